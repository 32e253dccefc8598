//! What the master finds wrong with a Piper, and what the arm's own codes mean.
//!
//! Codes from 0x11 0000 to 0x11 FFFF, apart from those of other protocols: the arm's status, a bit of a joint's driver, or a
//! finding of the master.
//!
//! Source of the arm's codes: the maker's SDK 0.6.2.
use super::frames::DRIVER_ENABLED;
use crate::bring_up::Refusal;

/// First code of this protocol.
pub const BASE: u32 = 0x0011_0000;
const ARM: u32 = BASE | 0x0100;
const DRIVER: u32 = BASE | 0x0200;
const FINDING: u32 = BASE | 0x0300;

/// A finding of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PiperFault {
    /// It sends nothing, or not all that an arm sends.
    NoAnswer = FINDING | 0x01,
    /// A question was not answered.
    NoReply = FINDING | 0x02,
    /// Another master commands it.
    OtherMaster = FINDING | 0x03,
    /// It did not say that its joints are energised, or that it takes joint targets.
    EnableTimeout = FINDING | 0x04,
    /// The command lay too far from the measured position to energise it.
    CommandFar = FINDING | 0x05,
    /// A joint lost its torque by itself.
    DroppedOut = FINDING | 0x06,
    /// Its frames stopped while it was in use.
    Silent = FINDING | 0x07,
    /// It is energised, and this master did not energise it.
    Unowned = FINDING | 0x08,
    /// It takes targets from elsewhere.
    OtherControl = FINDING | 0x09,
    /// Another firmware than the settings name.
    Firmware = FINDING | 0x0A,
    /// A range or speed of a joint that does not fit the robot.
    Limits = FINDING | 0x0B,
    /// The controller does not reach a joint.
    Unreached = FINDING | 0x0C,
    /// A joint is beyond the range that the controller holds for it.
    Beyond = FINDING | 0x0D,
    /// It was configured before and answers otherwise now.
    Restarted = FINDING | 0x0E,
}

impl PiperFault {
    /// Every finding.
    pub const ALL: [Self; 14] = [
        Self::NoAnswer,
        Self::NoReply,
        Self::OtherMaster,
        Self::EnableTimeout,
        Self::CommandFar,
        Self::DroppedOut,
        Self::Silent,
        Self::Unowned,
        Self::OtherControl,
        Self::Firmware,
        Self::Limits,
        Self::Unreached,
        Self::Beyond,
        Self::Restarted,
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
                "the arm does not send its state, angles and drivers; check its power, the wiring and the bit rate \
                 (1 Mbit/s), and that it is a follower (0x470)"
            }
            Self::NoReply => "the arm sends its state, but does not answer this question; check its firmware",
            Self::OtherMaster => "another master or a leader arm commands this arm; end it first",
            Self::EnableTimeout => {
                "the arm did not say in time that its joints are energised and that it takes joint targets by CAN; check its \
                 supply and its emergency stop"
            }
            Self::CommandFar => "not energised: the command lies too far from the measured position",
            Self::DroppedOut => "a joint lost its torque by itself; check the supply",
            Self::Silent => "the arm stopped sending; check its power and the wiring",
            Self::Unowned => {
                "the arm was energised before this streamer came, and nothing tells what it holds, so it is not taken over; end \
                 the program that uses it, or support the arm and `torque-off`; then `clear-fault`"
            }
            Self::OtherControl => {
                "the arm takes no targets by CAN now: it is being taught, or another interface or program controls it; end \
                 that, then `clear-fault`"
            }
            Self::Firmware => "the arm has another firmware than the settings name (firmware)",
            Self::Limits => "the arm's own limits are narrower than the robot's",
            Self::Unreached => "the arm's controller does not reach this joint; check its cable",
            Self::Beyond => "the joint is beyond the range that the arm's controller holds for it",
            Self::Restarted => {
                "the arm's limits or firmware are not as they were: it restarted, or another program set it; clear the fault to \
                 compare them again"
            }
        }
    }
}

/// Bits of a joint's driver that are faults.
const DRIVER_BITS: [(u8, &str); 7] = [
    (0, "supply voltage too low"),
    (1, "motor too hot"),
    (2, "over-current"),
    (3, "driver too hot"),
    (4, "collision detected"),
    (5, "driver error"),
    (7, "stalled"),
];

/// The code of a joint's driver: its first fault.
#[must_use]
pub const fn driver_code(faults: u8) -> u32 {
    DRIVER | faults.trailing_zeros()
}

