//! A checked trajectory with the table of what it does when, made off the real-time thread.
//!
//! A stop is chosen from this table in the cycle that asks for it (`taustream_motion::stopping`).
use std::ops::Deref;
use taustream_messages::CheckedTrajectory;
use taustream_motion::peaks_ahead::{AT_REST, PeaksAhead, Stretch, cell_count, fill, span_s};
use taustream_motion::{JointLimits, MAX_JOINTS};

/// A trajectory that the cycle can run and stop.
#[derive(Clone, Debug)]
pub struct PreparedTrajectory {
    checked: CheckedTrajectory,
    cells: Vec<Stretch>,
}

impl PreparedTrajectory {
    /// Makes the table of a trajectory that keeps the motion limits of an arm. Allocates.
    #[must_use]
    pub fn new(checked: CheckedTrajectory, limits: &[JointLimits; MAX_JOINTS]) -> Self {
        let mut cells = vec![AT_REST; cell_count(&checked.trajectory)];
        fill(&mut cells, &checked.trajectory, limits);
        Self { checked, cells }
    }

    /// Gives the same motion another id and generation.
    pub fn rename(&mut self, trajectory_id: u64, generation: u64) {
        (self.checked.trajectory_id, self.checked.generation) = (trajectory_id, generation);
    }

    /// What it does from an instant on.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn ahead(&self) -> PeaksAhead<'_> {
        PeaksAhead::new(&self.cells, span_s(&self.checked.trajectory))
    }

    /// The same up to `from_s`, and what its successor does from there on.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn ahead_into<'a>(&'a self, from_s: f64, successor: &'a Self) -> PeaksAhead<'a> {
        self.ahead().then(from_s, &successor.cells, span_s(&successor.checked.trajectory))
    }
}

impl Deref for PreparedTrajectory {
    type Target = CheckedTrajectory;

    fn deref(&self) -> &CheckedTrajectory {
        &self.checked
    }
}
