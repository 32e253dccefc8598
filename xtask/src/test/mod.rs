//! `cargo xtask test`: everything that must hold before a change lands, in parts that can be run alone.
mod fast;
mod peers;
mod rights;
mod services;
mod vcan;

use crate::packages;
use crate::place::Place;
use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use std::fmt::Write as _;
use std::process::ExitCode;
use std::time::Instant;

const HELP: &str = "\
Examples:
  cargo xtask test                     everything; this is what must pass before a change lands
  cargo xtask test fast                what needs no root, no packages and no test machine, on any Linux
  cargo xtask test vcan --only bus     the steps of one part whose name contains a word
  cargo xtask test vcan --repeat 10    again and again, with a table of the runs at the end";

/// The words of `cargo xtask test`.
#[derive(Args, Debug)]
#[command(after_help = HELP)]
pub(crate) struct Arguments {
    /// Run these parts only [default: all].
    #[arg(value_enum)]
    parts: Vec<Part>,
    /// Run only steps whose name contains this.
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
    /// List parts and steps with what they need, and run nothing.
    #[arg(long)]
    list: bool,
    /// Run the steps this many times, continue after a failure, and print a table of the runs.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeat: u32,
}

/// Steps that need the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Format, lints, tests, the commands of the documentation, the demo without real-time rights.
    Fast,
    /// Licences, sources and banned crates of all dependencies, by cargo-deny.
    Licences,
    /// Our numbers against other people's libraries and against programs written from the papers.
    Peers,
    /// Links, masters, devices and scenarios on a real vcan0 in the test machine.
    Vcan,
    /// The installed services in a Debian whose process 1 is systemd.
    Systemd,
}

impl Part {
    fn word(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// What came of a step.
enum Outcome {
    Passed,
    /// Something that is not part of this project is not here: what, and how to get it.
    Skipped(String),
}

/// One step of a part.
struct Step {
    name: &'static str,
    part: Part,
    /// Debian packages.
    packages: &'static [&'static str],
    /// It runs programs of the workspace, which are built first.
    programs: bool,
    run: fn(&Place) -> Result<Outcome>,
}

/// Every step, in the order in which they run.
fn steps() -> impl Iterator<Item = &'static Step> {
    [fast::STEPS, fast::LICENCES, peers::STEPS, vcan::STEPS, services::STEPS].into_iter().flatten()
}

/// Runs what was requested; without `--repeat` the first failure ends the run.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode> {
    let wanted = |step: &&Step| {
        let part = arguments.parts.is_empty() || arguments.parts.contains(&step.part);
        part && arguments.only.as_ref().is_none_or(|word| step.name.contains(word.as_str()))
    };
    let chosen: Vec<&Step> = steps().filter(wanted).collect();
    if arguments.list {
        print!("{}", list(&chosen));
        return Ok(ExitCode::SUCCESS);
    }
    ensure!(!chosen.is_empty(), "no step is called so; `cargo xtask test --list` shows them");
    let since = Instant::now();
    let place = Place::find()?;
    // All packages are named before anything runs.
    let needed: Vec<&str> = chosen.iter().flat_map(|step| step.packages.iter().copied()).collect();
    packages::ensure(&needed)?;
    if chosen.iter().any(|step| step.programs) {
        fast::build(&place)?;
    }
    if arguments.repeat > 1 {
        return repeat(&chosen, &place, arguments.repeat);
    }
    let mut skipped = Vec::new();
    for step in &chosen {
        if let Outcome::Skipped(what) = (step.run)(&place)? {
            skipped.push(format!("SKIPPED {}: {what}", step.name));
        }
    }
    let whole = if chosen.len() == steps().count() { "everything" } else { "what was chosen" };
    for line in &skipped {
        println!("{line}");
    }
    let skipped = if skipped.is_empty() { "nothing was skipped" } else { "but what is named above" };
    println!("\nTEST OK: {whole} passed, {skipped}, {:.0} s", since.elapsed().as_secs_f64());
    Ok(ExitCode::SUCCESS)
}

fn list(steps: &[&Step]) -> String {
    let mut text = String::new();
    let mut part = None;
    for step in steps {
        if part != Some(step.part) {
            part = Some(step.part);
            let value = step.part.to_possible_value();
            let help = value.as_ref().and_then(|v| v.get_help()).map(ToString::to_string).unwrap_or_default();
            // Writing to a String cannot fail.
            let _never = writeln!(text, "{}: {help}", step.part.word());
        }
        let needs = if step.packages.is_empty() {
            String::new()
        } else {
            format!(" (packages: {})", step.packages.join(" "))
        };
        let _never = writeln!(text, "    {}{needs}", step.name);
    }
    text
}

/// Runs the steps again and again; every run is tried whole, and a table tells how each went.
fn repeat(steps: &[&Step], place: &Place, runs: u32) -> Result<ExitCode> {
    let mut table = String::from("run  load before  load after  time (s)  result\n");
    let mut green = 0;
    for run in 1..=runs {
        let (since, load) = (Instant::now(), load()?);
        let mut failed = Vec::new();
        for step in steps {
            if let Err(error) = (step.run)(place) {
                eprintln!("FAILED {}: {error:#}", step.name);
                failed.push(step.name);
            }
        }
        let result =
            if failed.is_empty() { "green".to_owned() } else { format!("red: {}", failed.join(", ")) };
        green += u32::from(failed.is_empty());
        let took_s = since.elapsed().as_secs_f64();
        let _never = writeln!(table, "{run:>3}  {load:>11}  {:>10}  {took_s:>8.0}  {result}", self::load()?);
        println!("\n{table}");
    }
    println!("{green} of {runs} runs are green");
    Ok(if green == runs { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The load average of the last minute.
fn load() -> Result<String> {
    let text = std::fs::read_to_string("/proc/loadavg").context("/proc/loadavg")?;
    Ok(text.split(' ').next().unwrap_or("?").to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_has_steps_and_every_step_a_name_of_its_own() {
        let mut names: Vec<&str> = steps().map(|step| step.name).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count, "two steps of one name");
        for part in Part::value_variants() {
            assert!(steps().any(|step| step.part == *part), "{part:?} has no steps");
        }
    }

    #[test]
    fn fast_part_needs_no_packages() {
        assert!(steps().filter(|step| step.part == Part::Fast).all(|step| step.packages.is_empty()));
    }

    #[test]
    fn list_names_every_part_step_and_package() {
        let text = list(&steps().collect::<Vec<_>>());
        for word in ["fast: Format", "vcan: Links", "    lints", "packages: user-mode-linux iproute2"] {
            assert!(text.contains(word), "no `{word}` in:\n{text}");
        }
    }
}
