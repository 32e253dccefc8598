//! What was measured in one pose at rest, as files keep it.
use crate::failure::Failure;
use serde::{Deserialize, Serialize};
use std::path::Path;
use taustream_arm::mass_fit::HeldPose;
use taustream_arm::{Robot, shipped};
use taustream_motion::MAX_JOINTS;

/// One pose; a number for every joint.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub(super) struct Held {
    pub(super) q_rad: Vec<f64>,
    /// Mean of two approaches from opposite sides.
    pub(super) torque_nm: Vec<f64>,
    /// Half the difference of the two.
    pub(super) friction_nm: Vec<f64>,
}

/// What is read of the answer of a calibration.
#[derive(Deserialize)]
struct Kept {
    robot: String,
    digest: String,
    held: Vec<Held>,
}

/// Most poses that are read.
const POSES_MAX: usize = 1000;

impl Held {
    /// As the fit takes it.
    pub(super) fn pose(&self) -> HeldPose {
        let of = |values: &[f64]| {
            let mut array = [0.0; MAX_JOINTS];
            array.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
            array
        };
        HeldPose { q_rad: of(&self.q_rad), torque_nm: of(&self.torque_nm) }
    }
}

/// Reads the poses of a file that `-o` or `--json` wrote.
///
/// # Errors
/// When it is no such file, or was measured on another robot.
pub(super) fn read(file: &Path, robot: &Robot) -> Result<Vec<Held>, Failure> {
    let text = shipped::read_text(file)?;
    let kept: Kept = serde_json::from_str(&text).map_err(|e| {
        Failure::unfit(file, format!("is no answer of `taustream calibrate gravity` (-o or --json): {e}"))
    })?;
    if kept.digest != robot.digest_hex() {
        let why = format!(
            "was measured on robot `{}` with digest {}; the settings name `{}` with {}, whose geometry or limits are others",
            kept.robot,
            kept.digest,
            robot.name,
            robot.digest_hex()
        );
        return Err(Failure::unfit(file, why));
    }
    let joints = robot.joints.len();
    let is_whole = |held: &Held| {
        [&held.q_rad, &held.torque_nm, &held.friction_nm].iter().all(|values| values.len() == joints)
    };
    if let Some(at) = kept.held.iter().position(|held| !is_whole(held)) {
        let why = format!("pose {} has not {joints} numbers in each of its lists", at + 1);
        return Err(Failure::unfit(file, why));
    }
    if kept.held.len() > POSES_MAX {
        return Err(Failure::unfit(file, format!("holds {} poses, more than {POSES_MAX}", kept.held.len())));
    }
    Ok(kept.held)
}
