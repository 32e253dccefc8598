//! Damiao motors (DM-J4310 and its family), MIT or `POS_VEL` mode.
pub mod frames;
mod sim;
mod sim_registers;
mod table;

pub use sim::{Motor, MotorParameters};
pub use table::DamiaoMotor;

use super::{CodeWords, Registration, boxed};
use crate::motors::{MotorDriver, fault};
use frames::Wire;
use taustream_arm::{BusKind, Settings};

/// Upper half of the error codes.
const CODES: u16 = 2;

pub(super) const REGISTRATION: Registration = Registration {
    name: "damiao",
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

/// The master of the Damiao servos of `settings.buses[bus]`; it may have none.
///
/// # Errors
/// When the settings cannot be configured in Damiao motors.
pub fn driver(settings: &Settings, bus: usize) -> Result<MotorDriver<DamiaoMotor>, super::DriverError> {
    let wire = settings.buses.get(bus).map_or(Wire::Classic, |bus| wire_of(bus.kind));
    MotorDriver::new(settings, bus, |servo| DamiaoMotor::new(settings, servo, wire))
}

/// The kind of frames on a bus: FD where it is an FD bus, classic on a virtual one.
const fn wire_of(kind: BusKind) -> Wire {
    match kind {
        BusKind::Virtual | BusKind::Classic { .. } => Wire::Classic,
        BusKind::Fd { .. } => Wire::Fd,
    }
}
