//! Four robots: whether the escape is needed, and what sharing virtual obstacles saves.
use super::{Method, arrived, has_arrived, ours, virtuals};
use crate::claim::Claim;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Paired, Summary, wilcoxon};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::planar::{Journey, Numbers, PlanarScene};

/// Printed: robots that plain BFO leaves behind.
const STUCK: usize = 3;

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome { ours: vec![ours()], ..Outcome::default() };
    let columns =
        ["", "all arrived", "robots that arrived", "steps of the slowest", "virtual obstacles", "way (cm)"];
    let note = "Median [quartiles] over runs; way: all robots' together, retreats included.";
    let mut table = Table::new("Four robots", "", note, &columns);
    let scenes = [("four-robots", apart()), ("one trap for all", together())];
    for (name, scene) in scenes {
        let Some(scene) = scene else { continue };
        run_context.say(&format!("  {name} ..",));
        let plain = Method::Plain.journeys(run_context, &scene, true)?;
        let shared = Method::Robust.journeys(run_context, &scene, true)?;
        let alone = Method::Robust.journeys(run_context, &scene, false)?;
        for (label, journeys) in [("BFO", &plain), ("RBF, shared", &shared), ("RBF, each its own", &alone)] {
            table.row(format!("{name}: {label}"), cells(journeys));
        }
        if name == "four-robots" {
            outcome.claims.push(left_behind(&plain, &shared));
        }
        outcome.claims.push(sharing(name, &shared, &alone));
    }
    outcome.tables.push(table);
    Ok(outcome)
}

/// The four of the paper's last scene, each before an obstacle of its own.
fn apart() -> Option<PlanarScene> {
    PlanarScene::by_name("four-robots")
}

/// The four one behind the other before the same U: where sharing has most to give.
fn together() -> Option<PlanarScene> {
    let u = PlanarScene::by_name("wide-u")?;
    let [start, goal] = u.robots.first().copied()?;
    let robot = |i: u32| {
        let along = 14.0 * f64::from(i);
        let away = [goal[0] - start[0], goal[1] - start[1]];
        let length = away[0].hypot(away[1]);
        // Goals beside each other, so that no robot waits for the place of another.
        [
            [start[0] - along * away[0] / length, start[1] - along * away[1] / length],
            [goal[0] + along, goal[1]],
        ]
    };
    Some(PlanarScene {
        name: "one trap for all",
        robots: (0..4).map(robot).collect(),
        obstacles: u.obstacles,
    })
}

fn cells(journeys: &[Journey]) -> Vec<Cell> {
    let median = |values: Vec<f64>| Cell::Median(Summary::of(&values));
    let robots = journeys.iter().map(|j| j.arrived.iter().filter(|a| **a).count() as f64).collect();
    vec![
        Cell::Share { count: arrived(journeys), of: journeys.len() },
        median(robots),
        median(journeys.iter().map(|j| j.steps as f64).collect()),
        median(virtuals(journeys)),
        median(journeys.iter().map(distance_cm).collect()),
    ]
}

fn distance_cm(journey: &Journey) -> f64 {
    let step = |p: &[[f64; 2]]| match p {
        [a, b] => (a[0] - b[0]).hypot(a[1] - b[1]),
        _ => 0.0,
    };
    journey.paths_cm.iter().flat_map(|p| p.windows(2)).map(step).sum()
}

fn left_behind(plain: &[Journey], robust: &[Journey]) -> Claim {
    let stuck: Vec<f64> = plain.iter().map(|j| j.arrived.iter().filter(|a| !**a).count() as f64).collect();
    let median = Summary::of(&stuck).median;
    Claim::decided(
        "Of four robots plain BFO leaves three behind, RBF brings all to their goals",
        "the median run of BFO leaves three behind and every run of RBF none (the scene is ours)",
        (median - STUCK as f64).abs() < 0.5 && robust.iter().all(has_arrived),
        format!(
            "BFO leaves {median} behind; RBF: {} of {} runs with all there",
            arrived(robust),
            robust.len()
        ),
    )
}

/// Whether sharing saves time: steps of the slowest robot, pair by pair; one that did not arrive took all its steps.
fn sharing(scene: &str, shared: &[Journey], alone: &[Journey]) -> Claim {
    let figures = |journeys: &[Journey]| -> Vec<f64> { journeys.iter().map(distance_cm).collect() };
    let steps = |journeys: &[Journey]| -> Vec<f64> { journeys.iter().map(|j| j.steps as f64).collect() };
    let [method, slowest] =
        [figures, steps].map(|f: fn(&[Journey]) -> Vec<f64>| wilcoxon(&f(shared), &f(alone)));
    let text = |p: Paired| format!("{} less, {} more, p = {}", p.less, p.more, crate::figures(p.p));
    Claim::decided(
        &format!("Sharing virtual obstacles among the robots saves time and way ({scene})"),
        "steps of the slowest robot and the way of all are less with sharing, by the signed-rank test at 5 %",
        method.is_less() && slowest.is_less(),
        format!(
            "way: {}; steps of the slowest: {} (steps of {} cm)",
            text(method),
            text(slowest),
            Numbers::OURS.step_cm
        ),
    )
}
