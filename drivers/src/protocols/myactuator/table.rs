//! What is asked of an RMD motor, in which order, and what its replies mean.
//!
//! A motor does not say in one frame what the machine of motors wants to know: errors and the brake stand in the status, the
//! angle in another reply, and in motion mode there are no errors. So the newest of each is remembered, and the status is
//! asked for now and then while the motor follows. The brake's state is what the motor says of being energised: it is
//! released on enabling, and engaged (after the output was cut) on disabling, by motors without a brake too.
use super::frames::{
    ERRORS, Reply as FrameReply, Request, Status, angle_of, rad_of, speed_limit_of, speed_rad_s,
};
use crate::codec::mit::{MitCommand, MitRanges, MitState};
use crate::frame::CanFrame;
use crate::motors::{
    AnsweringMotor, Ask, Job, MotorCommand, MotorFeedback, MotorWords, Outbox, ParameterWords, PowerWord,
    Reply,
};
use crate::protocols::DriverError;
use taustream_arm::protocol::myactuator::STATUS_EVERY_COMMANDS;
use taustream_arm::{MyActuator, MyActuatorMode, Servo, Settings};

/// First four characters of the model.
const MODEL_HEAD: u16 = 0xB500;
/// The other three.
const MODEL_TAIL: u16 = 0xB501;
const WATCHDOG: u16 = 0xB300;
const REPORT_ERRORS: u16 = 0x2003;

const CONFIGURE: [Job; 4] =
    [Job::Read(MODEL_HEAD), Job::Read(MODEL_TAIL), Job::Write(WATCHDOG), Job::Send(REPORT_ERRORS)];
/// The watchdog is kept over a restart (section 2.31), and written again so that another program's is not believed.
const VERIFY: [Job; 3] = [Job::Read(MODEL_HEAD), Job::Read(MODEL_TAIL), Job::Write(WATCHDOG)];

pub(super) const WORDS: MotorWords = MotorWords {
    addressing: "the bit rate (command 0xB4) and node_id (command 0x79)",
    simulated_addressing: "its node_id in the settings",
    release: "wait until its own watchdog (command 0xB3) cuts its output",
    parameter_noun: "parameter",
    parameter: |number| match number {
        MODEL_HEAD | MODEL_TAIL => ParameterWords { name: "motor model", key: "model" },
        WATCHDOG => ParameterWords { name: "communication interruption protection", key: "watchdog_ms" },
        _ => ParameterWords { name: "unknown", key: "no key" },
    },
    value: |number, value| match number {
        MODEL_HEAD | MODEL_TAIL => {
            let characters =
                value.iter().filter(|byte| byte.is_ascii_graphic()).map(|byte| char::from(*byte));
            let part = if number == MODEL_HEAD { "first" } else { "last" };
            format!("{:?} as its {part} characters", characters.collect::<String>())
        }
        _ => u32::from_le_bytes(value).to_string(),
    },
    error: |number| {
        let known = ERRORS.iter().find(|(bit, _)| bit.trailing_zeros() == u32::from(number));
        let words = known.map_or("an error that its manual does not list", |(_, words)| words);
        format!("error 0x{:04X}: {words}", 1_u32 << (number & 0xF))
    },
};

/// A status word as text: "0x0004 under-voltage, brake released".
pub(super) fn status_text(word: u32) -> String {
    let errors = (word & 0xFFFF) as u16;
    let named: Vec<&str> = ERRORS
        .iter()
        .filter(|(bit, _)| errors & bit != 0)
        .map(|(_, words)| words.split(';').next().unwrap_or_default())
        .collect();
    let named = if named.is_empty() { "no error".to_owned() } else { named.join(", ") };
    let brake = if word & RELEASED == 0 { "brake engaged" } else { "brake released" };
    format!("0x{errors:04X} {named}, {brake}")
}

/// Bit of the status word behind the errors.
const RELEASED: u32 = 0x1_0000;

