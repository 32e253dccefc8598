//! The service thread: owner of every shared-memory port (they cannot move between threads).
//!
//! It copies trajectories out and has them checked on a thread of their own, so that a long check never delays a
//! `stop`; it hands commands to the cycle and returns the cycle's answers; it publishes reports and receipts, keeps
//! the histograms and writes the log. It may wait and allocate: the cycle does not notice.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::check::{Checked, Checker};
use crate::cycle_state::{Decision, PendingCommand, TrajectoryResult};
use crate::intake::{COMMANDS_PENDING_MAX, CommandQueue};
use crate::log;
use crate::names::Names;
use crate::pose_store::PoseStore;
use crate::recorder::Candidate;
use crate::report::{Note, Readers};
use crate::rt;
use hdrhistogram::Histogram;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::prelude::ipc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;
use taustream_arm::daemon::Manager;
use taustream_arm::{RuntimeError, Settings, TrajectoryFile, runtime};
use taustream_drivers::Nanos;
use taustream_messages::service::{
    CommandServer, ReceiptPublisher, ReportPublisher, ServiceError, TrajectorySubscriber, Wire,
};
use taustream_messages::{Command, CommandReply, CommandRequest, Outcome, Phase, Receipt, Rejection, Report};
use tracing::{error, info, warn};

/// How often ports and queues are looked at: the latency of a command, and no burden for a small machine.
const INTERVAL: Duration = Duration::from_millis(2);
/// How long the cycle may take to answer; it answers in one period unless it is dead.
const ANSWER_S_MAX: f64 = 1.0;
/// Longest time that the histograms tell apart, ns.
const LONGEST_NS: u64 = 10_000_000_000;

type Question = ActiveRequest<ipc::Service, CommandRequest, (), CommandReply, ()>;

/// A command that waits for the cycle's answer.
struct Pending {
    sequence: u64,
    since: Nanos,
    question: Question,
}

/// Everything that the service thread owns.
pub struct Service {
    command_queue: CommandQueue,
    readers: Readers,
    names: Names,
    arm: String,
    robot: String,
    digest_hex: String,
    checker: Checker,
    candidates: Option<Sender<Candidate>>,
    trajectories: TrajectorySubscriber,
    receipts: ReceiptPublisher,
    reports: ReportPublisher,
    commands: CommandServer,
    pending: Vec<Pending>,
    next_sequence: u64,
    lateness: Histogram<u64>,
    lateness_window: Histogram<u64>,
    cycle: Histogram<u64>,
    phase: Phase,
    report_sequence: u64,
    newest_generation: u64,
    accepted: u64,
    rejected: u64,
    manager: Manager,
    notified: Option<Phase>,
    pose_store: Option<PoseStore>,
}

/// Why the service thread cannot serve.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Shared memory refuses.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// There is no place for shared memory.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// Histograms or threads cannot be made.
    #[error("cannot start the service thread: {0}")]
    System(String),
}

impl Service {
    /// Opens every port of the arm. Call it on the thread that will serve.
    ///
    /// # Errors
    /// When shared memory refuses, for instance because a streamer serves this arm already.
    pub fn open(
        settings: &Settings,
        command_queue: CommandQueue,
        readers: Readers,
        candidates: Option<Sender<Candidate>>,
    ) -> Result<Self, StartError> {
        let wire = Wire::join(&settings.name, "taustream-streamer", &runtime::directory()?)?;
        // The one that can be had only once comes first: a second streamer ends here.
        let commands = wire.command_server()?;
        let histogram =
            || Histogram::new_with_bounds(1, LONGEST_NS, 3).map_err(|e| StartError::System(e.to_string()));
        Ok(Self {
            command_queue,
            readers,
            names: Names::of(settings),
            arm: settings.name.clone(),
            robot: settings.robot.name.clone(),
            digest_hex: settings.robot.digest_hex(),
            checker: Checker::start(&settings.robot).map_err(|e| StartError::System(e.to_string()))?,
            candidates,
            trajectories: wire.trajectory_subscriber()?,
            receipts: wire.receipt_publisher()?,
            reports: wire.report_publisher()?,
            commands,
            pending: Vec::with_capacity(COMMANDS_PENDING_MAX),
            next_sequence: 1,
            lateness: histogram()?,
            lateness_window: histogram()?,
            cycle: histogram()?,
            phase: Phase::Configuring,
            report_sequence: 0,
            newest_generation: 0,
            accepted: 0,
            rejected: 0,
            manager: Manager::from_environment(),
            notified: None,
            pose_store: None,
        })
    }

