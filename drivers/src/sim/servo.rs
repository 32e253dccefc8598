//! A simulated servo, whatever it speaks.
use super::disturbance::Disturbance;
use super::drive::{Drive, DriveParameters};
use super::motor::{Motor, MotorParameters};
use super::plant::PlantParameters;
use super::planted::PlantedObject;
use super::power::PowerState;
use crate::frame::CanFrame;
use crate::servo::Nanos;

/// What a simulated servo is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ServoParameters {
    /// A CiA 402 drive.
    Cia402(DriveParameters),
    /// A Damiao motor.
    Damiao(MotorParameters),
}

impl ServoParameters {
    /// Its mechanics.
    pub const fn plant_mut(&mut self) -> &mut PlantParameters {
        match self {
            Self::Cia402(drive) => &mut drive.plant,
            Self::Damiao(motor) => &mut motor.plant,
        }
    }
    /// Link angle at power-up.
    pub const fn start_rad_mut(&mut self) -> &mut f64 {
        match self {
            Self::Cia402(drive) => &mut drive.start_rad,
            Self::Damiao(motor) => &mut motor.start_rad,
        }
    }
}

/// A simulated servo.
#[derive(Clone, Debug)]
pub enum SimulatedServo {
    /// A CiA 402 drive.
    Cia402(Box<Drive>),
    /// A Damiao motor.
    Damiao(Box<Motor>),
}

impl SimulatedServo {
    /// A servo that powers up at the first call of [`Self::advance`]; of a drive, these objects are changed.
    #[must_use]
    pub fn new(parameters: ServoParameters, objects: &[PlantedObject]) -> Self {
        match parameters {
            ServoParameters::Cia402(parameters) => {
                let mut drive = Drive::new(parameters);
                objects.iter().for_each(|object| drive.plant(*object));
                Self::Cia402(Box::new(drive))
            }
            ServoParameters::Damiao(motor) => Self::Damiao(Box::new(Motor::new(motor))),
        }
    }

    /// Lets time pass up to `now`, and pushes what the servo sends by itself.
    pub fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        match self {
            Self::Cia402(drive) => drive.advance(now, out),
            Self::Damiao(motor) => motor.advance(now, out),
        }
    }

    /// Takes a frame from the bus and pushes the answers.
    pub fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        match self {
            Self::Cia402(drive) => drive.receive(now, frame, out),
            Self::Damiao(motor) => motor.receive(now, frame, out),
        }
    }

    /// Puts a fault into the servo.
    pub fn disturb(&mut self, disturbance: Disturbance, out: &mut Vec<CanFrame>) {
        match self {
            Self::Cia402(drive) => drive.disturb(disturbance, out),
            Self::Damiao(motor) => motor.disturb(disturbance),
        }
    }

    /// It follows commands with torque.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        match self {
            Self::Cia402(drive) => drive.power_state() == PowerState::OperationEnabled,
            Self::Damiao(motor) => motor.is_enabled(),
        }
    }

    /// True angle of the link, which no encoder fault can bend.
    #[must_use]
    pub fn position_rad(&self) -> f64 {
        match self {
            Self::Cia402(drive) => drive.position_rad(),
            Self::Damiao(motor) => motor.position_rad(),
        }
    }

    /// True angular velocity of the link.
    #[must_use]
    pub fn velocity_rad_s(&self) -> f64 {
        match self {
            Self::Cia402(drive) => drive.velocity_rad_s(),
            Self::Damiao(motor) => motor.velocity_rad_s(),
        }
    }

    /// The drive, if it is a CiA 402 drive.
    #[must_use]
    pub fn as_cia402(&self) -> Option<&Drive> {
        match self {
            Self::Cia402(drive) => Some(drive),
            Self::Damiao(_) => None,
        }
    }

    /// Node id.
    #[must_use]
    pub fn node_id(&self) -> u8 {
        match self {
            Self::Cia402(drive) => drive.node_id(),
            Self::Damiao(motor) => motor.node_id(),
        }
    }

    /// Its states, for the operator: `key=value` words of its protocol.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Cia402(drive) => {
                let (power, network, word) = (drive.power_state(), drive.network_state(), drive.statusword());
                format!("power={power:?} network={network:?} statusword=0x{word:04X}")
            }
            Self::Damiao(motor) => format!("status=0x{:X}", motor.status()),
        }
    }
}
