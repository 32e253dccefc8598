//! Inverse kinematics: damped least squares on the chain's Jacobian, inside the joint ranges.
//!
//! From a guess, steps of Levenberg and Marquardt lead to the nearest pose whose tip is at the target. A step is taken
//! only when it makes the error smaller, so the result is never worse than the guess. Any chain of one to sixteen joints,
//! with the orientation or without.
//!
//! Source: Wampler, "Manipulator inverse kinematic solutions based on vector formulations and damped least-squares
//! methods", IEEE Transactions on Systems, Man, and Cybernetics 16(1), 1986.
use super::target::TipTarget;
use nalgebra::{Matrix6, Vector3, Vector6};
use taustream_arm::Robot;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Most steps; from a guess at random ten to thirty do it, from a centimetre off five to ten.
const STEPS_MAX: u32 = 60;
/// Share of the largest lever, squared, by which the first step is damped; taken and refused steps change it.
const DAMPING: f64 = 1e-4;
const DAMPING_LEAST: f64 = 1e-15;
const DAMPING_MOST: f64 = 1e6;
/// What a turn counts beside a way, m/rad, as a share of the arm's reach.
const TURN_WEIGHT: f64 = 0.25;

/// Inverse kinematics of one target.
#[derive(Clone, Copy, Debug)]
pub struct Inverse<'a> {
    robot: &'a Robot,
    target: &'a TipTarget,
    /// m/rad.
    lever_m: f64,
}

impl<'a> Inverse<'a> {
    /// For an arm that reaches about this far.
    #[must_use]
    pub fn new(robot: &'a Robot, target: &'a TipTarget, reach_m: f64) -> Self {
        Self { robot, target, lever_m: TURN_WEIGHT * reach_m }
    }

    /// A pose nearby whose tip is nearer to the target, or the same pose.
    #[must_use]
    pub fn polish(&self, pose_rad: &JointArray) -> JointArray {
        let mut pose = *pose_rad;
        let mut damping = DAMPING;
        let mut error = self.left(&pose).norm();
        for _ in 0..STEPS_MAX {
            if error == 0.0 || damping > DAMPING_MOST {
                break;
            }
            let next = self.step(&pose, damping);
            let next_error = self.left(&next).norm();
            if next_error < error {
                (pose, error) = (next, next_error);
                damping = (0.1 * damping).max(DAMPING_LEAST);
            } else {
                damping *= 10.0;
            }
        }
        pose
    }

    /// What is left, all in m.
    fn left(&self, pose_rad: &JointArray) -> Vector6<f64> {
        let tip = self.robot.chain.frame(self.target.frame(self.robot), pose_rad);
        self.weighed(self.target.left(&tip))
    }

    fn weighed(&self, left: Vector6<f64>) -> Vector6<f64> {
        let l = self.lever_m;
        left.component_mul(&Vector6::new(1.0, 1.0, 1.0, l, l, l))
    }

    /// One damped step, held to the ranges. A joint that stands at its end and would leave it takes no part.
    fn step(&self, pose_rad: &JointArray, damping: f64) -> JointArray {
        let (tip, columns) = self.robot.chain.jacobian(self.target.frame(self.robot), pose_rad);
        let left = self.weighed(self.target.left(&tip));
        let into_tip = tip.rotation.inverse();
        let is_asked = |i: usize| self.target.orientation.is_some() && left[3 + i] != 0.0;
        let mut levers = [Vector6::zeros(); MAX_JOINTS];
        let ranges = || self.robot.joints.iter().map(|j| j.limits.position_rad);
        for (((lever, column), q), [low, high]) in levers.iter_mut().zip(&columns).zip(pose_rad).zip(ranges())
        {
            // A turn inside its tolerance, or free, binds nothing.
            let turn = into_tip * column.angular * self.lever_m;
            let turn = Vector3::from_fn(|i, _| if is_asked(i) { turn[i] } else { 0.0 });
            let way = column.linear_m;
            let full = Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z);
            let towards = full.dot(&left);
            let is_stuck = (*q <= low && towards < 0.0) || (*q >= high && towards > 0.0);
            *lever = if is_stuck { Vector6::zeros() } else { full };
        }
        let largest = levers.iter().map(Vector6::norm_squared).fold(0.0, f64::max);
        let mut normal = Matrix6::identity() * (damping * largest);
        for lever in &levers {
            normal += lever * lever.transpose();
        }
        let Some(weights) = normal.cholesky().map(|c| c.solve(&left)) else { return *pose_rad };
        let mut next = *pose_rad;
        for ((q, lever), [low, high]) in next.iter_mut().zip(&levers).zip(ranges()) {
            *q = (*q + lever.dot(&weights)).clamp(low, high);
        }
        next
    }
}
