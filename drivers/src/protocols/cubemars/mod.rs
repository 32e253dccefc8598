//! `CubeMars` (T-Motor) AK motors in MIT mode.
pub mod frames;
mod sim;
mod table;

pub use sim::{CubeMarsMotor, CubeMarsParameters};
pub use table::CubeMarsTable;

use super::{CodeWords, DriverError, Registration, boxed};
use crate::motors::{MotorDriver, fault};
use taustream_arm::Settings;

/// Upper half of the error codes.
const CODES: u16 = 4;

pub(super) const REGISTRATION: Registration = Registration {
    name: "cubemars",
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

/// The master of the `CubeMars` servos of `settings.buses[bus]`; it may have none.
///
/// # Errors
/// When the settings cannot be configured in `CubeMars` motors.
pub fn driver(settings: &Settings, bus: usize) -> Result<MotorDriver<CubeMarsTable>, DriverError> {
    MotorDriver::new(settings, bus, CubeMarsTable::new)
}
