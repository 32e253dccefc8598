//! What the answers to the configuration steps of a node mean.
use crate::bring_up::cia402::{Node, NodeStage, SCALE_DIFFERS};
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::scale::Contradiction;
use crate::bring_up::steps::{self, Check, Parts, Step};
use crate::codec::canopen::PDO_DISABLED;
use crate::codec::cia402_words::STATUS_ENERGISED;
use crate::codec::error_text::{ABORT_TIMEOUT, is_of_the_transfer};
use crate::codec::sdo_client::{SdoOutcome, SdoValue};
use crate::servo::Nanos;

impl Node {
    pub(super) fn settle_step(&mut self, now: Nanos, outcome: SdoOutcome, at: (usize, Nanos)) {
        let (index, since) = at;
        let Some(step) = self.steps.get(index).copied() else { return };
        match outcome {
            SdoOutcome::Written => {
                self.differs = self.differs.with(step.marks);
                self.next_step(now, index);
            }
            SdoOutcome::Aborted(code) => self.step_refused(now, step, index, code),
            SdoOutcome::TimedOut => self.refuse(ABORT_TIMEOUT, step.job),
            SdoOutcome::Value(value) if step.check == Check::Scale => match step.number(value) {
                Some(number) => self.compare(now, step, index, Some(number)),
                None => self.refuse(BringUpFault::WrongWidth.code(), step.job),
            },
            SdoOutcome::Value(value) => match self.check_value(now, step, since, value) {
                Ok(true) => self.next_step(now, index),
                Ok(false) => {}
                Err(fault) => self.refuse(fault.code(), step.job),
            },
        }
    }

    /// An abort: no code says reliably whether the object is absent, fixed or of another kind.
    fn step_refused(&mut self, now: Nanos, step: Step, index: usize, code: u32) {
        if is_of_the_transfer(code) {
            self.refuse(code, step.job);
        } else if step.check == Check::Scale {
            self.compare(now, step, index, None);
        } else if let Check::Compare { part, first, .. } = step.check {
            self.note_difference(part, first);
            self.there = None;
            self.next_step(now, index);
        } else if step.may_be_refused(self.there) {
            self.note_fixed_pdo(step);
            self.next_step(now, index);
        } else {
            self.refuse(code, step.job);
        }
    }

    /// To the next step that is due.
    fn next_step(&mut self, now: Nanos, index: usize) {
        let rest = self.steps.iter().enumerate().skip(index + 1);
        let due = rest.filter(|(_, step)| self.differs.meets(step.when)).map(|(at, _)| at).next();
        self.stage = NodeStage::Configure { step: due.unwrap_or(self.steps.len()), since: now };
    }

    /// A PDO that is not needed, and stays on.
    fn note_fixed_pdo(&mut self, step: Step) {
        if self.there.is_some_and(|cob_id| step.is_own(cob_id) && cob_id & PDO_DISABLED == 0) {
            self.fixed_pdos.note(step.job.address().index);
        }
    }

    fn note_difference(&mut self, part: Parts, first: bool) {
        let earlier = if first { Parts::NONE } else { self.differs };
        self.differs = earlier.with(part);
    }

    /// Holds what the drive states about its scale against the settings; none where it does not have the object.
    fn compare(&mut self, now: Nanos, step: Step, index: usize, value: Option<u32>) {
        match self.stated.take(step.job.address(), value, &self.plan.scale) {
            Ok(()) => self.next_step(now, index),
            Err(Contradiction { object, stated, expected }) => {
                self.numbers = [stated, expected];
                self.stage = NodeStage::Refused { code: SCALE_DIFFERS, object: object.packed() };
            }
        }
    }

    /// Whether the value lets the plan continue; false asks again, or the stage has changed.
    fn check_value(
        &mut self,
        now: Nanos,
        step: Step,
        since: Nanos,
        value: SdoValue,
    ) -> Result<bool, BringUpFault> {
        let Some(number) = step.number(value) else { return Err(BringUpFault::WrongWidth) };
        if let Check::Equals { value: expected, .. } = step.check {
            self.numbers = [f64::from(number), f64::from(expected)];
        }
        if matches!(step.check, Check::AtLeast(_))
            && let Some(profile) = &self.plan.profile
        {
            self.numbers = profile.numbers(step.job.address(), number);
        }
        if matches!(step.check, Check::RatedTorque(..))
            && let Some(torque) = &self.plan.torque
        {
            self.numbers = [f64::from(number) * 1e-3, torque.rated_nm];
        }
        steps::passes(step.check, number)?;
        match step.check {
            Check::NotEnergised => {
                self.status = (number & 0xFFFF) as u16;
                if self.status & STATUS_ENERGISED == 0 {
                    return Ok(true);
                }
                self.stage = NodeStage::Unowned { next: now, fault: BringUpFault::Foreign, object: 0 };
                Ok(false)
            }
            Check::Becomes(mode) | Check::MayBe(mode) => {
                self.mode.is_right = number == u32::from(mode);
                let waits = matches!(step.check, Check::Becomes(_)) && !self.mode.is_right;
                if waits && self.age(now, since) >= self.timeouts.step.0 {
                    return Err(BringUpFault::ModeNotTaken);
                }
                Ok(!waits)
            }
            Check::Position => {
                self.position = Some(number.cast_signed());
                Ok(true)
            }
            Check::Compare { value, mask, part, first } => {
                self.there = Some(number);
                let differs = number & mask != value & mask;
                self.note_difference(if differs { part } else { Parts::NONE }, first);
                Ok(true)
            }
            Check::Present
            | Check::Profile402
            | Check::Offers(_)
            | Check::Scale
            | Check::OffOrOwn(_)
            | Check::AtLeast(_)
            | Check::RatedTorque(..)
            | Check::Equals { .. } => Ok(true),
        }
    }
}
