//! A motor that is only looked at, and the parameters that make it this master's: none is written to one that is energised.
use super::super::fault::{differs, parameter_object};
use super::super::{AnsweringMotor, Ask, Job, MotorFault, PowerWord};
use super::{Machine, MotorStage, OBSERVE_AGAIN, OBSERVE_MIN, REQUEST_AGAIN, SEND_AGAIN_MAX, SETTLE, age};
use crate::bring_up::timing::BringUpCycle;
use crate::servo::{DriveTarget, Nanos};

/// What an answer means for the list of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CheckResult {
    /// This many jobs further.
    On(usize),
    /// The parameter holds something else.
    Differs,
}

impl<M: AnsweringMotor> Machine<M> {
    pub(super) fn observing(
        &mut self,
        cycle: BringUpCycle,
        since: Nanos,
        status: Option<PowerWord>,
    ) -> Option<Ask> {
        match status {
            Some(PowerWord::On) => self.stage = MotorStage::Unowned,
            Some(_) if cycle.other_master => self.fault = Some(MotorFault::OtherMaster),
            Some(_)
                if cycle.drive_target == DriveTarget::Disabled && age(cycle.now, since) >= OBSERVE_MIN.0 =>
            {
                self.fault = None;
                return self.at_job(cycle.now, 0);
            }
            None if self.requested.is_some() && age(cycle.now, self.requested_at) >= OBSERVE_AGAIN.0 => {
                self.received = false;
                self.fault.get_or_insert(MotorFault::NoAnswer);
            }
            Some(_) | None => {}
        }
        self.look(cycle.now)
    }

    pub(super) fn unowned(&mut self, cycle: BringUpCycle, status: Option<PowerWord>) -> Option<Ask> {
        match status {
            Some(status) if status != PowerWord::On => self.observe(cycle.now, None),
            _ => {}
        }
        let look = self.look(cycle.now)?;
        // Its answer to the emergency is a feedback as good as any.
        Some(if cycle.drive_target == DriveTarget::TorqueOff { Ask::Disable } else { look })
    }

    pub(super) fn configuring(
        &mut self,
        now: Nanos,
        status: Option<PowerWord>,
        at: (usize, Nanos),
    ) -> Option<Ask> {
        let (index, since) = at;
        if status == Some(PowerWord::On) {
            self.stage = MotorStage::Unowned;
            return None;
        }
        let Some(job) = self.motor.configure().get(index).copied() else {
            self.stage = MotorStage::Ready;
            return Some(Ask::Refresh);
        };
        if let Some(value) = self.answer.take() {
            return match self.check_value(job, value) {
                CheckResult::On(steps) => self.at_job(now, index + steps),
                // A write that is not confirmed may have been lost on the way.
                CheckResult::Differs if self.may_send_again(index, job) => self.at_job(now, index - 1),
                CheckResult::Differs => {
                    let (code, object) = differs(M::CODES, job.parameter(), value);
                    self.stage = MotorStage::Refused { code, object };
                    None
                }
            };
        }
        if age(now, since) >= self.timeouts.step.0 {
            let code = MotorFault::NoParameter.code(M::CODES);
            let object = parameter_object(M::CODES, job.parameter());
            self.stage = MotorStage::Refused { code, object };
            return None;
        }
        if let Job::Send(parameter) = job {
            self.at_job(now, index + 1);
            return Some(Ask::Write(parameter, self.motor.wanted(parameter)));
        }
        self.request_job(now, job, since)
    }

    /// Parameters and feedback alternate, so that the position stays recent.
    pub(super) fn verifying(&mut self, now: Nanos, at: (usize, Nanos)) -> Option<Ask> {
        let (index, since) = at;
        let Some(job) = self.motor.verify().get(index).copied() else {
            self.stage = MotorStage::Arm { since: now };
            return Some(Ask::Refresh);
        };
        if let Some(value) = self.answer.take() {
            if self.check_value(job, value) == CheckResult::Differs {
                return self.go(MotorFault::Restarted);
            }
            self.stage = MotorStage::Verify { job: index + 1, since: now };
            return Some(Ask::Refresh);
        }
        if age(now, since) >= self.timeouts.step.0 {
            return self.go(MotorFault::NoParameter);
        }
        self.request_job(now, job, since)
    }

    pub(super) fn at_job(&mut self, now: Nanos, job: usize) -> Option<Ask> {
        (self.requested, self.answer) = (None, None);
        self.stage = MotorStage::Configure { job, since: now };
        None
    }

    /// Asks for the answer to a job, again when it was lost.
    fn request_job(&mut self, now: Nanos, job: Job, since: Nanos) -> Option<Ask> {
        let settling = matches!(job, Job::ReadSettled(_)) && age(now, since) < SETTLE.0;
        let waiting = self.requested.is_some() && age(now, self.requested_at) < REQUEST_AGAIN.0;
        let parameter = job.parameter();
        let ask = match job {
            Job::Write(_) | Job::Send(_) => Ask::Write(parameter, self.motor.wanted(parameter)),
            Job::Read(_) | Job::ReadToSkip(..) | Job::ReadSettled(_) => Ask::Read(parameter),
        };
        (!settling && !waiting).then(|| self.send_request(now, ask))
    }

    /// The job before wrote this parameter without a confirmation, not too often yet.
    fn may_send_again(&mut self, index: usize, job: Job) -> bool {
        let before = index.checked_sub(1).and_then(|before| self.motor.configure().get(before));
        let again = before == Some(&Job::Send(job.parameter())) && self.sent_again < SEND_AGAIN_MAX;
        self.sent_again += u8::from(again);
        again
    }

    fn check_value(&self, job: Job, value: [u8; 4]) -> CheckResult {
        match (job, self.motor.agrees(job.parameter(), value)) {
            (Job::ReadToSkip(_, skipped), true) => CheckResult::On(1 + skipped),
            (Job::ReadToSkip(..), false) | (_, true) => CheckResult::On(1),
            (_, false) => CheckResult::Differs,
        }
    }
}
