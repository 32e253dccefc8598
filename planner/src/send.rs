//! Hands a trajectory to the streamer and waits for its receipt.
//!
//! The generation comes from the streamer's newest report, never from memory: a planner that was killed and started
//! again continues where the streamer is. A report counts only while it is new by the clock of the host, so that one which a
//! dead streamer left behind is never believed.
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_messages::clock::now_ns;
use taustream_messages::event::{Events, Topic};
use taustream_messages::service::{
    ReceiptSubscriber, ReportSubscriber, ServiceError, TrajectoryPublisher, Wire,
};
use taustream_messages::{CheckedTrajectory, Outcome, Phase, Receipt, Replaces, Report, TrajectoryMessage};
use taustream_motion::Trajectory;

/// How often a wait for a report looks for it: reports come at their own rate, without events.
const POLL: Duration = Duration::from_millis(1);
/// How long a wait for a receipt relies on its event.
const LOOK_AGAIN: Duration = Duration::from_millis(5);
/// How long a sender stays, so that the planner learns what it has sent.
const LINGER: Duration = Duration::from_millis(50);
/// A streamer that sends no report for this long is not running.
pub const REPORT_WITHIN: Duration = Duration::from_secs(1);
/// A report that is not older is the streamer's state of now, ns: a reporting period and a half at the default rate.
const CURRENT_NS: u64 = 15_000_000;
/// Of a wait for a receipt, how much is left to the receipt's own way.
pub(crate) const RECEIPT_TAKES: Duration = Duration::from_millis(300);
/// Trajectories that are remembered: one runs, one waits, others were replaced or are unanswered.
const SENT_MAX: usize = 8;
/// Ids stay below 2^53, so that JSON readers with f64 numbers keep them exact.
const ID_BITS: u32 = 53;

/// A trajectory that was published.
#[derive(Clone, Debug, PartialEq)]
pub struct SentTrajectory {
    /// Its id.
    pub trajectory_id: u64,
    /// Its generation.
    pub generation: u64,
    /// The streamer's answer; `None` when none came in time.
    pub receipt: Option<Receipt>,
    /// When it was sent, by `CLOCK_MONOTONIC`, ns.
    pub sent_ns: u64,
}

/// Why a trajectory was not sent.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SendError {
    /// Shared memory, or no streamer.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The streamer drives another robot.
    #[error("the streamer drives another robot (digest {streamer}, ours is {ours}); use its robot file")]
    WrongRobot {
        /// The streamer's digest.
        streamer: String,
        /// Ours.
        ours: String,
    },
    /// Shared memory refused in the middle of it.
    #[error("the trajectory could not be handed over: cannot {what}: {why}")]
    Transport {
        /// What was tried.
        what: &'static str,
        /// iceoryx2's reason.
        why: String,
    },
}

/// Publishes a trajectory from rest under the next generation, and waits up to `timeout` for its receipt.
///
/// # Errors
/// When no streamer runs, it drives another robot, or shared memory refuses.
pub fn send_trajectory(
    wire: &Wire,
    robot: &Robot,
    trajectory: &Trajectory,
    timeout: Duration,
) -> Result<SentTrajectory, SendError> {
    let outbox = Outbox::open(wire)?;
    let sent = outbox.send(robot, trajectory, Replaces::Rest, timeout);
    // What was sent is seen only while its sender is there, and the planner looks every few milliseconds.
    thread::sleep(LINGER);
    sent
}

/// The ports through which trajectories go out and answers come back.
#[derive(Debug)]
pub struct Outbox<'a> {
    wire: &'a Wire,
    trajectories: TrajectoryPublisher,
    receipts: ReceiptSubscriber,
    reports: ReportSubscriber,
    events: RefCell<Events>,
    /// The newest report that made sense.
    newest: Cell<Option<(Report, Phase)>>,
    /// When the streamer's newest acceptance came, by `CLOCK_MONOTONIC`, ns: older reports do not know what it accepted.
    accepted_ns: Cell<u64>,
    /// What was sent, newest last: what runs may be cut only by whoever knows its strokes.
    sent: RefCell<VecDeque<(u64, Trajectory)>>,
}

impl<'a> Outbox<'a> {
    /// Opens the ports. No subscriber is needed yet.
    ///
    /// # Errors
    /// When shared memory refuses.
    pub fn open(wire: &'a Wire) -> Result<Self, SendError> {
        // The receipt's port first: it must be there before anything that is answered.
        let (receipts, reports) = (wire.receipt_subscriber()?, wire.report_subscriber()?);
        let (newest, accepted_ns, sent) = (Cell::new(None), Cell::new(0), RefCell::default());
        let (trajectories, events) =
            (wire.trajectory_publisher()?, RefCell::new(wire.events(Topic::Trajectory)));
        Ok(Self { wire, trajectories, receipts, reports, events, newest, accepted_ns, sent })
    }

    /// The newest report that has arrived since the last call, if there is one that makes sense.
    ///
    /// # Errors
    /// When shared memory refuses.
    pub fn newest_report(&self) -> Result<Option<(Report, Phase)>, SendError> {
        let mut newest = None;
        while let Some(sample) = self.reports.receive().map_err(|e| transport("receive reports", &e))? {
            // Copied out before it is checked.
            let report = *sample.payload();
            if let Some((report, phase)) = report.checked() {
                newest = Some((*report, phase));
            }
        }
        if newest.is_some() {
            self.newest.set(newest);
        }
        Ok(newest)
    }

    /// The newest report that was received, however old it is.
    pub(crate) fn last_report(&self) -> Option<(Report, Phase)> {
        self.newest.get()
    }

