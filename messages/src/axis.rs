//! Axes beside the path in messages: what is asked of them, and what they do.
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::axis::Activity;

/// Where an axis is asked to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisGoal {
    /// Its open position.
    Open,
    /// Its closed position.
    Closed,
    /// A position in its own unit.
    At(f64),
    /// Nowhere: to rest.
    Stop,
}

/// What an axis does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisState {
    /// Its servo does not follow.
    Off,
    /// It stands at its command.
    Holding,
    /// Its command moves.
    Moving,
    /// It touches something and holds against it.
    InContact,
    /// Its servo is in fault.
    Fault,
}

impl AxisState {
    /// Every state.
    pub const ALL: [Self; 5] = [Self::Off, Self::Holding, Self::Moving, Self::InContact, Self::Fault];

    /// Its number on the wire.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::Off => 0,
            Self::Holding => 1,
            Self::Moving => 2,
            Self::InContact => 3,
            Self::Fault => 4,
        }
    }
    /// The state of a number; a number of another release is a fault.
    #[must_use]
    pub fn from_code(code: u32) -> Self {
        Self::ALL.into_iter().find(|state| state.code() == code).unwrap_or(Self::Fault)
    }
    /// Its word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Holding => "holding",
            Self::Moving => "moving",
            Self::InContact => "in contact",
            Self::Fault => "fault",
        }
    }
}

impl From<Activity> for AxisState {
    fn from(activity: Activity) -> Self {
        match activity {
            Activity::Holding => Self::Holding,
            Activity::Moving => Self::Moving,
            Activity::InContact => Self::InContact,
        }
    }
}

/// One axis in a report. Positions are in its own unit, rad or m, forces in Nm or N.
#[derive(Clone, Copy, Debug, Default, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct AxisReport {
    /// [`AxisState::code`].
    pub state: u32,
    /// 1 for metres, 0 for radians.
    pub metres: u32,
    /// Commands that it has taken since start; it wraps.
    pub commands: u32,
    /// Zero.
    pub reserved: u32,
    /// Commanded position.
    pub command: f64,
    /// Commanded velocity.
    pub command_velocity: f64,
    /// Where it was led by the newest command; NaN before the first.
    pub goal: f64,
    /// Where it goes, or stands: the goal, unless contact, a stop or a fault came between.
    pub target: f64,
    /// Measured position; NaN before the first feedback.
    pub measured: f64,
    /// Measured force; NaN where its servo does not say.
    pub force: f64,
    /// The force that is contact, of the newest command; infinite where its position alone is.
    pub force_max: f64,
}

impl AxisReport {
    /// What it does.
    #[must_use]
    pub fn state(&self) -> AxisState {
        AxisState::from_code(self.state)
    }
    /// "m" or "rad".
    #[must_use]
    pub fn unit(&self) -> &'static str {
        if self.metres == 1 { "m" } else { "rad" }
    }
    /// "N" or "Nm".
    #[must_use]
    pub fn force_unit(&self) -> &'static str {
        if self.metres == 1 { "N" } else { "Nm" }
    }
}
