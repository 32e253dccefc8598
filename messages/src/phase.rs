//! What the streamer is doing.

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
    /// At rest on the path; `resume` continues.
    Paused = 7,
    /// sigma is on its way to 0; then the trajectory is dropped and the arm holds.
    Stopping = 8,
    /// sigma is on its way to 0 after a fault, still on the path; then `Fault`.
    FastStopping = 9,
    /// Every joint brakes off the path; then `Fault`.
    Braking = 10,
    /// Stopped by a fault. The report says whether the drives are energised and hold.
    Fault = 11,
    /// The drives hold, after a fault was cleared or a joint has homed; `enable` makes the arm ready again.
    Locked = 12,
    /// Drives are being de-energised.
    Disabling = 13,
    /// The drive of one joint moves it by its own homing; the others hold. Then `Locked`.
    Homing = 14,
}

impl Phase {
    /// Every phase.
    pub const ALL: [Self; 14] = [
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
        Self::Homing,
    ];

    /// The code in messages.
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
            Self::Homing => "homing",
        }
    }
}
