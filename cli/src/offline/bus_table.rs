//! One bus in `taustream check`: what goes over it, how full that makes it, and the remedies when it is too full.
use serde::Serialize;
use std::fmt;
use taustream_arm::bus_load::flow::Flow;
use taustream_arm::bus_load::frame::Format;
use taustream_arm::bus_load::{BusLoad, REFUSED_PERCENT, WARNED_PERCENT};
use taustream_arm::text::counted;
use taustream_arm::{Bus, Settings, Traffic};

/// One bus.
#[derive(Debug, Serialize)]
pub(super) struct BusTable {
    bus: String,
    interface: String,
    servos: usize,
    /// Null for a virtual bus.
    bitrate_bit_s: Option<u32>,
    /// Null but on CAN FD.
    data_bitrate_bit_s: Option<u32>,
    /// `fits`, `warned`, `refused`, or `virtual`.
    verdict: &'static str,
    /// Worst case over many cycles; of a virtual bus what 1 Mbit/s would have.
    load_percent: f64,
    /// Worst case of the fullest single cycle.
    fullest_cycle_percent: f64,
    setpoint_every: u32,
    stagger: bool,
    feedback_every: u32,
    packed: bool,
    frames: Vec<FrameLine>,
    /// Empty when the bus has room.
    ways_out: Vec<RemedyLine>,
}

/// One kind of frame.
#[derive(Debug, Serialize)]
struct FrameLine {
    what: &'static str,
    format: Format,
    bytes: u32,
    /// Worst-case bits of one frame, pause included.
    nominal_bits: u32,
    /// Of them in the data phase of CAN FD.
    data_bits: u32,
    rate_hz: f64,
    percent: f64,
}

/// One remedy.
#[derive(Debug, Serialize)]
struct RemedyLine {
    what: String,
    load_percent: f64,
    suffices: bool,
}

impl BusTable {
    /// `None` only for a bus that does not exist.
    pub(super) fn of(settings: &Settings, index: usize, bus: &Bus) -> Option<Self> {
        let load = settings.bus_load(index)?;
        let Traffic { setpoint_every, stagger, feedback_every, packed } = bus.traffic;
        let remedies = if load.is_warned() { settings.remedies(index) } else { Vec::new() };
        let remedy = |remedy: taustream_arm::bus_load::LoadRemedy| RemedyLine {
            what: remedy.what,
            load_percent: remedy.percent,
            suffices: remedy.suffices,
        };
        Some(Self {
            bus: bus.name.clone(),
            interface: bus.interface.clone(),
            servos: load.servos,
            bitrate_bit_s: bus.kind.bitrate_bit_s(),
            data_bitrate_bit_s: bus.kind.data_bitrate_bit_s(),
            verdict: verdict(&load),
            load_percent: load.percent,
            fullest_cycle_percent: load.fullest_cycle_percent,
            setpoint_every,
            stagger,
            feedback_every,
            packed,
            frames: load.flows.iter().map(|flow| FrameLine::of(flow, &load)).collect(),
            ways_out: remedies.into_iter().map(remedy).collect(),
        })
    }
}

impl BusTable {
    /// More than the bus can carry.
    pub(super) fn is_refused(&self) -> bool {
        self.verdict == REFUSED
    }
}

/// The word for a bus that is too full.
const REFUSED: &str = "refused";

fn verdict(load: &BusLoad) -> &'static str {
    if load.is_virtual {
        "virtual"
    } else if load.is_refused() {
        REFUSED
    } else if load.is_warned() {
        "warned"
    } else {
        "fits"
    }
}

impl FrameLine {
    fn of(flow: &Flow, load: &BusLoad) -> Self {
        let bits = flow.frame.most_bits();
        Self {
            what: flow.what,
            format: flow.frame.format,
            bytes: flow.frame.bytes,
            nominal_bits: bits.nominal,
            data_bits: bits.data,
            rate_hz: flow.rate_hz,
            percent: 100.0 * flow.share(load.rates),
        }
    }
}

impl fmt::Display for BusTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bus {} on {}: {}, ", self.bus, self.interface, counted(self.servos, "servo"))?;
        match (self.bitrate_bit_s, self.data_bitrate_bit_s) {
            (None, _) => writeln!(
                f,
                "VIRTUAL: no bit rate, so never too full; taken on a vcan interface or the local link only"
            )?,
            (Some(nominal), None) => writeln!(f, "{nominal} bit/s")?,
            (Some(nominal), Some(data)) => writeln!(f, "CAN FD, {nominal} bit/s and {data} bit/s for data")?,
        }
        if let (true, Some(bit_s)) = (self.interface.starts_with("vcan"), self.bitrate_bit_s) {
            let mega = f64::from(bit_s) * 1e-6;
            writeln!(f, "  {} has no bit rate; the simulator models {mega} Mbit/s", self.interface)?;
        }
        writeln!(f, "  frames                       bytes  most bits  frames/s      share")?;
        for line in &self.frames {
            let (bits, share) = (line.nominal_bits + line.data_bits, line.percent);
            let fd = if line.format == Format::Fd { " FD" } else { "" };
            let what = format!("{}{fd}", line.what);
            writeln!(f, "  {what:<28} {:>5} {bits:>10} {:>9.1} {share:>8.2} %", line.bytes, line.rate_hz)?;
        }
        let (percent, fullest) = (self.load_percent, self.fullest_cycle_percent);
        let of = if self.bitrate_bit_s.is_some() { "" } else { " of a bus with 1 Mbit/s" };
        write!(f, "  {percent:.1} %{of} in the worst case; the fullest single cycle {fullest:.1} %")?;
        match self.verdict {
            REFUSED => write!(f, ": REFUSED, more than {REFUSED_PERCENT:.0} %")?,
            "warned" => write!(
                f,
                ": WARNING, above {WARNED_PERCENT:.0} % configuration and repeated frames have little bandwidth left"
            )?,
            _ if fullest > REFUSED_PERCENT && self.bitrate_bit_s.is_some() => {
                write!(f, "; the rest of it waits for the next one")?;
            }
            _ => {}
        }
        if !self.ways_out.is_empty() {
            write!(f, "\n  remedies, with the resulting load of the fullest bus (* suffices alone):")?;
        }
        for remedy in &self.ways_out {
            let mark = if remedy.suffices { '*' } else { ' ' };
            write!(f, "\n  {mark} {:>6.1} %  {}", remedy.load_percent, remedy.what)?;
        }
        Ok(())
    }
}