/// The code of the arm's own status.
#[must_use]
pub const fn arm_code(status: u8) -> u32 {
    ARM | status as u32
}

/// The words of the arm's own status.
#[must_use]
pub const fn arm_words(status: u8) -> &'static str {
    match status {
        0x0 => "normal",
        0x1 => {
            "emergency stop; when its cause is gone and the arm is supported, clear the fault: it then loses its torque"
        }
        0x2 => "no solution for a target pose",
        0x3 => "singularity",
        0x4 => "a target is beyond the arm's own limits",
        0x5 => "the controller does not reach a joint",
        0x6 => "a brake of a joint is not open",
        0x7 => "collision",
        0x8 => "too fast while it was taught",
        0x9 => "a joint is in fault",
        0xA => "other fault",
        0xB => "a teaching is being recorded",
        0xC => "a teaching is being played",
        0xD => "a teaching is paused",
        0xE => "controller too hot",
        0xF => "brake resistor too hot",
        _ => "a status that is not known here",
    }
}

/// The sentence for one of these codes, on a link that has a cable or none.
#[must_use]
pub fn explain_on(code: u32, has_cable: bool) -> String {
    if let Some(fault) = PiperFault::ALL.into_iter().find(|fault| fault.code() == code) {
        let without_cable = matches!(fault, PiperFault::NoAnswer | PiperFault::Silent) && !has_cable;
        return if without_cable {
            "the arm sends nothing, or not all; see that its simulated servos run on this bus, all six of them".to_owned()
        } else {
            fault.sentence().to_owned()
        };
    }
    let low = (code & 0xFF) as u8;
    let driver = DRIVER_BITS.into_iter().find(|(bit, _)| *bit == low);
    match (code & !0xFF, driver) {
        (ARM, _) => format!("arm status {low:X}: {}", arm_words(low)),
        (DRIVER, Some((_, words))) => format!("driver of the joint: {words}"),
        _ => format!("code {code:#x}"),
    }
}

/// A status word as text: the joint's driver, then the arm: "0x40 enabled, arm 0 normal".
#[must_use]
pub fn status_text(word: u32) -> String {
    let [driver, arm, ..] = word.to_le_bytes();
    let power = if driver & DRIVER_ENABLED == 0 { "off" } else { "enabled" };
    let words = arm_words(arm).split(';').next().unwrap_or_default();
    format!("0x{driver:02X} {power}, arm {arm:X} {words}")
}

/// What of a joint's limits differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum LimitKind {
    /// The smallest angle.
    Least = 1,
    /// The largest angle.
    Most = 2,
    /// The largest speed.
    Speed = 3,
}

/// Flag of an object of this protocol in [`crate::ServoStatus::refused_object`].
const OBJECT: u32 = 0x8000_0000 | BASE;

/// The object of a limit.
#[must_use]
pub const fn limit_object(kind: LimitKind) -> u32 {
    OBJECT | kind as u32
}

/// The sentence for a refused joint; of a limit of the arm what the arm states and what the robot may do, both as the arm
/// counts.
#[must_use]
pub fn explain_refusal(refusal: &Refusal) -> String {
    let [stated, wanted] = refusal.numbers;
    let what = match refusal.object.checked_sub(OBJECT) {
        Some(1) => {
            format!(
                "the arm's own least angle of this joint is {stated:.4} rad, but the robot goes to {wanted:.4} rad"
            )
        }
        Some(2) => {
            format!(
                "the arm's own greatest angle of this joint is {stated:.4} rad, but the robot goes to {wanted:.4} rad"
            )
        }
        Some(3) => {
            format!(
                "the arm's own speed limit of this joint is {stated:.3} rad/s, but the robot stops from {wanted:.3} rad/s"
            )
        }
        _ => return explain_on(refusal.code, true),
    };
    format!(
        "{what}; widen it in the arm with the maker's tool (0x474), or narrow the joint in the robot file"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_sentence() {
        let findings = PiperFault::ALL.into_iter().map(PiperFault::code);
        let arm = (0..=0x10).map(arm_code);
        let drivers = [0x01, 0x02, 0x04, 0x08, 0x10, 0x20, 0x80].map(driver_code);
        let codes: Vec<u32> = findings.chain(arm).chain(drivers).collect();
        let mut sentences: Vec<String> = codes.iter().map(|code| explain_on(*code, true)).collect();
        sentences.sort();
        sentences.dedup();
        assert_eq!(sentences.len(), codes.len());
        assert!(!sentences.iter().any(|sentence| sentence.starts_with("code")), "{sentences:?}");
    }
}
