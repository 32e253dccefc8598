//! Frames of `RobStride` motors in their private protocol: operation commands, parameters, feedback, fault reports.
//!
//! Every identifier has 29 bits: a type in the highest five, then sixteen bits whose meaning hangs on the type, then the
//! receiver. Every value can be encoded and decoded, because the master and the simulated motors share this file. Decoders
//! take any frame and answer `None` for what is not theirs.
//!
//! The motor has no request that only asks for its state. What comes nearest is to read a parameter and to write the same
//! value back: the answer to a write is a feedback. Type 4 with 0xC4 in its second byte reads the version and is answered
//! like a feedback too, but firmware without it takes that frame for "stop", so it is never sent.
//!
//! Source: `RobStride`, "RS00/RS02/RS03/RS04 User Manual" of 2026-04-28, chapter 4.1.
use crate::codec::mit::{MitCommand, MitRanges, MitState, Span};
use crate::frame::{CanFrame, CanId};

const GET_ID: u8 = 0;
const OPERATION: u8 = 1;
const FEEDBACK: u8 = 2;
const ENABLE: u8 = 3;
const STOP: u8 = 4;
const SET_ZERO: u8 = 6;
const READ: u8 = 17;
const WRITE: u8 = 18;
const FAULT: u8 = 21;
const REPORT: u8 = 24;
/// Types that a master sends and this software does not: identifiers, baud rate, protocol, flash, reporting.
const OTHERS: [u8; 5] = [7, 22, 23, REPORT, 25];

/// Second byte of a "stop" that asks for the version.
const VERSION: u8 = 0xC4;
/// First bytes of a feedback that holds a version.
const VERSION_REPLY: [u8; 3] = [0x00, VERSION, 0x56];
/// Receiver of the answer to "get id".
const BROADCAST: u8 = 0xFE;

/// Largest identifier of a motor.
pub const NODE_ID_MAX: u8 = 127;
/// Units of parameter 0x7028 a millisecond.
pub const TIMEOUT_UNITS_A_MS: u32 = 20;
/// Reach of positions on the wire since firmware 0.0.2.6 of RS00: the manual's 4 pi.
pub const POSITION_REACH_RAD: f64 = 4.0 * std::f64::consts::PI;

/// The three parts of an identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Parts {
    kind: u8,
    data: u16,
    target: u8,
}

impl Parts {
    fn id(self) -> CanId {
        let Self { kind, data, target } = self;
        CanId::extended(u32::from(kind & 0x1F) << 24 | u32::from(data) << 8 | u32::from(target))
    }
    fn of(frame: &CanFrame) -> Option<Self> {
        let [kind, high, low, target] = frame.id().as_extended_data()?.to_be_bytes();
        Some(Self { kind, data: u16::from_be_bytes([high, low]), target })
    }
    fn frame(self, bytes: [u8; 8]) -> CanFrame {
        CanFrame::classic(self.id(), &bytes)
    }
}

/// The eight bytes of a classic frame: the motors have no FD.
fn eight(frame: &CanFrame) -> Option<[u8; 8]> {
    <[u8; 8]>::try_from(frame.data()).ok().filter(|_| !frame.is_fd())
}

/// A parameter that this software knows by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum Parameter {
    /// What the motor makes of commands, one byte; 0 is operation control.
    RunMode = 0x7005,
    /// Largest torque that it gives, Nm.
    TorqueLimit = 0x700B,
    /// Angle of the output shaft, rad.
    Position = 0x7019,
    /// Watchdog in units of 50 us; 0 is none.
    Timeout = 0x7028,
}

impl Parameter {
    /// Every one.
    pub const ALL: [Self; 4] = [Self::RunMode, Self::TorqueLimit, Self::Position, Self::Timeout];

    /// Its index.
    #[must_use]
    pub const fn index(self) -> u16 {
        self as u16
    }
    /// The manual's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::RunMode => "run_mode",
            Self::TorqueLimit => "limit_torque",
            Self::Position => "mechPos",
            Self::Timeout => "canTimeout",
        }
    }
    /// The key of the settings that must agree with it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::RunMode => "protocol",
            Self::TorqueLimit => "torque_limit_nm",
            Self::Position => "position_range_rad",
            Self::Timeout => "watchdog_ms",
        }
    }
    /// By its index.
    #[must_use]
    pub fn from_index(index: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|parameter| parameter.index() == index)
    }
}

/// The ranges of a motor on the wire, all in 16 bits.
#[must_use]
pub const fn ranges(reach: [f64; 3], stiffness_max: f64, damping_max: f64) -> MitRanges {
    let [position_rad, velocity_rad_s, torque_nm] = reach;
    MitRanges {
        position: Span::symmetric(position_rad, 16),
        velocity: Span::symmetric(velocity_rad_s, 16),
        stiffness: Span::new(0.0, stiffness_max, 16),
        damping: Span::new(0.0, damping_max, 16),
        torque: Span::symmetric(torque_nm, 16),
    }
}

