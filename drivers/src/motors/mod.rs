//! Motors that answer each command: one machine for all of them, and what a protocol adds to it.
//!
//! Such a motor speaks when it is spoken to. Every cycle has one request for it: a command while it is energised, a request
//! for feedback or a parameter else. A protocol of this kind is an [`AnsweringMotor`]: how requests and answers look as
//! frames, which parameters make the motor this master's, and the words for its errors. Order, time limits and what is
//! never done (a motor that somebody else energised is not touched) are the machine's.
pub mod driver;
pub mod fault;
pub mod machine;

pub use driver::{MotorDriver, MotorJoint};
pub use fault::{MotorFault, MotorWords, ParameterWords};

use crate::codec::mit::MitState;
use crate::frame::{CanFrame, FrameBatch, JointSet};
use std::fmt::Debug;

/// What a motor is asked in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ask {
    /// Its state.
    Refresh,
    /// To energise.
    Enable,
    /// To de-energise.
    Disable,
    /// To take the angle where it stands as its zero, for good.
    SetZero,
    /// To forget its error.
    ClearError,
    /// The value of a parameter.
    Read(u16),
    /// To take a value for a parameter.
    Write(u16, [u8; 4]),
    /// To follow.
    Command(MotorCommand),
}

/// The command of one cycle, motor side. Every number is finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorCommand {
    /// Wanted angle.
    pub position_rad: f64,
    /// Wanted velocity.
    pub velocity_rad_s: f64,
    /// Torque on top; the share of the gains is in it already.
    pub torque_nm: f64,
    /// Part of the settings' gains, 0 to 1: they rise when the motor is energised.
    pub gain_share: f64,
}

/// What a motor says of its power stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PowerWord {
    /// Without torque.
    #[default]
    Off,
    /// Energised.
    On,
    /// In an error, without torque.
    Error,
}

/// What a motor says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorFeedback {
    /// Its power stage.
    pub power: PowerWord,
    /// It has de-energised itself because no command came.
    pub lost_master: bool,
    /// Its own error, 0 to 0xFF, for [`MotorWords::error`].
    pub error: u8,
    /// Its states, as [`crate::ServoStatus::status_word`] has them.
    pub status_word: u32,
    /// It warns.
    pub warning: bool,
    /// Motor side; NaN where it does not say.
    pub state: MitState,
}

impl MotorFeedback {
    /// Before the first.
    pub const NONE: Self = Self {
        power: PowerWord::Off,
        lost_master: false,
        error: 0,
        status_word: 0,
        warning: false,
        state: MitState { position_rad: f64::NAN, velocity_rad_s: f64::NAN, torque_nm: f64::NAN },
    };
}

/// What a frame of a motor means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// Its state.
    Feedback(MotorFeedback),
    /// The value of a parameter, after a read or a write.
    Value {
        /// Its number.
        parameter: u16,
        /// It was written.
        written: bool,
        /// As it stands in the frame.
        value: [u8; 4],
    },
    /// The motor's own, and nothing that is waited for: it lives.
    Noted,
}

/// One look at, or write to, a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Job {
    /// Read it: it must agree with the settings.
    Read(u16),
    /// Read it; where it agrees, this many of the following jobs are not needed.
    ReadToSkip(u16, usize),
    /// Write it; its echo must say the same.
    Write(u16),
    /// Write it to a motor that does not echo; a read follows.
    Send(u16),
    /// Read it once the motor has had time to change.
    ReadSettled(u16),
}

impl Job {
    /// Its parameter.
    #[must_use]
    pub const fn parameter(self) -> u16 {
        match self {
            Self::Read(number)
            | Self::ReadToSkip(number, _)
            | Self::Write(number)
            | Self::Send(number)
            | Self::ReadSettled(number) => number,
        }
    }
}

/// A protocol whose motors answer each command.
pub trait AnsweringMotor: Clone + Debug + Send + 'static {
    /// The upper half of its error codes, which no other protocol has (see [`crate::protocols`]).
    const CODES: u16;
    /// Its words.
    const WORDS: MotorWords;
    /// An earlier command of the motor could take effect when it is energised: one without gains goes first.
    const COMMAND_BEFORE_ENABLE: bool;

    /// The frames of a request.
    ///
    /// Real time: arithmetic only.
    fn encode(&mut self, ask: Ask, out: &mut Outbox<'_>);

    /// What a frame says, when it is this motor's. Takes any frame.
    ///
    /// Real time: arithmetic only.
    fn decode(&mut self, frame: &CanFrame) -> Option<Reply>;

    /// True for a frame by which a master speaks to this motor. Our own frames do not come back.
    fn is_to(&self, frame: &CanFrame) -> bool;

    /// From the first look to a configured motor.
    fn configure(&self) -> &'static [Job];

    /// Looked at again before every energising: a motor that restarted has forgotten.
    fn verify(&self) -> &'static [Job];

    /// What the settings want a parameter to hold, as it stands in a frame.
    fn wanted(&self, parameter: u16) -> [u8; 4];

    /// Whether a value is what the settings want.
    fn agrees(&self, parameter: u16, value: [u8; 4]) -> bool {
        value == self.wanted(parameter)
    }

    /// Time in which gains rise; 0 where there are none.
    fn ramp_ns(&self) -> u64;

    /// Its zero can be set by a command.
    fn sets_zero(&self) -> bool {
        true
    }

    /// Everything that is remembered of the motor is of another one now.
    fn forget(&mut self) {}
}

/// Takes the frames of a request, with the joint whose setpoint they hold.
#[derive(Debug)]
pub struct Outbox<'a> {
    batch: &'a mut FrameBatch,
    joint: usize,
}

impl<'a> Outbox<'a> {
    /// For the motor of a joint.
    pub const fn new(batch: &'a mut FrameBatch, joint: usize) -> Self {
        Self { batch, joint }
    }
    /// A frame that holds a setpoint.
    pub fn setpoint(&mut self, frame: CanFrame) {
        self.batch.push_setpoints(frame, JointSet::of(self.joint));
    }
    /// Any other frame.
    pub fn push(&mut self, frame: CanFrame) {
        self.batch.push(frame);
    }
}

/// The same number but for the last digits of a decimal fraction; never for what is no number.
#[must_use]
pub fn is_same(held: f32, wanted: f32) -> bool {
    (held - wanted).abs() <= 1e-6 * wanted.abs()
}
