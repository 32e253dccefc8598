//! What a `RobStride` motor's parameters must hold, in the order in which they are looked at and written, and how it is asked.
//!
//! The motor has no request that only asks for its state. It is looked at by reading its limit of torque and writing the same
//! value back: the answer to a write is a feedback, which says whether it is energised. The watchdog is not used for that: a
//! motor that restarted is known by its watchdog, which it has forgotten.
//!
//! Nothing is kept in the motor's flash: what was written is gone with the power, and is looked at again before the motor
//! is energised.
use super::fault_words::fault_words;
use super::frames::{
    Feedback, Mode, Operation, Parameter, Reply as FrameReply, Request, TIMEOUT_UNITS_A_MS, ranges,
};
use crate::codec::mit::{MitCommand, MitRanges};
use crate::frame::CanFrame;
use crate::motors::{
    AnsweringMotor, Ask, Job, MotorCommand, MotorFeedback, MotorWords, Outbox, ParameterWords, PowerWord,
    Reply, is_same,
};
use crate::protocols::DriverError;
use taustream_arm::{RobStride, Servo};

const RUN_MODE: u16 = Parameter::RunMode.index();
const TORQUE_LIMIT: u16 = Parameter::TorqueLimit.index();
const POSITION: u16 = Parameter::Position.index();
const TIMEOUT: u16 = Parameter::Timeout.index();

const CONFIGURE: [Job; 7] = [
    Job::Read(TORQUE_LIMIT),
    Job::Read(POSITION),
    Job::ReadToSkip(RUN_MODE, 2),
    Job::Send(RUN_MODE),
    Job::ReadSettled(RUN_MODE),
    Job::Send(TIMEOUT),
    Job::Read(TIMEOUT),
];
const VERIFY: [Job; 4] =
    [Job::Read(TORQUE_LIMIT), Job::Read(POSITION), Job::Read(RUN_MODE), Job::Read(TIMEOUT)];

/// How far the angle on the wire may lie from the angle in rad. A joint that is moved by hand has moved meanwhile.
const POSITION_NEAR_RAD: f64 = 0.02;
/// Temperature from which the motor warns, 0.1 degrees Celsius.
const HOT_DECICELSIUS: u16 = 1350;
/// Errors of a fault report alone: this, and the number of the bit.
const REPORTED: u8 = 0x40;

pub(super) const WORDS: MotorWords = MotorWords {
    addressing: "the bit rate (1 Mbit/s), node_id (CAN_ID) and that it speaks the private protocol",
    simulated_addressing: "its node_id in the settings",
    release: "switch off its power",
    parameter_noun: "parameter",
    parameter: |index| {
        Parameter::from_index(index).map_or(ParameterWords { name: "unknown", key: "no key" }, |parameter| {
            ParameterWords { name: parameter.name(), key: parameter.key() }
        })
    },
    value: |index, value| match Parameter::from_index(index) {
        Some(Parameter::RunMode) => u32::from(value[0]).to_string(),
        Some(Parameter::Timeout) => u32::from_le_bytes(value).to_string(),
        Some(Parameter::TorqueLimit | Parameter::Position) | None => f32::from_le_bytes(value).to_string(),
    },
    error: |error| fault_words(error, REPORTED),
};

/// A status word as text: "run, 35.0 C".
pub(super) fn status_text(word: u32) -> String {
    let mode = match word & 3 {
        0 => "reset",
        1 => "calibration",
        2 => "run",
        _ => "unknown mode",
    };
    let (faults, celsius) = (word >> 8 & 0x3F, f64::from(word >> 16) / 10.0);
    if faults == 0 {
        format!("{mode}, {celsius:.1} C")
    } else {
        format!("{mode}, faults 0x{faults:02X}, {celsius:.1} C")
    }
}

/// What one motor is to hold, how it is addressed, and what it has said.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobStrideTable {
    node_id: u8,
    settings: RobStride,
    /// The limit of torque as it was just read, to be written back for the feedback that answers.
    held: Option<[u8; 4]>,
    /// It was read for that.
    looking: bool,
    /// It was configured here, and nobody else has spoken to it since: it holds what the settings want.
    ours: bool,
    /// Angle of the newest feedback.
    position_rad: f64,
    /// Faults of the newest fault report.
    reported: u32,
}

impl RobStrideTable {
    /// The motor of a servo; none when it speaks something else.
    ///
    /// # Errors
    /// A node id that the protocol does not have.
    pub fn new(servo: &Servo) -> Result<Option<Self>, DriverError> {
        let Some(settings) = servo.protocol.get::<RobStride>().copied() else { return Ok(None) };
        let (joint, node_id) = (servo.joint, servo.node_id);
        if !(1..=super::frames::NODE_ID_MAX).contains(&node_id) {
            return Err(DriverError::NodeId { joint, node_id, words: "RobStride motors have 1 to 127" });
        }
        Ok(Some(Self {
            node_id,
            settings,
            held: None,
            looking: false,
            ours: false,
            position_rad: f64::NAN,
            reported: 0,
        }))
    }

    const fn ranges(&self) -> MitRanges {
        let (reach, [stiffness, damping]) = (&self.settings.ranges, self.settings.gains_max);
        ranges([reach.position_rad, reach.velocity_rad_s, reach.torque_nm], stiffness, damping)
    }

