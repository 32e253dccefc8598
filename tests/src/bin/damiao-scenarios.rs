//! Runs the scenarios of Damiao motors on a real vcan0 and judges their recordings. Meant to run inside the test machine.
use anyhow::{Context, Result, bail, ensure};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;
use taustream_tests::damiao_scenarios::{ALL, Scenario};
use taustream_tests::mit_setpoints::{LogEnds, encodings, judge};
use taustream_tests::scenarios::Goals;
use taustream_tests::setpoints::{BusFrame, Verdict};
use taustream_tests::stage::{Place, Stage};
use taustream_tests::{candump, cycle_log};

/// Runs the scenarios of Damiao motors over the real processes on a real vcan0.
#[derive(Parser, Debug)]
struct Arguments {
    /// Settings of an arm of Damiao motors in MIT mode.
    #[arg(long, default_value = "config/settings/damiao6.toml")]
    settings: PathBuf,
    /// Demo file: start pose and goals.
    #[arg(long, default_value = "config/demo.toml")]
    demo: PathBuf,
    /// Folder for logs and recordings.
    #[arg(long, default_value = "target/damiao-scenarios")]
    output: PathBuf,
    /// Only scenarios whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
}

/// How often a scenario is tried on a host that stalls the machine.
const TRIES: usize = 3;

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("damiao-scenarios: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<usize> {
    let (place, goals) = read(arguments)?;
    let chosen: Vec<&Scenario> = ALL.iter().filter(|s| s.name.contains(&arguments.only)).collect();
    ensure!(!chosen.is_empty(), "no scenario is called `{}`", arguments.only);
    let mut failed = 0;
    for scenario in &chosen {
        let since = Instant::now();
        let result = perform_with_patience(scenario, &place, &goals);
        let took_s = since.elapsed().as_secs_f64();
        match result {
            Ok(v) => println!(
                "ok     {}: {} frames on the bus, {} cycles, {} commands equal to the log, {} of them to a trajectory; {took_s:.1} s",
                scenario.name, v.frames, v.syncs, v.setpoints, v.on_trajectory
            ),
            Err(error) => {
                failed += 1;
                println!("FAILED {}: {error:#}; {took_s:.1} s", scenario.name);
            }
        }
    }
    println!("{} passed, {failed} failed", chosen.len() - failed);
    Ok(failed)
}

/// Tries a scenario again, aloud, when the host held the whole machine up. A fault of the product comes back in every try.
fn perform_with_patience(scenario: &Scenario, place: &Place, goals: &Goals) -> Result<Verdict> {
    for attempt in 1..TRIES {
        let folder = format!("{}-{attempt}", scenario.name);
        match perform(scenario, place, goals, &folder) {
            Err(error) if was_stalled(place, &folder) => {
                let reason: String = error.to_string().chars().take(160).collect();
                println!("       {}: the host stalled the machine, trying again: {reason}", scenario.name);
            }
            outcome => return outcome,
        }
    }
    perform(scenario, place, goals, &format!("{}-{TRIES}", scenario.name))
}

/// True when the streamer could not run for longer than the motors bridge.
fn was_stalled(place: &Place, folder: &str) -> bool {
    let said = std::fs::read_to_string(place.output.join(folder).join("streamer.err")).unwrap_or_default();
    ["no setpoint left for", "loop stalled"].iter().any(|sign| said.contains(sign))
}

fn perform(scenario: &Scenario, place: &Place, goals: &Goals, folder: &str) -> Result<Verdict> {
    let mut stage = Stage::open(place, folder)?;
    let motors = encodings(&stage.settings).context("not every servo is a Damiao motor in MIT mode")?;
    let period_s = f64::from(stage.settings.cycle.period_us) * 1e-6;
    let interface = stage.settings.buses.first().context("no bus")?.interface.clone();
    (scenario.run)(&mut stage, goals)?;
    let (recording, log) = stage.close_whatever_became_of_the_streamer()?;
    let seen = |record: candump::Record| BusFrame {
        id: record.frame.id().raw(),
        data: record.frame.data().to_vec(),
    };
    let records = candump::parse(&recording)?.into_iter().filter(|record| record.interface == interface);
    let frames: Vec<BusFrame> = records.map(seen).collect();
    let mut text = std::fs::read_to_string(&log).with_context(|| format!("cannot read {}", log.display()))?;
    if scenario.kills {
        // The last line may be half a line, and the last cycles none.
        text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
    }
    let ends = if scenario.kills { LogEnds::Early } else { LogEnds::WithTheStreamer };
    let verdict = judge((&frames, &cycle_log::parse(&text)?), 0, (&motors, period_s), ends)?;
    // A recording without motion would pass every comparison.
    ensure!(verdict.on_trajectory > 0, "nothing was compared with a trajectory");
    Ok(verdict)
}

fn read(arguments: &Arguments) -> Result<(Place, Goals)> {
    let file = &arguments.demo;
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let demo: toml::Table = text.parse().with_context(|| format!("{} is no TOML", file.display()))?;
    let numbers = |value: &toml::Value| -> Option<Vec<f64>> {
        value.as_array()?.iter().map(toml::Value::as_float).collect()
    };
    let start = demo.get("start_rad").and_then(numbers).context("start_rad is missing")?;
    let goals = demo.get("goals_rad").and_then(|v| v.as_array()).context("goals_rad is missing")?;
    let goals: Option<Vec<Vec<f64>>> = goals.iter().map(numbers).collect();
    let goals = goals.context("goals_rad holds something that is no number")?;
    if goals.len() < 3 {
        bail!("{} goals; the scenarios need three", goals.len());
    }
    let programs = std::env::current_exe()?.parent().context("no folder of programs")?.to_owned();
    let place = Place {
        programs,
        settings: arguments.settings.clone(),
        start_rad: start.iter().map(ToString::to_string).collect::<Vec<_>>().join(","),
        output: arguments.output.clone(),
    };
    Ok((place, Goals(goals)))
}
