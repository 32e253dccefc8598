//! `taustream-streamer`: drives one arm.
use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread;
use taustream_arm::daemon::{self, Manager};
use taustream_arm::{Kind, Settings, find, last_pose};
use taustream_drivers::drivers;
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_streamer::arguments::Arguments;
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, Next};
use taustream_streamer::intake::{self, CommandQueue, Shutdown, ShutdownHandle};
use taustream_streamer::pose_store::{self, PoseStore};
use taustream_streamer::recorder::{Candidate, Recorder};
use taustream_streamer::report::Readers;
use taustream_streamer::rt;
use taustream_streamer::service::Service;
use tracing::warn;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    daemon::start_log();
    let settings = match find(Kind::Settings, &arguments.settings).and_then(|file| Settings::load(&file)) {
        Ok(settings) => settings,
        Err(faults) => {
            tracing::error!("settings:\n{faults}");
            return ExitCode::from(2);
        }
    };
    match run(&arguments, settings) {
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

fn run(arguments: &Arguments, settings: Settings) -> Result<Next> {
    let buses = open_buses(&settings, arguments.link)?;
    let described = buses.describe();
    let (queues, command_queue) = intake::pair();
    let shutdown_handle = command_queue.shutdown_handle();
    let recording = arguments.cycle_log.is_some();
    let mut core = Core::new(&settings, buses, queues, recording);
    let state = last_pose::directory(arguments.state_dir.as_deref());
    core.restore_poses(&pose_store::restore_poses(&settings, &state));
    let pose_store =
        PoseStore::start(&settings, state).context("cannot start the thread that stores the last pose")?;
    let readers = core.readers();

    lock_memory(arguments.allow_non_realtime)?;
    let (candidates, logged) = channel();
    let recorder = match &arguments.cycle_log {
        None => None,
        Some(path) => {
            let started = Recorder::start(path, &settings, Arc::clone(&readers.records), logged);
            Some(started.with_context(|| format!("cycle log {}", path.display()))?)
        }
    };
    let settings = Arc::new(settings);
    let stop = Arc::new(AtomicBool::new(false));
    let candidates = recording.then_some(candidates);
    let service =
        start_service(&settings, (command_queue, readers), candidates, pose_store, Arc::clone(&stop))?;
    forward_signals(shutdown_handle)?;

    let outcome = run_real_time(core, &settings, arguments.allow_non_realtime, &described);
    stop.store(true, Ordering::Release);
    if service.join().is_err() {
        tracing::error!("the service thread has panicked");
    }
    if let Some(Err(e)) = recorder.map(Recorder::finish) {
        tracing::error!("cycle log: {e}");
    }
    outcome
}

fn open_buses(settings: &Settings, choice: LinkChoice) -> Result<Buses> {
    let runtime = taustream_arm::runtime::directory()?;
    let mut buses = Vec::new();
    for (index, bus) in settings.buses.iter().enumerate() {
        let link = link::open(bus, choice, LinkRole::Master, &runtime)?;
        let driver = drivers::of_bus(settings, index)?;
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

fn start_service(
    settings: &Arc<Settings>,
    (command_queue, readers): (CommandQueue, Readers),
    candidates: Option<Sender<Candidate>>,
    pose_store: PoseStore,
    stop: Arc<AtomicBool>,
) -> Result<thread::JoinHandle<()>> {
    let (opened, result) = channel();
    let settings = Arc::clone(settings);
    let work = move || match Service::open(&settings, command_queue, readers, candidates) {
        Ok(service) => {
            let _ = opened.send(Ok(()));
            service.keeping(pose_store).serve(&stop);
        }
        Err(e) => {
            let _ = opened.send(Err(e));
        }
    };
    let thread = thread::Builder::new().name("service".into()).stack_size(2 << 20).spawn(work)?;
    result.recv().context("the service thread has ended")??;
    Ok(thread)
}

fn forward_signals(shutdown_handle: ShutdownHandle) -> Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM])?;
    let work = move || {
        for (count, _) in signals.forever().enumerate() {
            Manager::stopping();
            shutdown_handle.request(if count == 0 { Shutdown::Orderly } else { Shutdown::AtOnce });
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
    let next = thread.join().map_err(|_| {
        anyhow!("the real-time thread has panicked; the drives react by their own watchdogs, and the arm is in their hands")
    })?;
    next.context("the real-time thread was not started")
}
