//! The far ends of the bench's links: a receiver must take what a local link carries, or its queue fills up.
#![expect(clippy::disallowed_methods, reason = "the far end is not the real-time thread and may sleep")]
use super::{BenchError, BenchOptions};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use taustream_arm::{Bus, BusKind, Settings};
use taustream_drivers::link::{self, LinkChoice, LinkRole, Sent};
use taustream_drivers::{CanFrame, CanLink, FrameBatch, LinkFault};

/// How often the far ends are emptied: well within what a socket holds.
const INTERVAL: Duration = Duration::from_millis(4);

/// Takes everything, gives nothing, and makes no system call.
struct Void;

impl CanLink for Void {
    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        Sent { count: frames.len(), fault: None }
    }
    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        into.clear();
        None
    }
    fn describe(&self) -> String {
        "no link".to_owned()
    }
}

/// The far ends, and how to open the near ones.
pub(super) struct Peers {
    choice: Option<LinkChoice>,
    /// A private meeting place, so that a running arm's local link is left alone.
    runtime: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Peers {
    pub(super) fn open(options: &BenchOptions) -> Result<Self, BenchError> {
        let runtime = std::env::temp_dir().join(format!("taustream-bench-{}", std::process::id()));
        let choice = options.link.map(|choice| settle(choice, &options.settings));
        let stop = Arc::new(AtomicBool::new(false));
        let mut peers = Self { choice, runtime, stop, thread: None };
        if choice == Some(LinkChoice::Local) {
            let ends: Result<Vec<_>, _> = options
                .settings
                .buses
                .iter()
                .map(|bus| link::open(bus, LinkChoice::Local, LinkRole::Servos, &peers.runtime))
                .collect();
            let mut ends = ends.map_err(|e| BenchError::Link(e.to_string()))?;
            let stop = Arc::clone(&peers.stop);
            let work = move || {
                let mut batch = FrameBatch::new();
                while !stop.load(Ordering::Relaxed) {
                    for end in &mut ends {
                        while end.receive(&mut batch).is_none() && !batch.frames().is_empty() {}
                    }
                    thread::sleep(INTERVAL);
                }
            };
            let spawned = thread::Builder::new().name("far ends".into()).stack_size(256 << 10).spawn(work);
            peers.thread = Some(spawned.map_err(|e| BenchError::System(e.to_string()))?);
        }
        Ok(peers)
    }

    /// The near end of a bus.
    pub(super) fn master(&self, bus: &Bus) -> Result<Box<dyn CanLink>, BenchError> {
        let Some(choice) = self.choice else { return Ok(Box::new(Void)) };
        link::open(bus, choice, LinkRole::Master, &self.runtime).map_err(|e| BenchError::Link(e.to_string()))
    }

    /// Ends the far ends.
    pub(super) fn close(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::warn!("the far end of the bench's link has panicked");
        }
        // Nothing but the bench's own sockets lies there; a leftover is harmless.
        let _ = std::fs::remove_dir_all(&self.runtime);
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        self.close();
    }
}

/// `auto` as the links would settle it, known beforehand because the far ends depend on it.
fn settle(choice: LinkChoice, settings: &Settings) -> LinkChoice {
    let all_virtual = settings.buses.iter().all(|b| b.kind == BusKind::Virtual);
    let there = |bus: &Bus| PathBuf::from("/sys/class/net").join(&bus.interface).exists();
    match choice {
        LinkChoice::Auto if all_virtual && !settings.buses.iter().all(there) => LinkChoice::Local,
        LinkChoice::Auto => LinkChoice::SocketCan,
        LinkChoice::SocketCan | LinkChoice::Local => choice,
    }
}
