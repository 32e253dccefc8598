//! The spline: are its end conditions enough, and what does optimising its times bring?
use crate::chart::Panel;
use crate::claim::Claim;
use crate::effect::Effect;
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::statistics::{Level, quantile, wilcoxon};
use crate::swept::{At, FACTORS, Values, at_every};
use crate::table::{Cell, Table};
use crate::trial::{Sample, Trial, minimise};
use taustream_optimizers::papers::spline::{Spline, conditions};
use taustream_optimizers::papers::spline_time::{JointLimit, SplineCost, SplineTime};
use taustream_optimizers::{Reading, Setup, by_name};

/// Table 4: joint angles of the eight nodes. The table says rad; the numbers are degrees.
const NODES_DEGREES: [[f64; 6]; 8] = [
    [1.9698, -95.3302, -52.5182, -109.9252, -85.6002, 1.9698],
    [-12.6766, -100.2120, -53.7348, -104.2469, -65.9316, -1.5196],
    [-40.5661, -109.2507, -56.2990, -92.4981, -38.4071, -8.6572],
    [-29.4233, -103.5337, -55.7650, -96.7164, -78.2400, -5.8801],
    [-51.5939, -112.3181, -57.7720, -88.0456, -52.5424, -10.9649],
    [-73.2598, -118.2951, -59.9670, -78.4775, 13.9345, -17.0033],
    [-101.4153, -128.6296, -63.0296, -66.9342, 14.9857, -22.9221],
    [-117.7092, -133.2772, -64.8753, -59.3292, 41.8628, -27.2202],
];
/// Ours: limits of every joint (rad/s, rad/s², rad/s³), times of a piece, runs and evaluations.
const LIMIT: JointLimit = [2.0, 5.0, 20.0];
const PIECE_S: [f64; 2] = [0.3, 3.0];
const RUNS: usize = 6;
const EVALUATIONS: usize = 1_200;
/// Evaluations of each over the limits.
const LIMIT_EVALUATIONS: usize = 1_000;
/// Below this share of the largest pivot, a pivot is nothing.
const RANK_SHARE: f64 = 1e-12;

/// Looks at it.
pub(crate) fn run(run_context: &RunContext) -> Result<Outcome, Stop> {
    let mut outcome = Outcome::default();
    outcome.ours.push(format!(
        "limits of every joint {} rad/s, {} rad/s², {} rad/s³; pieces of {} to {} s; time and impact divided by those \
         of pieces of {} s in the corrected reading",
        LIMIT[0],
        LIMIT[1],
        LIMIT[2],
        PIECE_S[0],
        PIECE_S[1],
        0.5 * (PIECE_S[0] + PIECE_S[1])
    ));
    outcome.claims.extend(table_4());
    rank_of_conditions(&mut outcome)?;
    times(run_context, &mut outcome)?;
    limits(run_context, &mut outcome)?;
    Ok(outcome)
}

/// What table 4 says of itself: an arm's joint turns by less than one revolution to a side.
fn table_4() -> [Claim; 2] {
    let farthest = NODES_DEGREES.iter().flatten().fold(0.0_f64, |m, q| m.max(q.abs()));
    let first = NODES_DEGREES[0];
    [
        Claim::exact(
            "Table 4's joint angles are radians, as its head says",
            "none is beyond one revolution, 6.283",
            farthest <= std::f64::consts::TAU,
            format!("the farthest is {}: these are degrees", figures(farthest)),
        ),
        Claim::exact(
            "Table 4's first node has six angles of its own",
            "joint 6 does not repeat the digits of joint 1",
            (first[5] - first[0]).abs() > 1e-9,
            format!("joint 1 {}, joint 6 {}: a slip of copying", figures(first[0]), figures(first[5])),
        ),
    ]
}

