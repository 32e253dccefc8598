//! Metaheuristics over a box: one trait for all of them.
//!
//! An optimiser is seeded, counts evaluations, can be cancelled, and remembers the best point that it ever saw
//! beside the best of its population now: the papers' methods lose their best, which is worth seeing.
pub mod ibfoa;

pub use ibfoa::{Ibfoa, Parameters};

/// What is minimised.
pub trait Problem {
    /// Lowest and highest value of each coordinate.
    fn bounds(&self) -> &[[f64; 2]];
    /// The cost of a point inside the bounds. NaN counts as infinite.
    fn cost(&self, x: &[f64]) -> f64;
}

/// How to run.
pub struct Run<'a> {
    /// Seed of every random choice.
    pub seed: u64,
    /// Most evaluations of the cost.
    pub evaluations_max: usize,
    /// Points of the first population; the rest is uniform random. Clamped to the bounds.
    pub guesses: &'a [Vec<f64>],
    /// Asked before every evaluation; true ends the run.
    pub is_over: &'a dyn Fn() -> bool,
    /// Told after every iteration.
    pub watch: &'a mut dyn FnMut(&Progress),
}

/// Where a run stands after an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Evaluations done.
    pub evaluations: usize,
    /// Least cost in the population now.
    pub current: f64,
    /// Least cost ever seen.
    pub best: f64,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The method's own schedule is done.
    Done,
    /// The evaluations are used up.
    Budget,
    /// [`Run::is_over`] said so.
    Cut,
}

/// What a run found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The best point ever seen; empty when not one could be evaluated.
    pub x: Vec<f64>,
    /// Its cost.
    pub cost: f64,
    /// Where the run stood at its end.
    pub progress: Progress,
    /// Why it ended.
    pub end: End,
}

/// A metaheuristic.
pub trait Optimizer {
    /// Its name.
    fn name(&self) -> &'static str;
    /// Looks for the least cost.
    fn minimise(&self, problem: &dyn Problem, run: Run) -> Found;
}

/// Counts evaluations and remembers the best: the one way in which an optimiser reaches its problem.
struct Meter<'a> {
    problem: &'a dyn Problem,
    is_over: &'a dyn Fn() -> bool,
    left: usize,
    done: usize,
    best: (Vec<f64>, f64),
}

impl<'a> Meter<'a> {
    fn new(problem: &'a dyn Problem, is_over: &'a dyn Fn() -> bool, evaluations_max: usize) -> Self {
        let best = (Vec::new(), f64::INFINITY);
        Self { problem, is_over, left: evaluations_max, done: 0, best }
    }

    /// The cost of a point, which is clamped to the bounds.
    fn cost(&mut self, x: &mut [f64]) -> Result<f64, End> {
        if self.left == 0 {
            return Err(End::Budget);
        }
        if (self.is_over)() {
            return Err(End::Cut);
        }
        for (x, [low, high]) in x.iter_mut().zip(self.problem.bounds()) {
            *x = x.max(*low).min(*high);
        }
        (self.left, self.done) = (self.left - 1, self.done + 1);
        let cost = self.problem.cost(x);
        let cost = if cost.is_nan() { f64::INFINITY } else { cost };
        if cost < self.best.1 || self.best.0.is_empty() {
            self.best = (x.to_vec(), cost);
        }
        Ok(cost)
    }

    fn found(self, iteration: usize, current: f64, end: End) -> Found {
        let (x, cost) = self.best;
        Found { x, cost, progress: Progress { iteration, evaluations: self.done, current, best: cost }, end }
    }
}
