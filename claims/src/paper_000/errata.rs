//! What the paper's equations say when they are taken at their word: swarming, summed distances.
use super::contenders::BFOA;
use super::course::{Course, equal_evaluations, follow};
use super::paper_field::{random_pose, touches};
use super::{Unit, case, ours, refused, ur5};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Summary, wilcoxon};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::control_points::CONTROL_POINTS;
use taustream_optimizers::{Parameters, Reading, Swarming};
use taustream_planner::rng::SeededRng;

const RUNS: usize = 20;
const QUICK: usize = 260;
/// Random poses in random scenes.
const POSES: usize = 4_000;
/// Squared distances (rad²) at which swarming is looked at: it is nothing beyond 1.
const SQUARES: u32 = 100_000;

/// Computes them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome { ours: ours(), ..Outcome::default() };
    outcome.claims.push(summed_distance(run_context)?);
    let (table, claim) = swarming(run_context)?;
    outcome.tables.push(table);
    outcome.claims.push(claim);
    Ok(outcome)
}

/// Eq. 3.9: the sum over the links, of poses that touch something by the least distance.
fn summed_distance(run_context: &RunContext) -> Result<Claim, Stop> {
    let robot = ur5()?;
    let wanted = run_context.choose(POSES, POSES / 10);
    let (mut touching, mut seen, mut drawn) = (0, 0, 0);
    while touching < wanted && drawn < 1_000 * wanted {
        let case = case(run_context, &robot, drawn)?;
        let mut rng = SeededRng::new(run_context.seed(drawn), 9);
        for _ in 0..20 {
            drawn += 1;
            let pose = random_pose(&robot, &mut rng);
            if touching < wanted && touches(&robot, &case.scene, &pose, Reading::Corrected) {
                touching += 1;
                seen += usize::from(touches(&robot, &case.scene, &pose, Reading::Printed));
            }
        }
        if run_context.is_over() {
            return Err(Stop::Interrupted);
        }
    }
    Ok(Claim::tested(
        "The penalty of eq. 3.8 and 3.9, with the distances to all links added up, sees collisions",
        "more than half of random poses of a UR5 with a link nearer than radius and expansion have a penalty: above 0 (holds), below \
         10 points (does not hold), or neither",
        vec![Effect::majority("a penalty", [seen, touching], Level::FIVE_PERCENT)],
    ))
}

/// Eq. 3.3 against the cost it is added to, and what switching it off changes.
fn swarming(run_context: &RunContext) -> Result<(Table, Claim), Stop> {
    let robot = ur5()?;
    let runs = run_context.runs(RUNS, 3);
    run_context.say(&format!("  BFOA with and without swarming, {runs} runs .."));
    let budget = run_context.choose(usize::MAX, QUICK);
    let go = |swarming: Option<Swarming>| {
        run_context.each(runs, |run| {
            let model = Unit::Metres.model(Reading::Corrected);
            let problem =
                case(run_context, &robot, run)?.problem(&robot, CONTROL_POINTS, model).map_err(refused)?;
            let parameters = Parameters { swarming, ..Parameters::CASE_1 };
            follow(run_context, (BFOA.make)(parameters).as_ref(), &problem, run_context.seed(run), budget)
        })
    };
    let (with, without) = (go(Some(Swarming::PAPER))?, go(None)?);
    let (best_with, best_without) = (bests(&with), bests(&without));
    let largest = largest_neighbour(&Swarming::PAPER) * (Parameters::CASE_1.population - 1) as f64;
    let least_cost = Summary::of(&best_with).least;
    let [a, b] = equal_evaluations(&with, &without);
    let test = wilcoxon(&a, &b);
    let columns = ["", "best so far", "less:more than without"];
    let note = format!("BFOA, case 1, L in m, {runs} runs, corrected; at equal evaluations.");
    let mut table = Table::new("Swarming", "cost J_c", &note, &columns);
    table.row("with J_ar", vec![Cell::Median(Summary::of(&best_with)), Cell::Test(test)]);
    table.row("without", vec![Cell::Median(Summary::of(&best_without)), Cell::None]);
    let claim = Claim::tested(
        "Swarming (eq. 3.3) guides the bacteria",
        "with it BFOA finds less than without, at equal evaluations: above 0 (holds), below 1 % (does not hold), or neither",
        vec![Effect::ratio(("with swarming", &a), ("without", &b), (f64::MIN_POSITIVE, Level::FIVE_PERCENT))],
    )
    .beside(format!("J_ar of 11 neighbours is at most {} beside costs from {}", figures(largest), figures(least_cost)));
    Ok((table, claim))
}

fn bests(courses: &[Course]) -> Vec<f64> {
    courses.iter().map(|c| c.found.cost).collect()
}

/// Largest magnitude of what one neighbour adds, at any distance.
fn largest_neighbour(swarming: &Swarming) -> f64 {
    let ([d, w_a], [h, w_r]) = (swarming.attraction, swarming.repulsion);
    let at = |i: u32| {
        let r2 = f64::from(i) / f64::from(SQUARES);
        (h * (-w_r * r2).exp() - d * (-w_a * r2).exp()).abs()
    };
    (0..=SQUARES).map(at).fold(0.0, f64::max)
}
