//! `MyActuator` RMD motors (X series, protocol V4), motion mode or position mode.
//!
//! Source: "Servo Motor Control Protocol", V4.2 and V4.3, sections 2, 3 and 5. Nothing here was tried on a motor.
pub mod frames;
mod sim;
mod table;

pub use sim::{Motor, MotorParameters};
pub use table::MyActuatorMotor;

use super::{CodeWords, Registration, boxed};
use crate::motors::{MotorDriver, fault};
use taustream_arm::Settings;

/// Upper half of the error codes.
const CODES: u16 = 5;

pub(super) const REGISTRATION: Registration = Registration {
    name: "myactuator",
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

/// The master of the `MyActuator` servos of `settings.buses[bus]`; it may have none.
///
/// # Errors
/// When the settings cannot be configured in such motors.
pub fn driver(settings: &Settings, bus: usize) -> Result<MotorDriver<MyActuatorMotor>, super::DriverError> {
    MotorDriver::new(settings, bus, |servo| MyActuatorMotor::new(settings, servo))
}
