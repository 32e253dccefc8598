//! A configured `ODrive` on its way to energised, while it follows, and back.
use super::{Axis, AxisTarget, CycleFrames, NO_REPLY, Stage, age, later, only};
use crate::bring_up::timing::BringUpCycle;
use crate::protocols::odrive::fault::OdriveFault;
use crate::protocols::odrive::frames::{
    CONTROL_POSITION, Command, ERROR_WATCHDOG, INPUT_PASSTHROUGH, InputPosition, STATE_CLOSED_LOOP,
    STATE_IDLE,
};
use crate::servo::{DriveTarget, Nanos};

pub(super) const IDLE: Command = Command::AxisState(STATE_IDLE as u32);
const CLOSED_LOOP: Command = Command::AxisState(STATE_CLOSED_LOOP as u32);
/// A heartbeat that still says "idle" so long after closed loop was requested, and two of its periods, is true.
const TAKEN: Nanos = Nanos(100_000_000);

impl Axis {
    /// The last look before the drive is energised: its command is where it stands.
    pub(super) fn arm(&mut self, now: Nanos, target: Option<AxisTarget>) -> CycleFrames {
        let stands = self.estimates.filter(|estimates| age(now, estimates.at) <= self.timeouts.feedback.0);
        let near = stands.zip(target).is_some_and(|(estimates, target)| {
            (target.position_turns - f64::from(estimates.position_turns)).abs() <= self.near_turns
        });
        let Some(estimates) = stands.filter(|_| near) else {
            self.go(OdriveFault::CommandFar);
            return only(None);
        };
        self.lost_master = false;
        self.sent =
            InputPosition { position_turns: estimates.position_turns, velocity_mturns_s: 0, torque_mnm: 0 };
        self.stage = Stage::Enable { since: now, requested: now };
        self.request(target)
    }

    /// Closed loop, after everything that must hold when it begins: an earlier setpoint must not take effect.
    fn request(&mut self, target: Option<AxisTarget>) -> CycleFrames {
        // An idle drive has not been fed; its watchdog is the only error that it may have here.
        let expired = self.heartbeat.is_some_and(|heartbeat| heartbeat.errors & ERROR_WATCHDOG != 0);
        let clear = expired.then_some(Command::ClearErrors);
        let mode = Command::ControllerMode(CONTROL_POSITION, INPUT_PASSTHROUGH);
        [Some(self.setpoint(target)), Some(mode), clear, Some(CLOSED_LOOP)]
    }

    pub(super) fn ready(&mut self, now: Nanos, rises: bool) -> Option<Command> {
        if self.is_energised() {
            // Another master has energised it.
            self.stage = Stage::Unowned;
            return None;
        }
        if !self.is_heard(now) {
            self.forget();
            self.observe(now, Some(OdriveFault::Silent));
            return None;
        }
        if let Some(since) = self.clearing {
            if self.errors() != 0 && age(now, since) < self.timeouts.step.0 {
                return self.again(now, Command::ClearErrors);
            }
            self.clearing = None;
        }
        if rises && self.errors() == 0 && self.fault.is_none() {
            self.step(now, 0, true);
        }
        None
    }

    pub(super) fn enabling(
        &mut self,
        now: Nanos,
        (since, requested): (Nanos, Nanos),
        target: Option<AxisTarget>,
    ) -> CycleFrames {
        if self.is_following() {
            self.stage = Stage::On;
        } else if self.errors() != 0 {
            self.stage = Stage::Ready;
            return only(Some(IDLE));
        } else if age(now, since) >= self.timeouts.step.0 {
            self.fault = Some(OdriveFault::EnableTimeout);
            return only(Some(self.disable(now)));
        } else {
            // Requested again only when it was not taken: a second request would interrupt the first.
            let wait = TAKEN.0.max(self.plan.heartbeat.0.saturating_mul(2));
            let taken = later(requested, Nanos(wait));
            if self.heartbeat.is_some_and(|heartbeat| heartbeat.at >= taken) {
                self.stage = Stage::Enable { since, requested: now };
                return self.request(target);
            }
        }
        only(Some(self.setpoint(target)))
    }

    pub(super) fn following(&mut self, cycle: BringUpCycle, target: Option<AxisTarget>) -> Option<Command> {
        let now = cycle.now;
        if matches!(cycle.drive_target, DriveTarget::Disabled | DriveTarget::TorqueOff) {
            return Some(self.disable(now));
        }
        if !self.is_following() {
            let expired = self.heartbeat.is_some_and(|heartbeat| heartbeat.errors & ERROR_WATCHDOG != 0);
            self.lost_master = expired;
            if self.errors() == 0 {
                self.go(OdriveFault::DroppedOut);
            } else {
                self.stage = Stage::Ready;
            }
            return None;
        }
        if !self.is_heard(now) {
            // A drive that is not heard may still receive: it gets its setpoints until the target is `Disabled`.
            self.fault.get_or_insert(OdriveFault::Silent);
        }
        Some(self.setpoint(target))
    }

    pub(super) fn disabling(&mut self, now: Nanos, since: Nanos) -> Option<Command> {
        if self.heartbeat.is_some_and(|heartbeat| heartbeat.at > since) && !self.is_energised() {
            self.stage = if self.fault.is_some() { Stage::Gone } else { Stage::Ready };
            return None;
        }
        if !self.is_heard(now) && age(now, since) >= NO_REPLY.0 {
            self.forget();
            self.observe(now, Some(OdriveFault::Silent));
            return None;
        }
        self.again(now, IDLE)
    }

    pub(super) fn gone(&mut self, cycle: BringUpCycle) -> Option<Command> {
        if self.is_energised() {
            // It was ours: it is not left to its last setpoint.
            return self.again(cycle.now, IDLE);
        }
        if cycle.drive_target == DriveTarget::Disabled {
            self.observe(cycle.now, self.fault);
        }
        None
    }

    /// The emergency: in any stage, before anything else.
    pub(super) fn torque_off(&mut self, now: Nanos) -> Command {
        match self.stage {
            Stage::Observe { .. }
            | Stage::Unowned
            | Stage::Gone
            | Stage::Refused { .. }
            | Stage::Step { enabling: false, .. } => {
                self.next = later(now, super::REPEAT);
                IDLE
            }
            Stage::Step { .. } | Stage::Ready | Stage::Enable { .. } | Stage::On | Stage::Disable { .. } => {
                self.disable(now)
            }
        }
    }

    pub(super) fn disable(&mut self, now: Nanos) -> Command {
        self.clearing = None;
        (self.stage, self.next) = (Stage::Disable { since: now }, later(now, super::REPEAT));
        IDLE
    }

    /// The setpoint of this cycle. What is no number never becomes one: the last good position stays.
    fn setpoint(&mut self, target: Option<AxisTarget>) -> Command {
        let input = target.and_then(|target| {
            InputPosition::new(target.position_turns, target.velocity_turns_s, target.torque_nm)
        });
        let rests = InputPosition { velocity_mturns_s: 0, torque_mnm: 0, ..self.sent };
        self.sent = input.unwrap_or(rests);
        Command::Position(self.sent)
    }
}
