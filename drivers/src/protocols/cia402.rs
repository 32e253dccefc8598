//! CANopen CiA 402: the line of the registry for [`crate::codec::cia402`], [`crate::bring_up`] and the simulated drives.
use super::{DriverError, Registration, boxed};
use crate::bring_up::fault;
use crate::codec::cia402::Cia402Driver;
use crate::sim::drive_settings;

pub(super) const REGISTRATION: Registration = Registration {
    name: "cia402",
    driver: |settings, bus| {
        boxed(Cia402Driver::new(settings, bus)).map_err(|error| DriverError::Protocol(error.to_string()))
    },
    simulate: drive_settings::simulate,
    simulator_keys: &drive_settings::KEYS,
    words: None,
    status: fault::status_text,
};