    /// The newest report, if the streamer has written it just now by the clock that both share; else the next one to come,
    /// within `timeout`. So a report that a dead streamer left behind is not believed, and nobody waits for a living one.
    ///
    /// # Errors
    /// `NotRunning` when none comes.
    pub fn current_report(&self, timeout: Duration) -> Result<(Report, Phase), SendError> {
        self.newest_report()?;
        match self.newest.get() {
            Some((report, phase)) if now_ns().saturating_sub(report.time_ns) <= CURRENT_NS => {
                Ok((report, phase))
            }
            Some(_) | None => self.fresh_report(timeout),
        }
    }

    /// A report that was published after this call, within `timeout`.
    ///
    /// # Errors
    /// `NotRunning` when none comes.
    pub fn fresh_report(&self, timeout: Duration) -> Result<(Report, Phase), SendError> {
        self.newest_report()?;
        let since = Instant::now();
        loop {
            if let Some(found) = self.newest_report()? {
                return Ok(found);
            }
            if since.elapsed() > timeout {
                return Err(self.wire.not_running("taustream-streamer").into());
            }
            thread::sleep(POLL);
        }
    }

    /// Publishes a trajectory under the next generation, and waits up to `timeout` for its receipt.
    ///
    /// # Errors
    /// When no streamer runs, it drives another robot, or shared memory refuses.
    pub fn send(
        &self,
        robot: &Robot,
        trajectory: &Trajectory,
        replaces: Replaces,
        timeout: Duration,
    ) -> Result<SentTrajectory, SendError> {
        let (report, _) = self.current_report(REPORT_WITHIN)?;
        self.send_after(robot, &report, (trajectory, replaces), timeout)
    }

    /// The same, under the generation after that of a report that was just received.
    ///
    /// # Errors
    /// When no streamer runs, it drives another robot, or shared memory refuses.
    pub fn send_after(
        &self,
        robot: &Robot,
        report: &Report,
        (trajectory, replaces): (&Trajectory, Replaces),
        timeout: Duration,
    ) -> Result<SentTrajectory, SendError> {
        check_robot(robot, report)?;
        let (trajectory_id, generation) = (random_id(), report.generation.wrapping_add(1));
        let message = TrajectoryMessage::new(&CheckedTrajectory {
            trajectory_id,
            generation,
            robot_digest: robot.message_digest,
            replaces,
            trajectory: trajectory.clone(),
        });
        // What the receipt would come too late for is not to move the arm either.
        let message = message.valid_for(timeout.saturating_sub(RECEIPT_TAKES));
        let sent_ns = now_ns();
        let received = self.trajectories.send_copy(*message).map_err(|e| transport("publish it", &e))?;
        if received == 0 {
            return Err(self.wire.not_running("taustream-streamer").into());
        }
        self.events.borrow().notify();
        let receipt = self.receipt(trajectory_id, timeout)?;
        // Without a receipt it may have been accepted all the same.
        if !matches!(receipt.and_then(|receipt| receipt.outcome()), Some(Outcome::Rejected(_))) {
            self.accepted_ns.set(now_ns());
            let mut sent = self.sent.borrow_mut();
            if sent.len() == SENT_MAX {
                sent.pop_front();
            }
            sent.push_back((trajectory_id, trajectory.clone()));
        }
        Ok(SentTrajectory { trajectory_id, generation, receipt, sent_ns })
    }

    /// When the streamer's newest acceptance came, by `CLOCK_MONOTONIC`, ns.
    pub(crate) fn accepted_ns(&self) -> u64 {
        self.accepted_ns.get()
    }

    /// The strokes of a trajectory that was sent from here.
    #[must_use]
    pub fn known(&self, trajectory_id: u64) -> Option<Trajectory> {
        let sent = self.sent.borrow();
        sent.iter().find(|(id, _)| *id == trajectory_id).map(|(_, trajectory)| trajectory.clone())
    }

    fn receipt(&self, trajectory_id: u64, timeout: Duration) -> Result<Option<Receipt>, SendError> {
        let since = Instant::now();
        loop {
            while let Some(sample) = self.receipts.receive().map_err(|e| transport("receive receipts", &e))? {
                let receipt = *sample.payload();
                if receipt.trajectory_id() == trajectory_id {
                    return Ok(Some(receipt));
                }
            }
            if since.elapsed() > timeout {
                return Ok(None);
            }
            self.events.borrow_mut().wait(LOOK_AGAIN);
        }
    }
}

/// Refuses a robot that is not the streamer's.
///
/// # Errors
/// `WrongRobot` with both digests.
pub fn check_robot(robot: &Robot, report: &Report) -> Result<(), SendError> {
    if report.robot_digest == robot.message_digest {
        return Ok(());
    }
    let [streamer, ours] = [&report.robot_digest, &robot.message_digest]
        .map(|digest| digest.iter().map(|b| format!("{b:02x}")).collect());
    Err(SendError::WrongRobot { streamer, ours })
}

fn transport(what: &'static str, why: &dyn std::fmt::Debug) -> SendError {
    SendError::Transport { what, why: format!("{why:?}") }
}

/// A random id from 1 to 2^53 - 1. The standard library's hash keys are the operating system's random numbers.
fn random_id() -> u64 {
    let mut hasher = RandomState::new().build_hasher();
    hasher.write_u32(std::process::id());
    (hasher.finish() >> (u64::BITS - ID_BITS)).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn ids_are_in_range_and_do_not_repeat() {
        let ids: BTreeSet<u64> = (0..1_000).map(|_| random_id()).collect();
        assert_eq!(ids.len(), 1_000);
        assert!(ids.iter().all(|id| (1..1 << ID_BITS).contains(id)));
    }
}
