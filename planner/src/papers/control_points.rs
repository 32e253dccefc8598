//! The random cases of Wang et al. (2022) for its planning problem, which is [`ControlPointCost`]. The product's own
//! refinement ([`crate::refine`]) has the same structure over the exact world; this is the paper's, for comparing.
//!
//! Source: section 5 and table 1. Its scenes are "random": start and goal uniform in (-π, π), three spheres of radius
//! 0.18 m round the arm, drawn again while an end pose is nearer than the radius and the expansion. The box of the
//! centres is ours, for an arm of about a UR5's size.
use crate::cost::{ControlPointCost, CostError, CostModel, paper_cost};
use crate::rng::SeededRng;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::f64::consts::PI;
use std::path::PathBuf;
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
    pub fn random(robot: &Robot, model: &CostModel, seed: u64) -> Option<Self> {
        let mut rng = SeededRng::new(seed, 5);
        let joints = robot.joints.len();
        let mut attempts = (0..ATTEMPTS_MAX).map(|_| {
            let mut pose = || -> JointArray {
                std::array::from_fn(|j| if j < joints { rng.within(-PI, PI) } else { 0.0 })
            };
            let ends_rad = [pose(), pose()];
            let obstacles =
                (0..SPHERES).map(|i| sphere(i, CENTRES_M.map(|[low, high]| rng.within(low, high))));
            let scene = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: obstacles.collect() };
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
