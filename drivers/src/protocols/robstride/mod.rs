//! `RobStride` motors (RS00 to RS06) in their private protocol.
mod fault_words;
pub mod frames;
mod parameters;
mod sim;
mod table;

pub use sim::{RobStrideMotor, RobStrideParameters};
pub use table::RobStrideTable;

use super::{CodeWords, DriverError, Registration, boxed};
use crate::motors::{MotorDriver, fault};
use taustream_arm::Settings;

/// Upper half of the error codes.
const CODES: u16 = 3;

pub(super) const REGISTRATION: Registration = Registration {
    name: "robstride",
    driver: |settings, bus| boxed(driver(settings, bus)),
    simulate: sim::simulate,
    simulator_keys: &sim::KEYS,
    words: Some(CodeWords {
        codes: CODES,
        explain: |code, has_cable| fault::explain(&table::WORDS, code, has_cable),
        explain_refusal: |refusal| fault::explain_refusal(&table::WORDS, refusal.code, refusal.object),
    }),
    status: table::status_text,
};

/// The master of the `RobStride` servos of `settings.buses[bus]`; it may have none.
///
/// # Errors
/// When the settings cannot be configured in `RobStride` motors.
pub fn driver(settings: &Settings, bus: usize) -> Result<MotorDriver<RobStrideTable>, DriverError> {
    MotorDriver::new(settings, bus, RobStrideTable::new)
}
