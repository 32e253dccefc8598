//! What `check` prints of feed-forward torques.
use serde::Serialize;
use std::fmt;
use taustream_arm::rng::SeededRng;
use taustream_arm::{JointTorque, Robot, Settings};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Random poses in which the torque that holds the arm is looked at.
const POSES: u32 = 10_000;

/// The section `[feed_forward]` under the keys of the settings file.
#[derive(Debug, Serialize)]
pub(super) struct FeedForwardLine {
    gravity: bool,
    inertia: bool,
    share: f64,
    joints: Vec<JointLine>,
}

/// One joint that gets a torque.
#[derive(Debug, Serialize)]
struct JointLine {
    joint: String,
    torque_nm_max: f64,
    rate_nm_s_max: f64,
    coulomb_nm: f64,
    viscous_nm_s_rad: f64,
    /// The greatest torque that its share of gravity needs, in random poses; none where gravity is not compensated.
    gravity_nm_max: Option<f64>,
}

impl FeedForwardLine {
    pub(super) fn of(settings: &Settings) -> Option<Self> {
        let wanted = settings.feed_forward?;
        let holding_nm = wanted.gravity.then(|| holding_nm_max(&settings.robot)).flatten();
        let line = |(joint, torque): (usize, &Option<JointTorque>)| {
            let JointTorque { torque_nm_max, rate_nm_s_max, coulomb_nm, viscous_nm_s_rad } = (*torque)?;
            let gravity_nm_max = holding_nm.and_then(|all| Some(wanted.share * all.get(joint)?));
            let joint = settings.robot.joints.get(joint)?.name.clone();
            Some(JointLine {
                joint,
                torque_nm_max,
                rate_nm_s_max,
                coulomb_nm,
                viscous_nm_s_rad,
                gravity_nm_max,
            })
        };
        let joints = wanted.joints.iter().enumerate().filter_map(line).collect();
        Some(Self { gravity: wanted.gravity, inertia: wanted.inertia, share: wanted.share, joints })
    }
}

/// The greatest torque that holds each joint against gravity, in random poses.
fn holding_nm_max(robot: &Robot) -> Option<JointArray> {
    let dynamics = robot.dynamics().ok()?;
    let mut rng = SeededRng::new(1, 1);
    let mut highest = [0.0; MAX_JOINTS];
    for _ in 0..POSES {
        let mut pose_rad = [0.0; MAX_JOINTS];
        for (angle_rad, joint) in pose_rad.iter_mut().zip(&robot.joints) {
            let [low_rad, high_rad] = joint.limits.position_rad;
            *angle_rad = rng.within(low_rad, high_rad);
        }
        for (highest, holding_nm) in highest.iter_mut().zip(dynamics.holding_nm(&pose_rad)) {
            *highest = f64::max(*highest, holding_nm.abs());
        }
    }
    Some(highest)
}

impl fmt::Display for FeedForwardLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let terms: Vec<&str> = [(self.gravity, "gravity"), (self.inertia, "inertia")]
            .iter()
            .filter(|t| t.0)
            .map(|t| t.1)
            .collect();
        let terms = if terms.is_empty() { "friction alone".to_owned() } else { terms.join(" and ") };
        write!(f, "  torque beside the position: {terms}, {} % of the model's", 100.0 * self.share)?;
        for joint in &self.joints {
            let JointLine { torque_nm_max, rate_nm_s_max, coulomb_nm, viscous_nm_s_rad, .. } = joint;
            let rise_s = torque_nm_max / rate_nm_s_max;
            write!(
                f,
                "\n    {:<18} at most {torque_nm_max} Nm, reached in {rise_s:.2} s after enabling",
                joint.joint
            )?;
            if *coulomb_nm > 0.0 || *viscous_nm_s_rad > 0.0 {
                write!(f, "; friction {coulomb_nm} Nm and {viscous_nm_s_rad} Nm s/rad")?;
            }
            match joint.gravity_nm_max {
                Some(most_nm) if most_nm > *torque_nm_max => {
                    write!(
                        f,
                        "; gravity needs up to {most_nm:.1} Nm, MORE THAN THAT: the drive carries the rest"
                    )?;
                }
                Some(most_nm) => write!(f, "; gravity needs up to {most_nm:.1} Nm")?,
                None => {}
            }
        }
        Ok(())
    }
}
