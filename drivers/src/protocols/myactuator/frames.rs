//! Frames of RMD motors: requests and replies of the commands that this software uses.
//!
//! Every value can be encoded and decoded, because the master and the simulated motors share this file. Decoders take
//! any frame and answer `None` for what is not theirs. Integers are little-endian; motion mode packs big-endian
//! ([`crate::codec::mit`]).
use crate::frame::{CanFrame, CanId};
use std::f64::consts::PI;

/// Commands to one motor, plus its number.
pub const COMMAND_ID: u16 = 0x140;
/// Its replies.
pub const REPLY_ID: u16 = 0x240;
/// Commands to all motors.
pub const ALL_ID: u16 = 0x280;
/// Commands in motion mode.
pub const MOTION_ID: u16 = 0x400;
/// Replies in motion mode.
pub const MOTION_REPLY_ID: u16 = 0x500;

/// One hundredth of a degree.
const ANGLE_STEP_RAD: f64 = 0.01 * PI / 180.0;
/// One degree a second.
const SPEED_STEP_RAD_S: f64 = PI / 180.0;

/// Errors by bit of the status, with what to do.
pub const ERRORS: [(u16, &str); 11] = [
    (0x0002, "motor stall; check for a blocked joint"),
    (0x0004, "under-voltage; check the supply"),
    (0x0008, "over-voltage; check the supply and what brakes into it"),
    (0x0010, "over-current; check for a blocked joint and a short circuit"),
    (0x0040, "power overrun; the load or the speed is too high"),
    (0x0080, "a calibration parameter could not be written"),
    (0x0100, "over-speed; check what drives the joint"),
    (0x0800, "its power stage is too hot; let it cool down"),
    (0x1000, "its winding is too hot; let it cool down"),
    (0x2000, "encoder calibration; calibrate it with the maker's tool"),
    (0x4000, "encoder data; check the encoder"),
];

/// An angle on the wire; what is beyond its 32 bits is cut off.
#[must_use]
pub fn angle_of(rad: f64) -> i32 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates; no number becomes 0")]
    let steps = (rad / ANGLE_STEP_RAD).round() as i32;
    steps
}

/// The angle of a number on the wire.
#[must_use]
pub fn rad_of(steps: i32) -> f64 {
    f64::from(steps) * ANGLE_STEP_RAD
}

/// The next whole degree a second above a speed, 1 to 65535: 0 would mean no limit.
#[must_use]
pub fn speed_limit_of(rad_s: f64) -> u16 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 65535")]
    let steps = (rad_s / SPEED_STEP_RAD_S).ceil().clamp(1.0, 65_535.0) as u16;
    steps
}

/// What a motor is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Errors, temperatures, voltage, state of the brake (0x9A).
    Status,
    /// The angle of the output shaft over many turns (0x92).
    Angle,
    /// The model (0xB5).
    Model,
    /// Output off (0x80).
    Shutdown,
    /// Release the brake: the motor may be commanded (0x77).
    Release,
    /// Engage the brake (0x78).
    Lock,
    /// Restart (0x76); it is not answered.
    Reset,
    /// Write the present angle as zero; it acts after a restart (0x64).
    SetZero,
    /// Cut the output after so many milliseconds without a command; 0 is never (0xB3).
    Watchdog(u32),
    /// Send the status every 100 ms while there is an error (0x20, function 3).
    ReportErrors(bool),
    /// Position and largest speed (0xA4).
    Position {
        /// Angle in 0.01 degrees.
        angle: i32,
        /// In degrees a second.
        speed: u16,
    },
    /// A command in motion mode, still packed.
    Motion([u8; 8]),
    /// Any other command, by its number.
    Other(u8),
}

/// The eight bytes of a classic standard data frame, with its identifier.
fn eight(frame: &CanFrame) -> Option<(u16, [u8; 8])> {
    if frame.is_fd() {
        return None;
    }
    Some((frame.id().as_standard_data()?, <[u8; 8]>::try_from(frame.data()).ok()?))
}

/// A command byte and 32 bits behind it.
const fn with_value(command: u8, second: u8, value: u32) -> [u8; 8] {
    let [a, b, c, d] = value.to_le_bytes();
    [command, second, 0, 0, a, b, c, d]
}

impl Request {
    /// The frame to motor `node_id`.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn encode(self, node_id: u8) -> CanFrame {
        let id = |base: u16| CanId::standard(base + u16::from(node_id));
        if let Self::Motion(bytes) = self {
            return CanFrame::classic(id(MOTION_ID), &bytes);
        }
        CanFrame::classic(id(COMMAND_ID), &self.bytes())
    }

    fn bytes(self) -> [u8; 8] {
        match self {
            Self::Status => with_value(0x9A, 0, 0),
            Self::Angle => with_value(0x92, 0, 0),
            Self::Model => with_value(0xB5, 0, 0),
            Self::Shutdown => with_value(0x80, 0, 0),
            Self::Release => with_value(0x77, 0, 0),
            Self::Lock => with_value(0x78, 0, 0),
            Self::Reset => with_value(0x76, 0, 0),
            Self::SetZero => with_value(0x64, 0, 0),
            Self::Watchdog(ms) => with_value(0xB3, 0, ms),
            Self::ReportErrors(on) => with_value(0x20, 3, u32::from(on)),
            Self::Position { angle, speed } => {
                let [low, high] = speed.to_le_bytes();
                let [a, b, c, d] = angle.to_le_bytes();
                [0xA4, 0, low, high, a, b, c, d]
            }
            Self::Motion(bytes) => bytes,
            Self::Other(command) => with_value(command, 0, 0),
        }
    }

    /// What a frame asks of motor `node_id`; `None` when it is not for it.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        let (id, bytes) = eight(frame)?;
        let own = u16::from(node_id);
        if id == MOTION_ID + own {
            return Some(Self::Motion(bytes));
        }
        if id != COMMAND_ID + own && id != ALL_ID {
            return None;
        }
        let [command, second, low, high, a, b, c, d] = bytes;
        let value = u32::from_le_bytes([a, b, c, d]);
        Some(match command {
            0x9A => Self::Status,
            0x92 => Self::Angle,
            0xB5 => Self::Model,
            0x80 => Self::Shutdown,
            0x77 => Self::Release,
            0x78 => Self::Lock,
            0x76 => Self::Reset,
            0x64 => Self::SetZero,
            0xB3 => Self::Watchdog(value),
            0x20 if second == 3 => Self::ReportErrors(value != 0),
            0xA4 => Self::Position {
                angle: i32::from_le_bytes([a, b, c, d]),
                speed: u16::from_le_bytes([low, high]),
            },
            other => Self::Other(other),
        })
    }
}

