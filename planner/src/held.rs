//! Joints that hold while others move: those of the groups that a request says nothing of, a bit each.
use taustream_arm::Robot;
use taustream_motion::{JointArray, Trajectory};

/// A motion that moves what was to hold: a fault of the planner, which nothing is sent of.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the planner has a fault: its motion moves joint {} ({name}), which was to hold", joint + 1)]
pub struct Moved {
    /// Zero-based index of the joint.
    pub joint: usize,
    /// Its name.
    pub name: String,
}

/// Refuses a motion in which a joint that was to hold moves, be it by rounding.
///
/// # Errors
/// The first such joint.
pub fn check_held(robot: &Robot, motion: &Trajectory, held_joints: u32) -> Result<(), Moved> {
    let is_held = |joint: usize| held_joints & (1 << joint) != 0;
    let moves = |joint: usize| motion.strokes().iter().any(|stroke| stroke.delta_rad[joint] != 0.0);
    let mut joints = robot.joints.iter().enumerate();
    match joints.find(|(joint, _)| is_held(*joint) && moves(*joint)) {
        Some((joint, of)) => Err(Moved { joint, name: of.name.clone() }),
        None => Ok(()),
    }
}

/// Joints that rest differ by rounding from where the motion that runs has led them.
const RESTS_RAD: f64 = 1e-9;

/// Of some joints those that every point leaves where they start, with the points that hold them exactly there.
pub(crate) fn held(joints: u32, start_rad: &JointArray, points_rad: &[JointArray]) -> (u32, Vec<JointArray>) {
    let mut points_rad = points_rad.to_vec();
    let mut held = 0;
    for (joint, at_rad) in start_rad.iter().enumerate().filter(|(joint, _)| joints & (1 << joint) != 0) {
        if points_rad.iter().all(|point| (point[joint] - at_rad).abs() <= RESTS_RAD) {
            held |= 1 << joint;
            points_rad.iter_mut().for_each(|point| point[joint] = *at_rad);
        }
    }
    (held, points_rad)
}