/// How many independent rows a matrix has: elimination with the largest pivot there is, rows scaled to one.
fn rank(mut rows: Vec<Vec<f64>>) -> usize {
    for row in &mut rows {
        // A row of nothing stays one.
        let largest = row.iter().fold(f64::MIN_POSITIVE, |m, x| m.max(x.abs()));
        row.iter_mut().for_each(|x| *x /= largest);
    }
    let columns = rows.first().map_or(0, Vec::len);
    let mut rank = 0;
    while rank < rows.len() {
        let places = (rank..rows.len()).flat_map(|r| (0..columns).map(move |c| (r, c)));
        let Some((r, c)) = places.max_by(|a, b| rows[a.0][a.1].abs().total_cmp(&rows[b.0][b.1].abs())) else {
            return rank;
        };
        if rows[r][c].abs() < RANK_SHARE {
            return rank;
        }
        rows.swap(rank, r);
        let (upper, lower) = rows.split_at_mut(rank + 1);
        let pivot = &upper[rank];
        for row in lower {
            let factor = row[c] / pivot[c];
            row.iter_mut().zip(pivot).for_each(|(x, p)| *x -= factor * p);
        }
        rank += 1;
    }
    rank
}

fn rank_of_conditions(outcome: &mut Outcome) -> Result<(), Stop> {
    let columns = ["derivatives given at each end", "unknowns", "equations", "independent"];
    let note = "eight nodes, pieces of 1 s; unknowns are the control points of one joint";
    let mut table = Table::new("Eq. 12 to 16: conditions of the spline", "", note, &columns);
    let mut is_enough = Vec::new();
    for (ends, label) in [(2, "velocity, acceleration (the paper's)"), (3, "and jerk (ours)")] {
        let rows = conditions(&[1.0; NODES_DEGREES.len() - 1], ends)?;
        let (equations, unknowns) = (rows.len(), rows.first().map_or(0, Vec::len));
        let independent = rank(rows);
        is_enough.push((independent == unknowns, format!("{independent} for {unknowns} unknowns")));
        table.row(label, [unknowns, equations, independent].map(|n| Cell::number(n as f64)).to_vec());
    }
    outcome.tables.push(table);
    if let [(papers, numbers), (_, ours)] = is_enough.as_slice() {
        outcome.claims.push(Claim::exact(
            "Interpolation with velocity and acceleration at both ends determines the spline of degree seven",
            "as many independent equations as unknowns",
            *papers,
            format!("{numbers}; with jerk {ours}"),
        ));
    }
    Ok(())
}

fn nodes_rad() -> Vec<Vec<f64>> {
    NODES_DEGREES.iter().map(|node| node.iter().map(|q| q.to_radians()).collect()).collect()
}

