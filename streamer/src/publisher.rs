//! The publishing thread: trajectories in, receipts and reports out, and everything that may take its time.
//!
//! It copies trajectories out and has them checked on a thread of their own, so that a long check never delays a report; it
//! publishes reports and receipts, keeps the histograms, restores buses, words the log and hands poses to their store. It may
//! wait and allocate: neither the cycle nor the threads that take commands notice.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::check::{Checked, Checker};
use crate::commands::Obstacle;
use crate::cycle_state::{Decision, TrajectoryResult};
use crate::intake::TrajectoryPort;
use crate::log::{self, CommandLog, SameLines};
use crate::names::Names;
use crate::ports::{Directive, Opened, PortThread};
use crate::pose_store::PoseStore;
use crate::recorder::Candidate;
use crate::report::Readers;
use crate::rt;
use hdrhistogram::Histogram;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;
use taustream_arm::{Settings, TrajectoryFile};
use taustream_messages::event::{Events, Topic};
use taustream_messages::service::{
    ReceiptPublisher, ReportPublisher, ServiceError, TrajectorySubscriber, Wire,
};
use taustream_messages::trajectory::is_newer;
use taustream_messages::{Outcome, Receipt, Rejection, Report};
use taustream_motion::{JointKind, MAX_JOINTS};
use tracing::{error, info, warn};

/// How often ports and queues are looked at.
const INTERVAL: Duration = Duration::from_millis(2);
/// The same while a trajectory is being checked, or the cycle has it: the cycle notifies nobody.
const INTERVAL_UNANSWERED: Duration = Duration::from_micros(200);
/// Trajectories that are taken in one round.
const TRAJECTORIES_MAX: usize = 8;
/// Longest time that the histograms tell apart, ns.
const LONGEST_NS: u64 = 10_000_000_000;

/// The open ports. Dropped in this order: the node last.
#[derive(Debug)]
struct Ports {
    trajectories: TrajectorySubscriber,
    receipts: ReceiptPublisher,
    events: Events,
    reports: ReportPublisher,
    wire: Wire,
}

impl Ports {
    fn open(arm: &str, runtime: &Path) -> Result<Self, ServiceError> {
        let wire = Wire::join(arm, "taustream-streamer", runtime)?;
        Ok(Self {
            trajectories: wire.trajectory_subscriber()?,
            receipts: wire.receipt_publisher()?,
            reports: wire.report_publisher()?,
            events: wire.events(Topic::Trajectory),
            wire,
        })
    }
}

/// What the thread works with.
pub struct Publisher {
    port: TrajectoryPort,
    readers: Readers,
    command_log: CommandLog,
    obstacles: Sender<Obstacle>,
    pose_store: PoseStore,
    candidates: Option<Sender<Candidate>>,
    names: Names,
    robot: String,
    kinds: [JointKind; MAX_JOINTS],
    digest_hex: String,
    checker: Checker,
    lateness: Histogram<u64>,
    lateness_window: Histogram<u64>,
    cycle: Histogram<u64>,
    report_sequence: u64,
    newest_generation: u64,
    accepted: u64,
    rejected: u64,
    rejections: SameLines,
    /// Trajectories without receipt.
    unanswered: u32,
}

/// The queues and threads that the publishing thread stands between.
#[derive(Debug)]
pub struct Surroundings {
    /// Trajectories and links, to the cycle and back.
    pub port: TrajectoryPort,
    /// What the cycle writes.
    pub readers: Readers,
    /// What the threads of commands write.
    pub command_log: CommandLog,
    /// To the thread that answers `clear-fault`.
    pub obstacles: Sender<Obstacle>,
    /// The store of the last pose.
    pub pose_store: PoseStore,
    /// The cycle log, if one is kept.
    pub candidates: Option<Sender<Candidate>>,
    /// Names of joints and buses, for the log.
    pub names: Names,
}

