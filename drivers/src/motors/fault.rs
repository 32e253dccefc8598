//! What the master finds wrong with a motor that answers each command, and the words for it.
//!
//! A code is the protocol's upper half ([`super::AnsweringMotor::CODES`]) and below it the motor's own error (0 to 0xFF) or
//! one of these. A refused parameter stands in [`crate::ServoStatus::refused_object`].

/// Findings are above the motors' own errors.
const FINDING: u32 = 0x0100;

/// A finding of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum MotorFault {
    /// It does not answer.
    NoAnswer = FINDING | 0x01,
    /// A parameter was not answered.
    NoParameter = FINDING | 0x02,
    /// Another master commands it.
    OtherMaster = FINDING | 0x03,
    /// It did not say that it is energised.
    EnableTimeout = FINDING | 0x04,
    /// The command lay too far from the measured position to energise it.
    CommandFar = FINDING | 0x05,
    /// It disabled itself.
    DroppedOut = FINDING | 0x06,
    /// Its feedback stopped while it was in use.
    NoReply = FINDING | 0x07,
    /// Its parameters are not as they were left.
    Restarted = FINDING | 0x08,
    /// It is energised, and this master did not energise it.
    Unowned = FINDING | 0x09,
}

/// A protocol's words for its motors.
#[derive(Clone, Copy, Debug)]
pub struct MotorWords {
    /// What decides whether it answers, beside power and wiring: "the bit rate (register 35)".
    pub addressing: &'static str,
    /// The same of a simulated one, by the keys of the settings.
    pub simulated_addressing: &'static str,
    /// How an energised motor that is not ours gets limp by itself: "wait until its own watchdog (TIMEOUT) disables it".
    pub release: &'static str,
    /// What a parameter is called: "register" or "parameter".
    pub parameter_noun: &'static str,
    /// Name and key of a parameter.
    pub parameter: fn(u16) -> ParameterWords,
    /// A value of a parameter as people write it.
    pub value: fn(u16, [u8; 4]) -> String,
    /// The motor's own error: "status 9: under-voltage; check the supply".
    pub error: fn(u8) -> String,
}

/// What a parameter is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParameterWords {
    /// The manual's name.
    pub name: &'static str,
    /// The key of the settings that must agree with it.
    pub key: &'static str,
}

impl MotorFault {
    /// Every finding.
    pub const ALL: [Self; 9] = [
        Self::NoAnswer,
        Self::NoParameter,
        Self::OtherMaster,
        Self::EnableTimeout,
        Self::CommandFar,
        Self::DroppedOut,
        Self::NoReply,
        Self::Restarted,
        Self::Unowned,
    ];

    /// As [`crate::ServoStatus::error_code`], of the protocol with these codes.
    #[must_use]
    pub const fn code(self, codes: u16) -> u32 {
        (codes as u32) << 16 | self as u32
    }

    /// What happened and what to do, on a link that has a cable or none.
    #[must_use]
    pub fn sentence(self, words: &MotorWords, has_cable: bool) -> String {
        let MotorWords { addressing, simulated_addressing, release, .. } = words;
        let text = match self {
            Self::NoAnswer if has_cable => {
                return format!("the motor does not answer; check its power, the wiring, {addressing}");
            }
            Self::NoAnswer => {
                return format!(
                    "the motor does not answer; see that its simulated servo runs on this bus, and {simulated_addressing}"
                );
            }
            Self::Unowned => {
                return format!(
                    "the motor was energised before this streamer came, and nothing tells what it holds, so it is not taken over; \
                     end the program that uses it, or support the arm and `torque-off`, or {release}; then `clear-fault`"
                );
            }
            Self::NoParameter => "the motor answers, but not to a read of this parameter; check its firmware",
            Self::OtherMaster => "another master commands this motor; end it first",
            Self::EnableTimeout => "the motor did not say that it is enabled; check its supply",
            Self::CommandFar => "not energised: the command lies too far from the measured position",
            Self::DroppedOut => {
                "the motor disabled itself, or restarted; check its supply, and that no other program disables it"
            }
            Self::NoReply if has_cable => "the motor stopped answering; check its power and the wiring",
            Self::NoReply => "the motor fell silent; see that its simulated servo still runs",
            Self::Restarted => {
                "the motor has restarted, or another program wrote its parameters; clear the fault to set them again"
            }
        };
        text.to_owned()
    }
}

/// Flag of a parameter in [`crate::ServoStatus::refused_object`]; its number is in the low half, its protocol's codes above.
const PARAMETER: u32 = 0x8000_0000;
/// Flag beside it: the code is what the parameter holds.
const HELD: u32 = 0x4000_0000;

/// The object of a parameter that was not answered.
#[must_use]
pub const fn parameter_object(codes: u16, parameter: u16) -> u32 {
    PARAMETER | (codes as u32 & 0xFF) << 16 | parameter as u32
}

/// Code and object of a parameter that holds something else than the settings say.
#[must_use]
pub const fn differs(codes: u16, parameter: u16, value: [u8; 4]) -> (u32, u32) {
    (u32::from_le_bytes(value), HELD | parameter_object(codes, parameter))
}

/// The codes of the protocol whose parameter an object is; none for an object of another kind.
#[must_use]
pub const fn codes_of(object: u32) -> Option<u16> {
    if object & PARAMETER == 0 { None } else { Some((object >> 16 & 0xFF) as u16) }
}

/// The sentence for the lower half of a code.
#[must_use]
pub fn explain(words: &MotorWords, code: u32, has_cable: bool) -> String {
    let low = code & 0xFFFF;
    if let Some(fault) = MotorFault::ALL.into_iter().find(|fault| *fault as u32 == low) {
        return fault.sentence(words, has_cable);
    }
    u8::try_from(low).map_or_else(|_| format!("code {code:#x}"), words.error)
}

/// The sentence for a refused parameter.
#[must_use]
pub fn explain_refusal(words: &MotorWords, code: u32, object: u32) -> String {
    let number = (object & 0xFFFF) as u16;
    let ParameterWords { name, key } = (words.parameter)(number);
    let noun = words.parameter_noun;
    let shown = if number < 0x100 { number.to_string() } else { format!("0x{number:04X}") };
    if object & HELD == 0 {
        return format!("{noun} {shown} ({name}): {}", explain(words, code, true));
    }
    let held = (words.value)(number, code.to_le_bytes());
    format!(
        "{noun} {shown} ({name}) of the motor holds {held} and the settings say otherwise; make {key} and the {noun} agree: \
         on the wire every value is scaled by it"
    )
}
