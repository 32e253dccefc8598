//! What the master finds wrong with an `ODrive`, and what the drive's own errors mean.
//!
//! Codes from 0x10 0000 to 0x10 FFFF, apart from those of other protocols: a bit of the active errors, or a finding of the
//! master.
//!
//! Source of the errors: the maker's enumeration for firmware 0.6.
use super::frames::ERROR_WATCHDOG;
use crate::bring_up::Refusal;

/// First code of this protocol.
pub const BASE: u32 = 0x0010_0000;
const ERROR: u32 = BASE | 0x0100;
const FINDING: u32 = BASE | 0x0200;

/// A finding of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum OdriveFault {
    /// No heartbeat, or no estimates that are numbers.
    NoAnswer = FINDING | 0x01,
    /// A question was not answered.
    NoReply = FINDING | 0x02,
    /// Another master commands it.
    OtherMaster = FINDING | 0x03,
    /// It did not say that it is in closed loop.
    EnableTimeout = FINDING | 0x04,
    /// The command lay too far from the measured position to energise it.
    CommandFar = FINDING | 0x05,
    /// It left closed loop by itself.
    DroppedOut = FINDING | 0x06,
    /// Its frames stopped while it was in use.
    Silent = FINDING | 0x07,
    /// It is energised, and this master did not energise it.
    Unowned = FINDING | 0x08,
    /// Another hardware than the settings name.
    Hardware = FINDING | 0x09,
    /// Another firmware than the settings name.
    Firmware = FINDING | 0x0A,
    /// Its velocity limit is below the joint's.
    VelocityLimit = FINDING | 0x0B,
    /// It did not take the watchdog's timeout.
    WatchdogTimeout = FINDING | 0x0C,
    /// It did not switch its watchdog on.
    WatchdogOff = FINDING | 0x0D,
    /// It was configured before and answers otherwise now.
    Restarted = FINDING | 0x0E,
}

impl OdriveFault {
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
        Self::Hardware,
        Self::Firmware,
        Self::VelocityLimit,
        Self::WatchdogTimeout,
        Self::WatchdogOff,
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
                "the drive sends no heartbeat, or no encoder estimates that are numbers; check its power, the wiring, the bit \
                 rate, its node id, its message periods (heartbeat_msg_rate_ms, encoder_msg_rate_ms) and its calibration"
            }
            Self::NoReply => {
                "the drive sends its heartbeat, but does not answer this question; check its firmware and the endpoint ids"
            }
            Self::OtherMaster => "another master commands this drive; end it first",
            Self::EnableTimeout => {
                "the drive did not go to closed loop in time; check its supply and its calibration"
            }
            Self::CommandFar => "not energised: the command lies too far from the measured position",
            Self::DroppedOut => {
                "the drive left closed loop by itself, or restarted; check its supply, and that no other program disarms it"
            }
            Self::Silent => "the drive stopped sending; check its power and the wiring",
            Self::Unowned => {
                "the drive was energised before this streamer came, and no frame tells what it holds, so it is not taken over; \
                 end the program that uses it, or support the arm and `torque-off`, or wait until its own watchdog disarms it; \
                 then `clear-fault`"
            }
            Self::Hardware => "the drive is another hardware than the settings name (hardware)",
            Self::Firmware => "the drive has another firmware than the settings name (firmware)",
            Self::VelocityLimit => "the drive's velocity limit is below what the joint may do",
            Self::WatchdogTimeout => {
                "the drive did not take the timeout of its watchdog; check endpoint_watchdog_timeout"
            }
            Self::WatchdogOff => "the drive did not switch its watchdog on; check endpoint_enable_watchdog",
            Self::Restarted => {
                "the drive has restarted, or another program changed it; clear the fault to configure it again"
            }
        }
    }
}

/// Bits of the active errors and what they mean.
const ERRORS: [(u32, &str); 22] = [
    (0, "it is still initialising"),
    (1, "system-level error: restart the drive, and report it to the maker if it comes back"),
    (2, "timing error in its firmware"),
    (3, "no encoder estimate: check the encoder, and whether it was calibrated"),
    (4, "bad configuration: correct it with the maker's tool"),
    (5, "fault of the gate driver"),
    (6, "an input that it needs is missing"),
    (8, "supply voltage too high"),
    (9, "supply voltage too low"),
    (10, "supply current too high"),
    (11, "regenerated current too high: check the brake resistor"),
    (12, "motor current above its limit"),
    (13, "motor too hot"),
    (14, "power stage too hot"),
    (15, "velocity above its limit"),
    (16, "position beyond its limit"),
    (24, "no command came for longer than its watchdog allows"),
    (25, "emergency stop was requested"),
    (26, "spinout: electrical and mechanical power disagree, check the encoder"),
    (27, "brake resistor is disarmed"),
    (28, "thermistor is disconnected"),
    (30, "calibration error"),
];

