//! `taustream bench timing`: durations of straight moves and of rounded paths against jerk-limited optima.
mod paths;
mod straight;

use super::limit_sets::{LimitedArm, limit_sets};
use crate::args::TimingArgs;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use paths::{PathRow, Sampled};
use rustix::time::{ClockId, clock_gettime};
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

/// What a call returns, and the processor time that it took, microseconds: others run beside it.
fn timed<T>(call: impl FnOnce() -> T) -> (T, f64) {
    let processor_us = || {
        let now = clock_gettime(ClockId::ThreadCPUTime);
        now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3
    };
    let begun_us = processor_us();
    let result = call();
    (result, processor_us() - begun_us)
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
            "straight moves: duration / jerk-limited optimum along the line; at most 1.12 is promised. The last two columns are what 128 \
             strokes would take (1.08 would be bold). us: processor time of a call, at most 300 is promised"
        )?;
        writeln!(
            f,
            "{:<30} {:>9} {:>7} {:>7} {:>8} {:>6} {:>7} {:>7}",
            "limits", "length", "median", "largest", "strokes", "us", "median", "largest"
        )?;
        for row in &self.straight {
            writeln!(f, "{row}")?;
        }
        writeln!(
            f,
            "\npaths of five points, 0.3 to 12 rad: duration / sum of the optima that stop at every point. us: processor time of a call, \
             at most 1000 is promised"
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
