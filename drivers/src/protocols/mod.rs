//! Every servo protocol, and all drivers of one bus behind one: a bus may carry servos of several protocols, and the cycle
//! need not know.
//!
//! A protocol is a folder here (frames, bring-up, simulated servo, words for its errors) and one line in `REGISTRY`; its
//! keys are a file of `taustream_arm::protocol`. A servo whose motor answers each command is a table for
//! [`crate::motors`]; any other implements [`ServoDriver`] itself.
//!
//! [`crate::ServoStatus::error_code`] tells by its upper half whose it is: 0 are the emergency codes of CiA 402, 1 what the
//! master finds wrong with such a drive, 2 and more those of the protocols here in the order of their arrival, and SDO
//! abort codes begin at 0x503.
mod cia402;
pub mod cubemars;
pub mod damiao;
pub mod myactuator;
pub mod odrive;
pub mod piper;
pub mod robstride;

use crate::bring_up::Refusal;
use crate::frame::{CanFrame, CanId, FrameBatch};
use crate::motors::fault::codes_of;
use crate::servo::{DriveTarget, JointCommand, Nanos, ServoDriver, ServoStatus, ZeroRefused};
use crate::sim::model::ModelParameters;
use crate::sim::settings::SimulatedJoint;
use taustream_arm::Settings;
use taustream_motion::MAX_JOINTS;

/// Every protocol.
pub(crate) const REGISTRY: [Registration; 7] = [
    cia402::REGISTRATION,
    damiao::REGISTRATION,
    odrive::REGISTRATION,
    piper::REGISTRATION,
    robstride::REGISTRATION,
    cubemars::REGISTRATION,
    myactuator::REGISTRATION,
];

/// What a protocol brings.
pub(crate) struct Registration {
    /// Its name in settings files.
    pub(crate) name: &'static str,
    /// The master of its servos on a bus.
    pub(crate) driver: fn(&Settings, usize) -> Result<BoxedDriver, DriverError>,
    /// A simulated servo, as the section `[simulator]` has it.
    pub(crate) simulate: fn(&SimulatedJoint<'_>) -> Box<dyn ModelParameters>,
    /// Its own keys of that section.
    pub(crate) simulator_keys: &'static [&'static str],
    /// Words for its error codes; none of CiA 402, whose codes have several upper halves ([`crate::bring_up::fault`]).
    pub(crate) words: Option<CodeWords>,
    /// A status word as text.
    pub(crate) status: fn(u32) -> String,
}

/// Words for the error codes of a protocol.
pub(crate) struct CodeWords {
    /// Upper half of its codes.
    pub(crate) codes: u16,
    /// The sentence for a code, on a link that has a cable or none.
    pub(crate) explain: fn(u32, bool) -> String,
    /// The sentence for a refused parameter.
    pub(crate) explain_refusal: fn(&Refusal) -> String,
}

/// Words for an error code; none for those of CiA 402.
pub(crate) fn of_code(code: u32) -> Option<&'static CodeWords> {
    words_of(u16::try_from(code >> 16).ok()?)
}

/// Words for a refused object; none for those of CiA 402.
pub(crate) fn of_object(object: u32) -> Option<&'static CodeWords> {
    words_of(codes_of(object)?)
}

fn words_of(codes: u16) -> Option<&'static CodeWords> {
    REGISTRY.iter().filter_map(|known| known.words.as_ref()).find(|words| words.codes == codes)
}

/// Why a bus has no driver.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DriverError {
    /// There is no such bus.
    #[error("bus {bus} was requested, but the settings have {buses}")]
    NoSuchBus {
        /// Index asked for.
        bus: usize,
        /// How many there are.
        buses: usize,
    },
    /// More joints than an arm may have, or a joint that the robot does not have.
    #[error("joint {} of the servos is not one of the {joints} joints of the robot", joint + 1)]
    JointBeyond {
        /// Index of the joint.
        joint: usize,
        /// Joints of the robot.
        joints: usize,
    },
    /// The protocol has no such number.
    #[error("joint {} has node id {node_id}; {words}", joint + 1)]
    NodeId {
        /// Index of the joint.
        joint: usize,
        /// Its node id.
        node_id: u8,
        /// Which ids there are: "Damiao motors have 1 to 15".
        words: &'static str,
    },
    /// A time or distance of the settings is not usable.
    #[error("supervision.{key} = {value}: expected a positive number")]
    Supervision {
        /// Its key.
        key: &'static str,
        /// Its value.
        value: f64,
    },
    /// Of one protocol alone.
    #[error("{0}")]
    Protocol(String),
}

/// A driver behind the trait.
type BoxedDriver = Box<dyn ServoDriver>;

fn boxed<D: ServoDriver + 'static, E>(driver: Result<D, E>) -> Result<BoxedDriver, E> {
    driver.map(|driver| Box::new(driver) as BoxedDriver)
}

/// The drivers of a bus, one for each protocol that is spoken on it. Identifiers do not meet (the settings see to that),
/// so every frame is at most one driver's, and SYNC comes from the one protocol that has it.
pub struct BusDriver {
    drivers: Vec<BoxedDriver>,
    joints: Vec<usize>,
}

/// The driver for every servo of `settings.buses[bus]`.
///
/// # Errors
/// When the settings cannot be configured in the servos of one of the protocols.
pub fn of_bus(settings: &Settings, bus: usize) -> Result<BusDriver, DriverError> {
    let is_spoken = |known: &&Registration| {
        settings.servos.iter().any(|servo| servo.bus == bus && servo.protocol.name() == known.name)
    };
    let drivers = REGISTRY.iter().filter(is_spoken).map(|known| (known.driver)(settings, bus));
    let drivers = drivers.collect::<Result<Vec<_>, _>>()?;
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

    fn set_homing(&mut self, joint: Option<usize>) {
        self.drivers.iter_mut().for_each(|driver| driver.set_homing(joint));
    }

    fn other_master(&self) -> Option<CanId> {
        self.drivers.iter().find_map(|driver| driver.other_master())
    }

    fn explain(&self, error_code: u32) -> String {
        crate::words::explain(error_code)
    }
}
