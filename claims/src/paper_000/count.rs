//! A request of the paper: a criterion for the number of control points, compared with fixed numbers.
use super::contenders::GREEDY;
use super::{Unit, case, ours, refused, ur5};
use crate::claim::Claim;
use crate::effect::{Claimed, Effect};
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Summary, wilcoxon};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::control_point_count::{Chosen, Growth};
use taustream_optimizers::{End, Parameters, Progress, Reading, Run};

const RUNS: usize = 16;
const QUICK_EVALUATIONS: usize = 40;
/// Fixed numbers of control points; the paper's is 3.
const FIXED: std::ops::RangeInclusive<usize> = 1..=6;

/// The result of one choice: cost and whether it collides.
type Brought = (f64, bool);

struct CountScene {
    chosen: Chosen,
    fixed: Vec<Brought>,
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let runs = run_context.runs(RUNS, 2).min(RUNS);
    run_context.say(&format!("  the number of control points, {runs} scenes .."));
    let scenes = run_context.each(runs, |run| one(run_context, run))?;
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    let Growth { control_points_max, evaluations_each, saves } = growth(run_context);
    outcome.ours.push(format!(
        "greedy BFOA, case 1's numbers; from one control point upwards, {evaluations_each} evaluations each, until another \
         saves less than {} % of the cost of a free path, {control_points_max} at most; fixed numbers get as many evaluations \
         as the criterion took in the same scene, and begin with the straight line too",
        figures(100.0 * saves)
    ));
    let criterion: Vec<Brought> = scenes.iter().map(|s| (s.chosen.cost, s.chosen.collides)).collect();
    let columns = [
        "",
        "control points",
        "free of collision",
        "cost of the free ones",
        "criterion less:more",
        "evaluations",
    ];
    let note = "Costs with L in m; median [quartiles]. The signed-rank test is over all scenes, collisions included.";
    let mut table = Table::new("The number of control points", "cost J_c", note, &columns);
    let evaluations = Summary::of(&scenes.iter().map(|s| s.chosen.evaluations as f64).collect::<Vec<_>>());
    let counts = Summary::of(&scenes.iter().map(|s| s.chosen.control_points as f64).collect::<Vec<_>>());
    table.row("criterion", row(Cell::Median(counts), &criterion, Cell::None, Cell::Mean(evaluations)));
    let mut effects = Vec::new();
    for (i, count) in FIXED.enumerate() {
        let fixed: Vec<Brought> = scenes.iter().filter_map(|s| s.fixed.get(i).copied()).collect();
        let test = wilcoxon(&costs(&criterion), &costs(&fixed));
        let free = criterion.iter().zip(&fixed).filter(|((_, a), (_, b))| !a && !b);
        let (ours, theirs): (Vec<f64>, Vec<f64>) = free.map(|((a, _), (b, _))| (*a, *b)).unzip();
        let name = format!("M = {count}");
        let effect = Effect::ratio(
            (&name, &theirs),
            ("the criterion", &ours),
            (f64::MIN_POSITIVE, Level::FIVE_PERCENT),
        );
        effects.push(effect.claimed(Claimed::Nothing));
        table.row(
            format!("fixed, M = {count}"),
            row(Cell::Number(count as f64), &fixed, Cell::Test(test), Cell::Mean(evaluations)),
        );
    }
    outcome.tables.push(table);
    let rule = "no fixed number from 1 to 6 saves 1 % at the same evaluations, in scenes that both leave without collision";
    let says = "Section 6 asks for it: a criterion finds the best number of control points (ours: grow while it pays)";
    outcome.claims.push(Claim::tested(says, rule, effects));
    Ok(outcome)
}

fn growth(run_context: &RunContext) -> Growth {
    let ours = Growth::OURS;
    Growth { evaluations_each: run_context.choose(ours.evaluations_each, QUICK_EVALUATIONS), ..ours }
}

fn one(run_context: &RunContext, run: usize) -> Result<CountScene, Stop> {
    let robot = ur5()?;
    let case = case(run_context, &robot, run)?;
    let model = Unit::Metres.model(Reading::Corrected);
    let problem = |count: usize| case.problem(&robot, count, model);
    let optimizer = (GREEDY.make)(Parameters::CASE_1);
    let is_over = || run_context.is_over();
    let chosen = growth(run_context).choose(&problem, optimizer.as_ref(), run_context.seed(run), &is_over);
    let chosen = chosen.map_err(|e| Stop::Refused(e.to_string()))?;
    let mut fixed = Vec::new();
    for count in FIXED {
        let problem = problem(count).map_err(refused)?;
        let guesses = [problem.straight()];
        let mut watch = |_: &Progress| ();
        let evaluations_max = chosen.evaluations;
        let run = Run {
            seed: run_context.seed(run),
            evaluations_max,
            guesses: &guesses,
            is_over: &is_over,
            watch: &mut watch,
        };
        let found = optimizer.minimise(&problem, run)?;
        if found.end == End::Cut {
            return Err(Stop::Interrupted);
        }
        let collides = problem.rate_exactly(&found.x).is_none_or(|c| c.collision);
        fixed.push((found.cost, collides));
    }
    Ok(CountScene { chosen, fixed })
}

fn costs(brought: &[Brought]) -> Vec<f64> {
    brought.iter().map(|(cost, _)| *cost).collect()
}

fn row(count: Cell, brought: &[Brought], test: Cell, evaluations: Cell) -> Vec<Cell> {
    let free: Vec<f64> = brought.iter().filter(|(_, collides)| !collides).map(|(cost, _)| *cost).collect();
    let cost = if free.is_empty() { Cell::None } else { Cell::Median(Summary::of(&free)) };
    vec![count, Cell::Share { count: free.len(), of: brought.len() }, cost, test, evaluations]
}
