//! The accepted trajectory that waits until the running one reaches its cut.
//!
//! One waits at most. A newer one takes its place: it cuts the running trajectory at a cut that is still ahead, or it cuts
//! the waiting one, at a time that it runs; then it takes over where the one that waited would have. Whether a message
//! repeats bit by bit what it keeps is decided here, in the cycle that takes it: only the cycle knows what runs.
use crate::intake::Boxed;
use taustream_messages::{Phase, Rejection, Replaces};
use taustream_motion::Setpoint;
use taustream_motion::cut::{KeptDifference, difference};
use taustream_motion::trajectory::Cursor;

/// Why a cut is refused: what only the moment can tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CutRefusal {
    /// The last setpoint sent lies behind the cut.
    Passed {
        /// The cut.
        at_s: f64,
        /// By how much.
        by_s: f64,
    },
    /// The trajectory is not run at the cut.
    Outside {
        /// The cut.
        at_s: f64,
        /// From when it is run.
        begins_s: f64,
        /// When it ends.
        ends_s: f64,
    },
    /// The trajectory that it cuts neither runs nor waits.
    OtherTrajectory {
        /// The one that it cuts.
        cut: u64,
        /// The one that runs.
        running: u64,
    },
    /// Nothing runs, or it comes to rest for good.
    NothingToCut {
        /// The phase.
        phase: Phase,
    },
    /// A change of speed runs that would leave the stop limits on it.
    SpeedChanges,
    /// It does not repeat what it keeps.
    Kept(KeptDifference),
}

impl CutRefusal {
    /// The receipt's reason.
    #[must_use]
    pub fn rejection(self) -> Rejection {
        let index = |index: usize| u32::try_from(index).unwrap_or(u32::MAX);
        match self {
            Self::Passed { at_s, by_s } => Rejection::CutPassed { at_s, by_s },
            Self::Outside { at_s, begins_s, ends_s } => Rejection::CutOutside { at_s, begins_s, ends_s },
            Self::OtherTrajectory { cut, running } => Rejection::OtherTrajectory { cut, running },
            Self::NothingToCut { phase } => Rejection::NothingToCut { phase: Some(phase) },
            Self::SpeedChanges => Rejection::SpeedChanges,
            Self::Kept(KeptDifference::Stroke(stroke)) => {
                Rejection::KeptStrokesDiffer { stroke: index(stroke) }
            }
            Self::Kept(KeptDifference::Base { joint, by_rad }) => {
                Rejection::KeptBaseDiffers { joint: index(joint), by_rad }
            }
        }
    }
}

/// A trajectory with the trajectory time at which it takes over.
#[derive(Debug)]
pub struct Waiting {
    /// The trajectory.
    pub trajectory: Boxed,
    /// From this trajectory time on it is sampled.
    pub from_s: f64,
    /// Samples it.
    pub cursor: Cursor,
}

/// The place of the trajectory that waits.
#[derive(Debug, Default)]
pub struct Successor {
    waiting: Option<Waiting>,
}

impl Successor {
    /// The trajectory that waits.
    #[must_use]
    pub fn waiting(&self) -> Option<&Waiting> {
        self.waiting.as_ref()
    }

    /// From which trajectory time an offered replacement holds, when the running trajectory has been sent up to `s`.
    ///
    /// Real time: no allocation; looks at every kept stroke once.
    ///
    /// # Errors
    /// Why it is not taken.
    pub fn check(&self, offer: &Boxed, (running, s): (&Boxed, f64)) -> Result<f64, CutRefusal> {
        let Replaces::Cut { trajectory_id, at_s } = offer.replaces else { return Ok(0.0) };
        let waiting =
            self.waiting.as_ref().filter(|waiting| waiting.trajectory.trajectory_id == trajectory_id);
        let (cut, begins_s, from_s) = match waiting {
            Some(waiting) => (&waiting.trajectory, waiting.from_s, waiting.from_s),
            None if running.trajectory_id == trajectory_id => (running, 0.0, at_s),
            None => {
                let (cut, running) = (trajectory_id, running.trajectory_id);
                return Err(CutRefusal::OtherTrajectory { cut, running });
            }
        };
        let ends_s = cut.trajectory.duration_s();
        // Written so that a NaN is refused.
        if !(begins_s <= at_s && at_s <= ends_s && at_s <= offer.trajectory.duration_s()) {
            return Err(CutRefusal::Outside { at_s, begins_s, ends_s });
        }
        if from_s < s {
            return Err(CutRefusal::Passed { at_s, by_s: s - from_s });
        }
        match difference(&cut.trajectory, &offer.trajectory, (at_s, from_s)) {
            Some(difference) => Err(CutRefusal::Kept(difference)),
            None => Ok(from_s),
        }
    }

    /// Lets a checked replacement wait for `from_s`. Returns the box of the one that waited.
    ///
    /// Real time: moves pointers.
    pub fn put(&mut self, trajectory: Boxed, from_s: f64) -> Option<Boxed> {
        let cursor = Cursor::at_start(&trajectory.trajectory);
        let waiting = Waiting { trajectory, from_s, cursor };
        self.waiting.replace(waiting).map(|waiting| waiting.trajectory)
    }

    /// True when the waiting trajectory is the one to sample at `s`.
    #[must_use]
    pub fn takes_over_at(&self, s: f64) -> bool {
        self.waiting.as_ref().is_some_and(|waiting| s >= waiting.from_s)
    }

    /// The waiting trajectory's setpoint at `s`, or nothing when none waits.
    ///
    /// Real time: touches the strokes that run; the first time, those that have ended, too.
    pub fn sample(&mut self, s: f64) -> Option<Setpoint> {
        let waiting = self.waiting.as_mut()?;
        Some(waiting.cursor.sample(&waiting.trajectory.trajectory, s))
    }

    /// Empties the place.
    ///
    /// Real time: moves pointers; nothing is freed.
    pub fn take(&mut self) -> Option<Waiting> {
        self.waiting.take()
    }
}
