//! A criterion for the number of control points, which Wang et al. (2022) chooses by trial and error.
//!
//! Begin with one; optimise; add another in the middle of the longest segment, and optimise again from there. Stop when
//! the path is free of collision and the last one added has not lowered the cost by a given share: it is left out
//! again. A problem that needs no detour is so solved with one control point, from the straight line, and a hard one
//! gets as many as pay.
use super::control_points::with_control_points;
use crate::cost::{ControlPointCost, CostError};
use crate::{Optimizer, Progress, Refusal, Run};
use taustream_motion::JointArray;

/// How to choose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// Most control points.
    pub control_points_max: usize,
    /// Evaluations for each number of them.
    pub evaluations_each: usize,
    /// Share of the cost that another one must save.
    pub saves: f64,
}

/// What optimises.
struct With<'a> {
    optimizer: &'a dyn Optimizer,
    seed: u64,
    is_over: &'a dyn Fn() -> bool,
}

impl Growth {
    /// Up to six, each with about what the paper's case 1 spends on a third of its schedule; one must save 2 %.
    pub const OURS: Self = Self { control_points_max: 6, evaluations_each: 3_000, saves: 0.02 };
}

/// What was chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Chosen {
    /// How many control points.
    pub control_points: usize,
    /// They themselves, as a decision vector.
    pub x: Vec<f64>,
    /// What they cost.
    pub cost: f64,
    /// True when the path touches something even so.
    pub collides: bool,
    /// Evaluations of all numbers that were tried.
    pub evaluations: usize,
}

/// Why nothing was chosen.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GrowthError {
    /// The problem.
    #[error(transparent)]
    Cost(#[from] CostError),
    /// The optimiser or a number of the growth.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

impl Growth {
    /// Chooses the number of control points, and the points.
    ///
    /// # Errors
    /// When the problem, the optimiser or a number of the growth makes no sense.
    pub fn choose<'r>(
        &self,
        problem: &dyn Fn(usize) -> Result<ControlPointCost<'r>, CostError>,
        optimizer: &dyn Optimizer,
        seed: u64,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Chosen, GrowthError> {
        self.check()?;
        let with = With { optimizer, seed, is_over };
        let first = problem(1)?;
        let mut chosen = self.try_one(&first, first.straight(), &with)?;
        for count in 2..=self.control_points_max {
            if is_over() {
                break;
            }
            let next = problem(count)?;
            let from = problem(chosen.control_points)?.corners(&chosen.x);
            let from = from.map_or_else(
                || next.straight(),
                |path| flat(&with_control_points(&path, count), next.joints()),
            );
            let tried = self.try_one(&next, from, &with)?;
            let evaluations = chosen.evaluations + tried.evaluations;
            let pays = tried.cost < (1.0 - self.saves) * chosen.cost;
            let is_enough = !chosen.collides && !pays;
            if pays {
                chosen = tried;
            }
            chosen.evaluations = evaluations;
            if is_enough {
                break;
            }
        }
        Ok(chosen)
    }

    fn check(&self) -> Result<(), Refusal> {
        let within = Refusal::check_number;
        let most = self.control_points_max as f64;
        within("growth", "the most control points", most, [1.0, 100.0], "from 1 to 100 is possible")?;
        let each = self.evaluations_each as f64;
        within("growth", "the evaluations", each, [1.0, 1e12], "at least 1 is needed")?;
        within("growth", "the share to save", self.saves, [0.0, 1.0], "from 0 to 1 is possible")
    }

    fn try_one(&self, problem: &ControlPointCost, from: Vec<f64>, with: &With) -> Result<Chosen, Refusal> {
        let With { optimizer, seed, is_over } = *with;
        let guesses = [from, problem.straight()];
        let mut watch = |_: &Progress| ();
        let evaluations_max = self.evaluations_each;
        let run = Run { seed, evaluations_max, guesses: &guesses, is_over, watch: &mut watch };
        let found = optimizer.minimise(problem, run)?;
        let collides = problem.rate_exactly(&found.x).is_none_or(|c| c.collision);
        let control_points = guesses[1].len() / problem.joints().max(1);
        let evaluations = found.progress.evaluations;
        Ok(Chosen { control_points, cost: found.cost, x: found.x, collides, evaluations })
    }
}

/// The inner corners of a path as a decision vector.
fn flat(path: &[JointArray], joints: usize) -> Vec<f64> {
    let inner = path.get(1..path.len().saturating_sub(1)).unwrap_or_default();
    inner.iter().flat_map(|q| q.iter().take(joints).copied()).collect()
}
