//! Stage 2: the energy of eq. 12, the cubics that make its integral least, and whether IWO is needed for that.
use super::via::PIECE_S;
use crate::chart::Panel;
use crate::claim::Claim;
use crate::effect::Effect;
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::Level;
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, minimise};
use taustream_optimizers::papers::two_link::{Moving, TwoLink};
use taustream_optimizers::papers::two_link_energy::{CubicSearch, Cubics, PieceEnergy, moving};
use taustream_optimizers::{Iwo, Problem, Reading};

const RUNS: usize = 30;
const EVALUATIONS: usize = 10_000;
/// The way of the paper's test without obstacles: both angles in full steps of 20 degrees.
const VIA_DEGREES: [f64; 6] = [0.0, 20.0, 40.0, 60.0, 80.0, 90.0];
/// What counts as nothing, in the units of the quantities.
pub(super) const NOTHING: f64 = 1e-6;
/// Half the side of the box in which IWO looks for a3 and b3, rad/s³.
const BOX: f64 = 2.0;

/// Looks at all three.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome::default();
    outcome.ours.push(format!("gravity {} lengths/s²", figures(TwoLink::PAPER_004.gravity)));
    potential(&mut outcome);
    motions(run_context, &mut outcome)?;
    needs_iwo(run_context, &mut outcome)?;
    Ok(outcome)
}

fn arm(reading: Reading) -> TwoLink {
    TwoLink { reading, ..TwoLink::PAPER_004 }
}

/// The potential energy by the heights of the links' middles, z upward from the ground.
fn by_heights(arm: &TwoLink, angles_rad: [f64; 2]) -> f64 {
    let [elbow, tip] = arm.points(angles_rad);
    let middles = [0.5 * elbow[2], 0.5 * (elbow[2] + tip[2])];
    middles.iter().zip(arm.masses).map(|(z, m)| m * arm.gravity * (arm.height + z)).sum()
}

fn potential(outcome: &mut Outcome) {
    let columns = ["θ (degrees)", "m g h, z upward", "eq. 12 as printed", "corrected sign"];
    let note = "potential energy; the paper measures θ from \"the positive z-axis\"";
    let mut table = Table::new("Eq. 12, potential energy", "relative units", note, &columns);
    let mut off = 0.0_f64;
    for degrees in [0.0, 30.0, 60.0, 90.0_f64] {
        let at = Moving { angle_rad: [degrees.to_radians(), 0.0], ..Moving::default() };
        let [printed, corrected] = [Reading::Printed, Reading::Corrected].map(|r| arm(r).energy(&at)[1]);
        let heights = by_heights(&TwoLink::PAPER_004, at.angle_rad);
        off = off.max((printed - heights).abs());
        table.row(figures(degrees), [heights, printed, corrected].map(Cell::number).to_vec());
    }
    outcome.tables.push(table);
    outcome.claims.push(Claim::exact(
        "Eq. 12 is the arm's mechanical energy, θ from the upward axis",
        "its potential part is m g h at four angles",
        off <= NOTHING,
        format!("off by up to {}; the sign is that of an arm that hangs, z downward", figures(off)),
    ));
}

/// What a motion does at its joins and at its end.
struct EvaluatedCurve {
    end_speed_rad_s: f64,
    speed_jump_rad_s: f64,
    acceleration_jump_rad_s2: f64,
}

fn evaluate(cubics: &Cubics) -> EvaluatedCurve {
    let at_end = cubics.pieces.last().map_or(Moving::default(), |p| moving(p, cubics.piece_s));
    let largest = |a: [f64; 2], b: [f64; 2]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
    for pair in cubics.pieces.windows(2) {
        let [before, after] = pair else { continue };
        let (before, after) = (moving(before, cubics.piece_s), moving(after, 0.0));
        speed = speed.max(largest(before.speed_rad_s, after.speed_rad_s));
        acceleration = acceleration.max(largest(before.acceleration_rad_s2, after.acceleration_rad_s2));
    }
    EvaluatedCurve {
        end_speed_rad_s: largest(at_end.speed_rad_s, [0.0; 2]),
        speed_jump_rad_s: speed,
        acceleration_jump_rad_s2: acceleration,
    }
}

/// Cubics that rest at every via point: what least energy is to beat.
fn resting(arm: TwoLink, via_rad: &[[f64; 2]]) -> Cubics {
    let pieces = via_rad.windows(2).filter_map(|pair| {
        let [from, to] = pair else { return None };
        let problem = piece(arm, [*from, *to], [0.0; 2]);
        Some(problem.piece(problem.to_rest()))
    });
    Cubics { pieces: pieces.collect(), piece_s: PIECE_S }
}

