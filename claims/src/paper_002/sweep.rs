//! Numbers that the paper does not print, each over a decade round ours, and what becomes of the claims.
use super::{Method, arrived, virtuals};
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile};
use crate::swept::{At, FACTORS, Values, places};
use crate::table::{Cell, Table};
use taustream_optimizers::papers::planar::{Journey, Numbers, Obstacle, PlanarScene, PlanarShape};

/// Runs of everything: without an event they make it less frequent than one in eight at one of six values of `H_o` too.
const RUNS: usize = 50;
/// Runs of a size of a trap.
const SIZE_RUNS: usize = 30;
const QUICK: usize = 2;
/// Runs in which a number other than `H_o` changes.
const OTHER_RUNS: usize = 6;
/// Steps after which a robot that has not arrived never will, nearly: RBF's slowest takes a third of them.
const STEPS_MAX: usize = 1_500;
/// Values of `H_o`: at 1 the goal's pull exceeds the repulsion everywhere, from 2 on it does not.
const HEIGHTS: [f64; 6] = [0.5, 1.0, 2.0, 5.0, 10.0, 20.0];
/// Sizes of a trap over ours; a larger one does not fit between start and goal.
const SIZES: [f64; 5] = [0.316_227_766, 0.5, 0.7, 1.0, 1.4];
/// Printed numbers of virtual obstacles in the L and in the U.
const PRINTED: [(&str, &str, f64); 2] = [("l", "L", 3.0), ("u", "U", 9.0)];

/// A number that the paper does not print.
struct Swept {
    name: &'static str,
    scale: fn(&mut Numbers, f64),
}

const SWEPT: [Swept; 12] = [
    Swept { name: "W_o", scale: |n, f| n.obstacle[1] *= f },
    Swept { name: "H_g", scale: |n, f| n.goal[0] *= f },
    Swept { name: "W_g", scale: |n, f| n.goal[1] *= f },
    Swept { name: "H_add", scale: |n, f| n.virtual_obstacle[0] *= f },
    Swept { name: "W_add", scale: |n, f| n.virtual_obstacle[1] *= f },
    Swept { name: "R (step)", scale: |n, f| n.step_cm *= f },
    Swept { name: "speed", scale: |n, f| n.speed_cm_s *= f },
    Swept { name: "N_s", scale: |n, f| n.bacteria = scaled(n.bacteria, f) },
    Swept { name: "d_min", scale: |n, f| n.arrived_cm *= f },
    Swept { name: "dis", scale: |n, f| n.retreat_cm *= f },
    Swept { name: "k", scale: |n, f| n.observed = scaled(n.observed, f) },
    Swept { name: "clearance", scale: |n, f| n.clearance_cm *= f },
];

fn scaled(count: usize, factor: f64) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred at most")]
    let scaled = (count as f64 * factor).round() as usize;
    scaled.max(1)
}

/// Journeys of the two kinds of bacteria through the scenes that tell the numbers apart.
struct Setting {
    label: String,
    /// By scene ([`SCENES`]): of BFO and RBF.
    journeys: Vec<[Vec<Journey>; 2]>,
}

const SCENES: [&str; 4] = ["moving", "two-discs", "l", "u"];

impl Setting {
    fn of(run_context: &RunContext, label: String, numbers: Numbers, runs: usize) -> Result<Self, Stop> {
        run_context.say(&format!("  {label} .."));
        let scenes = SCENES.into_iter().filter_map(PlanarScene::by_name);
        let through = |scene: PlanarScene| -> Result<[Vec<Journey>; 2], Stop> {
            let go = |method: Method| method.journeys_with(run_context, &scene, numbers, runs);
            Ok([go(Method::Plain)?, go(Method::Robust)?])
        };
        Ok(Self { label, journeys: scenes.map(through).collect::<Result<_, _>>()? })
    }

    fn journeys(&self, scene: usize, is_robust: bool) -> &[Journey] {
        self.journeys.get(scene).map_or(&[], |both| both[usize::from(is_robust)].as_slice())
    }

    fn touched(&self) -> usize {
        self.journeys(0, true).iter().filter(|j| j.nearest_cm <= 0.0).count()
    }

    fn escaped(&self) -> usize {
        self.journeys(1, true).iter().filter(|j| !j.virtuals.is_empty()).count()
    }

    fn cells(&self) -> Vec<Cell> {
        let share = |scene: usize, is_robust: bool| {
            let journeys = self.journeys(scene, is_robust);
            Cell::Share { count: arrived(journeys), of: journeys.len() }
        };
        let made = |scene: usize| Cell::number(quantile(&virtuals(self.journeys(scene, true)), 0.5));
        let of = self.journeys(0, true).len();
        vec![
            share(0, true),
            Cell::Share { count: self.touched(), of },
            share(1, false),
            share(1, true),
            Cell::Share { count: self.escaped(), of },
            share(2, false),
            share(2, true),
            made(2),
            share(3, false),
            share(3, true),
            made(3),
        ]
    }

