//! Poses on the way, and how far from its corners a motion may pass: the options that `plan`, `replan` and `import` share.
use crate::angles::Angles;
use crate::failure::Failure;
use clap::Args;
use taustream_arm::{Group, Robot};
use taustream_motion::JointArray;
use taustream_planner::Blend;

/// How far from corners a motion may pass.
#[derive(Args, Debug)]
pub(crate) struct BlendArgs {
    /// How far from its path the motion may be at corners: length of the difference of all joints, rad; 0 stops at each.
    ///
    /// Without it, corners are rounded as far as the scene's margins allow, up to 0.4 rad.
    #[arg(long, value_name = "RAD", allow_negative_numbers = true, value_parser = blend_amount)]
    pub(crate) blend_rad: Option<f64>,
    /// The same as a distance by which any point of the arm may be off, m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, conflicts_with = "blend_rad", value_parser = blend_amount)]
    pub(crate) blend_m: Option<f64>,
}

/// Poses on the way.
#[derive(Args, Debug)]
pub(crate) struct ViaArgs {
    /// Pose to pass on the way, rad; give it once for each pose, in their order.
    ///
    /// The motion keeps within the blend of the straight lines that join the poses.
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true)]
    via: Vec<Angles>,
    /// How far from them.
    #[command(flatten)]
    blend: BlendArgs,
}

impl BlendArgs {
    /// True when one of the options was given.
    pub(crate) fn is_given(&self) -> bool {
        self.blend_rad.is_some() || self.blend_m.is_some()
    }

    /// How far from its corners the motion may pass.
    pub(crate) fn blend(&self) -> Blend {
        let in_metres = self.blend_m.map(Blend::Metres);
        self.blend_rad.map(Blend::Radians).or(in_metres).unwrap_or_default()
    }
}

impl ViaArgs {
    /// The poses, with the numbers of a robot.
    ///
    /// # Errors
    /// Not one value a joint of the group, or of the robot without one.
    pub(crate) fn poses_of(
        &self,
        of: (&Robot, Option<&Group>),
        others_rad: &JointArray,
    ) -> Result<Vec<JointArray>, Failure> {
        self.via.iter().map(|via| via.pose_in(of, others_rad, "--via")).collect()
    }

    /// How far from its corners the motion may pass.
    pub(crate) fn blend(&self) -> Blend {
        self.blend.blend()
    }

    /// The options that were given, for a kind of goal that takes none of them.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let names = [
            (!self.via.is_empty(), "--via"),
            (self.blend.blend_rad.is_some(), "--blend-rad"),
            (self.blend.blend_m.is_some(), "--blend-m"),
        ];
        names.into_iter().find(|(given, _)| *given).map(|(_, name)| name)
    }
}

/// A distance from a corner.
fn blend_amount(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(amount) if (0.0..=10.0).contains(&amount) => Ok(amount),
        _ => Err("expected a number from 0 to 10".to_owned()),
    }
}
