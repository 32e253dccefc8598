//! The paper's cost of a motion, in the paper's own model.
//!
//! Links are bare segments between frame origins, obstacles are spheres, and the penalty takes the least distance
//! over the links. This is a reference to compare with the paper; what may move is decided by the planner's proof.
//!
//! Source: Wang et al. (2022), eq. 3.5 to 3.10 in the corrected reading (its eq. 3.9 sums the distances over the links,
//! so that its penalty never acts). [`Reading::Printed`] selects that sum.
mod control_points;
mod fast;
mod flat;
mod lanes;
mod level;
mod margin;
mod phases;
mod prefilter;
mod skeleton;
#[cfg(test)]
mod soundness;

pub use control_points::ControlPointCost;
pub use level::Level;

use crate::Reading;
use taustream_arm::scene::Shape;
use taustream_arm::{Robot, Scene};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};

/// The numbers of the cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CostModel {
    /// Equal time steps a stroke.
    pub waypoints_per_segment: usize,
    /// Distance added to every radius; stands for the links' thickness.
    pub expansion_m: f64,
    /// Weights of path length (1/m), joint travel (1/rad) and penalty.
    pub weights: [f64; 3],
    /// Printed: an obstacle's distance is the sum of its distances to all links; corrected: the least of them.
    pub reading: Reading,
}

impl Default for CostModel {
    /// The paper's numbers.
    fn default() -> Self {
        Self {
            waypoints_per_segment: 120,
            expansion_m: 0.1,
            weights: [7.0, 300.0, 1.2e7],
            reading: Reading::Corrected,
        }
    }
}

/// The cost and its parts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PaperCost {
    /// Length of the path of the last frame's origin.
    pub path_length_m: f64,
    /// Sum of the joint travel.
    pub joint_travel_rad: f64,
    /// Sum over poses and spheres of max(1 - d / (radius + expansion), 0).
    pub penalty: f64,
    /// True when a pose is closer to a sphere than its radius plus the expansion.
    pub collision: bool,
    /// The weighted sum; the penalty counts only with a collision.
    pub cost: f64,
    /// How many poses were sampled.
    pub poses: usize,
}

/// Why a motion has no cost in this model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CostError {
    /// Obstacles that the paper does not know.
    #[error("the paper's cost knows spheres only; {} of this scene {}", names.join(", "),
        if names.len() == 1 { "is none" } else { "are none" })]
    NotSpheres {
        /// Names of the others.
        names: Vec<String>,
    },
    /// Strokes overlap, so that there are no segments.
    #[error(
        "strokes {} and {} overlap by {by_s:.6} s; the paper's cost is defined for strokes one after another",
        stroke, stroke + 1
    )]
    Overlap {
        /// One-based number of the earlier stroke.
        stroke: usize,
        /// By how much.
        by_s: f64,
    },
    /// Made for an arm with another number of joints.
    #[error("the trajectory moves {got} joints, the robot has {expected}")]
    Joints {
        /// Of the trajectory.
        got: usize,
        /// Of the robot.
        expected: usize,
    },
    /// A number of the model makes no sense.
    #[error("{what} is {value}; {expected}")]
    Model {
        /// Which number.
        what: &'static str,
        /// The value that was given.
        value: f64,
        /// What is possible.
        expected: &'static str,
    },
}

/// Most steps a stroke; a bound against absurd arguments.
const STEPS_MAX: usize = 100_000;
/// Strokes that end this much after the next one starts still count as one after another: starts are sums.
const OVERLAP_S: f64 = 1e-9;

/// The paper's cost of a trajectory whose strokes follow each other.
///
/// # Errors
/// When the scene, the trajectory or the model does not fit the paper's.
pub fn paper_cost(
    robot: &Robot,
    scene: &Scene,
    trajectory: &Trajectory,
    model: &CostModel,
) -> Result<PaperCost, CostError> {
    model.check()?;
    let (got, expected) = (trajectory.joints(), robot.joints.len());
    if got != expected {
        return Err(CostError::Joints { got, expected });
    }
    let spheres = spheres(scene)?;
    check_overlap(trajectory)?;

    let mut sum = Sum::new(model, robot, &spheres);
    for stroke in trajectory.strokes() {
        for step in 0..model.waypoints_per_segment {
            let share = step as f64 / model.waypoints_per_segment as f64;
            sum.add(&trajectory.sample(stroke.start_s + stroke.duration_s * share).position_rad);
        }
    }
    sum.add(&trajectory.end_rad());
    Ok(sum.finish())
}

