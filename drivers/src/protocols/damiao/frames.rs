//! Frames of Damiao motors: commands of two modes, special commands, registers, feedback.
//!
//! Every value can be encoded and decoded, because the master and the simulated motors share this file. Decoders take
//! any frame and answer `None` for what is not theirs.
//!
//! Register answers and feedback come under one identifier. An answer begins with the motor's id, 0 and 0x33 or 0x55; a
//! feedback with the same three bytes would be of a motor that is disabled and stands within 0.4 % of its lowest angle.
//! Settings keep joints out of there, so such a frame is an answer, whatever was asked.
//!
//! Source: Damiao DM-J43xx manual and the firmware's register table.
use crate::codec::mit::{self, MitRanges, MitState};
use crate::frame::{CanFrame, CanId};
use taustream_arm::DamiaoMode;

/// Where registers are requested.
pub const REGISTER_ID: u16 = 0x7FF;
/// Distance between the identifiers of one mode's commands and the next's.
pub const MODE_STEP: u16 = 0x100;

const READ: u8 = 0x33;
const WRITE: u8 = 0x55;
const STORE: u8 = 0xAA;
const REFRESH: u8 = 0xCC;

/// What may stand in a frame's payload: classic frames everywhere, FD frames with bit rate switch on an FD bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wire {
    /// Classic frames.
    #[default]
    Classic,
    /// FD frames; still eight bytes.
    Fd,
}

impl Wire {
    /// A frame of this kind.
    #[must_use]
    pub fn frame(self, id: u16, bytes: &[u8]) -> CanFrame {
        match self {
            Self::Classic => CanFrame::classic(CanId::standard(id), bytes),
            Self::Fd => CanFrame::fd(CanId::standard(id), bytes),
        }
    }
}

/// The eight bytes of a standard data frame, classic or FD, with its identifier.
fn eight(frame: &CanFrame) -> Option<(u16, [u8; 8])> {
    Some((frame.id().as_standard_data()?, <[u8; 8]>::try_from(frame.data()).ok()?))
}

/// A register that this software knows by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Register {
    /// Identifier of its feedback.
    FeedbackId = 7,
    /// Identifier of its commands.
    NodeId = 8,
    /// Watchdog in units of 50 us; 0 is none.
    Timeout = 9,
    /// Mode of control.
    Mode = 10,
    /// Reach of positions on the wire, rad.
    PositionRange = 21,
    /// Reach of velocities, rad/s.
    VelocityRange = 22,
    /// Reach of torques, Nm.
    TorqueRange = 23,
}

impl Register {
    /// The manual's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FeedbackId => "MST_ID",
            Self::NodeId => "ESC_ID",
            Self::Timeout => "TIMEOUT",
            Self::Mode => "CTRL_MODE",
            Self::PositionRange => "PMAX",
            Self::VelocityRange => "VMAX",
            Self::TorqueRange => "TMAX",
        }
    }
    /// The key of the settings that must agree with it.
    #[must_use]
    pub const fn key(self) -> &'static str {
        match self {
            Self::FeedbackId => "feedback_id",
            Self::NodeId => "node_id",
            Self::Timeout => "watchdog_ms",
            Self::Mode => "mode",
            Self::PositionRange => "position_range_rad",
            Self::VelocityRange => "velocity_range_rad_s",
            Self::TorqueRange => "torque_range_nm",
        }
    }
    /// By its number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        const ALL: [Register; 7] = [
            Register::FeedbackId,
            Register::NodeId,
            Register::Timeout,
            Register::Mode,
            Register::PositionRange,
            Register::VelocityRange,
            Register::TorqueRange,
        ];
        ALL.into_iter().find(|register| *register as u8 == number)
    }
}

/// True when a register holds an unsigned integer; all others hold a float (register table).
#[must_use]
pub const fn is_integer(register: u8) -> bool {
    matches!(register, 7..=10 | 13..=16 | 35 | 36)
}

/// Units of register 9 a millisecond.
pub const TIMEOUT_UNITS_A_MS: u32 = 20;