    /// The same, keeping the last pose on disk.
    #[must_use]
    pub fn keeping(self, pose_store: PoseStore) -> Self {
        Self { pose_store: Some(pose_store), ..self }
    }

    /// Serves until `stop`; then tells what is left to tell.
    pub fn serve(&mut self, stop: &AtomicBool) {
        loop {
            // Read first: what the cycle pushed before the request is still published.
            let last = stop.load(Ordering::Acquire);
            self.take_commands();
            self.take_trajectories();
            self.restore_buses();
            self.return_answers();
            self.return_checked();
            self.send_receipts();
            let cycles = self.take_timings();
            self.publish_reports();
            self.write_notes();
            self.notify_manager(cycles);
            if last {
                return;
            }
            thread::sleep(INTERVAL);
        }
    }

    fn take_commands(&mut self) {
        while self.pending.len() < COMMANDS_PENDING_MAX {
            let question = match self.commands.receive() {
                Ok(Some(question)) => question,
                Ok(None) => return,
                Err(e) => return error!("cannot take a command: {e:?}"),
            };
            let command = match Command::try_from(question.payload()) {
                Ok(command) => command,
                Err(e) => {
                    reply(&question, CommandReply::refused(self.phase, &e.to_string()));
                    continue;
                }
            };
            info!(?command, "command received");
            let sequence = self.next_sequence;
            self.next_sequence += 1;
            if self.command_queue.push_command(PendingCommand { sequence, command }) {
                self.pending.push(Pending { sequence, since: rt::now(), question });
            } else {
                let text = "too many commands at once; try again";
                reply(&question, CommandReply::refused(self.phase, text));
            }
        }
    }

    /// Restarts the links of failed buses. The reason of a failure is the answer to the `clear-fault` that asked.
    fn restore_buses(&mut self) {
        let Some(mut handover) = self.command_queue.failed_links() else { return };
        let mut obstacles = Vec::new();
        for (bus, link) in handover.links.iter_mut().enumerate() {
            match link.as_mut().map(|link| link.reopen()) {
                None => {}
                Some(Ok(())) => info!("{} is started over", self.names.bus(bus)),
                Some(Err(e)) => obstacles.push(format!("{}: {e}", self.names.bus(bus))),
            }
        }
        handover.recovered = obstacles.is_empty();
        let sequence = handover.sequence;
        self.command_queue.return_links(handover);
        if !obstacles.is_empty() {
            self.answer(sequence, (false, Phase::Fault), &obstacles.join("; "));
        }
    }

    fn answer(&mut self, sequence: u64, (accepted, phase): (bool, Phase), text: &str) {
        let found = self.pending.iter().position(|p| p.sequence == sequence);
        let Some(pending) = found.map(|at| self.pending.swap_remove(at)) else { return };
        let message = if accepted { CommandReply::accepted } else { CommandReply::refused };
        info!(accepted, phase = phase.word(), "answered: {text}");
        reply(&pending.question, message(phase, text));
    }

    fn return_answers(&mut self) {
        while let Some(answer) = self.command_queue.answer() {
            let text = answer.why.sentence(&self.names);
            self.answer(answer.sequence, (answer.accepted, answer.phase), &text);
        }
        let now = rt::now();
        let phase = self.phase;
        self.pending.retain(|pending| {
            let alive = now.since_s(pending.since) <= ANSWER_S_MAX;
            if !alive {
                let text = "the real-time thread does not answer; restart the streamer";
                reply(&pending.question, CommandReply::refused(phase, text));
            }
            alive
        });
    }

    fn take_trajectories(&mut self) {
        loop {
            let sample = match self.trajectories.receive() {
                Ok(Some(sample)) => sample,
                Ok(None) => return,
                Err(e) => return error!("cannot take a trajectory: {e:?}"),
            };
            // Copied out before anything of it is read: the sender may still be writing.
            let copy = Box::new(*sample.payload());
            let (id, generation) = (copy.claimed_id(), copy.claimed_generation());
            if !self.checker.check(copy) {
                self.receipt(id, generation, &Outcome::Rejected(Rejection::Busy));
            }
        }
    }

    fn return_checked(&mut self) {
        while let Some(Checked { id, generation, result }) = self.checker.checked() {
            let newest = self.newest_generation;
            let result =
                result.and_then(|checked| match (generation > newest, self.command_queue.empty_box()) {
                    (false, unused) => {
                        unused.into_iter().for_each(|b| self.command_queue.return_unused(b));
                        Err(Rejection::StaleGeneration { got: generation, newest })
                    }
                    (true, None) => Err(Rejection::Busy),
                    (true, Some(empty)) => Ok((checked, empty)),
                });
            match result {
                Ok((checked, mut empty)) => {
                    self.send_candidate(&checked);
                    *empty = *checked;
                    self.command_queue.offer(empty);
                }
                Err(rejection) => self.receipt(id, generation, &Outcome::Rejected(rejection)),
            }
        }
    }

