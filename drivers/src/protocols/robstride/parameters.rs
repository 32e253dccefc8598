//! The parameters of a simulated `RobStride` motor, and what a power cycle keeps of them.
//!
//! Source: `RobStride`, "RS00 User Manual" of 2026-04-28, section 4.1.13. Values that nothing here acts on are the manual's
//! defaults.
use super::frames::{Parameter, TIMEOUT_UNITS_A_MS};
use super::sim::RobStrideParameters;
use std::collections::BTreeMap;

/// Floats: index, value, least and greatest that is taken. A range of nothing can only be read.
const FLOATS: [(u16, f32, f32, f32); 17] = [
    (0x7006, 0.0, -90.0, 90.0),
    (0x700A, 0.0, -50.0, 50.0),
    (0x7010, 0.17, 0.0, 200.0),
    (0x7011, 0.012, 0.0, 200.0),
    (0x7014, 0.1, 0.0, 1.0),
    (0x7016, 0.0, -100.0, 100.0),
    (0x7017, 2.0, 0.0, 50.0),
    (0x7018, 16.0, 0.0, 90.0),
    (0x701C, 48.0, 1.0, 0.0),
    (0x701E, 40.0, 0.0, 200.0),
    (0x701F, 6.0, 0.0, 200.0),
    (0x7020, 0.02, 0.0, 200.0),
    (0x7021, 0.1, 0.0, 1.0),
    (0x7022, 20.0, 0.0, 1000.0),
    (0x7024, 10.0, 0.0, 50.0),
    (0x7025, 10.0, 0.0, 1000.0),
    (0x702B, 0.0, -100.0, 100.0),
];
/// Whole numbers: index, value, greatest that is taken.
const INTEGERS: [(u16, u32, u32); 3] = [(0x7026, 1, 65_535), (0x7029, 1, 1), (0x702A, 0, 1)];
/// Values of `run_mode` that mean something.
const RUN_MODES: [u32; 5] = [0, 1, 2, 3, 5];

/// All parameters but those that are measured.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    now: BTreeMap<u16, [u8; 4]>,
    flash: BTreeMap<u16, [u8; 4]>,
    torque_nm_max: f32,
    /// Writes are not taken.
    pub(super) locked: bool,
}

impl Parameters {
    pub(super) fn new(motor: &RobStrideParameters) -> Self {
        let mut flash = BTreeMap::new();
        for (index, value, ..) in FLOATS {
            flash.insert(index, value.to_le_bytes());
        }
        for (index, value, _) in INTEGERS {
            flash.insert(index, value.to_le_bytes());
        }
        let timeout = motor.timeout_ms.saturating_mul(TIMEOUT_UNITS_A_MS);
        flash.insert(Parameter::Timeout.index(), timeout.to_le_bytes());
        flash.insert(Parameter::RunMode.index(), u32::from(motor.run_mode).to_le_bytes());
        #[expect(clippy::cast_possible_truncation, reason = "the parameter is this wide")]
        let torque_nm_max = motor.torque_limit_nm as f32;
        flash.insert(Parameter::TorqueLimit.index(), torque_nm_max.to_le_bytes());
        Self { now: flash.clone(), flash, torque_nm_max, locked: false }
    }

    /// As it stands; `None` when the motor has none of that index.
    pub(super) fn get(&self, index: u16) -> Option<[u8; 4]> {
        self.now.get(&index).copied()
    }

    /// Writes one, if the motor takes the value.
    pub(super) fn set(&mut self, index: u16, value: [u8; 4]) {
        if !self.locked
            && self.takes(index, value)
            && let Some(held) = self.now.get_mut(&index)
        {
            *held = value;
        }
    }

    pub(super) fn restart(&mut self) {
        self.now.clone_from(&self.flash);
    }

    pub(super) fn integer(&self, parameter: Parameter) -> u32 {
        self.get(parameter.index()).map_or(0, u32::from_le_bytes)
    }

    pub(super) fn float(&self, parameter: Parameter) -> f64 {
        self.get(parameter.index()).map_or(0.0, |value| f64::from(f32::from_le_bytes(value)))
    }

    fn takes(&self, index: u16, value: [u8; 4]) -> bool {
        let (whole, float) = (u32::from_le_bytes(value), f32::from_le_bytes(value));
        if index == Parameter::RunMode.index() {
            return RUN_MODES.contains(&whole);
        }
        if index == Parameter::Timeout.index() {
            return true;
        }
        if index == Parameter::TorqueLimit.index() {
            return (0.0..=self.torque_nm_max).contains(&float);
        }
        // False for what is no number.
        FLOATS.iter().any(|(known, _, least, most)| *known == index && (*least..=*most).contains(&float))
            || INTEGERS.iter().any(|(known, _, most)| *known == index && whole <= *most)
    }
}
