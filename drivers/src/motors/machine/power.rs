//! A configured motor on its way to energised, while it follows, and back.
use super::super::{AnsweringMotor, Ask, MotorCommand, MotorFault, PowerWord};
use super::{Machine, MotorStage, MotorTarget, NO_REPLY, REPEAT, age};
use crate::bring_up::timing::BringUpCycle;
use crate::servo::{DriveTarget, Nanos};

impl<M: AnsweringMotor> Machine<M> {
    pub(super) fn ready(&mut self, now: Nanos, status: Option<PowerWord>, rises: bool) -> Option<Ask> {
        if status == Some(PowerWord::On) {
            // Another master has energised it.
            self.stage = MotorStage::Unowned;
            return None;
        }
        if age(now, self.measured_at) >= NO_REPLY.0 && age(now, self.requested_at) >= NO_REPLY.0 {
            self.received = false;
            self.observe(now, Some(MotorFault::NoReply));
            return None;
        }
        if std::mem::take(&mut self.set_zero) {
            return Some(Ask::SetZero);
        }
        if let Some((since, next)) = self.clearing {
            if !self.in_error() {
                (self.clearing, self.fault) = (None, None);
            } else if age(now, since) >= self.timeouts.step.0 {
                self.clearing = None;
            } else if now >= next {
                self.clearing = Some((since, later(now, REPEAT)));
                return Some(Ask::ClearError);
            }
        }
        if rises && !self.in_error() && self.fault.is_none() {
            (self.requested, self.answer) = (None, None);
            self.stage = MotorStage::Verify { job: 0, since: now };
        }
        Some(Ask::Refresh)
    }

    pub(super) fn arming(&mut self, now: Nanos, target: Option<MotorTarget>, since: Nanos) -> Option<Ask> {
        if self.in_error() {
            self.stage = MotorStage::Ready;
            return Some(Ask::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            return self.go(MotorFault::NoReply);
        }
        if self.measured_at <= since {
            return Some(Ask::Refresh);
        }
        // False for a position that is not known.
        let near =
            target.is_some_and(|t| (t.position_rad - self.measured.position_rad).abs() <= self.near_rad);
        if !near {
            return self.go(MotorFault::CommandFar);
        }
        self.sent_rad = self.measured.position_rad;
        self.stage = MotorStage::Enable { since: now, next: now };
        Some(if M::COMMAND_BEFORE_ENABLE { self.command(target, 0.0) } else { Ask::Refresh })
    }

    pub(super) fn enabling(
        &mut self,
        now: Nanos,
        status: Option<PowerWord>,
        target: Option<MotorTarget>,
        at: (Nanos, Nanos),
    ) -> Option<Ask> {
        let (since, next) = at;
        if status == Some(PowerWord::On) {
            self.stage = MotorStage::Ramp { since: now };
            return Some(self.command(target, 0.0));
        }
        if self.in_error() {
            self.stage = MotorStage::Ready;
            return Some(Ask::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            self.fault = Some(MotorFault::EnableTimeout);
            return self.disable(now);
        }
        if now < next {
            return Some(if M::COMMAND_BEFORE_ENABLE { self.command(target, 0.0) } else { Ask::Refresh });
        }
        self.stage = MotorStage::Enable { since, next: later(now, REPEAT) };
        Some(Ask::Enable)
    }

    pub(super) fn following(
        &mut self,
        cycle: BringUpCycle,
        status: Option<PowerWord>,
        target: Option<MotorTarget>,
    ) -> Option<Ask> {
        let now = cycle.now;
        if matches!(cycle.drive_target, DriveTarget::Disabled | DriveTarget::TorqueOff) {
            return self.disable(now);
        }
        match status {
            None | Some(PowerWord::On) => {}
            Some(PowerWord::Off) => return self.go(MotorFault::DroppedOut),
            Some(_) => {
                self.stage = MotorStage::Ready;
                return Some(Ask::Refresh);
            }
        }
        if age(now, self.measured_at) >= NO_REPLY.0 {
            // A motor without feedback may still receive: it gets its commands until the target is `Disabled`.
            self.fault.get_or_insert(MotorFault::NoReply);
        }
        let ramped = |since| ratio(age(now, since), self.motor.ramp_ns());
        let share = if let MotorStage::Ramp { since } = self.stage { ramped(since) } else { 1.0 };
        if share >= 1.0 {
            self.stage = MotorStage::On;
        }
        Some(self.command(target, share))
    }

    pub(super) fn disabling(&mut self, now: Nanos, status: Option<PowerWord>, since: Nanos) -> Option<Ask> {
        if status.is_some_and(|status| status != PowerWord::On) {
            self.stage = if self.fault.is_some() { MotorStage::Gone } else { MotorStage::Ready };
            return Some(Ask::Refresh);
        }
        if age(now, since) >= NO_REPLY.0 && age(now, self.measured_at) >= NO_REPLY.0 {
            self.received = false;
            self.observe(now, Some(MotorFault::NoReply));
            return None;
        }
        Some(Ask::Disable)
    }

    pub(super) fn gone(&mut self, cycle: BringUpCycle) -> Option<Ask> {
        if cycle.drive_target == DriveTarget::Disabled {
            self.observe(cycle.now, self.fault);
        }
        // It was ours: should it be energised after all, it is not left to its last command.
        let energised = self.feedback.power == PowerWord::On;
        Some(if energised { Ask::Disable } else { Ask::Refresh })
    }

    /// The emergency: in any stage, before anything else.
    pub(super) fn torque_off(&mut self, now: Nanos) -> Option<Ask> {
        match self.stage {
            MotorStage::Observe { .. }
            | MotorStage::Unowned
            | MotorStage::Configure { .. }
            | MotorStage::Gone
            | MotorStage::Refused { .. } => {
                self.requested = None;
                Some(Ask::Disable)
            }
            MotorStage::Ready
            | MotorStage::Verify { .. }
            | MotorStage::Arm { .. }
            | MotorStage::Enable { .. }
            | MotorStage::Ramp { .. }
            | MotorStage::On
            | MotorStage::Disable { .. } => self.disable(now),
        }
    }

    pub(super) fn disable(&mut self, now: Nanos) -> Option<Ask> {
        (self.requested, self.answer, self.clearing) = (None, None, None);
        self.stage = MotorStage::Disable { since: now };
        Some(Ask::Disable)
    }

    /// The command of this cycle with this share of the gains. What is no number never becomes one: the last good
    /// angle stays.
    fn command(&mut self, target: Option<MotorTarget>, gain_share: f64) -> Ask {
        if let Some(target) = target {
            self.sent_rad = target.position_rad;
        }
        let (velocity_rad_s, torque_nm) = target.map_or((0.0, 0.0), |t| (t.velocity_rad_s, t.torque_nm));
        Ask::Command(MotorCommand {
            position_rad: self.sent_rad,
            velocity_rad_s,
            torque_nm: gain_share * torque_nm,
            gain_share,
        })
    }
}

const fn later(now: Nanos, by: Nanos) -> Nanos {
    Nanos(now.0.saturating_add(by.0))
}

/// `part` of `whole`, at most 1.
fn ratio(part: u64, whole: u64) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "2^53 ns are 104 days")]
    let (part, whole_ns) = (part as f64, whole as f64);
    if whole == 0 { 1.0 } else { (part / whole_ns).min(1.0) }
}
