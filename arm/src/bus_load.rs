//! How full a bus gets in the worst case, and what would make it less full.
//!
//! Every frame is counted with the most stuff bits that it can have and with the pause behind it: what each cycle sends,
//! and what comes beside it (heartbeats, repeated controlwords). Configuration and emergencies need the room that is
//! left. `docs/bus-planning.md` explains the numbers to users.
pub mod flow;
pub mod frame;
mod remedies;

use crate::protocol::{self, Protocol};
use crate::settings::{Bus, BusKind, Settings};
use flow::Flow;
pub use flow::{CONTROL_REPEAT_TURNS, HEARTBEAT_MS};
use frame::BitRates;
pub use remedies::LoadRemedy;

/// Above this, settings are refused: the cycle's frames do not fit into the cycle.
pub const REFUSED_PERCENT: f64 = 100.0;
/// Above this, a warning is due: configuration and repetitions have little room.
pub const WARNED_PERCENT: f64 = 80.0;

/// What a virtual bus is measured against, for people who plan a real one.
const USUAL_BIT_S: u32 = 1_000_000;

/// The load of one bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusLoad {
    /// Servos on it.
    pub servos: usize,
    /// What goes over it.
    pub flows: Vec<Flow>,
    /// Its bit rates; those of a usual bus (1 Mbit/s) when it is virtual.
    pub rates: BitRates,
    /// It has no bit rate: the shares are those of a usual bus.
    pub is_virtual: bool,
    /// Share of the time in percent, over many cycles.
    pub percent: f64,
    /// The fullest single cycle, in percent of a cycle. Above 100 the rest of it waits for the next one.
    pub fullest_cycle_percent: f64,
}

impl BusLoad {
    fn of(bus: &Bus, settings: &Settings, servos: &[Protocol]) -> Self {
        let period_s = f64::from(settings.cycle.period_us.max(1)) * 1e-6;
        let flows = protocol::flows(bus, servos, 1.0 / period_s);
        let nominal_bit_s = bus.kind.bitrate_bit_s().unwrap_or(USUAL_BIT_S);
        let data_bit_s = bus.kind.data_bitrate_bit_s().unwrap_or(nominal_bit_s);
        let rates = BitRates { nominal_bit_s, data_bit_s };
        let burst_s: f64 = flows.iter().map(|flow| flow.burst_s(rates)).sum();
        Self {
            servos: servos.len(),
            percent: flow::percent(&flows, rates),
            fullest_cycle_percent: 100.0 * burst_s / period_s,
            flows,
            rates,
            is_virtual: bus.kind == BusKind::Virtual,
        }
    }
    /// More than the bus can carry.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        !self.is_virtual && self.percent > REFUSED_PERCENT
    }
    /// So much that configuration and repetitions have little room.
    #[must_use]
    pub fn is_warned(&self) -> bool {
        !self.is_virtual && self.percent > WARNED_PERCENT
    }
}

impl Settings {
    /// The worst-case load of a bus by its index; none of a bus that does not exist.
    #[must_use]
    pub fn bus_load(&self, bus: usize) -> Option<BusLoad> {
        Some(BusLoad::of(self.buses.get(bus)?, self, &self.protocols_on(bus)))
    }

    /// What would make a bus less full, each with the load that it would give.
    #[must_use]
    pub fn remedies(&self, bus: usize) -> Vec<LoadRemedy> {
        let found = self.buses.get(bus).map(|b| remedies::of(b, self, &self.protocols_on(bus)));
        found.unwrap_or_default()
    }

    fn protocols_on(&self, bus: usize) -> Vec<Protocol> {
        self.servos.iter().filter(|servo| servo.bus == bus).map(|servo| servo.protocol.clone()).collect()
    }
}
