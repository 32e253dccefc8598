//! Where the tip shall end: a position, with or without an orientation, each within a tolerance.
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use taustream_arm::Robot;
use taustream_motion::JointArray;
use taustream_motion::chain::Pose;

/// A pose counts as there when its tip is no farther off than this, or than the tolerance if that is more.
pub const ERROR_M_MAX: f64 = 1e-6;
/// The same for the turn of the tip.
pub const ERROR_RAD_MAX: f64 = 1e-6;
/// Share of a tolerance that is aimed at, so that rounding does not decide whether a pose is inside.
const AIM: f64 = 0.9;

/// Where a tip of the robot shall end, in the base's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipTarget {
    /// Which one, counted from 0: a serial arm has one.
    pub tip: usize,
    /// Where it shall be.
    pub position_m: [f64; 3],
    /// How far off it may be.
    pub tolerance_m: f64,
    /// How it shall be turned; `None` leaves that free.
    pub orientation: Option<Orientation>,
}

/// How the tip shall be turned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// The tip's axes in the base's frame.
    pub rotation: UnitQuaternion<f64>,
    /// How far it may be turned about its own x, y and z axis (components of the rotation vector); infinite is free.
    pub tolerance_rad: [f64; 3],
}

impl TipTarget {
    /// A position of the first tip, however that is turned.
    #[must_use]
    pub fn position(position_m: [f64; 3]) -> Self {
        Self { tip: 0, position_m, tolerance_m: 0.0, orientation: None }
    }

    /// The tip's frame; that of the first tip for one that is not there, which is refused before.
    pub(super) fn frame(&self, robot: &Robot) -> usize {
        robot.chain.tips().get(self.tip).copied().unwrap_or(robot.chain.tip_frame())
    }

    /// How far the tip of a pose is off, beyond no tolerance.
    #[must_use]
    pub fn error(&self, robot: &Robot, pose_rad: &JointArray) -> TipError {
        let tip = robot.chain.frame(self.frame(robot), pose_rad);
        let position_m = (Vector3::from(self.position_m) - tip.translation.vector).norm();
        let turned_rad = self.orientation.map(|o| o.off_rad(&tip));
        TipError { position_m, turned_rad }
    }

    /// True when the tip of a pose is where it shall be, within the tolerances.
    #[must_use]
    pub fn is_reached(&self, error: &TipError) -> bool {
        let is_turned = match (self.orientation, error.turned_rad) {
            (Some(orientation), Some(off_rad)) => {
                let axes = off_rad.iter().zip(orientation.tolerance_rad);
                axes.into_iter().all(|(off, tolerance)| off.abs() <= tolerance.max(ERROR_RAD_MAX))
            }
            _ => true,
        };
        is_turned && error.position_m <= self.tolerance_m.max(ERROR_M_MAX)
    }

    /// What is left to a frame: position, m, then turn in the target's axes, rad, each only as far as it is outside its
    /// tolerance.
    pub(crate) fn left(&self, tip: &Pose) -> Vector6<f64> {
        let off_m = Vector3::from(self.position_m) - tip.translation.vector;
        let far_m = off_m.norm();
        let beyond = far_m - AIM * self.tolerance_m;
        let off_m = if beyond > 0.0 { off_m * (beyond / far_m) } else { Vector3::zeros() };
        let off_rad = self.orientation.map_or_else(Vector3::zeros, |o| {
            let each = o.off_rad(tip);
            Vector3::from_fn(|i, _| {
                let (off, tolerance) = (each[i], AIM * o.tolerance_rad[i]);
                off.signum() * (off.abs() - tolerance).max(0.0)
            })
        });
        Vector6::new(off_m.x, off_m.y, off_m.z, off_rad.x, off_rad.y, off_rad.z)
    }
}

impl Orientation {
    /// The rotation vector from a frame's axes to the target's, in the target's axes.
    fn off_rad(&self, tip: &Pose) -> [f64; 3] {
        (tip.rotation.inverse() * self.rotation).scaled_axis().into()
    }
}

/// How far a tip is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TipError {
    /// Distance to the position.
    pub position_m: f64,
    /// Rotation vector about the target's axes; `None` where the orientation is free.
    pub turned_rad: Option<[f64; 3]>,
}

impl TipError {
    /// Length of the rotation vector, without the axes that are free.
    #[must_use]
    pub fn angle_rad(&self, target: &TipTarget) -> Option<f64> {
        let (off_rad, orientation) = (self.turned_rad?, target.orientation?);
        let bound = off_rad.iter().zip(orientation.tolerance_rad).filter(|(_, t)| t.is_finite());
        Some(bound.map(|(off, _)| off * off).sum::<f64>().sqrt())
    }
}
