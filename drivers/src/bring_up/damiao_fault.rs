//! What the master finds wrong with a Damiao motor, and what the motor's own codes mean.
//!
//! Codes from 0x2 0000 to 0x2 FFFF, apart from those of CiA 402 (see [`crate::bring_up::fault`]): the motor's status
//! nibble, or one of these. A refused register stands in [`crate::ServoStatus::refused_object`].
use crate::codec::damiao_frames::{Register, is_integer, status_words};

const BASE: u32 = 0x0002_0000;
const FINDING: u32 = 0x0100;

/// A finding of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum DamiaoFault {
    /// It does not answer.
    NoAnswer = BASE | FINDING | 0x01,
    /// A register was not answered.
    NoRegister = BASE | FINDING | 0x02,
    /// Another master commands it.
    OtherMaster = BASE | FINDING | 0x03,
    /// It did not say that it is energised.
    EnableTimeout = BASE | FINDING | 0x04,
    /// The command lay too far from the measured position to energise it.
    CommandFar = BASE | FINDING | 0x05,
    /// It disabled itself.
    DroppedOut = BASE | FINDING | 0x06,
    /// Its feedback stopped while it was in use.
    NoReply = BASE | FINDING | 0x07,
    /// Its registers are not as they were left.
    Restarted = BASE | FINDING | 0x08,
    /// It is energised, and this master did not energise it.
    Unowned = BASE | FINDING | 0x09,
}

impl DamiaoFault {
    /// Every finding.
    pub const ALL: [Self; 9] = [
        Self::NoAnswer,
        Self::NoRegister,
        Self::OtherMaster,
        Self::EnableTimeout,
        Self::CommandFar,
        Self::DroppedOut,
        Self::NoReply,
        Self::Restarted,
        Self::Unowned,
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
                "the motor does not answer; check its power, the wiring, the bit rate (register 35), node_id (register 8) \
                 and feedback_id (register 7)"
            }
            Self::NoRegister => "the motor answers, but not to a read of this register; check its firmware",
            Self::OtherMaster => "another master commands this motor; end it first",
            Self::EnableTimeout => "the motor did not say that it is enabled; check its supply",
            Self::CommandFar => "not energised: the command lies too far from the measured position",
            Self::DroppedOut => {
                "the motor disabled itself, or restarted; check its supply, and that no other program disables it"
            }
            Self::NoReply => "the motor stopped answering; check its power and the wiring",
            Self::Restarted => {
                "the motor has restarted, or another program wrote its registers; clear the fault to set them again"
            }
            Self::Unowned => {
                "the motor was energised before this streamer came, and no register tells what it holds, so it is not taken \
                 over; end the program that uses it, or support the arm and `torque-off`, or wait until its own watchdog \
                 (TIMEOUT) disables it; then `clear-fault`"
            }
        }
    }
}

/// Flag of a register in [`crate::ServoStatus::refused_object`]; its number is in the low byte.
const REGISTER: u32 = 0x8000_0000;
/// Flag beside it: the code is what the register holds.
const HELD: u32 = 0x4000_0000;

/// The motor's own status as a code.
#[must_use]
pub const fn status_code(status: u8) -> u32 {
    BASE | status as u32
}

/// The object of a register that was not answered.
#[must_use]
pub const fn register_object(register: Register) -> u32 {
    REGISTER | register as u32
}

/// Code and object of a register that holds something else than the settings say.
#[must_use]
pub const fn differs(register: Register, value: [u8; 4]) -> (u32, u32) {
    (u32::from_le_bytes(value), REGISTER | HELD | register as u32)
}

/// The sentence for one of these codes; `None` for another protocol's.
#[must_use]
pub fn explain(code: u32) -> Option<String> {
    explain_on(code, true)
}

/// The same, on a link that has a cable or none.
#[must_use]
pub fn explain_on(code: u32, has_cable: bool) -> Option<String> {
    if let Some(fault) = DamiaoFault::ALL.into_iter().find(|fault| fault.code() == code) {
        let sentence = match fault {
            DamiaoFault::NoAnswer if !has_cable => {
                "the motor does not answer; see that its simulated servo runs on this bus, and its node_id and feedback_id \
                 in the settings"
            }
            DamiaoFault::NoReply if !has_cable => {
                "the motor fell silent; see that its simulated servo still runs"
            }
            DamiaoFault::NoAnswer
            | DamiaoFault::NoRegister
            | DamiaoFault::OtherMaster
            | DamiaoFault::EnableTimeout
            | DamiaoFault::CommandFar
            | DamiaoFault::DroppedOut
            | DamiaoFault::NoReply
            | DamiaoFault::Restarted
            | DamiaoFault::Unowned => fault.sentence(),
        };
        return Some(sentence.to_owned());
    }
    let status = u8::try_from(code.checked_sub(BASE)?).ok().filter(|status| *status <= 0xF)?;
    Some(format!("status {status:X}: {}", status_words(status)))
}

/// The sentence for a refused register; `None` when the object is none of these.
#[must_use]
pub fn explain_refusal(code: u32, object: u32) -> Option<String> {
    if object & REGISTER == 0 {
        return None;
    }
    let number = (object & 0xFF) as u8;
    let (name, key) = match Register::from_number(number) {
        Some(register) => (register.name(), register.key()),
        None => ("unknown", "no key"),
    };
    if object & HELD == 0 {
        let what = explain(code).unwrap_or_else(|| format!("code {code:#x}"));
        return Some(format!("register {number} ({name}): {what}"));
    }
    let held = if is_integer(number) { code.to_string() } else { f32::from_bits(code).to_string() };
    Some(format!(
        "register {number} ({name}) of the motor holds {held} and the settings say otherwise; make {key} and the \
         register agree: on the wire every value is scaled by it"
    ))
}
