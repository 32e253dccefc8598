//! What a Damiao motor's registers must hold, in the order in which they are looked at and written, and how it is asked.
//!
//! Nothing is kept in the motor's flash: what was written is gone with the power, and is looked at again before the motor
//! is energised.
use super::frames::{
    Feedback, Register, Reply as FrameReply, Request, STATUS_DISABLED, STATUS_ENABLED,
    STATUS_LOST_COMMUNICATION, Special, TIMEOUT_UNITS_A_MS, Wire, is_integer, mode_number, status_words,
};
use crate::codec::mit::{MitCommand, MitRanges};
use crate::frame::CanFrame;
use crate::motors::{
    AnsweringMotor, Ask, Job, MotorCommand, MotorFeedback, MotorWords, Outbox, ParameterWords, PowerWord,
    Reply, is_same,
};
use crate::protocols::DriverError;
use taustream_arm::{Damiao, DamiaoMode, Servo, Settings};

const POSITION_RANGE: u16 = Register::PositionRange as u16;
const VELOCITY_RANGE: u16 = Register::VelocityRange as u16;
const TORQUE_RANGE: u16 = Register::TorqueRange as u16;
const MODE: u16 = Register::Mode as u16;
const TIMEOUT: u16 = Register::Timeout as u16;

const CONFIGURE: [Job; 8] = [
    Job::Read(POSITION_RANGE),
    Job::Read(VELOCITY_RANGE),
    Job::Read(TORQUE_RANGE),
    Job::ReadToSkip(MODE, 2),
    Job::Write(MODE),
    Job::ReadSettled(MODE),
    Job::Write(TIMEOUT),
    Job::Read(TIMEOUT),
];
const VERIFY: [Job; 5] = [
    Job::Read(POSITION_RANGE),
    Job::Read(VELOCITY_RANGE),
    Job::Read(TORQUE_RANGE),
    Job::Read(MODE),
    Job::Read(TIMEOUT),
];

pub(super) const WORDS: MotorWords = MotorWords {
    addressing: "the bit rate (register 35), node_id (register 8) and feedback_id (register 7)",
    simulated_addressing: "its node_id and feedback_id in the settings",
    release: "wait until its own watchdog (TIMEOUT) disables it",
    parameter_noun: "register",
    parameter: |number| {
        let register = u8::try_from(number).ok().and_then(Register::from_number);
        register.map_or(ParameterWords { name: "unknown", key: "no key" }, |register| ParameterWords {
            name: register.name(),
            key: register.key(),
        })
    },
    value: |number, value| match u8::try_from(number) {
        Ok(number) if is_integer(number) => u32::from_le_bytes(value).to_string(),
        _ => f32::from_le_bytes(value).to_string(),
    },
    error: |status| format!("status {status:X}: {}", status_words(status)),
};

/// A status word as text: "9 under-voltage".
pub(super) fn status_text(word: u32) -> String {
    let status = (word & 0xF) as u8;
    format!("{status:X} {}", status_words(status).split(';').next().unwrap_or_default())
}

/// What one motor is to hold, and how it is addressed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DamiaoMotor {
    node_id: u8,
    damiao: Damiao,
    /// Largest speed that `pos_vel` commands state.
    speed_rad_s: f64,
    wire: Wire,
}

impl DamiaoMotor {
    /// The motor of a servo; none when it speaks something else.
    ///
    /// # Errors
    /// A node id that feedback has no room for.
    pub fn new(settings: &Settings, servo: &Servo, wire: Wire) -> Result<Option<Self>, DriverError> {
        let Some(damiao) = servo.protocol.get::<Damiao>().copied() else { return Ok(None) };
        let (joint, node_id) = (servo.joint, servo.node_id);
        if !(1..=15).contains(&node_id) {
            return Err(DriverError::NodeId { joint, node_id, words: "Damiao motors have 1 to 15" });
        }
        let limits = settings.slot(joint).map(|joint| joint.limits).unwrap_or_default();
        Ok(Some(Self { node_id, damiao, speed_rad_s: limits.stop.velocity_rad_s, wire }))
    }

    const fn ranges(&self) -> MitRanges {
        let ranges = &self.damiao.ranges;
        MitRanges::symmetric(ranges.position_rad, ranges.velocity_rad_s, ranges.torque_nm)
    }

