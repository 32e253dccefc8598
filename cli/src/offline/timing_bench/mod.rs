//! `taustream bench timing`: durations of straight moves and of rounded paths against jerk-limited optima.
mod paths;
mod straight;

use crate::args::TimingArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use paths::{PathRow, Sampled};
use serde::Serialize;
use std::fmt;
use straight::StraightRow;
use taustream_motion::{JointLimits, LimitSet, MAX_JOINTS};

/// Limits under a name.
struct Arm {
    name: String,
    joints: usize,
    limits: [JointLimits; MAX_JOINTS],
}

/// The measurement, for people and programs.
#[derive(Serialize)]
struct Answer {
    straight: Vec<StraightRow>,
    paths: Vec<PathRow>,
}

/// Median and largest of some values.
#[derive(Clone, Copy, Debug, Serialize)]
struct Spread {
    median: f64,
    largest: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self { median: *values.get(values.len() / 2)?, largest: *values.last()? })
    }
}

/// Measures and prints.
pub(super) fn run(form: Form, args: &TimingArgs) -> Result<(), Failure> {
    let mut arms = Vec::new();
    for given in &args.robot {
        let robot = arm::robot(given)?;
        arms.push(Arm { name: robot.name.clone(), joints: robot.joints.len(), limits: robot.limits() });
    }
    arms.push(even("like a Panda: 2.175, 15, 7500", [2.175, 15.0, 7500.0]));
    arms.push(even("gentle: 3, 2, 10", [3.0, 2.0, 10.0]));
    arms.push(even("slow: 0.5, 15, 150", [0.5, 15.0, 150.0]));
    form.progress(format_args!("timing straight moves and paths under {} sets of limits ..", arms.len()));
    let straight = arms.iter().flat_map(|arm| straight::rows(arm, args)).collect();
    let (mut paths, mut sampled) = (Vec::new(), Vec::new());
    for arm in &arms {
        let (rows, motions) = paths::rows(arm, args);
        paths.extend(rows);
        sampled.extend(motions);
    }
    if let Some(path) = &args.output {
        let lines: Vec<String> = sampled.iter().map(Sampled::to_line).collect();
        write_whole(path, &lines.join(""))?;
    }
    form.print(&Answer { straight, paths })
}

/// Six joints of the same limits.
fn even(name: &str, [velocity_rad_s, acceleration_rad_s2, jerk_rad_s3]: [f64; 3]) -> Arm {
    let motion = LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 };
    let joint = JointLimits { motion, stop: motion, ..JointLimits::default() };
    Arm { name: name.to_owned(), joints: 6, limits: [joint; MAX_JOINTS] }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "straight moves: duration / jerk-limited optimum along the line; at most 1.12 is promised"
        )?;
        writeln!(
            f,
            "{:<30} {:>9} {:>7} {:>7} {:>8} {:>6}",
            "limits", "length", "median", "largest", "strokes", "us"
        )?;
        for row in &self.straight {
            writeln!(f, "{row}")?;
        }
        writeln!(
            f,
            "\npaths of five points, 0.3 to 12 rad: duration / sum of the optima that stop at every point"
        )?;
        write!(
            f,
            "{:<30} {:>9} {:>7} {:>7} {:>8} {:>6}",
            "limits", "blend", "median", "largest", "rounded", "us"
        )?;
        for row in &self.paths {
            write!(f, "\n{row}")?;
        }
        Ok(())
    }
}
