//! The proof that a trajectory keeps the limits and the distance to everything, along its whole length.
use taustream_arm::{Robot, Scene};
use taustream_motion::Trajectory;
use taustream_motion::limits::{LimitViolation, Peaks};

/// What was proven about a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// How long it takes at full speed.
    pub duration_s: f64,
    /// Least distance to any obstacle, or between links that may not touch: a proven lower bound, at most 1 mm
    /// below the truth. Infinite when nothing can collide.
    pub clearance_m: f64,
    /// Where along the motion the arm is closest, to the resolution of the proof.
    pub clearance_at_s: f64,
    /// What is closest there: a link, and an obstacle or another link. Empty when nothing can collide.
    pub clearance_between: (String, String),
    /// Proven upper bounds of velocity, acceleration and jerk.
    pub peaks: Peaks,
}

/// Two things that are closer than they may be.
#[derive(Clone, Debug, PartialEq)]
pub struct Contact {
    /// A link, and an obstacle or another link.
    pub between: (String, String),
    /// Their distance; negative when they overlap and the depth is known.
    pub distance_m: f64,
    /// The distance that they must keep: the scene's margin for obstacles, 0 between links.
    pub required_m: f64,
}

impl std::fmt::Display for Contact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ((a, b), distance_m, required_m) = (&self.between, self.distance_m, self.required_m);
        if distance_m <= 0.0 {
            write!(f, "{a} touches {b}")?;
        } else {
            write!(f, "{a} is {distance_m:.4} m from {b}")?;
        }
        write!(f, " ({required_m:.4} m required)")
    }
}

/// The first reason why a trajectory is not proven safe.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Violation {
    /// Made for an arm with another number of joints.
    #[error("the trajectory moves {got} joints, the robot has {expected}")]
    Joints {
        /// Of the trajectory.
        got: usize,
        /// Of the robot.
        expected: usize,
    },
    /// A limit is exceeded.
    #[error("joint {} ({name}): {violation}", violation.joint + 1)]
    Limit {
        /// The joint's name.
        name: String,
        /// The joint, quantity, time, value and limit.
        violation: LimitViolation,
    },
    /// Two things come too close.
    #[error("collision from t = {from_s:.3} s: {contact} at t = {at_s:.3} s")]
    Collision {
        /// First instant at which the distance is not proven to be enough.
        from_s: f64,
        /// Instant of the contact that is stated: the deepest of a sampling.
        at_s: f64,
        /// What touches what, and by how much.
        contact: Contact,
    },
    /// The proof ran out of work; nothing is known to be wrong.
    #[error("not proven: {checks} checks did not settle t = {at_s:.3} s; keep more distance there")]
    Unresolved {
        /// How many poses were checked.
        checks: usize,
        /// The instant that the proof had reached.
        at_s: f64,
    },
}

/// Proves that a trajectory keeps the motion limits, the position ranges and the distance to everything.
///
/// # Errors
/// The first violation, with joint or pair, time and amount.
pub fn verify(_robot: &Robot, _scene: &Scene, _trajectory: &Trajectory) -> Result<Proof, Violation> {
    todo!("planner")
}
