//! Refinement of a path by a metaheuristic over three control points, under the paper's cost.
//!
//! The structure is the paper's (length of the tip's path, joint travel, penalty when anything collides); the
//! distances are the world's own, of every shape, and the penalty's width is the radii and the margin. What comes
//! out is a proposal: its edges are proven like any other path's.
use crate::budget::Budget;
use crate::energy::Energy;
use crate::rng::SeededRng;
use crate::timing::Path;
use crate::tree::Space;
use crate::world::{Snapshot, World};
use std::cell::RefCell;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::with_control_points;
use taustream_optimizers::{Optimizer, Problem, Progress, Refusal, Run, Solution};

/// Control points between start and goal (the paper's M).
pub const CONTROL_POINTS: usize = 3;
/// Poses a segment, evenly spaced along its line: the paper's even time steps put 40 % of them into the first and
/// last 1 % of a stroke, and the path is the same for every timing.
const POSES_PER_SEGMENT: u32 = 12;
/// Poses that one evaluation checks.
pub const POSES: usize = (CONTROL_POINTS + 1) * POSES_PER_SEGMENT as usize;
/// Guesses beside the path itself, scattered around it by this much (rad).
const SCATTER_RAD: f64 = 0.15;
const SCATTERED: usize = 5;

/// Proposes a path near a given one (which may collide, and has the problem's ends) with any optimiser, or none when the
/// run was cut before its first evaluation.
///
/// # Errors
/// When the optimiser's numbers make no sense, or the robot's limits are no box.
pub fn refine(
    problem: &PathProblem,
    path: &[JointArray],
    optimizer: &dyn Optimizer,
    evaluations_max: usize,
    seed: u64,
) -> Result<Option<(Vec<JointArray>, Solution)>, Refusal> {
    let guesses = problem.guesses(path, seed);
    let (is_over, mut watch) = (|| problem.budget.is_over(), |_: &Progress| ());
    let run = Run { seed, evaluations_max, guesses: &guesses, is_over: &is_over, watch: &mut watch };
    let found = optimizer.minimise(problem, run)?;
    Ok((!found.x.is_empty()).then(|| (problem.corners(&found.x), found)))
}

/// The paper's problem: where to put the control points. With [`Energy`] the energy of the motion takes the place
/// of the ways of tip and joints.
pub struct PathProblem<'a> {
    world: &'a World<'a>,
    budget: &'a Budget<'a>,
    start_rad: JointArray,
    goal_rad: JointArray,
    weights: [f64; 3],
    energy: Option<&'a Energy>,
    bounds: Vec<[f64; 2]>,
    /// Scratch memory; the trait's evaluation takes no mutable access.
    snapshot: RefCell<Snapshot>,
}

impl<'a> PathProblem<'a> {
    /// The problem between two poses.
    #[must_use]
    pub fn new(space: &Space<'a>, start_rad: JointArray, goal_rad: JointArray) -> Self {
        let (world, budget) = (space.world, space.budget);
        let one = world.robot().joints.iter().map(|j| j.limits.position_rad);
        let bounds = one.cycle().take(CONTROL_POINTS * world.joints()).collect();
        let (weights, snapshot) = (CostModel::default().weights, RefCell::default());
        Self { world, budget, start_rad, goal_rad, weights, energy: None, bounds, snapshot }
    }

    /// The same for the energy of the motion.
    #[must_use]
    pub fn by_energy(mut self, energy: Option<&'a Energy>) -> Self {
        self.energy = energy;
        self
    }

    /// Start, control points and goal of a decision vector.
    #[must_use]
    pub fn corners(&self, x: &[f64]) -> Vec<JointArray> {
        let mut corners = vec![self.start_rad];
        for point in x.chunks(self.world.joints()) {
            let mut corner = [0.0; MAX_JOINTS];
            corner.iter_mut().zip(point).for_each(|(c, p)| *c = *p);
            corners.push(corner);
        }
        corners.push(self.goal_rad);
        corners
    }

    /// Energy of the motion that passes the corners without stopping, as timing would make it; infinite when there is
    /// none.
    fn energy_j(&self, energy: &Energy, corners_rad: &[JointArray]) -> f64 {
        let limits = self.world.robot().limits();
        let path = Path { corners_rad, joints: self.world.joints(), limits: &limits };
        path.rough().map_or(f64::INFINITY, |motion| energy.spent_roughly_j(&motion))
    }

    /// The path with three control points, some scattered around it, and the straight line.
    fn guesses(&self, path: &[JointArray], seed: u64) -> Vec<Vec<f64>> {
        let joints = self.world.joints();
        let flat = |corners: &[JointArray]| -> Vec<f64> {
            let inner = corners.iter().skip(1).take(CONTROL_POINTS);
            inner.flat_map(|c| c.iter().take(joints).copied()).collect()
        };
        let seeded = flat(&with_control_points(path, CONTROL_POINTS));
        let mut rng = SeededRng::new(seed, 1);
        let mut guesses = vec![
            seeded.clone(),
            flat(&with_control_points(&[self.start_rad, self.goal_rad], CONTROL_POINTS)),
        ];
        for _ in 0..SCATTERED {
            guesses.push(seeded.iter().map(|x| x + rng.within(-SCATTER_RAD, SCATTER_RAD)).collect());
        }
        guesses
    }
}

impl Problem for PathProblem<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let snapshot = &mut *self.snapshot.borrow_mut();
        let corners = self.corners(x);
        let (mut length_m, mut travel_rad, mut penalty, mut collides) = (0.0, 0.0, 0.0, false);
        let tips = self.world.robot().chain.tips();
        let mut last: [Option<parry3d_f64::math::Vector>; MAX_JOINTS] = [None; MAX_JOINTS];
        for segment in corners.windows(2) {
            let [from, to] = segment else { continue };
            travel_rad += from.iter().zip(to).map(|(a, b)| (b - a).abs()).sum::<f64>();
            for i in 1..=POSES_PER_SEGMENT {
                if self.budget.is_over_after(self.world.pairs().len()) {
                    // Not worth anything: the run ends with the next question.
                    return f64::INFINITY;
                }
                let share = f64::from(i) / f64::from(POSES_PER_SEGMENT);
                self.world.place(&Space::between(from, to, share), snapshot);
                for (frame, last) in tips.iter().zip(&mut last) {
                    let tip = snapshot.origin(*frame);
                    length_m += last.map_or(0.0, |l| (tip - l).length());
                    *last = Some(tip);
                }
                for pair in self.world.pairs() {
                    let hinge = self.world.hinge(pair, snapshot);
                    penalty += hinge;
                    collides |= hinge > 0.0;
                }
            }
        }
        let [length, travel, weight] = self.weights;
        let penalty = if collides { weight * penalty } else { 0.0 };
        let leading_term = match self.energy {
            Some(energy) => self.energy_j(energy, &corners),
            None => length * length_m + travel * travel_rad,
        };
        leading_term + penalty
    }
}
