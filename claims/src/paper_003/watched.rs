//! The paper's task with an eye on the tip: when it comes within the threshold, and where it is after a generation.
use crate::run_context::{RunContext, Stop};
use crate::trial::{Trial, minimise};
use std::cell::{Cell, RefCell};
use taustream_optimizers::papers::reach::Reach;
use taustream_optimizers::{Optimizer, Problem};

/// What is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Objective {
    /// Time plus reward or punishment: the paper's.
    Reward,
    /// Time in seconds plus the error in millimetres.
    TimeAndError,
    /// The error in millimetres alone.
    Error,
}

/// One run of one method.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Reaching {
    /// The run.
    pub(super) trial: Trial,
    /// Error of the result.
    pub(super) error_mm: f64,
    /// Generation in which a point within the threshold was first seen; infinite when none was.
    pub(super) generation: f64,
    /// Cost and error (mm) of the best point so far, after every generation from 0.
    pub(super) best: Vec<[f64; 2]>,
    /// Angles of that point.
    pub(super) angles_rad: Vec<[f64; 4]>,
}

/// A method and the evaluations of one of its generations.
pub(super) struct Contender {
    pub(super) optimizer: Box<dyn Optimizer>,
    pub(super) per_generation: usize,
}

struct Watched<'a> {
    task: Reach<'a>,
    objective: Objective,
    per_generation: usize,
    evaluations: Cell<usize>,
    first: Cell<Option<usize>>,
    least: Cell<[f64; 2]>,
    best: RefCell<Vec<[f64; 2]>>,
    least_rad: Cell<[f64; 4]>,
    angles_rad: RefCell<Vec<[f64; 4]>>,
}

impl Problem for Watched<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.task.bounds_rad
    }

    fn cost(&self, x: &[f64]) -> f64 {
        let error_m = self.task.error_m(x);
        let cost = match self.objective {
            Objective::Reward => self.task.cost(x),
            Objective::TimeAndError => self.task.time_s(x) + 1e3 * error_m,
            Objective::Error => 1e3 * error_m,
        };
        let evaluations = self.evaluations.get() + 1;
        self.evaluations.set(evaluations);
        if error_m <= self.task.reward.threshold_m && self.first.get().is_none() {
            self.first.set(Some(evaluations));
        }
        if cost < self.least.get()[0] {
            self.least.set([cost, 1e3 * error_m]);
            self.least_rad.set(std::array::from_fn(|j| x.get(j).copied().unwrap_or(0.0)));
        }
        if evaluations.is_multiple_of(self.per_generation) {
            self.best.borrow_mut().push(self.least.get());
            self.angles_rad.borrow_mut().push(self.least_rad.get());
        }
        cost
    }
}

/// Runs a method on a task.
pub(super) fn reach(
    run_context: &RunContext,
    contender: &Contender,
    (task, objective): (Reach, Objective),
    run: usize,
    budget: usize,
) -> Result<Reaching, Stop> {
    let problem = Watched {
        task,
        objective,
        per_generation: contender.per_generation.max(1),
        evaluations: Cell::new(0),
        first: Cell::new(None),
        least: Cell::new([f64::INFINITY; 2]),
        best: RefCell::default(),
        least_rad: Cell::new([0.0; 4]),
        angles_rad: RefCell::default(),
    };
    let trial = minimise(run_context, contender.optimizer.as_ref(), &problem, run_context.seed(run), budget)?;
    let generation =
        problem.first.get().map_or(f64::INFINITY, |first| (first / problem.per_generation) as f64);
    let error_mm = 1e3 * task.error_m(&trial.found.x);
    let (best, angles_rad) = (problem.best.take(), problem.angles_rad.take());
    Ok(Reaching { trial, error_mm, generation, best, angles_rad })
}
