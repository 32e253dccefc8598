//! Foraging with and without virtual obstacles, and RRT-Connect, each once on the same budget of poses.
use super::{Contest, Problem};
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Summary, wilcoxon};
use crate::table::{Cell, Table};
use taustream_arm::Robot;
use taustream_planner::budget::Budget;
use taustream_planner::foraging::{Numbers, forage};
use taustream_planner::pipeline::search_checks;
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::{Space, rrt_connect};
use taustream_planner::world::World;

/// What one search came to.
#[derive(Clone, Copy, Default)]
struct Tried {
    found: bool,
    /// Poses checked.
    checks: usize,
    /// Virtual obstacles set.
    virtuals: usize,
}

/// One problem: with virtual obstacles, without, and with trees.
struct Three {
    set: usize,
    tried: [Tried; 3],
}

/// The table.
pub(super) fn table(run_context: &RunContext, contest: &Contest) -> Result<Table, Stop> {
    let checks_max = search_checks(contest.deadline);
    let all = contest.problems();
    let three = run_context.each(all.len(), |i| {
        let Some((set, robot, problem)) = all.get(i) else { return Err(Stop::Interrupted) };
        Ok(Three { set: *set, tried: attempt(robot, problem, checks_max, run_context.seed(problem.id))? })
    })?;
    let note = format!(
        "One search each, of {checks_max} poses at most. RBF is foraging with virtual obstacles, BFO the same without (from \
         the start again when it is trapped). The test pairs the failures: problems that only BFO fails, then those that \
         only RBF fails. Poses are medians over the paths found, virtual obstacles over all problems with quartiles."
    );
    let columns = [
        "set",
        "RBF found",
        "BFO found",
        "only BFO fails:only RBF fails",
        "RRT-Connect found",
        "RBF poses",
        "BFO poses",
        "RRT-Connect poses",
        "virtual obstacles",
        "most",
    ];
    let mut table = Table::new("Foraging with and without virtual obstacles", "", &note, &columns);
    for (i, set) in contest.sets.iter().enumerate() {
        let of_set: Vec<&Three> = three.iter().filter(|t| t.set == i).collect();
        table.row(set.name.clone(), cells(&of_set));
    }
    table.row("all", cells(&three.iter().collect::<Vec<_>>()));
    Ok(table)
}

fn cells(three: &[&Three]) -> Vec<Cell> {
    let tried = |k: usize| three.iter().map(move |t| t.tried[k]);
    let found = |k: usize| Cell::Share { count: tried(k).filter(|t| t.found).count(), of: three.len() };
    let failures = |k: usize| tried(k).map(|t| if t.found { 0.0 } else { 1.0 }).collect::<Vec<_>>();
    let poses = |k: usize| {
        let checks: Vec<f64> = tried(k).filter(|t| t.found).map(|t| t.checks as f64).collect();
        Cell::number(Summary::of(&checks).median)
    };
    let virtuals = Summary::of(&tried(0).map(|t| t.virtuals as f64).collect::<Vec<_>>());
    let (median, most) = if three.is_empty() {
        (Cell::None, Cell::None)
    } else {
        (Cell::Median(virtuals), Cell::number(virtuals.most))
    };
    let test = Cell::Test(wilcoxon(&failures(0), &failures(1)));
    vec![found(0), found(1), test, found(2), poses(0), poses(1), poses(2), median, most]
}

fn attempt(robot: &Robot, problem: &Problem, checks_max: usize, seed: u64) -> Result<[Tried; 3], Stop> {
    let world = World::new(robot, &problem.scene).map_err(Stop::Refused)?;
    let budget = Budget::unbounded();
    let ends = [&problem.start_rad, &problem.goal_rad];
    let mut tried = [Tried::default(); 3];
    for (tried, numbers) in tried.iter_mut().zip([Some(Numbers::ROBUST), Some(Numbers::PLAIN), None]) {
        let (space, mut rng) = (Space::new(&world, &budget), SeededRng::new(seed, 0));
        let (found, virtuals) = match numbers {
            Some(numbers) => {
                let foraged = forage(&space, ends, &numbers, checks_max, &mut rng)?;
                (foraged.path.is_some(), foraged.virtuals.len())
            }
            None => (rrt_connect(&space, ends[0], ends[1], checks_max, &mut rng).path.is_some(), 0),
        };
        *tried = Tried { found, checks: space.checks(), virtuals };
    }
    Ok(tried)
}
