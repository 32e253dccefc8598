//! Whether the multi-turn offset of a joint is known, and its source.

/// What is known of the multi-turn offset of a joint. Only a referenced joint may be energised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum ReferenceState {
    /// No feedback from its drive yet.
    #[default]
    NoFeedback = 0,
    /// The feedback tells every angle of the joint.
    Encoder = 1,
    /// The offset that comes nearest to the last pose on disk.
    Record = 2,
    /// Its drive was never without power since this arm was last known.
    Adoption = 3,
    /// Set by the operator.
    Operator = 4,
    /// The feedback wraps, and there is no last pose to resolve the offset.
    NoRecord = 5,
    /// The last pose was written while the arm moved.
    RecordMoving = 6,
    /// The last pose is too far from every angle that the reading allows.
    RecordFar = 7,
    /// No angle that the reading allows lies inside the joint's range.
    OutOfRange = 8,
    /// The feedback knows nothing after power-up.
    Incremental = 9,
    /// Its homing runs, or ended before its end.
    Homing = 10,
    /// Its drive has found its home position.
    Homed = 11,
}

impl ReferenceState {
    /// Every standing.
    pub const ALL: [Self; 12] = [
        Self::NoFeedback,
        Self::Encoder,
        Self::Record,
        Self::Adoption,
        Self::Operator,
        Self::NoRecord,
        Self::RecordMoving,
        Self::RecordFar,
        Self::OutOfRange,
        Self::Incremental,
        Self::Homing,
        Self::Homed,
    ];

    /// The code in messages.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The standing of a code; an unknown one counts as nothing known.
    #[must_use]
    pub fn from_code(code: u32) -> Self {
        Self::ALL.into_iter().find(|reference_state| reference_state.code() == code).unwrap_or_default()
    }
    /// True when the joint's multi-turn offset is known.
    #[must_use]
    pub fn is_referenced(self) -> bool {
        matches!(self, Self::Encoder | Self::Record | Self::Adoption | Self::Operator | Self::Homed)
    }
    /// What is known, for people.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::NoFeedback => "no feedback from its drive yet",
            Self::Encoder => "its feedback is absolute",
            Self::Record => "by the last pose on disk",
            Self::Adoption => "its drive was never off since it was referenced",
            Self::Operator => "set by the operator",
            Self::NoRecord => {
                "its feedback wraps, and there is no last pose to resolve the multi-turn offset"
            }
            Self::RecordMoving => "its feedback wraps, and the last pose was written in motion",
            Self::RecordFar => {
                "its feedback wraps, and the last pose is too far away to resolve the multi-turn offset"
            }
            Self::OutOfRange => "no multi-turn offset of its feedback lies inside its range",
            Self::Incremental => "its feedback is incremental and has no reference after power-up",
            Self::Homing => "its homing runs, or has not come to its end",
            Self::Homed => "homed since its drive was switched on",
        }
    }
}
