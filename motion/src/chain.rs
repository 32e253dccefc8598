//! Forward kinematics of a serial chain of revolute joints.
use crate::{JointArray, MAX_JOINTS};

/// A pose: rotation and translation in metres.
pub type Pose = nalgebra::Isometry3<f64>;

/// One joint: frame = parent * pre * rotation(axis, q + offset) * post.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainJoint {
    /// From the parent's frame to the joint.
    pub pre: Pose,
    /// Axis of rotation in the joint's frame, of unit length.
    pub axis: nalgebra::Unit<nalgebra::Vector3<f64>>,
    /// Angle added to the joint's position.
    pub offset_rad: f64,
    /// From the joint to the link's frame.
    pub post: Pose,
}

impl ChainJoint {
    /// Standard Denavit-Hartenberg row: Rz(q + theta) Tz(d) Tx(a) Rx(alpha).
    #[must_use]
    pub fn from_dh(_a_m: f64, _alpha_rad: f64, _d_m: f64, _theta_offset_rad: f64) -> Self {
        todo!("motion")
    }
    /// Modified (Craig) row: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(q + theta) Tz(d).
    #[must_use]
    pub fn from_mdh(_a_m: f64, _alpha_rad: f64, _d_m: f64, _theta_offset_rad: f64) -> Self {
        todo!("motion")
    }
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
    pub fn new(_joints: &[ChainJoint]) -> Option<Self> {
        todo!("motion")
    }
    /// How many joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.count
    }
    /// The base frame (index 0, identity) and the frame after each joint; unused ones repeat the last.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn frames(&self, _position_rad: &JointArray) -> [Pose; MAX_JOINTS + 1] {
        todo!("motion")
    }
}
