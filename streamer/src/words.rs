//! Why a command was taken over or refused: as plain values on the real-time thread, as sentences off it.
use crate::names::Names;
use taustream_drivers::DriveState;
use taustream_messages::Phase;

/// The cycle's answer to a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// The question's number.
    pub sequence: u64,
    /// Taken over?
    pub accepted: bool,
    /// The phase after it.
    pub phase: Phase,
    /// What happens now, or why not.
    pub why: Why,
}

/// What happens now, or why not. Joints are zero-based.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "each variant's sentence stands in `Why::sentence`")]
pub enum Why {
    Enabling,
    Unlocked,
    Disabling,
    Pausing,
    Resuming,
    Stopping,
    FastStopping,
    TorqueOff,
    SpeedSet { percent: f64, moving: bool },
    Resetting,
    ClearedHolding,
    ClearedOff,
    Already,
    NothingMoves,
    NotConfigured { joint: usize, state: DriveState },
    NotAtRest { joint: usize, speed_rad_s: f64, limit_rad_s: f64 },
    SpeedUnknown,
    OutOfRange { joint: usize, position_rad: f64, range_rad: [f64; 2] },
    NoFeedback { joint: usize, age_s: f64 },
    Warns { joint: usize, status_word: u32 },
    Tracking { joint: usize, error_rad: f64, limit_rad: f64 },
    ClearFirst,
    StopFirst,
    EnableFirst,
    NothingToResume,
    NoFault,
    TooManyRamps,
    BusRestored,
    BusPassive { bus: usize },
    OutOfReach { bus: usize },
    HoldsBesideFailed { joint: usize, bus: usize },
    Unowned { joint: usize },
    PartlyEnergised { joint: usize, state: DriveState },
    StillEnergised { joint: usize },
    Wait,
    Leaving,
}

impl Why {
    /// The sentence for people.
    #[must_use]
    pub fn sentence(&self, names: &Names) -> String {
        self.taken().unwrap_or_else(|| self.refused(names))
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded below")]
    fn taken(self) -> Option<String> {
        let text = match self {
            Self::Enabling => "drives are being energised at the measured pose",
            Self::Unlocked => "the arm holds and takes trajectories",
            Self::Disabling => "drives are being de-energised",
            Self::Pausing => "slowing down on the path; `resume` goes on",
            Self::Resuming => "going on along the path",
            Self::Stopping => "slowing down on the path; then the trajectory is dropped",
            Self::FastStopping => "fast stop on the path; then `clear-fault` and `enable`",
            Self::TorqueOff => "drives are de-energised at once; the arm may fall",
            Self::SpeedSet { percent, moving: true } => return Some(format!("speed goes to {percent} %")),
            Self::SpeedSet { percent, moving: false } => {
                return Some(format!("the next motion runs at {percent} %"));
            }
            Self::Resetting => "the drives are asked to forget their faults; `status` shows the outcome",
            Self::ClearedHolding => "fault cleared, the drives hold; `enable` makes the arm ready",
            Self::ClearedOff => "fault cleared, the drives are de-energised; `enable` energises them",
            Self::BusRestored => {
                "the bus carries frames again and its drives are looked at anew; when `status` says disabled, `enable`"
            }
            Self::Already => "it is so already",
            Self::NothingMoves => "nothing moves",
            _ => return None,
        };
        Some(text.to_owned())
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above and below")]
    fn refused(self, names: &Names) -> String {
        let name = |joint| names.joint(joint);
        match self {
            Self::NotConfigured { joint, state } => format!(
                "{} is not ready ({}); see that its drive is powered and connected, then `status`",
                name(joint),
                state_word(state)
            ),
            Self::NotAtRest { joint, speed_rad_s, limit_rad_s } => format!(
                "{} moves at {speed_rad_s:.3} rad/s (at rest: {limit_rad_s} rad/s); wait until the arm rests",
                name(joint)
            ),
            Self::OutOfRange { joint, position_rad, range_rad: [low, high] } => format!(
                "{} is at {position_rad:.4} rad, outside its range [{low:.4}, {high:.4}]; move it back by hand",
                name(joint)
            ),
            Self::NoFeedback { joint, age_s } => format!(
                "{} has not answered for {age_s:.3} s; see that its drive is powered and connected",
                name(joint)
            ),
            Self::Warns { joint, status_word } => format!(
                "the drive of {} warns (status {status_word:#06x}); remove the cause at the drive",
                name(joint)
            ),
            Self::Tracking { joint, error_rad, limit_rad } => format!(
                "{} is {error_rad:.4} rad from its command (limit {limit_rad}); `disable` and free the arm",
                name(joint)
            ),
            Self::BusPassive { bus } => format!(
                "the controller of {} is still error-passive; see cable, termination and the power of the drives, or start \
                 it anew: ip link set {1} down && ip link set {1} up",
                names.bus(bus),
                names.interface(bus)
            ),
            Self::OutOfReach { bus } => format!(
                "no drive can be told: {} has failed, and its drives are where their own watchdogs have left them; \
                 `clear-fault` reaches them again once the bus is mended",
                names.bus(bus)
            ),
            Self::HoldsBesideFailed { joint, bus } => format!(
                "{} holds while the drives on {} are out of reach; support the arm, `disable`, then `clear-fault`",
                name(joint),
                names.bus(bus)
            ),
            Self::Unowned { joint } => format!(
                "the drive of {} was found energised by somebody else and is left alone; end that program, or `torque-off` (the arm may fall)",
                name(joint)
            ),
            Self::PartlyEnergised { joint, state } => format!(
                "the drive of {} is off ({}) while others hold; support the arm, `disable`, then `clear-fault`",
                name(joint),
                state_word(state)
            ),
            Self::StillEnergised { joint } => {
                format!("the drive of {} is still energised; wait, then ask again", name(joint))
            }
            other => other.plain_refusal().to_owned(),
        }
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above")]
    fn plain_refusal(self) -> &'static str {
        match self {
            Self::ClearFirst => "the arm is in fault; `status` shows why, then `clear-fault`",
            Self::SpeedUnknown => {
                "the drives were heard for too short a time to know that the arm rests; ask again in a moment"
            }
            Self::StopFirst => "the arm moves; `stop` first",
            Self::EnableFirst => "the drives are not energised; `enable` first",
            Self::NothingToResume => "nothing is paused; send a trajectory",
            Self::NoFault => "there is no fault",
            Self::TooManyRamps => "too many speed changes at once; wait a second and ask again",
            Self::Wait => "another change is under way; wait until it has ended",
            Self::Leaving => "the streamer is ending",
            _ => "it is not possible now",
        }
    }
}

/// The word for a drive's state.
#[must_use]
pub fn state_word(state: DriveState) -> &'static str {
    match state {
        DriveState::Absent => "not heard",
        DriveState::Configuring => "being configured",
        DriveState::EnergisedUnowned => "energised by somebody else",
        DriveState::Disabled => "de-energised",
        DriveState::Enabling => "being energised",
        DriveState::Enabled => "energised",
        DriveState::Disabling => "being de-energised",
        DriveState::Fault => "in fault",
        DriveState::Refused => "refused its configuration",
    }
}
