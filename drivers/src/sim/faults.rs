//! Faults on request, as text: `joint=elbow,kind=silence,at_s=2.0,after=enable,for_s=1.0,value=..`.
//!
//! The same text serves `--fault` and, after the word `fault`, lines on the standard input.
use crate::codec::digital_inputs::{KNOWN, NEGATIVE_LIMIT};
use std::fmt;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// The drive's connector is off: it neither sends nor receives.
    Silence,
    /// What it sends comes this much later.
    Delay {
        /// How much.
        by_s: f64,
    },
    /// Each of its frames, sent or received, is lost with this probability.
    Drop {
        /// 0 to 1.
        probability: f64,
    },
    /// It detects a fault by itself.
    Fault {
        /// EMCY code.
        code: u16,
    },
    /// The joint is jammed.
    Stuck,
    /// A rigid object is in its way: it cannot pass this link angle.
    Object {
        /// Where.
        at_rad: f64,
    },
    /// The encoder slips: it reads this much too far.
    Jump {
        /// How far.
        by_rad: f64,
    },
    /// It warns (statusword bit 7).
    Warning,
    /// It refuses every SDO write.
    Refuse {
        /// SDO abort code.
        code: u32,
    },
    /// These digital inputs are active (CiA 402).
    Inputs {
        /// Bits 0 to 3 of 0x60FD.
        bits: u8,
    },
    /// Its supply dips: it restarts.
    Restart,
}

/// From when on a fault's time counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum After {
    /// From the order.
    Start,
    /// From the moment when the joint's drive is in operation enabled.
    Enable,
    /// From the moment when the joint begins to move while enabled.
    Moving,
}

/// One fault that was requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultRequest {
    /// Joint, base to tip, from 0.
    pub joint: usize,
    /// What goes wrong.
    pub kind: FaultKind,
    /// From when on time counts.
    pub after: After,
    /// When it begins.
    pub at_s: f64,
    /// How long it lasts; without, until cleared.
    pub for_s: Option<f64>,
}

/// A line of the operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SimulatorCommand {
    /// A fault.
    Fault(FaultRequest),
    /// The end of all faults, or of one joint's.
    Clear(Option<usize>),
    /// Where the joints truly are.
    Status,
}

/// Why an order was not understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FaultRequestError {
    /// The first word of a line is none of the known ones.
    #[error("unknown order {0:?}: expected fault SPEC, clear, clear joint=NAME, or status")]
    Word(String),
    /// A piece without an equals sign, or with an unknown key.
    #[error("{0:?} is no part of a fault: expected joint=, kind=, at_s=, after=, for_s= or value=")]
    Key(String),
    /// A key that appears twice.
    #[error("{0} appears twice")]
    Twice(String),
    /// A key that must be there.
    #[error("{0} is missing: expected for example joint=3,kind=silence,at_s=2.0")]
    Missing(&'static str),
    /// The joint is not one of the arm's.
    #[error("joint={given} is no joint of this arm: expected 1 to {} or one of {}", names.len(), names.join(", "))]
    Joint {
        /// What stood there.
        given: String,
        /// The arm's joints.
        names: Vec<String>,
    },
    /// The kind is unknown.
    #[error(
        "kind={0} is unknown: expected silence, delay, drop, fault, stuck, object, jump, warning, refuse, inputs or restart"
    )]
    Kind(String),
    /// The event is unknown.
    #[error("after={0} is unknown: expected start, enable or moving")]
    After(String),
    /// A number does not fit its key.
    #[error("{key}={given}: expected {expected}")]
    Number {
        /// The key.
        key: &'static str,
        /// What stood there.
        given: String,
        /// What fits.
        expected: &'static str,
    },
}