fn times(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let (runs, budget) = (run_context.runs(RUNS, 2), run_context.choose(EVALUATIONS, 300));
    let limits = [LIMIT; 6];
    let nodes = nodes_rad();
    let columns = [
        "",
        "time (s)",
        "impact, sum of rms jerk (rad/s³)",
        "limits broken",
        "F",
        "F: isma less:more",
        "evaluations",
    ];
    let note = format!(
        "table 4's nodes, {runs} runs of {budget} evaluations; median [quartiles]; the paper prints none of it"
    );
    let mut table = Table::new("Time and impact", "", &note, &columns);
    let mut shown = Vec::new();
    let mut numbers = Vec::new();
    for (word, reading) in [("printed", Reading::Printed), ("corrected", Reading::Corrected)] {
        let problem = SplineTime::new(&nodes, &limits, PIECE_S, reading)?;
        let middle = vec![0.5 * (PIECE_S[0] + PIECE_S[1]); nodes.len() - 1];
        let even = problem.evaluate(&middle)?;
        let even_cells = [even.time_s, even.jerk_rad_s3, even.broken as f64, even.cost].map(Cell::number);
        let none = [Cell::None, Cell::None];
        table.row(format!("even times, objective {word}"), even_cells.into_iter().chain(none).collect());
        let mut first: Option<Sample> = None;
        for method in ["isma", "sma"] {
            run_context.say(&format!("  times by {method}, objective {word} .."));
            let setup = Setup { reading: Reading::Corrected, evaluations: Some(budget) };
            let trials: Vec<Trial> = run_context.each(runs, |run| {
                let optimizer = by_name(method, setup).map_err(|e| Stop::Refused(e.to_string()))?;
                minimise(run_context, optimizer.as_ref(), &problem, run_context.seed(run), budget)
            })?;
            let decided =
                trials.iter().map(|t| problem.evaluate(&t.found.x)).collect::<Result<Vec<_>, _>>()?;
            let sample =
                |figure: fn(&SplineCost) -> f64| Sample::of(decided.iter().map(figure).collect()).summary();
            let parts = [sample(|j| j.time_s), sample(|j| j.jerk_rad_s3), sample(|j| j.broken as f64)];
            let cost = Sample::best(&trials);
            let test = first.as_ref().map(|isma| wilcoxon(&isma.values, &cost.values));
            numbers.push(format!(
                "{method} {word}: {} s, impact {}, {} limits broken",
                figures(parts[0].median),
                figures(parts[1].median),
                figures(parts[2].median)
            ));
            let mut cells: Vec<Cell> = parts.into_iter().map(Cell::Median).collect();
            cells.push(Cell::Median(cost.summary()));
            cells.push(test.map_or(Cell::None, Cell::Test));
            cells.push(Cell::maybe(cost.evaluations));
            table.row(format!("{method}, objective {word}"), cells);
            if method == "isma" {
                shown.extend(trials.first().map(|t| (word, t.found.x.clone())));
                first = Some(cost);
            }
        }
    }
    outcome.tables.push(table);
    outcome.figures.push(profiles(&nodes, &shown)?);
    outcome.claims.push(smooth(&nodes, &shown)?);
    outcome.claims.push(Claim::unchecked(
        "Optimising the times with ISMA reduces time and impact of the ER3A-C60's path by what figure 8 shows",
        "the paper prints no limits, no times, no F and no arm; ours: its nodes, our limits",
        numbers.join("; "),
    ));
    Ok(())
}

/// What ISMA's times save at the same whole time, over the limits, which are not printed. Times longer by a factor divide
/// the impact by its cube, so that even times can be made as long as any others.
fn limits(run_context: &RunContext, outcome: &mut Outcome) -> Result<(), Stop> {
    let (runs, budget) = (run_context.runs(RUNS, 2).min(RUNS), run_context.choose(LIMIT_EVALUATIONS, 100));
    let nodes = nodes_rad();
    let columns = ["", "time (s)", "impact", "impact of even times as long", "less by (%)", "limits broken"];
    let note =
        format!("objective corrected, {runs} runs of {budget} evaluations; medians; effect [95 % interval]");
    let mut table = Table::new("Impact at the same time, over the limits", "rad/s³", &note, &columns);
    let mut settings = Vec::new();
    for factor in [FACTORS[0], 1.0, FACTORS[1]] {
        run_context.say(&format!("  limits times {} ..", figures(factor)));
        // Slow joints need longer pieces.
        let piece_s = [PIECE_S[0], PIECE_S[1] / factor.min(1.0)];
        let problem = SplineTime::new(&nodes, &[LIMIT.map(|l| factor * l); 6], piece_s, Reading::Corrected)?;
        let even = problem.evaluate(&vec![0.5 * (piece_s[0] + piece_s[1]); nodes.len() - 1])?;
        let found = run_context.each(runs, |run| {
            let setup = Setup { reading: Reading::Corrected, evaluations: Some(budget) };
            let optimizer = by_name("isma", setup).map_err(|e| Stop::Refused(e.to_string()))?;
            let trial = minimise(run_context, optimizer.as_ref(), &problem, run_context.seed(run), budget)?;
            Ok(problem.evaluate(&trial.found.x)?)
        })?;
        let of = |figure: &dyn Fn(&SplineCost) -> f64| found.iter().map(figure).collect::<Vec<f64>>();
        let (impacts, as_even) =
            (of(&|c| c.jerk_rad_s3), of(&|c| even.jerk_rad_s3 * (even.time_s / c.time_s).powi(3)));
        let effect = |level: Level| {
            Effect::ratio(
                ("isma's times", &impacts),
                ("even times as long", &as_even),
                (f64::MIN_POSITIVE, level),
            )
        };
        let label = format!("limits times {}", figures(factor));
        settings.push(At::every(&*label, Values::of(3), |level| vec![effect(level)]));
        let estimate = Cell::estimate(effect(Level::FIVE_PERCENT).estimate);
        let broken = of(&|c| c.broken as f64);
        let medians = [of(&|c| c.time_s), impacts, as_even].map(|v| Cell::number(quantile(&v, 0.5)));
        table.row(
            label,
            medians.into_iter().chain([estimate, Cell::number(quantile(&broken, 1.0))]).collect(),
        );
    }
    outcome.tables.push(table);
    outcome.claims.push(at_every(
        "Optimising the times with ISMA reduces the impact on table 4's path",
        "the impact is less than that of even times of the same sum, at limits over a decade round ours: above 0 (holds), below 1 % (does \
         not hold), or neither",
        &settings,
    ));
    Ok(())
}

