//! The two limit sets of a joint, and the proof that a trajectory stays inside one.
//!
//! `motion` limits are what plans use; `stop` limits are what the mechanics withstand. Their difference is the
//! room in which pauses and stops slow the arm down along its path (docs/adr).
use crate::digits::Decimals;
use crate::{JointArray, MAX_JOINTS, Trajectory};

/// Largest absolute velocity, acceleration and jerk of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimitSet {
    /// Largest |velocity|.
    pub velocity_rad_s: f64,
    /// Largest |acceleration|.
    pub acceleration_rad_s2: f64,
    /// Largest |jerk|.
    pub jerk_rad_s3: f64,
}

/// What one joint may do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointLimits {
    /// Lowest and highest angle.
    pub position_rad: [f64; 2],
    /// What plans use.
    pub motion: LimitSet,
    /// What the mechanics withstand; same velocity, higher acceleration and jerk.
    pub stop: LimitSet,
}

/// Which quantity a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Angle, rad.
    Position,
    /// Angular velocity, rad/s.
    Velocity,
    /// Angular acceleration, rad/s^2.
    Acceleration,
    /// Angular jerk, rad/s^3.
    Jerk,
}

/// The first limit that a trajectory exceeds.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{quantity:?} limit of joint {} {} at t = {at_s:.3} s: {} against {}", joint + 1,
    if *proven { "exceeded" } else { "not proven to hold (its bound is given)" },
    Decimals::apart(&[*value, *limit], 6).show(*value), Decimals::apart(&[*value, *limit], 6).show(*limit))]
pub struct LimitViolation {
    /// Zero-based index of the joint.
    pub joint: usize,
    /// What is exceeded.
    pub quantity: Quantity,
    /// When, in trajectory time.
    pub at_s: f64,
    /// The value there.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// True when `value` is reached; false when the work allowed for the proof ran out, and `value` is the bound
    /// that could not be brought below the limit.
    pub proven: bool,
}

/// Largest absolute values over a whole trajectory, as proven upper bounds, one a joint: as a rule at most 0.1 % (or a
/// millionth of the limit) above the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peaks {
    /// Upper bound of |velocity|.
    pub velocity_rad_s: JointArray,
    /// Upper bound of |acceleration|.
    pub acceleration_rad_s2: JointArray,
    /// Upper bound of |jerk|.
    pub jerk_rad_s3: JointArray,
}

/// Proves that a trajectory keeps the motion limits (and the position limits) of every joint.
///
/// Exact up to a relative [`TOLERANCE`]; positions have the tolerance of [`crate::range`]. Between samples a bound of a
/// higher derivative says what can happen. Its work is bounded; what it cannot prove it refuses. A joint whose base is
/// outside its range must come inside, and may only move inwards until it is.
///
/// # Errors
/// The first violation in time, at its worst instant.
pub fn check_motion(
    trajectory: &Trajectory,
    limits: &[JointLimits; MAX_JOINTS],
) -> Result<Peaks, LimitViolation> {
    crate::proof::check(trajectory, limits, 0.0)
}

/// Like [`check_motion`], from `begin_s` on: for a replacement, which runs from its cut on. What its strokes would do before
/// is not run and not checked. The joint's entry counts from the pose at `begin_s`.
///
/// # Errors
/// The first violation in time, at its worst instant.
pub fn check_motion_from(
    trajectory: &Trajectory,
    limits: &[JointLimits; MAX_JOINTS],
    begin_s: f64,
) -> Result<Peaks, LimitViolation> {
    crate::proof::check(trajectory, limits, begin_s)
}

/// Relative excess that [`check_motion`] lets pass, so that a motion timed exactly to a limit is not refused
/// for rounding.
pub const TOLERANCE: f64 = 1e-6;
