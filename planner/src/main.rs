//! `taustream-planner`: answers replan requests for one arm.
use anyhow::{Context, Result};
use clap::Parser;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::Write;
use std::mem::ManuallyDrop;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;
use taustream_arm::daemon::Manager;
use taustream_arm::log::start_log;
use taustream_arm::{Faults, Kind, Scene, Settings, find};
use taustream_messages::files::{ArmFiles, Claim};
use taustream_messages::service::Wire;
use taustream_planner::arguments::Arguments;
use taustream_planner::service::{Ending, OpenError, Service};

/// How long to wait before services are opened again.
const AGAIN_AFTER: Duration = Duration::from_millis(300);
/// How often services that cannot be opened are tried again.
const FAILURES_MAX: u32 = 3;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let _log = start_log();
    let settings = match load(&arguments) {
        Ok(settings) => settings,
        Err(faults) => {
            tracing::error!("{faults}");
            return ExitCode::from(2);
        }
    };
    match run(&settings, arguments.keep_scene.as_deref()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            tracing::error!("{e:#}");
            ExitCode::FAILURE
        }
    }
}

fn load(arguments: &Arguments) -> Result<Settings, Faults> {
    let mut settings = Settings::load(&find(Kind::Settings, &arguments.settings)?)?;
    if let Some(scene) = &arguments.scene {
        settings.scene = Scene::load(&find(Kind::Scene, scene)?)?;
    }
    Ok(settings)
}

fn run(settings: &Settings, keep_scene: Option<&Path>) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).context("cannot take signals")?;
    }
    let runtime = taustream_arm::runtime::directory()?;
    let files = ArmFiles::of(&settings.name, &runtime);
    let claim = files.claim("planner")?;
    let mut said_ready = false;
    let mut failures = 0;
    while !stop.load(Ordering::Relaxed) {
        match serve((settings, keep_scene), &runtime, &stop, &claim, &mut said_ready) {
            Ok(Ending::Stopped) => break,
            Ok(Ending::NamesGone) => failures = 0,
            Err(e) => {
                failures += 1;
                let gone_on = failures > FAILURES_MAX || e.is_for_people();
                if gone_on {
                    return Err(e.into());
                }
                tracing::warn!("{e}; clearing what is left of arm `{}` and trying again", settings.name);
                files.clear();
            }
        }
        // A streamer that lives opens its own services again meanwhile.
        thread::sleep(AGAIN_AFTER);
        let _said_by_join = taustream_arm::runtime::directory();
    }
    claim.started();
    Manager::stopping();
    Ok(())
}

/// Serves until the end, or until the files behind its services vanish.
fn serve(
    (settings, keep_scene): (&Settings, Option<&Path>),
    runtime: &Path,
    stop: &Arc<AtomicBool>,
    claim: &Claim,
    said_ready: &mut bool,
) -> Result<Ending, OpenError> {
    let opening = claim.files().opening()?;
    let wire = Wire::join(&settings.name, "taustream-planner", runtime)?;
    let mut service = Service::open(&wire, &settings.robot, &settings.scene, stop)?;
    drop(opening);
    service.mind_neighbours(&settings.name, &settings.neighbours, runtime)?;
    if let Some(path) = keep_scene {
        service.keep_scene(path)?;
    }
    // A planner that is killed from now on leaves nothing that the next one would have to clear under a living streamer.
    claim.started();
    if !*said_ready {
        *said_ready = true;
        let (name, robot, obstacles) = (&settings.name, &settings.robot.name, settings.scene.obstacles.len());
        let mut out = std::io::stdout();
        // Whoever started this may have closed its output; the arm is planned for all the same.
        let _nobody_reads =
            writeln!(out, "taustream-planner ready: arm {name}, {robot}, {obstacles} obstacles")
                .and_then(|()| out.flush());
    }
    let ending = service.serve();
    if ending == Ending::NamesGone {
        // Closed in earnest, they would delete files of the same names that somebody else has made meanwhile.
        let _kept = ManuallyDrop::new(service);
        let _kept = ManuallyDrop::new(wire);
    }
    Ok(ending)
}
