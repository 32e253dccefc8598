//! `taustream bench cost`: the paper's cost function in vector lanes beside plain f64, and whole runs with it.
mod measure;

use crate::args::CostBenchArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use measure::{CostBench, Options, Runs, Set, measure};
use serde::Serialize;
use std::fmt;

/// The measurement, for people and programs.
#[derive(Serialize)]
#[serde(transparent)]
struct Answer(CostBench);

/// Measures and prints.
pub(super) fn run(form: Form, args: &CostBenchArgs) -> Result<(), Failure> {
    let robot = arm::robot(&args.robot)?;
    let options =
        Options { seconds: args.seconds, case_1_runs: args.case_1_runs, case_2_runs: args.case_2_runs };
    form.progress(format_args!(
        "measuring evaluations for {} s, then case 1 ({}) and case 2 ({}) ..",
        args.seconds, args.case_1_runs, args.case_2_runs
    ));
    let answer = Answer(measure(&robot, &options)?);
    form.print(&answer)?;
    let differing: usize = answer.0.sets.iter().flat_map(|set| &set.levels).map(|at| at.differing).sum();
    match differing {
        0 => Ok(()),
        _ => Err(Failure::Failed(format!(
            "{differing} penalties differ from the plain ones; please report this"
        ))),
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let b = &self.0;
        writeln!(
            f,
            "{}, {} poses an evaluation, one thread; best of this machine: {}",
            b.robot, b.poses, b.level
        )?;
        if b.debug_build {
            writeln!(f, "NOT a release build: these times say little (cargo run --release -- bench cost)")?;
        }
        for set in &b.sets {
            write_set(f, set)?;
        }
        write_runs(f, "case 1, fast", &b.case_1)?;
        write_runs(f, "case 1, plain f64", &b.case_1_plain)?;
        if let Some(runs) = &b.case_2 {
            write_runs(f, "case 2, fast", runs)?;
        }
        write!(
            f,
            "The paper: 54.924 s for case 1 and 2520.544 s for case 2, in another language on another machine."
        )
    }
}

fn write_set(f: &mut fmt::Formatter<'_>, set: &Set) -> fmt::Result {
    writeln!(f, "candidates {}, {:.1} % of them colliding:", set.candidates, set.colliding_percent)?;
    writeln!(f, "  {:<20} p50 (us)  mean (us)  times as fast  relative error", "")?;
    writeln!(f, "  {:<20} {:>8.2} {:>10.2}", "plain f64", set.plain.p50_us, set.plain.mean_us)?;
    for at in &set.levels {
        let (p50, mean, ratio) = (at.time.p50_us, at.time.mean_us, at.times_as_fast);
        writeln!(f, "  {:<20} {p50:>8.2} {mean:>10.2} {ratio:>14.1} {:>15.1e}", at.level, at.relative_error)?;
    }
    Ok(())
}

fn write_runs(f: &mut fmt::Formatter<'_>, name: &str, runs: &Runs) -> fmt::Result {
    let Runs { runs, evaluations, median_s, least_s, processor_s } = runs;
    let noun = if *runs == 1 { "run" } else { "runs" };
    write!(f, "whole IBFOA, {name:<18} {median_s:>8.3} s median, {least_s:.3} s least of {runs} {noun}")?;
    let had = processor_s.map_or_else(|| "?".to_owned(), |s| format!("{s:.3}"));
    writeln!(f, "; the median one: {had} s on the processor, {evaluations} evaluations")
}
