//! `taustream bench stops`: how long stops take, and how far they go, beside the optimum along the same path.
mod measure;

use crate::args::StopsBenchArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use measure::{Case, cases};
use serde::Serialize;
use std::fmt;
use taustream_arm::Robot;

/// Median, 95th percentile and worst of a ratio.
#[derive(Clone, Copy, Debug, Serialize)]
struct Spread {
    median: f64,
    p95: f64,
    worst: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |percent: usize| {
            let index = (values.len() * percent / 100).min(values.len().saturating_sub(1));
            values.get(index).copied().unwrap_or(f64::NAN)
        };
        Self { median: at(50), p95: at(95), worst: at(100) }
    }
}

impl fmt::Display for Spread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:>7.3} {:>7.3} {:>8.3}", self.median, self.p95, self.worst)
    }
}

/// The stops of one group of cases, over the optimum.
#[derive(Debug, Serialize)]
struct Row {
    group: String,
    cases: usize,
    duration_ratio: Spread,
    distance_ratio: Spread,
    pause_duration_ratio: Spread,
    /// Longest fast stop, s.
    longest_s: f64,
}

impl Row {
    fn of(group: String, cases: &[&Case]) -> Self {
        let spread = |value: fn(&Case) -> f64| Spread::of(cases.iter().map(|case| value(case)).collect());
        Self {
            group,
            cases: cases.len(),
            duration_ratio: spread(|case| case.fast.duration_s / case.optimum.duration_s),
            distance_ratio: spread(|case| case.fast.distance_rad / case.optimum.distance_rad),
            pause_duration_ratio: spread(|case| case.pause.duration_s / case.optimum.duration_s),
            longest_s: cases.iter().map(|case| case.fast.duration_s).fold(0.0, f64::max),
        }
    }
}

/// The tables.
#[derive(Debug, Serialize)]
struct Answer {
    robot: String,
    joint: String,
    /// No stop from a constant speed takes longer, s.
    stop_s_max: f64,
    by_speed: Vec<Row>,
    by_phase: Vec<Row>,
    by_move: Vec<Row>,
    by_speed_and_move: Vec<Row>,
    all: Row,
    /// How long it takes to choose a fast stop, us.
    choice_us: Spread,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "fast stops of straight moves of {}, joint {}, over rsruckig's velocity control with the stop limits; a pause beside them",
            self.robot, self.joint
        )?;
        writeln!(
            f,
            "                               duration (fast stop)      distance (fast stop)      duration (pause)         longest"
        )?;
        writeln!(
            f,
            "                       cases   median    p95    worst   median    p95    worst   median    p95    worst    (s)"
        )?;
        let tables = [&self.by_speed, &self.by_phase, &self.by_move, &self.by_speed_and_move];
        for row in tables.into_iter().flatten().chain([&self.all]) {
            writeln!(
                f,
                "{:<22} {:>5}  {}  {}  {} {:>7.3}",
                row.group,
                row.cases,
                row.duration_ratio,
                row.distance_ratio,
                row.pause_duration_ratio,
                row.longest_s
            )?;
        }
        writeln!(f, "choosing a fast stop takes (us): median, p95, worst {}", self.choice_us)?;
        write!(
            f,
            "by the limits alone, no stop from a constant speed takes longer than {:.3} s; a change takes at least 2 ms, so ratios are \
             high where the optimum is shorter",
            self.stop_s_max
        )
    }
}

/// Measures and prints.
pub(super) fn run(form: Form, args: &StopsBenchArgs) -> Result<(), Failure> {
    let robot = arm::modelled_robot(&args.robot)?;
    let found = cases(&robot, args.instants)?;
    form.print(&answer(&robot, &found))
}

fn answer(robot: &Robot, cases: &[Case]) -> Answer {
    let group = |name: String, belongs: &dyn Fn(&Case) -> bool| {
        let members: Vec<&Case> = cases.iter().filter(|case| belongs(case)).collect();
        Row::of(name, &members)
    };
    let moves = measure::MOVES_RAD;
    let by_speed_and_move = measure::SPEEDS.iter().flat_map(|speed| {
        moves.iter().map(move |travel_rad| {
            group(format!("{travel_rad} rad at {:.0} %", 100.0 * speed), &|case: &Case| {
                same(case.speed, *speed) && same(case.travel_rad, *travel_rad)
            })
        })
    });
    Answer {
        robot: robot.name.clone(),
        joint: robot.joints.first().map(|joint| joint.name.clone()).unwrap_or_default(),
        stop_s_max: robot.stop_s(),
        by_speed: measure::SPEEDS
            .iter()
            .map(|speed| group(format!("at {:.0} %", 100.0 * speed), &|case| same(case.speed, *speed)))
            .collect(),
        by_phase: (0..measure::PHASES)
            .map(|phase| {
                let [from, to] = [phase, phase + 1].map(|end| end * 100 / measure::PHASES);
                group(format!("at {from} to {to} % of it"), &|case| case.phase == phase)
            })
            .collect(),
        by_move: moves
            .iter()
            .map(|travel_rad| {
                group(format!("moves of {travel_rad} rad"), &|case| same(case.travel_rad, *travel_rad))
            })
            .collect(),
        by_speed_and_move: by_speed_and_move.collect(),
        all: group("all".to_owned(), &|_| true),
        choice_us: Spread::of(cases.iter().map(|case| case.choice_us).collect()),
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-9
}
