//! The sets of limits under which motions are timed: those of robots, and some like other arms'.
use crate::arm;
use crate::failure::Failure;
use std::path::PathBuf;
use taustream_motion::{JointLimits, LimitSet, MAX_JOINTS};

/// Limits under a name.
pub(super) struct LimitedArm {
    pub(super) name: String,
    pub(super) joints: usize,
    pub(super) limits: [JointLimits; MAX_JOINTS],
}

/// Those of the robots given, and those like other arms'.
pub(super) fn limit_sets(robots: &[PathBuf]) -> Result<Vec<LimitedArm>, Failure> {
    let mut arms = Vec::new();
    for given in robots {
        let robot = arm::robot(given)?;
        arms.push(LimitedArm {
            name: robot.name.clone(),
            joints: robot.joints.len(),
            limits: robot.limits(),
        });
    }
    arms.push(even("like a Panda: 2.175, 15, 7500", [2.175, 15.0, 7500.0]));
    arms.push(even("gentle: 3, 2, 10", [3.0, 2.0, 10.0]));
    arms.push(even("slow: 0.5, 15, 150", [0.5, 15.0, 150.0]));
    Ok(arms)
}

/// Six joints of the same limits.
fn even(name: &str, [velocity_rad_s, acceleration_rad_s2, jerk_rad_s3]: [f64; 3]) -> LimitedArm {
    let motion = LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 };
    let joint = JointLimits { motion, stop: motion, ..JointLimits::default() };
    LimitedArm { name: name.to_owned(), joints: 6, limits: [joint; MAX_JOINTS] }
}
