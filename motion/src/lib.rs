//! Strokes, profiles, limits, time scale, brake and chain kinematics.
//!
//! This crate says where an arm is at an instant, and how fast that may change. It does no I/O, reads no
//! clock, allocates nothing and does not panic, so the 1 kHz cycle may call every sampling function in it.
//! Angles are link-side radians, times are seconds, lengths are metres. Where a name of all joints ends in `_rad`, the value of a
//! prismatic joint is in metres (and its derivatives likewise): see [`JointKind`].
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod axis;
pub mod brake;
pub mod chain;
pub mod cut;
pub mod digits;
pub mod duration;
pub mod dynamics;
mod joint_array;
mod joint_kind;
pub mod limits;
pub mod peaks;
pub mod peaks_ahead;
mod polynomial;
pub mod profile;
mod profile_derivatives;
mod proof;
pub mod ramp;
pub mod range;
pub mod smoothing;
pub mod spline;
pub mod stopping;
pub mod stroke;
pub mod time_scale;
pub mod trajectory;

pub use joint_array::joint_array;
pub use joint_kind::JointKind;
pub use limits::{JointLimits, LimitSet};
pub use stroke::{Stroke, StrokeError};
pub use trajectory::{Trajectory, TrajectoryError};

/// Most joints an arm may have; unused slots of a [`JointArray`] are zero.
pub const MAX_JOINTS: usize = 16;

/// Most arms have no more joints: what is computed in vectors takes arrays of this length for them.
pub const USUAL_JOINTS: usize = MAX_JOINTS / 2;

/// Most strokes a trajectory may have.
pub const MAX_STROKES: usize = 512;

/// One value a joint, base to tip, in the unit that the owner's name states; for a prismatic joint with metres in place of radians.
pub type JointArray = [f64; MAX_JOINTS];

/// Where all joints are, and how they move, at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Link angles from the calibrated zero.
    pub position_rad: JointArray,
    /// First derivative of the angles by time.
    pub velocity_rad_s: JointArray,
    /// Second derivative of the angles by time.
    pub acceleration_rad_s2: JointArray,
    /// Third derivative of the angles by time.
    pub jerk_rad_s3: JointArray,
}
