//! An `ODrive` that is only received, and the steps that make it this master's: none is made with one that is energised.
use super::{
    Axis, AxisTarget, CycleFrames, NO_REPLY, OBSERVE_MIN, REPEAT, SETTLE, Stage, Watchdog, age, later, only,
};
use crate::bring_up::timing::BringUpCycle;
use crate::protocols::odrive::fault::{OdriveFault, version_number};
use crate::protocols::odrive::frames::{Command, EndpointValue, Query};
use crate::servo::{DriveTarget, Nanos};

/// One step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Ask what it is, and compare.
    Identity,
    /// Read its velocity limit, and compare.
    VelocityLimit,
    /// Write the timeout of its watchdog, and read it back.
    WatchdogTimeout,
    /// Switch its watchdog on, and read that back.
    WatchdogOn,
}

const STEPS: [Step; 4] = [Step::Identity, Step::VelocityLimit, Step::WatchdogTimeout, Step::WatchdogOn];

/// What a step found: it holds, or this with what the drive states and what it should.
type Outcome = Result<(), (OdriveFault, [f64; 2])>;

impl Axis {
    pub(super) fn observing(&mut self, cycle: BringUpCycle, since: Nanos) -> Option<Command> {
        if self.is_energised() {
            self.stage = Stage::Unowned;
        } else if !self.is_heard(cycle.now) {
            if age(cycle.now, since) >= NO_REPLY.0.max(self.plan.heartbeat.0.saturating_mul(4)) {
                self.fault.get_or_insert(OdriveFault::NoAnswer);
            }
        } else if cycle.other_master {
            self.fault = Some(OdriveFault::OtherMaster);
        } else if cycle.drive_target == DriveTarget::Disabled && age(cycle.now, since) >= OBSERVE_MIN.0 {
            self.fault = None;
            self.step(cycle.now, 0, false);
        } else if self.fault == Some(OdriveFault::NoAnswer) {
            self.fault = None;
        }
        None
    }

    pub(super) fn unowned(&mut self, cycle: BringUpCycle) -> Option<Command> {
        if !self.is_energised() {
            self.observe(cycle.now, None);
        } else if cycle.drive_target == DriveTarget::TorqueOff {
            return self.again(cycle.now, super::power::IDLE);
        }
        None
    }

    pub(super) fn stepping(
        &mut self,
        now: Nanos,
        (at, since, enabling): (usize, Nanos, bool),
        target: Option<AxisTarget>,
    ) -> CycleFrames {
        if self.is_energised() {
            self.stage = Stage::Unowned;
            return only(None);
        }
        let known = if self.plan.watchdog == Watchdog::Owner { 1 } else { STEPS.len() };
        let Some(step) = STEPS.get(at).copied().filter(|_| at < known) else {
            if enabling {
                return self.arm(now, target);
            }
            self.stage = Stage::Ready;
            return only(None);
        };
        match self.outcome(step) {
            Some(Ok(())) => self.step(now, at + 1, enabling),
            Some(Err((fault, numbers))) => self.refuse(enabling, fault, numbers),
            None if age(now, since) >= self.timeouts.step.0 => {
                self.refuse(enabling, OdriveFault::NoReply, [0.0; 2]);
            }
            None => return only(self.ask(now, step, enabling)),
        }
        only(None)
    }

    pub(super) fn step(&mut self, now: Nanos, at: usize, enabling: bool) {
        (self.version, self.answer, self.written, self.next) = (None, None, None, now);
        self.stage = Stage::Step { at, since: now, enabling };
    }

    /// The question of a step; what it writes goes first, once. Nothing is written on the way to energised.
    fn ask(&mut self, now: Nanos, step: Step, enabling: bool) -> Option<Command> {
        let Watchdog::Written { timeout_s, endpoints } = self.plan.watchdog else {
            return self.again(now, Command::Request(Query::Version));
        };
        let (endpoint, value) = match step {
            Step::Identity => return self.again(now, Command::Request(Query::Version)),
            Step::VelocityLimit => (endpoints.velocity_limit, None),
            Step::WatchdogTimeout => {
                (endpoints.watchdog_timeout, Some(EndpointValue::Word(timeout_s.to_le_bytes())))
            }
            Step::WatchdogOn => (endpoints.enable_watchdog, Some(EndpointValue::Byte(1))),
        };
        match (value.filter(|_| !enabling), self.written) {
            (Some(value), None) => {
                (self.written, self.next) = (Some(now), later(now, SETTLE));
                Some(Command::Write(endpoint, value))
            }
            (Some(_), Some(at)) if age(now, at) < SETTLE.0 => {
                // The confirmation of the write.
                self.answer = None;
                None
            }
            (Some(_) | None, _) => self.again(now, Command::Read(endpoint)),
        }
    }

    /// What the answer says against the settings, when there is one.
    fn outcome(&self, step: Step) -> Option<Outcome> {
        let same = |holds: bool, fault, numbers| if holds { Ok(()) } else { Err((fault, numbers)) };
        let Watchdog::Written { timeout_s, endpoints } = self.plan.watchdog else { return self.identity() };
        let value = |wanted: u16| {
            let (_, value) = self.answer.filter(|(endpoint, _)| *endpoint == wanted)?;
            Some(value.bytes())
        };
        match step {
            Step::Identity => self.identity(),
            Step::VelocityLimit => {
                let limit = f64::from(f32::from_le_bytes(value(endpoints.velocity_limit)?));
                let wanted = self.plan.speed_turns_s;
                // False for what is no number.
                Some(same(limit >= wanted * (1.0 - 1e-6), OdriveFault::VelocityLimit, [limit, wanted]))
            }
            Step::WatchdogTimeout => {
                self.written_or_enabling()?;
                let held = f32::from_le_bytes(value(endpoints.watchdog_timeout)?);
                let numbers = [held, timeout_s].map(f64::from);
                Some(same(held.to_bits() == timeout_s.to_bits(), OdriveFault::WatchdogTimeout, numbers))
            }
            Step::WatchdogOn => {
                self.written_or_enabling()?;
                let [held, ..] = value(endpoints.enable_watchdog)?;
                Some(same(held == 1, OdriveFault::WatchdogOff, [f64::from(held), 1.0]))
            }
        }
    }

    /// An answer before the value was written, and has settled, is of an earlier question.
    fn written_or_enabling(&self) -> Option<()> {
        let enabling = matches!(self.stage, Stage::Step { enabling: true, .. });
        // Asked after the write: the time of the next question has moved on.
        let settled =
            self.written.is_some_and(|at| self.next.0 > at.0.saturating_add(SETTLE.0 + REPEAT.0 / 2));
        (enabling || settled).then_some(())
    }

    fn identity(&self) -> Option<Outcome> {
        let version = self.version?;
        let (hardware, firmware) = (self.plan.hardware, self.plan.firmware);
        let differs = |fault, stated, wanted| Err((fault, [version_number(stated), version_number(wanted)]));
        Some(if version.hardware != hardware {
            differs(OdriveFault::Hardware, version.hardware, hardware)
        } else if version.firmware != firmware {
            differs(OdriveFault::Firmware, version.firmware, firmware)
        } else {
            Ok(())
        })
    }

    fn refuse(&mut self, enabling: bool, fault: OdriveFault, numbers: [f64; 2]) {
        if enabling {
            self.go(if fault == OdriveFault::NoReply { fault } else { OdriveFault::Restarted });
        } else {
            self.stage = Stage::Refused { fault, numbers };
        }
    }
}
