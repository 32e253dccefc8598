//! What the streamer is doing, and why it stopped.

/// The streamer's state. One explicit machine owns the transitions (streamer/src/supervise.rs).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Phase {
    /// Buses are opened, drives are found and configured; nothing is energised.
    Configuring = 1,
    /// Drives are configured and not energised.
    Disabled = 2,
    /// Drives are being energised at the measured pose.
    Enabling = 3,
    /// Energised, at rest, ready for a plan.
    Holding = 4,
    /// A trajectory runs.
    Moving = 5,
    /// sigma is on its way to 0; the trajectory is kept.
    Pausing = 6,
    /// At rest on the path; `resume` goes on.
    Paused = 7,
    /// sigma is on its way to 0; then the trajectory is dropped and the arm holds.
    Stopping = 8,
    /// sigma is on its way to 0 after a fault, still on the path; then `Fault`.
    FastStopping = 9,
    /// Every joint brakes off the path; then `Fault`.
    Braking = 10,
    /// Stopped by a fault. The report says whether the drives are energised and hold.
    Fault = 11,
    /// The fault is cleared and the drives hold; `enable` makes the arm ready again.
    Locked = 12,
    /// Drives are being de-energised.
    Disabling = 13,
}

impl Phase {
    /// Every phase.
    pub const ALL: [Self; 13] = [
        Self::Configuring,
        Self::Disabled,
        Self::Enabling,
        Self::Holding,
        Self::Moving,
        Self::Pausing,
        Self::Paused,
        Self::Stopping,
        Self::FastStopping,
        Self::Braking,
        Self::Fault,
        Self::Locked,
        Self::Disabling,
    ];

    /// The code that stands in messages.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The phase of a code; `None` for a code that is unknown.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|p| p.code() == code)
    }
    /// The word that users read.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Configuring => "configuring",
            Self::Disabled => "disabled",
            Self::Enabling => "enabling",
            Self::Holding => "holding",
            Self::Moving => "moving",
            Self::Pausing => "pausing",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
            Self::FastStopping => "fast-stopping",
            Self::Braking => "braking",
            Self::Fault => "fault",
            Self::Locked => "locked",
            Self::Disabling => "disabling",
        }
    }
}

/// The limit that stands beside [`FaultReason::DriveFault`] when the drive has no fault, but set its warning bit.
pub const DRIVE_WARNING: f64 = 1.0;

/// Why the arm is, or is going, in [`Phase::Fault`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum FaultReason {
    /// A drive reported a fault; value = its error code. With [`DRIVE_WARNING`] as limit: it warns; value = statusword.
    DriveFault = 1,
    /// No feedback of a joint for too long; value = age in s.
    FeedbackLate = 2,
    /// A joint does not follow; value = tracking error in rad.
    TrackingError = 3,
    /// A measured position jumped; value = jump in rad.
    PositionJump = 4,
    /// A setpoint failed the guard; value = the offending number.
    Guard = 5,
    /// The bus refused frames for too many cycles; value = cycles.
    BusFault = 6,
    /// The loop stalled for longer than the drives' watchdog; value = gap in s.
    Stall = 7,
    /// A drive did not get ready in time; value = timeout in s.
    BringUp = 8,
    /// A drive left its operating state without being told; value = statusword.
    DriveDropped = 9,
    /// Drives are not at rest, or energised by somebody else; value = rad/s.
    NotTrusted = 10,
    /// The operator asked for torque off.
    TorqueOff = 11,
    /// The operator asked for a fast stop.
    Operator = 12,
    /// A drive refused a configuration step; value = its error code, limit = the object, `index << 8 | sub` or 0.
    ConfigurationRefused = 13,
}

impl FaultReason {
    /// Every reason.
    pub const ALL: [Self; 13] = [
        Self::DriveFault,
        Self::FeedbackLate,
        Self::TrackingError,
        Self::PositionJump,
        Self::Guard,
        Self::BusFault,
        Self::Stall,
        Self::BringUp,
        Self::DriveDropped,
        Self::NotTrusted,
        Self::TorqueOff,
        Self::Operator,
        Self::ConfigurationRefused,
    ];
    /// The code that stands in messages; 0 stands for none.
    #[must_use]
    pub fn code(self) -> u32 {
        self as u32
    }
    /// The reason of a code.
    #[must_use]
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|r| r.code() == code)
    }
    /// What happened and in which unit the value is: "feedback late (s)". `limit` is what stands beside the value.
    #[must_use]
    pub fn word(self, limit: f64) -> &'static str {
        match self {
            Self::DriveFault if limit > 0.0 => "drive warns (statusword)",
            Self::DriveFault => "drive fault (error code)",
            Self::FeedbackLate => "feedback late (s)",
            Self::TrackingError => "tracking error (rad)",
            Self::PositionJump => "position jumped (rad)",
            Self::Guard => "setpoint failed the guard",
            Self::BusFault => "bus fault (lost cycles)",
            Self::Stall => "loop stalled (s)",
            Self::BringUp => "drive not ready in time (s)",
            Self::DriveDropped => "drive left operation by itself (statusword)",
            Self::NotTrusted => "arm not at rest (rad/s)",
            Self::TorqueOff => "torque switched off by the operator",
            Self::Operator => "fast stop by the operator",
            Self::ConfigurationRefused => "drive refused its configuration",
        }
    }
}