fn piece(arm: TwoLink, angles_rad: [[f64; 2]; 2], speed_rad_s: [f64; 2]) -> PieceEnergy {
    PieceEnergy { arm, angles_rad, speed_rad_s, piece_s: PIECE_S, bounds: [[-BOX, BOX]; 2] }
}

/// What the paper's way without obstacles costs at some gravity.
pub(super) struct Spent {
    /// Work of the joints: least energy with the printed sign, with z upward, and cubics that rest at every via point.
    pub(super) work: [f64; 3],
    /// Speed at the goal, with both signs.
    pub(super) end_rad_s: [f64; 2],
}

/// The cubics of least energy at some gravity, the end left free as printed.
pub(super) fn spent(run_context: &RunContext, gravity: f64) -> Result<Spent, Stop> {
    let (via, truth) = (via_rad(), TwoLink { gravity, ..arm(Reading::Corrected) });
    let mut work = [0.0, 0.0, resting(truth, &via).work(&truth)];
    let mut end_rad_s = [0.0; 2];
    for ((work, end), sign) in work.iter_mut().zip(&mut end_rad_s).zip([Reading::Printed, Reading::Corrected])
    {
        let cubics = free_end(run_context, TwoLink { reading: sign, ..truth }).through(&via)?;
        (*work, *end) = (cubics.work(&truth), evaluate(&cubics).end_speed_rad_s);
    }
    Ok(Spent { work, end_rad_s })
}

/// IWO's search for cubics, the end left free as printed.
fn free_end(run_context: &RunContext, arm: TwoLink) -> CubicSearch<'static> {
    CubicSearch {
        arm,
        piece_s: PIECE_S,
        optimizer: &Iwo::PAPER_004,
        evaluations_max: EVALUATIONS,
        seed: run_context.seed(0),
        reading: Reading::Printed,
    }
}

fn via_rad() -> Vec<[f64; 2]> {
    VIA_DEGREES.iter().map(|d| [d.to_radians(); 2]).collect()
}

fn motions(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let via = via_rad();
    let truth = arm(Reading::Corrected);
    let cases = [
        ("eq. 12 as printed, end free (printed)", Reading::Printed, Reading::Printed),
        ("z upward, end free", Reading::Corrected, Reading::Printed),
        ("z upward, end at rest (corrected)", Reading::Corrected, Reading::Corrected),
    ];
    let columns = [
        "",
        "∫E dt, z upward",
        "work of the joints",
        "speed at the goal (rad/s)",
        "jump of speed at via points",
        "jump of acceleration (rad/s²)",
    ];
    let note = "via points 0, 20, 40, 60, 80, 90 degrees in both angles, T = 1; a3 and b3 by IWO; the work is ∫|torque · \
                speed| dt";
    let mut table = Table::new("Cubics of least energy", "relative units", note, &columns);
    let mut all = Vec::new();
    let mut panel = Panel::new("time (s)", "speed of θ (rad/s)");
    for (label, sign, end) in cases {
        let search = CubicSearch { reading: end, ..free_end(run_context, arm(sign)) };
        all.push((label, search.through(&via)?));
    }
    all.push(("at rest at every via point", resting(truth, &via)));
    let mut decided = Vec::new();
    for (label, cubics) in &all {
        let curve = evaluate(cubics);
        let numbers = [
            cubics.action(&truth),
            cubics.work(&truth),
            curve.end_speed_rad_s,
            curve.speed_jump_rad_s,
            curve.acceleration_jump_rad_s2,
        ];
        table.row(*label, numbers.map(Cell::number).to_vec());
        panel.line(label, speeds(cubics));
        decided.push((numbers, curve));
    }
    outcome.tables.push(table);
    let title = "Paper 004, stage 2: speed of the upper arm";
    outcome.figures.push(Figure::of("004-cubics.svg", title, 1, &[panel]));
    outcome.claims.extend(claims_of_motions(&decided));
    Ok(())
}

fn speeds(cubics: &Cubics) -> Vec<(f64, f64)> {
    let end_s = cubics.piece_s * cubics.pieces.len() as f64;
    let times = (0..=300).map(|i| end_s * f64::from(i) / 300.0);
    times.filter_map(|t| cubics.at(t).map(|m| (t, m.speed_rad_s[0]))).collect()
}

