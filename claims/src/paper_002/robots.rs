//! Four robots: whether the escape is needed, and what sharing virtual obstacles saves.
use super::{Method, arrived, ours, virtuals};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, Summary};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::planar::{Journey, PlanarScene};

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
    let behind = |j: &Journey| j.arrived.iter().filter(|a| !**a).count();
    let others = plain.iter().filter(|j| behind(j) != STUCK).count();
    Claim::tested(
        "Of four robots plain BFO leaves three behind, RBF brings all to their goals",
        "every run of BFO leaves three behind and every run of RBF none (the scene is ours); one refutes it",
        vec![
            Effect::never("BFO leaves more or fewer than three", [others, plain.len()], Level::FIVE_PERCENT),
            Effect::never(
                "RBF leaves one",
                [robust.len() - arrived(robust), robust.len()],
                Level::FIVE_PERCENT,
            ),
        ],
    )
}

/// Whether sharing saves time: steps of the slowest robot, pair by pair; one that did not arrive took all its steps.
fn sharing(scene: &str, shared: &[Journey], alone: &[Journey]) -> Claim {
    let compare = |figure: fn(&Journey) -> f64, what: &str| {
        let [ours, theirs] = [shared, alone].map(|j| j.iter().map(figure).collect::<Vec<f64>>());
        let name = format!("{what} with sharing");
        Effect::ratio((&name, &ours), ("without", &theirs), (f64::MIN_POSITIVE, Level::FIVE_PERCENT))
    };
    Claim::tested(
        &format!("Sharing virtual obstacles among the robots saves time and way ({scene})"),
        "steps of the slowest robot and the way of all are less with sharing: above 0 (holds), below 1 % (does not hold), or neither",
        vec![compare(distance_cm, "way"), compare(|j| j.steps as f64, "steps of the slowest")],
    )
    .beside(format!("all arrive in {} of {} runs with sharing, {} without", arrived(shared), shared.len(), arrived(alone)))
}
