//! The thread that takes commands out of shared memory: it hands them to the cycle and returns the cycle's answers.
//!
//! It never logs, never touches a disk, and never waits for anybody: what is to be logged goes into a ring that drops and
//! counts, and every other thread may hang without delaying an answer. Opening the ports may take a moment, when names in
//! shared memory are new or have vanished; a stop then comes by [`crate::stop_socket`].
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::answer::CommandAnswer;
use crate::intake::{COMMANDS_PENDING_MAX, CommandPort};
use crate::log::{CommandEvent, EventWriter};
use crate::names::Names;
use crate::ports::{Directive, Opened, PortThread};
use crate::report::Pulse;
use crate::rt;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::prelude::ipc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::Duration;
use taustream_drivers::Nanos;
use taustream_messages::event::{Events, Topic};
use taustream_messages::service::{CommandServer, ServiceError, Wire};
use taustream_messages::{Command, CommandReply, CommandRequest, Phase};

/// How often the port and the queues are looked at without an event.
const INTERVAL: Duration = Duration::from_millis(2);
/// How often answers are looked for: the cycle notifies nobody.
const INTERVAL_UNANSWERED: Duration = Duration::from_micros(200);
/// How long the cycle may take to carry a command out; it answers in one period unless it is dead.
pub(crate) const CARRIED_OUT_WITHIN: Duration = Duration::from_millis(1_000);
/// How long its answer is waited for: longer, so that nothing is carried out that was answered as lost.
pub(crate) const ANSWER_S_MAX: f64 = 1.2;

type Question = ActiveRequest<ipc::Service, CommandRequest, (), CommandReply, ()>;

/// A command that waits for the cycle's answer.
struct Pending {
    sequence: u64,
    since: Nanos,
    question: Question,
}

/// What stands in the way of restoring buses, for the `clear-fault` that asked.
#[derive(Debug)]
pub struct Obstacle {
    /// Its number.
    pub sequence: u64,
    /// What, and what to do.
    pub text: String,
}

/// What the thread works with.
#[derive(Debug)]
pub struct CommandThread {
    /// To the cycle and back.
    pub port: CommandPort,
    /// What the cycle is doing.
    pub pulse: Arc<Pulse>,
    /// Names of joints and buses.
    pub names: Names,
    /// What is to be logged.
    pub events: EventWriter,
    /// From the thread that restores buses.
    pub obstacles: Receiver<Obstacle>,
    /// Counts this thread's rounds, for the watchdog.
    pub rounds: Arc<AtomicU64>,
}

/// The open port. Dropped as a whole, the server before its node.
struct Port {
    server: CommandServer,
    events: Events,
    wire: Wire,
}

/// Opens the port of commands: the one that can be had only once.
fn open(arm: &str, runtime: &std::path::Path) -> Result<Port, ServiceError> {
    let wire = Wire::join(arm, "taustream-streamer", runtime)?;
    Ok(Port { server: wire.command_server()?, events: wire.events(Topic::Command), wire })
}

impl CommandThread {
    /// Serves until `stop`.
    pub fn serve(mut self, ports: &PortThread, stop: &AtomicBool) {
        let mut port = None;
        let mut pending = Vec::with_capacity(COMMANDS_PENDING_MAX);
        loop {
            // Read first: what was answered before the end is still returned.
            let last = stop.load(Ordering::Acquire);
            match ports.directive() {
                Some(Directive::Close) => {
                    pending.clear();
                    ports.closed(port.take());
                }
                Some(Directive::Open) => {
                    port = ports.opened(open(ports.arm(), ports.runtime()), |port| Opened {
                        footprint: port.wire.footprint(),
                    });
                }
                None => {}
            }
            if let Some(port) = &port {
                self.take_commands(&port.server, &mut pending);
            }
            let waited_for = pending.len();
            self.return_answers(&mut pending);
            self.rounds.fetch_add(1, Ordering::Relaxed);
            if last {
                return;
            }
            match &mut port {
                None => thread::sleep(INTERVAL),
                Some(port) => {
                    if pending.len() < waited_for {
                        port.events.notify();
                    }
                    if pending.is_empty() {
                        port.events.wait(INTERVAL);
                    } else {
                        thread::sleep(INTERVAL_UNANSWERED);
                    }
                }
            }
        }
    }

    fn take_commands(&mut self, server: &CommandServer, pending: &mut Vec<Pending>) {
        while pending.len() < COMMANDS_PENDING_MAX {
            let question = match server.receive() {
                Ok(Some(question)) => question,
                Ok(None) => return,
                Err(_) => return self.events.push(CommandEvent::PortFailed),
            };
            // Copied out before anything of it is read: the sender may still be writing.
            let request = *question.payload();
            let command = match Command::try_from(&request) {
                Ok(command) => command,
                Err(error) => {
                    self.events.push(CommandEvent::Malformed(error));
                    reply(&question, CommandReply::refused(self.pulse.phase(), &error.to_string()));
                    continue;
                }
            };
            let since = rt::now();
            let valid_until = valid_until(since).min(Nanos(request.valid_until_ns()));
            self.events.push(CommandEvent::PendingCommand { command, socket: false });
            match self.port.ask(command, valid_until) {
                Some(sequence) => pending.push(Pending { sequence, since, question }),
                None => reply(&question, CommandReply::refused(self.pulse.phase(), TOO_MANY)),
            }
        }
    }

    fn return_answers(&mut self, pending: &mut Vec<Pending>) {
        while let Some(answer) = self.port.answer() {
            self.events.push(CommandEvent::Answered(answer));
            let text = answer.why.sentence(&self.names);
            finish(pending, answer.sequence, message(&answer, &text));
        }
        for Obstacle { sequence, text } in self.obstacles.try_iter() {
            finish(pending, sequence, CommandReply::refused(Phase::Fault, &text));
        }
        let now = rt::now();
        let phase = self.pulse.phase();
        pending.retain(|pending| {
            let alive = now.since_s(pending.since) <= ANSWER_S_MAX;
            if !alive {
                reply(&pending.question, CommandReply::refused(phase, NO_ANSWER));
            }
            alive
        });
    }
}

/// More commands are on their way than the cycle takes at a time.
pub(crate) const TOO_MANY: &str = "too many commands at once; ask again";
/// The cycle is dead or stands still.
pub(crate) const NO_ANSWER: &str =
    "the real-time thread does not answer, and the command is not carried out; restart the streamer";

/// Until when the cycle may carry out what was taken at an instant.
pub(crate) fn valid_until(taken: Nanos) -> Nanos {
    Nanos(taken.0.saturating_add(u64::try_from(CARRIED_OUT_WITHIN.as_nanos()).unwrap_or(0)))
}

fn message(answer: &CommandAnswer, text: &str) -> CommandReply {
    let message = if answer.accepted { CommandReply::accepted } else { CommandReply::refused };
    message(answer.phase, text)
}

fn finish(pending: &mut Vec<Pending>, sequence: u64, message: CommandReply) {
    let found = pending.iter().position(|p| p.sequence == sequence);
    if let Some(pending) = found.map(|at| pending.swap_remove(at)) {
        reply(&pending.question, message);
    }
}

fn reply(question: &Question, message: CommandReply) {
    // Whoever asked may have gone; that is its own affair.
    let _nobody_waits = question.send_copy(message);
}
