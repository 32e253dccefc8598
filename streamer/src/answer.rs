//! Why a command was accepted or refused: as plain values on the real-time thread, as sentences off it.
use crate::names::Names;
use crate::write_ahead::StoreFault;
use taustream_arm::revolution::OUTSIDE_RAD_MAX;
use taustream_drivers::DriveState;
use taustream_drivers::bring_up::Refusal;
use taustream_messages::{Cause, Phase, ReferenceState};
use taustream_motion::digits::{Decimals, OutsideRange};

/// The cycle's answer to a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommandAnswer {
    /// The question's number.
    pub sequence: u64,
    /// Accepted?
    pub accepted: bool,
    /// The phase after it.
    pub phase: Phase,
    /// What happens now, or why not.
    pub why: AnswerReason,
}

/// What happens now, or why not. Joints are zero-based.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(missing_docs, reason = "each variant has its text in `AnswerReason::sentence`")]
pub enum AnswerReason {
    Enabling,
    EnablingOutside { joint: usize, position_rad: f64, range_rad: [f64; 2], percent: f64 },
    Unlocked,
    TakingOver,
    Referenced { joint: usize, at_rad: f64 },
    Disabling,
    Pausing,
    Resuming,
    Stopping,
    FastStopping,
    TorqueOff,
    SpeedSet { percent: f64, moving: bool },
    SpeedHeld { percent: f64, limit: f64 },
    Resetting,
    ClearedHolding,
    ClearedOff,
    Already,
    NothingMoves,
    NotConfigured { joint: usize, state: DriveState, refusal: Refusal },
    NotAtRest { joint: usize, speed_rad_s: f64, limit_rad_s: f64 },
    SpeedUnknown,
    NoFeedback { joint: usize, age_s: f64 },
    Warns { joint: usize, status_word: u32 },
    Tracking { joint: usize, error_rad: f64, limit_rad: f64 },
    ClearFirst { cause: Option<Cause> },
    StopFirst,
    EnableFirst,
    NothingToResume,
    NoFault,
    TooManyRamps,
    BusRestored,
    BusPassive { bus: usize },
    Unreachable { bus: usize },
    HoldsBesideFailed { joint: usize, bus: usize },
    Unowned { joint: usize },
    PartlyEnergised { joint: usize, state: DriveState },
    StillEnergised { joint: usize },
    NotReferenced { joint: usize, reference_state: ReferenceState, by_rad: f64 },
    ReferenceOutside { joint: usize, at_rad: f64, range_rad: [f64; 2] },
    ReferenceFar { joint: usize, at_rad: f64, nearest_rad: f64, limit_rad: f64 },
    ReferenceNotNeeded { joint: usize, reading_rad: f64, at_rad: f64 },
    NoSuchJoint { joint: usize },
    Energised { joint: usize, state: DriveState },
    AxisGoes { axis: usize, to: f64 },
    AxisStops { axis: usize },
    AxesStop,
    NoSuchAxis { axis: usize, axes: usize },
    AxisOutside { axis: usize, at: f64, range: [f64; 2] },
    AxisForce { axis: usize, force: f64, most: f64 },
    AxisFeelsNoForce { axis: usize },
    AxisTakesLong { axis: usize, stroke_s: f64 },
    AxisInMotion { axis: usize },
    Homing { joint: usize },
    HomingStops,
    NoHoming { joint: usize },
    NotHomed { joint: usize },
    AdoptFirst,
    Wait,
    ShuttingDown,
    TooLate { late_s: f64 },
    Overtaken,
    NotRecorded { fault: StoreFault },
    RecordLate { waited_s: f64 },
}

