//! Asking the streamer and the planner over shared memory, with a time limit on every wait.
use crate::failure::Failure;
use crate::interrupt;
use std::thread;
use std::time::{Duration, Instant};
use taustream_messages::event::{Events, Topic};
use taustream_messages::service::{ReportSubscriber, ServiceError, Wire};
use taustream_messages::{Command, CommandReply, CommandRequest, Phase, PlanReply, PlanRequest, Report};

/// The process that owns the arm.
pub(crate) const STREAMER: &str = "taustream-streamer";
/// The process that plans.
pub(crate) const PLANNER: &str = "taustream-planner";

/// How often a wait for a report looks for it: reports come at their own rate, without events.
const POLL: Duration = Duration::from_millis(1);
/// How long a wait for an answer relies on its event, before it looks at the clock and at Ctrl-C.
const LOOK_AGAIN: Duration = Duration::from_millis(5);
/// Longest wait for an answer to a command; the streamer answers within a few cycles.
const COMMAND_S_MAX: f64 = 2.0;
/// How long the streamer may carry a command out: shorter, so that nothing happens after we have given up.
const COMMAND_VALID: Duration = Duration::from_millis(1_500);
/// Longest wait for one report; the slowest settable rate is well above one a second.
const REPORT_S_MAX: f64 = 2.0;

/// Longest wait for a planner whose names a starting streamer has cleared: it notices and opens them again within two.
const PLANNER_BACK_S: f64 = 3.0;

/// Access to the services of one arm.
pub(crate) struct Client {
    // Ports go before their node.
    reports: ReportSubscriber,
    wire: Wire,
}

impl Client {
    /// Joins the services of `arm`. No service is needed yet.
    pub(crate) fn join(arm: &str) -> Result<Self, Failure> {
        let wire = Wire::join(arm, "taustream", &taustream_arm::runtime::directory()?)?;
        let reports = wire.report_subscriber()?;
        Ok(Self { reports, wire })
    }

    /// The services themselves.
    pub(crate) fn wire(&self) -> &Wire {
        &self.wire
    }

    /// Sends a command to the streamer; its answer, accepted or refused.
    pub(crate) fn command(&self, command: Command) -> Result<CommandReply, Failure> {
        let client = self.wire.command_client()?;
        let pending = client
            .send_copy(CommandRequest::new(command, COMMAND_VALID))
            .map_err(|e| self.refused("send the command", &e))?;
        if pending.number_of_server_connections() == 0 {
            return Err(self.wire.not_running(STREAMER).into());
        }
        // After the command: opening them takes a moment, and the streamer looks at its port meanwhile.
        let mut events = self.wire.events(Topic::Command);
        events.notify();
        let limit = Limit::after_s(COMMAND_S_MAX);
        loop {
            match pending.receive() {
                Ok(Some(reply)) => return Ok(*reply.payload()),
                Ok(None) => self.wait(&mut events, &limit, STREAMER)?,
                Err(e) => return Err(self.refused("receive the answer", &e)),
            }
        }
    }

    /// Sends a replan request to the planner; its answer, within `limit_s`. `meanwhile` runs while it plans.
    pub(crate) fn plan(
        &self,
        request: PlanRequest,
        limit_s: f64,
        meanwhile: &mut dyn FnMut() -> Result<(), Failure>,
    ) -> Result<PlanReply, Failure> {
        let mut events = self.wire.events(Topic::Plan);
        // A streamer that has just started clears the arm's names, and a running planner opens its own again soon.
        let back = Limit::after_s(PLANNER_BACK_S);
        let (_client, pending) = loop {
            let client = self.wire.plan_client()?;
            let pending = client.send_copy(request).map_err(|e| self.refused("send the request", &e))?;
            if pending.number_of_server_connections() > 0 {
                events.notify();
                break (client, pending);
            }
            // A planner without a streamer is of no use: that one is named first.
            self.report()?;
            if back.is_over() {
                return Err(self.wire.not_running(PLANNER).into());
            }
            meanwhile()?;
            interrupt::check()?;
            thread::sleep(Duration::from_millis(20));
        };
        let limit = Limit::after_s(limit_s);
        loop {
            match pending.receive() {
                Ok(Some(reply)) => return Ok(*reply.payload()),
                Ok(None) => self.wait(&mut events, &limit, PLANNER)?,
                Err(e) => return Err(self.refused("receive the answer", &e)),
            }
            meanwhile()?;
        }
    }

    /// The newest report that has arrived and was not read yet, if it makes sense.
    pub(crate) fn newest_report(&self) -> Result<Option<(Report, Phase)>, Failure> {
        let mut newest = None;
        self.drain_reports(|report, phase| newest = Some((*report, phase)))?;
        Ok(newest)
    }

    /// Hands every report that has arrived to `take`, oldest first. Reports of another layout are passed over.
    pub(crate) fn drain_reports(&self, mut take: impl FnMut(&Report, Phase)) -> Result<(), Failure> {
        loop {
            match self.reports.receive() {
                Ok(None) => return Ok(()),
                Ok(Some(sample)) => {
                    let report = *sample.payload();
                    if let Some((report, phase)) = report.checked() {
                        take(report, phase);
                    }
                }
                Err(e) => return Err(self.refused("receive reports", &e)),
            }
        }
    }

    /// Waits for a report that was written after this call.
    ///
    /// # Errors
    /// `NotRunning` when none comes: a streamer that runs reports all the time.
    pub(crate) fn report(&self) -> Result<(Report, Phase), Failure> {
        self.newest_report()?;
        let limit = Limit::after_s(REPORT_S_MAX);
        loop {
            if let Some(found) = self.newest_report()? {
                return Ok(found);
            }
            if limit.is_over() {
                return Err(self.wire.not_running(STREAMER).into());
            }
            interrupt::check()?;
            thread::sleep(POLL);
        }
    }

    fn wait(&self, events: &mut Events, limit: &Limit, who: &'static str) -> Result<(), Failure> {
        interrupt::check()?;
        if limit.is_over() {
            return Err(Failure::NoAnswer { who, arm: self.wire.arm().to_owned(), waited_s: limit.length_s });
        }
        events.wait(LOOK_AGAIN);
        Ok(())
    }

    pub(crate) fn refused(&self, what: &'static str, why: &dyn std::fmt::Debug) -> Failure {
        ServiceError::Refused { arm: self.wire.arm().to_owned(), what, why: format!("{why:?}") }.into()
    }
}

/// A wait that ends.
pub(crate) struct Limit {
    end: Option<Instant>,
    length_s: f64,
}

impl Limit {
    /// Over after `length_s` from now on; a length that is no duration never ends.
    pub(crate) fn after_s(length_s: f64) -> Self {
        let end = Duration::try_from_secs_f64(length_s).ok().and_then(|d| Instant::now().checked_add(d));
        Self { end, length_s }
    }
    /// True when the time has passed.
    pub(crate) fn is_over(&self) -> bool {
        self.end.is_some_and(|end| Instant::now() >= end)
    }
}
