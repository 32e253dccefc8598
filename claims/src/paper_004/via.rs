//! Figures 4 to 6: do the via points keep clear of the obstacles, and does what joins them?
use crate::chart::{LimitLine, Panel, palette};
use crate::claim::{Claim, Verdict};
use crate::effect::Effect;
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::table::{Cell, Table};
use crate::trial::Sample;
use taustream_optimizers::papers::two_link_energy::CubicSearch;
use taustream_optimizers::papers::two_link_via::{STEP_RAD, ViaPath, ViaTask};
use taustream_optimizers::{Iwo, Reading, Refusal};

/// Runs; the paper shows one. Forty without an event make it less frequent than 9 in 100.
const RUNS: usize = 40;
/// Runs that tell in which angle the way bends.
const BENDING_RUNS: usize = 400;
/// Obstacles' radius as printed, which its figure 5 takes for the limit of the distance.
pub(super) const PRINTED_LIMIT: f64 = 1.29;
/// More than IWO's schedule can use.
const EVALUATIONS: usize = 10_000;
/// What the paper's penalty lacks: room on the radius of the arm's spheres.
const MARGIN: f64 = 0.25;
/// Where a piece is looked at.
const SAMPLES: u32 = 60;
/// How long a piece lasts, in the paper.
pub(super) const PIECE_S: f64 = 1.0;

/// The readings: label, penalty, reading of the unit, margin.
const READINGS: [(&str, bool, Reading, f64); 4] = [
    ("no penalty", false, Reading::Corrected, 0.0),
    ("penalty, angles in degrees (printed)", true, Reading::Printed, 0.0),
    ("penalty, angles in radians (corrected)", true, Reading::Corrected, 0.0),
    ("penalty, radians, with a margin", true, Reading::Corrected, MARGIN),
];

/// When φ bends more than θ.
pub(super) const MAJORITY_RULE: &str = "radians: φ is farther from the way without obstacles than θ in most runs: above half (holds), by less than \
     10 points (does not hold), or neither";

/// One walk and its distances between centres of spheres.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Walk {
    via_rad: Vec<[f64; 2]>,
    reached: bool,
    /// Least at the via points, on straight pieces, on cubics.
    pub(super) least: [f64; 3],
    /// Over the share of the way, on the cubics.
    along: Vec<(f64, f64)>,
}

impl Walk {
    /// Of which the via points alone are looked at.
    pub(super) fn of_points(task: &ViaTask, path: ViaPath) -> Self {
        let least = path.via_rad.iter().map(|q| task.distance(*q)).fold(f64::INFINITY, f64::min);
        Self { via_rad: path.via_rad, reached: path.reached, least: [least; 3], along: Vec::new() }
    }
}

/// The paper's task, with or without its penalty, and with a margin on the radius of the arm's spheres.
pub(super) fn task(has_penalty: bool, reading: Reading, margin: f64) -> ViaTask {
    let mut task = ViaTask::paper_004(reading);
    if !has_penalty {
        task.weights[2] = 0.0;
    }
    task.radii[0] += margin;
    task
}

/// Distance of centres at which spheres touch.
pub(super) fn contact(task: &ViaTask) -> f64 {
    task.radii.iter().sum()
}

/// Walks that touch at the via points (0), on straight pieces (1), on cubics (2).
pub(super) fn touching(walks: &[Walk], contact: f64, which: usize) -> usize {
    walks.iter().filter(|w| w.least[which] < contact - 1e-6).count()
}

/// How far the median least distance at the via points is from the printed one.
pub(super) fn near(name: &str, walks: &[Walk], level: Level) -> Effect {
    let least: Vec<f64> = walks.iter().map(|w| w.least[0]).collect();
    let name = format!("the least distance, {name}");
    Effect::near((&name, &least), PRINTED_LIMIT, (0.1 * PRINTED_LIMIT, "", level))
}

/// The via points of a run.
pub(super) fn via_points(task: &ViaTask, seed: u64) -> Result<ViaPath, Refusal> {
    task.walk(&Iwo::PAPER_004, EVALUATIONS, seed)
}