impl Publisher {
    /// A publisher for the arm of `settings`.
    ///
    /// # Errors
    /// When a thread or a histogram is not to be had.
    pub fn new(settings: &Settings, around: Surroundings) -> std::io::Result<Self> {
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).map_err(std::io::Error::other);
        let Surroundings { port, readers, command_log, obstacles, pose_store, candidates, names } = around;
        Ok(Self {
            port,
            readers,
            command_log,
            obstacles,
            pose_store,
            candidates,
            names,
            robot: settings.robot.name.clone(),
            kinds: settings.robot.kinds(),
            digest_hex: settings.robot.digest_hex(),
            checker: Checker::start(&settings.robot)?,
            lateness: histogram()?,
            lateness_window: histogram()?,
            cycle: histogram()?,
            report_sequence: 0,
            newest_generation: 0,
            accepted: 0,
            rejected: 0,
            rejections: SameLines::default(),
            unanswered: 0,
        })
    }

    /// Serves until `stop`; then writes what is left to write.
    pub fn serve(&mut self, ports: &PortThread, stop: &AtomicBool) {
        let mut open: Option<Ports> = None;
        loop {
            // Read first: what the cycle pushed before the end is still published.
            let last = stop.load(Ordering::Acquire);
            match ports.directive() {
                Some(Directive::Close) => ports.closed(open.take()),
                Some(Directive::Open) => {
                    let opened = Ports::open(ports.arm(), ports.runtime());
                    open = ports.opened(opened, |ports| Opened { footprint: ports.wire.footprint() });
                }
                None => {}
            }
            let answered_before = self.accepted + self.rejected;
            let to = open.as_ref();
            self.take_trajectories(to);
            self.restore_buses();
            self.return_checked(to);
            self.send_receipts(to);
            self.take_timings();
            self.publish_reports(to);
            self.command_log.write();
            while let Ok(note) = self.readers.notes.pop() {
                log::note(&note, &self.names);
            }
            if last {
                return;
            }
            let answered = self.accepted + self.rejected > answered_before;
            self.wait(open.as_mut(), answered);
        }
    }

    /// Waits for trajectories, and for the time to look at the other queues.
    fn wait(&self, open: Option<&mut Ports>, answered: bool) {
        let Some(ports) = open else { return thread::sleep(INTERVAL) };
        if answered {
            ports.events.notify();
        }
        if self.unanswered > 0 {
            thread::sleep(INTERVAL_UNANSWERED);
        } else {
            ports.events.wait(INTERVAL);
        }
    }

    /// Restarts the links of failed buses. The reason of a failure is the answer to the `clear-fault` that asked.
    fn restore_buses(&mut self) {
        let Some(mut handover) = self.port.failed_links() else { return };
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
        self.port.return_links(handover);
        if !obstacles.is_empty() {
            let text = obstacles.join("; ");
            warn!("clear-fault is refused: {text}");
            let _thread_has_ended = self.obstacles.send(Obstacle { sequence, text });
        }
    }

    fn take_trajectories(&mut self, to: Option<&Ports>) {
        for _ in 0..TRAJECTORIES_MAX {
            let sample = match to.map(|ports| ports.trajectories.receive()) {
                Some(Ok(Some(sample))) => sample,
                Some(Ok(None)) | None => return,
                Some(Err(e)) => return self.log_rejection(format!("cannot take a trajectory: {e:?}")),
            };
            // Copied out before anything of it is read: the sender may still be writing.
            let copy = Box::new(*sample.payload());
            drop(sample);
            let (id, generation) = (copy.claimed_id(), copy.claimed_generation());
            self.unanswered += 1;
            if !self.checker.check(copy) {
                self.receipt(to, id, generation, &Outcome::Rejected(Rejection::Busy));
            }
        }
    }

    fn return_checked(&mut self, to: Option<&Ports>) {
        while let Some(Checked { id, generation, valid_until, result }) = self.checker.checked() {
            let (now, newest) = (rt::now(), self.newest_generation);
            let result = result.and_then(|checked| {
                if now > valid_until {
                    return Err(Rejection::TooLate { late_s: now.since_s(valid_until) });
                }
                if !is_newer(generation, newest) {
                    return Err(Rejection::StaleGeneration { got: generation, newest });
                }
                Ok((checked, self.port.empty_box().ok_or(Rejection::Busy)?))
            });
            match result {
                Ok((checked, mut empty)) => {
                    self.send_candidate(&checked);
                    *empty = *checked;
                    self.port.offer(empty);
                }
                Err(rejection) => self.receipt(to, id, generation, &Outcome::Rejected(rejection)),
            }
        }
    }

    fn send_candidate(&mut self, checked: &taustream_messages::CheckedTrajectory) {
        let Some(candidates) = &self.candidates else { return };
        let file = TrajectoryFile {
            robot: self.robot.clone(),
            digest: Some(self.digest_hex.clone()),
            kinds: self.kinds,
            trajectory: checked.trajectory.clone(),
        };
        let (trajectory_id, generation) = (checked.trajectory_id, checked.generation);
        if candidates.send(Candidate { trajectory_id, generation, file }).is_err() {
            warn!("the cycle log has ended; see the message of its thread");
            self.candidates = None;
        }
    }

    fn send_receipts(&mut self, to: Option<&Ports>) {
        while let Some(TrajectoryResult { trajectory_id, generation, decision }) =
            self.port.trajectory_result()
        {
            let outcome = match decision {
                Decision::Accepted { tick } => {
                    self.newest_generation = generation;
                    Outcome::Accepted { from_s: 0.0, tick }
                }
                Decision::Waits { from_s } => {
                    self.newest_generation = generation;
                    Outcome::Accepted { from_s, tick: 0 }
                }
                Decision::Cut(refusal) => Outcome::Rejected(refusal.rejection()),
                Decision::Stale { newest } => {
                    Outcome::Rejected(Rejection::StaleGeneration { got: generation, newest })
                }
                Decision::NotAtBase { joint, by_rad } => {
                    let joint = u32::try_from(joint).unwrap_or(u32::MAX);
                    Outcome::Rejected(Rejection::NotAtBase { joint, by_rad })
                }
                Decision::NotReady { phase } => Outcome::Rejected(Rejection::NotReady { phase: Some(phase) }),
            };
            self.receipt(to, trajectory_id, generation, &outcome);
        }
    }

    fn receipt(&mut self, to: Option<&Ports>, id: u64, generation: u64, outcome: &Outcome) {
        self.unanswered = self.unanswered.saturating_sub(1);
        match outcome {
            Outcome::Accepted { tick: 0, from_s } => {
                self.accepted += 1;
                info!(id, generation, from_s, "trajectory accepted; it waits for its cut");
            }
            Outcome::Accepted { tick, .. } => {
                self.accepted += 1;
                info!(id, generation, tick, "trajectory accepted");
            }
            Outcome::Rejected(rejection) => {
                self.rejected += 1;
                let line = format!("trajectory rejected: {rejection}");
                if let Some(line) = self.rejections.take(line, rt::now()) {
                    warn!(id, generation, "{line}");
                }
            }
        }
        let receipt = Receipt::new(id, generation, outcome);
        if let Some(Err(e)) = to.map(|ports| ports.receipts.send_copy(receipt)) {
            self.log_rejection(format!("cannot publish a receipt: {e:?}"));
        }
    }

    fn log_rejection(&mut self, line: String) {
        if let Some(line) = self.rejections.take(line, rt::now()) {
            error!("{line}");
        }
    }

    fn take_timings(&mut self) {
        while let Ok(timing) = self.readers.timings.pop() {
            self.lateness.saturating_record(timing.lateness_ns);
            self.lateness_window.saturating_record(timing.lateness_ns);
            if timing.cycle_ns > 0 {
                self.cycle.saturating_record(timing.cycle_ns);
            }
        }
    }

    fn publish_reports(&mut self, to: Option<&Ports>) {
        while let Ok(report) = self.readers.reports.pop() {
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
            self.pose_store.note(&report);
            if let Some(Err(e)) = to.map(|ports| ports.reports.send_copy(report)) {
                self.log_rejection(format!("cannot publish a report: {e:?}"));
            }
        }
    }
}