    /// True when RBF leaves both traps in every run and BFO in none.
    fn is_as_claimed(&self) -> bool {
        [2, 3].into_iter().all(|scene| {
            let robust = self.journeys(scene, true);
            arrived(robust) == robust.len() && arrived(self.journeys(scene, false)) == 0
        })
    }
}

/// Runs them.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let steps_max = STEPS_MAX;
    let ours = Numbers { steps_max, ..Numbers::OURS };
    let runs = run_context.runs(RUNS, QUICK);
    let at = |height: &f64| {
        let numbers = Numbers { obstacle: [*height, ours.obstacle[1]], ..ours };
        Setting::of(run_context, format!("H_o = {height}"), numbers, runs)
    };
    let heights = HEIGHTS.iter().map(at).collect::<Result<Vec<_>, _>>()?;
    let mut others = Vec::new();
    for Swept { name, scale } in &SWEPT {
        for factor in run_context.choose(&FACTORS[..], &FACTORS[..1]) {
            let mut numbers = ours;
            scale(&mut numbers, *factor);
            let label = format!("{name} times {}", figures(*factor));
            others.push(Setting::of(run_context, label, numbers, runs.min(OTHER_RUNS))?);
        }
    }
    let mut outcome = Outcome { tables: vec![table(heights.iter().chain(&others))], ..Outcome::default() };
    outcome.claims = vec![moving(&heights), two_discs(&heights), traps(&heights, &others)];
    sizes(run_context, ours, &mut outcome)?;
    Ok(outcome)
}

fn table<'a>(settings: impl Iterator<Item = &'a Setting>) -> Table {
    let columns = [
        "",
        "moving disc: RBF arrived",
        "touched",
        "two discs: BFO arrived",
        "RBF arrived",
        "with a virtual obstacle",
        "L: BFO arrived",
        "RBF arrived",
        "virtual obstacles, median",
        "U: BFO arrived",
        "RBF arrived",
        "virtual obstacles, median",
    ];
    let note = format!(
        "The paper prints the sensor's range alone. H_o over its values; every other number over a decade round ours, at H_o = 1. At \
         most {STEPS_MAX} steps."
    );
    let mut table = Table::new("Numbers that the paper does not print", "", &note, &columns);
    settings.for_each(|setting| table.row(setting.label.clone(), setting.cells()));
    table
}

/// A claim that stands at some value of a number that is not printed.
fn at_some(
    says: &str,
    rule: &str,
    settings: &[Setting],
    effect: impl Fn(&Setting, Level) -> Effect,
) -> Claim {
    let effects: Vec<Effect> = settings.iter().map(|s| effect(s, Level::FIVE_PERCENT)).collect();
    let values = Values::of(settings.len());
    let at = settings.iter().map(|s| At::some(&*s.label, values, |level| vec![effect(s, level)]));
    let at: Vec<At> = at.collect();
    Claim::weighed(says, rule, Verdict::any(at.iter().map(|s| s.verdict)), effects).beside(places(&at))
}

fn or_none(text: &str) -> &str {
    if text.is_empty() { "none" } else { text }
}

fn moving(heights: &[Setting]) -> Claim {
    at_some(
        "RBF reaches the goal past a moving disc without touching it",
        "at some H_o from 0.5 to 20, which is not printed, no run touches the disc or fails to arrive",
        heights,
        |setting, level| {
            let journeys = setting.journeys(0, true);
            let missed = setting.touched() + journeys.len() - arrived(journeys);
            Effect::never(&format!("{}: touched or lost", setting.label), [missed, journeys.len()], level)
        },
    )
}

fn two_discs(heights: &[Setting]) -> Claim {
    at_some(
        "Two discs beside each other are a local minimum that RBF leaves with a virtual obstacle",
        "at some H_o from 0.5 to 20, which is not printed, every run of RBF makes one and arrives (the discs' radii are ours)",
        heights,
        |setting, level| {
            let journeys = setting.journeys(1, true);
            let as_claimed =
                journeys.iter().filter(|j| !j.virtuals.is_empty() && super::has_arrived(j)).count();
            let missed = journeys.len() - as_claimed;
            Effect::never(
                &format!("{}: free without one, or lost", setting.label),
                [missed, journeys.len()],
                level,
            )
        },
    )
}

