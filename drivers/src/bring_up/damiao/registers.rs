//! A Damiao motor that is only looked at, and the registers that make it this master's: none is written to one that is energised.
use super::{Motor, MotorStage, OBSERVE_AGAIN, OBSERVE_MIN, REQUEST_AGAIN, SETTLE, age};
use crate::bring_up::damiao_fault::{DamiaoFault, differs, register_object};
use crate::bring_up::damiao_plan::{CONFIGURE, CheckResult, Job, VERIFY};
use crate::bring_up::timing::BringUpCycle;
use crate::codec::damiao_frames::{Request, STATUS_ENABLED, Special};
use crate::servo::{DriveTarget, Nanos};

impl Motor {
    pub(super) fn observing(
        &mut self,
        cycle: BringUpCycle,
        since: Nanos,
        status: Option<u8>,
    ) -> Option<Request> {
        match status {
            Some(STATUS_ENABLED) => self.stage = MotorStage::Unowned,
            Some(_) if cycle.other_master => self.fault = Some(DamiaoFault::OtherMaster),
            Some(_)
                if cycle.drive_target == DriveTarget::Disabled && age(cycle.now, since) >= OBSERVE_MIN.0 =>
            {
                self.fault = None;
                return self.at_job(cycle.now, 0);
            }
            None if self.requested.is_some() && age(cycle.now, self.requested_at) >= OBSERVE_AGAIN.0 => {
                self.received = false;
                self.fault.get_or_insert(DamiaoFault::NoAnswer);
            }
            Some(_) | None => {}
        }
        self.look(cycle.now)
    }

    pub(super) fn unowned(&mut self, cycle: BringUpCycle, status: Option<u8>) -> Option<Request> {
        match status {
            Some(status) if status != STATUS_ENABLED => self.observe(cycle.now, None),
            _ => {}
        }
        let look = self.look(cycle.now)?;
        // Its answer to the emergency is a feedback as good as any.
        Some(if cycle.drive_target == DriveTarget::TorqueOff {
            Request::Special(Special::Disable, 0)
        } else {
            look
        })
    }

    pub(super) fn configuring(
        &mut self,
        now: Nanos,
        status: Option<u8>,
        at: (usize, Nanos),
    ) -> Option<Request> {
        let (index, since) = at;
        if status == Some(STATUS_ENABLED) {
            self.stage = MotorStage::Unowned;
            return None;
        }
        let Some(job) = CONFIGURE.get(index).copied() else {
            self.stage = MotorStage::Ready;
            return Some(Request::Refresh);
        };
        if let Some((_, _, value)) = self.answer.take() {
            return match self.plan.check_value(job, Some(index), value) {
                CheckResult::On(steps) => self.at_job(now, index + steps),
                CheckResult::Differs => {
                    let (code, object) = differs(job.register(), value);
                    self.stage = MotorStage::Refused { code, object };
                    None
                }
            };
        }
        if age(now, since) >= self.timeouts.step.0 {
            let code = DamiaoFault::NoRegister.code();
            self.stage = MotorStage::Refused { code, object: register_object(job.register()) };
            return None;
        }
        self.request_job(now, job, since)
    }

    /// Registers and feedback alternate, so that the position stays recent.
    pub(super) fn verifying(&mut self, now: Nanos, at: (usize, Nanos)) -> Option<Request> {
        let (index, since) = at;
        let Some(job) = VERIFY.get(index).copied() else {
            self.stage = MotorStage::Arm { since: now };
            return Some(Request::Refresh);
        };
        if let Some((_, _, value)) = self.answer.take() {
            if self.plan.check_value(job, None, value) == CheckResult::Differs {
                return self.go(DamiaoFault::Restarted);
            }
            self.stage = MotorStage::Verify { job: index + 1, since: now };
            return Some(Request::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            return self.go(DamiaoFault::NoRegister);
        }
        self.request_job(now, job, since)
    }

    pub(super) fn at_job(&mut self, now: Nanos, job: usize) -> Option<Request> {
        (self.requested, self.answer) = (None, None);
        self.stage = MotorStage::Configure { job, since: now };
        None
    }

    /// Asks for the answer to a job, again when it was lost.
    fn request_job(&mut self, now: Nanos, job: Job, since: Nanos) -> Option<Request> {
        let settling = matches!(job, Job::ReadSettled(_)) && age(now, since) < SETTLE.0;
        let waiting = self.requested.is_some() && age(now, self.requested_at) < REQUEST_AGAIN.0;
        (!settling && !waiting).then(|| self.send_request(now, self.plan.request(job)))
    }
}
