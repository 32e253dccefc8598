//! Poses that a motion passes on its way to the goal, and how far from its corners it may pass.
use crate::plan::PlanRequestError;
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Most way points of a request.
pub const WAY_POINTS_MAX: usize = 16;
/// Kinds of a blend.
const CLEARANCE: u32 = 0;
const RADIANS: u32 = 1;
const METRES: u32 = 2;

/// How far from its path a motion may be where it rounds corners.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Blend {
    /// As far as the scene's margins allow, up to 0.4 rad.
    #[default]
    Clearance,
    /// The length of the difference of all joints, rad; 0 stops at each corner.
    Radians(f64),
    /// How far any point of the arm may be from where it would be on the path, m; 0 stops at each corner.
    Metres(f64),
}

/// Way points and blend on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub(crate) struct WayPointsWire {
    count: u32,
    blend_kind: u32,
    blend: f64,
    poses_rad: [[f64; MAX_JOINTS]; WAY_POINTS_MAX],
}

impl WayPointsWire {
    /// Writes down what a request asks for. Its count says when there are more than fit; they are refused on reading.
    pub(crate) fn new(via_rad: &[JointArray], blend: Blend) -> Self {
        let (blend_kind, blend) = match blend {
            Blend::Clearance => (CLEARANCE, 0.0),
            Blend::Radians(most_rad) => (RADIANS, most_rad),
            Blend::Metres(most_m) => (METRES, most_m),
        };
        let mut poses_rad = [[0.0; MAX_JOINTS]; WAY_POINTS_MAX];
        poses_rad.iter_mut().zip(via_rad).for_each(|(pose, via)| *pose = *via);
        let count = u32::try_from(via_rad.len()).unwrap_or(u32::MAX);
        Self { count, blend_kind, blend, poses_rad }
    }

    /// The way points and the blend, checked for an arm with so many joints.
    pub(crate) fn read(&self, joints: usize) -> Result<(Vec<JointArray>, Blend), PlanRequestError> {
        let count = usize::try_from(self.count).unwrap_or(usize::MAX);
        let via_rad = self.poses_rad.get(..count).ok_or(PlanRequestError::WayPoints { got: self.count })?;
        for (point, pose_rad) in via_rad.iter().enumerate() {
            for (joint, &value_rad) in pose_rad.iter().enumerate() {
                if !value_rad.is_finite() || (joint >= joints && value_rad != 0.0) {
                    return Err(PlanRequestError::WayPoint { point, joint, value_rad });
                }
            }
        }
        if !(self.blend.is_finite() && self.blend >= 0.0) {
            return Err(PlanRequestError::Blend { value: self.blend });
        }
        let blend = match self.blend_kind {
            CLEARANCE => Blend::Clearance,
            RADIANS => Blend::Radians(self.blend),
            METRES => Blend::Metres(self.blend),
            got => return Err(PlanRequestError::BlendKind { got }),
        };
        Ok((via_rad.to_vec(), blend))
    }
}
