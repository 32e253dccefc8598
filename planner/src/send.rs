//! Hands a trajectory to the streamer and waits for its receipt.
use std::time::Duration;
use taustream_arm::Robot;
use taustream_messages::Receipt;
use taustream_messages::service::{ServiceError, Wire};
use taustream_motion::Trajectory;

/// A trajectory that was published.
#[derive(Clone, Debug, PartialEq)]
pub struct SentTrajectory {
    /// Its id.
    pub trajectory_id: u64,
    /// Its generation.
    pub generation: u64,
    /// The streamer's answer; `None` when none came in time.
    pub receipt: Option<Receipt>,
}

/// Why a trajectory was not sent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SendError {
    /// Shared memory, or no streamer.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The streamer drives another robot.
    #[error("the streamer drives another robot (digest {streamer}, ours is {ours}); use its robot file")]
    WrongRobot {
        /// The streamer's digest.
        streamer: String,
        /// Ours.
        ours: String,
    },
    /// Publishing failed.
    #[error("the trajectory could not be published: {why}")]
    Publish {
        /// iceoryx2's reason.
        why: String,
    },
}

/// Publishes a trajectory from rest under the next generation, and waits up to `timeout` for its receipt.
///
/// # Errors
/// When no streamer runs, it drives another robot, or shared memory refuses.
pub fn send_trajectory(
    _wire: &Wire,
    _robot: &Robot,
    _trajectory: &Trajectory,
    _timeout: Duration,
) -> Result<SentTrajectory, SendError> {
    todo!("planner")
}
