//! Runs the simulator on links: one thread, one wait a wake-up, then one receive and one send on each bus that has work.
//!
//! System calls are what a simulator costs on a slow machine, so there are no others in a cycle but one look at the
//! clock. Commands come as lines on the standard input; answers and faults that begin or end go to the standard output.
use super::faults::SimulatorCommand;
use super::linked::LinkedSimulator;
use crate::frame::{BATCH_MAX, CanFrame, FrameBatch};
use crate::link::{CanLink, LinkFault};
use crate::servo::Nanos;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::io::Write;
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest sleep: heartbeats, watchdogs and gravity need no more.
const REST: Duration = Duration::from_millis(5);
/// Least time between two wake-ups that no frame asks for: what a modelled bus has delivered comes so much late.
const LEAST_PAUSE_NS: u64 = 400_000;
/// Batches taken from one bus in one wake-up: a flood must not keep the other buses waiting.
const ROUNDS: usize = 4;
/// Pause between two attempts to get a lost interface back, and between two complaints.
const RETRY: Duration = Duration::from_secs(1);
/// Longest order; a longer line is refused.
const LINE_MAX: usize = 1024;

/// Why the simulator gave up.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Waiting is not possible.
    #[error("cannot wait for frames: {0}")]
    Wait(std::io::Error),
}

/// One bus.
struct Port {
    link: Box<dyn CanLink>,
    ready: bool,
    gone: bool,
    retried: Instant,
    /// Frames that the link did not take.
    lost: u64,
    reported: u64,
}

/// Counts of a whole run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Served {
    /// Frames received.
    pub received: u64,
    /// Frames sent.
    pub sent: u64,
    /// Frames that a link did not take.
    pub lost: u64,
}

/// Serves until `stop`. `links` are indexed as the simulator's buses. Not real time.
///
/// # Errors
/// When the operating system does not let it wait. Interfaces that vanish are waited for.
pub fn serve(
    links: Vec<Box<dyn CanLink>>,
    simulator: LinkedSimulator,
    input: Option<&mut dyn CommandSource>,
    stop: &AtomicBool,
) -> Result<Served, ServeError> {
    let began = Instant::now();
    let joints = simulator.simulator.joints();
    let ports: Vec<Port> = links
        .into_iter()
        .map(|link| Port { link, ready: false, gone: false, retried: began, lost: 0, reported: 0 })
        .collect();
    let out = vec![Vec::with_capacity(BATCH_MAX); ports.len()];
    let batch = FrameBatch::new();
    let turned = Nanos(0);
    let mut server =
        Server { began, joints, ports, simulator, turned, out, batch, served: Served::default() };
    let mut input = input;
    while !stop.load(Ordering::Relaxed) {
        let commands_wait = server.wait(input.as_deref())?;
        server.run_cycle();
        if commands_wait && input.as_deref_mut().is_some_and(|input| !server.take_commands(input)) {
            input = None;
        }
        server.report_events();
    }
    server.buses_in_words().iter().for_each(|line| tracing::info!("{line}"));
    Ok(server.served)
}

/// The source of commands.
pub trait CommandSource: AsFd {
    /// Reads what is there, after the descriptor polled readable; 0 at the end.
    ///
    /// # Errors
    /// The operating system's.
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize>;
    /// A whole line, when one has come; `Err` for one that is too long.
    fn next_line(&mut self) -> Option<Result<String, usize>>;
    /// Takes over bytes that were read.
    fn feed(&mut self, bytes: &[u8]);
}

struct Server {
    began: Instant,
    joints: Vec<String>,
    ports: Vec<Port>,
    simulator: LinkedSimulator,
    turned: Nanos,
    out: Vec<Vec<CanFrame>>,
    batch: FrameBatch,
    served: Served,
}

