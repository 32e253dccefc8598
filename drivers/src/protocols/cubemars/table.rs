//! How a `CubeMars` AK motor is asked, and what can be known of it.
//!
//! The protocol cannot tell whether a motor carries torque, and has no request that only looks: "enter motor mode" energises,
//! "leave motor mode" de-energises, and a command to an energised motor replaces the one that holds its load. So a motor is
//! first not asked at all. A feedback or a request that comes without ours shows that another master has it, and it is left
//! alone. After silence for longer than the motor's own watchdog, which the settings state and the maker's tool sets, a motor
//! that was energised has dropped its command by itself: now to leave motor mode changes nothing that it does.
//!
//! From then on its state is what it was asked last: each feedback answers a request.
use super::frames::{Feedback, Request, Special, error_words};
use crate::codec::mit::{MitCommand, MitRanges};
use crate::frame::CanFrame;
use crate::motors::{
    AnsweringMotor, Ask, Job, MotorCommand, MotorFeedback, MotorWords, Outbox, ParameterWords, PowerWord,
    Reply,
};
use crate::protocols::DriverError;
use taustream_arm::{CubeMars, Servo};

/// Time between two looks at a motor that is waited for: the machine's.
const LOOK_MS: u32 = 100;
/// "Enter" is sent so many times: a lost one would not be noticed.
const ENTER_TIMES: u8 = 3;

pub(super) const WORDS: MotorWords = MotorWords {
    addressing: "the bit rate (1 Mbit/s), node_id, feedback_id and that its firmware is in MIT mode",
    simulated_addressing: "its node_id and feedback_id in the settings",
    release: "wait until its watchdog (watchdog_ms) has passed since that program's last frame",
    parameter_noun: "parameter",
    parameter: |_| ParameterWords { name: "unknown", key: "no key" },
    value: |_, value| u32::from_le_bytes(value).to_string(),
    error: |error| format!("error {error}: {}", error_words(error)),
};

/// A status word as text: "error 2, 35 C".
pub(super) fn status_text(word: u32) -> String {
    let (error, celsius) = (word & 0xFF, i64::from(word >> 8 & 0xFF) - 40);
    match (word >> 16 & 1, error) {
        // Old firmware.
        (0, _) => "no temperature".to_owned(),
        (_, 0) => format!("no error, {celsius} C"),
        (_, error) => format!("error {error}, {celsius} C"),
    }
}

/// What a motor is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Belief {
    /// Another master may have energised it. It was not asked for so many looks.
    Unknown(u32),
    /// Not in motor mode.
    Off,
    /// In motor mode.
    On,
}

/// How one motor is addressed and scaled, and what it is taken for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeMarsTable {
    node_id: u8,
    settings: CubeMars,
    belief: Belief,
    /// How many more times "enter" is sent.
    enter: u8,
    error: u8,
    /// Newest angle that it was sent to, or measured before it was sent anywhere.
    at_rad: f64,
}

impl CubeMarsTable {
    /// The motor of a servo; none when it speaks something else.
    ///
    /// # Errors
    /// A node id that the settings do not allow.
    pub fn new(servo: &Servo) -> Result<Option<Self>, DriverError> {
        let Some(settings) = servo.protocol.get::<CubeMars>().copied() else { return Ok(None) };
        let (joint, node_id) = (servo.joint, servo.node_id);
        if !(1..=127).contains(&node_id) {
            return Err(DriverError::NodeId { joint, node_id, words: "CubeMars motors have 1 to 127 here" });
        }
        Ok(Some(Self { node_id, settings, belief: Belief::Unknown(0), enter: 0, error: 0, at_rad: 0.0 }))
    }

    const fn ranges(&self) -> MitRanges {
        let reach = &self.settings.ranges;
        MitRanges::symmetric(reach.position_rad, reach.velocity_rad_s, reach.torque_nm)
    }

    /// Looks without a request before one is sent: its watchdog, and one more for a look that began before.
    const fn quiet_looks(&self) -> u32 {
        self.settings.watchdog_ms.div_ceil(LOOK_MS) + 1
    }

    fn special(&self, special: Special) -> CanFrame {
        Request::Special(special).encode(self.node_id)
    }

    /// A command without gains and torque, to where it is: what the motor remembers of it does nothing.
    fn neutral(&self) -> Option<CanFrame> {
        let command = MitCommand { position_rad: self.at_rad, ..MitCommand::default() };
        let packed = command.encode(&self.ranges())?;
        Some(Request::Mit(packed).encode(self.node_id))
    }

