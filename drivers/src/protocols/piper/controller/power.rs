//! A compared Piper on its way to energised, while it follows, and back.
use super::{ArmPlan, Controller, CycleFrames, NO_REPLY, REPEAT, Stage, age, later, only};
use crate::bring_up::timing::BringUpCycle;
use crate::protocols::piper::fault::PiperFault;
use crate::protocols::piper::frames::{ALL, CONTROL_CAN, Command, JOINTS, MOVE_JOINTS};
use crate::servo::{DriveTarget, Nanos};

/// Status of an emergency stop.
const EMERGENCY_STOP: u8 = 1;

impl Controller {
    pub(super) fn ready(&mut self, now: Nanos, rises: bool) -> Option<Command> {
        if self.any_enabled() {
            self.stage = Stage::Unowned;
            return None;
        }
        if !self.is_heard(now) {
            self.forget();
            self.observe(now, Some(PiperFault::Silent));
            return None;
        }
        if let Some(number) = self.set_zero.take() {
            return Some(Command::SetZero(number));
        }
        if let Some(since) = self.clearing {
            if !self.in_error() || age(now, since) >= self.timeouts.step.0 {
                self.clearing = None;
            } else {
                let stopped = self.status.is_some_and(|(status, _)| status.arm == EMERGENCY_STOP);
                return self.again(now, if stopped { Command::Resume } else { Command::ClearErrors(ALL) });
            }
        }
        if rises && !self.in_error() && self.fault.is_none() {
            self.ask(now, 0, true);
        }
        None
    }

    pub(super) fn enabling(
        &mut self,
        now: Nanos,
        since: Nanos,
        targets: &[Option<i32>; JOINTS],
    ) -> CycleFrames {
        if self.in_error() || age(now, since) >= self.timeouts.step.0 {
            self.fault = Some(PiperFault::EnableTimeout);
            return self.disable(now);
        }
        if self.all_enabled() {
            (self.stage, self.next) = (Stage::Take { since: now }, now);
        }
        // The targets come first: an earlier one must not take effect.
        let enable = self.again(now, Command::Enable(ALL));
        self.targets(targets, enable)
    }

    pub(super) fn taking(
        &mut self,
        now: Nanos,
        since: Nanos,
        targets: &[Option<i32>; JOINTS],
    ) -> CycleFrames {
        if self.in_error() || age(now, since) >= self.timeouts.step.0 {
            self.fault = Some(PiperFault::EnableTimeout);
            return self.disable(now);
        }
        if self.takes_targets() {
            self.stage = Stage::On;
            return self.targets(targets, None);
        }
        let ArmPlan { speed_percent, follow, .. } = self.plan;
        let mode = Command::Mode { control: CONTROL_CAN, movement: MOVE_JOINTS, speed_percent, follow };
        let mode = self.again(now, mode);
        self.targets(targets, mode)
    }

    pub(super) fn following(&mut self, cycle: BringUpCycle, targets: &[Option<i32>; JOINTS]) -> CycleFrames {
        let now = cycle.now;
        if matches!(cycle.drive_target, DriveTarget::Disabled | DriveTarget::TorqueOff) {
            return self.disable(now);
        }
        if !self.takes_targets() {
            self.go(PiperFault::OtherControl);
            return only(None);
        }
        // The joints that still have torque are not dropped with the one that lost it: they get their targets until the
        // drive target says otherwise.
        if !self.all_enabled() {
            self.fault.get_or_insert(PiperFault::DroppedOut);
        }
        if !self.is_heard(now) {
            self.fault.get_or_insert(PiperFault::Silent);
        }
        self.targets(targets, None)
    }

    pub(super) fn disabling(&mut self, now: Nanos, since: Nanos) -> Option<Command> {
        if !self.is_heard(now) && age(now, since) >= NO_REPLY.0 {
            self.forget();
            self.observe(now, Some(PiperFault::Silent));
            return None;
        }
        if !self.any_enabled() {
            self.stage = Stage::Ready;
            return None;
        }
        self.again(now, Command::Disable(ALL))
    }

    pub(super) fn gone(&mut self, cycle: BringUpCycle) -> Option<Command> {
        if !matches!(cycle.drive_target, DriveTarget::Disabled | DriveTarget::TorqueOff) {
            return None;
        }
        if self.any_enabled() {
            // It was ours: it is not left to its last target.
            return self.again(cycle.now, Command::Disable(ALL));
        }
        if cycle.drive_target == DriveTarget::Disabled {
            self.observe(cycle.now, self.fault);
        }
        None
    }

    /// The emergency: in any stage, before anything else. The arm has no brakes: it falls.
    pub(super) fn torque_off(&mut self, now: Nanos) -> CycleFrames {
        match self.stage {
            Stage::Observe { .. }
            | Stage::Unowned
            | Stage::Gone
            | Stage::Refused { .. }
            | Stage::Ask { enabling: false, .. } => {
                self.next = later(now, REPEAT);
                only(Some(Command::Disable(ALL)))
            }
            Stage::Ask { .. }
            | Stage::Ready
            | Stage::Enable { .. }
            | Stage::Take { .. }
            | Stage::On
            | Stage::Disable { .. } => self.disable(now),
        }
    }

    pub(super) fn disable(&mut self, now: Nanos) -> CycleFrames {
        (self.stage, self.next) = (Stage::Disable { since: now }, later(now, REPEAT));
        (self.clearing, self.set_zero) = (None, None);
        only(Some(Command::Disable(ALL)))
    }
}