/// The curves of the first run: joint 5, which moves most.
fn profiles(nodes: &[Vec<f64>], shown: &[(&str, Vec<f64>)]) -> Result<Figure, Stop> {
    const JOINT: usize = 4;
    let names = ["position (rad)", "velocity (rad/s)", "acceleration (rad/s²)", "jerk (rad/s³)"];
    let mut panels: Vec<Panel> = names.iter().map(|name| Panel::new("time (s)", name)).collect();
    for (label, intervals_s) in shown {
        let spline = Spline::through(nodes, intervals_s)?;
        for (order, panel) in panels.iter_mut().enumerate() {
            let times = (0..=400).map(|i| spline.total_s() * f64::from(i) / 400.0);
            panel.line(label, times.filter_map(|t| spline.at(JOINT, t, order).map(|q| (t, q))).collect());
        }
    }
    let title = "Paper 001, figure 8: joint 5 with ISMA's times, objective printed and corrected";
    Ok(Figure::of("001-spline.svg", title, 2, &panels))
}

/// Velocity, acceleration and jerk on both sides of every join.
fn smooth(nodes: &[Vec<f64>], shown: &[(&str, Vec<f64>)]) -> Result<Claim, Stop> {
    let mut largest = 0.0_f64;
    for (_, intervals_s) in shown {
        let spline = Spline::through(nodes, intervals_s)?;
        let joins = spline.joins_s();
        for t in joins.iter().take(joins.len().saturating_sub(1)).skip(1) {
            for (joint, order) in (0..spline.joints()).flat_map(|j| (1..=3).map(move |o| (j, o))) {
                let side = |dt: f64| spline.at(joint, t + dt, order).unwrap_or(f64::NAN);
                // What the derivative itself changes over the gap is not a jump.
                let slope = spline.at(joint, *t, order + 1).unwrap_or(f64::NAN);
                let gap = 1e-7;
                largest = largest.max((side(gap) - side(-gap) - 2.0 * gap * slope).abs());
            }
        }
    }
    Ok(Claim::exact(
        "Velocity, acceleration and jerk have no sudden change",
        "at the joins of the spline with ISMA's times none of them jumps by more than 1e-6",
        largest <= 1e-6,
        format!("largest jump {}", figures(largest)),
    ))
}

#[cfg(test)]
mod tests {
    use super::rank;

    #[test]
    fn rank_counts_independent_rows_whatever_their_scale() {
        let rows = vec![vec![1e6, 2e6, 0.0], vec![1e-6, 2e-6, 1e-6], vec![3.0, 6.0, 2.0]];
        assert_eq!(rank(rows), 2);
        assert_eq!(rank(vec![vec![0.0, 1.0], vec![1.0, 0.0]]), 2);
        assert_eq!(rank(vec![vec![0.0, 0.0]]), 0);
        assert_eq!(rank(Vec::new()), 0);
    }
}
