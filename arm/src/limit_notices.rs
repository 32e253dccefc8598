//! What the owner should know about the limits of a joint: permitted, but rarely meant.
use crate::document::shown;
use crate::reader::Table;
use crate::urdf::JointInfo;
use std::f64::consts::TAU;
use taustream_motion::{JointKind, LimitSet};

/// Two revolutions to a side; more is rare, and a range in degrees is common.
const RANGE_RAD: f64 = 2.0 * TAU;
/// Faster than the joints of arms turn, and slower than most are in degrees per second.
const VELOCITY_RAD_S: f64 = 40.0;
/// A turn by 1 rad that takes longer is hardly meant.
const TURN_S: f64 = 60.0;

/// Farther than lifts and gantries of arms go, and less than most do in millimetres.
const RANGE_M: f64 = 10.0;
/// Faster than they go, and slower than most do in millimetres a second.
const VELOCITY_M_S: f64 = 5.0;
/// What a prismatic joint shall do in a minute at least.
const WAY_M: f64 = 0.1;

/// A range of many revolutions, or of many metres.
pub(crate) fn of_range(
    table: &Table<'_>,
    (kind, position_rad): (JointKind, Option<[f64; 2]>),
    notices: &mut Vec<String>,
) {
    if kind.is_prismatic() {
        if let Some([low, high]) = position_rad.filter(|range| range.iter().any(|m| m.abs() > RANGE_M)) {
            let path = table.path_of("position_m");
            notices.push(format!("{path} = [{low}, {high}] m: LOOKS LIKE MILLIMETRES"));
        }
        return;
    }
    let Some([low, high]) = position_rad.filter(|range| range.iter().any(|rad| rad.abs() > RANGE_RAD)) else {
        return;
    };
    notices.push(format!(
        "{} = [{low}, {high}] are {:.1} and {:.1} revolutions: LOOKS LIKE DEGREES; in rad these would be [{:.4}, {:.4}]",
        table.path_of("position_rad"),
        low / TAU,
        high / TAU,
        low.to_radians(),
        high.to_radians()
    ));
}

/// A velocity of many revolutions a second, and limits so small that the joint hardly moves.
pub(crate) fn of_motion(
    table: &Table<'_>,
    (kind, motion): (JointKind, Option<&LimitSet>),
    notices: &mut Vec<String>,
) {
    let Some(motion) = motion else { return };
    let path = table.path_of("motion");
    let velocity_rad_s = motion.velocity_rad_s;
    if kind.is_prismatic() {
        if velocity_rad_s > VELOCITY_M_S {
            notices
                .push(format!("{path}.velocity_m_s = {velocity_rad_s} m/s: LOOKS LIKE MILLIMETRES A SECOND"));
        }
    } else if velocity_rad_s > VELOCITY_RAD_S {
        notices.push(format!(
            "{path}.velocity_rad_s = {velocity_rad_s} are {:.1} revolutions a second: LOOKS LIKE DEGREES; in rad/s this would be {:.4}",
            velocity_rad_s / TAU,
            velocity_rad_s.to_radians()
        ));
    }
    // From rest to rest with one limit alone: at full speed; half the way speeding up; a quarter of it with rising acceleration.
    let (way, words) = match kind {
        JointKind::Revolute => (1.0, "a turn by 1 rad".to_owned()),
        JointKind::Prismatic => (WAY_M, format!("a way of {WAY_M} m")),
    };
    let slowest = [
        (velocity_rad_s, way / velocity_rad_s),
        (motion.acceleration_rad_s2, 2.0 * (way / motion.acceleration_rad_s2).sqrt()),
        (motion.jerk_rad_s3, (32.0 * way / motion.jerk_rad_s3).cbrt()),
    ];
    for (key, (value, turn_s)) in
        kind.rate_keys().into_iter().zip(slowest).filter(|(_, (_, turn_s))| *turn_s > TURN_S)
    {
        notices
            .push(format!("{path}.{key} = {value:e}: {words} takes at least {turn_s:.0} s; LOOKS TOO SMALL"));
    }
}

/// A stop may use more than a motion; where the URDF states less, that is said.
pub(crate) fn of_stop(joint_info: &JointInfo, stop: &LimitSet, notices: &mut Vec<String>) {
    let beyond = |what: &str, stop: f64, stated: Option<f64>| {
        let stated = stated.filter(|stated| *stated > 0.0 && stop > *stated)?;
        Some(format!("stop.{what} = {stop} is above the URDF's {stated}"))
    };
    let [_, acceleration, jerk] = joint_info.kind.rate_keys();
    let found = [
        beyond(acceleration, stop.acceleration_rad_s2, joint_info.limits.acceleration),
        beyond(jerk, stop.jerk_rad_s3, joint_info.limits.jerk),
    ];
    let found: Vec<String> = found.into_iter().flatten().collect();
    if !found.is_empty() {
        notices.push(format!(
            "joint {}: {}; only pauses and stops use it",
            shown(&joint_info.name),
            found.join(", ")
        ));
    }
}