/// One motor: its settings, and the newest of each of its replies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MyActuatorMotor {
    node_id: u8,
    settings: MyActuator,
    /// Largest speed that commands in position mode state.
    speed_rad_s: f64,
    status: Option<Status>,
    state: MitState,
    /// Questions that take turns.
    turn: u32,
    /// Steps of letting go since the motor was asked for something else.
    let_go: u32,
    /// The parameter that was read last: one reply has both parts of the model.
    read: u16,
}

impl MyActuatorMotor {
    /// The motor of a servo; none when it speaks something else.
    ///
    /// # Errors
    /// A node id that identifiers have no room for.
    pub fn new(settings: &Settings, servo: &Servo) -> Result<Option<Self>, DriverError> {
        let Some(own) = servo.protocol.get::<MyActuator>().copied() else { return Ok(None) };
        let (joint, node_id) = (servo.joint, servo.node_id);
        if !(1..=32).contains(&node_id) {
            return Err(DriverError::NodeId { joint, node_id, words: "MyActuator motors have 1 to 32" });
        }
        let limits = settings.slot(joint).map(|joint| joint.limits).unwrap_or_default();
        Ok(Some(Self {
            node_id,
            settings: own,
            speed_rad_s: limits.stop.velocity_rad_s,
            status: None,
            state: MotorFeedback::NONE.state,
            turn: 0,
            let_go: 0,
            read: MODEL_HEAD,
        }))
    }

    /// The number of this turn among `turns`.
    const fn take_turn(&mut self, turns: u32) -> u32 {
        let turn = self.turn % turns;
        self.turn = self.turn.wrapping_add(1);
        turn
    }

    fn command(&mut self, command: &MotorCommand, out: &mut Outbox<'_>) {
        match self.settings.mode {
            MyActuatorMode::Motion(gains, ranges) => {
                let command = MitCommand {
                    position_rad: command.position_rad,
                    velocity_rad_s: command.velocity_rad_s,
                    stiffness_nm_rad: command.gain_share * gains.stiffness_nm_rad,
                    damping_nm_s_rad: command.gain_share * gains.damping_nm_s_rad,
                    torque_nm: command.torque_nm,
                };
                let spans =
                    MitRanges::symmetric(ranges.position_rad, ranges.velocity_rad_s, ranges.torque_nm);
                if let Some(bytes) = command.encode(&spans) {
                    out.setpoint(Request::Motion(bytes).encode(self.node_id));
                }
            }
            MyActuatorMode::Position => {
                let (angle, speed) = (angle_of(command.position_rad), speed_limit_of(self.speed_rad_s));
                out.setpoint(Request::Position { angle, speed }.encode(self.node_id));
                out.push(Request::Angle.encode(self.node_id));
            }
        }
        if self.take_turn(STATUS_EVERY_COMMANDS) == 0 {
            out.push(Request::Status.encode(self.node_id));
        }
    }

    /// The output first; then the brake, and whether it is engaged.
    const fn let_go(&mut self) -> Request {
        let step = self.let_go % 3;
        self.let_go = self.let_go.wrapping_add(1);
        match step {
            0 => Request::Shutdown,
            1 => Request::Lock,
            _ => Request::Status,
        }
    }

    /// What is known, once there was a status.
    fn feedback(&self, state: MitState) -> Option<Reply> {
        let Status { is_released, errors, winding_celsius, .. } = self.status?;
        Some(Reply::Feedback(MotorFeedback {
            power: match (errors, is_released) {
                (0, false) => PowerWord::Off,
                (0, true) => PowerWord::On,
                _ => PowerWord::Error,
            },
            // Nothing in a reply tells a cut output from an engaged brake.
            lost_master: false,
            error: u8::try_from(errors.trailing_zeros() & 0xF).unwrap_or(0),
            status_word: u32::from(errors)
                | if is_released { RELEASED } else { 0 }
                | u32::from(winding_celsius.to_le_bytes()[0]) << 24,
            warning: false,
            state,
        }))
    }
}

