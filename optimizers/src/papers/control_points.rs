//! The random cases of Wang et al. (2022) for its planning problem, which is [`ControlPointCost`]. The product's own
//! refinement (in the planner) has the same structure over the exact world; this is the paper's, for comparing.
//!
//! Source: section 5 and table 1. Its scenes are "random": start and goal uniform in (-π, π), three spheres of radius
//! 0.18 m round the arm, drawn again while an end pose is nearer than the radius and the expansion. The box of the
//! centres is ours, for an arm of about a UR5's size.
use crate::cost::{ControlPointCost, CostError, CostModel, paper_cost};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::f64::consts::PI;
use std::path::PathBuf;
use taustream_arm::rng::SeededRng;
use taustream_arm::scene::{Obstacle, Shape};
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, Trajectory};

/// Control points, M.
pub const CONTROL_POINTS: usize = 3;
/// Obstacles of a case.
const SPHERES: usize = 3;
/// Radius of an obstacle.
const RADIUS_M: f64 = 0.18;
/// Least and highest coordinates of an obstacle's centre.
pub type Centres = [[f64; 2]; 3];
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
    /// Where the centres of the obstacles are (m): ours, the paper prints none.
    pub const CENTRES_M: Centres = [[-0.8, 0.8], [-0.8, 0.8], [0.0, 0.9]];

    /// The case of a seed, with centres in our box.
    #[must_use]
    pub fn random(robot: &Robot, model: &CostModel, seed: u64) -> Option<Self> {
        Self::random_within(robot, model, &Self::CENTRES_M, seed)
    }

    /// The case of a seed, with centres in a box (m); `None` when no draw leaves both end poses free, which only an arm much larger than its
    /// surroundings does.
    #[must_use]
    pub fn random_within(robot: &Robot, model: &CostModel, centres_m: &Centres, seed: u64) -> Option<Self> {
        let mut rng = SeededRng::new(seed, 5);
        let joints = robot.joints.len();
        let mut attempts = (0..ATTEMPTS_MAX).map(|_| {
            let mut pose = || -> JointArray {
                std::array::from_fn(|j| if j < joints { rng.within(-PI, PI) } else { 0.0 })
            };
            let ends_rad = [pose(), pose()];
            let obstacles =
                (0..SPHERES).map(|i| sphere(i, centres_m.map(|[low, high]| rng.within(low, high))));
            let scene = Scene {
                file: PathBuf::new(),
                margin_m: 0.0,
                obstacles: obstacles.collect(),
                zones: Vec::new(),
            };
            Self { ends_rad, scene }
        });
        attempts.find(|case| case.ends_rad.iter().all(|end| case.is_free(robot, model, end)))
    }

    /// The planning problem of the case: the paper's has [`CONTROL_POINTS`] of them.
    ///
    /// # Errors
    /// When the model or the number of control points makes no sense.
    pub fn problem<'a>(
        &self,
        robot: &'a Robot,
        control_points: usize,
        model: CostModel,
    ) -> Result<ControlPointCost<'a>, CostError> {
        ControlPointCost::new(robot, &self.scene, self.ends_rad, control_points, model)
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

/// The same path with a number of inner corners: the longest segments are halved, or the corner whose removal changes
/// least goes.
#[must_use]
pub fn with_control_points(path: &[JointArray], count: usize) -> Vec<JointArray> {
    let distance = |a: &JointArray, b: &JointArray| -> f64 {
        a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
    };
    let mut corners = path.to_vec();
    while corners.len() < count + 2 {
        let longest = (1..corners.len())
            .max_by(|a, b| {
                let length = |i: usize| distance(&corners[i - 1], &corners[i]);
                length(*a).total_cmp(&length(*b)).then(b.cmp(a))
            })
            .unwrap_or(1);
        let (before, after) = (&corners[longest - 1], &corners[longest]);
        let halfway = std::array::from_fn(|j| 0.5 * (before[j] + after[j]));
        corners.insert(longest, halfway);
    }
    while corners.len() > count + 2 {
        let detour = |i: usize| {
            distance(&corners[i - 1], &corners[i]) + distance(&corners[i], &corners[i + 1])
                - distance(&corners[i - 1], &corners[i + 1])
        };
        let least = (1..corners.len() - 1).min_by(|a, b| detour(*a).total_cmp(&detour(*b))).unwrap_or(1);
        corners.remove(least);
    }
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_points_are_three_whatever_the_path_and_ends_stay() {
        for corners in 2..12_u32 {
            let path: Vec<JointArray> = (0..corners)
                .map(|i| std::array::from_fn(|j| (f64::from(i) * (j as f64 + 1.0)).sin()))
                .collect();
            let five = with_control_points(&path, CONTROL_POINTS);
            assert_eq!(five.len(), CONTROL_POINTS + 2);
            assert_eq!((five.first(), five.last()), (path.first(), path.last()));
        }
    }
}