/// Errors, temperatures, voltage, state of the brake.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Of the winding.
    pub winding_celsius: i8,
    /// Of the power stage.
    pub stage_celsius: i8,
    /// The brake is released: the motor may be commanded.
    pub is_released: bool,
    /// Supply in 0.1 V.
    pub decivolts: u16,
    /// Bits of [`ERRORS`].
    pub errors: u16,
}

/// What a motor sends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reply {
    /// Answer to [`Request::Status`], or by itself while there is an error.
    Status(Status),
    /// Answer to [`Request::Angle`], in 0.01 degrees.
    Angle(i32),
    /// Answer to [`Request::Model`].
    Model([u8; 7]),
    /// Answer to [`Request::Watchdog`]: what was sent.
    Watchdog(u32),
    /// Answer to [`Request::Motion`]: angle, velocity and torque, still packed.
    Motion([u8; 5]),
    /// Answer to [`Request::Position`]: speed in degrees a second; its angle is in whole degrees and is not used.
    Position {
        /// Degrees a second.
        speed: i16,
        /// Whole degrees.
        degrees: i16,
    },
    /// Answer to any other command, by its number.
    Other(u8),
}

impl Reply {
    /// The frame of motor `node_id`.
    #[must_use]
    pub fn encode(self, node_id: u8) -> CanFrame {
        let own = u16::from(node_id);
        let reply = |bytes: [u8; 8]| CanFrame::classic(CanId::standard(REPLY_ID + own), &bytes);
        match self {
            Self::Status(Status { winding_celsius, stage_celsius, is_released, decivolts, errors }) => {
                let [winding, stage] = [winding_celsius, stage_celsius].map(|t| t.to_le_bytes()[0]);
                let ([v, w], [e, f]) = (decivolts.to_le_bytes(), errors.to_le_bytes());
                reply([0x9A, winding, stage, u8::from(is_released), v, w, e, f])
            }
            Self::Angle(angle) => {
                let [a, b, c, d] = angle.to_le_bytes();
                reply([0x92, 0, 0, 0, a, b, c, d])
            }
            Self::Model([a, b, c, d, e, f, g]) => reply([0xB5, a, b, c, d, e, f, g]),
            Self::Watchdog(ms) => reply(with_value(0xB3, 0, ms)),
            Self::Motion([a, b, c, d, e]) => {
                CanFrame::classic(CanId::standard(MOTION_REPLY_ID + own), &[node_id, a, b, c, d, e, 0, 0])
            }
            Self::Position { speed, degrees } => {
                let ([a, b], [c, d]) = (speed.to_le_bytes(), degrees.to_le_bytes());
                reply([0xA4, 35, 0, 0, a, b, c, d])
            }
            Self::Other(command) => reply(with_value(command, 0, 0)),
        }
    }

    /// What a frame says, when it is motor `node_id`'s.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn decode(frame: &CanFrame, node_id: u8) -> Option<Self> {
        let (id, bytes) = eight(frame)?;
        let own = u16::from(node_id);
        if id == MOTION_REPLY_ID + own {
            let [sender, a, b, c, d, e, ..] = bytes;
            return (sender == node_id).then_some(Self::Motion([a, b, c, d, e]));
        }
        if id != REPLY_ID + own {
            return None;
        }
        let [command, a, b, c, d, e, f, g] = bytes;
        Some(match command {
            0x9A => Self::Status(Status {
                winding_celsius: i8::from_le_bytes([a]),
                stage_celsius: i8::from_le_bytes([b]),
                is_released: c != 0,
                decivolts: u16::from_le_bytes([d, e]),
                errors: u16::from_le_bytes([f, g]),
            }),
            0x92 => Self::Angle(i32::from_le_bytes([d, e, f, g])),
            0xB5 => Self::Model([a, b, c, d, e, f, g]),
            0xB3 => Self::Watchdog(u32::from_le_bytes([d, e, f, g])),
            0xA4 => Self::Position { speed: i16::from_le_bytes([d, e]), degrees: i16::from_le_bytes([f, g]) },
            other => Self::Other(other),
        })
    }
}

/// The speed that a reply in position mode states.
#[must_use]
pub fn speed_rad_s(degrees_s: i16) -> f64 {
    f64::from(degrees_s) * SPEED_STEP_RAD_S
}
