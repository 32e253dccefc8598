//! What goes wrong in a run, and when: decided from the seed before it begins.
use super::random::SeededRng;
use std::fmt;
use taustream_arm::{Cia402, Settings};
use taustream_drivers::sim::faults::FaultKind;

/// What a plan may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mix {
    /// Operator and nothing else: every setpoint is compared with its path and limits.
    Calm,
    /// Stalls of the loop.
    Stalls,
    /// Faults of buses.
    Buses,
    /// Faults of drives.
    Drives,
    /// Everything.
    All,
}

impl Mix {
    const ALL: [Self; 5] = [Self::Calm, Self::Stalls, Self::Buses, Self::Drives, Self::All];

    fn has(self, one: Self) -> bool {
        self == one || self == Self::All
    }
}

/// What goes wrong with a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusEvent {
    /// Only so many frames of each batch are taken.
    Partial(usize),
    /// No node acknowledges.
    NoAcknowledge,
    /// The controller leaves the bus, and comes back at the end.
    BusOff,
    /// The interface is down.
    Down,
    /// The interface has gone.
    Gone,
    /// Own frames come back late by this, ns.
    EchoesLate(u64),
    /// So many echoes are lost.
    EchoesLost(u64),
    /// So many arrivals find the receive queue full.
    Overflow(u64),
    /// Another node sends so many frames.
    Foreign(u32),
    /// Another master commands a drive.
    OtherMaster,
}

/// One event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The loop wakes up so much late.
    Stall {
        /// Milliseconds.
        ms: u64,
    },
    /// A bus, for so long.
    Bus {
        /// Index of the bus.
        bus: usize,
        /// What.
        event: BusEvent,
        /// For how long, ms; 0 where it has no duration.
        for_ms: u64,
    },
    /// A drive, for so long.
    Drive {
        /// Zero-based joint.
        joint: usize,
        /// What.
        kind: FaultKind,
        /// For how long, ms.
        for_ms: u64,
    },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stall { ms } => write!(f, "the loop stalls for {ms} ms"),
            Self::Bus { bus, event, for_ms } => write!(f, "bus {bus}: {event:?} for {for_ms} ms"),
            Self::Drive { joint, kind, for_ms } => {
                write!(f, "drive of joint {}: {kind} for {for_ms} ms", joint + 1)
            }
        }
    }
}

/// Milliseconds from the start in which nothing goes wrong: drives are configured then.
const QUIET_MS: u64 = 400;

/// What goes wrong, by millisecond.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Its kind.
    pub mix: Mix,
    /// Events in order, with their millisecond.
    pub events: Vec<(u64, Event)>,
}

impl Plan {
    /// Nothing goes wrong.
    #[must_use]
    pub fn calm() -> Self {
        Self { mix: Mix::Calm, events: Vec::new() }
    }

    /// The plan of a seed for `duration_ms`.
    #[must_use]
    pub fn random(seed: u64, settings: &Settings, duration_ms: u64) -> Self {
        let mut rng = SeededRng::new(seed, 1);
        let mix = Mix::ALL[usize::try_from(seed % 5).unwrap_or(0)];
        let mut events = Vec::new();
        let mut at_ms = QUIET_MS;
        while mix != Mix::Calm && at_ms < duration_ms {
            at_ms += rng.whole(50, 1_500);
            let event = match rng.whole(0, 2) {
                0 if mix.has(Mix::Stalls) => Event::Stall { ms: stall_ms(&mut rng) },
                1 if mix.has(Mix::Buses) => bus_event(&mut rng, settings),
                2 if mix.has(Mix::Drives) => drive_event(&mut rng, settings),
                _ => continue,
            };
            events.push((at_ms, event));
        }
        Self { mix, events }
    }
}

/// Mostly short, up to 700 ms.
fn stall_ms(rng: &mut SeededRng) -> u64 {
    match rng.whole(0, 3) {
        0 => rng.whole(1, 3),
        1 => rng.whole(3, 25),
        2 => rng.whole(25, 150),
        _ => rng.whole(150, 700),
    }
}

fn bus_event(rng: &mut SeededRng, settings: &Settings) -> Event {
    let bus = rng.index(settings.buses.len());
    let short_ms = rng.whole(1, 12);
    let long_ms = rng.whole(5, 400);
    let (event, for_ms) = match rng.whole(0, 10) {
        0 | 1 => (BusEvent::Partial(rng.index(8)), short_ms),
        2 => (BusEvent::NoAcknowledge, short_ms),
        3 => (BusEvent::NoAcknowledge, long_ms),
        4 => (BusEvent::BusOff, long_ms),
        5 => (BusEvent::Down, long_ms),
        6 => (BusEvent::Gone, long_ms),
        7 => (BusEvent::EchoesLate(rng.whole(1, 30) * 1_000_000), long_ms),
        8 => (BusEvent::EchoesLost(rng.whole(1, 40)), 0),
        9 => (BusEvent::Overflow(rng.whole(1, 200)), 0),
        _ if rng.chance(0.2) => (BusEvent::OtherMaster, 0),
        _ => (BusEvent::Foreign(u32::try_from(rng.whole(1, 100)).unwrap_or(1)), 0),
    };
    Event::Bus { bus, event, for_ms }
}

fn drive_event(rng: &mut SeededRng, settings: &Settings) -> Event {
    let joint = rng.index(settings.robot.joints.len());
    let is_cia402 = settings.servos[joint].protocol.get::<Cia402>().is_some();
    let kind = match rng.whole(0, 7) {
        0 | 1 => FaultKind::Silence,
        2 => FaultKind::Delay { by_s: rng.within(0.001, 0.08) },
        3 => FaultKind::Drop { probability: rng.within(0.01, 0.3) },
        4 => FaultKind::Fault { code: if is_cia402 { 0x2310 } else { 0xA } },
        5 => FaultKind::Stuck,
        6 => FaultKind::Warning,
        _ => FaultKind::Restart,
    };
    Event::Drive { joint, kind, for_ms: rng.whole(5, 800) }
}