/// An operation command, packed: its meaning hangs on the motor's ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operation {
    /// Torque, in the identifier.
    pub torque: u16,
    /// Position, velocity, stiffness, damping, the high byte first.
    pub bytes: [u8; 8],
}

impl Operation {
    /// Packs a command; `None` when one of its five numbers is none.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(command: &MitCommand, ranges: &MitRanges) -> Option<Self> {
        let [a, b] = ranges.position.encode(command.position_rad)?.to_be_bytes();
        let [c, d] = ranges.velocity.encode(command.velocity_rad_s)?.to_be_bytes();
        let [e, f] = ranges.stiffness.encode(command.stiffness_nm_rad)?.to_be_bytes();
        let [g, h] = ranges.damping.encode(command.damping_nm_s_rad)?.to_be_bytes();
        Some(Self { torque: ranges.torque.encode(command.torque_nm)?, bytes: [a, b, c, d, e, f, g, h] })
    }
    /// The command; any bits are one.
    #[must_use]
    pub fn decode(self, ranges: &MitRanges) -> MitCommand {
        let [a, b, c, d, e, f, g, h] = self.bytes;
        MitCommand {
            position_rad: ranges.position.decode(u16::from_be_bytes([a, b])),
            velocity_rad_s: ranges.velocity.decode(u16::from_be_bytes([c, d])),
            stiffness_nm_rad: ranges.stiffness.decode(u16::from_be_bytes([e, f])),
            damping_nm_s_rad: ranges.damping.decode(u16::from_be_bytes([g, h])),
            torque_nm: ranges.torque.decode(self.torque),
        }
    }
}

/// What a motor is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Say who you are.
    GetId,
    /// An operation command.
    Operation(Operation),
    /// Energise.
    Enable,
    /// De-energise.
    Stop,
    /// De-energise and forget the fault.
    ClearFault,
    /// Say your version; firmware without it takes this for `Stop`.
    Version,
    /// Here is zero.
    SetZero,
    /// Read a parameter.
    Read(u16),
    /// Write a parameter, until power is lost.
    Write(u16, [u8; 4]),
    /// A request of a type that this software does not send.
    Other(u8),
}

impl Request {
    /// It holds a setpoint.
    #[must_use]
    pub const fn is_setpoint(self) -> bool {
        matches!(self, Self::Operation(_))
    }

    /// The frame from master `host` to motor `node_id`.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(self, host: u8, node_id: u8) -> CanFrame {
        let parts = |kind: u8| Parts { kind, data: u16::from(host), target: node_id };
        let first = |byte: u8, second: u8| [byte, second, 0, 0, 0, 0, 0, 0];
        let parameter = |index: u16, [a, b, c, d]: [u8; 4]| {
            let [low, high] = index.to_le_bytes();
            [low, high, 0, 0, a, b, c, d]
        };
        match self {
            Self::GetId => parts(GET_ID).frame([0; 8]),
            Self::Operation(Operation { torque, bytes }) => {
                Parts { kind: OPERATION, data: torque, target: node_id }.frame(bytes)
            }
            Self::Enable => parts(ENABLE).frame([0; 8]),
            Self::Stop => parts(STOP).frame([0; 8]),
            Self::ClearFault => parts(STOP).frame(first(1, 0)),
            Self::Version => parts(STOP).frame(first(0, VERSION)),
            Self::SetZero => parts(SET_ZERO).frame(first(1, 0)),
            Self::Read(index) => parts(READ).frame(parameter(index, [0; 4])),
            Self::Write(index, value) => parts(WRITE).frame(parameter(index, value)),
            Self::Other(kind) => parts(kind).frame([0; 8]),
        }
    }

    /// Who asks motor `node_id` what; `None` when the frame does not. Operation commands name no master: 0.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<(u8, Self)> {
        let Parts { kind, data, target } = Parts::of(frame)?;
        let bytes = eight(frame).filter(|_| target == node_id)?;
        let [_, host] = data.to_be_bytes();
        let [first, second, _, _, a, b, c, d] = bytes;
        let index = u16::from_le_bytes([first, second]);
        let request = match kind {
            GET_ID => Self::GetId,
            OPERATION => return Some((0, Self::Operation(Operation { torque: data, bytes }))),
            ENABLE => Self::Enable,
            STOP if first == 1 => Self::ClearFault,
            STOP if first == 0 && second == VERSION => Self::Version,
            STOP => Self::Stop,
            SET_ZERO if first == 1 => Self::SetZero,
            READ => Self::Read(index),
            WRITE => Self::Write(index, [a, b, c, d]),
            kind if OTHERS.contains(&kind) => Self::Other(kind),
            _ => return None,
        };
        Some((host, request))
    }

    /// True when a frame speaks to motor `node_id` as a master does. Masters stand above all motors ([`NODE_ID_MAX`]), so no
    /// answer to one is among these.
    #[must_use]
    pub fn is_to(frame: &CanFrame, node_id: u8) -> bool {
        Self::decode(frame, node_id).is_some()
    }
}

/// Whether the motor carries torque, as the identifier of its feedback says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// No torque.
    Reset = 0,
    /// It measures itself, and moves.
    Calibration = 1,
    /// Energised.
    Run = 2,
    /// No state of the manual.
    Unknown = 3,
}

