//! Runs every scenario on a real vcan0 and checks every recording. Meant to run inside the test machine.
use anyhow::{Result, anyhow, ensure};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use taustream_arm::{Cia402, Settings};
use taustream_tests::demo_file::{DemoFile, programs_beside};
use taustream_tests::retry::{Failed, passes};
use taustream_tests::scenarios::{self, CheckMode, Goals, Scenario};
use taustream_tests::setpoints::{BusFrame, CheckResult, Encoding, Losses, check_setpoints_with};
use taustream_tests::test_bench::{CYCLE_LOG, Place, RECORDING, TestBench};
use taustream_tests::traffic::as_plain;
use taustream_tests::{
    bus_scenarios, candump, cut_scenarios, cycle_log, disturbed_scenarios, homing_scenarios,
    restart_scenarios, stream_scenarios,
};

/// Runs the scenarios over the real processes on a real vcan0.
#[derive(Parser, Debug)]
struct Arguments {
    /// Demo file: settings, start pose and goals.
    #[arg(long, default_value = "config/demo.toml")]
    demo: PathBuf,
    /// Settings file instead of the demo's.
    #[arg(long)]
    settings: Option<PathBuf>,
    /// Folder of the built programs; default: where this program is.
    #[arg(long)]
    programs: Option<PathBuf>,
    /// Folder for logs and recordings.
    #[arg(long, default_value = "target/scenarios")]
    output: PathBuf,
    /// Only scenarios whose name contains this.
    #[arg(long, default_value = "")]
    only: String,
    /// Folder of a scenario that has run: checks its recording again, and runs none. Needs no bus, and takes as much memory as
    /// a long recording asks for, which a test machine may not have.
    #[arg(long, value_name = "DIR")]
    recorded: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("scenarios: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<usize> {
    let (place, goals) = read_demo(arguments)?;
    let settings = Settings::load(&place.settings)?;
    if let Some(folder) = &arguments.recorded {
        let recording = std::fs::read_to_string(folder.join(RECORDING))?;
        println!("{}", check_all(&settings, &recording, &folder.join(CYCLE_LOG), Losses::None)?);
        return Ok(0);
    }
    for bus in &settings.buses {
        let interface = PathBuf::from("/sys/class/net").join(&bus.interface);
        ensure!(interface.exists(), "{} does not exist: run this inside the test machine", bus.interface);
    }
    let all = scenarios::ALL
        .iter()
        .chain(cut_scenarios::ALL)
        .chain(disturbed_scenarios::ALL)
        .chain(stream_scenarios::ALL)
        .chain(homing_scenarios::ALL)
        .chain(bus_scenarios::ALL);
    let chosen: Vec<&Scenario> = all.filter(|s| s.name.contains(&arguments.only)).collect();
    // Written for one bus; where the settings have more, the other settings' run has them.
    let restarts = if settings.buses.len() == 1 { restart_scenarios::ALL } else { &[] };
    let restarts: Vec<_> = restarts.iter().filter(|r| r.name.contains(&arguments.only)).collect();
    ensure!(!(chosen.is_empty() && restarts.is_empty()), "no scenario is called `{}`", arguments.only);
    let mut passed = 0;
    for scenario in &chosen {
        passed += usize::from(passes(scenario.name, |attempt| perform(scenario, &place, &goals, attempt)));
    }
    for restart in &restarts {
        passed += usize::from(passes(restart.name, |attempt| {
            restart_scenarios::perform(restart, &place, &goals, attempt)
        }));
    }
    let failed = chosen.len() + restarts.len() - passed;
    println!("{passed} passed, {failed} failed");
    Ok(failed)
}

fn perform(scenario: &Scenario, place: &Place, goals: &Goals, attempt: usize) -> Result<String, Failed> {
    let other = scenario.settings.map(|file| place.settings.with_file_name(file));
    let place = Place { settings: other.unwrap_or_else(|| place.settings.clone()), ..place.clone() };
    let mut bench = TestBench::open(&place, &format!("{}-{attempt}", scenario.name))?;
    let settings = bench.settings.clone();
    if let Err(error) = (scenario.run)(&mut bench, goals) {
        let failed = bench.failed(error);
        drop(bench);
        bus_scenarios::restore_interfaces();
        return Err(failed);
    }
    let (recording, log) = bench.close()?;
    let losses = match scenario.check_mode {
        CheckMode::Exactly => Losses::None,
        CheckMode::WithLosses => Losses::AsLogged,
    };
    let check_result = check_all(&settings, &recording, &log, losses)?;
    if check_result.on_trajectory == 0 {
        return Err(anyhow!("nothing was compared with a trajectory: it would pass every comparison").into());
    }
    Ok(check_result.to_string())
}

/// Checks every bus of a recording.
fn check_all(settings: &Settings, recording: &str, log: &Path, losses: Losses) -> Result<CheckResult> {
    let log = cycle_log::read(log)?;
    let mut check_result = CheckResult::default();
    for (index, bus) in settings.buses.iter().enumerate() {
        let encodings = encodings(settings, index);
        let frames = as_plain(frames(recording, &bus.interface)?, &log, index, &encodings, bus.traffic)?;
        check_result.add(check_setpoints_with(losses, (&frames, &log), index, &encodings)?);
    }
    Ok(check_result)
}

/// What was seen on one interface.
fn frames(recording: &str, interface: &str) -> Result<Vec<BusFrame>> {
    let seen = |record: candump::Record| BusFrame {
        id: record.frame.id().raw(),
        data: record.frame.data().to_vec(),
    };
    let records = candump::parse(recording)?.into_iter();
    Ok(records.filter(|record| record.interface == interface).map(seen).collect())
}

/// The servos of one bus.
fn encodings(settings: &Settings, bus: usize) -> Vec<Encoding> {
    let encoding = |servo: &taustream_arm::Servo| {
        let cia402 = servo.protocol.get::<Cia402>()?;
        Some(Encoding {
            joint: servo.joint,
            node_id: servo.node_id,
            counts_per_rad: servo.sign * cia402.gear_ratio * cia402.counts_per_rev / std::f64::consts::TAU,
            zero_rad: servo.zero_offset_rad,
        })
    };
    settings.servos.iter().filter(|servo| servo.bus == bus).filter_map(encoding).collect()
}

fn read_demo(arguments: &Arguments) -> Result<(Place, Goals)> {
    let demo = DemoFile::read(&arguments.demo)?;
    let programs = arguments.programs.clone().map_or_else(programs_beside, Ok)?;
    let place = Place {
        programs,
        settings: arguments.settings.clone().unwrap_or(demo.settings),
        start_rad: demo.start_rad,
        output: arguments.output.clone(),
    };
    Ok((place, demo.goals))
}