    fn refresh(&mut self, out: &mut Outbox<'_>) {
        match self.belief {
            Belief::Unknown(looks) if looks < self.quiet_looks() => self.belief = Belief::Unknown(looks + 1),
            // To leave motor mode would clear the error, which is the operator's to clear.
            Belief::Off | Belief::On if self.error != 0 => {
                if let Some(frame) = self.neutral() {
                    out.push(frame);
                }
            }
            Belief::Unknown(_) | Belief::Off | Belief::On => {
                self.belief = Belief::Off;
                out.push(self.special(Special::Exit));
            }
        }
    }

    fn command(&mut self, command: &MotorCommand, out: &mut Outbox<'_>) {
        if self.enter > 0 {
            self.enter -= 1;
            out.push(self.special(Special::Enter));
        }
        self.at_rad = command.position_rad;
        let gains = &self.settings.gains;
        let command = MitCommand {
            position_rad: command.position_rad,
            velocity_rad_s: command.velocity_rad_s,
            stiffness_nm_rad: command.gain_share * gains.stiffness_nm_rad,
            damping_nm_s_rad: command.gain_share * gains.damping_nm_s_rad,
            torque_nm: command.torque_nm,
        };
        if let Some(packed) = command.encode(&self.ranges()) {
            out.setpoint(Request::Mit(packed).encode(self.node_id));
        }
    }

    fn feedback(&mut self, feedback: Feedback) -> MotorFeedback {
        self.error = feedback.error();
        if let Belief::Unknown(_) = self.belief {
            // Nobody here has asked.
            self.belief = Belief::Unknown(0);
        }
        let state = feedback.values(&self.ranges());
        if self.belief != Belief::On {
            self.at_rad = state.position_rad;
        }
        let [temperature, error] = feedback.health.unwrap_or_default();
        MotorFeedback {
            power: match self.belief {
                _ if self.error != 0 => PowerWord::Error,
                Belief::Off => PowerWord::Off,
                Belief::On | Belief::Unknown(_) => PowerWord::On,
            },
            lost_master: false,
            error: self.error,
            status_word: u32::from(error)
                | u32::from(temperature) << 8
                | u32::from(feedback.health.is_some()) << 16,
            warning: false,
            state,
        }
    }
}

impl AnsweringMotor for CubeMarsTable {
    const CODES: u16 = super::CODES;
    const WORDS: MotorWords = WORDS;
    const COMMAND_BEFORE_ENABLE: bool = true;

    fn encode(&mut self, ask: Ask, out: &mut Outbox<'_>) {
        match ask {
            Ask::Refresh => self.refresh(out),
            Ask::Enable => {
                (self.belief, self.enter) = (Belief::On, ENTER_TIMES - 1);
                out.push(self.special(Special::Enter));
                // At once: it may remember a command of an earlier master.
                if let Some(frame) = self.neutral() {
                    out.push(frame);
                }
            }
            Ask::Disable => {
                (self.belief, self.enter) = (Belief::Off, 0);
                // First: it remembers its newest command, and would take it up at the next "enter".
                if let Some(frame) = self.neutral() {
                    out.push(frame);
                }
                out.push(self.special(Special::Exit));
            }
            Ask::SetZero => out.push(self.special(Special::SetZero)),
            Ask::ClearError => {
                (self.belief, self.enter) = (Belief::Off, 0);
                out.push(self.special(Special::Exit));
            }
            // It has no parameters.
            Ask::Read(_) | Ask::Write(..) => {}
            Ask::Command(command) => self.command(&command, out),
        }
    }

    fn decode(&mut self, frame: &CanFrame) -> Option<Reply> {
        let feedback = Feedback::decode(frame, self.node_id, self.settings.feedback_id);
        if feedback.is_none() && self.is_to(frame) && self.belief != Belief::On {
            // Another master speaks to it: what it is now, nobody here knows.
            self.belief = Belief::Unknown(0);
        }
        Some(Reply::Feedback(self.feedback(feedback?)))
    }

    fn is_to(&self, frame: &CanFrame) -> bool {
        Request::is_to(frame, self.node_id, self.settings.feedback_id)
    }

    fn configure(&self) -> &'static [Job] {
        &[]
    }

    fn verify(&self) -> &'static [Job] {
        &[]
    }

    fn wanted(&self, _: u16) -> [u8; 4] {
        [0; 4]
    }

    fn ramp_ns(&self) -> u64 {
        u64::from(self.settings.gains.gain_ramp_ms) * 1_000_000
    }

    fn forget(&mut self) {
        (self.belief, self.enter, self.error) = (Belief::Unknown(0), 0, 0);
    }
}
