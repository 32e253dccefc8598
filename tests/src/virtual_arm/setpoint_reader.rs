//! The setpoints that a frame holds for each joint, read by decoders that share nothing with the product's.
use crate::mit_setpoints::MotorEncoding;
use crate::setpoints::{Encoding, target};
use taustream_arm::protocol::odrive::Odrive;
use taustream_arm::protocol::piper::Piper;
use taustream_arm::{Cia402, Damiao, DamiaoMode, RobStride, Settings};
use taustream_drivers::CanFrame;
use taustream_drivers::sim::{ServoModel, ServoSimulator};

/// RPDO1 and RPDO2 of node 0.
const RPDO1: u32 = 0x200;
const RPDO2: u32 = 0x300;
/// Identifiers of the `POS_VEL` mode begin here.
const POS_VEL: u32 = 0x100;
/// Flag of a 29-bit identifier, type 1 (operation command) and receiver of `RobStride` frames, and the bits that are theirs.
const OPERATION: u32 = 0x8100_0000;
const OPERATION_BITS: u32 = 0xFF00_00FF;
/// Half the distance between two neighbouring numbers of 32 bits below 8 rad.
const FLOAT_HALF_RAD: f64 = 2.4e-7;
/// The same below 32 turns.
const FLOAT_HALF_TURNS: f64 = 9.6e-7;
/// `Set_Input_Pos`, below the node id.
const INPUT_POSITION: u32 = 0x0C;
/// Targets of the first pair of joints.
const PAIRS: u32 = 0x155;

/// One setpoint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadSetpoint {
    /// Joint of the arm.
    pub joint: usize,
    /// The commanded link angle.
    pub position_rad: f64,
}

/// How the setpoints of one servo are encoded.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Counts in an RPDO of its own, or in a frame that two drives share.
    Counts(Encoding),
    /// 16 bits of an MIT command.
    Mit(MotorEncoding),
    /// 16 bits of a `RobStride` operation command.
    Operation { node_id: u8, reach_rad: f64, sign: f64, zero_rad: f64 },
    /// A number of 32 bits.
    PosVel { node_id: u8, sign: f64, zero_rad: f64 },
    /// Turns of a motor, a number of 32 bits.
    Turns { node_id: u8, turns_a_rad: f64, zero_rad: f64 },
    /// Thousandths of degrees, in a frame of two joints.
    Millidegrees { number: u8, sign: f64, zero_rad: f64 },
}

/// One servo on its bus.
#[derive(Clone, Copy, Debug)]
struct Reading {
    joint: usize,
    bus: usize,
    kind: Kind,
}

/// The servos of an arm.
#[derive(Clone, Debug)]
pub struct SetpointReader {
    servos: Vec<Reading>,
    packed: Vec<bool>,
    every: Vec<u64>,
}

