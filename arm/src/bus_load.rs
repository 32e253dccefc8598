//! How full a bus gets in the worst case.
//!
//! Every frame is counted with the most stuff bits that it can have and with the pause behind it. Only what every cycle
//! sends is counted: heartbeats and configuration need the room that is left.
//!
//! Source: Davis, Burns, Bril and Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited
//! and revised", Real-Time Systems 35, 2007, equation 1 (11-bit identifiers).
use crate::protocol::Protocol;
use crate::settings::{BusKind, Settings};

/// Above this, settings are refused: the cycle's frames do not fit into the cycle.
pub const REFUSED_PERCENT: f64 = 100.0;
/// Above this, a warning is due: configuration and repetitions have little room.
pub const WARNED_PERCENT: f64 = 80.0;

/// Control or status word and a 32-bit position.
const CIA402_PDO_BYTES: u32 = 6;
/// Every command and every feedback.
const DAMIAO_BYTES: u32 = 8;

/// The load of one bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusLoad {
    /// Servos on it.
    pub servos: usize,
    /// Worst-case bits of one cycle: SYNC, and one setpoint and one answer a servo.
    pub cycle_bits: u32,
    /// Share of the bit rate in percent; none for a virtual bus, which has no bit rate.
    pub percent: Option<f64>,
}

impl Settings {
    /// The worst-case load of a bus by its index; nothing is on a bus that does not exist.
    #[must_use]
    pub fn bus_load(&self, bus: usize) -> BusLoad {
        let mine = self.servos.iter().filter(|servo| servo.bus == bus);
        let bits = mine.clone().map(|servo| match servo.protocol {
            Protocol::Cia402(_) => 2 * frame_bits(CIA402_PDO_BYTES),
            Protocol::Damiao(_) => 2 * frame_bits(DAMIAO_BYTES),
        });
        let sync = mine.clone().any(|servo| servo.protocol.as_cia402().is_some());
        let sync_bits = if sync { frame_bits(0) } else { 0 };
        let cycle_bits = bits.fold(sync_bits, u32::saturating_add);
        let servos = mine.count();
        let cycle_s = f64::from(self.cycle.period_us) * 1e-6;
        let percent = match self.buses.get(bus).map(|bus| bus.kind) {
            Some(BusKind::Classic { bitrate_bit_s } | BusKind::Fd { bitrate_bit_s, .. }) => {
                Some(100.0 * f64::from(cycle_bits) / (f64::from(bitrate_bit_s) * cycle_s))
            }
            Some(BusKind::Virtual) | None => None,
        };
        BusLoad { servos, cycle_bits, percent }
    }
}

/// Most bits of a classic frame with an 11-bit identifier and `bytes` bytes, pause included.
fn frame_bits(bytes: u32) -> u32 {
    47 + 8 * bytes + (34 + 8 * bytes - 1) / 4
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn frame_bits_agree_with_the_printed_table() {
        for (bytes, bits) in [(0, 55), (2, 75), (4, 95), (6, 115), (8, 135)] {
            assert_eq!(frame_bits(bytes), bits, "{bytes} bytes");
        }
    }

    #[test]
    fn six_servos_at_1_khz_are_refused_on_one_classic_bus_and_taken_at_500_hz() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
        let text = std::fs::read_to_string(&file).unwrap();
        let real = text.replace("virtual = true", "bitrate_bit_s = 1000000");
        assert_ne!(real, text);
        let faults = Settings::from_toml(&file, &real).unwrap_err().to_string();
        assert!(faults.contains("bus[0] = 144 % full in the worst case (1435 bits a cycle)"), "{faults}");
        let slower =
            Settings::from_toml(&file, &real.replace("period_us = 1000", "period_us = 2000")).unwrap();
        let load = slower.bus_load(0);
        assert_eq!((load.servos, load.cycle_bits), (6, 1435));
        assert!(load.percent.is_some_and(|percent| (percent - 71.75).abs() < 1e-9), "{load:?}");
        assert_eq!(slower.bus_load(7), BusLoad { servos: 0, cycle_bits: 0, percent: None });
    }
}
