//! Figure 1 and section 4: Tau-J*, Tau-J, the quintic and the cubic spline.
use super::{K, refused};
use crate::chart::Panel;
use crate::claim::Claim;
use crate::figure::Figure;
use crate::number::figures;
use crate::registry::Outcome;
use crate::run_context::{RunContext, Stop};
use crate::table::{Cell, Table};
use taustream_motion::profile::{Profile, Quintic, Septic, TauJ, TauJStar};
use taustream_motion::spline::{CubicSpline, Ends};

/// The knots of figure 1 (s, m).
const KNOTS: [(f64, f64); 5] = [(0.0, 0.0), (100.0, 300.0), (200.0, 200.0), (300.0, -300.0), (400.0, -700.0)];
/// Points of a curve.
const POINTS: u32 = 1_200;
/// Shares of a segment before its end at which the jerk is looked at.
const BEFORE: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// Below this share of the peak jerk, the jerk at an end counts as zero.
const NOTHING: f64 = 1e-9;

/// An interpolator between knots.
enum Construction {
    /// The same profile between each two knots, at rest at all of them.
    Stops(&'static str, Box<dyn Profile>),
    /// One spline through all knots.
    Through(&'static str, Box<CubicSpline>),
}

/// Velocity, acceleration and jerk.
type Rates = [f64; 3];

impl Construction {
    fn name(&self) -> &'static str {
        match self {
            Self::Stops(name, _) | Self::Through(name, _) => name,
        }
    }

    /// Peaks over all segments.
    fn peaks(&self) -> Rates {
        let (peaks, length, time_s) = match self {
            Self::Stops(_, profile) => {
                let longest = KNOTS.windows(2).map(|p| step(p).1.abs()).fold(0.0, f64::max);
                (profile.peaks(), longest, KNOTS[1].0)
            }
            // The spline is over its whole span, and in metres already.
            Self::Through(_, spline) => (spline.peaks(), 1.0, KNOTS[KNOTS.len() - 1].0),
        };
        let [v, a, j] = [peaks.c_v, peaks.c_a, peaks.c_j];
        [length * v / time_s, length * a / time_s.powi(2), length * j / time_s.powi(3)]
    }

    /// At the very start and the very end of the motion, from inside.
    fn ends(&self) -> [Rates; 2] {
        match self {
            Self::Stops(_, profile) => {
                let [start, end] = profile.ends();
                let of = |knots: &[(f64, f64)], phi: taustream_motion::stroke::Phi| {
                    let (time_s, delta) = step(knots);
                    [
                        delta * phi.d1 / time_s,
                        delta * phi.d2 / time_s.powi(2),
                        delta * phi.d3 / time_s.powi(3),
                    ]
                };
                [of(&KNOTS[..2], start), of(&KNOTS[KNOTS.len() - 2..], end)]
            }
            Self::Through(_, spline) => spline.span_s().map(|t_s| {
                let phi = spline.sample(t_s);
                [phi.d1, phi.d2, phi.d3]
            }),
        }
    }

    /// Position and its derivatives.
    fn at(&self, t_s: f64) -> [f64; 4] {
        match self {
            Self::Stops(_, profile) => {
                let pair = KNOTS.windows(2).find(|p| t_s <= p[1].0).unwrap_or(&KNOTS[KNOTS.len() - 2..]);
                let (time_s, delta) = step(pair);
                let phi = profile.at((t_s - pair[0].0) / time_s);
                let rates = [phi.d1 / time_s, phi.d2 / time_s.powi(2), phi.d3 / time_s.powi(3)];
                let [v, a, j] = rates.map(|r| delta * r);
                [pair[0].1 + delta * phi.value, v, a, j]
            }
            Self::Through(_, spline) => {
                let phi = spline.sample(t_s);
                [phi.value, phi.d1, phi.d2, phi.d3]
            }
        }
    }
}

fn step(knots: &[(f64, f64)]) -> (f64, f64) {
    match knots {
        [a, b, ..] => (b.0 - a.0, b.1 - a.1),
        _ => (f64::NAN, f64::NAN),
    }
}

/// Tau-J*, Tau-J, quintic, spline: the first four are the paper's figure.
fn distances() -> Result<[Construction; 6], Stop> {
    let spline = |ends| CubicSpline::new(&KNOTS, ends).map(Box::new).map_err(refused);
    Ok([
        Construction::Stops("Tau-J*", Box::new(TauJStar::new(K).map_err(refused)?)),
        Construction::Stops("Tau-J", Box::new(TauJ::new(K).map_err(refused)?)),
        Construction::Stops("quintic", Box::new(Quintic)),
        Construction::Through("cubic spline, clamped", spline(Ends::Clamped)?),
        Construction::Through("cubic spline, not-a-knot", spline(Ends::NotAKnot)?),
        Construction::Stops("septic (not in the paper)", Box::new(Septic)),
    ])
}

/// Computes them; nothing is random.
pub(crate) fn run(_run_context: &RunContext) -> Result<Outcome, Stop> {
    let distances = distances()?;
    Ok(Outcome {
        ours: vec![format!(
            "the cubic spline's end conditions: both usual ones are shown; k = {K} where it is not said"
        )],
        tables: vec![figure_1(&distances), peaks()?, jerk_at_the_end()],
        figures: vec![picture(&distances)],
        claims: claims(&distances)?,
    })
}

fn figure_1(distances: &[Construction]) -> Table {
    let columns = [
        "",
        "peak velocity (m/s)",
        "peak acceleration (m/s²)",
        "peak jerk (m/s³)",
        "acceleration at the start",
        "at the end",
        "jerk at the start (m/s³)",
        "at the end",
    ];
    let note = "Knots 0, 300, 200, -300, -700 m every 100 s, k = 0.1; the paper prints curves only.";
    let mut table = Table::new("Figure 1", "", note, &columns);
    for construction in distances {
        let ([v, a, j], [start, end]) = (construction.peaks(), construction.ends());
        let cells = [v, a, j, start[1], end[1], start[2], end[2]];
        table.row(construction.name(), cells.map(Cell::number).to_vec());
    }
    table
}

fn peaks() -> Result<Table, Stop> {
    let columns = ["k", "Tau-J c_v", "c_a", "c_j", "Tau-J* c_v", "c_a", "c_j"];
    let note = "Peaks are c_v x0/T, c_a x0/T², c_j x0/T³. Quintic and septic have no k.";
    let mut table = Table::new("Peak factors over k", "", note, &columns);
    let factors = |profile: &dyn Profile| {
        let peaks = profile.peaks();
        [peaks.c_v, peaks.c_a, peaks.c_j].map(Cell::number)
    };
    for k in [0.05, 0.1, 0.15, 0.18, 0.2, 0.215, 0.25, 0.3] {
        let (j, star) = (TauJ::new(k).map_err(refused)?, TauJStar::new(k).map_err(refused)?);
        table.row(figures(k), [factors(&j), factors(&star)].concat());
    }
    let blank = || [Cell::None, Cell::None, Cell::None];
    table.row("quintic", [factors(&Quintic), blank()].concat());
    table.row("septic", [factors(&Septic), blank()].concat());
    Ok(table)
}

/// For which k the jerk vanishes at the end.
fn jerk_at_the_end() -> Table {
    let columns =
        ["k", "Tau-J, s = 1 - 1e-3", "1 - 1e-6", "1 - 1e-9", "Tau-J*, s = 1 - 1e-3", "1 - 1e-6", "1 - 1e-9"];
    let note = "Jerk shortly before the end, in x0/T³. From k = 1/3 on it does not vanish, and our profiles refuse k.";
    let mut table = Table::new("Jerk towards the end", "x0/T³", note, &columns);
    for k in [0.05, 0.1, 0.2, 0.25, 0.3, 0.33, 1.0 / 3.0, 0.4] {
        let near = |profile: Option<Box<dyn Profile>>| -> Vec<Cell> {
            let at = |before: &f64| match &profile {
                Some(profile) => Cell::number(profile.at(1.0 - before).d3),
                None => Cell::words("refused"),
            };
            BEFORE.iter().map(at).collect()
        };
        let j = near(TauJ::new(k).ok().map(|p| -> Box<dyn Profile> { Box::new(p) }));
        let star = near(TauJStar::new(k).ok().map(|p| -> Box<dyn Profile> { Box::new(p) }));
        table.row(figures(k), [j, star].concat());
    }
    table
}

fn picture(distances: &[Construction]) -> Figure {
    let names = ["position (m)", "velocity (m/s)", "acceleration (m/s²)", "jerk (m/s³)"];
    let panels = names.iter().enumerate().map(|(order, name)| {
        let mut panel = Panel::new("t (s)", name);
        for construction in distances.iter().take(4) {
            let at = |i: u32| {
                let t_s = KNOTS[KNOTS.len() - 1].0 * f64::from(i) / f64::from(POINTS);
                (t_s, construction.at(t_s)[order])
            };
            panel.line(construction.name(), (0..=POINTS).map(at).collect());
        }
        panel
    });
    let panels: Vec<Panel> = panels.collect();
    Figure::of("000-profiles.svg", "Paper 000, figure 1: four interpolators", 2, &panels)
}

fn claims(distances: &[Construction]) -> Result<Vec<Claim>, Stop> {
    let [star, tau_j, quintic, spline, not_a_knot, _] = distances else {
        return Err(Stop::Refused("six interpolators are needed".to_owned()));
    };
    let is_zero = |construction: &Construction, value: f64| value.abs() <= NOTHING * construction.peaks()[2];
    let jerks = |construction: &Construction| construction.ends().map(|e| e[2]);
    let shown = |construction: &Construction| {
        let [start, end] = jerks(construction);
        format!("{} {} and {} m/s³", construction.name(), figures(start), figures(end))
    };
    let both = |construction: &Construction, zero: bool| {
        jerks(construction).iter().all(|j| is_zero(construction, *j) == zero)
    };
    let limit = (1.0 - 1e-6) / 3.0;
    let up_to = TauJStar::new(limit).is_ok() && TauJStar::new(1.0 / 3.0).is_err();
    let ends = [spline, not_a_knot].map(|w| w.ends().map(|e| e[1]));
    let peak = |construction: &Construction| construction.peaks()[2];
    let rests = |construction: &Construction| match construction {
        Construction::Stops(_, profile) => profile.rest_order() >= 2,
        Construction::Through(..) => false,
    };
    Ok(vec![
        Claim::exact(
            "Tau-J* has zero jerk at the start and at the end",
            "both are less than 1e-9 of its peak, at the paper's k = 0.1",
            both(star, true),
            format!(
                "{}; true for k below 1/3 only, which our profile {}",
                shown(star),
                if up_to { "requires" } else { "does not require" }
            ),
        ),
        Claim::exact(
            "Tau-J has non-zero jerk at the start and at the end",
            "neither is less than 1e-9 of its peak",
            both(tau_j, false),
            shown(tau_j),
        ),
        Claim::exact(
            "The quintic's jerk is not zero at start and end",
            "neither is less than 1e-9 of its peak",
            both(quintic, false),
            shown(quintic),
        ),
        Claim::exact(
            "The cubic spline's acceleration is not zero at start and end",
            "neither is zero with either end condition",
            ends.iter().flatten().all(|a| a.abs() > 1e-6),
            format!("clamped {:?}, not-a-knot {:?} m/s²", ends[0].map(figures), ends[1].map(figures)),
        ),
        Claim::exact(
            "Tau-J*, Tau-J and the quintic stop at every knot, the spline does not",
            "velocity and acceleration are zero at both ends of their segments; the spline's velocity at an inner knot is not",
            [star, tau_j, quintic].into_iter().all(rests) && spline.at(KNOTS[1].0)[1].abs() > 1e-6,
            format!("the clamped spline passes the second knot at {} m/s", figures(spline.at(KNOTS[1].0)[1])),
        ),
        Claim::exact(
            "Tau-J* guides the more compliant motion",
            "its peak jerk on figure 1 is less than Tau-J's and the quintic's (at its ends it is: see above)",
            peak(star) < peak(tau_j) && peak(star) < peak(quintic),
            [star, tau_j, quintic].map(|w| format!("{} {}", w.name(), figures(peak(w)))).join(", ") + " m/s³",
        ),
    ])
}