/// Whether the main claim needs our numbers.
fn traps(heights: &[Setting], others: &[Setting]) -> Claim {
    let all = || heights.iter().chain(others);
    let odd: Vec<&str> = all().filter(|s| !s.is_as_claimed()).map(|s| s.label.as_str()).collect();
    let (holds, of) = (all().count() - odd.len(), all().count());
    Claim::weighed(
        "RBF gets out of the L and the U and BFO does not, whatever the numbers that are not printed",
        "every run of RBF arrives and none of BFO, at every value of each number over a decade: one refutes it",
        if odd.is_empty() { Verdict::Holds } else { Verdict::DoesNotHold },
        Vec::new(),
    )
    .beside(format!("at {holds} of {of} settings; not at: {}", or_none(&odd.join(", "))))
}

/// The number of virtual obstacles over the size of the trap, which is not printed.
fn sizes(run_context: &RunContext, numbers: Numbers, outcome: &mut Outcome) -> Result<(), Stop> {
    let columns = ["", "arrived", "virtual obstacles, least", "median", "most"];
    let note = "RBF; the lengths of the walls over ours, about the middle of the way.";
    let mut table = Table::new("Sizes of the traps", "", note, &columns);
    let runs = run_context.runs(SIZE_RUNS, QUICK);
    let level = Level::FIVE_PERCENT.over(SIZES.len());
    for (name, shape, printed) in PRINTED {
        let Some(scene) = PlanarScene::by_name(name) else { continue };
        let mut medians = Vec::new();
        for size in SIZES {
            let scene = resized(&scene, size);
            let journeys = Method::Robust.journeys_with(run_context, &scene, numbers, runs)?;
            let made = virtuals(&journeys);
            let [least, median, most] = [0.0, 0.5, 1.0].map(|q| quantile(&made, q));
            medians.push((size, crate::statistics::median(&made, level).interval));
            let share = Cell::Share { count: arrived(&journeys), of: journeys.len() };
            let numbers = [least, median, most].map(Cell::number);
            table
                .row(format!("{shape}, {} of ours", figures(size)), [vec![share], numbers.to_vec()].concat());
        }
        outcome.claims.push(takes(shape, printed, &medians));
    }
    outcome.tables.push(table);
    Ok(())
}

/// Whether so many virtual obstacles are those of some size: where fewer stand at one size and more at a larger one, a size
/// between them has as many. The least and the most of some runs would not do: both depend on a single run.
fn takes(shape: &str, printed: f64, medians: &[(f64, [f64; 2])]) -> Claim {
    let at_most = medians.iter().filter(|(_, [_, high])| *high <= printed).map(|(size, _)| *size);
    let at_least = medians.iter().filter(|(_, [low, _])| *low >= printed).map(|(size, _)| *size);
    let between = at_most.fold(f64::INFINITY, f64::min) <= at_least.fold(f64::NEG_INFINITY, f64::max);
    let is_missed = medians.iter().all(|(_, [_, high])| *high < printed)
        || medians.iter().all(|(_, [low, _])| *low > printed);
    let verdict = match (between, is_missed) {
        (true, _) => Verdict::Holds,
        (false, true) => Verdict::DoesNotHold,
        (false, false) => Verdict::Open,
    };
    let sizes = medians.iter().map(|(size, [low, high])| {
        format!("[{}, {}] at {} of ours", figures(*low), figures(*high), figures(*size))
    });
    Claim::weighed(
        &format!("The {shape} takes {printed} virtual obstacles"),
        "the median of our runs is at most the number at one size from 0.32 to 1.4 of ours, which is not printed, and at least the number at \
         another (holds), or less at all, or more at all (does not hold), or neither",
        verdict,
        Vec::new(),
    )
    .beside(format!("medians of {}", sizes.collect::<Vec<_>>().join(", ")))
}

/// The walls of a scene, larger about where the middle of its way is.
fn resized(scene: &PlanarScene, size: f64) -> PlanarScene {
    let Some([start, goal]) = scene.robots.first().copied() else { return scene.clone() };
    let middle = [0.5 * (start[0] + goal[0]), 0.5 * (start[1] + goal[1])];
    let place = |c: &[f64; 2]| [middle[0] + size * (c[0] - middle[0]), middle[1] + size * (c[1] - middle[1])];
    let obstacle = |o: &Obstacle| match &o.shape {
        PlanarShape::Walls { corners_cm } => {
            Obstacle::walls(&corners_cm.iter().map(place).collect::<Vec<_>>())
        }
        PlanarShape::Disc { .. } => o.clone(),
    };
    PlanarScene { obstacles: scene.obstacles.iter().map(obstacle).collect(), ..scene.clone() }
}
