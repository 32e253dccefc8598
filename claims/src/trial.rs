//! One run of a method, and many of them beside each other.
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Summary, quantile};
use taustream_optimizers::{End, Optimizer, Problem, Progress, Run, Solution};

/// Points of a convergence curve.
const CHECKPOINTS: usize = 100;

/// What a run found, and how it came there.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// What it found.
    pub found: Solution,
    /// Evaluations done and best so far, at up to 100 iterations that are spread evenly over the budget.
    pub trace: Vec<(f64, f64)>,
    /// Iterations after which the population's best was worse than before.
    pub rises: usize,
}

/// Runs a method once. The budget is what the trace is spread over too.
///
/// # Errors
/// When the method refuses, or the user ended it.
pub fn minimise(
    run_context: &RunContext,
    optimizer: &dyn Optimizer,
    problem: &dyn Problem,
    seed: u64,
    evaluations_max: usize,
) -> Result<Trial, Stop> {
    let mut trace = Vec::new();
    let (mut rises, mut last) = (0, f64::INFINITY);
    let step = evaluations_max as f64 / CHECKPOINTS as f64;
    let mut watch = |p: &Progress| {
        rises += usize::from(p.current > last);
        last = p.current;
        if p.evaluations as f64 >= step * trace.len() as f64 {
            trace.push((p.evaluations as f64, p.best));
        }
    };
    let is_over = || run_context.is_over();
    let run = Run { seed, evaluations_max, guesses: &[], is_over: &is_over, watch: &mut watch };
    let found = optimizer.minimise(problem, run)?;
    if found.end == End::Cut {
        return Err(Stop::Interrupted);
    }
    Ok(Trial { found, trace, rises })
}

/// One figure of many runs, in the order of the runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The figures.
    pub values: Vec<f64>,
    /// Evaluations of a run, on average; none where nothing is evaluated.
    pub evaluations: Option<f64>,
}

impl Sample {
    /// Figures that cost no evaluations.
    #[must_use]
    pub fn of(values: Vec<f64>) -> Self {
        Self { values, evaluations: None }
    }

    /// A figure of each run.
    #[must_use]
    pub fn from_trials(trials: &[Trial], figure: impl Fn(&Trial) -> f64) -> Self {
        let evaluations: usize = trials.iter().map(|t| t.found.progress.evaluations).sum();
        let evaluations = Some(evaluations as f64 / trials.len().max(1) as f64);
        Self { values: trials.iter().map(figure).collect(), evaluations }
    }

    /// Best so far of each run.
    #[must_use]
    pub fn best(trials: &[Trial]) -> Self {
        Self::from_trials(trials, |t| t.found.cost)
    }

    /// Mean, deviation, quartiles.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary::of(&self.values)
    }
}

/// Lower quartile, median and upper quartile of many runs' curves over evaluations: (x, [low, middle, high]).
#[must_use]
pub fn convergence(trials: &[Trial]) -> Vec<(f64, [f64; 3])> {
    let points = trials.iter().map(|t| t.trace.len()).max().unwrap_or(0);
    let at = |i: usize| {
        // A run that ended earlier stays where it ended.
        let here = |t: &Trial| t.trace.get(i).or(t.trace.last()).copied();
        let (xs, ys): (Vec<f64>, Vec<f64>) = trials.iter().filter_map(here).unzip();
        (quantile(&xs, 1.0), [0.25, 0.5, 0.75].map(|q| quantile(&ys, q)))
    };
    (0..points).map(at).collect()
}
