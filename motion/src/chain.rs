//! Forward kinematics of a serial chain of revolute joints.
//!
//! Sines and cosines come from `libm`, so that every machine computes the same pose.
//!
//! Source: Denavit and Hartenberg 1955 (standard rows); Craig, Introduction to Robotics, 3rd ed., section 3.4
//! (modified rows).
use crate::{JointArray, MAX_JOINTS};
use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

/// A pose: rotation and translation in metres.
pub type Pose = Isometry3<f64>;

/// One joint: frame = parent * pre * rotation(axis, q + offset) * post. Denavit-Hartenberg rows and the joints of a URDF,
/// fixed ones before and behind them included, are all of this form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainJoint {
    /// From the parent's frame to the joint.
    pub pre: Pose,
    /// Axis of rotation in the joint's frame, of unit length.
    pub axis: Unit<Vector3<f64>>,
    /// Angle added to the joint's position.
    pub offset_rad: f64,
    /// From the joint to the link's frame.
    pub post: Pose,
}

impl ChainJoint {
    /// Standard Denavit-Hartenberg row: Rz(q + theta) Tz(d) Tx(a) Rx(alpha).
    #[must_use]
    pub fn from_dh(a_m: f64, alpha_rad: f64, d_m: f64, theta_offset_rad: f64) -> Self {
        let post =
            Isometry3::from_parts(Translation3::new(a_m, 0.0, d_m), rotation(&Vector3::x_axis(), alpha_rad));
        Self { pre: Pose::identity(), axis: Vector3::z_axis(), offset_rad: theta_offset_rad, post }
    }
    /// Modified (Craig) row: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(q + theta) Tz(d).
    #[must_use]
    pub fn from_mdh(a_m: f64, alpha_rad: f64, d_m: f64, theta_offset_rad: f64) -> Self {
        // Rx and Tx share their axis, so their order does not matter.
        let pre =
            Isometry3::from_parts(Translation3::new(a_m, 0.0, 0.0), rotation(&Vector3::x_axis(), alpha_rad));
        let post = Pose::translation(0.0, 0.0, d_m);
        Self { pre, axis: Vector3::z_axis(), offset_rad: theta_offset_rad, post }
    }
}

/// What one rad/s of a joint does to the tip, in base coordinates: a column of the geometric Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Velocity of the tip's origin, m/s for each rad/s.
    pub linear_m: Vector3<f64>,
    /// Angular velocity of the tip: the joint's axis, of unit length.
    pub angular: Vector3<f64>,
}

impl Column {
    /// Of a joint that is not there, or does nothing.
    pub const ZERO: Self =
        Self { linear_m: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };
}

/// A serial chain of up to 8 joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    joints: [ChainJoint; MAX_JOINTS],
    count: usize,
}

impl Chain {
    /// Makes a chain of 1 to 8 joints; `None` otherwise.
    #[must_use]
    pub fn new(joints: &[ChainJoint]) -> Option<Self> {
        if !(1..=MAX_JOINTS).contains(&joints.len()) {
            return None;
        }
        let mut kept = [ChainJoint::from_dh(0.0, 0.0, 0.0, 0.0); MAX_JOINTS];
        for (slot, joint) in kept.iter_mut().zip(joints) {
            *slot = *joint;
        }
        Some(Self { joints: kept, count: joints.len() })
    }
    /// How many joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.count
    }
    /// A joint by its index, base first; `None` beyond the last.
    #[must_use]
    pub fn joint(&self, index: usize) -> Option<&ChainJoint> {
        self.joints.get(index).filter(|_| index < self.count)
    }
    /// The base frame (index 0, identity) and the frame after each joint; unused ones repeat the last.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn frames(&self, position_rad: &JointArray) -> [Pose; MAX_JOINTS + 1] {
        let mut frames = [Pose::identity(); MAX_JOINTS + 1];
        let mut tip = Pose::identity();
        let moves = self.joints.iter().zip(position_rad).take(self.count);
        let mut slots = frames.iter_mut().skip(1);
        for ((joint, angle_rad), slot) in moves.zip(slots.by_ref()) {
            let turn = rotation(&joint.axis, angle_rad + joint.offset_rad);
            tip = tip * joint.pre * turn * joint.post;
            *slot = tip;
        }
        for slot in slots {
            *slot = tip;
        }
        frames
    }
    /// The pose of the tip, and how each joint moves it: the geometric Jacobian in base coordinates, a column a joint;
    /// those of unused joints are zero.
    ///
    /// Real time: no allocation.
    ///
    /// Source: Siciliano et al., Robotics: Modelling, Planning and Control, section 3.1.3 (revolute joints).
    #[must_use]
    pub fn jacobian(&self, position_rad: &JointArray) -> (Pose, [Column; MAX_JOINTS]) {
        let frames = self.frames(position_rad);
        let [.., tip] = frames;
        let mut columns = [Column::ZERO; MAX_JOINTS];
        for ((column, joint), parent) in columns.iter_mut().zip(&self.joints).zip(&frames).take(self.count) {
            // A turn about the axis leaves the axis where it is, so the joint's own angle does not matter.
            let before = parent * joint.pre;
            let angular = before.rotation * joint.axis.into_inner();
            let arm_m = tip.translation.vector - before.translation.vector;
            *column = Column { linear_m: angular.cross(&arm_m), angular };
        }
        (tip, columns)
    }
}

/// Rotation about an axis of unit length.
fn rotation(axis: &Unit<Vector3<f64>>, angle_rad: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = libm::sincos(0.5 * angle_rad);
    Unit::new_unchecked(Quaternion::from_parts(cos, axis.into_inner() * sin))
}
