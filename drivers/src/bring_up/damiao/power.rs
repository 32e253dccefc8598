//! A configured Damiao motor on its way to energised, while it follows, and back.
use super::{Motor, MotorStage, MotorTarget, NO_REPLY, REPEAT, age};
use crate::bring_up::damiao_fault::DamiaoFault;
use crate::bring_up::timing::BringUpCycle;
use crate::codec::damiao_frames::{Request, STATUS_DISABLED, STATUS_ENABLED, Special};
use crate::codec::mit::MitCommand;
use crate::servo::{DriveTarget, Nanos};
use taustream_arm::DamiaoMode;

impl Motor {
    pub(super) fn ready(&mut self, now: Nanos, status: Option<u8>, rises: bool) -> Option<Request> {
        if status == Some(STATUS_ENABLED) {
            // Another master has energised it.
            self.stage = MotorStage::Unowned;
            return None;
        }
        if age(now, self.measured_at) >= NO_REPLY.0 && age(now, self.requested_at) >= NO_REPLY.0 {
            self.received = false;
            self.observe(now, Some(DamiaoFault::NoReply));
            return None;
        }
        if std::mem::take(&mut self.set_zero) {
            return Some(Request::Special(Special::SetZero, 0));
        }
        if let Some((since, next)) = self.clearing {
            if !self.in_error() {
                (self.clearing, self.fault) = (None, None);
            } else if age(now, since) >= self.timeouts.step.0 {
                self.clearing = None;
            } else if now >= next {
                self.clearing = Some((since, later(now, REPEAT)));
                return Some(Request::Special(Special::ClearError, 0));
            }
        }
        if rises && !self.in_error() && self.fault.is_none() {
            (self.requested, self.answer) = (None, None);
            self.stage = MotorStage::Verify { job: 0, since: now };
        }
        Some(Request::Refresh)
    }

    pub(super) fn arming(
        &mut self,
        now: Nanos,
        target: Option<MotorTarget>,
        since: Nanos,
    ) -> Option<Request> {
        if self.in_error() {
            self.stage = MotorStage::Ready;
            return Some(Request::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            return self.go(DamiaoFault::NoReply);
        }
        if self.measured_at <= since {
            return Some(Request::Refresh);
        }
        // False for a position that is not known.
        let near =
            target.is_some_and(|t| (t.position_rad - self.measured.position_rad).abs() <= self.near_rad);
        if !near {
            return self.go(DamiaoFault::CommandFar);
        }
        self.sent_rad = self.measured.position_rad;
        self.stage = MotorStage::Enable { since: now, next: now };
        // A command without gains first: an earlier command of the motor must not take effect.
        self.command(target, 0.0)
    }

    pub(super) fn enabling(
        &mut self,
        now: Nanos,
        status: Option<u8>,
        target: Option<MotorTarget>,
        at: (Nanos, Nanos),
    ) -> Option<Request> {
        let (since, next) = at;
        if status == Some(STATUS_ENABLED) {
            self.stage = MotorStage::Ramp { since: now };
            return self.command(target, 0.0);
        }
        if self.in_error() {
            self.stage = MotorStage::Ready;
            return Some(Request::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            self.fault = Some(DamiaoFault::EnableTimeout);
            return self.disable(now);
        }
        if now < next {
            return self.command(target, 0.0);
        }
        self.stage = MotorStage::Enable { since, next: later(now, REPEAT) };
        Some(Request::Special(Special::Enable, 0))
    }

    pub(super) fn following(
        &mut self,
        cycle: BringUpCycle,
        status: Option<u8>,
        target: Option<MotorTarget>,
    ) -> Option<Request> {
        let now = cycle.now;
        if matches!(cycle.drive_target, DriveTarget::Disabled | DriveTarget::TorqueOff) {
            return self.disable(now);
        }
        match status {
            None | Some(STATUS_ENABLED) => {}
            Some(STATUS_DISABLED) => return self.go(DamiaoFault::DroppedOut),
            Some(_) => {
                self.stage = MotorStage::Ready;
                return Some(Request::Refresh);
            }
        }
        if age(now, self.measured_at) >= NO_REPLY.0 {
            // A motor without feedback may still receive: it gets its commands until the target is `Disabled`.
            self.fault.get_or_insert(DamiaoFault::NoReply);
        }
        let ramped = |since| ratio(age(now, since), self.plan.ramp_ns());
        let share = if let MotorStage::Ramp { since } = self.stage { ramped(since) } else { 1.0 };
        if share >= 1.0 {
            self.stage = MotorStage::On;
        }
        self.command(target, share)
    }

    pub(super) fn disabling(&mut self, now: Nanos, status: Option<u8>, since: Nanos) -> Option<Request> {
        if status.is_some_and(|status| status != STATUS_ENABLED) {
            self.stage = if self.fault.is_some() { MotorStage::Gone } else { MotorStage::Ready };
            return Some(Request::Refresh);
        }
        if age(now, since) >= NO_REPLY.0 && age(now, self.measured_at) >= NO_REPLY.0 {
            self.received = false;
            self.observe(now, Some(DamiaoFault::NoReply));
            return None;
        }
        Some(Request::Special(Special::Disable, 0))
    }

    pub(super) fn gone(&mut self, cycle: BringUpCycle) -> Option<Request> {
        if cycle.drive_target == DriveTarget::Disabled {
            self.observe(cycle.now, self.fault);
        }
        // It was ours: should it be energised after all, it is not left to its last command.
        let energised = self.feedback.status == STATUS_ENABLED;
        Some(if energised { Request::Special(Special::Disable, 0) } else { Request::Refresh })
    }

    /// The emergency: in any stage, before anything else.
    pub(super) fn torque_off(&mut self, now: Nanos) -> Option<Request> {
        match self.stage {
            MotorStage::Observe { .. }
            | MotorStage::Unowned
            | MotorStage::Configure { .. }
            | MotorStage::Gone
            | MotorStage::Refused { .. } => {
                self.requested = None;
                Some(Request::Special(Special::Disable, 0))
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

    pub(super) fn disable(&mut self, now: Nanos) -> Option<Request> {
        (self.requested, self.answer, self.clearing) = (None, None, None);
        self.stage = MotorStage::Disable { since: now };
        Some(Request::Special(Special::Disable, 0))
    }

    /// The command of this cycle with this share of the gains. What is no number never becomes one: the last good
    /// angle stays.
    fn command(&mut self, target: Option<MotorTarget>, share: f64) -> Option<Request> {
        if let Some(target) = target {
            self.sent_rad = target.position_rad;
        }
        let (velocity_rad_s, torque_nm) = target.map_or((0.0, 0.0), |t| (t.velocity_rad_s, t.torque_nm));
        match self.plan.damiao.mode {
            DamiaoMode::Mit { stiffness_nm_rad, damping_nm_s_rad, .. } => {
                let command = MitCommand {
                    position_rad: self.sent_rad,
                    velocity_rad_s,
                    stiffness_nm_rad: share * stiffness_nm_rad,
                    damping_nm_s_rad: share * damping_nm_s_rad,
                    torque_nm: share * torque_nm,
                };
                command.encode(&self.plan.ranges()).map(Request::Mit)
            }
            DamiaoMode::PosVel => {
                #[expect(clippy::cast_possible_truncation, reason = "the frame has this width")]
                let (position_rad, velocity_rad_s) = (self.sent_rad as f32, self.plan.speed_rad_s as f32);
                Some(Request::PosVel { position_rad, velocity_rad_s })
            }
        }
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
