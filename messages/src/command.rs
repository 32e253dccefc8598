//! Commands to the streamer and its answers (request-response).
use crate::{AxisGoal, LAYOUT_VERSION, Phase, Text, clock};
use iceoryx2::prelude::ZeroCopySend;
use std::time::Duration;

/// What an operator, or the planner, may ask of the streamer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Energise the drives and hold.
    Enable,
    /// De-energise the drives; only at rest.
    Disable,
    /// sigma to 0, keeping the trajectory.
    Pause,
    /// sigma back to the override.
    Resume,
    /// sigma to 0, then drop the trajectory and hold.
    Stop,
    /// sigma to 0 as fast as the stop limits allow, then fault.
    FastStop,
    /// De-energise at once. The arm may fall.
    TorqueOff,
    /// Speed override in percent, 0 to 100.
    Speed {
        /// The override in percent.
        percent: f64,
    },
    /// Clear a fault after its cause is fixed.
    ClearFault,
    /// The operator sets the angle of a joint; only while nothing is energised.
    Reference {
        /// Zero-based joint.
        joint: u32,
        /// Its true angle.
        at_rad: f64,
    },
    /// Leads an axis that is no joint of the path.
    Axis {
        /// Zero-based axis, in the order of the settings.
        axis: u32,
        /// Where to.
        goal: AxisGoal,
        /// The force that is contact, N or Nm; `None`: the one of the settings.
        force: Option<f64>,
    },
    /// The drive of a joint finds its zero by itself, moving the joint; the others hold.
    Home {
        /// Zero-based joint; axes follow the joints.
        joint: u32,
    },
}

/// A command on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct CommandRequest {
    layout_version: u32,
    code: u32,
    joint: u32,
    has_force: u32,
    value: f64,
    force: f64,
    valid_until_ns: u64,
}

/// The answer on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct CommandReply {
    layout_version: u32,
    accepted: u32,
    phase: u32,
    reserved: u32,
    text: Text,
}

/// Why a request is not a command.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CommandError {
    /// Written by another version.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use command line and streamer of one release")]
    Layout {
        /// The version in the message.
        got: u32,
    },
    /// No such command.
    #[error("unknown command code {got}")]
    Unknown {
        /// The code in the message.
        got: u32,
    },
    /// The override is not a number from 0 to 100.
    #[error("speed is {percent} %; it must be from 0 to 100 %")]
    Percent {
        /// The value in the message.
        percent: f64,
    },
    /// A number of an axis command is not finite.
    #[error("axis: {what} is {value}; it must be a finite number")]
    Axis {
        /// Which number: "position" or "force".
        what: &'static str,
        /// The value in the message.
        value: f64,
    },
    /// The angle of a reference is not a finite number.
    #[error("reference at {at_rad} rad; it must be a finite number")]
    Angle {
        /// The value in the message.
        at_rad: f64,
    },
}

impl CommandRequest {
    /// A request that its sender gives up after `valid_for`; it is not carried out later than that.
    #[must_use]
    pub fn new(command: Command, valid_for: Duration) -> Self {
        Self { valid_until_ns: clock::ns_after(valid_for), ..Self::from(command) }
    }

    fn axis(&self, goal: AxisGoal) -> Result<Command, CommandError> {
        let force = (self.has_force != 0).then_some(self.force);
        match force {
            Some(value) if !value.is_finite() => Err(CommandError::Axis { what: "force", value }),
            _ => Ok(Command::Axis { axis: self.joint, goal, force }),
        }
    }

    /// `CLOCK_MONOTONIC` until which the sender waits, ns; `u64::MAX` when it has not said so.
    #[must_use]
    pub fn valid_until_ns(&self) -> u64 {
        self.valid_until_ns
    }
}