impl Server {
    /// Time since the start, from one so that nothing is due at zero.
    fn now(&self) -> Nanos {
        let elapsed = self.began.elapsed() + Duration::from_secs(1);
        Nanos(u64::try_from(elapsed.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Sleeps until frames or commands come, or something is due. True when commands wait.
    fn wait(&mut self, input: Option<&dyn CommandSource>) -> Result<bool, ServeError> {
        let rest = match self.simulator.next_due() {
            Some(due) => {
                // A modelled bus ends a frame every 100 us; to wake up for each would take a slow machine whole.
                let due = due.0.max(self.turned.0.saturating_add(LEAST_PAUSE_NS));
                Duration::from_nanos(due.saturating_sub(self.now().0)).min(REST)
            }
            None => REST,
        };
        let rest = if self.ports.iter().any(|port| port.link.readiness().is_none()) {
            rest.min(Duration::from_millis(1)) // A link in memory cannot wake us.
        } else {
            rest
        };
        let timeout = Timespec { tv_sec: 0, tv_nsec: rest.subsec_nanos().into() };
        let mut fds: Vec<PollFd<'_>> = Vec::with_capacity(self.ports.len() + 1);
        fds.extend(input.map(|input| PollFd::from_borrowed_fd(input.as_fd(), PollFlags::IN)));
        let polled = self.ports.iter().filter_map(|port| port.link.readiness());
        fds.extend(polled.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)));
        match poll(&mut fds, Some(&timeout)) {
            Ok(_) => {}
            Err(Errno::INTR) => return Ok(false),
            Err(errno) => return Err(ServeError::Wait(errno.into())),
        }
        let mut answers = fds.iter().map(|fd| !fd.revents().is_empty());
        let commands_wait = input.is_some() && answers.next().unwrap_or(false);
        let mut ready = Vec::with_capacity(self.ports.len());
        for port in &self.ports {
            ready.push(port.link.readiness().is_none() || answers.next().unwrap_or(false));
        }
        for (port, ready) in self.ports.iter_mut().zip(ready) {
            port.ready = ready;
        }
        Ok(commands_wait)
    }

    /// One wake-up: time passes, frames are taken, answers leave.
    fn run_cycle(&mut self) {
        let now = self.now();
        self.turned = now;
        self.simulator.advance(now, &mut self.out);
        for at in 0..self.ports.len() {
            self.observe(now, at);
        }
        for (port, frames) in self.ports.iter_mut().zip(&mut self.out) {
            self.served.sent += port.send(frames);
            self.served.lost += port.complain();
            frames.clear();
        }
    }

    /// Takes what has come on a bus.
    fn observe(&mut self, now: Nanos, at: usize) {
        let Some(port) = self.ports.get_mut(at) else { return };
        if port.gone {
            port.retry();
            return;
        }
        for _ in 0..ROUNDS {
            let Some(port) = self.ports.get_mut(at).filter(|port| port.ready) else { return };
            let fault = port.link.receive(&mut self.batch);
            if fault == Some(LinkFault::Gone) {
                tracing::warn!("{} has gone; waiting for it", port.link.describe());
                port.gone = true;
            }
            let frames = self.batch.frames();
            self.served.received += frames.len() as u64;
            self.simulator.receive(now, at, frames, &mut self.out);
            if fault.is_some() || frames.len() < BATCH_MAX {
                return;
            }
        }
    }

    /// Executes the waiting commands; false when no more can come.
    fn take_commands(&mut self, input: &mut dyn CommandSource) -> bool {
        let mut bytes = [0; LINE_MAX];
        let goes_on = match input.read(&mut bytes) {
            Ok(0) => false,
            Ok(count) => {
                input.feed(bytes.get(..count).unwrap_or(&[]));
                true
            }
            Err(error) => {
                tracing::warn!("cannot read orders: {error}");
                matches!(error.kind(), std::io::ErrorKind::Interrupted | std::io::ErrorKind::WouldBlock)
            }
        };
        while let Some(line) = input.next_line() {
            match line {
                Ok(line) if line.trim().is_empty() => {}
                Ok(line) => self.carry_out(&line),
                Err(length) => say(&format!("error: a line of {length} bytes; at most {LINE_MAX}")),
            }
        }
        goes_on
    }

    fn carry_out(&mut self, line: &str) {
        match SimulatorCommand::parse(line, &self.joints) {
            Err(error) => say(&format!("error: {error}")),
            Ok(SimulatorCommand::Fault(order)) => {
                self.simulator.simulator.request(self.now(), order);
                let joint = self.joints.get(order.joint).map_or("?", String::as_str);
                say(&format!("ok: {} of {joint} is ordered", order.kind));
            }
            Ok(SimulatorCommand::Clear(joint)) => {
                self.simulator.simulator.clear(joint);
                say("ok: cleared");
            }
            Ok(SimulatorCommand::Status) => {
                for (joint, name) in self.joints.iter().enumerate() {
                    let Some(drive) = self.simulator.simulator.drive(joint) else { continue };
                    let (position_rad, velocity_rad_s) = (drive.position_rad(), drive.velocity_rad_s());
                    say(&format!(
                        "status joint={name} node={} position_rad={position_rad} \
                         velocity_rad_s={velocity_rad_s} energised={} {}",
                        drive.node_id(),
                        drive.is_enabled(),
                        drive.describe(),
                    ));
                }
                self.buses_in_words().iter().for_each(|line| say(line));
                say("ok: status");
            }
        }
    }

    /// What the modelled buses have carried; nothing of virtual ones.
    fn buses_in_words(&self) -> Vec<String> {
        let now = self.now();
        let wires =
            self.ports.iter().enumerate().filter_map(|(at, port)| Some((port, self.simulator.wire(at)?)));
        wires.map(|(port, wire)| wire.in_words(&port.link.describe(), now)).collect()
    }

    fn report_events(&mut self) {
        for event in self.simulator.simulator.take_events() {
            let what = if event.began { "begins" } else { "ends" };
            say(&format!("fault {what}: {} of {}", event.kind, event.joint));
        }
    }
}

impl Port {
    /// Sends what there is; frames that are not taken are lost, as on a bus without receivers.
    fn send(&mut self, frames: &[CanFrame]) -> u64 {
        let mut count = 0;
        for chunk in frames.chunks(BATCH_MAX) {
            let sent = self.link.send(chunk);
            count += sent.count.min(chunk.len()) as u64;
            self.lost += chunk.len().saturating_sub(sent.count) as u64;
            if sent.fault == Some(LinkFault::Gone) && !self.gone {
                tracing::warn!("{} has gone; waiting for it", self.link.describe());
                self.gone = true;
            }
        }
        count
    }