    fn send_candidate(&mut self, checked: &taustream_messages::CheckedTrajectory) {
        let Some(candidates) = &self.candidates else { return };
        let file = TrajectoryFile {
            robot: self.robot.clone(),
            digest: Some(self.digest_hex.clone()),
            trajectory: checked.trajectory.clone(),
        };
        let (trajectory_id, generation) = (checked.trajectory_id, checked.generation);
        if candidates.send(Candidate { trajectory_id, generation, file }).is_err() {
            warn!("the cycle log has ended; see the message of its thread");
            self.candidates = None;
        }
    }

    fn send_receipts(&mut self) {
        while let Some(TrajectoryResult { trajectory_id, generation, decision }) =
            self.command_queue.trajectory_result()
        {
            let outcome = match decision {
                Decision::Accepted { tick } => {
                    self.newest_generation = generation;
                    Outcome::Accepted { from_s: 0.0, tick }
                }
                Decision::Stale { newest } => {
                    Outcome::Rejected(Rejection::StaleGeneration { got: generation, newest })
                }
                Decision::NotAtBase { joint, by_rad } => {
                    let joint = u32::try_from(joint).unwrap_or(u32::MAX);
                    Outcome::Rejected(Rejection::NotAtBase { joint, by_rad })
                }
                Decision::NotReady { phase } => Outcome::Rejected(Rejection::NotReady { phase: Some(phase) }),
            };
            self.receipt(trajectory_id, generation, &outcome);
        }
    }

    fn receipt(&mut self, id: u64, generation: u64, outcome: &Outcome) {
        match outcome {
            Outcome::Accepted { tick, .. } => {
                self.accepted += 1;
                info!(id, generation, tick, "trajectory accepted");
            }
            Outcome::Rejected(rejection) => {
                self.rejected += 1;
                warn!(id, generation, "trajectory rejected: {rejection}");
            }
        }
        if let Err(e) = self.receipts.send_copy(Receipt::new(id, generation, outcome)) {
            error!("cannot publish a receipt: {e:?}");
        }
    }

    /// Returns how many cycles have run since the last call.
    fn take_timings(&mut self) -> usize {
        let mut cycles = 0;
        while let Some(timing) = self.readers.timings.pop() {
            self.lateness.saturating_record(timing.lateness_ns);
            self.lateness_window.saturating_record(timing.lateness_ns);
            if timing.cycle_ns > 0 {
                self.cycle.saturating_record(timing.cycle_ns);
            }
            cycles += 1;
        }
        cycles
    }

    /// Readiness and the watchdog hang on cycles that have run: this thread's own life says nothing about the arm.
    fn notify_manager(&mut self, cycles: usize) {
        if cycles == 0 {
            return;
        }
        self.manager.progress();
        if self.notified != Some(self.phase) {
            self.notified = Some(self.phase);
            self.manager.status(&format!("arm {}: {}", self.arm, self.phase.word()));
        }
    }

    fn publish_reports(&mut self) {
        while let Some(report) = self.readers.reports.pop() {
            self.phase = Phase::from_code(report.phase).unwrap_or(self.phase);
            let report = Report {
                sequence: self.report_sequence,
                accepted: self.accepted,
                rejected: self.rejected,
                lateness_ns_p50: self.lateness_window.value_at_quantile(0.5),
                lateness_ns_p99: self.lateness.value_at_quantile(0.99),
                lateness_ns_p999: self.lateness.value_at_quantile(0.999),
                lateness_ns_max: self.lateness.max(),
                cycle_ns_p99: self.cycle.value_at_quantile(0.99),
                cycle_ns_max: self.cycle.max(),
                ..report
            };
            self.report_sequence += 1;
            self.lateness_window.reset();
            if let Some(pose_store) = &mut self.pose_store {
                pose_store.note(&report);
            }
            if let Err(e) = self.reports.send_copy(report) {
                error!("cannot publish a report: {e:?}");
            }
        }
    }

    fn write_notes(&mut self) {
        while let Some(note) = self.readers.notes.pop() {
            if let Note::Transition(transition) = note {
                self.phase = transition.to;
            }
            log::note(&note, &self.names);
        }
    }
}

fn reply(question: &Question, message: CommandReply) {
    if let Err(e) = question.send_copy(message) {
        // The asker has gone; that is its own affair.
        info!("no receiver for an answer: {e:?}");
    }
}
