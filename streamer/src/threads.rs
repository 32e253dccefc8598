//! The threads beside the cycle and the cycle log: started together, ended together.
use crate::commands::CommandThread;
use crate::ending::{NotEnded, THREADS_WITHIN, join_within};
use crate::intake::CommandQueue;
use crate::log::{self, CommandLog};
use crate::names::Names;
use crate::ports::{PortError, PortWatch};
use crate::pose_store::PoseStore;
use crate::publisher::{Publisher, Surroundings};
use crate::recorder::Candidate;
use crate::report::Readers;
use crate::stop_socket::{StopThread, bind_file};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};
use taustream_arm::Settings;
use taustream_arm::daemon::Manager;
use tracing::{error, warn};

/// Why the streamer cannot serve.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Shared memory refuses.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A thread or a histogram is not to be had.
    #[error("cannot start a thread: {0}")]
    System(#[from] io::Error),
}

/// The threads.
#[derive(Debug)]
pub struct Threads {
    stop: Arc<AtomicBool>,
    all: Vec<JoinHandle<()>>,
    /// Ends first: it would take the closing of the others' ports for a loss.
    watch: Option<JoinHandle<()>>,
    watch_stop: Arc<AtomicBool>,
}

impl Threads {
    /// Starts all of them, and opens the arm's ports.
    ///
    /// # Errors
    /// When shared memory refuses, for instance because a streamer serves this arm already.
    pub fn start(
        settings: &Settings,
        names: Names,
        runtime: &Path,
        (command_queue, readers): (CommandQueue, Readers),
        (pose_store, candidates): (PoseStore, Option<Sender<Candidate>>),
    ) -> Result<Self, StartError> {
        let names = Names { directories: pose_store.directories().clone(), ..names };
        let (command_events, command_reader) = log::events();
        let (socket_events, socket_reader) = log::events();
        let command_log = CommandLog::new(vec![command_reader, socket_reader], names.clone());
        let (obstacles, obstacles_in) = channel();
        let (files, files_in) = channel();
        let rounds = Arc::new(AtomicU64::new(0));
        let (pulse, arm) = (Arc::clone(&readers.pulse), settings.name.clone());
        let commands = CommandThread {
            port: command_queue.commands,
            pulse: Arc::clone(&pulse),
            names: names.clone(),
            events: command_events,
            obstacles: obstacles_in,
            rounds: Arc::clone(&rounds),
        };
        let (port, events) = (command_queue.socket, socket_events);
        let socket = StopThread {
            port,
            pulse,
            names: names.clone(),
            events,
            command_rounds: rounds,
            arm: arm.clone(),
        };
        let port = command_queue.trajectories;
        let around = Surroundings { port, readers, command_log, obstacles, pose_store, candidates, names };
        let mut publisher = Publisher::new(settings, around)?;

        let (mut watch, ends) = PortWatch::new(&arm, runtime, 2);
        let mut threads =
            Self { stop: Arc::default(), all: Vec::new(), watch: None, watch_stop: Arc::default() };
        let mut ends = ends.into_iter();
        if let (Some(first), Some(second)) = (ends.next(), ends.next()) {
            let stop = Arc::clone(&threads.stop);
            threads.spawn("commands", 1 << 20, move || commands.serve(&first, &stop))?;
            let stop = Arc::clone(&threads.stop);
            threads.spawn("publisher", 4 << 20, move || publisher.serve(&second, &stop))?;
        }
        if let Err(e) = watch.open_first() {
            // Not joined: one of them may be what hangs.
            threads.stop.store(true, Ordering::Release);
            return Err(e.into());
        }
        match bind_file(&arm, runtime) {
            Ok(listener) => drop(files.send(listener)),
            Err(e) => warn!("{}: the streamer's own socket cannot be made there: {e}", runtime.display()),
        }
        let stop = Arc::clone(&threads.stop);
        let manager = Manager::from_environment();
        threads.spawn("stop", 512 << 10, move || socket.serve(&files_in, manager, &stop))?;
        threads.watch = Some(watch.start(files, Arc::clone(&threads.watch_stop))?);
        Ok(threads)
    }

    fn spawn(&mut self, name: &str, stack: usize, work: impl FnOnce() + Send + 'static) -> io::Result<()> {
        self.all.push(thread::Builder::new().name(name.into()).stack_size(stack).spawn(work)?);
        Ok(())
    }

    /// Ends all of them, after they have written what is left. One that hangs is named and left to the end of the process.
    pub fn finish(self) {
        self.watch_stop.store(true, Ordering::Release);
        if let Some(watch) = self.watch {
            finish(watch);
        }
        self.stop.store(true, Ordering::Release);
        for thread in self.all {
            finish(thread);
        }
    }
}

fn finish(thread: JoinHandle<()>) {
    let name = thread.thread().name().unwrap_or("without name").to_owned();
    match join_within(thread, THREADS_WITHIN) {
        Ok(()) => {}
        Err(NotEnded::Panicked) => error!("the thread {name} has panicked"),
        Err(NotEnded::Running) => {
            error!(
                "the thread {name} has not ended within {} s; the process ends without it",
                THREADS_WITHIN.as_secs()
            );
        }
    }
}
