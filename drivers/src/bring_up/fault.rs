//! What the master itself finds wrong with a node, beside what the node reports.
//!
//! [`crate::ServoStatus::error_code`] of a CiA 402 drive holds kinds of codes that do not overlap: emergency codes (up to
//! 0xFFFF), these (0x1 0000 to 0x1 FFFF), and SDO abort codes (from 0x503 0000).
use crate::bring_up::{profile_limits, scale};
use crate::codec::cia402_words::{DriveStep, STATUS_LIMIT, STATUS_WARNING};
use crate::codec::{digital_inputs, emcy, error_text, object};
use taustream_arm::OptionalObject;

/// A finding of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum BringUpFault {
    /// Three requests were not answered while listening.
    NoAnswer = 0x0001_0001,
    /// No boot-up message after the communication reset.
    NoBootUp = 0x0001_0002,
    /// Its heartbeat stopped.
    HeartbeatLost = 0x0001_0003,
    /// It restarted while it was in use.
    Restarted = 0x0001_0004,
    /// It left NMT operational while it was in use.
    LeftOperational = 0x0001_0005,
    /// It did not become operational after NMT start.
    NotOperational = 0x0001_0006,
    /// Object 0x1000 does not name profile 402.
    NotCia402 = 0x0001_0007,
    /// Object 0x6502 does not offer cyclic synchronous position.
    NoCsp = 0x0001_0008,
    /// Object 0x6061 did not become 8.
    ModeNotTaken = 0x0001_0009,
    /// A step towards operation enabled was not confirmed in time.
    EnableTimeout = 0x0001_000A,
    /// The command lay too far from the measured position to energise the drive.
    CommandFar = 0x0001_000B,
    /// It left operation enabled by itself.
    DroppedOut = 0x0001_000C,
    /// It stopped by quick stop by itself.
    QuickStopped = 0x0001_000D,
    /// It is energised but says that it does not follow the target.
    NotFollowing = 0x0001_000E,
    /// A value that it sent has another width than the object.
    WrongWidth = 0x0001_000F,
    /// Another master sends SYNC on the bus.
    OtherMaster = 0x0001_0010,
    /// It is energised with a configuration that is not this master's.
    Foreign = 0x0001_0011,
    /// An object that states its scale, direction or range contradicts the settings.
    ScaleDiffers = 0x0001_0012,
    /// It confirmed a write and holds another value.
    NotTaken = 0x0001_0013,
    /// Object 0x6502 does not offer interpolated position.
    NoMode = 0x0001_0014,
    /// It has reported an error of its homing.
    HomingError = 0x0001_0015,
    /// Its homing has not ended in time.
    HomingTimeout = 0x0001_0016,
    /// It goes on showing the end of an earlier homing.
    HomingNotBegun = 0x0001_0017,
    /// Object 0x6061 did not become 6.
    HomingModeNotTaken = 0x0001_0018,
    /// It sent no feedback while it was homing.
    HomingNoFeedback = 0x0001_0019,
    /// It did not come to rest after its homing.
    HomingNotAtRest = 0x0001_001A,
    /// Neither halt nor quick stop ended its homing.
    HomingNotStopped = 0x0001_001B,
    /// A limit of speed or acceleration is below what the streamer may command.
    LimitTooLow = 0x0001_001C,
    /// Its negative limit switch has become active while it followed.
    NegativeLimitSwitch = 0x0001_001D,
    /// Its positive limit switch has become active while it followed.
    PositiveLimitSwitch = 0x0001_001E,
    /// It has not taken the command to release its brake.
    BrakeNotReleased = 0x0001_001F,
    /// It has not taken the command to close its brake.
    BrakeNotClosed = 0x0001_0020,
    /// Its motor has another rated torque than the settings say.
    RatedTorqueDiffers = 0x0001_0021,
}

