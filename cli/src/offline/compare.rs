//! `taustream bench compare`: the streamer's cycle with several settings files, side by side in one run.
use crate::args::CompareArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use taustream_arm::Settings;
use taustream_streamer::bench::{BenchOptions, Compared, compare};

/// The measurement, for people and programs.
#[derive(Serialize)]
#[serde(transparent)]
struct Answer(Vec<Compared>);

/// Measures and prints.
pub(super) fn run(form: Form, args: &CompareArgs) -> Result<(), Failure> {
    let load = |given: &std::path::PathBuf| arm::settings(Some(given.as_path()));
    let arms = args.arms.iter().map(load).collect::<Result<Vec<Settings>, Failure>>()?;
    let Some((first, beside)) = arms.split_first() else {
        return Err(Failure::Usage("name at least two settings files".to_owned()));
    };
    let (seconds, slices) = (args.seconds, args.slices);
    let options = BenchOptions {
        settings: first.clone(),
        seconds,
        slices,
        link: args.link,
        allow_non_realtime: args.allow_non_realtime,
    };
    let count = arms.len();
    form.progress(format_args!("measuring {count} arms for {seconds} s each, in {slices} rounds .."));
    form.print(&Answer(compare(&options, beside).map_err(|error| super::bench::failure(&error))?))
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let realtime = self.0.iter().all(|arm| arm.realtime);
        let rights = if realtime { "SCHED_FIFO, memory locked" } else { "WITHOUT real-time rights" };
        writeln!(f, "whole cycle of each arm, alternately in one run; {rights}")?;
        write!(
            f,
            "arm            buses  joints  p50 (us)  p99 (us)  bare p50  against the first: p50    p99"
        )?;
        for arm in &self.0 {
            let us = |ns: u64| std::time::Duration::from_nanos(ns).as_secs_f64() * 1e6;
            let (p50, p99, bare) = (us(arm.cycle.p50_ns), us(arm.cycle.p99_ns), us(arm.bare.p50_ns));
            write!(
                f,
                "\n{:<14} {:>5} {:>7} {p50:>9.2} {p99:>9.2} {bare:>9.2} {:>23.3} {:>6.3}  {}",
                arm.arm, arm.buses, arm.joints, arm.p50_ratio, arm.p99_ratio, arm.link
            )?;
        }
        Ok(())
    }
}