impl CostModel {
    fn check(&self) -> Result<(), CostError> {
        let steps = self.waypoints_per_segment;
        if steps == 0 || steps > STEPS_MAX {
            let (what, value) = ("waypoints per segment", steps as f64);
            return Err(CostError::Model { what, value, expected: "from 1 to 100000 is possible" });
        }
        if !(self.expansion_m >= 0.0 && self.expansion_m.is_finite()) {
            let (what, value) = ("expansion_m", self.expansion_m);
            return Err(CostError::Model { what, value, expected: "a length of 0 m or more is possible" });
        }
        match self.weights.iter().find(|w| !(**w >= 0.0 && w.is_finite())) {
            Some(&value) => {
                Err(CostError::Model { what: "a weight", value, expected: "0 or more is possible" })
            }
            None => Ok(()),
        }
    }
}

type Point = nalgebra::Point3<f64>;

fn spheres(scene: &Scene) -> Result<Vec<(Point, f64)>, CostError> {
    let mut spheres = Vec::new();
    let mut names = Vec::new();
    for obstacle in &scene.obstacles {
        if let Shape::Sphere { radius_m } = obstacle.shape {
            spheres.push((Point::from(obstacle.pose.translation.vector), radius_m));
        } else {
            names.push(obstacle.name.clone());
        }
    }
    if names.is_empty() { Ok(spheres) } else { Err(CostError::NotSpheres { names }) }
}

fn check_overlap(trajectory: &Trajectory) -> Result<(), CostError> {
    for (i, pair) in trajectory.strokes().windows(2).enumerate() {
        if let [a, b] = pair {
            let by_s = a.end_s() - b.start_s;
            if by_s > OVERLAP_S {
                return Err(CostError::Overlap { stroke: i + 1, by_s });
            }
        }
    }
    Ok(())
}

/// The sums over the poses so far.
struct Sum<'a> {
    model: &'a CostModel,
    robot: &'a Robot,
    spheres: &'a [(Point, f64)],
    last: Option<(JointArray, [Pose; MAX_JOINTS + 1])>,
    cost: PaperCost,
}

impl<'a> Sum<'a> {
    fn new(model: &'a CostModel, robot: &'a Robot, spheres: &'a [(Point, f64)]) -> Self {
        Self { model, robot, spheres, last: None, cost: PaperCost::default() }
    }

    fn add(&mut self, position_rad: &JointArray) {
        let frames = self.robot.chain.frames(position_rad);
        if let Some((before_rad, before)) = &self.last {
            for tip in self.robot.chain.tips() {
                self.cost.path_length_m += (origin(&frames[*tip]) - origin(&before[*tip])).norm();
            }
            let steps = position_rad.iter().zip(before_rad);
            self.cost.joint_travel_rad += steps.map(|(q, p)| (q - p).abs()).sum::<f64>();
        }
        self.last = Some((*position_rad, frames));
        self.cost.poses += 1;
        self.penalise(&frames);
    }

    /// Adds what a pose costs by being too near to spheres.
    fn penalise(&mut self, frames: &[Pose; MAX_JOINTS + 1]) {
        let chain = &self.robot.chain;
        for (centre, radius_m) in self.spheres {
            let distances_m = (0..chain.joints())
                .map(|joint| (origin(&frames[chain.parent_frame(joint)]), origin(&frames[joint + 1])))
                .map(|(a, b)| distance_to_segment_m(centre, &a, &b));
            let distance_m = match self.model.reading {
                Reading::Corrected => distances_m.fold(f64::INFINITY, f64::min),
                Reading::Printed => distances_m.sum(),
            };
            let reach_m = radius_m + self.model.expansion_m;
            if distance_m < reach_m {
                self.cost.collision = true;
                self.cost.penalty += 1.0 - distance_m / reach_m;
            }
        }
    }

    fn finish(mut self) -> PaperCost {
        let [length, travel, penalty] = self.model.weights;
        self.cost.cost = length * self.cost.path_length_m
            + travel * self.cost.joint_travel_rad
            + penalty * self.cost.penalty;
        self.cost
    }
}

fn origin(frame: &Pose) -> Point {
    Point::from(frame.translation.vector)
}

fn distance_to_segment_m(point: &Point, a: &Point, b: &Point) -> f64 {
    let along = b - a;
    let length2 = along.norm_squared();
    let share = if length2 > 0.0 { ((point - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * share - point).norm()
}
