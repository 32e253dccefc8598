//! The paper's planning problem: free control points between two poses, under its cost.
//!
//! M control points give M + 1 Tau-J* strokes one after another; the decision vector holds the control points' joint
//! angles. All joints of a stroke share one profile, so that a table of it serves every evaluation.
//!
//! Source: Wang et al. (2022), section 5 and table 1.
use super::fast::Fast;
use super::level::Level;
use super::phases::phases;
use super::{CostError, CostModel, PaperCost, Point, Sum, spheres};
use crate::Problem;
use std::f64::consts::PI;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// Time of a segment, T.
const SEGMENT_S: f64 = 6.0;
/// 1/k of the strokes: the paper's k is 0.1.
const EXPONENT: u32 = 10;
/// Most control points; a bound against absurd arguments.
const CONTROL_POINTS_MAX: usize = 100;

/// What control points between two poses cost.
///
/// Decision vectors are control points after each other, each with one angle a joint (rad). Those with another
/// number of coordinates, or with one that is not finite, cost infinity.
#[derive(Clone, Debug)]
pub struct ControlPointCost<'a> {
    robot: &'a Robot,
    spheres: Vec<(Point, f64)>,
    ends_rad: [JointArray; 2],
    control_points: usize,
    model: CostModel,
    /// Of a stroke, at each of its waypoints.
    phases: Vec<f64>,
    /// `None` where only the reference can evaluate.
    fast: Option<Fast>,
    bounds_rad: Vec<[f64; 2]>,
}

impl<'a> ControlPointCost<'a> {
    /// The problem of going from the first to the second of two poses through `control_points` others.
    ///
    /// # Errors
    /// When the scene has other shapes than spheres, or a number of the model, an angle of an end or the number of
    /// control points makes no sense.
    pub fn new(
        robot: &'a Robot,
        scene: &Scene,
        ends_rad: [JointArray; 2],
        control_points: usize,
        model: CostModel,
    ) -> Result<Self, CostError> {
        model.check()?;
        let spheres = spheres(scene)?;
        if !(1..=CONTROL_POINTS_MAX).contains(&control_points) {
            let (what, value) = ("the number of control points", control_points as f64);
            return Err(CostError::Model { what, value, expected: "from 1 to 100 is possible" });
        }
        if let Some(&value) = ends_rad.iter().flatten().find(|q| !q.is_finite()) {
            let what = "an angle of the start or the goal";
            return Err(CostError::Model { what, value, expected: "a finite angle is needed" });
        }
        let phases = phases(EXPONENT, model.waypoints_per_segment);
        let bounds_rad = vec![[-PI, PI]; control_points * robot.joints.len()];
        let fast = Fast::new(&robot.chain, &spheres, &model, &phases);
        Ok(Self { robot, spheres, ends_rad, control_points, model, phases, fast, bounds_rad })
    }

    /// The same with other vector instructions than the best of this machine.
    #[must_use]
    pub fn on(self, level: Level) -> Self {
        Self { fast: self.fast.map(|fast| fast.on(level)), ..self }
    }

    /// Start, control points and goal of a decision vector; `None` when it is none.
    #[must_use]
    pub fn corners(&self, x: &[f64]) -> Option<Vec<JointArray>> {
        if x.len() != self.bounds_rad.len() || x.iter().any(|q| !q.is_finite()) {
            return None;
        }
        let [start, goal] = self.ends_rad;
        let mut corners = Vec::with_capacity(self.control_points + 2);
        corners.push(start);
        for point in x.chunks_exact(self.robot.joints.len()) {
            let mut corner = [0.0; MAX_JOINTS];
            corner.iter_mut().zip(point).for_each(|(c, p)| *c = *p);
            corners.push(corner);
        }
        corners.push(goal);
        Some(corners)
    }

    /// The cost and its parts; `None` for what is no decision vector. Penalty and collision are those of
    /// [`Self::rate_exactly`]; the tip's path is summed in f32.
    #[must_use]
    pub fn rate(&self, x: &[f64]) -> Option<PaperCost> {
        let corners = self.corners(x)?;
        let Some(prefiltered) = self.fast.as_ref().and_then(|fast| fast.prefilter(&corners)) else {
            return self.rate_poses(&corners);
        };
        let mut sum = Sum::new(&self.model, self.robot, &self.spheres);
        for (segment, step) in prefiltered.suspects {
            let pose = self.pose(corners.get(segment..segment + 2)?, step);
            sum.penalise(&self.robot.chain.frames(&pose));
        }
        let travels = corners.windows(2).map(|pair| match pair {
            [from, to] => from.iter().zip(to).map(|(p, q)| (q - p).abs()).sum(),
            _ => 0.0,
        });
        sum.cost.path_length_m = prefiltered.length_m;
        // Joints move in one direction within a segment.
        sum.cost.joint_travel_rad = travels.sum();
        sum.cost.poses = self.phases.len() * (corners.len() - 1) + 1;
        Some(sum.finish())
    }

    /// The pose of a segment at a step; the step behind the last one is its end.
    fn pose(&self, segment: &[JointArray], step: usize) -> JointArray {
        match (segment, self.phases.get(step)) {
            ([from, to], Some(phase)) => std::array::from_fn(|j| from[j] + phase * (to[j] - from[j])),
            ([_, to], None) => *to,
            _ => [0.0; MAX_JOINTS],
        }
    }

    /// The same by plain f64 arithmetic, pose by pose: the reference, and what is reported in the end.
    #[must_use]
    pub fn rate_exactly(&self, x: &[f64]) -> Option<PaperCost> {
        self.rate_poses(&self.corners(x)?)
    }

    fn rate_poses(&self, corners: &[JointArray]) -> Option<PaperCost> {
        let mut sum = Sum::new(&self.model, self.robot, &self.spheres);
        for segment in corners.windows(2) {
            (0..self.phases.len()).for_each(|step| sum.add(&self.pose(segment, step)));
        }
        sum.add(corners.last()?);
        Some(sum.finish())
    }

    /// The motion of a decision vector: strokes of 6 s. `None` for what is no decision vector.
    #[must_use]
    pub fn motion(&self, x: &[f64]) -> Option<Trajectory> {
        let corners = self.corners(x)?;
        let strokes = corners.windows(2).enumerate().filter_map(|(i, pair)| {
            let [from, to] = pair else { return None };
            let delta_rad = std::array::from_fn(|j| to[j] - from[j]);
            Some(Stroke { start_s: SEGMENT_S * i as f64, duration_s: SEGMENT_S, n: EXPONENT, delta_rad })
        });
        let strokes: Vec<Stroke> = strokes.collect();
        Trajectory::new(self.robot.joints.len(), self.ends_rad[0], &strokes).ok()
    }

    /// How many joints the arm has.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.robot.joints.len()
    }

    /// The straight joint-space line as a decision vector: control points evenly along it.
    #[must_use]
    pub fn straight(&self) -> Vec<f64> {
        let ([start, goal], joints) = (self.ends_rad, self.robot.joints.len());
        let share = |i: usize| (i + 1) as f64 / (self.control_points + 1) as f64;
        let point = |i: usize| (0..joints).map(move |j| start[j] + share(i) * (goal[j] - start[j]));
        (0..self.control_points).flat_map(point).collect()
    }
}

impl Problem for ControlPointCost<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds_rad
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.rate(x).map_or(f64::INFINITY, |cost| cost.cost)
    }

    fn exact_cost(&self, x: &[f64]) -> Option<f64> {
        self.rate_exactly(x).map(|cost| cost.cost)
    }
}