impl From<Command> for CommandRequest {
    fn from(command: Command) -> Self {
        let (code, joint, value) = match command {
            Command::Enable => (1, 0, 0.0),
            Command::Disable => (2, 0, 0.0),
            Command::Pause => (3, 0, 0.0),
            Command::Resume => (4, 0, 0.0),
            Command::Stop => (5, 0, 0.0),
            Command::FastStop => (6, 0, 0.0),
            Command::TorqueOff => (7, 0, 0.0),
            Command::Speed { percent } => (8, 0, percent),
            Command::ClearFault => (9, 0, 0.0),
            Command::Reference { joint, at_rad } => (10, joint, at_rad),
            Command::Axis { axis, goal: AxisGoal::Open, .. } => (11, axis, 0.0),
            Command::Axis { axis, goal: AxisGoal::Closed, .. } => (12, axis, 0.0),
            Command::Axis { axis, goal: AxisGoal::At(position), .. } => (13, axis, position),
            Command::Axis { axis, goal: AxisGoal::Stop, .. } => (14, axis, 0.0),
            Command::Home { joint } => (15, joint, 0.0),
        };
        let force = if let Command::Axis { force, .. } = command { force } else { None };
        Self {
            layout_version: LAYOUT_VERSION,
            code,
            joint,
            has_force: u32::from(force.is_some()),
            value,
            force: force.unwrap_or(0.0),
            valid_until_ns: u64::MAX,
        }
    }
}

impl TryFrom<&CommandRequest> for Command {
    type Error = CommandError;

    fn try_from(r: &CommandRequest) -> Result<Self, CommandError> {
        if r.layout_version != LAYOUT_VERSION {
            return Err(CommandError::Layout { got: r.layout_version });
        }
        Ok(match r.code {
            1 => Self::Enable,
            2 => Self::Disable,
            3 => Self::Pause,
            4 => Self::Resume,
            5 => Self::Stop,
            6 => Self::FastStop,
            7 => Self::TorqueOff,
            8 if (0.0..=100.0).contains(&r.value) => Self::Speed { percent: r.value },
            8 => return Err(CommandError::Percent { percent: r.value }),
            9 => Self::ClearFault,
            10 if r.value.is_finite() => Self::Reference { joint: r.joint, at_rad: r.value },
            10 => return Err(CommandError::Angle { at_rad: r.value }),
            11 => r.axis(AxisGoal::Open)?,
            12 => r.axis(AxisGoal::Closed)?,
            13 if r.value.is_finite() => r.axis(AxisGoal::At(r.value))?,
            13 => return Err(CommandError::Axis { what: "position", value: r.value }),
            14 => r.axis(AxisGoal::Stop)?,
            15 => Self::Home { joint: r.joint },
            got => return Err(CommandError::Unknown { got }),
        })
    }
}

impl CommandReply {
    /// Accepted; `text` says what happens now.
    #[must_use]
    pub fn accepted(phase: Phase, text: &str) -> Self {
        Self::new(true, phase, text)
    }
    /// Refused; `text` says why and what to do.
    #[must_use]
    pub fn refused(phase: Phase, text: &str) -> Self {
        Self::new(false, phase, text)
    }
    fn new(accepted: bool, phase: Phase, text: &str) -> Self {
        Self {
            layout_version: LAYOUT_VERSION,
            accepted: u32::from(accepted),
            phase: phase.code(),
            reserved: 0,
            text: Text::new(text),
        }
    }
    /// True when the command was accepted. An answer of another layout counts as refused.
    #[must_use]
    pub fn is_accepted(&self) -> bool {
        self.layout_version == LAYOUT_VERSION && self.accepted == 1
    }
    /// The phase when the answer was written.
    #[must_use]
    pub fn phase(&self) -> Option<Phase> {
        Phase::from_code(self.phase)
    }
    /// What happens now, or why not.
    #[must_use]
    pub fn text(&self) -> String {
        self.text.read()
    }
}

const _: () = assert!(size_of::<CommandRequest>() == 40);
const _: () = assert!(size_of::<CommandReply>() == 264);
