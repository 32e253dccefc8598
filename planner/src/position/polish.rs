//! The last millimetres to a position: damped least squares on the chain's Jacobian, inside the joint ranges.
//!
//! A swarm is good at finding the right part of joint space and slow at digits; a few steps of Levenberg and Marquardt
//! add the digits. A step is taken only when it makes the error smaller, so the result is never worse.
//!
//! Source: Wampler, "Manipulator inverse kinematic solutions based on vector formulations and damped least-squares
//! methods", IEEE Transactions on Systems, Man, and Cybernetics 16(1), 1986.
use nalgebra::{Matrix3, Vector3};
use taustream_arm::Robot;
use taustream_motion::JointArray;

/// Most steps; from a centimetre off, five to ten do it.
const STEPS_MAX: u32 = 60;
/// Share of the largest lever, squared, by which the first step is damped; taken and refused steps change it.
const DAMPING: f64 = 1e-4;
const DAMPING_LEAST: f64 = 1e-15;
const DAMPING_MOST: f64 = 1e6;

/// Distance of the tip to a point, m.
#[must_use]
pub fn error_m(robot: &Robot, pose_rad: &JointArray, target_m: &Vector3<f64>) -> f64 {
    let [.., tip] = robot.chain.frames(pose_rad);
    (tip.translation.vector - target_m).norm()
}

/// A pose nearby whose tip is nearer to a point, or the same pose.
#[must_use]
pub fn polish(robot: &Robot, pose_rad: &JointArray, target_m: &Vector3<f64>) -> JointArray {
    let mut pose = *pose_rad;
    let mut damping = DAMPING;
    let mut error = error_m(robot, &pose, target_m);
    for _ in 0..STEPS_MAX {
        if error == 0.0 || damping > DAMPING_MOST {
            break;
        }
        let next = step(robot, &pose, target_m, damping);
        let next_error = error_m(robot, &next, target_m);
        if next_error < error {
            (pose, error) = (next, next_error);
            damping = (0.1 * damping).max(DAMPING_LEAST);
        } else {
            damping *= 10.0;
        }
    }
    pose
}

/// One damped step, held to the ranges. A joint that stands at its end and would leave it takes no part.
fn step(robot: &Robot, pose_rad: &JointArray, target_m: &Vector3<f64>, damping: f64) -> JointArray {
    let (tip, columns) = robot.chain.jacobian(pose_rad);
    let off_m = target_m - tip.translation.vector;
    let ranges = || robot.joints.iter().map(|j| j.limits.position_rad);
    let distances = pose_rad.iter().zip(ranges()).zip(&columns).map(|((q, [low, high]), column)| {
        let towards = column.linear_m.dot(&off_m);
        let is_stuck = (*q <= low && towards < 0.0) || (*q >= high && towards > 0.0);
        if is_stuck { Vector3::zeros() } else { column.linear_m }
    });
    let levers: Vec<Vector3<f64>> = distances.collect();
    let largest = levers.iter().map(Vector3::norm_squared).fold(0.0, f64::max);
    let mut normal = Matrix3::identity() * (damping * largest);
    for lever in &levers {
        normal += lever * lever.transpose();
    }
    let Some(weights) = normal.cholesky().map(|c| c.solve(&off_m)) else { return *pose_rad };
    let mut next = *pose_rad;
    for ((q, lever), [low, high]) in next.iter_mut().zip(&levers).zip(ranges()) {
        *q = (*q + lever.dot(&weights)).clamp(low, high);
    }
    next
}
