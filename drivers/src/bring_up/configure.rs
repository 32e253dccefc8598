//! What the answers to the configuration steps of a node mean.
use crate::bring_up::cia402::{Node, NodeStage, SCALE_DIFFERS};
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::plan::{Check, Step};
use crate::bring_up::scale::Contradiction;
use crate::codec::cia402_words::STATUS_ENERGISED;
use crate::codec::error_text::{ABORT_NO_OBJECT, ABORT_NO_SUBINDEX, ABORT_TIMEOUT};
use crate::codec::object;
use crate::codec::sdo_client::{SdoOutcome, SdoValue};
use crate::servo::Nanos;

impl Node {
    pub(super) fn settle_step(&mut self, now: Nanos, outcome: SdoOutcome, at: (usize, Nanos)) {
        let (index, since) = at;
        let Some(step) = self.steps.get(index).copied() else { return };
        match outcome {
            SdoOutcome::Written => self.next_step(now, index),
            SdoOutcome::Aborted(ABORT_NO_OBJECT | ABORT_NO_SUBINDEX) if step.check == Check::Scale => {
                self.compare(now, step, index, None);
            }
            SdoOutcome::Aborted(ABORT_NO_OBJECT | ABORT_NO_SUBINDEX) if step.optional => {
                self.next_step(now, index);
            }
            SdoOutcome::Aborted(code) => self.refuse(code, step.job),
            SdoOutcome::TimedOut => self.refuse(ABORT_TIMEOUT, step.job),
            SdoOutcome::Value(value) if step.check == Check::Scale => {
                match value.as_unsigned_of_any_width() {
                    Some(number) => self.compare(now, step, index, Some(number)),
                    None => self.refuse(BringUpFault::WrongWidth.code(), step.job),
                }
            }
            SdoOutcome::Value(value) => match self.check_value(now, step, since, value) {
                Ok(true) => self.next_step(now, index),
                Ok(false) => {}
                Err(fault) => self.refuse(fault.code(), step.job),
            },
        }
    }

    fn next_step(&mut self, now: Nanos, index: usize) {
        self.stage = NodeStage::Configure { step: index + 1, since: now };
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
        let Some(number) = value.as_unsigned(step.width) else { return Err(BringUpFault::WrongWidth) };
        match step.check {
            Check::Present | Check::Scale => Ok(true),
            Check::Profile402 if number & 0xFFFF == u32::from(object::PROFILE_402) => Ok(true),
            Check::Profile402 => Err(BringUpFault::NotCia402),
            Check::OffersCsp if number & object::SUPPORTS_CSP != 0 => Ok(true),
            Check::OffersCsp => Err(BringUpFault::NoCsp),
            Check::NotEnergised => {
                self.status = (number & 0xFFFF) as u16;
                if self.status & STATUS_ENERGISED == 0 {
                    return Ok(true);
                }
                self.stage = NodeStage::Unowned { next: now, fault: BringUpFault::Foreign, object: 0 };
                Ok(false)
            }
            Check::BecomesCsp if number == u32::from(object::MODE_CSP.cast_unsigned()) => Ok(true),
            Check::BecomesCsp if self.age(now, since) < self.timeouts.step.0 => Ok(false),
            Check::BecomesCsp => Err(BringUpFault::ModeNotTaken),
            Check::Position => {
                self.position = Some(number.cast_signed());
                Ok(true)
            }
            Check::Equals { value, mask } => {
                if number & mask == value & mask {
                    Ok(true)
                } else {
                    Err(BringUpFault::Foreign)
                }
            }
        }
    }
}
