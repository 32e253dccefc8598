//! All drivers of one bus behind one: a bus may carry servos of several protocols, and the cycle need not know.
use crate::bring_up::explain;
use crate::codec::cia402::{Cia402Driver, Cia402Error};
use crate::codec::damiao::{DamiaoDriver, DamiaoError};
use crate::frame::{CanFrame, CanId, FrameBatch};
use crate::servo::{DriveTarget, JointCommand, Nanos, ServoDriver, ServoStatus, ZeroRefused};
use taustream_arm::{Protocol, Settings};
use taustream_motion::MAX_JOINTS;

/// Why a bus has no driver.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DriverError {
    /// Of the CiA 402 drives.
    #[error(transparent)]
    Cia402(#[from] Cia402Error),
    /// Of the Damiao motors.
    #[error(transparent)]
    Damiao(#[from] DamiaoError),
}

/// The drivers of a bus, one for each protocol that is spoken on it. Identifiers do not meet (the settings see to that),
/// so every frame is at most one driver's, and SYNC comes from the one protocol that has it.
pub struct BusDriver {
    drivers: Vec<Box<dyn ServoDriver>>,
    joints: Vec<usize>,
}

/// The driver for every servo of `settings.buses[bus]`.
///
/// # Errors
/// When the settings cannot be configured in the servos of one of the protocols.
pub fn of_bus(settings: &Settings, bus: usize) -> Result<BusDriver, DriverError> {
    let spoken = || settings.servos.iter().filter(|servo| servo.bus == bus).map(|servo| servo.protocol);
    let mut drivers: Vec<Box<dyn ServoDriver>> = Vec::new();
    if spoken().any(|protocol| matches!(protocol, Protocol::Cia402(_))) {
        drivers.push(Box::new(Cia402Driver::new(settings, bus)?));
    }
    if spoken().any(|protocol| matches!(protocol, Protocol::Damiao(_))) {
        drivers.push(Box::new(DamiaoDriver::new(settings, bus)?));
    }
    let joints = drivers.iter().flat_map(|driver| driver.joints()).copied().collect();
    Ok(BusDriver { drivers, joints })
}

impl ServoDriver for BusDriver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        for driver in &mut self.drivers {
            driver.encode(now, drive_target, commands, out);
        }
    }

    fn decode(&mut self, now: Nanos, frame: &CanFrame) {
        for driver in &mut self.drivers {
            driver.decode(now, frame);
        }
    }

    fn joints(&self) -> &[usize] {
        &self.joints
    }

    fn status(&self, joint: usize) -> ServoStatus {
        let driver = self.drivers.iter().find(|driver| driver.joints().contains(&joint));
        driver.map_or(ServoStatus::UNKNOWN, |driver| driver.status(joint))
    }

    fn clear_faults(&mut self) {
        self.drivers.iter_mut().for_each(|driver| driver.clear_faults());
    }

    fn start_over(&mut self) {
        self.drivers.iter_mut().for_each(|driver| driver.start_over());
    }

    fn set_zero(&mut self, joint: usize) -> Result<(), ZeroRefused> {
        let driver = self.drivers.iter_mut().find(|driver| driver.joints().contains(&joint));
        driver.map_or(Err(ZeroRefused::NoSuchJoint), |driver| driver.set_zero(joint))
    }

    fn other_master(&self) -> Option<CanId> {
        self.drivers.iter().find_map(|driver| driver.other_master())
    }

    fn explain(&self, error_code: u32) -> String {
        explain(error_code)
    }
}
