//! `taustream-streamer`: drives one arm.
use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;
use std::sync::mpsc::channel;
use std::thread;
use taustream_arm::daemon::Manager;
use taustream_arm::log::start_log;
use taustream_arm::state_dir::SystemDisk;
use taustream_arm::{Kind, Settings, drive_epochs, find, last_pose};
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::protocols;
use taustream_streamer::arguments::Arguments;
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, Next};
use taustream_streamer::intake::{self, Shutdown, ShutdownHandle};
use taustream_streamer::names::Names;
use taustream_streamer::pose_store::{self, PoseRecords, PoseStore};
use taustream_streamer::recorder::Recorder;
use taustream_streamer::threads::Threads;
use taustream_streamer::{report, rt, write_ahead};
use tracing::warn;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let _log = start_log();
    let settings = match find(Kind::Settings, &arguments.settings).and_then(|file| Settings::load(&file)) {
        Ok(settings) => settings,
        Err(faults) => {
            tracing::error!("settings:\n{faults}");
            return ExitCode::from(2);
        }
    };
    match run(&arguments, &settings) {
        Ok(Next::Ended) => ExitCode::SUCCESS,
        Ok(_) => {
            tracing::error!("ended before the drives were seen to be de-energised");
            ExitCode::FAILURE
        }
        Err(e) => {
            tracing::error!("{e:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments, settings: &Settings) -> Result<Next> {
    let runtime = taustream_arm::runtime::directory()?;
    let buses = open_buses(settings, arguments.link, &runtime)?;
    let described = buses.describe();
    let names = Names::of(settings).with_local(buses.local().iter().copied());
    let (queues, command_queue) = intake::pair();
    let shutdown_handle = command_queue.shutdown_handle();
    let recording = arguments.cycle_log.is_some();
    let (reports, mut readers) = report::queues(recording);
    let mut core = Core::new(settings, buses, queues, reports);
    let pose_store = keep_pose(arguments, settings, &runtime, &mut core)?;

    lock_memory(arguments.allow_non_realtime)?;
    let (candidates, logged) = channel();
    let recorder = match arguments.cycle_log.as_ref().zip(readers.records.take()) {
        None => None,
        Some((path, records)) => {
            let started = Recorder::start(path, settings, records, logged);
            Some(started.with_context(|| format!("cycle log {}", path.display()))?)
        }
    };
    let candidates = recording.then_some(candidates);
    let threads =
        Threads::start(settings, names, &runtime, (command_queue, readers), (pose_store, candidates))?;
    forward_signals(shutdown_handle)?;

    let outcome = run_real_time(core, settings, arguments.allow_non_realtime, &described);
    threads.finish();
    if let Some((Err(e), path)) = recorder.map(Recorder::finish).zip(arguments.cycle_log.as_ref()) {
        tracing::error!("cycle log {}: {e}", path.display());
    }
    outcome
}

/// Takes the last pose from disk, and starts the thread that keeps it.
fn keep_pose(
    arguments: &Arguments,
    settings: &Settings,
    runtime: &Path,
    core: &mut Core,
) -> Result<PoseStore> {
    let mut local = true;
    for bus in &settings.buses {
        local &= link::is_local(bus, arguments.link)?;
    }
    let state = last_pose::directory(arguments.state_dir.as_deref());
    let directories = pose_store::directories(state, local.then_some(runtime))?;
    let (requester, recorder) = write_ahead::pair();
    let disk = SystemDisk { services_user: drive_epochs::services_user() };
    let mut store = PoseRecords::new(settings, directories, Box::new(disk), recorder);
    core.restore_poses(&store.restore_poses());
    core.record_first(requester);
    PoseStore::start(store).context("cannot start the thread that keeps the last pose")
}

fn open_buses(settings: &Settings, choice: LinkChoice, runtime: &Path) -> Result<Buses> {
    let mut buses = Vec::new();
    for (index, bus) in settings.buses.iter().enumerate() {
        let link = link::open(bus, choice, LinkRole::Master, runtime)?;
        let driver = protocols::of_bus(settings, index)?;
        buses.push(Bus::new(link, Box::new(driver), settings));
    }
    Ok(Buses::new(buses)?)
}

fn lock_memory(allowed_without: bool) -> Result<()> {
    match rt::lock_memory() {
        Ok(()) => Ok(()),
        Err(e) if allowed_without => {
            warn!("going on without locked memory: {e}");
            Ok(())
        }
        Err(e) => Err(e.into()),
    }
}

fn forward_signals(shutdown_handle: ShutdownHandle) -> Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    let work = move || {
        for (count, _) in signals.forever().enumerate() {
            shutdown_handle.request(if count == 0 { Shutdown::Orderly } else { Shutdown::AtOnce });
            Manager::stopping();
        }
    };
    thread::Builder::new().name("signals".into()).stack_size(256 << 10).spawn(work)?;
    Ok(())
}

fn run_real_time(
    mut core: Core,
    settings: &Settings,
    allowed_without: bool,
    described: &str,
) -> Result<Next> {
    let cycle = settings.cycle;
    let (entered, result) = channel();
    let (go, may_go) = channel::<()>();
    let work = move || {
        let _ = entered.send(rt::enter(cycle.priority, cycle.cpu));
        // Without a word from `main` the rights were missing, and nothing runs.
        may_go.recv().ok().map(|()| rt::run(&mut core, cycle.period_us))
    };
    let thread = thread::Builder::new().name("cycle".into()).stack_size(2 << 20).spawn(work)?;
    if let Err(missing) = result.recv().context("the real-time thread has ended")? {
        for error in &missing {
            warn!("{error}");
        }
        if !allowed_without {
            let list: Vec<String> = missing.iter().map(ToString::to_string).collect();
            bail!("not started: {}", list.join("; "));
        }
        warn!("running without real-time rights (--allow-non-realtime): setpoints will be late");
    } else if let Some(warning) = rt::throttling_warning() {
        warn!("{warning}");
    }
    let (joints, period_us) = (settings.robot.joints.len(), cycle.period_us);
    let name = &settings.name;
    writeln!(
        std::io::stdout(),
        "taustream-streamer ready: arm {name}, {joints} joints, {described}, {period_us} us"
    )?;
    std::io::stdout().flush()?;
    go.send(()).context("the real-time thread has ended")?;
    #[expect(clippy::disallowed_methods, reason = "the process lives as long as the cycle runs, which waits for no disk")]
    let next = thread.join().map_err(|_| {
        anyhow!("the real-time thread has panicked; the drives react by their own watchdogs, and the arm is in their hands")
    })?;
    next.context("the real-time thread was not started")
}