    fn request(&mut self, ask: Ask) -> Option<Request> {
        Some(match ask {
            Ask::Refresh if self.ours => Request::Write(TORQUE_LIMIT, self.wanted(TORQUE_LIMIT)),
            Ask::Refresh => {
                let held = self.held.take();
                self.looking = held.is_none();
                held.map_or(Request::Read(TORQUE_LIMIT), |held| Request::Write(TORQUE_LIMIT, held))
            }
            Ask::Enable => Request::Enable,
            Ask::Disable => Request::Stop,
            Ask::SetZero => Request::SetZero,
            Ask::ClearError => {
                self.reported = 0;
                Request::ClearFault
            }
            Ask::Read(index) => Request::Read(index),
            Ask::Write(index, value) => {
                self.ours = true;
                Request::Write(index, value)
            }
            Ask::Command(command) => return self.command(&command),
        })
    }

    fn command(&self, command: &MotorCommand) -> Option<Request> {
        let gains = &self.settings.gains;
        let command = MitCommand {
            position_rad: command.position_rad,
            velocity_rad_s: command.velocity_rad_s,
            stiffness_nm_rad: command.gain_share * gains.stiffness_nm_rad,
            damping_nm_s_rad: command.gain_share * gains.damping_nm_s_rad,
            torque_nm: command.torque_nm,
        };
        Operation::encode(&command, &self.ranges()).map(Request::Operation)
    }

    fn feedback(&mut self, feedback: Feedback) -> MotorFeedback {
        let state = feedback.values(&self.ranges());
        self.position_rad = state.position_rad;
        let Feedback { mode, faults, decicelsius, .. } = feedback;
        let reported = self.reported;
        let bit = u8::try_from(reported.trailing_zeros()).unwrap_or(0);
        let error = match (faults, mode) {
            (0, Mode::Reset) if reported != 0 => REPORTED | bit & 0x1F,
            (faults, _) => faults,
        };
        MotorFeedback {
            power: match mode {
                _ if error != 0 => PowerWord::Error,
                Mode::Reset => PowerWord::Off,
                // A calibration moves the motor, and who knows what an unknown mode does.
                Mode::Run | Mode::Calibration | Mode::Unknown => PowerWord::On,
            },
            // It says no more than that it has no torque.
            lost_master: false,
            error,
            status_word: mode as u32 | u32::from(faults) << 8 | u32::from(decicelsius) << 16,
            warning: decicelsius >= HOT_DECICELSIUS,
            state,
        }
    }

    fn value(&mut self, index: u16, read: bool, value: [u8; 4]) -> Reply {
        let looking = self.looking && index == TORQUE_LIMIT;
        if looking {
            (self.looking, self.held) = (false, read.then_some(value));
        }
        if looking || !read { Reply::Noted } else { Reply::Value { parameter: index, written: false, value } }
    }

    /// The angle in rad and the angle on the wire are one, but for whole turns of the field, which repeats.
    fn is_here(&self, held_rad: f64) -> bool {
        let period_rad = 2.0 * self.settings.ranges.position_rad;
        let off_rad = held_rad - self.position_rad;
        // False for what is no number.
        (off_rad - (off_rad / period_rad).round() * period_rad).abs() <= POSITION_NEAR_RAD
    }
}

impl AnsweringMotor for RobStrideTable {
    const CODES: u16 = super::CODES;
    const WORDS: MotorWords = WORDS;
    const COMMAND_BEFORE_ENABLE: bool = true;

    fn encode(&mut self, ask: Ask, out: &mut Outbox<'_>) {
        if let Some(request) = self.request(ask) {
            let frame = request.encode(self.settings.host_id, self.node_id);
            if request.is_setpoint() { out.setpoint(frame) } else { out.push(frame) }
        }
    }

    fn decode(&mut self, frame: &CanFrame) -> Option<Reply> {
        if self.is_to(frame) {
            (self.ours, self.held) = (false, None);
        }
        Some(match FrameReply::decode(frame, self.node_id, self.settings.host_id)? {
            FrameReply::Feedback(feedback) => Reply::Feedback(self.feedback(feedback)),
            FrameReply::Value { index, read, value } => self.value(index, read, value),
            FrameReply::Fault { faults, .. } => {
                self.reported = faults;
                Reply::Noted
            }
            FrameReply::Identity(_) | FrameReply::Version(_) => Reply::Noted,
        })
    }

    fn is_to(&self, frame: &CanFrame) -> bool {
        Request::is_to(frame, self.node_id)
    }

    fn configure(&self) -> &'static [Job] {
        &CONFIGURE
    }

    fn verify(&self) -> &'static [Job] {
        &VERIFY
    }

    fn wanted(&self, parameter: u16) -> [u8; 4] {
        #[expect(clippy::cast_possible_truncation, reason = "the parameter is this wide")]
        let narrow = |value: f64| (value as f32).to_le_bytes();
        match parameter {
            TIMEOUT => self.settings.watchdog_ms.saturating_mul(TIMEOUT_UNITS_A_MS).to_le_bytes(),
            TORQUE_LIMIT => narrow(self.settings.torque_limit_nm),
            POSITION => narrow(self.position_rad),
            // Operation control.
            _ => [0; 4],
        }
    }

    fn agrees(&self, parameter: u16, value: [u8; 4]) -> bool {
        let [first, ..] = value;
        match parameter {
            TORQUE_LIMIT => is_same(f32::from_le_bytes(value), f32::from_le_bytes(self.wanted(parameter))),
            POSITION => self.is_here(f64::from(f32::from_le_bytes(value))),
            // One byte; what stands behind it is nobody's.
            RUN_MODE => first == 0,
            _ => value == self.wanted(parameter),
        }
    }

    fn ramp_ns(&self) -> u64 {
        u64::from(self.settings.gains.gain_ramp_ms) * 1_000_000
    }

    fn forget(&mut self) {
        (self.held, self.looking, self.ours) = (None, false, false);
        (self.position_rad, self.reported) = (f64::NAN, 0);
    }
}
