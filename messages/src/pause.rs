//! Why an arm is paused.

/// Who or what paused the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PauseReason {
    /// A command.
    Operator = 1,
    /// No setpoint left for longer than the arm resumes by itself.
    Stall = 2,
}

impl PauseReason {
    /// Every reason.
    pub const ALL: [Self; 2] = [Self::Operator, Self::Stall];

    /// The code in messages; 0 means none.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The reason of a code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.code() == code)
    }
    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Stall => "stall",
        }
    }
}

/// A pause, with its evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pause {
    /// Who or what paused the arm.
    pub reason: PauseReason,
    /// How long no setpoint left, s; 0 for a command.
    pub gap_s: f64,
}