impl SimulatorCommand {
    /// Reads a line of the standard input; `joints` are the names, base to tip.
    ///
    /// # Errors
    /// What was not understood, and what was expected.
    pub fn parse(line: &str, joints: &[String]) -> Result<Self, FaultRequestError> {
        let line = line.trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match (word, rest.trim()) {
            ("fault", spec) => Ok(Self::Fault(FaultRequest::parse(spec, joints)?)),
            ("clear", "") => Ok(Self::Clear(None)),
            ("clear", rest) => match rest.split_once('=') {
                Some(("joint", name)) => Ok(Self::Clear(Some(joint(name, joints)?))),
                _ => Err(FaultRequestError::Word(line.to_owned())),
            },
            ("status", "") => Ok(Self::Status),
            _ => Err(FaultRequestError::Word(line.to_owned())),
        }
    }
}

/// The pieces of a fault, as text.
#[derive(Default)]
struct Pieces<'a>(Vec<(&'a str, &'a str)>);

impl<'a> Pieces<'a> {
    fn split(text: &'a str) -> Result<Self, FaultRequestError> {
        const KEYS: [&str; 6] = ["joint", "kind", "at_s", "after", "for_s", "value"];
        let mut pieces = Self::default();
        for piece in text.split(',').map(str::trim) {
            let (key, value) =
                piece.split_once('=').ok_or_else(|| FaultRequestError::Key(piece.to_owned()))?;
            if !KEYS.contains(&key) {
                return Err(FaultRequestError::Key(piece.to_owned()));
            }
            if pieces.get(key).is_some() {
                return Err(FaultRequestError::Twice(key.to_owned()));
            }
            pieces.0.push((key, value));
        }
        Ok(pieces)
    }

    fn get(&self, key: &str) -> Option<&'a str> {
        self.0.iter().find(|(name, _)| *name == key).map(|(_, value)| *value)
    }

    fn need(&self, key: &'static str) -> Result<&'a str, FaultRequestError> {
        self.get(key).ok_or(FaultRequestError::Missing(key))
    }

    /// A number from `low` to `high`, or `default` when the key is not there.
    fn number(&self, key: &'static str, default: f64, fits: &Fits) -> Result<f64, FaultRequestError> {
        let Some(text) = self.get(key) else { return Ok(default) };
        let number = text.parse::<f64>().ok();
        number
            .filter(|number| (fits.low..=fits.high).contains(number))
            .ok_or_else(|| FaultRequestError::Number { key, given: text.to_owned(), expected: fits.words })
    }

    /// A code, decimal or after 0x.
    fn code(&self, default: u32, high: u32, words: &'static str) -> Result<u32, FaultRequestError> {
        let Some(text) = self.get("value") else { return Ok(default) };
        let code = match text.strip_prefix("0x") {
            Some(digits) => u32::from_str_radix(digits, 16).ok(),
            None => text.parse().ok(),
        };
        let wrong = || FaultRequestError::Number { key: "value", given: text.to_owned(), expected: words };
        code.filter(|code| (1..=high).contains(code)).ok_or_else(wrong)
    }
}

/// Which numbers fit.
struct Fits {
    low: f64,
    high: f64,
    words: &'static str,
}

/// A day is long enough for any test, and keeps nanoseconds far from overflow.
const TIME: Fits = Fits { low: 0.0, high: 86_400.0, words: "seconds from 0 to 86400" };

impl FaultRequest {
    /// Reads a fault; `joints` are the names, base to tip.
    ///
    /// # Errors
    /// What was not understood, and what was expected.
    pub fn parse(text: &str, joints: &[String]) -> Result<Self, FaultRequestError> {
        let pieces = Pieces::split(text)?;
        let after = match pieces.get("after") {
            None | Some("start") => After::Start,
            Some("enable") => After::Enable,
            Some("moving") => After::Moving,
            Some(other) => return Err(FaultRequestError::After(other.to_owned())),
        };
        let for_s = match pieces.get("for_s") {
            None => None,
            Some(_) => Some(pieces.number("for_s", 0.0, &TIME)?),
        };
        Ok(Self {
            joint: joint(pieces.need("joint")?, joints)?,
            kind: kind(&pieces)?,
            after,
            at_s: pieces.number("at_s", 0.0, &TIME)?,
            for_s,
        })
    }
}