/// Via points and the cubics through them.
pub(super) fn walk(task: &ViaTask, seed: u64) -> Result<Walk, Stop> {
    let path = via_points(task, seed)?;
    let search = CubicSearch {
        arm: task.arm,
        piece_s: PIECE_S,
        optimizer: &Iwo::PAPER_004,
        evaluations_max: EVALUATIONS,
        seed,
        reading: Reading::Corrected,
    };
    let cubics = search.through(&path.via_rad)?;
    let least = |poses: &[[f64; 2]]| poses.iter().map(|q| task.distance(*q)).fold(f64::INFINITY, f64::min);
    let shares = || (0..=SAMPLES).map(|i| f64::from(i) / f64::from(SAMPLES));
    let straight = path.via_rad.windows(2).flat_map(|pair| match pair {
        [a, b] => shares().map(|s| std::array::from_fn(|j| a[j] + s * (b[j] - a[j]))).collect(),
        _ => Vec::new(),
    });
    let end_s = PIECE_S * cubics.pieces.len() as f64;
    let steps = u32::try_from(cubics.pieces.len()).unwrap_or(0) * SAMPLES;
    let timed = (0..=steps).filter_map(|i| {
        let at_s = end_s * f64::from(i) / f64::from(steps.max(1));
        cubics.at(at_s).map(|moving| (at_s, moving.angle_rad))
    });
    let timed: Vec<(f64, [f64; 2])> = timed.collect();
    let on_cubics: Vec<[f64; 2]> = timed.iter().map(|(_, q)| *q).collect();
    Ok(Walk {
        least: [least(&path.via_rad), least(&straight.collect::<Vec<_>>()), least(&on_cubics)],
        along: timed.iter().map(|(t, q)| (*t, task.distance(*q))).collect(),
        via_rad: path.via_rad,
        reached: path.reached,
    })
}

/// Walks.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let runs = run_context.runs(RUNS, 4);
    let contact = contact(&ViaTask::paper_004(Reading::Corrected));
    let columns = [
        "",
        "paper, least distance",
        "reached the goal",
        "via points touch",
        "straight pieces touch",
        "cubics touch",
        "via points",
        "least distance at via points",
        "least distance on cubics",
    ];
    let note = format!(
        "{runs} runs; distances between centres; spheres touch below R1 + R2 = {}; the paper's figure takes 1.29 as \
         the limit; median [quartiles]",
        figures(contact)
    );
    let mut table = Table::new("Figures 4 to 6: via points by IWO", "relative units", &note, &columns);
    let mut all = Vec::new();
    for reading in READINGS {
        run_context.say(&format!("  {}, {runs} runs ..", reading.0));
        let (_, has_penalty, unit, margin) = reading;
        let walks =
            run_context.each(runs, |run| walk(&task(has_penalty, unit, margin), run_context.seed(run)))?;
        let touching = |which: usize| touching(&walks, contact, which);
        let share = |count| Cell::Share { count, of: runs };
        let sample = |figure: &dyn Fn(&Walk) -> f64| Sample::of(walks.iter().map(figure).collect()).summary();
        let is_papers = reading.1 && reading.3 == 0.0;
        table.row(
            reading.0,
            vec![
                if is_papers { Cell::Paper(PRINTED_LIMIT) } else { Cell::None },
                share(walks.iter().filter(|w| w.reached).count()),
                share(touching(0)),
                share(touching(1)),
                share(touching(2)),
                Cell::Median(sample(&|w| w.via_rad.len() as f64)),
                Cell::Median(sample(&|w| w.least[0])),
                Cell::Median(sample(&|w| w.least[2])),
            ],
        );
        all.push(walks);
    }
    let ours = vec![
        "five spheres a link, at its tenths 1, 3, 5, 7, 9".to_owned(),
        "the goal is reached within 0.01 rad".to_owned(),
        format!("margin {MARGIN} on the radius of the arm's spheres, in the last row"),
    ];
    let claims = claims(&all, contact, bending(run_context)?);
    Ok(Outcome { ours, tables: vec![table], figures: vec![figure(&all, contact)], claims })
}