impl Mode {
    const fn from_bits(bits: u16) -> Self {
        match bits & 3 {
            0 => Self::Reset,
            1 => Self::Calibration,
            2 => Self::Run,
            _ => Self::Unknown,
        }
    }
}

/// What a motor says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Feedback {
    /// Whether it carries torque.
    pub mode: Mode,
    /// Faults, six bits: under-voltage is the lowest.
    pub faults: u8,
    /// Angle, velocity and torque, packed.
    pub state: [u8; 6],
    /// Temperature, 0.1 degrees Celsius.
    pub decicelsius: u16,
}

impl Feedback {
    /// As values.
    #[must_use]
    pub fn values(&self, ranges: &MitRanges) -> MitState {
        let [a, b, c, d, e, f] = self.state;
        MitState {
            position_rad: ranges.position.decode(u16::from_be_bytes([a, b])),
            velocity_rad_s: ranges.velocity.decode(u16::from_be_bytes([c, d])),
            torque_nm: ranges.torque.decode(u16::from_be_bytes([e, f])),
        }
    }
    /// Packs a state; what is no number is sent as the middle of its range.
    #[must_use]
    pub fn pack(state: &MitState, ranges: &MitRanges) -> [u8; 6] {
        let code = |span: &Span, value: f64| span.encode(value).unwrap_or(0x7FFF).to_be_bytes();
        let [a, b] = code(&ranges.position, state.position_rad);
        let [c, d] = code(&ranges.velocity, state.velocity_rad_s);
        let [e, f] = code(&ranges.torque, state.torque_nm);
        [a, b, c, d, e, f]
    }
}

/// What a motor sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Its unique number.
    Identity([u8; 8]),
    /// Its state.
    Feedback(Feedback),
    /// The value of a parameter, or that it could not be read.
    Value {
        /// Its index.
        index: u16,
        /// It was read.
        read: bool,
        /// The low byte first.
        value: [u8; 4],
    },
    /// Its faults and warnings, by itself.
    Fault {
        /// Faults by bit.
        faults: u32,
        /// Warnings by bit.
        warnings: u32,
    },
    /// The answer to `Version`.
    Version([u8; 4]),
}

impl Reply {
    /// The frame of motor `node_id` to master `host`.
    #[must_use]
    pub fn encode(self, node_id: u8, host: u8) -> CanFrame {
        let parts =
            |kind: u8, high: u8| Parts { kind, data: u16::from_be_bytes([high, node_id]), target: host };
        match self {
            Self::Identity(number) => Parts { target: BROADCAST, ..parts(GET_ID, 0) }.frame(number),
            Self::Feedback(Feedback { mode, faults, state: [a, b, c, d, e, f], decicelsius }) => {
                let [g, h] = decicelsius.to_be_bytes();
                parts(FEEDBACK, (mode as u8) << 6 | faults & 0x3F).frame([a, b, c, d, e, f, g, h])
            }
            Self::Value { index, read, value: [a, b, c, d] } => {
                let [low, high] = index.to_le_bytes();
                parts(READ, u8::from(!read)).frame([low, high, 0, 0, a, b, c, d])
            }
            Self::Fault { faults, warnings } => {
                let ([a, b, c, d], [e, f, g, h]) = (faults.to_le_bytes(), warnings.to_le_bytes());
                parts(FAULT, 0).frame([a, b, c, d, e, f, g, h])
            }
            Self::Version([a, b, c, d]) => {
                let [first, second, third] = VERSION_REPLY;
                parts(FEEDBACK, 0).frame([first, second, third, a, b, c, d, 0])
            }
        }
    }

    /// What a frame says, when it is of motor `node_id`. Values of parameters count only when they are for `host`; all else
    /// is true whoever asked.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8, host: u8) -> Option<Self> {
        let Parts { kind, data, target } = Parts::of(frame)?;
        let [high, low] = data.to_be_bytes();
        let bytes = eight(frame).filter(|_| low == node_id)?;
        let [a, b, c, d, e, f, g, h] = bytes;
        match kind {
            GET_ID if target == BROADCAST => Some(Self::Identity(bytes)),
            FEEDBACK | REPORT if target > NODE_ID_MAX || target == host => {
                if [a, b, c] == VERSION_REPLY {
                    return Some(Self::Version([d, e, f, g]));
                }
                Some(Self::Feedback(Feedback {
                    mode: Mode::from_bits(u16::from(high >> 6)),
                    faults: high & 0x3F,
                    state: [a, b, c, d, e, f],
                    decicelsius: u16::from_be_bytes([g, h]),
                }))
            }
            READ if target == host => {
                Some(Self::Value { index: u16::from_le_bytes([a, b]), read: high == 0, value: [e, f, g, h] })
            }
            FAULT => Some(Self::Fault {
                faults: u32::from_le_bytes([a, b, c, d]),
                warnings: u32::from_le_bytes([e, f, g, h]),
            }),
            _ => None,
        }
    }
}