fn kind(pieces: &Pieces<'_>) -> Result<FaultKind, FaultRequestError> {
    const DELAY: Fits = Fits { low: 0.0, high: 10_000.0, words: "milliseconds from 0 to 10000" };
    const CHANCE: Fits = Fits { low: 0.0, high: 1.0, words: "a probability from 0 to 1" };
    const ANGLE: Fits = Fits { low: -100.0, high: 100.0, words: "radians from -100 to 100" };
    const PLACE: Fits = Fits { low: -1e4, high: 1e4, words: "radians of the link, from -10000 to 10000" };
    const INPUTS: &str =
        "bits of 0x60FD from 1 to 15: 1 negative, 2 positive limit switch, 4 home switch, 8 interlock";
    const EMCY: &str = "an EMCY code from 1 to 0xFFFF";
    const ABORT: &str = "an SDO abort code, for example 0x08000022";
    let kind = match pieces.need("kind")? {
        "silence" => FaultKind::Silence,
        "delay" => FaultKind::Delay { by_s: pieces.number("value", 5.0, &DELAY)? * 1e-3 },
        "drop" => FaultKind::Drop { probability: pieces.number("value", 0.1, &CHANCE)? },
        "fault" => {
            let code = pieces.code(0x2310, 0xFFFF, EMCY)?;
            FaultKind::Fault { code: u16::try_from(code).unwrap_or(0x1000) }
        }
        "stuck" => FaultKind::Stuck,
        "object" => {
            pieces.get("value").ok_or(FaultRequestError::Missing("value"))?;
            FaultKind::Object { at_rad: pieces.number("value", 0.0, &PLACE)? }
        }
        "jump" => FaultKind::Jump { by_rad: pieces.number("value", 0.2, &ANGLE)? },
        "warning" => FaultKind::Warning,
        "refuse" => FaultKind::Refuse { code: pieces.code(0x0800_0000, u32::MAX, ABORT)? },
        "inputs" => {
            let bits = pieces.code(u32::from(NEGATIVE_LIMIT), u32::from(KNOWN), INPUTS)?;
            FaultKind::Inputs { bits: u8::try_from(bits).unwrap_or(KNOWN) }
        }
        "restart" => FaultKind::Restart,
        other => return Err(FaultRequestError::Kind(other.to_owned())),
    };
    let takes_value =
        !matches!(kind, FaultKind::Silence | FaultKind::Stuck | FaultKind::Warning | FaultKind::Restart);
    match pieces.get("value") {
        Some(given) if !takes_value => Err(FaultRequestError::Number {
            key: "value",
            given: given.to_owned(),
            expected: "no value for this kind",
        }),
        _ => Ok(kind),
    }
}

/// A joint by name, or by number from 1.
fn joint(given: &str, names: &[String]) -> Result<usize, FaultRequestError> {
    let by_number = given.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    names
        .iter()
        .position(|name| name == given)
        .or(by_number.filter(|at| *at < names.len()))
        .ok_or_else(|| FaultRequestError::Joint { given: given.to_owned(), names: names.to_vec() })
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silence => write!(f, "silence"),
            Self::Delay { by_s } => write!(f, "delay of {:.1} ms", by_s * 1e3),
            Self::Drop { probability } => write!(f, "drop of {:.1} %", probability * 100.0),
            Self::Fault { code } => write!(f, "fault 0x{code:04X}"),
            Self::Stuck => write!(f, "stuck"),
            Self::Object { at_rad } => write!(f, "object at {at_rad} rad"),
            Self::Jump { by_rad } => write!(f, "jump by {by_rad} rad"),
            Self::Warning => write!(f, "warning"),
            Self::Refuse { code } => write!(f, "refusal 0x{code:08X}"),
            Self::Inputs { bits } => write!(f, "digital inputs 0x{bits:X}"),
            Self::Restart => write!(f, "restart"),
        }
    }
}
