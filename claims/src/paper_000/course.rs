//! One run of a method with the whole course of its population.
use crate::run_context::{RunContext, Stop};
use crate::statistics::quantile;
use taustream_optimizers::{End, Optimizer, Problem, Progress, Run, Solution};

/// What a run found, and its state after every iteration.
pub(super) struct Course {
    pub(super) found: Solution,
    states: Vec<Progress>,
}

/// Runs a method.
///
/// # Errors
/// When the method refuses, or the user ended it.
pub(super) fn follow(
    run_context: &RunContext,
    optimizer: &dyn Optimizer,
    problem: &dyn Problem,
    seed: u64,
    evaluations_max: usize,
) -> Result<Course, Stop> {
    let mut states = Vec::new();
    let mut watch = |p: &Progress| states.push(*p);
    let is_over = || run_context.is_over();
    let run = Run { seed, evaluations_max, guesses: &[], is_over: &is_over, watch: &mut watch };
    let found = optimizer.minimise(problem, run)?;
    if found.end == End::Cut {
        return Err(Stop::Interrupted);
    }
    Ok(Course { found, states })
}

impl Course {
    /// Best of the population at the end.
    pub(super) fn last(&self) -> f64 {
        self.found.progress.current
    }

    pub(super) fn evaluations(&self) -> f64 {
        self.found.progress.evaluations as f64
    }

    /// Best so far when so many evaluations were done.
    pub(super) fn best_after(&self, evaluations: f64) -> f64 {
        if evaluations >= self.evaluations() {
            return self.found.cost;
        }
        let before = self.states.iter().take_while(|s| s.evaluations as f64 <= evaluations).last();
        before.or(self.states.first()).map_or(self.found.cost, |s| s.best)
    }

    /// Population's best when a share of the iterations is done.
    pub(super) fn after(&self, share: f64) -> Option<f64> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to the last index"
        )]
        let at = (share.clamp(0.0, 1.0) * self.states.len().saturating_sub(1) as f64).round() as usize;
        self.states.get(at).map(|state| state.current)
    }

    /// Iterations after which the population's best was worse than before.
    pub(super) fn rises(&self) -> usize {
        self.pairs().filter(|[before, after]| after > before).count()
    }

    /// Iterations of which [`Self::rises`] could be one.
    pub(super) fn steps(&self) -> usize {
        self.states.len().saturating_sub(1)
    }

    /// Population's best before and after the first step of chemotaxis that follows a dispersal.
    pub(super) fn dispersals(&self, iterations: usize) -> impl Iterator<Item = [f64; 2]> + '_ {
        let every = iterations.max(1);
        self.pairs().enumerate().filter(move |(i, _)| (i + 1) % every == 0).map(|(_, pair)| pair)
    }

    fn pairs(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.states.windows(2).filter_map(|pair| match pair {
            [a, b] => Some([a.current, b.current]),
            _ => None,
        })
    }
}

/// Best so far of two methods, run by run, at the evaluations of the one that took fewer.
pub(super) fn equal_evaluations(ours: &[Course], theirs: &[Course]) -> [Vec<f64>; 2] {
    let pairs = ours.iter().zip(theirs).map(|(a, b)| {
        let both = a.evaluations().min(b.evaluations());
        (a.best_after(both), b.best_after(both))
    });
    let (ours, theirs) = pairs.unzip();
    [ours, theirs]
}

/// Quartiles over runs of the population's best after each iteration, thinned.
pub(super) fn curve(courses: &[Course], points: usize) -> Vec<(f64, [f64; 3])> {
    let iterations = courses.iter().map(|c| c.states.len()).max().unwrap_or(0);
    let every = iterations.div_ceil(points.max(1)).max(1);
    let at = |i: usize| {
        let here = courses.iter().filter_map(|c| c.states.get(i).or(c.states.last()).map(|s| s.current));
        let here: Vec<f64> = here.collect();
        ((i + 1) as f64, [0.25, 0.5, 0.75].map(|q| quantile(&here, q)))
    };
    (0..iterations).step_by(every).map(at).collect()
}
