//! What would make a bus less full: the settings that exist, each with the load that it would give.
use super::frame::{BitRates, Format};
use super::{BusLoad, WARNED_PERCENT, flow};
use crate::protocol::{self, FdUse, Protocol};
use crate::settings::{Bus, BusKind, Settings, Traffic};

/// Data rate that CAN FD is computed with.
const FD_DATA_BIT_S: u32 = 5_000_000;
/// Nominal rate that CAN FD is computed with.
const FD_BIT_S: u32 = 1_000_000;

/// One remedy.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadRemedy {
    /// What to change.
    pub what: String,
    /// The load that the fullest bus then has in the worst case, in percent.
    pub percent: f64,
    /// It gets the bus below the warning by itself.
    pub suffices: bool,
}

pub(super) fn of(bus: &Bus, settings: &Settings, servos: &[Protocol]) -> Vec<LoadRemedy> {
    let mut remedies = Remedies { bus, settings, servos, found: Vec::new() };
    for buses in 2..=servos.len().min(3) {
        let largest = servos.len().div_ceil(buses);
        let share = servos.get(..largest).unwrap_or(servos);
        remedies.push(format!("{buses} buses, at most {largest} servos on each"), bus, settings, share);
    }
    if !matches!(bus.kind, BusKind::Fd { .. }) {
        remedies.fd();
    }
    if servos.iter().all(Protocol::shapes_traffic) {
        remedies.traffic();
    }
    let period_us = settings.cycle.period_us.saturating_mul(2);
    let slower = Settings {
        cycle: crate::settings::CycleSettings { period_us, ..settings.cycle },
        ..settings.clone()
    };
    remedies.push(format!("cycle.period_us = {period_us}, for every joint of the arm"), bus, &slower, servos);
    remedies.found
}

struct Remedies<'a> {
    bus: &'a Bus,
    settings: &'a Settings,
    servos: &'a [Protocol],
    found: Vec<LoadRemedy>,
}

impl Remedies<'_> {
    fn push(&mut self, what: String, bus: &Bus, settings: &Settings, servos: &[Protocol]) {
        self.note(what, BusLoad::of(bus, settings, servos).percent);
    }

    fn note(&mut self, what: String, percent: f64) {
        self.found.push(LoadRemedy { what, percent, suffices: percent <= WARNED_PERCENT });
    }

    fn fd(&mut self) {
        let kind = BusKind::Fd { bitrate_bit_s: FD_BIT_S, data_bitrate_bit_s: FD_DATA_BIT_S };
        let all = |wanted| self.servos.iter().all(|protocol| protocol.fd() == wanted);
        if all(FdUse::Spoken) {
            let what =
                "bitrate_bit_s = 1000000 and data_bitrate_bit_s = 5000000 (CAN FD), set in the motors too";
            let fd = Bus { kind, ..self.bus.clone() };
            self.push(what.to_owned(), &fd, self.settings, self.servos);
        } else if all(FdUse::Planned) {
            // Said with its number, because drives can be chosen; but it is no setting yet.
            let cycle_hz = 1e6 / f64::from(self.settings.cycle.period_us.max(1));
            let rates = BitRates { nominal_bit_s: FD_BIT_S, data_bit_s: FD_DATA_BIT_S };
            let flows = protocol::flows_with(self.bus, self.servos, cycle_hz, |_| Format::Fd);
            let what = "CAN FD at 1 and 5 Mbit/s, with servos that speak it (CiA 402 drives are sent classic frames)";
            self.note(what.to_owned(), flow::percent(&flows, rates));
        }
    }

    fn traffic(&mut self) {
        let now = self.bus.traffic;
        let slower = |every: u32, most: u32| every.saturating_mul(2).min(most);
        let setpoint_every = slower(now.setpoint_every, crate::settings::SETPOINT_EVERY_MAX);
        let feedback_every = slower(now.feedback_every, crate::settings::FEEDBACK_EVERY_MAX);
        let decimated = Traffic { setpoint_every, ..now };
        let staggered = Traffic { setpoint_every, stagger: true, ..now };
        let packed = Traffic { packed: true, ..now };
        let quiet = Traffic { feedback_every, ..now };
        let both = Traffic { feedback_every, packed: true, ..now };
        let all = [
            (format!("setpoint_every = {setpoint_every}"), decimated),
            (
                format!("setpoint_every = {setpoint_every} and stagger = true, which spreads the burst"),
                staggered,
            ),
            ("packed = true".to_owned(), packed),
            (format!("feedback_every = {feedback_every}"), quiet),
            (format!("packed = true and feedback_every = {feedback_every}"), both),
            (
                format!("setpoint_every = {setpoint_every} and feedback_every = {feedback_every}"),
                Traffic { feedback_every, ..staggered },
            ),
        ];
        for (what, traffic) in all.into_iter().filter(|(_, traffic)| *traffic != now) {
            let bus = Bus { traffic, ..self.bus.clone() };
            self.push(what, &bus, self.settings, self.servos);
        }
    }
}
