//! Edges that are free at sampled poses: what a search looks at, many poses at once.
//!
//! Neighbouring samples are so near that no point of the arm moves by more than a spacing between them. What is thinner can be
//! missed: a path of such edges is a proposal, and its motion is proven like any other. So that most proofs succeed, samples
//! keep a little more than the margin.
use crate::collide::StraightEdge;
use crate::lanes::Lanes;
use crate::rng::SeededRng;
use crate::tree::{Field, Space};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Share of the random poses that are drawn near start and goal.
const NEAR: f64 = 0.7;
/// How far beyond start and goal those are drawn (rad).
const BEYOND_RAD: f64 = 1.2;

/// Most samples of an edge.
const SAMPLES_MAX: f64 = 1e6;

/// How edges are sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    /// Longest edge of a tree, in metres of weighted distance.
    pub step_m: f64,
    /// How far a point of the arm may be from one sample to the next (m).
    pub spacing_m: f64,
    /// What samples keep beyond every pair (m).
    pub extra_m: f64,
}

/// A space whose edges are sampled.
pub struct Sampled<'s, 'a> {
    space: &'s Space<'a>,
    lanes: &'s Lanes<'a>,
    sampling: Sampling,
    /// Where poses near start and goal are drawn.
    near_rad: [[f64; 2]; MAX_JOINTS],
}

impl<'s, 'a> Sampled<'s, 'a> {
    /// A space for one question.
    #[must_use]
    pub fn new(
        space: &'s Space<'a>,
        lanes: &'s Lanes<'a>,
        ends: [&JointArray; 2],
        sampling: Sampling,
    ) -> Self {
        let [start, goal] = ends;
        let mut near_rad = [[0.0; 2]; MAX_JOINTS];
        let joints = space.world.robot().joints.iter().map(|joint| joint.limits.position_rad);
        for ((near, [low, high]), (a, b)) in near_rad.iter_mut().zip(joints).zip(start.iter().zip(goal)) {
            *near = [low.max(a.min(*b) - BEYOND_RAD), high.min(a.max(*b) + BEYOND_RAD)];
        }
        Self { space, lanes, sampling, near_rad }
    }

    /// True when poses keep what the edges of a search keep.
    #[must_use]
    pub fn are_free(&self, poses_rad: &[JointArray]) -> bool {
        self.space.note_checks(poses_rad.len());
        self.lanes.are_free(poses_rad, self.sampling.extra_m)
    }
}

impl Field for Sampled<'_, '_> {
    fn step(&self) -> f64 {
        self.sampling.step_m
    }

    fn distance(&self, a: &JointArray, b: &JointArray) -> f64 {
        self.space.distance_m(a, b)
    }

    /// The end that the edge comes from is known.
    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        let reach = self.space.world.reach_m();
        let joints = self.space.world.joints();
        let moves = reach.iter().zip(a.iter().zip(b)).take(joints).map(|(r, (a, b))| r * (a - b).abs());
        let moves_m: f64 = moves.sum();
        let count = (moves_m / self.sampling.spacing_m).ceil().clamp(1.0, SAMPLES_MAX);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let count = count as usize;
        self.space.note_checks(count);
        let edge = StraightEdge { from_rad: a, to_rad: b };
        !self.space.budget.is_over_after(count) && self.lanes.is_edge_free(edge, count, self.sampling.extra_m)
    }

    fn checks(&self) -> usize {
        self.space.checks()
    }

    fn is_over(&self) -> bool {
        self.space.budget.is_over_after(1)
    }

    /// Often near start and goal: most ways round an obstacle are.
    fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        if rng.unit() >= NEAR {
            return self.space.random_pose(rng);
        }
        let mut pose = [0.0; MAX_JOINTS];
        for (q, [low, high]) in pose.iter_mut().zip(&self.near_rad).take(self.space.world.joints()) {
            *q = rng.within(*low, *high);
        }
        pose
    }
}
