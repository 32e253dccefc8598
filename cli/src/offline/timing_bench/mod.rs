//! `taustream bench timing`: durations of straight moves and of rounded paths against jerk-limited optima.
mod paths;
mod straight;

use super::limit_sets::{LimitedArm, limit_sets};
use crate::args::TimingArgs;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use paths::{PathRow, Sampled};
use serde::Serialize;
use std::fmt;
use straight::StraightRow;

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
    let arms = limit_sets(&args.robot)?;
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