const NEGATIVE_SWITCH: &str = "the drive's negative limit switch has become active (object 0x60FD, bit 0); lead the joint off it, then see its position_rad";
const POSITIVE_SWITCH: &str = "the drive's positive limit switch has become active (object 0x60FD, bit 1); lead the joint off it, then see its position_rad";
const NOT_RELEASED: &str = "the drive has not taken the command to release its brake (object 0x60FE:01); it is de-energised with the brake closed";
const NOT_CLOSED: &str = "the drive has not taken the command to close its brake (object 0x60FE:01), and keeps its torque; support the joint, then \
    `torque-off`";

impl BringUpFault {
    /// Every finding.
    pub const ALL: [Self; 33] = [
        Self::NoAnswer,
        Self::NoBootUp,
        Self::HeartbeatLost,
        Self::Restarted,
        Self::LeftOperational,
        Self::NotOperational,
        Self::NotCia402,
        Self::NoCsp,
        Self::ModeNotTaken,
        Self::EnableTimeout,
        Self::CommandFar,
        Self::DroppedOut,
        Self::QuickStopped,
        Self::NotFollowing,
        Self::WrongWidth,
        Self::OtherMaster,
        Self::Foreign,
        Self::ScaleDiffers,
        Self::NotTaken,
        Self::NoMode,
        Self::HomingError,
        Self::HomingTimeout,
        Self::HomingNotBegun,
        Self::HomingModeNotTaken,
        Self::HomingNoFeedback,
        Self::HomingNotAtRest,
        Self::HomingNotStopped,
        Self::LimitTooLow,
        Self::NegativeLimitSwitch,
        Self::PositiveLimitSwitch,
        Self::BrakeNotReleased,
        Self::BrakeNotClosed,
        Self::RatedTorqueDiffers,
    ];

    /// As [`crate::ServoStatus::error_code`].
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// What happened and what to do.
    #[must_use]
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::NoAnswer => {
                "the drive does not answer; check its power, the wiring, the bit rate and its node id (a drive in \
                 NMT stopped that sends no heartbeat needs a power cycle)"
            }
            Self::NoBootUp => {
                "no boot-up message in time after the communication reset; still waiting, and a drive that takes longer \
                 needs boot_timeout_s in its [[servo]]"
            }
            Self::HeartbeatLost => "the drive's heartbeat stopped; check its power and the wiring",
            Self::Restarted => "the drive restarted by itself; check its supply",
            Self::LeftOperational => "the drive left NMT operational by itself",
            Self::NotOperational => "the drive did not become operational after NMT start",
            Self::NotCia402 => "the device is no CiA 402 drive (object 0x1000); check the node id",
            Self::NoCsp => {
                "the drive does not offer cyclic synchronous position (object 0x6502, bit 7); one with interpolated position \
                 takes position_mode = \"interpolated\" in its [[servo]]"
            }
            Self::NoMode => "the drive does not offer interpolated position (object 0x6502, bit 6)",
            Self::ModeNotTaken => {
                "the drive did not take the mode of its settings (object 0x6061); one that shows its mode only in operation enabled needs \
                 late_mode_display = true in its [[servo]]"
            }
            Self::EnableTimeout => {
                "the drive did not confirm a step of enabling in time; check its motor supply and its enable input; one \
                 that takes longer needs a longer supervision.drive_timeout_s"
            }
            Self::CommandFar => "not energised: the command lies too far from the measured position",
            Self::DroppedOut => "the drive left operation enabled by itself; check its safe torque off input",
            Self::QuickStopped => "the drive stopped by quick stop by itself",
            Self::NotFollowing => "the drive is energised but does not follow the target (statusword bit 12)",
            Self::WrongWidth => "the drive sent a value of another width than the object has",
            Self::OtherMaster => "another master sends SYNC on this bus; end it first",
            Self::Foreign => {
                "the drive is energised, and not as this arm's settings would have left it; end the program that uses \
                 it, or support the arm and `torque-off`"
            }
            Self::ScaleDiffers => {
                "what the drive states about its scale, direction or range contradicts the settings; correct the one that \
                 is wrong"
            }
            Self::LimitTooLow => {
                "a limit of speed or acceleration of the drive is below what the streamer may command"
            }
            Self::NegativeLimitSwitch => NEGATIVE_SWITCH,
            Self::PositiveLimitSwitch => POSITIVE_SWITCH,
            Self::BrakeNotReleased => NOT_RELEASED,
            Self::RatedTorqueDiffers => "the rated torque of the drive differs from rated_torque_nm",
            Self::BrakeNotClosed => NOT_CLOSED,
            Self::NotTaken => "the drive confirmed a write and holds another value",
            Self::HomingError => {
                "the drive reports a homing error (statusword bit 13); see its switches and its homing method (0x6098)"
            }
            Self::HomingTimeout => {
                "homing has not ended within its time; see the switch and the direction of the method, or give it a longer timeout_s in \
                 [servo.homing]"
            }
            Self::HomingNotBegun => {
                "homing did not begin: the drive goes on showing the end of an earlier one (statusword bit 12); see its enable inputs"
            }
            Self::HomingModeNotTaken => {
                "the drive did not take its homing mode (object 0x6061 did not become 6)"
            }
            Self::HomingNoFeedback => "the drive sent no feedback while it was homing; check its wiring",
            Self::HomingNotAtRest => "the drive did not come to rest after its homing",
            Self::HomingNotStopped => {
                "neither halt nor quick stop has ended the drive's homing; use the emergency stop"
            }
        }
    }
}

