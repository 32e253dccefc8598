//! Measures the cost function and whole runs of the paper's optimiser with it.
//!
//! Everything that is compared is timed in turns in one process, so that whatever else the machine does slows all of
//! it. Times are of one thread: the paper's bacteria move one after another, each by the result of the last one.
use crate::failure::Failure;
use serde::Serialize;
use std::cell::RefCell;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_planner::cost::{ControlPointCost, Level};
use taustream_planner::optimize::{Found, Ibfoa, Optimizer, Parameters, Problem, Progress, Run};
use taustream_planner::papers::control_points::{CONTROL_POINTS, Case};
use taustream_planner::{CostModel, PaperCost, draw::Draw};

/// Decision vectors that are timed together.
const BATCH: usize = 40;
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
    /// Time of one by plain f64, median.
    pub(super) plain_us: f64,
    /// The fast cost by levels.
    pub(super) levels: Vec<AtLevel>,
}

/// The fast cost on one level.
#[derive(Debug, Serialize)]
pub(super) struct AtLevel {
    /// The level.
    pub(super) level: &'static str,
    /// Time of an evaluation: median, and of the fastest batch.
    pub(super) p50_us: f64,
    pub(super) least_us: f64,
    /// Median of the ratios of plain to fast, batch by batch.
    pub(super) times_as_fast: f64,
    /// Largest relative error of the cost.
    pub(super) relative_error: f64,
    /// Penalties or collisions that differ in any bit; there must be none.
    pub(super) differing: usize,
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
}

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
    let mut draw = Draw::new(1, 0);
    let anywhere = |_| problem.bounds().iter().map(|[low, high]| draw.within(*low, *high)).collect();
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
    let case = Case::draw(robot, &model, seed).ok_or_else(|| {
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
    let mut plain_us = Vec::new();
    let mut fast_us = vec![Vec::new(); levels.len()];
    let started = Instant::now();
    while plain_us.is_empty() || started.elapsed() < share {
        for batch in points.chunks(BATCH) {
            plain_us.push(time_batch(batch, |x| problem.rate_exactly(x)));
            for (fast, us) in fast.iter().zip(&mut fast_us) {
                us.push(time_batch(batch, |x| fast.rate(x)));
            }
        }
    }
    let exact = rated(points, |x| problem.rate_exactly(x))?;
    let colliding = exact.iter().filter(|cost| cost.collision).count();
    let mut at = Vec::with_capacity(levels.len());
    for ((level, fast), us) in levels.iter().zip(&fast).zip(&fast_us) {
        let ratios = plain_us.iter().zip(us).map(|(plain, fast)| plain / fast).collect();
        let costs = rated(points, |x| fast.rate(x))?;
        let pairs = || exact.iter().zip(&costs);
        let differs = |(a, b): &(&PaperCost, &PaperCost)| {
            a.collision != b.collision || a.penalty.to_bits() != b.penalty.to_bits()
        };
        at.push(AtLevel {
            level: level.name(),
            p50_us: median(us.clone()),
            least_us: us.iter().copied().fold(f64::INFINITY, f64::min),
            times_as_fast: median(ratios),
            relative_error: pairs().map(|(a, b)| (b.cost / a.cost - 1.0).abs()).fold(0.0, f64::max),
            differing: pairs().filter(differs).count(),
        });
    }
    let colliding_percent = 100.0 * colliding as f64 / points.len().max(1) as f64;
    Ok(Set { candidates, colliding_percent, plain_us: median(plain_us), levels: at })
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

fn time_run(problem: &dyn Problem, parameters: Parameters, seed: u64) -> Result<(f64, usize), Failure> {
    let started = Instant::now();
    let found = optimise(problem, parameters, seed)?;
    Ok((started.elapsed().as_secs_f64(), found.progress.evaluations))
}

fn timed(mut runs: Vec<(f64, usize)>) -> Runs {
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (median_s, evaluations) = runs.get(runs.len() / 2).copied().unwrap_or_default();
    let least_s = runs.first().map_or(0.0, |run| run.0);
    Runs { runs: runs.len(), evaluations, median_s, least_s }
}

fn optimise(problem: &dyn Problem, parameters: Parameters, seed: u64) -> Result<Found, Failure> {
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