    fn request(&self, ask: Ask) -> Option<Request> {
        let number = |parameter: u16| (parameter & 0xFF) as u8;
        Some(match ask {
            Ask::Refresh => Request::Refresh,
            Ask::Enable => Request::Special(Special::Enable, 0),
            Ask::Disable => Request::Special(Special::Disable, 0),
            Ask::SetZero => Request::Special(Special::SetZero, 0),
            Ask::ClearError => Request::Special(Special::ClearError, 0),
            Ask::Read(parameter) => Request::Read(number(parameter)),
            Ask::Write(parameter, value) => Request::Write(number(parameter), value),
            Ask::Command(command) => return self.command(&command),
        })
    }

    fn command(&self, command: &MotorCommand) -> Option<Request> {
        match self.damiao.mode {
            DamiaoMode::Mit(gains) => {
                let command = MitCommand {
                    position_rad: command.position_rad,
                    velocity_rad_s: command.velocity_rad_s,
                    stiffness_nm_rad: command.gain_share * gains.stiffness_nm_rad,
                    damping_nm_s_rad: command.gain_share * gains.damping_nm_s_rad,
                    torque_nm: command.torque_nm,
                };
                command.encode(&self.ranges()).map(Request::Mit)
            }
            DamiaoMode::PosVel => {
                #[expect(clippy::cast_possible_truncation, reason = "the frame has this width")]
                let (position_rad, velocity_rad_s) = (command.position_rad as f32, self.speed_rad_s as f32);
                Some(Request::PosVel { position_rad, velocity_rad_s })
            }
        }
    }

    fn feedback(&self, feedback: &Feedback) -> MotorFeedback {
        let Feedback { status, stage_celsius, winding_celsius, .. } = *feedback;
        MotorFeedback {
            power: match status {
                STATUS_DISABLED => PowerWord::Off,
                STATUS_ENABLED => PowerWord::On,
                _ => PowerWord::Error,
            },
            lost_master: status == STATUS_LOST_COMMUNICATION,
            error: status,
            // Status nibble, then the temperatures of power stage and winding, a byte each.
            status_word: u32::from(status) | u32::from(stage_celsius) << 8 | u32::from(winding_celsius) << 16,
            warning: false,
            state: feedback.values(&self.ranges()),
        }
    }

    fn wanted_float(&self, parameter: u16) -> f32 {
        let ranges = &self.damiao.ranges;
        let wanted = match parameter {
            POSITION_RANGE => ranges.position_rad,
            VELOCITY_RANGE => ranges.velocity_rad_s,
            TORQUE_RANGE => ranges.torque_nm,
            _ => f64::NAN,
        };
        #[expect(clippy::cast_possible_truncation, reason = "the register is this wide")]
        let wanted = wanted as f32;
        wanted
    }
}

impl AnsweringMotor for DamiaoMotor {
    const CODES: u16 = super::CODES;
    const WORDS: MotorWords = WORDS;
    const COMMAND_BEFORE_ENABLE: bool = true;

    fn encode(&mut self, ask: Ask, out: &mut Outbox<'_>) {
        if let Some(request) = self.request(ask) {
            let frame = request.encode(self.node_id, self.wire);
            if request.is_setpoint() { out.setpoint(frame) } else { out.push(frame) }
        }
    }

    fn decode(&mut self, frame: &CanFrame) -> Option<Reply> {
        Some(match FrameReply::decode(frame, self.node_id, self.damiao.feedback_id)? {
            FrameReply::Feedback(feedback) => Reply::Feedback(self.feedback(&feedback)),
            FrameReply::Register { number, written, value } => {
                Reply::Value { parameter: u16::from(number), written, value }
            }
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
        match parameter {
            TIMEOUT => self.damiao.watchdog_ms.saturating_mul(TIMEOUT_UNITS_A_MS).to_le_bytes(),
            MODE => mode_number(&self.damiao.mode).to_le_bytes(),
            _ => self.wanted_float(parameter).to_le_bytes(),
        }
    }

    fn agrees(&self, parameter: u16, value: [u8; 4]) -> bool {
        match parameter {
            POSITION_RANGE | VELOCITY_RANGE | TORQUE_RANGE => {
                is_same(f32::from_le_bytes(value), self.wanted_float(parameter))
            }
            _ => value == self.wanted(parameter),
        }
    }

    fn ramp_ns(&self) -> u64 {
        match self.damiao.mode {
            DamiaoMode::Mit(gains) => u64::from(gains.gain_ramp_ms) * 1_000_000,
            DamiaoMode::PosVel => 0,
        }
    }
}