/// The code of the active errors: the first one; `None` when there are none.
#[must_use]
pub const fn error_code(errors: u32) -> Option<u32> {
    if errors == 0 { None } else { Some(ERROR | errors.trailing_zeros()) }
}

/// The errors that count of a drive: an idle one whose watchdog ran out is well, because nobody feeds it then.
#[must_use]
pub const fn counted(errors: u32, is_idle: bool) -> u32 {
    if is_idle { errors & !ERROR_WATCHDOG } else { errors }
}

/// The sentence for one of these codes, on a link that has a cable or none.
#[must_use]
pub fn explain_on(code: u32, has_cable: bool) -> String {
    if let Some(fault) = OdriveFault::ALL.into_iter().find(|fault| fault.code() == code) {
        let without_cable = matches!(fault, OdriveFault::NoAnswer | OdriveFault::Silent) && !has_cable;
        return if without_cable {
            "the drive sends nothing; see that its simulated servo runs on this bus, and its node id in the settings"
                .to_owned()
        } else {
            fault.sentence().to_owned()
        };
    }
    let Some(bit) = code.checked_sub(ERROR).filter(|bit| *bit < 32) else { return format!("code {code:#x}") };
    let known = ERRORS.iter().find(|(known, _)| *known == bit);
    let words = known.map_or("an error that is not known here", |(_, words)| words);
    format!("ODrive error 0x{:X}: {words}", 1_u32 << bit)
}

/// A state of the axis as text: "8 closed loop".
#[must_use]
pub fn status_text(state: u32) -> String {
    let words = match state {
        0 => "undefined",
        1 => "idle",
        2 => "startup",
        3..=7 | 10 | 12..=14 => "calibrating",
        8 => "closed loop",
        9 => "lock-in spin",
        11 => "homing",
        _ => "a state that is not known here",
    };
    format!("{state} {words}")
}

/// Flag of an object of this protocol in [`crate::ServoStatus::refused_object`].
const OBJECT: u32 = 0x8000_0000 | BASE;

/// Three parts of a version as one number.
#[must_use]
pub fn version_number([major, minor, revision]: [u8; 3]) -> f64 {
    f64::from(u32::from(major) << 16 | u32::from(minor) << 8 | u32::from(revision))
}

fn version_text(number: f64) -> String {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "24 bits")]
    let [_, major, minor, revision] = (number as u32).to_be_bytes();
    format!("{major}.{minor}.{revision}")
}

/// The object of a finding that has two numbers: what the drive states and what the settings say.
#[must_use]
pub const fn object(fault: OdriveFault) -> u32 {
    OBJECT | fault as u32 & 0xFFFF
}

/// The sentence for a refused drive: what it states and what the settings say.
#[must_use]
pub fn explain_refusal(refusal: &Refusal) -> String {
    let [stated, wanted] = refusal.numbers;
    let fault = OdriveFault::ALL.into_iter().find(|fault| object(*fault) == refusal.object);
    let sentence = fault.map_or_else(|| explain_on(refusal.code, true), |fault| fault.sentence().to_owned());
    match fault {
        Some(OdriveFault::Hardware | OdriveFault::Firmware) => {
            format!("{sentence}: it states {}, the settings {}", version_text(stated), version_text(wanted))
        }
        Some(OdriveFault::VelocityLimit) => format!(
            "{sentence}: {stated:.3} turns/s against {wanted:.3} turns/s; raise axis0.controller.config.vel_limit, or slow \
             the joint down"
        ),
        Some(OdriveFault::WatchdogTimeout | OdriveFault::WatchdogOff) => {
            format!("{sentence}: it holds {stated}, the settings say {wanted}")
        }
        Some(
            OdriveFault::NoAnswer
            | OdriveFault::NoReply
            | OdriveFault::OtherMaster
            | OdriveFault::EnableTimeout
            | OdriveFault::CommandFar
            | OdriveFault::DroppedOut
            | OdriveFault::Silent
            | OdriveFault::Unowned
            | OdriveFault::Restarted,
        )
        | None => sentence,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_one_sentence() {
        let findings = OdriveFault::ALL.into_iter().map(OdriveFault::code);
        let errors = (0..32).filter_map(|bit| error_code(1 << bit));
        let codes: Vec<u32> = findings.chain(errors).collect();
        let mut sentences: Vec<String> = codes.iter().map(|code| explain_on(*code, true)).collect();
        sentences.sort();
        sentences.dedup();
        assert_eq!(sentences.len(), codes.len());
        assert!(!sentences.iter().any(|sentence| sentence.starts_with("code")), "{sentences:?}");
        assert_eq!(error_code(0), None);
    }
}
