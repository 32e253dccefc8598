//! `taustream-servosim`: the servos of an arm, simulated behind a real CAN link.
#![deny(unsafe_code)]

use anyhow::Context;
use clap::Parser;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use taustream_arm::daemon::Manager;
use taustream_arm::log::start_log;
use taustream_arm::{Kind, Settings, runtime};
use taustream_drivers::link::{CanLink, LinkRole};
use taustream_drivers::sim::arguments::Arguments;
use taustream_drivers::sim::serve::{StandardInput, serve};
use taustream_drivers::sim::settings::{drives, masses, queue_frames};
use taustream_drivers::sim::{FaultRequest, LinkedSimulator, ServoSimulator, planted, priority};
use taustream_drivers::{Nanos, link};

fn main() -> ExitCode {
    let _log = start_log();
    let args = Arguments::parse();
    let simulator = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => return fail(&error, 2),
    };
    match run(&args, simulator) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error, 1),
    }
}

fn fail(error: &anyhow::Error, code: u8) -> ExitCode {
    let _nobody_listens = writeln!(std::io::stderr(), "taustream-servosim: {error:#}");
    ExitCode::from(code)
}

/// Everything that can be wrong with arguments and files.
fn prepare(args: &Arguments) -> anyhow::Result<(Settings, LinkedSimulator)> {
    let settings = Settings::load(&taustream_arm::find(Kind::Settings, &args.settings)?)?;
    let start_rad = args.start_rad.as_deref().map(|text| angles(text, &settings)).transpose()?;
    let mut setups = drives(&settings, start_rad.as_deref())?;
    for text in &args.objects {
        planted::plant(text, &mut setups).with_context(|| format!("--object {text}"))?;
    }
    let mut simulator = ServoSimulator::new(setups, settings.buses.len(), args.seed);
    if let Some(masses) = masses(&settings)? {
        simulator = simulator.with_masses(masses)?;
    }
    let joints = simulator.joints();
    for text in &args.faults {
        let order = FaultRequest::parse(text, &joints).with_context(|| format!("--fault {text}"))?;
        simulator.request(Nanos(0), order);
    }
    let simulator = LinkedSimulator::new(simulator, &settings.buses, queue_frames(&settings)?);
    Ok((settings, simulator))
}

/// Angles of all joints, inside their ranges.
fn angles(text: &str, settings: &Settings) -> anyhow::Result<Vec<f64>> {
    let joints: Vec<_> = settings.all_slots().collect();
    let pieces: Vec<&str> = text.split(',').collect();
    // Axes behind the joints may be left out: they start where the section says.
    anyhow::ensure!(
        [settings.robot.joints.len(), joints.len()].contains(&pieces.len()),
        "--start-rad has {} angles; {} has {} joints and {} axes",
        pieces.len(),
        settings.robot.name,
        settings.robot.joints.len(),
        settings.axes.len()
    );
    let mut angles_rad = Vec::with_capacity(pieces.len());
    for (piece, joint) in pieces.iter().zip(&joints) {
        let [low_rad, high_rad] = joint.limits.position_rad;
        let angle_rad =
            piece.trim().parse::<f64>().ok().filter(|angle_rad| (low_rad..=high_rad).contains(angle_rad));
        angles_rad.push(angle_rad.with_context(|| {
            format!("--start-rad: {piece:?} for {}: expected {low_rad} to {high_rad} rad", joint.name)
        })?);
    }
    Ok(angles_rad)
}

/// Opens the links and serves until stopped.
fn run(args: &Arguments, (settings, simulator): (Settings, LinkedSimulator)) -> anyhow::Result<()> {
    let runtime = runtime::directory()?;
    let mut links: Vec<Box<dyn CanLink>> = Vec::with_capacity(settings.buses.len());
    for bus in &settings.buses {
        links.push(link::open(bus, args.link, LinkRole::Servos, &runtime)?);
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    if let Err(error) = priority::raise() {
        tracing::info!("running without SCHED_FIFO ({error}): on a busy computer the drives may answer late");
    }
    let on: Vec<String> = links.iter().map(|link| link.describe()).collect();
    let mut stdout = std::io::stdout();
    writeln!(stdout, "taustream-servosim ready: {} drives on {}", settings.servos.len(), on.join(", "))?;
    stdout.flush()?;
    Manager::from_environment().progress();
    let served = serve(links, simulator, Some(&mut StandardInput::default()), &stop)?;
    tracing::info!("received {} frames, sent {}, lost {}", served.received, served.sent, served.lost);
    Ok(())
}
