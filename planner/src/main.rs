//! `taustream-planner`: answers replan requests for one arm.
use anyhow::{Context, Result};
use clap::Parser;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use taustream_arm::daemon::{self, Manager};
use taustream_arm::{Faults, Kind, Scene, Settings, find};
use taustream_messages::service::Wire;
use taustream_planner::arguments::Arguments;
use taustream_planner::service::Service;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    daemon::start_log();
    let settings = match load(&arguments) {
        Ok(settings) => settings,
        Err(faults) => {
            tracing::error!("{faults}");
            return ExitCode::from(2);
        }
    };
    match run(&settings) {
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

fn run(settings: &Settings) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).context("cannot take signals")?;
    }
    let wire = Wire::join(&settings.name, "taustream-planner", &taustream_arm::runtime::directory()?)?;
    let mut service = Service::open(&wire, &settings.robot, &settings.scene, &stop)?;
    let (name, robot, obstacles) = (&settings.name, &settings.robot.name, settings.scene.obstacles.len());
    writeln!(std::io::stdout(), "taustream-planner ready: arm {name}, {robot}, {obstacles} obstacles")?;
    std::io::stdout().flush()?;
    service.serve();
    Manager::stopping();
    Ok(())
}