    /// Says, at most once a second, that frames were lost. Returns how many.
    fn complain(&mut self) -> u64 {
        let new = self.lost - self.reported;
        if new == 0 || self.retried.elapsed() < RETRY {
            return 0;
        }
        self.retried = Instant::now();
        self.reported = self.lost;
        tracing::warn!("{} did not take {new} frames", self.link.describe());
        new
    }

    /// Tries, at most once a second, to get the interface back.
    fn retry(&mut self) {
        if self.retried.elapsed() < RETRY {
            return;
        }
        self.retried = Instant::now();
        if self.link.reopen().is_ok() {
            tracing::info!("{} is back", self.link.describe());
            self.gone = false;
        }
    }
}

/// The standard input as a source of commands.
#[derive(Debug, Default)]
pub struct StandardInput {
    buffer: Vec<u8>,
    /// Bytes of a line that was too long, thrown away until its end.
    skipped: usize,
}

impl AsFd for StandardInput {
    fn as_fd(&self) -> std::os::fd::BorrowedFd<'_> {
        rustix::stdio::stdin()
    }
}

impl CommandSource for StandardInput {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        Ok(rustix::io::read(rustix::stdio::stdin(), into)?)
    }

    fn feed(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    fn next_line(&mut self) -> Option<Result<String, usize>> {
        let Some(end) = self.buffer.iter().position(|byte| *byte == b'\n') else {
            if self.buffer.len() > LINE_MAX {
                self.skipped += self.buffer.len();
                self.buffer.clear();
            }
            return None;
        };
        let line: Vec<u8> = self.buffer.drain(..=end).collect();
        let length = std::mem::take(&mut self.skipped) + line.len();
        if length > LINE_MAX {
            return Some(Err(length));
        }
        Some(Ok(String::from_utf8_lossy(&line).into_owned()))
    }
}

/// A line for readers; without readers it is dropped.
fn say(line: &str) {
    let mut stdout = std::io::stdout().lock();
    let _nobody_listens = writeln!(stdout, "{line}").and_then(|()| stdout.flush());
}