/// The value of register 10 for a mode.
#[must_use]
pub const fn mode_number(mode: &DamiaoMode) -> u32 {
    match mode {
        DamiaoMode::Mit(_) => 1,
        DamiaoMode::PosVel => 2,
    }
}

/// Commands of one byte, recognised by seven 0xFF before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Special {
    /// Forget the error.
    ClearError = 0xFB,
    /// Energise.
    Enable = 0xFC,
    /// De-energise.
    Disable = 0xFD,
    /// Here is zero, from now on and after power-up.
    SetZero = 0xFE,
}

impl Special {
    fn from_byte(byte: u8) -> Option<Self> {
        const ALL: [Special; 4] = [Special::ClearError, Special::Enable, Special::Disable, Special::SetZero];
        ALL.into_iter().find(|special| *special as u8 == byte)
    }
}

/// What a motor is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// A special command; at the identifier of which mode (0 is MIT's, which is the usual one).
    Special(Special, u8),
    /// An MIT command, still packed: its meaning hangs on the motor's ranges.
    Mit([u8; 8]),
    /// Position and largest speed.
    PosVel {
        /// Wanted angle.
        position_rad: f32,
        /// Largest speed.
        velocity_rad_s: f32,
    },
    /// A command of a mode that this software does not use: 3 is VEL, 4 is `FORCE_POS`.
    OtherMode(u8),
    /// Read a register.
    Read(u8),
    /// Write a register, until power is lost.
    Write(u8, [u8; 4]),
    /// Keep all registers over a power cycle.
    Store,
    /// Send a feedback.
    Refresh,
}

impl Request {
    /// It holds a setpoint.
    #[must_use]
    pub const fn is_setpoint(self) -> bool {
        matches!(self, Self::Mit(_) | Self::PosVel { .. })
    }

    /// The frame to motor `node_id`.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(self, node_id: u8, wire: Wire) -> CanFrame {
        let id = u16::from(node_id);
        let register = |kind: u8, number: u8, [a, b, c, d]: [u8; 4]| {
            wire.frame(REGISTER_ID, &[node_id, 0, kind, number, a, b, c, d])
        };
        match self {
            Self::Special(special, mode) => {
                let mut bytes = [0xFF; 8];
                bytes[7] = special as u8;
                wire.frame(id + MODE_STEP * u16::from(mode & 3), &bytes)
            }
            Self::Mit(bytes) => wire.frame(id, &mit::unlike_special(bytes)),
            Self::PosVel { position_rad, velocity_rad_s } => {
                let [a, b, c, d] = position_rad.to_le_bytes();
                let [e, f, g, h] = velocity_rad_s.to_le_bytes();
                wire.frame(id + MODE_STEP, &[a, b, c, d, e, f, g, h])
            }
            Self::OtherMode(mode) => {
                wire.frame(id + MODE_STEP * u16::from(mode.wrapping_sub(1) & 3), &[0; 8])
            }
            Self::Read(number) => register(READ, number, [0; 4]),
            Self::Write(number, value) => register(WRITE, number, value),
            Self::Store => register(STORE, 1, [0; 4]),
            Self::Refresh => register(REFRESH, 0, [0; 4]),
        }
    }

    /// What a frame asks of motor `node_id`; `None` when it is not for it.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        let id = frame.id().as_standard_data()?;
        if id == REGISTER_ID {
            let (_, [low, high, kind, number, a, b, c, d]) = eight(frame)?;
            if (low, high) != (node_id, 0) {
                return None;
            }
            return match kind {
                READ => Some(Self::Read(number)),
                WRITE => Some(Self::Write(number, [a, b, c, d])),
                STORE if number == 1 => Some(Self::Store),
                REFRESH => Some(Self::Refresh),
                _ => None,
            };
        }
        let mode = id.checked_sub(u16::from(node_id)).filter(|offset| offset % MODE_STEP == 0)? / MODE_STEP;
        let mode = u8::try_from(mode).ok().filter(|mode| *mode < 4)?;
        if let Some((_, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, last])) = eight(frame)
            && let Some(special) = Special::from_byte(last)
        {
            return Some(Self::Special(special, mode));
        }
        match (mode, eight(frame)) {
            (0, Some((_, bytes))) => Some(Self::Mit(bytes)),
            (1, Some((_, [a, b, c, d, e, f, g, h]))) => Some(Self::PosVel {
                position_rad: f32::from_le_bytes([a, b, c, d]),
                velocity_rad_s: f32::from_le_bytes([e, f, g, h]),
            }),
            (2 | 3, _) => Some(Self::OtherMode(mode + 1)),
            _ => None,
        }
    }

    /// True when a frame speaks to motor `node_id` as a master does.
    #[must_use]
    pub fn is_to(frame: &CanFrame, node_id: u8) -> bool {
        Self::decode(frame, node_id).is_some()
    }
}

