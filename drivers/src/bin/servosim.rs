//! `taustream-servosim`: the servos of an arm, simulated behind a real CAN link.
#![deny(unsafe_code)]

use anyhow::Context;
use clap::Parser;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use taustream_arm::{Kind, Settings, runtime};
use taustream_drivers::link::{CanLink, LinkChoice, LinkRole};
use taustream_drivers::sim::serve::{StandardInput, serve};
use taustream_drivers::sim::settings::drives;
use taustream_drivers::sim::{FaultOrder, Rig, priority};
use taustream_drivers::{Nanos, link};

/// What the manual says beyond the list of options.
const MANUAL: &str = "\
Each servo of the settings file becomes one CiA 402 drive (CANopen, cyclic synchronous position) with its own object
dictionary, motor, gravity load and watchdog. Dynamics and watchdog are set in the file's optional [simulator] section.

A fault is  joint=NAME|NUMBER,kind=KIND[,value=V][,after=start|enable|moving][,at_s=T][,for_s=T]
  silence   the drive neither sends nor hears            delay    its frames come V ms late (5)
  drop      each of its frames is lost with chance V     fault    it reports EMCY code V (0x2310)
  stuck     the joint is jammed                          jump     its encoder reads V rad too far (0.2)
  warning   it sets the warning bit                      refuse   it refuses SDO writes with abort code V
  restart   its supply dips and it boots again
Lines on the standard input do the same while it runs:  fault SPEC | clear | clear joint=NAME | status

Examples:
  taustream-servosim --settings vcan6 --start-rad \"0,-1.57,1.57,-1.57,-1.57,0\"
  taustream-servosim --settings vcan6 --link local --fault joint=elbow,kind=silence,after=moving,at_s=0.5

It is no model of a safety function: real arms need their own emergency stop.

Exit status: 0 ended by SIGINT or SIGTERM, 1 the link failed, 2 bad usage or bad file.";

/// Simulated servos on the buses of a settings file: they move, fall, warn and fail as real ones do, and break nothing.
#[derive(Debug, Parser)]
#[command(name = "taustream-servosim", version, after_help = MANUAL)]
struct Args {
    /// Settings file, or the name of one in the configuration directories.
    #[arg(long, value_name = "FILE")]
    settings: String,
    /// What carries the frames.
    #[arg(long, value_enum, default_value_t)]
    link: LinkChoice,
    /// Joint angles at power-up, base to tip: "q1,q2,..".
    #[arg(long, value_name = "Q1,Q2,..", allow_hyphen_values = true)]
    start_rad: Option<String>,
    /// A fault; may be given several times (see below).
    #[arg(long = "fault", value_name = "SPEC")]
    faults: Vec<String>,
    /// Decides which frames a lossy wire loses.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn main() -> ExitCode {
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_env_filter(
            tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into()),
        )
        .init();
    let args = Args::parse();
    let rig = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => return fail(&error, 2),
    };
    match run(&args, rig) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error, 1),
    }
}

fn fail(error: &anyhow::Error, code: u8) -> ExitCode {
    let _nobody_listens = writeln!(std::io::stderr(), "taustream-servosim: {error:#}");
    ExitCode::from(code)
}

/// Everything that can be wrong with arguments and files.
fn prepare(args: &Args) -> anyhow::Result<(Settings, Rig)> {
    let settings = Settings::load(&taustream_arm::find(Kind::Settings, &args.settings)?)?;
    let start_rad = args.start_rad.as_deref().map(|text| angles(text, &settings)).transpose()?;
    let setups = drives(&settings, start_rad.as_deref())?;
    let mut rig = Rig::new(setups, settings.buses.len(), args.seed);
    let joints = rig.joints();
    for text in &args.faults {
        let order = FaultOrder::parse(text, &joints).with_context(|| format!("--fault {text}"))?;
        rig.order(Nanos(0), order);
    }
    Ok((settings, rig))
}

/// Angles of all joints, inside their ranges.
fn angles(text: &str, settings: &Settings) -> anyhow::Result<Vec<f64>> {
    let joints = &settings.robot.joints;
    let pieces: Vec<&str> = text.split(',').collect();
    anyhow::ensure!(
        pieces.len() == joints.len(),
        "--start-rad has {} angles; {} has {} joints",
        pieces.len(),
        settings.robot.name,
        joints.len()
    );
    let mut angles_rad = Vec::with_capacity(pieces.len());
    for (piece, joint) in pieces.iter().zip(joints) {
        let [low_rad, high_rad] = joint.limits.position_rad;
        let angle_rad =
            piece.trim().parse::<f64>().ok().filter(|angle_rad| (low_rad..=high_rad).contains(angle_rad));
        angles_rad.push(angle_rad.with_context(|| {
            format!("--start-rad: {piece:?} for {}: expected {low_rad} to {high_rad} rad", joint.name)
        })?);
    }
    Ok(angles_rad)
}

/// Opens the links and serves until told to stop.
fn run(args: &Args, (settings, rig): (Settings, Rig)) -> anyhow::Result<()> {
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
    let served = serve(links, rig, Some(&mut StandardInput::default()), &stop)?;
    tracing::info!("heard {} frames, sent {}, lost {}", served.heard, served.sent, served.lost);
    Ok(())
}
