//! Measures the cost function and whole runs of the paper's optimiser with it.
//!
//! Everything that is compared is timed alternately in one process, so that whatever else the machine does slows all of
//! it. Times are of one thread: the paper's bacteria move one after another, each by the result of the last one.
use crate::failure::Failure;
use serde::Serialize;
use std::cell::RefCell;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_arm::rng::SeededRng;
use taustream_optimizers::cost::{ControlPointCost, Level};
use taustream_optimizers::cost::{CostModel, PaperCost};
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case};
use taustream_optimizers::{Ibfoa, Optimizer, Parameters, Problem, Progress, Run, Solution};

/// Decision vectors that are timed together: few, so that a batch seldom loses the processor on the way.
const BATCH: usize = 5;
/// Decision vectors of a set.
const SET: usize = 400;

/// Everything that was measured.
#[derive(Debug, Serialize)]
pub(super) struct CostBench {
    /// The arm.
    pub(super) robot: String,
    /// True when this program was built without the release profile: its times say little.
    pub(super) debug_build: bool,
    /// What the best level of this machine is.
    pub(super) level: &'static str,
    /// Poses of an evaluation.
    pub(super) poses: usize,
    /// Candidates of a run of case 1, evenly chosen, and uniform random ones.
    pub(super) sets: Vec<Set>,
    /// Case 1 with the fast cost.
    pub(super) case_1: Runs,
    /// One run of case 1 with the plain cost.
    pub(super) case_1_plain: Runs,
    /// Case 2 with the fast cost.
    pub(super) case_2: Option<Runs>,
}

/// Evaluations of one set of decision vectors.
#[derive(Debug, Serialize)]
pub(super) struct Set {
    /// Which set.
    pub(super) candidates: &'static str,
    /// How many of them collide.
    pub(super) colliding_percent: f64,
    /// Time of one by plain f64.
    pub(super) plain: Time,
    /// The fast cost by levels.
    pub(super) levels: Vec<AtLevel>,
}

/// The fast cost on one level.
#[derive(Debug, Serialize)]
pub(super) struct AtLevel {
    /// The level.
    pub(super) level: &'static str,
    /// Time of an evaluation.
    pub(super) time: Time,
    /// Ratio of the means, plain over fast.
    pub(super) times_as_fast: f64,
    /// Largest relative error of the cost.
    pub(super) relative_error: f64,
    /// Penalties or collisions that differ in any bit; there must be none.
    pub(super) differing: usize,
}

/// Times of an evaluation.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Time {
    /// Median of all timed batches, whatever else the machine did.
    pub(super) p50_us: f64,
    /// Mean over the set; each batch counts by its best round.
    pub(super) mean_us: f64,
}

/// Whole runs of an optimiser.
#[derive(Debug, Serialize)]
pub(super) struct Runs {
    /// How many.
    pub(super) runs: usize,
    /// Evaluations of the median run.
    pub(super) evaluations: usize,
    /// Time of a run: median and least.
    pub(super) median_s: f64,
    pub(super) least_s: f64,
    /// Time that the median run had the processor; less than its time where others wanted it too.
    pub(super) processor_s: Option<f64>,
}

/// One run: its time, its time on the processor, its evaluations.
type OneRun = (f64, Option<f64>, usize);

/// What to measure.
pub(super) struct Options {
    pub(super) seconds: f64,
    pub(super) case_1_runs: usize,
    pub(super) case_2_runs: usize,
}

/// Measures.
pub(super) fn measure(robot: &Robot, options: &Options) -> Result<CostBench, Failure> {
    let problem = problem(robot, 1)?;
    let recorded = Recorder { problem: &problem, seen: RefCell::default() };
    optimise(&recorded, Parameters::CASE_1, 1)?;
    let seen = recorded.seen.into_inner();
    let stride = seen.len().div_ceil(SET).max(1);
    let met: Vec<Vec<f64>> = seen.into_iter().step_by(stride).collect();
    let mut rng = SeededRng::new(1, 0);
    let anywhere = |_| problem.bounds().iter().map(|[low, high]| rng.within(*low, *high)).collect();
    let random: Vec<Vec<f64>> = (0..SET).map(anywhere).collect();
    let share = Duration::from_secs_f64(0.5 * options.seconds);
    let sets = vec![
        time_set(&problem, "met by a run of case 1", &met, share)?,
        time_set(&problem, "uniform random", &random, share)?,
    ];
    let plain = Plain(&problem);
    Ok(CostBench {
        robot: robot.name.clone(),
        debug_build: cfg!(debug_assertions),
        level: Level::best().name(),
        poses: problem.rate(&problem.straight()).map_or(0, |cost| cost.poses),
        sets,
        case_1: time_runs(robot, Parameters::CASE_1, options.case_1_runs)?,
        case_1_plain: timed(
            std::iter::once(time_run(&plain, Parameters::CASE_1, 1)).collect::<Result<_, _>>()?,
        ),
        case_2: match options.case_2_runs {
            0 => None,
            runs => Some(time_runs(robot, Parameters::CASE_2, runs)?),
        },
    })
}

fn problem(robot: &Robot, seed: u64) -> Result<ControlPointCost<'_>, Failure> {
    let model = CostModel::default();
    let case = Case::random(robot, &model, seed).ok_or_else(|| {
        Failure::Failed(format!("{}: no two poses are clear of the paper's random spheres", robot.name))
    })?;
    case.problem(robot, CONTROL_POINTS, model).map_err(|error| Failure::Failed(error.to_string()))
}