/// What to do about a silent node where there is no cable; `None` where the usual sentence serves.
const fn unwired(fault: BringUpFault) -> Option<&'static str> {
    match fault {
        BringUpFault::NoAnswer => Some(
            "the drive does not answer; see that its simulated servo runs on this bus, and its node id in the settings",
        ),
        BringUpFault::HeartbeatLost => {
            Some("the drive's heartbeat stopped; see that its simulated servo still runs")
        }
        BringUpFault::NoBootUp
        | BringUpFault::Restarted
        | BringUpFault::LeftOperational
        | BringUpFault::NotOperational
        | BringUpFault::NotCia402
        | BringUpFault::NoCsp
        | BringUpFault::ModeNotTaken
        | BringUpFault::EnableTimeout
        | BringUpFault::CommandFar
        | BringUpFault::DroppedOut
        | BringUpFault::QuickStopped
        | BringUpFault::NotFollowing
        | BringUpFault::WrongWidth
        | BringUpFault::OtherMaster
        | BringUpFault::Foreign
        | BringUpFault::ScaleDiffers
        | BringUpFault::NotTaken
        | BringUpFault::NoMode
        | BringUpFault::HomingError
        | BringUpFault::HomingTimeout
        | BringUpFault::HomingNotBegun
        | BringUpFault::HomingModeNotTaken
        | BringUpFault::HomingNoFeedback
        | BringUpFault::HomingNotAtRest
        | BringUpFault::HomingNotStopped
        | BringUpFault::LimitTooLow
        | BringUpFault::NegativeLimitSwitch
        | BringUpFault::PositiveLimitSwitch
        | BringUpFault::BrakeNotReleased
        | BringUpFault::BrakeNotClosed
        | BringUpFault::RatedTorqueDiffers => None,
    }
}

/// A configuration step that was refused, and what proves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refusal {
    /// As [`crate::ServoStatus::error_code`].
    pub code: u32,
    /// As [`crate::ServoStatus::refused_object`].
    pub object: u32,
    /// What the drive states and what the settings say; 0 where there are no such numbers.
    pub numbers: [f64; 2],
}