fn claims_of_motions(decided: &[([f64; 5], EvaluatedCurve)]) -> Vec<Claim> {
    let [(printed, curve), (upward, free), _, (resting, _)] = decided else { return Vec::new() };
    vec![
        Claim::exact(
            "The angular velocities are continuous at the via points",
            "no speed jumps by more than 1e-6 rad/s",
            curve.speed_jump_rad_s <= NOTHING,
            format!(
                "largest jump of speed {}, of acceleration {} rad/s²",
                figures(curve.speed_jump_rad_s),
                figures(curve.acceleration_jump_rad_s2)
            ),
        ),
        Claim::exact(
            "The arm moves from its start to its goal (and stops there)",
            "the speed at the goal is below 1e-6 rad/s",
            curve.end_speed_rad_s <= NOTHING,
            format!(
                "{} rad/s with the printed sign, {} with z upward",
                figures(curve.end_speed_rad_s),
                figures(free.end_speed_rad_s)
            ),
        ),
        Claim::exact(
            "The integral of E measures the energy consumed: making it least spends little",
            "the joints' work is less than that of cubics which rest at every via point, with either sign",
            printed[1] < resting[1] || upward[1] < resting[1],
            format!(
                "work {} as printed, {} with z upward, {} at rest at every point",
                figures(printed[1]),
                figures(upward[1]),
                figures(resting[1])
            ),
        ),
    ]
}

/// The least cost by Newton's method with central differences, and how many evaluations that took.
fn newton(problem: &PieceEnergy) -> (f64, usize) {
    const STEP: f64 = 1e-3;
    let f = |x: [f64; 2]| problem.cost(&x);
    let (mut x, mut evaluations) = (problem.to_rest(), 0);
    for _ in 0..8 {
        let at = |i: f64, j: f64| f([x[0] + i * STEP, x[1] + j * STEP]);
        let (here, e, w, n, s) = (at(0.0, 0.0), at(1.0, 0.0), at(-1.0, 0.0), at(0.0, 1.0), at(0.0, -1.0));
        let (ne, sw) = (at(1.0, 1.0), at(-1.0, -1.0));
        evaluations += 7;
        let slope = [(e - w) / (2.0 * STEP), (n - s) / (2.0 * STEP)];
        let square = STEP * STEP;
        let (xx, yy) = ((e - 2.0 * here + w) / square, (n - 2.0 * here + s) / square);
        let xy = (ne + sw + 2.0 * here - e - w - n - s) / (2.0 * square);
        let det = xx * yy - xy * xy;
        let step = [(yy * slope[0] - xy * slope[1]) / det, (xx * slope[1] - xy * slope[0]) / det];
        x = [x[0] - step[0], x[1] - step[1]];
    }
    (f(x), evaluations + 1)
}

fn needs_iwo(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let runs = run_context.runs(RUNS, 3);
    let columns = ["", "least, Newton", "evaluations", "IWO above it, relative", "evaluations"];
    let note =
        format!("∫E dt of single pieces from 20 to 40 degrees, {runs} runs of IWO; median [quartiles]");
    let mut table = Table::new("IWO against the exact solution", "", &note, &columns);
    let (mut effects, mut newtons) = (Vec::new(), 0);
    for (label, speed) in [("from rest", 0.0), ("at 0.3 rad/s", 0.3), ("at 0.6 rad/s", 0.6)] {
        let angles = [[20.0_f64.to_radians(); 2], [40.0_f64.to_radians(); 2]];
        let problem = piece(arm(Reading::Corrected), angles, [speed; 2]);
        let (exact, evaluations) = newton(&problem);
        let trials: Vec<Trial> = run_context.each(runs, |run| {
            minimise(run_context, &Iwo::PAPER_004, &problem, run_context.seed(run), EVALUATIONS)
        })?;
        let above = Sample::from_trials(&trials, |t| (t.found.cost - exact) / exact.abs());
        newtons = newtons.max(evaluations);
        effects.push(Effect::below(
            (&format!("the gap {label}"), &above.values),
            1e-6,
            ("of it", Level::FIVE_PERCENT),
        ));
        table.row(
            label,
            vec![
                Cell::number(exact),
                Cell::number(evaluations as f64),
                Cell::Median(above.summary()),
                Cell::maybe(above.evaluations),
            ],
        );
    }
    outcome.tables.push(table);
    outcome.claims.push(
        Claim::tested(
            "IWO finds the coefficients of least energy",
            "the median run is within 1e-6 of the exact least value, relatively, on every piece",
            effects,
        )
        .beside(format!("Newton's method needs {newtons} evaluations")),
    );
    Ok(())
}
