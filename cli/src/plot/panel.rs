//! Curves over time, one panel a quantity.
use crate::failure::Failure;
use plotters::prelude::RGBColor;
use std::path::Path;
use taustream_arm::RobotJoint;
use taustream_claims::chart::{Area, COLOURS, Curve, Drawn, LimitLine, Panel, draw_panel};
use taustream_motion::JointKind;

/// One colour a joint.
pub(super) const JOINT_COLOURS: [RGBColor; COLOURS.len()] = COLOURS;
/// Title of each panel, and its quantity's order of derivation.
pub(super) const PANELS: [&str; 4] =
    ["position (rad)", "velocity (rad/s)", "acceleration (rad/s^2)", "jerk (rad/s^3)"];

/// A limit that all joints share.
const SHARED: RGBColor = RGBColor(90, 90, 90);

/// Why a picture could not be made.
pub(super) fn undrawable(file: &Path, why: &dyn std::error::Error) -> Failure {
    Failure::Failed(format!("{} cannot be drawn: {why}", file.display()))
}

/// The titles for joints of these kinds.
pub(super) fn titles(kinds: &[JointKind]) -> [&'static str; 4] {
    const BOTH: [&str; 4] = [
        "position (rad, or m)",
        "velocity (rad/s, or m/s)",
        "acceleration (rad/s^2, or m/s^2)",
        "jerk (rad/s^3, or m/s^3)",
    ];
    const METRES: [&str; 4] = ["position (m)", "velocity (m/s)", "acceleration (m/s^2)", "jerk (m/s^3)"];
    match kinds.iter().filter(|kind| kind.is_prismatic()).count() {
        0 => PANELS,
        sliding if sliding == kinds.len() => METRES,
        _ => BOTH,
    }
}

/// The four panels below each other, with their titles.
pub(super) fn draw_panels(
    (body, titles): (&Area<'_>, [&str; 4]),
    panels: &[Vec<Curve>; 4],
    limits: &[Vec<LimitLine>; 4],
) -> Drawn {
    let areas = body.split_evenly((4, 1));
    for ((area, name), (curves, limits)) in areas.iter().zip(titles).zip(panels.iter().zip(limits)) {
        let (curves, limits) = (curves.clone(), limits.clone());
        draw_panel(area, &Panel { curves, limits, ..Panel::new("time (s)", name) })?;
    }
    Ok(())
}

/// The motion limits of every panel: one pair of lines where all joints have the same, else one pair a joint.
pub(super) fn motion_limits(joints: &[RobotJoint]) -> [Vec<LimitLine>; 4] {
    let of: [fn(&RobotJoint) -> [f64; 2]; 4] = [
        |joint| joint.limits.position_rad,
        |joint| [-joint.limits.motion.velocity_rad_s, joint.limits.motion.velocity_rad_s],
        |joint| [-joint.limits.motion.acceleration_rad_s2, joint.limits.motion.acceleration_rad_s2],
        |joint| [-joint.limits.motion.jerk_rad_s3, joint.limits.motion.jerk_rad_s3],
    ];
    of.map(|limit| {
        let mut pairs: Vec<([f64; 2], RGBColor)> = joints.iter().map(limit).zip(JOINT_COLOURS).collect();
        let is_shared = pairs
            .windows(2)
            .all(|two| matches!(two, [a, b] if a.0.map(f64::to_bits) == b.0.map(f64::to_bits)));
        if is_shared {
            pairs.truncate(1);
            pairs.iter_mut().for_each(|(_, colour)| *colour = SHARED);
        }
        let mut label = if is_shared { "limit of all joints" } else { "limits (dashed)" }.to_owned();
        let lines = pairs.into_iter().flat_map(|(pair, colour)| pair.map(|value| (value, colour)));
        lines.map(|(value, colour)| LimitLine { value, colour, label: std::mem::take(&mut label) }).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_that_differ_are_drawn_for_each_joint() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        let mut joints = taustream_arm::Robot::load(&file).unwrap().joints;
        assert_eq!(motion_limits(&joints)[1].len(), 2);
        joints[3].limits.motion.velocity_rad_s = 1.0;
        assert_eq!(motion_limits(&joints)[1].len(), 12);
        assert_eq!(motion_limits(&joints)[2].len(), 2);
        assert!(motion_limits(&[]).iter().all(Vec::is_empty));
    }
}
