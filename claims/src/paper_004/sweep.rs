//! Numbers that the paper does not print, each over a decade round ours: spheres of a link, how near the goal counts as
//! reached, gravity.
use super::energy::{Spent, spent};
use super::via::{
    MAJORITY_RULE, PRINTED_LIMIT, Walk, bends, contact, near, task, touching, via_points, walk,
};
use crate::claim::Claim;
use crate::effect::Effect;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile};
use crate::swept::{At, FACTORS, Values, at_every, at_some, label};
use crate::table::{Cell, Table};
use taustream_optimizers::Reading;
use taustream_optimizers::papers::two_link::TwoLink;
use taustream_optimizers::papers::two_link_via::ViaTask;

/// Thirty runs without an event make it less frequent than one in eight.
const RUNS: usize = 30;
/// Runs that tell in which angle the way bends: the interval is ±7 points.
const BENDING_RUNS: usize = 200;
const QUICK: usize = 2;
/// A decade round our five.
const SPHERES: [u32; 2] = [2, 16];

/// What the runs at one value brought.
struct Setting {
    label: String,
    /// With the penalty, angles in degrees (via points only) and in radians.
    degrees: Vec<Walk>,
    radians: Vec<Walk>,
    contact: f64,
    bends: [usize; 2],
    /// Without the penalty.
    free: Vec<Walk>,
}

/// The tasks of a value: no penalty, degrees, radians.
type Tasks = [ViaTask; 3];

fn tasks(change: impl Fn(&mut ViaTask)) -> Tasks {
    [(false, Reading::Corrected), (true, Reading::Printed), (true, Reading::Corrected)].map(
        |(has, reading)| {
            let mut task = task(has, reading, 0.0);
            change(&mut task);
            task
        },
    )
}

impl Setting {
    fn of(run_context: &RunContext, label: String, [free, degrees, radians]: Tasks) -> Result<Self, Stop> {
        run_context.say(&format!("  {label} .."));
        let runs = run_context.runs(RUNS, QUICK).min(RUNS);
        let many = run_context.runs(BENDING_RUNS, QUICK).min(BENDING_RUNS);
        let points = |task: &ViaTask, runs: usize| {
            run_context.each(runs, |run| Ok(via_points(task, run_context.seed(run))?))
        };
        let walks = |task: &ViaTask| -> Result<Vec<Walk>, Stop> {
            Ok(points(task, runs)?.into_iter().map(|path| Walk::of_points(task, path)).collect())
        };
        let paths: Vec<_> = points(&radians, many)?.into_iter().map(|path| path.via_rad).collect();
        Ok(Self {
            label,
            degrees: walks(&degrees)?,
            radians: run_context.each(runs, |run| walk(&radians, run_context.seed(run)))?,
            contact: contact(&radians),
            bends: [bends(&paths), paths.len()],
            free: walks(&free)?,
        })
    }

    fn never(&self, walks: &[Walk], which: usize, level: Level) -> Vec<Effect> {
        vec![Effect::never("touch", [touching(walks, self.contact, which), walks.len()], level)]
    }

