//! What a protocol puts on its bus: kinds of frames and how often each comes.
use super::frame::{BitRates, Format, Frame};
use crate::settings::Traffic;

/// Period of the heartbeats that CANopen drives send, and that their master sends.
pub const HEARTBEAT_MS: u16 = 100;
/// On a bus with packed setpoints, controlwords have frames of their own. They are sent when they change, and repeated
/// in every so many turns of their drive, in case one was lost: 8 ms at 1 kHz, for less than 1 % of the bus a drive.
pub const CONTROL_REPEAT_TURNS: u32 = 8;

/// One kind of frame on a bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flow {
    /// What it is: "setpoints".
    pub what: &'static str,
    /// Its format and size.
    pub frame: Frame,
    /// Frames a second.
    pub rate_hz: f64,
    /// Frames in the fullest cycle.
    pub burst: u32,
}

impl Flow {
    /// Share of a second that it takes in the worst case.
    #[must_use]
    pub fn share(&self, rates: BitRates) -> f64 {
        self.rate_hz * self.frame.most_bits().seconds(rates)
    }
    /// Time that it takes of the fullest cycle in the worst case, s.
    #[must_use]
    pub fn burst_s(&self, rates: BitRates) -> f64 {
        f64::from(self.burst) * self.frame.most_bits().seconds(rates)
    }
}

/// The share of a bus that flows take in the worst case, in percent.
#[must_use]
pub fn percent(flows: &[Flow], rates: BitRates) -> f64 {
    100.0 * flows.iter().map(|flow| flow.share(rates)).sum::<f64>()
}

/// CiA 402 drives on one bus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cia402Bus {
    /// How many.
    pub drives: u32,
    /// SYNCs a second.
    pub cycle_hz: f64,
    /// How often, and how packed.
    pub traffic: Traffic,
    /// Data bytes of a plain setpoint.
    pub setpoint_bytes: u32,
    /// Data bytes of an answer; 0: there are none.
    pub answer_bytes: u32,
    /// Frames on the wire. This driver sends classic ones on every bus: CiA 402 over CAN FD is another protocol (CiA
    /// 1301), and the figure is for planning with drives that have it.
    pub format: Format,
}

impl Cia402Bus {
    /// SYNC, setpoints and answers: what design tables count.
    #[must_use]
    pub fn process_data(&self) -> Vec<Flow> {
        let flow = |what, bytes, rate_hz, burst| Flow {
            what,
            frame: Frame::standard(self.format, bytes),
            rate_hz,
            burst,
        };
        let Traffic { setpoint_every, stagger, feedback_every, packed } = self.traffic;
        let turns = if stagger { setpoint_every.max(1) } else { 1 };
        let setpoint_hz = self.cycle_hz / f64::from(setpoint_every.max(1));
        let answer_hz = self.cycle_hz / f64::from(feedback_every.max(1));
        let pairs = if packed { self.drives / 2 } else { 0 };
        let plain = self.drives - 2 * pairs;
        let mut flows = vec![flow("SYNC", 0, self.cycle_hz, 1)];
        if pairs > 0 {
            let rate_hz = f64::from(pairs) * setpoint_hz;
            flows.push(flow("setpoints, packed in pairs", 8, rate_hz, pairs.div_ceil(turns)));
        }
        if plain > 0 {
            let rate_hz = f64::from(plain) * setpoint_hz;
            flows.push(flow("setpoints", self.setpoint_bytes, rate_hz, plain.div_ceil(turns)));
        }
        if self.answer_bytes > 0 {
            // The drives count SYNCs each from its own start: they may all answer the same one.
            let rate_hz = f64::from(self.drives) * answer_hz;
            flows.push(flow("answers", self.answer_bytes, rate_hz, self.drives));
        }
        flows
    }

    /// What comes beside the process data, as this driver configures its drives.
    #[must_use]
    pub fn service(&self) -> Vec<Flow> {
        let heartbeats = self.drives + 1;
        let heartbeat = Flow {
            what: "heartbeats",
            frame: Frame::standard(self.format, 1),
            rate_hz: f64::from(heartbeats) * 1000.0 / f64::from(HEARTBEAT_MS),
            burst: heartbeats,
        };
        let controlled = if self.traffic.packed { self.drives / 2 * 2 } else { 0 };
        let turn_hz = self.cycle_hz / f64::from(self.traffic.setpoint_every.max(1));
        let control = (controlled > 0).then(|| Flow {
            what: "controlwords, repeated",
            frame: Frame::standard(self.format, 2),
            rate_hz: f64::from(controlled) * turn_hz / f64::from(CONTROL_REPEAT_TURNS),
            // The pairs repeat theirs in different turns, unless there are more pairs than turns.
            burst: 2 * (controlled / 2).div_ceil(CONTROL_REPEAT_TURNS),
        });
        control.into_iter().chain([heartbeat]).collect()
    }
}

/// Servos that answer each command with one frame (Damiao, RMD motion mode, AK, `RobStride`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exchange {
    /// How many servos.
    pub servos: u32,
    /// Commands a second to each.
    pub cycle_hz: f64,
    /// The command.
    pub command: Frame,
    /// The answer.
    pub answer: Option<Frame>,
}

impl Exchange {
    /// Commands and answers.
    #[must_use]
    pub fn flows(&self) -> Vec<Flow> {
        let flow = |what, frame| Flow {
            what,
            frame,
            rate_hz: f64::from(self.servos) * self.cycle_hz,
            burst: self.servos,
        };
        let answers = self.answer.map(|frame| flow("answers", frame));
        [flow("commands", self.command)].into_iter().chain(answers).collect()
    }
}

/// Frames that a servo sends by itself.
#[must_use]
pub fn periodic(what: &'static str, frame: Frame, count: u32, rate_hz: f64) -> Flow {
    Flow { what, frame, rate_hz: f64::from(count) * rate_hz, burst: count }
}
