//! The digital inputs of an operational drive (0x60FD), read by SDO: at once when its state or its limit bit changes, and now and then.
//!
//! They are not in its TPDO: status, position and 32 bits of inputs are more than a frame of eight bytes. A limit switch that becomes
//! active while the drive follows is a fault of the joint, by which the arm stops; the drive stays energised. One
//! that is active already is none, or no joint could be led off its switch.
use crate::bring_up::cia402::Node;
use crate::bring_up::fault::BringUpFault;
use crate::codec::cia402_words::{STATUS_ENERGISED, STATUS_LIMIT};
use crate::codec::digital_inputs::{self, NEGATIVE_LIMIT, POSITIVE_LIMIT};
use crate::codec::object;
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::Nanos;
use taustream_arm::protocol::cia402::DIGITAL_INPUTS_MS;

const AGAIN: Nanos = Nanos(DIGITAL_INPUTS_MS as u64 * 1_000_000);
/// Bits of the statusword whose change may have come from an input: the state, and the limit bit.
const CHANGES: u16 = STATUS_LIMIT | STATUS_ENERGISED | 0x006B;

/// What is known of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Inputs {
    /// Those that were active at the newest answer.
    newest: Option<u8>,
    asked: Nanos,
    /// Statusword when they were asked for.
    status: u16,
}

impl Inputs {
    /// The next answer is compared with nothing: homing leads its joint to a switch.
    pub(super) fn forget(&mut self) {
        self.newest = None;
    }
}

impl Node {
    /// Newest statusword, and above it the digital inputs that are known to be active.
    #[must_use]
    pub fn status_word(&self) -> u32 {
        u32::from(self.status) | u32::from(self.inputs.newest.unwrap_or(0)) << 16
    }

    /// Asks for the inputs when they are due.
    pub(super) fn request_inputs(&mut self, now: Nanos) {
        let changed = (self.status ^ self.inputs.status) & CHANGES != 0;
        let due = changed || self.age(now, self.inputs.asked) >= AGAIN.0;
        if self.plan.features.digital_inputs && due && self.sdo.is_idle() {
            (self.inputs.asked, self.inputs.status) = (now, self.status);
            self.sdo.begin(SdoJob::Read(object::DIGITAL_INPUTS));
        }
    }

    /// Takes the answer.
    pub(super) fn take_inputs(&mut self, outcome: SdoOutcome) {
        // Without an answer the last ones stand: that the drive is gone is found otherwise.
        let SdoOutcome::Value(value) = outcome else { return };
        let Some(number) = value.as_unsigned_of_any_width() else { return };
        let active = digital_inputs::active(number);
        let before = self.inputs.newest.replace(active);
        let risen = active & !before.unwrap_or(active);
        if self.power.is_on() && risen & NEGATIVE_LIMIT != 0 {
            self.power.note(BringUpFault::NegativeLimitSwitch);
        } else if self.power.is_on() && risen & POSITIVE_LIMIT != 0 {
            self.power.note(BringUpFault::PositiveLimitSwitch);
        }
    }
}
