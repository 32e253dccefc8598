//! How full a bus gets in the worst case.
//!
//! Every frame is counted with the most stuff bits that it can have and with the pause behind it (classic CAN, 11-bit
//! identifiers): 47 + 8 s + floor((34 + 8 s - 1) / 4) bits for s bytes. Source: ISO 11898-1; Davis et al.,
//! "Controller Area Network (CAN) schedulability analysis", 2007, equation 1.
use serde::Serialize;
use std::fmt;
use taustream_arm::{BusKind, Settings};

/// Above this a bus is refused: the cycle's frames do not fit into the cycle.
const REFUSED_PERCENT: f64 = 100.0;
/// Above this a bus is warned about: SDO, heartbeats and repetitions need room.
const WARNED_PERCENT: f64 = 80.0;
/// Bytes of one PDO: control or status word, and a 32-bit position.
const PDO_BYTES: u32 = 6;

/// One bus and its load.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct BusLoad {
    bus: String,
    interface: String,
    servos: usize,
    /// None for a virtual bus.
    bitrate_bit_s: Option<u32>,
    /// Worst-case bits of one cycle: SYNC, one setpoint and one answer a servo.
    cycle_bits: u32,
    /// None for a virtual bus.
    load_percent: Option<f64>,
}

/// The load of every bus of the settings.
pub(crate) fn loads(settings: &Settings) -> Vec<BusLoad> {
    let load = |(index, bus): (usize, &taustream_arm::Bus)| {
        let servos = settings.servos.iter().filter(|s| s.bus == index).count();
        let cycle_bits = cycle_bits(servos);
        let bitrate_bit_s = match bus.kind {
            BusKind::Virtual => None,
            BusKind::Classic { bitrate_bit_s } => Some(bitrate_bit_s),
        };
        let period_s = f64::from(settings.cycle.period_us) * 1e-6;
        BusLoad {
            bus: bus.name.clone(),
            interface: bus.interface.clone(),
            servos,
            bitrate_bit_s,
            cycle_bits,
            load_percent: bitrate_bit_s
                .map(|rate| 100.0 * f64::from(cycle_bits) / (f64::from(rate) * period_s)),
        }
    };
    settings.buses.iter().enumerate().map(load).collect()
}

/// Worst-case bits of SYNC, one setpoint and one answer a servo.
fn cycle_bits(servos: usize) -> u32 {
    let servos = u32::try_from(servos).unwrap_or(u32::MAX);
    frame_bits(0).saturating_add(servos.saturating_mul(2 * frame_bits(PDO_BYTES)))
}

fn frame_bits(bytes: u32) -> u32 {
    47 + 8 * bytes + (34 + 8 * bytes - 1) / 4
}

impl BusLoad {
    /// Why this bus cannot work, and the ways out.
    pub(crate) fn refusal(&self) -> Option<String> {
        let percent = self.load_percent.filter(|p| *p > REFUSED_PERCENT)?;
        Some(format!(
            "bus `{}` ({}) would be {percent:.0} % full in the worst case ({} bits a cycle, {} servos); spread the servos over more buses or lengthen cycle.period_us",
            self.bus, self.interface, self.cycle_bits, self.servos
        ))
    }
}

impl fmt::Display for BusLoad {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} on {}: {} servos, ", self.bus, self.interface, self.servos)?;
        let Some(percent) = self.load_percent else {
            return write!(
                f,
                "VIRTUAL: no bit rate, so no load; accepted on a vcan interface or the local link only"
            );
        };
        write!(f, "{percent:.0} % full in the worst case ({} bits a cycle)", self.cycle_bits)?;
        if percent > WARNED_PERCENT {
            write!(
                f,
                ", WARNING: above {WARNED_PERCENT:.0} % little room is left for configuration and repetitions"
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table of worst-case frame lengths that CAN handbooks print.
    #[test]
    fn frame_bits_agree_with_the_printed_table() {
        for (bytes, bits) in [(0, 55), (2, 75), (4, 95), (6, 115), (8, 135)] {
            assert_eq!(frame_bits(bytes), bits, "{bytes} bytes");
        }
    }

    #[test]
    fn bus_with_six_servos_at_1_khz_and_1_mbit_s_is_refused() {
        let load = BusLoad {
            bus: "arm".into(),
            interface: "can0".into(),
            servos: 6,
            bitrate_bit_s: Some(1_000_000),
            cycle_bits: cycle_bits(6),
            load_percent: Some(f64::from(cycle_bits(6)) / 10.0),
        };
        assert_eq!(load.cycle_bits, 1435);
        assert!(
            load.refusal().is_some_and(|why| why.contains("144 %") && why.contains("more buses")),
            "{load:?}"
        );
    }
}