impl AnswerReason {
    /// The sentence for people.
    #[must_use]
    pub fn sentence(&self, names: &Names) -> String {
        let taken = self.taken().map(|text| match (self, names.fall_warning()) {
            (Self::Enabling | Self::Unlocked | Self::TakingOver, Some(warning)) => {
                format!("{text}; {warning}")
            }
            _ => text,
        });
        taken
            .or_else(|| self.of_referencing(names))
            .or_else(|| self.of_axis(names))
            .unwrap_or_else(|| self.refused(names))
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded below")]
    fn taken(self) -> Option<String> {
        let text = match self {
            Self::Enabling => "drives are being energised at the measured pose",
            Self::Unlocked => "the arm holds and accepts trajectories",
            Self::TakingOver => "the drives that hold are adopted at their held pose",
            Self::Disabling => "drives are being de-energised",
            Self::Pausing => "slowing down on the path; `resume` continues",
            Self::Resuming => "continuing on the path",
            Self::Stopping => "slowing down on the path; then the trajectory is dropped",
            Self::FastStopping => "fast stop on the path; then `clear-fault` and `enable`",
            Self::TorqueOff => "drives are de-energised at once; the arm may fall",
            Self::SpeedSet { percent, moving: true } => return Some(format!("speed changes to {percent} %")),
            Self::SpeedSet { percent, moving: false } => {
                return Some(format!("the next motion runs at {percent} %"));
            }
            Self::SpeedHeld { percent, limit } => {
                return Some(format!(
                    "motions that begin outside the position limits run at {limit} % at most; those after them at {percent} %"
                ));
            }
            Self::Resetting => "fault reset sent to the drives; `status` shows the result",
            Self::ClearedHolding => "fault cleared, the drives hold; `enable` makes the arm ready",
            Self::ClearedOff => "fault cleared, the drives are de-energised; `enable` energises them",
            Self::BusRestored => {
                "the bus is open again and the state of its drives is being read; when `status` shows disabled, `enable`"
            }
            Self::Already => "the arm is in this state already",
            Self::HomingStops => "the homing is being stopped; its joint holds then, and is not referenced",
            Self::AxesStop => "the axes beside the path come to rest and hold there",
            Self::NothingMoves => "nothing moves",
            _ => return None,
        };
        Some(text.to_owned())
    }

    /// Answers about references.
    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above and below")]
    fn of_referencing(&self, names: &Names) -> Option<String> {
        Some(match *self {
            Self::Referenced { joint, at_rad } => {
                format!(
                    "{} is referenced at {at_rad:.6} rad; stored on disk after 0.2 s at rest",
                    names.joint(joint)
                )
            }
            Self::NotReferenced { joint, reference_state, by_rad } => {
                let by = match reference_state {
                    ReferenceState::RecordFar => format!(" (by {by_rad:.4} rad)"),
                    _ => String::new(),
                };
                format!(
                    "{} is not referenced: {}{by}; measure its angle, then `taustream reference --joint ..`",
                    names.joint(joint),
                    reference_state.word()
                )
            }
            Self::EnablingOutside { joint, position_rad, range_rad, percent } => format!(
                "drives are being energised at the measured pose; {} at {}: only motions that lead it inwards are accepted, at {percent} % speed (`taustream recover`)",
                names.joint(joint),
                OutsideRange { kind: names.kind(joint), position_rad, range_rad }
            ),
            Self::ReferenceOutside { joint, at_rad, range_rad } => format!(
                "{} cannot be there: {}, and at most {OUTSIDE_RAD_MAX} rad is plausible; measure again",
                names.joint(joint),
                OutsideRange { kind: names.kind(joint), position_rad: at_rad, range_rad }
            ),
            Self::ReferenceFar { joint, at_rad, nearest_rad, limit_rad } => {
                let by_rad = (nearest_rad - at_rad).abs();
                let decimals = Decimals::apart(&[by_rad, limit_rad], 4);
                let (by, limit) = (decimals.show(by_rad), decimals.show(limit_rad));
                format!(
                    "{} cannot be at {at_rad:.4} rad: the nearest angle that its feedback allows is {nearest_rad:.4} rad, {by} rad away (at most {limit}); measure again, or correct zero_offset_rad and sign",
                    names.joint(joint)
                )
            }
            Self::ReferenceNotNeeded { joint, reading_rad, at_rad } => format!(
                "{} needs no reference: its feedback is absolute and reads {reading_rad:.6} rad, {:.6} rad from {at_rad:.6}; if that is wrong, correct zero_offset_rad or sign in the settings",
                names.joint(joint),
                (reading_rad - at_rad).abs()
            ),
            Self::NoSuchJoint { joint } => format!("there is no joint {}", joint + 1),
            Self::Homing { joint } => format!(
                "{} homes itself; the other joints hold, and what `enable` makes ready is the arm after that",
                names.joint(joint)
            ),
            Self::NoHoming { joint } => names.no_homing(joint),
            Self::NotHomed { joint } => format!(
                "{} is not referenced: its homing has not come to its end; `taustream home` it again",
                names.joint(joint)
            ),
            Self::Energised { joint, state } => format!(
                "{} can be referenced only while nothing is energised (its drive is {}); support the arm and `disable` first",
                names.joint(joint),
                state_word(state)
            ),
            _ => return None,
        })
    }

    /// Answers about axes beside the path.
    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above and below")]
    fn of_axis(&self, names: &Names) -> Option<String> {
        let shown = |axis: usize| names.axis(axis);
        let unit = |axis: usize| names.axis_unit(axis).word();
        let force_unit = |axis: usize| names.axis_unit(axis).force_word();
        Some(match *self {
            Self::AxisGoes { axis, to } => format!("{} goes to {to:.6} {}", shown(axis), unit(axis)),
            Self::AxisStops { axis } => format!("{} comes to rest and holds there", shown(axis)),
            Self::NoSuchAxis { axis, axes } => {
                format!("there is no axis {}; the settings of this arm have {axes}", axis + 1)
            }
            Self::AxisOutside { axis, at, range: [low, high] } => {
                let by = (low - at).max(at - high);
                format!(
                    "{} cannot go to {at:.6} {unit}: it is {by:.6} {unit} outside [{low:.6}, {high:.6}]; give a position inside",
                    shown(axis),
                    unit = unit(axis)
                )
            }
            Self::AxisForce { axis, force, most } => format!(
                "{} takes a force above 0 up to {most:.3} {unit}, not {force:.3} {unit}; the settings state the most",
                shown(axis),
                unit = force_unit(axis)
            ),
            Self::AxisFeelsNoForce { axis } => format!(
                "{} has no force in its settings ([axis.contact]): contact is found by its distance behind the command; leave --force out",
                shown(axis)
            ),
            Self::AxisTakesLong { axis, stroke_s } => {
                format!(
                    "{} would take {stroke_s:.0} s; 600 s are the most; choose a nearer position",
                    shown(axis)
                )
            }
            Self::AxisInMotion { axis } => format!("{} moves; `stop` first", shown(axis)),
            _ => return None,
        })
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above and below")]
    fn refused(self, names: &Names) -> String {
        let name = |joint| names.joint(joint);
        match self {
            Self::NotConfigured { joint, state, refusal } => {
                let why = if refusal.code == 0 {
                    format!("; {}, then `status`", present(names, joint))
                } else {
                    format!(": {}", names.refusal(joint, &refusal))
                };
                format!("{} is not ready ({}){why}", name(joint), state_word(state))
            }
            Self::ClearFirst { cause: Some(cause) } => {
                format!("`clear-fault` first, once the cause is fixed: {}", names.fault(&cause))
            }
            Self::NotAtRest { joint, speed_rad_s, limit_rad_s } => format!(
                "{} moves at {speed_rad_s:.3} rad/s (at rest: {limit_rad_s} rad/s); wait until the arm is at rest",
                name(joint)
            ),
            Self::NoFeedback { joint, age_s } if age_s.is_infinite() => {
                format!("no feedback from {} yet; {}", name(joint), present(names, joint))
            }
            Self::NoFeedback { joint, age_s } => {
                format!("no feedback from {} for {age_s:.3} s; {}", name(joint), present(names, joint))
            }
            Self::Warns { joint, status_word } => format!(
                "the drive of {} warns (status {}); remove the cause at the drive",
                name(joint),
                names.status_word(joint, status_word)
            ),
            Self::Tracking { joint, error_rad, limit_rad } => {
                let decimals = Decimals::apart(&[error_rad, limit_rad], 4);
                let (error, limit) = (decimals.show(error_rad), decimals.show(limit_rad));
                format!(
                    "{} is {error} rad from its command (limit {limit}); `disable` and free the arm",
                    name(joint)
                )
            }
            other => other.refused_by_state(names),
        }
    }

    /// Refusals because of what buses, drives and the disk are in.
    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above and below")]
    fn refused_by_state(self, names: &Names) -> String {
        let name = |joint| names.joint(joint);
        match self {
            Self::BusPassive { bus } => format!(
                "the controller of {} is still error-passive; check cable, termination and the power of the drives, or restart \
                 it: ip link set {1} down && ip link set {1} up",
                names.bus(bus),
                names.interface(bus)
            ),
            Self::Unreachable { bus } => format!(
                "no drive can be reached: {} has failed, and its drives have stopped by their own watchdogs; \
                 fix the bus, then `clear-fault`",
                names.bus(bus)
            ),
            Self::HoldsBesideFailed { joint, bus } => format!(
                "{} holds while the drives on {} are unreachable; support the arm, `disable`, then `clear-fault`",
                name(joint),
                names.bus(bus)
            ),
            Self::Unowned { joint } => format!(
                "the drive of {} is energised, unowned; end the program that uses it, or support the arm and `torque-off`",
                name(joint)
            ),
            Self::PartlyEnergised { joint, state } => format!(
                "the drive of {} is off ({}) while others hold; support the arm, `disable`, then `clear-fault`",
                name(joint),
                state_word(state)
            ),
            Self::TooLate { late_s } => format!(
                "the streamer stood still; it came to this command {late_s:.3} s after its sender had given up, and did not carry it out"
            ),
            Self::StillEnergised { joint } => {
                format!("the drive of {} is still energised; wait and try again", name(joint))
            }
            Self::NotRecorded { fault } => format!(
                "nothing was changed or energised, because the record that has to say so first is not on the disk: {}",
                names.directories.sentence(fault)
            ),
            Self::RecordLate { waited_s } => format!(
                "nothing was changed or energised, because the disk has not taken the record that has to say so first within \
                 {waited_s:.1} s; see the disk of {}, then ask again",
                names.directories.state.display()
            ),
            other => other.plain_refusal().to_owned(),
        }
    }

    #[expect(clippy::wildcard_enum_match_arm, reason = "the other reasons are worded above")]
    fn plain_refusal(self) -> &'static str {
        match self {
            Self::ClearFirst { .. } => "`clear-fault` first, once the cause is fixed; `status` shows it",
            Self::SpeedUnknown => {
                "too little feedback to know that the arm is at rest; try again in a second"
            }
            Self::StopFirst => "the arm moves; `stop` first",
            Self::AdoptFirst => "the drives hold from before this start; `enable` or `disable` first",
            Self::EnableFirst => "the drives are not energised; `enable` first",
            Self::NothingToResume => "nothing is paused; send a trajectory",
            Self::NoFault => "there is no fault",
            Self::TooManyRamps => "too many speed changes at once; wait a second and try again",
            Self::Wait => "another change is in progress; wait until it has ended",
            Self::ShuttingDown => "the streamer is shutting down",
            Self::Overtaken => "a stop, a fault or the end of the streamer came first; nothing was energised",
            _ => "it is not possible now",
        }
    }
}

/// What to look at when a drive is silent.
fn present(names: &Names, joint: usize) -> &'static str {
    if names.joint_has_cable(joint) {
        "check power and connection of its drive"
    } else {
        "check that its simulated servo runs"
    }
}

/// The word for a drive's state.
#[must_use]
pub fn state_word(state: DriveState) -> &'static str {
    match state {
        DriveState::Absent => "not heard",
        DriveState::Configuring => "being configured",
        DriveState::EnergisedUnowned => "energised, unowned",
        DriveState::Adopted => "holding from before this start",
        DriveState::Disabled => "de-energised",
        DriveState::Enabling => "being energised",
        DriveState::Enabled => "energised",
        DriveState::Homing => "homing",
        DriveState::Disabling => "being de-energised",
        DriveState::Fault => "in fault",
        DriveState::Refused => "refused its configuration",
    }
}
