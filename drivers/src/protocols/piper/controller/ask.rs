//! A Piper that is only received, and the questions that make it this master's: nothing is changed in one that is energised.
use super::{Controller, NO_REPLY, OBSERVE_MIN, Stage, age};
use crate::bring_up::timing::BringUpCycle;
use crate::protocols::piper::fault::{LimitKind, PiperFault, limit_object};
use crate::protocols::piper::frames::{ALL, CONTROL_CAN, Command, JOINTS};
use crate::servo::{DriveTarget, Nanos};

/// How the firmware's name begins.
const FIRMWARE_BEGINS: &[u8] = b"S-V";

/// What does not fit: the finding, the limit and its two numbers.
pub(super) type Misfit = (PiperFault, u32, [f64; 2]);

impl Controller {
    pub(super) fn observing(&mut self, cycle: BringUpCycle, since: Nanos) -> Option<Command> {
        if self.any_enabled() {
            self.stage = Stage::Unowned;
        } else if !self.is_heard(cycle.now) {
            if age(cycle.now, since) >= NO_REPLY.0 {
                self.fault = Some(PiperFault::NoAnswer);
            }
        } else if cycle.other_master {
            self.fault = Some(PiperFault::OtherMaster);
        } else if cycle.drive_target == DriveTarget::Disabled && age(cycle.now, since) >= OBSERVE_MIN.0 {
            self.fault = None;
            self.ask(cycle.now, 0, false);
        } else if self.fault == Some(PiperFault::NoAnswer) {
            self.fault = None;
        }
        None
    }

    pub(super) fn unowned(&mut self, cycle: BringUpCycle) -> Option<Command> {
        if !self.any_enabled() {
            self.observe(cycle.now, None);
        } else if cycle.drive_target == DriveTarget::TorqueOff {
            return self.again(cycle.now, Command::Disable(ALL));
        }
        None
    }

    /// The questions one after another: joints 1 to 6, then the firmware.
    pub(super) fn asking(
        &mut self,
        now: Nanos,
        (question, since, enabling): (usize, Nanos, bool),
        targets: &[Option<i32>; JOINTS],
    ) -> Option<Command> {
        if self.any_enabled() {
            self.stage = Stage::Unowned;
            return None;
        }
        let Some(answer) = self.answer(question) else {
            if age(now, since) >= self.timeouts.step.0 {
                self.refuse(enabling, question, (PiperFault::NoReply, 0, [0.0; 2]));
                return None;
            }
            let number = u8::try_from(question + 1).unwrap_or(ALL);
            let asks = if question < JOINTS { Command::AskLimits(number) } else { Command::AskFirmware };
            let sent = self.again(now, asks);
            if sent == Some(Command::AskFirmware) {
                self.firmware.1 = 0;
            }
            return sent;
        };
        if let Some(misfit) = answer {
            self.refuse(enabling, question, misfit);
        } else if question < JOINTS {
            self.ask(now, question + 1, enabling);
        } else if enabling {
            self.arm(now, targets);
        } else {
            self.stage = Stage::Ready;
        }
        None
    }

    /// What the answer to a question says against the settings, when there is one.
    pub(super) fn answer(&self, question: usize) -> Option<Option<Misfit>> {
        let Some(([least_rad, most_rad], speed_rad_s)) = self.plan.joints.get(question).copied() else {
            let (text, used) = self.firmware;
            let text = text.get(..used)?;
            let begins = text.windows(FIRMWARE_BEGINS.len()).position(|part| part == FIRMWARE_BEGINS)?;
            let name = text.get(begins..begins + self.plan.firmware.len())?;
            return Some((name != self.plan.firmware).then_some((PiperFault::Firmware, 0, [0.0; 2])));
        };
        let limits = self.answered.filter(|limits| usize::from(limits.joint) == question + 1)?;
        let [own_least_rad, own_most_rad] = limits.range_rad();
        // A tenth of a degree is what the answer can say.
        let step_rad = 0.1_f64.to_radians();
        let differs = |kind, numbers| Some(Some((PiperFault::Limits, limit_object(kind), numbers)));
        if own_least_rad > least_rad + step_rad {
            differs(LimitKind::Least, [own_least_rad, least_rad])
        } else if own_most_rad < most_rad - step_rad {
            differs(LimitKind::Most, [own_most_rad, most_rad])
        } else if limits.speed_rad_s() < speed_rad_s - 1e-3 {
            differs(LimitKind::Speed, [limits.speed_rad_s(), speed_rad_s])
        } else {
            Some(None)
        }
    }

    pub(super) fn refuse(&mut self, enabling: bool, joint: usize, (fault, object, numbers): Misfit) {
        if enabling {
            let fault = if fault == PiperFault::NoReply { fault } else { PiperFault::Restarted };
            self.fault = Some(fault);
            self.stage = Stage::Gone;
        } else {
            self.stage = Stage::Refused { joint, fault, object, numbers };
        }
    }

    /// The last look before the joints are energised: commands are where the arm stands.
    pub(super) fn arm(&mut self, now: Nanos, targets: &[Option<i32>; JOINTS]) {
        let near = targets.iter().zip(&self.joints).all(|(target, joint)| {
            let (Some(target), Some((angle, at))) = (target, joint.angle) else { return false };
            age(now, at) <= self.timeouts.feedback.0
                && target.abs_diff(angle) <= self.near_mdeg.unsigned_abs()
        });
        let control = self.status.map_or(0, |(status, _)| status.control);
        if !near {
            self.go(PiperFault::CommandFar);
        } else if control > CONTROL_CAN {
            self.go(PiperFault::OtherControl);
        } else {
            self.sent_mdeg = self.joints.map(|joint| joint.angle.map_or(0, |(angle, _)| angle));
            (self.stage, self.next) = (Stage::Enable { since: now }, now);
        }
    }

    pub(super) fn ask(&mut self, now: Nanos, question: usize, enabling: bool) {
        (self.answered, self.next) = (None, now);
        self.firmware.1 = 0;
        self.stage = Stage::Ask { question, since: now, enabling };
    }
}