/// Times plain and fast evaluations of a set in turns, batch by batch, for as long as `share` and once at least.
fn time_set(
    problem: &ControlPointCost,
    candidates: &'static str,
    points: &[Vec<f64>],
    share: Duration,
) -> Result<Set, Failure> {
    let levels = Level::available();
    let fast: Vec<ControlPointCost> = levels.iter().map(|level| problem.clone().on(*level)).collect();
    let mut rounds: Vec<Vec<f64>> = Vec::new();
    let started = Instant::now();
    while rounds.is_empty() || started.elapsed() < share {
        // Plain first, then each level, batch by batch.
        let one = |batch: &[Vec<f64>]| {
            let mut us = vec![time_batch(batch, |x| problem.rate_exactly(x))];
            us.extend(fast.iter().map(|fast| time_batch(batch, |x| fast.rate(x))));
            us
        };
        rounds.push(points.chunks(BATCH).flat_map(one).collect());
    }
    let time = |variant: usize| Time::of(&rounds, variant, levels.len() + 1);
    let plain = time(0);
    let exact = rated(points, |x| problem.rate_exactly(x))?;
    let colliding = exact.iter().filter(|cost| cost.collision).count();
    let mut at = Vec::with_capacity(levels.len());
    for (number, (level, fast)) in levels.iter().zip(&fast).enumerate() {
        let time = time(number + 1);
        let costs = rated(points, |x| fast.rate(x))?;
        let pairs = || exact.iter().zip(&costs);
        let differs = |(a, b): &(&PaperCost, &PaperCost)| {
            a.collision != b.collision || a.penalty.to_bits() != b.penalty.to_bits()
        };
        at.push(AtLevel {
            level: level.name(),
            time,
            times_as_fast: plain.mean_us / time.mean_us,
            relative_error: pairs().map(|(a, b)| (b.cost / a.cost - 1.0).abs()).fold(0.0, f64::max),
            differing: pairs().filter(differs).count(),
        });
    }
    let colliding_percent = 100.0 * colliding as f64 / points.len().max(1) as f64;
    Ok(Set { candidates, colliding_percent, plain, levels: at })
}

impl Time {
    /// The times of one of `variants` ways: a round holds each batch by every way in turn.
    fn of(rounds: &[Vec<f64>], variant: usize, variants: usize) -> Self {
        let batches = rounds.first().map_or(0, Vec::len) / variants.max(1);
        let of_batch = |batch: usize| -> Vec<f64> {
            rounds.iter().filter_map(|round| round.get(batch * variants + variant)).copied().collect()
        };
        let best = |batch| of_batch(batch).into_iter().fold(f64::INFINITY, f64::min);
        let mean_us = (0..batches).map(best).sum::<f64>() / batches.max(1) as f64;
        Self { p50_us: median((0..batches).flat_map(of_batch).collect()), mean_us }
    }
}

/// Time of one evaluation of a batch, in microseconds.
fn time_batch(points: &[Vec<f64>], rate: impl Fn(&[f64]) -> Option<PaperCost>) -> f64 {
    let started = Instant::now();
    for x in points {
        std::hint::black_box(rate(std::hint::black_box(x)));
    }
    started.elapsed().as_secs_f64() * 1e6 / points.len().max(1) as f64
}

fn rated(points: &[Vec<f64>], rate: impl Fn(&[f64]) -> Option<PaperCost>) -> Result<Vec<PaperCost>, Failure> {
    let costs: Option<Vec<PaperCost>> = points.iter().map(|x| rate(x)).collect();
    costs.ok_or_else(|| Failure::Failed("a candidate has no cost".to_owned()))
}

/// Runs of different cases, each drawn by its own seed.
fn time_runs(robot: &Robot, parameters: Parameters, runs: usize) -> Result<Runs, Failure> {
    let one = |seed| time_run(&problem(robot, seed)?, parameters, seed);
    Ok(timed((1..).take(runs).map(one).collect::<Result<_, _>>()?))
}

fn time_run(problem: &dyn Problem, parameters: Parameters, seed: u64) -> Result<OneRun, Failure> {
    let (started, had_s) = (Instant::now(), processor_s());
    let found = optimise(problem, parameters, seed)?;
    let processor_s = processor_s().zip(had_s).map(|(now, then)| now - then);
    Ok((started.elapsed().as_secs_f64(), processor_s, found.progress.evaluations))
}

/// Time that this thread has had the processor; `None` where the system does not say.
fn processor_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let on_processor_ns: u64 = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(on_processor_ns).as_secs_f64())
}

fn timed(mut runs: Vec<OneRun>) -> Runs {
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (median_s, processor_s, evaluations) = runs.get(runs.len() / 2).copied().unwrap_or_default();
    let least_s = runs.first().map_or(0.0, |run| run.0);
    Runs { runs: runs.len(), evaluations, median_s, least_s, processor_s }
}

fn optimise(problem: &dyn Problem, parameters: Parameters, seed: u64) -> Result<Solution, Failure> {
    let (is_over, mut watch) = (|| false, |_: &Progress| ());
    let run = Run { seed, evaluations_max: usize::MAX, guesses: &[], is_over: &is_over, watch: &mut watch };
    let optimizer = Ibfoa { parameters, ..Ibfoa::CASE_1 };
    optimizer.minimise(problem, run).map_err(|refusal| Failure::Failed(refusal.to_string()))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A problem whose candidates are kept.
struct Recorder<'a> {
    problem: &'a ControlPointCost<'a>,
    seen: RefCell<Vec<Vec<f64>>>,
}

impl Problem for Recorder<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.problem.bounds()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.seen.borrow_mut().push(x.to_vec());
        self.problem.cost(x)
    }
}

/// A problem with the plain cost.
struct Plain<'a>(&'a ControlPointCost<'a>);

impl Problem for Plain<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.0.bounds()
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.0.rate_exactly(x).map_or(f64::INFINITY, |cost| cost.cost)
    }
}
