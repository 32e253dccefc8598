//! Every scene and every method: who arrives, in how many steps, with how many virtual obstacles.
use super::{Method, arrived, has_arrived, ours, pictures, scenes, virtuals};
use crate::claim::Claim;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Summary, quantile};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::planar::{Journey, Numbers};

/// Printed numbers of virtual obstacles in the L and in the U.
const VIRTUAL_L: f64 = 3.0;
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

    fn share(&self, method: Method) -> String {
        format!("{} {}/{}", method.name(), arrived(self.of(method)), self.of(method).len())
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
    let shares = |visits: &[&Visit], methods: &[Method]| {
        let one = |v: &&Visit| {
            format!(
                "{}: {}",
                v.scene.name,
                methods.iter().map(|w| v.share(*w)).collect::<Vec<_>>().join(", ")
            )
        };
        visits.iter().map(one).collect::<Vec<_>>().join("; ")
    };
    let all = |visits: &[&Visit], method: Method| {
        visits.iter().all(|v| arrived(v.of(method)) == v.of(method).len())
    };
    let none = |visits: &[&Visit], method: Method| visits.iter().all(|v| arrived(v.of(method)) == 0);

    claims.push(Claim::decided(
        "RBF gets out of L and U traps and reaches the goal, BFO gets stuck in them",
        "in the L and both U's every run of RBF (virtual obstacle at the trap) arrives and none of BFO",
        all(&traps, Method::Robust) && none(&traps, Method::Plain),
        shares(&traps, &[Method::Robust, Method::Plain]),
    ));
    claims.push(Claim::decided(
        "The virtual obstacle of eq. 15 as printed, round T(j), frees the robot from L and U traps",
        "every run of that reading arrives",
        all(&traps, Method::RobustPrinted),
        shares(&traps, &[Method::RobustPrinted]),
    ));
    let discs: Vec<&Visit> = ["static", "moving", "three"].into_iter().filter_map(named).collect();
    let touched = |v: &Visit| v.of(Method::Robust).iter().filter(|j| j.nearest_cm <= 0.0).count();
    claims.push(Claim::decided(
        "RBF reaches the goal past a static, a moving and three discs without touching them",
        "every run arrives and keeps more than nothing between itself and the discs",
        all(&discs, Method::Robust) && discs.iter().all(|v| touched(v) == 0),
        format!(
            "{}; touched in {} runs",
            shares(&discs, &[Method::Robust]),
            discs.iter().map(|v| format!("{} ({})", touched(v), v.scene.name)).collect::<Vec<_>>().join(", ")
        ),
    ));
    let in_line: Vec<&Visit> = named("static").into_iter().collect();
    claims.push(Claim::decided(
        "An obstacle straight ahead traps the potential field, and not the bacteria",
        "with the disc's centre on the straight way the field does not arrive and every run of BFO does",
        none(&in_line, Method::Field) && all(&in_line, Method::Plain),
        shares(&in_line, &[Method::Field, Method::Plain]),
    ));
    let two: Vec<&Visit> = named("two-discs").into_iter().collect();
    let trapped = two.iter().flat_map(|v| v.of(Method::Robust)).filter(|j| !j.virtuals.is_empty()).count();
    claims.push(Claim::decided(
        "Two discs beside each other are a local minimum that RBF leaves with a virtual obstacle",
        "some run of RBF makes a virtual obstacle there (the discs' radii are not printed)",
        trapped > 0,
        format!("{trapped} runs did; {}", shares(&two, &[Method::Plain, Method::Robust, Method::Field])),
    ));
    claims.push(count(named("l"), "L", VIRTUAL_L));
    claims.push(count(named("u"), "U", VIRTUAL_U));
    claims.push(time(named("moving"), "a moving obstacle", TIME_MOVING_S));
    claims.push(time(named("three"), "three obstacles", TIME_THREE_S));
    claims.extend(limits(named("closed room"), named("start in a trap")));
    claims
}

/// The number of virtual obstacles: the sizes are not printed, so that only the order of magnitude can be compared.
fn count(visit: Option<&Visit>, shape: &str, printed: f64) -> Claim {
    let made = Summary::of(&virtuals(visit.map_or(&[], |v| v.of(Method::Robust))));
    Claim::decided(
        &format!("The {shape} takes {printed} virtual obstacles"),
        "the printed number lies between the least and the most of our runs (the sizes are ours)",
        made.least <= printed && printed <= made.most,
        format!("least {}, median {}, most {}", made.least, made.median, made.most),
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
    let made = Summary::of(&virtuals(&room));
    let freed = arrived(&trap);
    [
        Claim::decided(
            "In a closed room virtual obstacles are made without end",
            "no run arrives, and the median run makes more than the nine of the U",
            arrived(&room) == 0 && made.median > VIRTUAL_U,
            format!(
                "{} virtual obstacles in the median run, {} at most (we cap them)",
                made.median, made.most
            ),
        ),
        Claim::decided(
            "A robot that starts in a trap has no trace to go back along and stays",
            "no run arrives",
            freed == 0,
            format!("{freed} of {} runs arrived (ours goes back to its start and on from there)", trap.len()),
        ),
    ]
}