impl AnsweringMotor for MyActuatorMotor {
    const CODES: u16 = super::CODES;
    const WORDS: MotorWords = WORDS;
    const COMMAND_BEFORE_ENABLE: bool = false;

    fn encode(&mut self, ask: Ask, out: &mut Outbox<'_>) {
        if !matches!(ask, Ask::Disable | Ask::Refresh) {
            self.let_go = 0;
        }
        let request = match ask {
            // What is in an error and still released would go on by itself when the error ends (section 8.1).
            Ask::Refresh if self.status.is_some_and(|status| status.errors != 0 && status.is_released) => {
                self.let_go()
            }
            // Whether it is energised comes first.
            Ask::Refresh if self.status.is_none() || self.take_turn(2) == 0 => Request::Status,
            Ask::Refresh => Request::Angle,
            Ask::Enable => {
                out.push(Request::Release.encode(self.node_id));
                Request::Status
            }
            Ask::Disable => self.let_go(),
            Ask::SetZero => {
                out.push(Request::SetZero.encode(self.node_id));
                Request::Reset
            }
            Ask::ClearError => Request::Reset,
            Ask::Read(parameter) => {
                self.read = parameter;
                Request::Model
            }
            Ask::Write(WATCHDOG, value) => Request::Watchdog(u32::from_le_bytes(value)),
            Ask::Write(..) => Request::ReportErrors(true),
            Ask::Command(command) => return self.command(&command, out),
        };
        out.push(request.encode(self.node_id));
    }

    fn decode(&mut self, frame: &CanFrame) -> Option<Reply> {
        match FrameReply::decode(frame, self.node_id)? {
            FrameReply::Status(status) => {
                self.status = Some(status);
                // It tells nothing of the angle.
                self.feedback(MotorFeedback::NONE.state)
            }
            FrameReply::Angle(angle) => {
                self.state.position_rad = rad_of(angle);
                Some(self.feedback(self.state).unwrap_or(Reply::Noted))
            }
            FrameReply::Motion(bytes) => {
                if let MyActuatorMode::Motion(_, ranges) = self.settings.mode {
                    let spans =
                        MitRanges::symmetric(ranges.position_rad, ranges.velocity_rad_s, ranges.torque_nm);
                    self.state = MitState::decode(bytes, &spans);
                }
                Some(self.feedback(self.state).unwrap_or(Reply::Noted))
            }
            FrameReply::Position { speed, .. } => {
                self.state.velocity_rad_s = speed_rad_s(speed);
                Some(Reply::Noted)
            }
            FrameReply::Model([a, b, c, d, e, f, g]) => {
                let value = if self.read == MODEL_HEAD { [a, b, c, d] } else { [e, f, g, 0] };
                Some(Reply::Value { parameter: self.read, written: false, value })
            }
            FrameReply::Watchdog(ms) => {
                Some(Reply::Value { parameter: WATCHDOG, written: true, value: ms.to_le_bytes() })
            }
            FrameReply::Other(_) => Some(Reply::Noted),
        }
    }

    fn is_to(&self, frame: &CanFrame) -> bool {
        Request::decode(frame, self.node_id).is_some()
    }

    fn configure(&self) -> &'static [Job] {
        &CONFIGURE
    }

    fn verify(&self) -> &'static [Job] {
        &VERIFY
    }

    fn wanted(&self, parameter: u16) -> [u8; 4] {
        let [a, b, c, d, e, f, g] = self.settings.model;
        match parameter {
            MODEL_HEAD => [a, b, c, d],
            MODEL_TAIL => [e, f, g, 0],
            WATCHDOG => self.settings.watchdog_ms.to_le_bytes(),
            _ => [1, 0, 0, 0],
        }
    }

    fn ramp_ns(&self) -> u64 {
        match self.settings.mode {
            MyActuatorMode::Motion(gains, _) => u64::from(gains.gain_ramp_ms) * 1_000_000,
            MyActuatorMode::Position => 0,
        }
    }

    fn forget(&mut self) {
        (self.status, self.state) = (None, MotorFeedback::NONE.state);
    }
}
