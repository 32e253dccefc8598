//! The registers of a simulated Damiao motor, and what its flash keeps of them.
//!
//! Source: the firmware's register table. Values of registers that nothing here acts on are
//! plausible ones of a DM-J4310.
use super::frames::{Register, TIMEOUT_UNITS_A_MS, is_integer};
use super::sim::MotorParameters;
use std::collections::BTreeMap;

/// Registers of floats that a master may write: number, value, least and greatest that is taken.
const FLOATS: [(u8, f32, f32, f32); 18] = [
    (0, 15.0, 10.0, f32::MAX),
    (1, 0.0, 0.0, f32::MAX),
    (2, 100.0, 80.0, 200.0),
    (3, 0.98, 0.0, 1.0),
    (4, 50.0, 0.0, f32::MAX),
    (5, -50.0, f32::MIN, 0.0),
    (6, 200.0, 0.0, f32::MAX),
    (24, 1000.0, 100.0, 10_000.0),
    (25, 0.004, 0.0, f32::MAX),
    (26, 0.002, 0.0, f32::MAX),
    (27, 60.0, 0.0, f32::MAX),
    (28, 1.0, 0.0, f32::MAX),
    (29, 32.0, 0.0, f32::MAX),
    (30, 1.0, 0.0, 1.0),
    (31, 4.0, 1.0, 30.0),
    (32, 50.0, 0.0, 500.0),
    (33, 100.0, 100.0, 10_000.0),
    (34, 50.0, 0.0, 10_000.0),
];
/// What can only be read.
const READ_ONLY: [(u8, f32); 15] = [
    (11, 0.000_3),
    (12, 0.000_02),
    (17, 0.65),
    (18, 0.000_4),
    (19, 0.004),
    (20, 10.0),
    (50, 0.0),
    (51, 0.0),
    (52, 1.0),
    (53, 1.0),
    (54, 0.0),
    (55, 1.0),
    (60, 24.0),
    (61, 35.0),
    (62, 35.0),
];
/// The same of integers: versions, serial number, pole pairs.
const READ_ONLY_INTEGERS: [(u8, u32); 5] = [(13, 1), (14, 5017), (15, 1), (16, 14), (36, 1)];
/// Reaches that are taken at all.
const REACH: [f32; 2] = [1e-3, 1e6];

/// All registers.
#[derive(Clone, Debug)]
pub(super) struct Registers {
    now: BTreeMap<u8, [u8; 4]>,
    flash: BTreeMap<u8, [u8; 4]>,
    /// Writes are not taken.
    pub(super) locked: bool,
}

impl Registers {
    pub(super) fn new(parameters: &MotorParameters) -> Self {
        let mut flash = BTreeMap::new();
        for (number, value, ..) in FLOATS {
            flash.insert(number, value.to_le_bytes());
        }
        for (number, value) in READ_ONLY {
            flash.insert(number, value.to_le_bytes());
        }
        for (number, value) in READ_ONLY_INTEGERS {
            flash.insert(number, value.to_le_bytes());
        }
        for (register, value) in [
            (Register::FeedbackId, u32::from(parameters.feedback_id)),
            (Register::NodeId, u32::from(parameters.node_id)),
            (Register::Timeout, parameters.timeout_ms.saturating_mul(TIMEOUT_UNITS_A_MS)),
            (Register::Mode, parameters.mode),
        ] {
            flash.insert(register as u8, value.to_le_bytes());
        }
        flash.insert(35, 4_u32.to_le_bytes());
        let reaches = [Register::PositionRange, Register::VelocityRange, Register::TorqueRange];
        for (register, reach) in reaches.into_iter().zip(parameters.ranges) {
            #[expect(clippy::cast_possible_truncation, reason = "the register is this wide")]
            let reach = reach as f32;
            flash.insert(register as u8, reach.to_le_bytes());
        }
        Self { now: flash.clone(), flash, locked: false }
    }

    /// A register as it stands; `None` when the motor has none of that number.
    pub(super) fn get(&self, number: u8) -> Option<[u8; 4]> {
        self.now.get(&number).copied()
    }

    /// Writes a register and returns what it holds then: the old value when the new one is not taken.
    pub(super) fn set(&mut self, number: u8, value: [u8; 4]) -> Option<[u8; 4]> {
        let takes = !self.locked && takes(number, value);
        let held = self.now.get_mut(&number)?;
        if takes {
            *held = value;
        }
        Some(*held)
    }

    pub(super) fn store(&mut self) {
        self.flash.clone_from(&self.now);
    }

    pub(super) fn restart(&mut self) {
        self.now.clone_from(&self.flash);
    }

    pub(super) fn integer(&self, register: Register) -> u32 {
        self.get(register as u8).map_or(0, u32::from_le_bytes)
    }

    pub(super) fn float(&self, register: Register) -> f64 {
        self.get(register as u8).map_or(0.0, |value| f64::from(f32::from_le_bytes(value)))
    }
}

/// Whether a motor takes a value. Its identifiers it takes too, but they act after a power cycle, which is not simulated.
fn takes(number: u8, value: [u8; 4]) -> bool {
    if is_integer(number) {
        let value = u32::from_le_bytes(value);
        return match number {
            7 | 8 => value <= 0x7FF,
            9 => true,
            10 => (1..=4).contains(&value),
            35 => value <= 11,
            _ => false,
        };
    }
    let value = f32::from_le_bytes(value);
    let [least, greatest] = match (number, FLOATS.iter().find(|(float, ..)| *float == number)) {
        (21..=23, _) => REACH,
        (_, Some((_, _, least, greatest))) => [*least, *greatest],
        (_, None) => return false,
    };
    // False for what is no number.
    (least..=greatest).contains(&value)
}
