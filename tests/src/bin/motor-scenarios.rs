//! Runs the scenarios of motors of any protocol but CiA 402 on a real vcan0 and checks their recordings. Meant to run inside the test machine.
use anyhow::{Context, Result, anyhow, ensure};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use taustream_arm::{Bus, Damiao, Servo, Settings};
use taustream_tests::demo_file::{DemoFile, programs_beside};
use taustream_tests::mit_setpoints::{self, LogEnds, check_setpoints};
use taustream_tests::motor_commands;
use taustream_tests::motor_scenarios::{ALL, Scenario};
use taustream_tests::retry::{Failed, passes};
use taustream_tests::scenarios::Goals;
use taustream_tests::setpoints::BusFrame;
use taustream_tests::test_bench::{Place, TestBench};
use taustream_tests::{candump, cycle_log};

/// Runs the scenarios of motors over the real processes on a real vcan0.
#[derive(Parser, Debug)]
struct Arguments {
    /// Settings of an arm of motors on one bus.
    #[arg(long, default_value = "config/settings/damiao6.toml")]
    settings: PathBuf,
    /// Puts the arm on a bus of CAN FD, 1 and 5 Mbit/s, which the simulator models.
    #[arg(long)]
    fd: bool,
    /// Demo file: start pose and goals.
    #[arg(long, default_value = "config/demo.toml")]
    demo: PathBuf,
    /// Folder for logs and recordings.
    #[arg(long, default_value = "target/motor-scenarios")]
    output: PathBuf,
    /// Only scenarios whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("motor-scenarios: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<usize> {
    let (place, goals) = read(arguments)?;
    let settings = Settings::load(&place.settings)?;
    let fits = |s: &&Scenario| s.name.contains(&arguments.only) && (s.fits)(&settings);
    let chosen: Vec<&Scenario> = ALL.iter().filter(fits).collect();
    ensure!(!chosen.is_empty(), "no scenario is called `{}`", arguments.only);
    let mut passed = 0;
    for scenario in &chosen {
        passed += usize::from(passes(scenario.name, |attempt| perform(scenario, &place, &goals, attempt)));
    }
    let failed = chosen.len() - passed;
    println!("{passed} passed, {failed} failed");
    Ok(failed)
}

fn perform(scenario: &Scenario, place: &Place, goals: &Goals, attempt: usize) -> Result<String, Failed> {
    let mut bench = TestBench::open(place, &format!("{}-{attempt}", scenario.name))?;
    let settings = bench.settings.clone();
    let period_s = f64::from(bench.settings.cycle.period_us) * 1e-6;
    if let Err(error) = (scenario.run)(&mut bench, goals) {
        return Err(bench.failed(error));
    }
    let (recording, log) = bench.close_whatever_became_of_the_streamer()?;
    let records = candump::parse(&recording)?;
    let mut text = std::fs::read_to_string(&log).with_context(|| format!("cannot read {}", log.display()))?;
    if scenario.kills {
        // The last line may be half a line, and the last cycles none.
        text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
    }
    let ends = if scenario.kills { LogEnds::Early } else { LogEnds::WithTheStreamer };
    let log = cycle_log::parse(&text)?;
    let mut checked = Vec::new();
    for (bus, described) in settings.buses.iter().enumerate() {
        let frames = frames_of(described, &records)?;
        let of_bus = |servo: &&Servo| servo.bus == bus;
        // Damiao motors have a checker that compares gains and velocities too.
        let are_damiao = settings.servos.iter().all(|servo| servo.protocol.get::<Damiao>().is_some());
        let alone =
            Settings { servos: settings.servos.iter().filter(of_bus).cloned().collect(), ..settings.clone() };
        let result = match mit_setpoints::encodings(&alone).filter(|_| are_damiao) {
            Some(motors) => check_setpoints((&frames, &log), bus, (&motors, period_s), ends)?,
            None => motor_commands::check(&frames, &log, &alone, ends)?,
        };
        // A recording without motion would pass every comparison.
        if result.on_trajectory == 0 || result.setpoints == 0 {
            return Err(anyhow!("nothing was compared with a trajectory").into());
        }
        checked.push(result.to_string());
    }
    Ok(checked.join("; "))
}

/// The frames of a bus, all of which are of its kind.
fn frames_of(bus: &Bus, records: &[candump::Record]) -> Result<Vec<BusFrame>> {
    let is_fd = bus.kind.data_bitrate_bit_s().is_some();
    let records: Vec<_> = records.iter().filter(|record| record.interface == bus.interface).collect();
    if let Some(other) = records.iter().find(|record| record.frame.is_fd() != is_fd) {
        let (got, bus) = if is_fd { ("classic", "CAN FD") } else { ("CAN FD", "classic") };
        return Err(anyhow!("a {got} frame on a {bus} bus: {:?}", other.frame));
    }
    let frame = |record: &&candump::Record| BusFrame {
        id: record.frame.id().raw(),
        data: record.frame.data().to_vec(),
    };
    Ok(records.iter().map(frame).collect())
}

fn read(arguments: &Arguments) -> Result<(Place, Goals)> {
    let demo = DemoFile::read(&arguments.demo)?;
    let settings = if arguments.fd { on_fd(&arguments.settings)? } else { arguments.settings.clone() };
    let place = Place {
        programs: programs_beside()?,
        settings,
        start_rad: demo.start_rad,
        output: arguments.output.clone(),
    };
    Ok((place, demo.goals))
}

/// The same settings with another bus, beside them, where their robot and scene are found.
fn on_fd(settings: &Path) -> Result<PathBuf> {
    let text = std::fs::read_to_string(settings)?;
    let bus = "bitrate_bit_s = 1000000\ndata_bitrate_bit_s = 5000000";
    let on_fd = text.replace("virtual = true", bus);
    ensure!(on_fd != text, "{} has no virtual bus to replace", settings.display());
    let file = settings.with_file_name("motors-fd.toml");
    std::fs::write(&file, on_fd)?;
    Ok(file)
}
