//! `taustream bench cycle`: wake-up lateness and the cost of the streamer's cycle, beside bare loops.
use crate::args::{BenchArgs, BenchName};
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use taustream_arm::text::counted;
use taustream_streamer::bench::{BenchError, BenchOptions, CycleBench, Quantiles, cycle};

/// The measurement, for people and programs.
#[derive(Serialize)]
#[serde(transparent)]
struct Answer(CycleBench);

/// Measures and prints.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &BenchArgs) -> Result<(), Failure> {
    let (seconds, slices, link, allow_non_realtime) = match &args.name {
        BenchName::Cycle { seconds, slices, link, allow_non_realtime } => {
            (seconds, slices, link, allow_non_realtime)
        }
        BenchName::Compare(args) => return super::compare::run(form, args),
        BenchName::Cost(args) => return super::cost_bench::run(form, args),
        BenchName::Follow(args) => return super::follow_bench::run(form, args),
        BenchName::Mbm(args) => return super::mbm::run(form, args),
        BenchName::Papers(args) => return super::papers::run(form, args),
        BenchName::Pictures(args) => return super::pictures::run(form, args),
        BenchName::Planners(args) => return super::planners::run(form, args),
        BenchName::Cuts(args) => return super::cuts_bench::run(form, args),
        BenchName::Stops(args) => return super::stops_bench::run(form, args),
        BenchName::Timing(args) => return super::timing_bench::run(form, args),
    };
    let options = BenchOptions {
        settings: arm::settings(settings)?,
        seconds: *seconds,
        slices: *slices,
        link: *link,
        allow_non_realtime: *allow_non_realtime,
    };
    form.progress(format_args!("measuring for {seconds} s, the two loops alternately ({slices} slices) .."));
    form.print(&Answer(cycle(&options).map_err(|error| failure(&error))?))
}

/// Why nothing was measured, as a failure of the command.
pub(super) fn failure(error: &BenchError) -> Failure {
    match error {
        BenchError::Options { .. } => Failure::Usage(error.to_string()),
        BenchError::Link(_) | BenchError::Rights(_) | BenchError::NotMoving(_) | BenchError::System(_) => {
            Failure::Failed(format!("nothing was measured: {error}"))
        }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let b = &self.0;
        let rights = if b.realtime { "SCHED_FIFO, memory locked" } else { "WITHOUT real-time rights" };
        writeln!(
            f,
            "{}, {}, {} us, {rights}; {} skipped",
            counted(b.joints, "joint"),
            b.link,
            b.period_us,
            counted(b.skipped, "deadline")
        )?;
        writeln!(f, "                            p50 (us)   p99 (us)  p99.9 (us)    max (us)     cycles")?;
        row(f, "wake-up lateness, streamer", &b.streamer_lateness)?;
        row(f, "wake-up lateness, bare", &b.bare_lateness)?;
        row(f, "whole cycle, streamer", &b.streamer_cycle)?;
        row(f, "same calls, bare", &b.bare_cycle)?;
        writeln!(f, "ratios, streamer over bare: lateness p99 {:.3}", b.lateness_p99_ratio)?;
        writeln!(
            f,
            "                            cycle p50 {:.3}, p99 {:.3}",
            b.cycle_p50_ratio, b.cycle_p99_ratio
        )?;
        writeln!(
            f,
            "16 joints on 4 buses over this arm, without system calls: cycle p50 {:.3}",
            b.sixteen_p50_ratio
        )?;
        write!(f, "{}", StageTable(b))
    }
}

/// The stages of the cycle beside the same system calls in the bare loop.
struct StageTable<'a>(&'a CycleBench);

impl fmt::Display for StageTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let read_ns = self.0.clock_read.p50_ns;
        writeln!(
            f,
            "stages, in slices of their own; each time includes one clock read, which takes {read_ns} ns (p50):"
        )?;
        writeln!(
            f,
            "  stage         p50 (us)  p99 (us)  max (us)  of the cycle   bare loop: p50 (us)  p99 (us)  max (us)"
        )?;
        for s in &self.0.stages {
            let (p50, p99, max) = (us(s.time.p50_ns), us(s.time.p99_ns), us(s.time.max_ns));
            write!(f, "  {:<12} {p50:>9.2} {p99:>9.2} {max:>9.2} {:>11.1} %", s.stage, s.share_percent)?;
            match s.bare {
                Some(b) => {
                    let (p50, p99, max) = (us(b.p50_ns), us(b.p99_ns), us(b.max_ns));
                    writeln!(f, "   {p50:>19.2} {p99:>9.2} {max:>9.2}")?;
                }
                None => writeln!(f, "   {:>19} {:>9} {:>9}", "-", "-", "-")?,
            }
        }
        Ok(())
    }
}

/// Nanoseconds as microseconds.
fn us(ns: u64) -> f64 {
    std::time::Duration::from_nanos(ns).as_secs_f64() * 1e6
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, q: &Quantiles) -> fmt::Result {
    let (p50, p99, p999, max) = (us(q.p50_ns), us(q.p99_ns), us(q.p999_ns), us(q.max_ns));
    writeln!(f, "{name:<27} {p50:>9.2}  {p99:>9.2}  {p999:>10.2}  {max:>10.2} {:>10}", q.count)
}