fn claims(all: &[Vec<Walk>], contact: f64, bends: [usize; 2]) -> Vec<Claim> {
    let [free, degrees, radians, margin] = all else { return Vec::new() };
    let touching = |walks: &[Walk], which: usize| touching(walks, contact, which);
    let level = Level::FIVE_PERCENT;
    let touch = |what: &str, walks: &[Walk], which: usize| {
        Effect::never(what, [touching(walks, which), walks.len()], level)
    };
    let rule = "no run has a via point whose spheres touch; one refutes it";
    let near = vec![near("degrees", degrees, level), near("radians", radians, level)];
    let below = free.iter().filter(|w| w.least[0] >= PRINTED_LIMIT).count();
    vec![
        Claim::tested(
            "With K = 10, 10, 100 the via points avoid the obstacles (angles in degrees, as table I has them)",
            rule,
            vec![touch("via points touch", degrees, 0)],
        ),
        Claim::tested(
            "With K = 10, 10, 100 the via points avoid the obstacles (angles in radians)",
            rule,
            vec![touch("via points touch", radians, 0)],
        ),
        Claim::tested(
            "The fitted trajectory avoids the obstacles",
            "no run's cubics touch, in the reading whose via points do not; one refutes it",
            vec![touch("cubics touch", radians, 2)],
        )
        .beside(format!(
            "straight pieces touch in {} of {}; with a margin of {MARGIN} cubics in {} and straight pieces in {} of {}",
            touching(radians, 1),
            radians.len(),
            touching(margin, 2),
            touching(margin, 1),
            margin.len()
        )),
        Claim::weighed(
            "The least distance stays near 1.29 (figure 5)",
            "the median least distance at the via points is within a tenth of it, in either reading",
            Verdict::any(near.iter().map(Effect::verdict)),
            near,
        ),
        Claim::tested(
            "Without the penalty the distance falls below 1.29 (figure 6)",
            "in every run; one refutes it",
            vec![Effect::never("it stays above", [below, free.len()], level)],
        ),
        Claim::tested(
            "θ goes on as without obstacles, φ bends away (figure 4)",
            MAJORITY_RULE,
            vec![Effect::majority("φ bends more", bends, level)],
        ),
    ]
}

/// Runs in which φ bends more than θ, of enough runs to tell half from 60 in 100: the interval is ±5 points.
fn bending(run_context: &RunContext) -> Result<[usize; 2], Stop> {
    let runs = run_context.runs(BENDING_RUNS, 4);
    let task = task(true, Reading::Corrected, 0.0);
    let goal = |run: usize| Ok(via_points(&task, run_context.seed(run))?.via_rad);
    let paths = run_context.each(runs, goal)?;
    Ok([bends(&paths), paths.len()])
}

/// Runs in which φ leaves the undisturbed way (both angles a full step at a time) farther than θ.
pub(super) fn bends(walks: &[Vec<[f64; 2]>]) -> usize {
    let goal = ViaTask::paper_004(Reading::Corrected).goal_rad;
    let off = |via_rad: &[[f64; 2]], j: usize| {
        let free = |i: usize| (i as f64 * STEP_RAD).min(goal[j]);
        via_rad.iter().enumerate().map(|(i, q)| (q[j] - free(i)).abs()).fold(0.0, f64::max)
    };
    walks.iter().filter(|w| off(w, 1) > off(w, 0)).count()
}

fn figure(all: &[Vec<Walk>], contact: f64) -> Figure {
    let mut path = Panel::new("θ (degrees)", "φ (degrees)");
    let mut distance = Panel::new("time (s)", "least distance between centres, on the cubics");
    for (walks, (label, ..)) in all.iter().zip(READINGS) {
        let Some(walk) = walks.first() else { continue };
        path.line(label, walk.via_rad.iter().map(|[a, b]| (a.to_degrees(), b.to_degrees())).collect());
        distance.line(label, walk.along.clone());
    }
    for (i, (value, label)) in
        [(contact, "spheres touch"), (PRINTED_LIMIT, "the paper's limit")].into_iter().enumerate()
    {
        distance.limits.push(LimitLine { value, colour: palette(6 + i), label: label.to_owned() });
    }
    Figure::of(
        "004-via-points.svg",
        "Paper 004, figures 4 to 6: the first run of each reading",
        1,
        &[path, distance],
    )
}
