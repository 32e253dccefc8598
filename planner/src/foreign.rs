//! Trajectories that others have sent: what runs must be checked when the scene changes, whoever has sent it.
use crate::send::SendError;
use std::cell::RefCell;
use std::collections::VecDeque;
use taustream_messages::CheckedTrajectory;
use taustream_messages::service::{TrajectorySubscriber, Wire};
use taustream_motion::Trajectory;
use tracing::info;

/// Trajectories that are remembered: one runs, one waits, others were rejected.
const FOREIGN_MAX: usize = 8;

/// What goes to the streamer, as it is received here.
pub(crate) struct Foreign {
    trajectories: TrajectorySubscriber,
    /// Newest last.
    seen: RefCell<VecDeque<(u64, Trajectory)>>,
}

impl Foreign {
    pub(crate) fn open(wire: &Wire) -> Result<Self, SendError> {
        Ok(Self { trajectories: wire.trajectory_subscriber()?, seen: RefCell::default() })
    }

    /// Takes what was sent since the last look.
    pub(crate) fn look(&self) {
        loop {
            match self.trajectories.receive() {
                Ok(Some(sample)) => {
                    // Copied out before it is checked; what the streamer rejects is never asked for.
                    let message = Box::new(*sample.payload());
                    if let Ok(checked) = CheckedTrajectory::try_from(&*message) {
                        let mut seen = self.seen.borrow_mut();
                        if seen.len() == FOREIGN_MAX {
                            seen.pop_front();
                        }
                        seen.push_back((checked.trajectory_id, checked.trajectory));
                    }
                }
                Ok(None) => return,
                Err(e) => return info!("cannot receive trajectories: {e:?}"),
            }
        }
    }

    /// The strokes of a trajectory.
    pub(crate) fn known(&self, trajectory_id: u64) -> Option<Trajectory> {
        let seen = self.seen.borrow();
        seen.iter().rev().find(|(id, _)| *id == trajectory_id).map(|(_, trajectory)| trajectory.clone())
    }
}
