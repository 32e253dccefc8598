//! The planning problem of seed paper 000: three free control points between two poses, under its cost.
//!
//! Four Tau-J* strokes of 6 s one after another, from start to goal by way of the control points; the decision vector
//! holds the control points' joint angles, each in (-π, π). The product's own refinement ([`crate::refine`]) has the
//! same structure over the exact world; this is the paper's, for comparing.
//!
//! Source: section 5 and table 1. Its scenes are "random": start and goal uniform in (-π, π), three spheres of radius
//! 0.18 m round the arm, drawn again while an end pose is nearer than the radius and the expansion. The box of the
//! centres is ours, for an arm of about a UR5's size.
use crate::cost::{CostModel, paper_cost};
use crate::draw::Draw;
use crate::optimize::Problem;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::f64::consts::PI;
use std::path::PathBuf;
use taustream_arm::scene::{Obstacle, Shape};
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// Control points, M.
pub const CONTROL_POINTS: usize = 3;
/// Time of a segment, T.
pub const SEGMENT_S: f64 = 6.0;
/// 1/k of the strokes: the paper's k is 0.1.
const N: u32 = 10;
/// Obstacles of a case.
const SPHERES: usize = 3;
/// Radius of an obstacle.
const RADIUS_M: f64 = 0.18;
/// Least and highest coordinates of an obstacle's centre.
const CENTRES_M: [[f64; 2]; 3] = [[-0.8, 0.8], [-0.8, 0.8], [0.0, 0.9]];
/// Draws until a case is given up.
const ATTEMPTS_MAX: usize = 10_000;

/// One random case: poses and obstacles.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Start and goal.
    pub ends_rad: [JointArray; 2],
    /// The obstacles.
    pub scene: Scene,
}

impl Case {
    /// The case of a seed; `None` when no draw leaves both end poses free, which only an arm much larger than its
    /// surroundings does.
    #[must_use]
    pub fn draw(robot: &Robot, model: &CostModel, seed: u64) -> Option<Self> {
        let mut draw = Draw::new(seed, 5);
        let joints = robot.joints.len();
        let mut attempts = (0..ATTEMPTS_MAX).map(|_| {
            let mut pose = || -> JointArray {
                std::array::from_fn(|j| if j < joints { draw.within(-PI, PI) } else { 0.0 })
            };
            let ends_rad = [pose(), pose()];
            let obstacles =
                (0..SPHERES).map(|i| sphere(i, CENTRES_M.map(|[low, high]| draw.within(low, high))));
            let scene = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: obstacles.collect() };
            Self { ends_rad, scene }
        });
        attempts.find(|case| case.ends_rad.iter().all(|end| case.is_free(robot, model, end)))
    }

    fn is_free(&self, robot: &Robot, model: &CostModel, pose_rad: &JointArray) -> bool {
        let still = Trajectory::new(robot.joints.len(), *pose_rad, &[]).ok();
        let cost = still.and_then(|still| paper_cost(robot, &self.scene, &still, model).ok());
        cost.is_some_and(|cost| !cost.collision)
    }
}

fn sphere(number: usize, [x, y, z]: [f64; 3]) -> Obstacle {
    let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
    Obstacle { name: format!("sphere{number}"), pose, shape: Shape::Sphere { radius_m: RADIUS_M } }
}

/// The problem of a case.
pub struct ControlPoints<'a> {
    robot: &'a Robot,
    case: &'a Case,
    model: CostModel,
    bounds_rad: Vec<[f64; 2]>,
}

impl<'a> ControlPoints<'a> {
    /// The problem of a case under a cost.
    #[must_use]
    pub fn new(robot: &'a Robot, case: &'a Case, model: CostModel) -> Self {
        let bounds_rad = vec![[-PI, PI]; CONTROL_POINTS * robot.joints.len()];
        Self { robot, case, model, bounds_rad }
    }

    /// The motion of a decision vector; `None` when it has too few numbers or one that is none.
    #[must_use]
    pub fn motion(&self, x: &[f64]) -> Option<Trajectory> {
        let joints = self.robot.joints.len();
        let [start, goal] = self.case.ends_rad;
        let mut corners = vec![start];
        for point in x.chunks_exact(joints) {
            let mut corner = [0.0; MAX_JOINTS];
            corner.iter_mut().zip(point).for_each(|(c, p)| *c = *p);
            corners.push(corner);
        }
        corners.push(goal);
        let strokes = corners.windows(2).enumerate().filter_map(|(i, pair)| {
            let [from, to] = pair else { return None };
            let delta_rad = std::array::from_fn(|j| to[j] - from[j]);
            Some(Stroke { start_s: SEGMENT_S * i as f64, duration_s: SEGMENT_S, n: N, delta_rad })
        });
        let is_whole = corners.len() == CONTROL_POINTS + 2;
        is_whole.then(|| Trajectory::new(joints, start, &strokes.collect::<Vec<_>>()).ok()).flatten()
    }

    /// The straight joint-space line as a decision vector: control points evenly along it.
    #[must_use]
    pub fn straight(&self) -> Vec<f64> {
        let ([start, goal], joints) = (self.case.ends_rad, self.robot.joints.len());
        let share = |i: usize| (i + 1) as f64 / (CONTROL_POINTS + 1) as f64;
        let point = |i: usize| (0..joints).map(move |j| start[j] + share(i) * (goal[j] - start[j]));
        (0..CONTROL_POINTS).flat_map(point).collect()
    }
}

impl Problem for ControlPoints<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds_rad
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let cost =
            self.motion(x).and_then(|m| paper_cost(self.robot, &self.case.scene, &m, &self.model).ok());
        cost.map_or(f64::INFINITY, |cost| cost.cost)
    }
}
