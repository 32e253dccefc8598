//! Every scene and every method: who arrives, in how many steps, with how many virtual obstacles.
use super::{Method, arrived, has_arrived, ours, pictures, scenes, virtuals};
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::planar::{Journey, Numbers};

/// Printed number of virtual obstacles in the U.
const VIRTUAL_U: f64 = 9.0;
/// Printed times with a moving obstacle and with three (s).
const TIME_MOVING_S: f64 = 11.86;
const TIME_THREE_S: f64 = 8.98;

/// All journeys through one scene, in the order of [`Method::ALL`].
pub(super) struct Visit {
    pub(super) scene: taustream_optimizers::papers::planar::PlanarScene,
    pub(super) journeys: Vec<Vec<Journey>>,
}

impl Visit {
    fn of(&self, method: Method) -> &[Journey] {
        let i = Method::ALL.iter().position(|w| *w == method);
        i.and_then(|i| self.journeys.get(i)).map_or(&[], Vec::as_slice)
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut visits = Vec::new();
    for scene in scenes() {
        run_context.say(&format!("  {} ..", scene.name));
        let methods = Method::ALL.into_iter().map(|method| method.journeys(run_context, &scene, true));
        let journeys = methods.collect::<Result<_, _>>()?;
        visits.push(Visit { scene, journeys });
    }
    Ok(Outcome {
        ours: vec![ours()],
        tables: vec![table(&visits)],
        figures: pictures::figures(&visits),
        claims: claims(&visits),
    })
}

fn table(visits: &[Visit]) -> Table {
    let columns = ["", "way", "arrived", "median steps", "virtual obstacles, median", "most", "nearest (cm)"];
    let note = "Steps of those that arrived; the field has nothing random and goes once; nearest: least distance to \
                anything in any run (a moving obstacle may come up to a robot by itself).";
    let mut table = Table::new("Scenes and ways", "", note, &columns);
    for visit in visits {
        for method in Method::ALL {
            let journeys = visit.of(method);
            let steps: Vec<f64> =
                journeys.iter().filter(|j| has_arrived(j)).map(|j| j.steps as f64).collect();
            let made = virtuals(journeys);
            let nearest = journeys.iter().map(|j| j.nearest_cm).fold(f64::INFINITY, f64::min);
            table.row(
                visit.scene.name,
                vec![
                    Cell::words(method.name()),
                    Cell::Share { count: arrived(journeys), of: journeys.len() },
                    Cell::number(quantile(&steps, 0.5)),
                    Cell::number(quantile(&made, 0.5)),
                    Cell::number(quantile(&made, 1.0)),
                    Cell::number(nearest),
                ],
            );
        }
    }
    table
}

fn claims(visits: &[Visit]) -> Vec<Claim> {
    let named = |name: &str| visits.iter().find(|v| v.scene.name == name);
    let mut claims = Vec::new();
    let traps: Vec<&Visit> = ["l", "u", "wide-u"].into_iter().filter_map(named).collect();
    let lost = |v: &&Visit, method: Method| v.of(method).len() - arrived(v.of(method));
    let never_lost = |method: Method| {
        move |v: &&Visit| {
            Effect::never(
                &format!("{}: {} lost", v.scene.name, method.name()),
                [lost(v, method), v.of(method).len()],
                Level::FIVE_PERCENT,
            )
        }
    };
    let stuck = |v: &&Visit| {
        let journeys = v.of(Method::Plain);
        Effect::never(
            &format!("{}: BFO arrives", v.scene.name),
            [arrived(journeys), journeys.len()],
            Level::FIVE_PERCENT,
        )
    };
    let out = traps.iter().map(never_lost(Method::Robust)).chain(traps.iter().map(stuck));
    claims.push(Claim::tested(
        "RBF gets out of L and U traps and reaches the goal, BFO gets stuck in them",
        "in the L and both U's every run of RBF (virtual obstacle at the trap) arrives and none of BFO; one refutes it",
        out.collect(),
    ));
    claims.push(Claim::tested(
        "The virtual obstacle of eq. 15 as printed, round T(j), frees the robot from L and U traps",
        "every run of that reading arrives; one refutes it",
        traps.iter().map(never_lost(Method::RobustPrinted)).collect(),
    ));
    let discs: Vec<&Visit> = ["static", "three"].into_iter().filter_map(named).collect();
    let touched = |v: &&Visit| {
        let journeys = v.of(Method::Robust);
        let missed = journeys.iter().filter(|j| j.nearest_cm <= 0.0 || !has_arrived(j)).count();
        Effect::never(
            &format!("{}: touched or lost", v.scene.name),
            [missed, journeys.len()],
            Level::FIVE_PERCENT,
        )
    };
    claims.push(Claim::tested(
        "RBF reaches the goal past one and three discs that stand still without touching them",
        "every run arrives and keeps more than nothing between itself and the discs; one refutes it",
        discs.iter().map(touched).collect(),
    ));
    claims.extend(on_the_line(named("disc on the line"), named("disc 1e-12 cm off the line")));
    claims.push(time(named("moving"), "a moving obstacle", TIME_MOVING_S));
    claims.push(time(named("three"), "three obstacles", TIME_THREE_S));
    claims.extend(limits(named("closed room"), named("start in a trap")));
    claims
}

/// The line through start and goal exactly through the disc's centre, where the field's push has no side; and a hair off it.
fn on_the_line(on: Option<&Visit>, off: Option<&Visit>) -> Option<Claim> {
    let (on, off) = (on?, off?);
    let bfo = |v: &Visit| {
        let journeys = v.of(Method::Plain);
        Effect::never(
            &format!("{}: BFO lost", v.scene.name),
            [journeys.len() - arrived(journeys), journeys.len()],
            Level::FIVE_PERCENT,
        )
    };
    let effects = vec![bfo(on)];
    let field = if arrived(on.of(Method::Field)) == 0 { Verdict::Holds } else { Verdict::DoesNotHold };
    let verdict = Verdict::all(effects.iter().map(Effect::verdict).chain([field]));
    let word = |v: &Visit| if arrived(v.of(Method::Field)) == 0 { "is stuck" } else { "arrives" };
    Some(
        Claim::weighed(
            "An obstacle straight ahead traps the potential field, and not the bacteria",
            "with the disc's centre exactly on the straight way the field does not arrive and every run of BFO does",
            verdict,
            effects,
        )
        .beside(format!(
            "on the line the field {}; 1e-12 cm off it the field {}: no robot stands so exactly",
            word(on),
            word(off)
        )),
    )
}

fn time(visit: Option<&Visit>, what: &str, printed_s: f64) -> Claim {
    let steps: Vec<f64> =
        visit.map_or(&[][..], |v| v.of(Method::Robust)).iter().map(|j| j.steps as f64).collect();
    let Numbers { step_cm, .. } = Numbers::OURS;
    Claim::unchecked(
        &format!("With {what} the goal is reached after {printed_s} s"),
        "neither the length of a step nor its time is printed",
        format!("ours: median {} steps of {step_cm} cm", quantile(&steps, 0.5)),
    )
}

/// What the paper's last section calls open.
fn limits(room: Option<&Visit>, trap: Option<&Visit>) -> [Claim; 2] {
    let journeys = |v: Option<&Visit>| v.map_or(Vec::new(), |v| v.of(Method::Robust).to_vec());
    let (room, trap) = (journeys(room), journeys(trap));
    let made = virtuals(&room);
    let freed = arrived(&trap);
    [
        Claim::tested(
            "In a closed room virtual obstacles are made without end",
            "no run arrives, and the median run makes more than the nine of the U (we cap them)",
            vec![
                Effect::never("closed room: RBF arrives", [arrived(&room), room.len()], Level::FIVE_PERCENT),
                Effect::above(("virtual obstacles", &made), VIRTUAL_U, ("obstacles", Level::FIVE_PERCENT)),
            ],
        ),
        Claim::tested(
            "A robot that starts in a trap has no trace to go back along and stays",
            "no run arrives; one refutes it (ours goes back to its start and on from there)",
            vec![Effect::never("start in a trap: RBF arrives", [freed, trap.len()], Level::FIVE_PERCENT)],
        ),
    ]
}
