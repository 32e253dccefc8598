//! Joint space as the paper's collision test sees it, for a tree to grow in.
use crate::run_context::RunContext;
use std::cell::Cell;
use std::f64::consts::PI;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::Reading;
use taustream_optimizers::cost::ControlPointCost;
use taustream_optimizers::cost::CostModel;
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::Field;

/// Length of an edge of the tree, ours, and between two poses of it that are checked (rad).
pub(super) const STEP_RAD: f64 = 0.4;
pub(super) const CHECKED_RAD: f64 = 0.02;

/// The space of one scene.
pub(super) struct PaperField<'a> {
    pub(super) robot: &'a Robot,
    pub(super) scene: &'a Scene,
    /// Length of an edge (rad).
    pub(super) step_rad: f64,
    pub(super) checks: Cell<usize>,
    pub(super) run_context: &'a RunContext<'a>,
}

impl Field for PaperField<'_> {
    fn step(&self) -> f64 {
        self.step_rad
    }

    fn distance(&self, a: &JointArray, b: &JointArray) -> f64 {
        distance_rad(a, b)
    }

    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        let steps = (distance_rad(a, b) / CHECKED_RAD).ceil().clamp(1.0, 1e4);
        let poses = (1..=10_000).map(f64::from).take_while(|i| *i <= steps);
        let mut poses = poses.map(|i| std::array::from_fn(|j| a[j] + i / steps * (b[j] - a[j])));
        poses.all(|pose| {
            self.checks.set(self.checks.get() + 1);
            !touches(self.robot, self.scene, &pose, Reading::Corrected)
        })
    }

    fn checks(&self) -> usize {
        self.checks.get()
    }

    fn is_over(&self) -> bool {
        self.run_context.is_over()
    }

    fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        random_pose(self.robot, rng)
    }
}

/// Uniform in ±π.
pub(super) fn random_pose(robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().take(robot.joints.len()).for_each(|q| *q = rng.within(-PI, PI));
    pose
}

/// Euclidean distance of two poses.
pub(super) fn distance_rad(a: &JointArray, b: &JointArray) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// One pose by the paper's test in a reading.
pub(super) fn touches(robot: &Robot, scene: &Scene, pose: &JointArray, reading: Reading) -> bool {
    let model = CostModel { waypoints_per_segment: 1, reading, ..CostModel::default() };
    let still = ControlPointCost::new(robot, scene, [*pose; 2], 1, model);
    let rated = still.ok().and_then(|c| c.rate_exactly(&pose[..robot.joints.len()]));
    rated.is_none_or(|cost| cost.collision)
}
