//! RRT in the paper's scenes, and what its step, which the paper does not print, does to the comparison.
use super::contenders::IBFOA;
use super::paper_field::{CHECKED_RAD, PaperField, STEP_RAD};
use super::path::{PathCost, TipPath};
use super::planners::{LEAST, bacteria, poses};
use super::{K, case, ur5};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile};
use crate::swept::{At, FACTORS, Values, at_every, label};
use crate::table::{Cell, Table};
use std::cell::Cell as Count;
use taustream_arm::Robot;
use taustream_motion::JointArray;
use taustream_motion::profile::TauJStar;
use taustream_optimizers::papers::control_points::Case;
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::rrt;

/// Most way points of a tree's path that its rating takes.
const WAY_POINTS_MAX: usize = 100;
/// Checks of a tree over those of the bacteria, over the steps: what is not found by then is left out.
const SHARE_OF_CHECKS: usize = 10;

/// A tree's path through a scene; none when it finds none, or one of too many way points.
pub(super) fn tree(
    run_context: &RunContext,
    (robot, case): (&Robot, &Case),
    step_rad: f64,
    checks_max: usize,
    run: usize,
) -> Result<Option<Vec<JointArray>>, Stop> {
    let field = PaperField { robot, scene: &case.scene, step_rad, checks: Count::new(0), run_context };
    let [start, goal] = &case.ends_rad;
    let path = rrt(&field, start, goal, checks_max, &mut SeededRng::new(run_context.seed(run), 7)).path;
    if run_context.is_over() {
        return Err(Stop::Interrupted);
    }
    Ok(path.filter(|p| p.len() <= WAY_POINTS_MAX))
}

fn worth(robot: &Robot, case: &Case, corners: Vec<JointArray>) -> Result<PathCost, Stop> {
    let profile = Box::new(TauJStar::new(K).map_err(|e| Stop::Refused(e.to_string()))?);
    TipPath { corners, profile }.worth(robot, &case.scene)
}

/// IBFOA's path of the tip against that of trees with steps over a decade.
pub(super) fn over_steps(run_context: &RunContext, runs: usize) -> Result<(Table, Claim), Stop> {
    let robot = ur5()?;
    let steps = [FACTORS[0] * STEP_RAD, STEP_RAD, FACTORS[1] * STEP_RAD];
    run_context.say("  the tree's step ..");
    let lengths = run_context.each(runs, |run| {
        let case = case(run_context, &robot, run)?;
        let (corners, evaluations) = bacteria(run_context, &robot, &case, &IBFOA, run)?;
        let ours = worth(&robot, &case, corners)?;
        let mut all = vec![(!ours.cost.collision).then_some(ours.cost.path_length_m)];
        for step_rad in steps {
            let checks_max = evaluations * poses() / SHARE_OF_CHECKS;
            let found = tree(run_context, (&robot, &case), step_rad, checks_max, run)?;
            let rated = found.map(|corners| worth(&robot, &case, corners)).transpose()?;
            all.push(rated.filter(|r| !r.cost.collision).map(|r| r.cost.path_length_m));
        }
        Ok(all)
    })?;
    let columns = ["", "found free", "path of the tip (m), median", "IBFOA's less by (%)"];
    let note = format!("{runs} scenes; poses checked every {CHECKED_RAD} rad; effect [95 % interval]");
    let mut table = Table::new("RRT over its step", "", &note, &columns);
    let mut settings = Vec::new();
    for (i, step_rad) in steps.into_iter().enumerate() {
        let pairs =
            lengths.iter().filter_map(|all| Some((all.first().copied()??, all.get(i + 1).copied()??)));
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs.unzip();
        let effect = |level: Level| Effect::ratio(("IBFOA", &ours), ("RRT", &theirs), (LEAST, level));
        let label = label("RRT: step (rad)", step_rad);
        table.row(
            label.clone(),
            vec![
                Cell::Share { count: lengths.iter().filter(|all| all[i + 1].is_some()).count(), of: runs },
                Cell::number(quantile(&theirs, 0.5)),
                Cell::estimate(effect(Level::FIVE_PERCENT).estimate),
            ],
        );
        settings.push(At::every(label, Values::of(steps.len()), |level| vec![effect(level)]));
    }
    let claim = at_every(
        "IBFOA-Tau-J* finds a shorter path of the tip than RRT",
        "its path is less, in scenes where both are free: above 0 (holds), below 1 % (does not hold), or neither",
        &settings,
    );
    Ok((table, claim))
}