impl SetpointReader {
    /// From an arm's settings.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let motors = crate::mit_setpoints::encodings(settings).unwrap_or_default();
        let reading = |servo: &taustream_arm::Servo| {
            let kind = if let Some(cia402) = servo.protocol.get::<Cia402>() {
                Kind::Counts(Encoding {
                    joint: servo.joint,
                    node_id: servo.node_id,
                    counts_per_rad: servo.sign * cia402.gear_ratio * cia402.counts_per_rev
                        / std::f64::consts::TAU,
                    zero_rad: servo.zero_offset_rad,
                })
            } else if let Some(odrive) = servo.protocol.get::<Odrive>() {
                Kind::Turns {
                    node_id: servo.node_id,
                    turns_a_rad: servo.sign * odrive.gear_ratio / std::f64::consts::TAU,
                    zero_rad: servo.zero_offset_rad,
                }
            } else if servo.protocol.get::<Piper>().is_some() {
                let (number, sign, zero_rad) = (servo.node_id, servo.sign, servo.zero_offset_rad);
                Kind::Millidegrees { number, sign, zero_rad }
            } else if let Some(robstride) = servo.protocol.get::<RobStride>() {
                Kind::Operation {
                    node_id: servo.node_id,
                    reach_rad: robstride.ranges.position_rad,
                    sign: servo.sign,
                    zero_rad: servo.zero_offset_rad,
                }
            } else if servo.protocol.get::<Damiao>().is_some_and(|damiao| damiao.mode == DamiaoMode::PosVel) {
                Kind::PosVel { node_id: servo.node_id, sign: servo.sign, zero_rad: servo.zero_offset_rad }
            } else {
                Kind::Mit(*motors.iter().find(|motor| motor.joint == servo.joint)?)
            };
            Some(Reading { joint: servo.joint, bus: servo.bus, kind })
        };
        Self {
            servos: settings.servos.iter().filter_map(reading).collect(),
            packed: settings.buses.iter().map(|bus| bus.traffic.packed).collect(),
            every: settings.buses.iter().map(|bus| u64::from(bus.traffic.setpoint_every.max(1))).collect(),
        }
    }

    /// The setpoints in a master's frame on a bus.
    #[must_use]
    pub fn read(&self, bus: usize, frame: &CanFrame) -> Vec<ReadSetpoint> {
        let (id, data) = (frame.id().raw(), frame.data());
        let own = self.servos.iter().filter(|servo| servo.bus == bus);
        let mut found: Vec<ReadSetpoint> = own.clone().filter_map(|servo| servo.read(id, data)).collect();
        if self.packed.get(bus) == Some(&true) && data.len() == 8 {
            let counts: Vec<(usize, Encoding)> = own
                .filter_map(|servo| match servo.kind {
                    Kind::Counts(encoding) => Some((servo.joint, encoding)),
                    Kind::Mit(_)
                    | Kind::Operation { .. }
                    | Kind::PosVel { .. }
                    | Kind::Turns { .. }
                    | Kind::Millidegrees { .. } => None,
                })
                .collect();
            let pair = counts.chunks_exact(2).find(|pair| RPDO2 + u32::from(pair[0].1.node_id) == id);
            for ((joint, encoding), bytes) in pair.into_iter().flatten().zip(data.chunks_exact(4)) {
                let counts = bytes.try_into().map(i32::from_le_bytes).unwrap_or_default();
                found.push(ReadSetpoint { joint: *joint, position_rad: encoding.rad(counts) });
            }
        }
        found
    }

    /// Largest difference between a commanded angle and the one that its frame holds: rounding.
    #[must_use]
    pub fn rounding_rad(&self, joint: usize) -> f64 {
        let servo = self.servos.iter().find(|servo| servo.joint == joint);
        servo.map_or(0.0, |servo| match servo.kind {
            Kind::Counts(encoding) => 0.5 / encoding.counts_per_rad.abs(),
            // The range is twice the reach, in 65535 steps.
            Kind::Mit(motor) => motor.reach[0] / 65_535.0,
            Kind::Operation { reach_rad, .. } => reach_rad / 65_535.0,
            Kind::PosVel { .. } => FLOAT_HALF_RAD,
            Kind::Turns { turns_a_rad, .. } => FLOAT_HALF_TURNS / turns_a_rad.abs(),
            Kind::Millidegrees { .. } => 0.5e-3_f64.to_radians(),
        })
    }

    /// Cycles from one setpoint of a joint to its next.
    #[must_use]
    pub fn every(&self, joint: usize) -> u64 {
        let servo = self.servos.iter().find(|servo| servo.joint == joint);
        servo.and_then(|servo| self.every.get(servo.bus)).copied().unwrap_or(1)
    }

    /// The bus of a joint.
    #[must_use]
    pub fn bus(&self, joint: usize) -> Option<usize> {
        self.servos.iter().find(|servo| servo.joint == joint).map(|servo| servo.bus)
    }
}

impl Reading {
    /// The setpoint in a frame of its own.
    fn read(&self, id: u32, data: &[u8]) -> Option<ReadSetpoint> {
        let position_rad = match self.kind {
            Kind::Counts(encoding) => {
                (id == RPDO1 + u32::from(encoding.node_id)).then(|| target(data))?.map(|at| encoding.rad(at))
            }
            Kind::Mit(motor) => (id == u32::from(motor.node_id)).then(|| motor.commanded_rad(data)).flatten(),
            Kind::Operation { node_id, reach_rad, sign, zero_rad } => {
                let bytes: [u8; 2] = data.get(..2)?.try_into().ok()?;
                let is_setpoint = id & OPERATION_BITS == OPERATION | u32::from(node_id) && data.len() == 8;
                let part = f64::from(u16::from_be_bytes(bytes)) / 65_535.0;
                is_setpoint.then_some((2.0 * part - 1.0) * reach_rad * sign + zero_rad)
            }
            Kind::PosVel { node_id, sign, zero_rad } => {
                let bytes: [u8; 4] = data.get(..4)?.try_into().ok()?;
                let is_setpoint = id == POS_VEL + u32::from(node_id) && data.len() == 8;
                is_setpoint.then(|| f64::from(f32::from_le_bytes(bytes)) * sign + zero_rad)
            }
            Kind::Turns { node_id, turns_a_rad, zero_rad } => {
                let bytes: [u8; 4] = data.get(..4)?.try_into().ok()?;
                let is_setpoint = id == u32::from(node_id) * 32 + INPUT_POSITION && data.len() == 8;
                is_setpoint.then(|| f64::from(f32::from_le_bytes(bytes)) / turns_a_rad + zero_rad)
            }
            Kind::Millidegrees { number, sign, zero_rad } => {
                let (pair, second) = (u32::from(number - 1) / 2, number % 2 == 0);
                let from = if second { 4 } else { 0 };
                let bytes: [u8; 4] = data.get(from..from + 4)?.try_into().ok()?;
                let degrees = f64::from(i32::from_be_bytes(bytes)) * 1e-3;
                (id == PAIRS + pair).then(|| degrees.to_radians() * sign + zero_rad)
            }
        }?;
        Some(ReadSetpoint { joint: self.joint, position_rad })
    }
}

/// Whether the drive of a joint follows commands with torque now.
#[must_use]
pub fn is_enabled(simulator: &ServoSimulator, joint: usize) -> bool {
    simulator.drive(joint).is_some_and(ServoModel::is_enabled)
}