/// Which object of a drive was refused and why: "object 0x1600:02: SDO abort 0x06040041 object cannot be mapped into a PDO".
#[must_use]
pub fn explain_refusal(refusal: &Refusal, has_cable: bool) -> String {
    let Refusal { code, object, numbers: [stated, expected] } = *refusal;
    if code == BringUpFault::ScaleDiffers.code()
        && let Some(sentence) = scale::sentence(object, stated, expected)
    {
        return sentence;
    }
    if code == BringUpFault::LimitTooLow.code()
        && let Some(sentence) = profile_limits::sentence(object, stated, expected)
    {
        return sentence;
    }
    if code == BringUpFault::RatedTorqueDiffers.code() {
        return format!(
            "object 0x6076 (rated torque) of the drive is {stated} Nm, and rated_torque_nm of [servo.torque] is {expected} Nm: every \
             torque would be {:.3} times the one that is meant; correct the one that is wrong, or state absent_objects = [0x6076]",
            stated / expected
        );
    }
    let (index, sub) = (object >> 8, object & 0xFF);
    let advice = advice(code, u16::try_from(index).unwrap_or(0));
    let what = if code == BringUpFault::NotTaken.code() {
        format!("the drive confirmed the write of {expected} and holds {stated}")
    } else {
        explain(code, has_cable)
    };
    format!("object 0x{index:04X}:{sub:02}: {what}{advice}")
}

/// What to do about an object that was refused.
fn advice(code: u32, index: u16) -> String {
    let by_drive = code > u32::from(u16::MAX) && !error_text::is_of_the_transfer(code);
    let not_taken = code == BringUpFault::NotTaken.code();
    if !(by_drive || not_taken) {
        return String::new();
    }
    if let Some(object) = OptionalObject::from_index(index) {
        return format!(
            " ({name}): if the drive lacks it, or has the right value fixed in it, state absent_objects = [0x{index:04X}] for \
             this servo; then {without}",
            name = object.name(),
            without = object.without()
        );
    }
    match index {
        // The mapping of the second RPDO is written for shared setpoint frames alone.
        _ if index == object::RPDO_MAPPING + 1 => {
            "; the drive does not skip the other drive's part of a shared setpoint frame: take `packed` off its bus".into()
        }
        _ if index == object::DIGITAL_INPUTS.index => {
            " (digital inputs): if the drive lacks it, take digital_inputs out of its [[servo]]; its switches are then its own affair".into()
        }
        _ if index == object::OUTPUTS.index => {
            " (digital outputs): this drive has no brake that its master releases; take [servo.brake] out if it works its brake by itself".into()
        }
        _ if index == object::CONSUMER_HEARTBEAT.index => {
            " (consumer heartbeat): without it the drive does not notice that its master is gone; if it notices otherwise, state \
             master_supervision = \"setpoint-timer\" (0x1400:05) or \"drive\" (set in the drive) for this servo"
                .into()
        }
        _ => String::new(),
    }
}

/// The sentence for a code of a drive, on a link that has a cable or none.
#[must_use]
pub fn explain(code: u32, has_cable: bool) -> String {
    if let Some(fault) = BringUpFault::ALL.into_iter().find(|fault| fault.code() == code) {
        let without_cable = unwired(fault).filter(|_| !has_cable);
        return without_cable.unwrap_or_else(|| fault.sentence()).to_owned();
    }
    match u16::try_from(code) {
        Ok(code) => format!("0x{code:04X} {}", emcy::words(code)),
        Err(_) => format!("SDO abort 0x{code:08X} {}", error_text::sdo_abort(code)),
    }
}

/// A drive's statusword as text: "0x0218 fault"; with the digital inputs that stand above it.
#[must_use]
pub fn status_text(word: u32) -> String {
    let status = (word & 0xFFFF) as u16;
    let step = DriveStep::from_status(status).map_or("no state of CiA 402", DriveStep::word);
    let warning = if status & STATUS_WARNING == 0 { "" } else { ", warning" };
    let limit = if status & STATUS_LIMIT == 0 { "" } else { ", internal limit active" };
    let inputs = digital_inputs::words(digital_inputs::active(word >> 16));
    format!("0x{status:04X} {step}{warning}{limit}{inputs}")
}
