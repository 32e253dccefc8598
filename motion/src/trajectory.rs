//! A checked sum of strokes over a base pose.
//!
//! q(t) = base + sum of delta_i * phi_i(t), added in the order of the strokes, so that every reader of the
//! same message computes the same bits.
use crate::stroke::{Stroke, StrokeError};
use crate::{JointArray, MAX_JOINTS, MAX_STROKES, Setpoint};

/// A checked trajectory: 1 to 8 joints, up to 512 strokes sorted by start. Fields are private so that an
/// unchecked one cannot exist.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    joints: usize,
    base_rad: JointArray,
    strokes: [Stroke; MAX_STROKES],
    count: usize,
}

/// Why numbers do not make a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// Not 1 to 8 joints.
    #[error("{joints} joints; an arm has 1 to {MAX_JOINTS}")]
    JointCount {
        /// The count that was given.
        joints: usize,
    },
    /// Too many strokes.
    #[error("{strokes} strokes; a trajectory has at most {MAX_STROKES}")]
    StrokeCount {
        /// The count that was given.
        strokes: usize,
    },
    /// The base pose is not finite, or an unused joint of it is not zero.
    #[error("base_rad of joint {joint} is {value_rad}; it must be finite, and zero beyond the arm's joints")]
    Base {
        /// Zero-based index of the joint.
        joint: usize,
        /// The value that was given.
        value_rad: f64,
    },
    /// Strokes are not sorted by start.
    #[error("stroke {stroke} starts before the one in front of it; strokes are sorted by start_s")]
    NotSorted {
        /// Zero-based index of the later stroke.
        stroke: usize,
    },
    /// One stroke is at fault.
    #[error("stroke {stroke}: {error}")]
    Stroke {
        /// Zero-based index of the stroke.
        stroke: usize,
        /// What is wrong with it.
        error: StrokeError,
    },
}

impl Trajectory {
    /// Checks the numbers and makes a trajectory of them.
    ///
    /// # Errors
    /// The first fault, with the stroke and the joint.
    pub fn new(_joints: usize, _base_rad: JointArray, _strokes: &[Stroke]) -> Result<Self, TrajectoryError> {
        todo!("motion")
    }
    /// How many joints the arm has.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }
    /// The pose before the first stroke.
    #[must_use]
    pub fn base_rad(&self) -> &JointArray {
        &self.base_rad
    }
    /// The strokes, sorted by start.
    #[must_use]
    pub fn strokes(&self) -> &[Stroke] {
        self.strokes.get(..self.count).unwrap_or(&[])
    }
    /// When the last stroke has ended; 0 without strokes.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        todo!("motion")
    }
    /// The pose after the last stroke.
    #[must_use]
    pub fn end_rad(&self) -> JointArray {
        todo!("motion")
    }
    /// Position, velocity, acceleration and jerk at trajectory time `t_s`; at rest before and after.
    ///
    /// Real time: no allocation; time grows with the number of strokes (see [`Cursor`]).
    #[must_use]
    pub fn sample(&self, _t_s: f64) -> Setpoint {
        todo!("motion")
    }
}

/// Samples one trajectory at times that never fall; skips strokes that have ended, with the same bits as
/// [`Trajectory::sample`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Cursor {
    /// Strokes in front of this one have ended.
    pub first: usize,
    /// Pose after the strokes that have ended.
    pub reached_rad: JointArray,
}

impl Cursor {
    /// Starts at the base of a trajectory.
    #[must_use]
    pub fn at_start(_trajectory: &Trajectory) -> Self {
        todo!("motion")
    }
    /// Like [`Trajectory::sample`]; a `t_s` that went back starts over.
    ///
    /// Real time: touches only strokes that are running or end in this step.
    pub fn sample(&mut self, _trajectory: &Trajectory, _t_s: f64) -> Setpoint {
        todo!("motion")
    }
}