/// Status nibble of a motor that is not energised.
pub const STATUS_DISABLED: u8 = 0x0;
/// Status nibble of a motor that is energised.
pub const STATUS_ENABLED: u8 = 0x1;
/// Status nibble of a motor that has disabled itself because no command came.
pub const STATUS_LOST_COMMUNICATION: u8 = 0xD;

/// What the nibble says.
#[must_use]
pub const fn status_words(status: u8) -> &'static str {
    match status {
        STATUS_DISABLED => "disabled",
        STATUS_ENABLED => "enabled",
        0x8 => "over-voltage; check the supply and what brakes into it",
        0x9 => "under-voltage; check the supply",
        0xA => "over-current; check for a blocked joint and a short circuit",
        0xB => "its power stage is too hot; let it cool down",
        0xC => "its winding is too hot; let it cool down",
        STATUS_LOST_COMMUNICATION => {
            "it received no command for longer than its TIMEOUT (watchdog_ms) and disabled itself; check the wiring, and whether the \
             streamer was stalled"
        }
        0xE => "overload; check for a blocked joint",
        _ => "a state that its manual does not list",
    }
}

/// What a motor says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Status nibble.
    pub status: u8,
    /// Angle, velocity and torque, still packed.
    pub state: [u8; 5],
    /// Temperature of the power stage.
    pub stage_celsius: u8,
    /// Temperature of the winding.
    pub winding_celsius: u8,
}

impl Feedback {
    /// As values.
    #[must_use]
    pub fn values(&self, ranges: &MitRanges) -> MitState {
        MitState::decode(self.state, ranges)
    }
}

/// What a motor sends under its feedback identifier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// Its state.
    Feedback(Feedback),
    /// The value of a register, after a read or a write.
    Register {
        /// Its number.
        number: u8,
        /// It was written.
        written: bool,
        /// Little-endian.
        value: [u8; 4],
    },
}

impl Reply {
    /// The frame of motor `node_id`.
    #[must_use]
    pub fn encode(self, node_id: u8, feedback_id: u16, wire: Wire) -> CanFrame {
        let bytes = match self {
            Self::Feedback(Feedback { status, state, stage_celsius, winding_celsius }) => {
                let [a, b, c, d, e] = state;
                [status << 4 | node_id & 0xF, a, b, c, d, e, stage_celsius, winding_celsius]
            }
            Self::Register { number, written, value: [a, b, c, d] } => {
                [node_id, 0, if written { WRITE } else { READ }, number, a, b, c, d]
            }
        };
        wire.frame(feedback_id, &bytes)
    }
    /// What a frame says, when it is motor `node_id`'s under its feedback identifier.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8, feedback_id: u16) -> Option<Self> {
        let (id, [first, a, b, c, d, e, f, g]) = eight(frame)?;
        if id != feedback_id || first & 0xF != node_id & 0xF {
            return None;
        }
        if first == node_id && a == 0 && (b == READ || b == WRITE) {
            return Some(Self::Register { number: c, written: b == WRITE, value: [d, e, f, g] });
        }
        Some(Self::Feedback(Feedback {
            status: first >> 4,
            state: [a, b, c, d, e],
            stage_celsius: f,
            winding_celsius: g,
        }))
    }
}
