//! Whether the torques that hold the arm are those of its masses: a payload that nobody stated, a wrong tool, a torque of the wrong
//! sign.
//!
//! At rest a drive bears the weight, and dry friction may add to that or take from it. Source of the first: [`Robot::dynamics`].
use crate::{Robot, Settings};
use taustream_motion::JointArray;

/// Dry friction of a joint of which none is stated, as a share of its greatest torque: geared joints have 3 to 8 percent.
const FRICTION_SHARE: f64 = 0.08;
/// How far torques by motor currents are off, as a share of the torque.
const READING_SHARE: f64 = 0.15;

/// A joint that is held by another torque than its masses ask for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "joint {} ({name}) is held by {measured_nm:.2} Nm, and the masses of the robot file ask for {modelled_nm:.2} Nm: {:.2} Nm apart, \
     {tolerance_nm:.2} Nm allowed",
    joint + 1,
    (measured_nm - modelled_nm).abs()
)]
pub struct HoldingMismatch {
    /// Zero-based index of the joint.
    pub joint: usize,
    /// Its name.
    pub name: String,
    /// What the drive reports.
    pub measured_nm: f64,
    /// What holds the masses of the robot file.
    pub modelled_nm: f64,
    /// What friction and the drive's reading may make of it.
    pub tolerance_nm: f64,
}

impl Settings {
    /// The joints of an arm at rest whose measured torques are not those of its masses.
    ///
    /// Left out are joints without a measured torque (NaN), and joints of which neither a greatest torque nor a friction is known.
    /// Empty for a robot whose masses are not known or cannot be right.
    #[must_use]
    pub fn holding_mismatches(&self, q_rad: &JointArray, torque_nm: &JointArray) -> Vec<HoldingMismatch> {
        let robot: &Robot = &self.robot;
        let Some(dynamics) = robot.dynamics().ok().filter(|_| robot.mass_doubt().is_none()) else {
            return Vec::new();
        };
        let modelled = dynamics.holding_nm(q_rad);
        let joints = robot.joints.iter().zip(modelled).zip(torque_nm).enumerate();
        joints
            .filter_map(|(index, ((joint, modelled_nm), measured_nm))| {
                let friction_nm = self.dry_friction_nm(index)?;
                let tolerance_nm = friction_nm + READING_SHARE * modelled_nm.abs();
                // A torque that is not measured is NaN, and no comparison holds for it.
                ((measured_nm - modelled_nm).abs() > tolerance_nm).then(|| HoldingMismatch {
                    joint: index,
                    name: joint.name.clone(),
                    measured_nm: *measured_nm,
                    modelled_nm,
                    tolerance_nm,
                })
            })
            .collect()
    }

    /// The friction that may hold a joint: as stated for its feed-forward, or a share of its greatest torque.
    fn dry_friction_nm(&self, joint: usize) -> Option<f64> {
        let stated = self.feed_forward.and_then(|wanted| *wanted.joints.get(joint)?);
        let stated_nm = stated.map(|joint| joint.coulomb_nm);
        let most_nm = self.robot.joints.get(joint)?.torque_nm_max.or(stated.map(|j| j.torque_nm_max));
        let usual_nm = most_nm.map(|most_nm| FRICTION_SHARE * most_nm);
        stated_nm.into_iter().chain(usual_nm).reduce(f64::max)
    }
}
