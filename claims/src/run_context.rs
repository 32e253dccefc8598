//! How much work an experiment may do, and how its runs are spread over threads.
use crate::looks::Looks;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use taustream_optimizers::Refusal;
use taustream_optimizers::papers::spline::SplineError;
use taustream_planner::plan::STACK_BYTES;

/// How much work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Effort {
    /// Runs of everything random; `None` is each experiment's own number (the paper's in a full run).
    pub runs: Option<usize>,
    /// Few and short runs: shows that everything works, and proves nothing.
    pub quick: bool,
    /// Seed of every random choice.
    pub seed: u64,
    /// Threads; the answer does not depend on them.
    pub jobs: usize,
}

/// Most runs and threads; bounds against absurd arguments.
pub(crate) const RUNS_MAX: usize = 100_000;
const JOBS_MAX: usize = 256;

/// Why an experiment has no outcome.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// The user ended it.
    #[error("the experiments were ended before they were done")]
    Interrupted,
    /// A method or a problem did not take its numbers.
    #[error("an experiment's numbers were refused: {0}")]
    Refused(String),
}

impl From<Refusal> for Stop {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal.to_string())
    }
}

impl From<SplineError> for Stop {
    fn from(refusal: SplineError) -> Self {
        Self::Refused(refusal.to_string())
    }
}

/// What experiments run in.
pub struct RunContext<'a> {
    effort: Effort,
    /// True for a further master seed, of which only the claims' words are looked at.
    is_repeat: bool,
    /// Called with progress messages.
    say: &'a (dyn Fn(&str) + Sync),
    /// Called before every batch of evaluations; true ends everything.
    is_over: &'a (dyn Fn() -> bool + Sync),
}

impl<'a> RunContext<'a> {
    /// A lab that reports with `say` and works until `is_over`.
    #[must_use]
    pub fn new(
        effort: Effort,
        say: &'a (dyn Fn(&str) + Sync),
        is_over: &'a (dyn Fn() -> bool + Sync),
    ) -> Self {
        Self { effort, is_repeat: false, say, is_over }
    }

    /// The same with another master seed, for the claims' words alone.
    #[must_use]
    pub fn repeated(&self, seed: u64) -> Self {
        Self { effort: Effort { seed, ..self.effort }, is_repeat: true, ..*self }
    }

    /// True for a further master seed: what no claim looks at need not run.
    #[must_use]
    pub fn is_repeat(&self) -> bool {
        self.is_repeat
    }

    /// True when few and short runs are requested.
    #[must_use]
    pub fn is_quick(&self) -> bool {
        self.effort.quick
    }

    /// The first of two choices in a full run, the other one in a quick one.
    #[must_use]
    pub fn choose<T>(&self, full: T, quick: T) -> T {
        if self.effort.quick { quick } else { full }
    }

    /// How many runs: what the user asked for, else `full` or `quick`.
    #[must_use]
    pub fn runs(&self, full: usize, quick: usize) -> usize {
        self.effort.runs.unwrap_or_else(|| self.choose(full, quick)).clamp(1, RUNS_MAX)
    }

    /// Looks at a full run's numbers of runs; else one look, at as many as the user asked for, or `quick`.
    #[must_use]
    pub fn looks(&self, full: Looks, quick: usize) -> Looks {
        match self.effort.runs {
            None if !self.effort.quick => full,
            Some(_) | None => Looks::new(self.runs(full.first(), quick), 1),
        }
    }

    /// The same, never more than in a full run: `--runs` asks for few of everything.
    #[must_use]
    pub fn looks_at_most(&self, full: Looks, quick: usize) -> Looks {
        let looks = self.looks(full, quick);
        if looks.last() > full.last() { full } else { looks }
    }

    /// The seed of a run. All methods get the same one for the same run, so that they begin with the same random
    /// numbers and are compared pair by pair.
    #[must_use]
    pub fn seed(&self, run: usize) -> u64 {
        // Neighbouring seeds and runs must not meet: spread by the odd constant of Steele, Lea and Flood's SplitMix.
        self.effort.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(run as u64)
    }

    /// Prints progress.
    pub fn say(&self, text: &str) {
        (self.say)(text);
    }

    /// True when everything has to end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        (self.is_over)()
    }

    /// Does `one` for every further number below `count`, and keeps what is there.
    ///
    /// # Errors
    /// As [`Self::each`].
    pub fn up_to<T: Send>(
        &self,
        count: usize,
        done: &mut Vec<T>,
        one: impl Fn(usize) -> Result<T, Stop> + Sync,
    ) -> Result<(), Stop> {
        let from = done.len();
        done.extend(self.each(count.saturating_sub(from), |i| one(from + i))?);
        Ok(())
    }

    /// Does `one` for every number below `count`, on all threads; the answers in the order of the numbers.
    ///
    /// # Errors
    /// When the user ended it; else the first refusal, by number.
    pub fn each<T: Send>(
        &self,
        count: usize,
        one: impl Fn(usize) -> Result<T, Stop> + Sync,
    ) -> Result<Vec<T>, Stop> {
        let (next, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
        let work = || {
            let mut done = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= count || failed.load(Ordering::Relaxed) {
                    return done;
                }
                let answer = if self.is_over() { Err(Stop::Interrupted) } else { one(i) };
                failed.fetch_or(answer.is_err(), Ordering::Relaxed);
                done.push((i, answer));
            }
        };
        let helpers = self.effort.jobs.clamp(1, JOBS_MAX).min(count.max(1)) - 1;
        let mut all = std::thread::scope(|scope| {
            let thread = || std::thread::Builder::new().stack_size(STACK_BYTES);
            // Where there are no more threads, fewer do the work.
            let helpers: Vec<_> =
                (0..helpers).filter_map(|_| thread().spawn_scoped(scope, work).ok()).collect();
            let mut all = work();
            for helper in helpers {
                match helper.join() {
                    Ok(done) => all.extend(done),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            all
        });
        all.sort_by_key(|(i, _)| *i);
        all.into_iter().map(|(_, answer)| answer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn effort(jobs: usize) -> Effort {
        Effort { runs: None, quick: true, seed: 1, jobs }
    }

    #[test]
    fn answers_keep_their_order_on_any_number_of_threads() {
        for jobs in [0, 1, 2, 7, 300] {
            let run_context = RunContext::new(effort(jobs), &|_| (), &|| false);
            let squares = run_context.each(100, |i| Ok(i * i)).unwrap();
            assert!(squares.iter().enumerate().all(|(i, s)| *s == i * i), "{jobs} jobs");
            assert_eq!(run_context.each(0, |_| Ok(())), Ok(Vec::new()));
        }
    }

    #[test]
    fn refusal_and_interruption_end_the_runs() {
        let run_context = RunContext::new(effort(2), &|_| (), &|| false);
        let refused = |i| if i == 3 { Err(Stop::Refused("three".to_owned())) } else { Ok(i) };
        assert_eq!(run_context.each(1000, refused), Err(Stop::Refused("three".to_owned())));
        let over = RunContext::new(effort(2), &|_| (), &|| true);
        assert_eq!(over.each(1, |_| Ok(())), Err(Stop::Interrupted));
    }

    #[test]
    fn seeds_of_neighbouring_efforts_and_runs_do_not_meet() {
        let seeds = |seed: u64| {
            let run_context = RunContext::new(Effort { seed, ..effort(1) }, &|_| (), &|| false);
            (0..1000).map(|run| run_context.seed(run)).collect::<Vec<_>>()
        };
        let mut all: Vec<u64> = (0..50).flat_map(seeds).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 50_000);
    }
}