    fn cells(&self) -> Vec<Cell> {
        let share = |walks: &[Walk], which: usize| Cell::Share {
            count: touching(walks, self.contact, which),
            of: walks.len(),
        };
        let median = |walks: &[Walk]| {
            Cell::number(quantile(&walks.iter().map(|w| w.least[0]).collect::<Vec<_>>(), 0.5))
        };
        vec![
            share(&self.degrees, 0),
            share(&self.radians, 0),
            share(&self.radians, 2),
            median(&self.free),
            median(&self.degrees),
            median(&self.radians),
            Cell::Share { count: self.bends[0], of: self.bends[1] },
        ]
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut settings = vec![Setting::of(run_context, "ours".to_owned(), tasks(|_| ()))?];
    for spheres in SPHERES {
        let label = label("spheres of a link", f64::from(spheres));
        settings.push(Setting::of(run_context, label, tasks(|task| task.spheres = spheres))?);
    }
    let ours = ViaTask::paper_004(Reading::Corrected);
    for factor in FACTORS {
        let reached_rad = factor * ours.reached_rad;
        let label = label("reached within (rad)", reached_rad);
        settings.push(Setting::of(run_context, label, tasks(|task| task.reached_rad = reached_rad))?);
    }
    let gravities = FACTORS.map(|factor| factor * TwoLink::PAPER_004.gravity);
    for gravity in gravities {
        let tasks = tasks(|task| task.arm.gravity = gravity);
        settings.push(Setting::of(run_context, label("g", gravity), tasks)?);
    }
    let mut outcome = Outcome { tables: vec![table(&settings)], ..Outcome::default() };
    outcome.claims = claims(&settings);
    energies(run_context, gravities, &mut outcome)?;
    Ok(outcome)
}

fn table(settings: &[Setting]) -> Table {
    let columns = [
        "",
        "degrees: via points touch",
        "radians: via points touch",
        "radians: cubics touch",
        "no penalty: least distance, median",
        "degrees: least distance, median",
        "radians: least distance, median",
        "radians: φ bends more than θ",
    ];
    let note =
        "ours: 5 spheres a link, the goal reached within 0.01 rad, g = 9.81; each row changes one of them";
    let mut table = Table::new("Numbers that the paper does not print", "", note, &columns);
    settings.iter().for_each(|setting| table.row(setting.label.clone(), setting.cells()));
    table
}

fn claims(settings: &[Setting]) -> Vec<Claim> {
    let values = Values::of(settings.len());
    let some = |effects: &dyn Fn(&Setting, Level) -> Vec<Effect>| -> Vec<At> {
        settings.iter().map(|s| At::some(&*s.label, values, |level| effects(s, level))).collect()
    };
    let every = |effects: &dyn Fn(&Setting, Level) -> Vec<Effect>| -> Vec<At> {
        settings.iter().map(|s| At::every(&*s.label, values, |level| effects(s, level))).collect()
    };
    let touch = "no run has a via point whose spheres touch; one refutes it";
    let nearest = |setting: &Setting| {
        // Either reading will do: as many values again.
        let values = Values::of(2 * settings.len());
        let at = |name: &str, walks: &[Walk]| {
            At::some(&*setting.label, values, |level| vec![near(name, walks, level)]).verdict
        };
        let readings = [at("degrees", &setting.degrees), at("radians", &setting.radians)];
        At { label: setting.label.clone(), verdict: crate::claim::Verdict::any(readings) }
    };
    vec![
        at_some(
            "With K = 10, 10, 100 the via points avoid the obstacles (angles in degrees)",
            touch,
            &some(&|s, level| s.never(&s.degrees, 0, level)),
        ),
        at_every(
            "With K = 10, 10, 100 the via points avoid the obstacles (angles in radians)",
            touch,
            &every(&|s, level| s.never(&s.radians, 0, level)),
        ),
        at_some(
            "The fitted trajectory avoids the obstacles (angles in radians)",
            "no run's cubics touch; one refutes it",
            &some(&|s, level| s.never(&s.radians, 2, level)),
        ),
        at_some(
            "The least distance stays near 1.29 (figure 5)",
            "the median least distance at the via points is within a tenth of it, in degrees or in radians",
            &settings.iter().map(nearest).collect::<Vec<_>>(),
        ),
        at_every(
            "Without the penalty the distance falls below 1.29 (figure 6)",
            "in every run; one refutes it",
            &every(&|s, level| {
                let above = s.free.iter().filter(|w| w.least[0] >= PRINTED_LIMIT).count();
                vec![Effect::never("it stays above", [above, s.free.len()], level)]
            }),
        ),
        at_some(
            "θ goes on as without obstacles, φ bends away (figure 4)",
            MAJORITY_RULE,
            &some(&|s, level| vec![Effect::majority("φ bends more", s.bends, level)]),
        ),
    ]
}

/// What stage 2 says of energy, over gravity.
fn energies(run_context: &RunContext, [low, high]: [f64; 2], outcome: &mut Outcome) -> Result<(), Stop> {
    let columns = [
        "",
        "work, eq. 12 as printed",
        "work, z upward",
        "work, at rest at every point",
        "speed at the goal, as printed (rad/s)",
        "z upward (rad/s)",
    ];
    let note = "the way of the paper's test without obstacles; work is ∫|torque · speed| dt";
    let mut table = Table::new("Least energy over gravity", "relative units", note, &columns);
    let (mut saves, mut stops) = (Vec::new(), Vec::new());
    for gravity in [low, TwoLink::PAPER_004.gravity, high] {
        let Spent { work, end_rad_s } = spent(run_context, gravity)?;
        let label = label("g", gravity);
        table.row(label.clone(), work.into_iter().chain(end_rad_s).map(Cell::number).collect());
        saves.push(At::exact(label.clone(), work[0] < work[2] || work[1] < work[2]));
        stops.push(At::exact(label, end_rad_s.iter().any(|speed| *speed <= super::energy::NOTHING)));
    }
    outcome.tables.push(table);
    outcome.claims.extend([
        at_some(
            "The integral of E measures the energy consumed: making it least spends little",
            "the joints' work is less than that of cubics which rest at every via point, with either sign",
            &saves,
        )
        .calculated(),
        at_some(
            "The arm moves from its start to its goal (and stops there)",
            "the speed at the goal is below 1e-6 rad/s, with either sign",
            &stops,
        )
        .calculated(),
    ]);
    Ok(())
}
