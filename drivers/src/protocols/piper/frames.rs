//! Frames of the `AgileX` Piper, both directions: one arm controller answers for six joints.
//!
//! All frames are classic, 11-bit, with 8 bytes; numbers are big-endian. Joints are numbered 1 to 6. Decoders take any
//! frame: what is too short or of another identifier is `None`.
//!
//! Source: the maker's SDK 0.6.2 (messages and parser, V2), held against it by `tests/piper_suite/golden.rs`. Nothing here
//! has been confirmed on an arm.
use crate::frame::{CanFrame, CanId};

/// Joints of the arm.
pub const JOINTS: usize = 6;

const STOP: u16 = 0x150;
const MODE: u16 = 0x151;
const TARGETS: u16 = 0x155;
const MIT: u16 = 0x15A;
const SPEED: u16 = 0x251;
const DRIVER: u16 = 0x261;
const STATUS: u16 = 0x2A1;
const ANGLES: u16 = 0x2A5;
const ROLE: u16 = 0x470;
const ENABLE: u16 = 0x471;
const LIMITS_QUERY: u16 = 0x472;
const LIMITS: u16 = 0x473;
const SET_LIMITS: u16 = 0x474;
const JOINT: u16 = 0x475;
const ACKNOWLEDGE: u16 = 0x476;
const FIRMWARE: u16 = 0x4AF;

/// All joints at once, in frames that name a joint.
pub const ALL: u8 = 7;
/// Control mode: CAN.
pub const CONTROL_CAN: u8 = 1;
/// Move mode: joints.
pub const MOVE_JOINTS: u8 = 1;
/// Follow targets at once, as the maker's SDK has it for "MIT mode" of a joint motion.
pub const FOLLOW_FAST: u8 = 0xAD;
/// Follow targets by the controller's own speed profile.
pub const FOLLOW_SMOOTH: u8 = 0;
/// Driver status: it is energised.
pub const DRIVER_ENABLED: u8 = 0x40;
/// Driver status: its faults. Bits 0 to 5 and 7.
pub const DRIVER_FAULTS: u8 = 0xBF;
/// Where a field asks for "do it".
const CONFIRM: u8 = 0xAE;
/// An acceleration that sets none.
const NO_ACCELERATION: u16 = 0x7FFF;

/// Units of an angle: 0.001 degrees.
const MILLIDEGREES_A_RAD: f64 = 180_000.0 / std::f64::consts::PI;
/// Units of an angle of a limit: 0.1 degrees.
const DECIDEGREES_A_RAD: f64 = 1_800.0 / std::f64::consts::PI;

/// An angle in 0.001 degrees; `None` for what is no number or does not fit 32 bits.
#[must_use]
pub fn millidegrees(angle_rad: f64) -> Option<i32> {
    let scaled = (angle_rad * MILLIDEGREES_A_RAD).round();
    let fits = (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&scaled);
    #[expect(clippy::cast_possible_truncation, reason = "checked")]
    let whole = scaled as i32;
    fits.then_some(whole)
}

/// An angle from 0.001 degrees.
#[must_use]
pub fn from_millidegrees(angle: i32) -> f64 {
    f64::from(angle) / MILLIDEGREES_A_RAD
}

/// A frame to the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Emergency stop.
    Stop,
    /// End of an emergency stop. The maker warns that the arm loses its torque.
    Resume,
    /// Who moves the arm and how.
    Mode {
        /// 0 standby, 1 CAN.
        control: u8,
        /// 0 to 5, 1 for joints.
        movement: u8,
        /// Speed, percent.
        speed_percent: u8,
        /// [`FOLLOW_FAST`] or [`FOLLOW_SMOOTH`].
        follow: u8,
    },
    /// Targets of a pair of joints, 0.001 degrees: pair 0 holds joints 1 and 2.
    Targets(u8, [i32; 2]),
    /// Energise a joint, or all.
    Enable(u8),
    /// De-energise a joint, or all. The arm has no brakes: it falls.
    Disable(u8),
    /// Ask a joint's limits.
    AskLimits(u8),
    /// Make the angle where a joint stands its zero.
    SetZero(u8),
    /// Clear the errors of a joint, or of all.
    ClearErrors(u8),
    /// Ask for the firmware's name.
    AskFirmware,
    /// Another command to the arm (cartesian, gripper, MIT, role, limits): never sent here, and known to be somebody's when
    /// seen.
    Other,
}

impl Command {
    /// Its frame.
    #[must_use]
    pub fn encode(self) -> CanFrame {
        let short = |id: u16, a: u8, b: u8| frame(id, [a, b, 0, 0, 0, 0, 0, 0]);
        match self {
            Self::Stop => short(STOP, 1, 0),
            Self::Resume => short(STOP, 2, 0),
            Self::Mode { control, movement, speed_percent, follow } => {
                frame(MODE, [control, movement, speed_percent, follow, 0, 0, 0, 0])
            }
            Self::Targets(pair, targets) => frame(TARGETS + u16::from(pair.min(2)), two_words(targets)),
            Self::Enable(joint) => short(ENABLE, joint, 2),
            Self::Disable(joint) => short(ENABLE, joint, 1),
            Self::AskLimits(joint) => short(LIMITS_QUERY, joint, 1),
            Self::SetZero(joint) => joint_frame(joint, CONFIRM, 0),
            Self::ClearErrors(joint) => joint_frame(joint, 0, CONFIRM),
            Self::AskFirmware => short(FIRMWARE, 1, 0),
            Self::Other => frame(MIT, [0; 8]),
        }
    }

    /// What a frame commands; `None` for a frame of the controller, an unknown one, or one without its bytes.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<Self> {
        let id = frame.id().as_standard_data()?;
        let data: [u8; 8] = frame.data().try_into().ok()?;
        let [a, b, c, d, ..] = data;
        match id {
            STOP => match a {
                1 => Some(Self::Stop),
                2 => Some(Self::Resume),
                _ => Some(Self::Other),
            },
            MODE => Some(Self::Mode { control: a, movement: b, speed_percent: c, follow: d }),
            0x155..=0x157 => {
                let pair = u8::try_from(id - TARGETS).ok()?;
                Some(Self::Targets(pair, words(data)))
            }
            ENABLE => match b {
                1 => Some(Self::Disable(a)),
                2 => Some(Self::Enable(a)),
                _ => None,
            },
            LIMITS_QUERY => (b == 1).then_some(Self::AskLimits(a)),
            JOINT => match (b, data) {
                (CONFIRM, _) => Some(Self::SetZero(a)),
                (_, [_, _, _, _, _, CONFIRM, _, _]) => Some(Self::ClearErrors(a)),
                _ => Some(Self::Other),
            },
            FIRMWARE if data == [1, 0, 0, 0, 0, 0, 0, 0] => Some(Self::AskFirmware),
            0x152..=0x154 | 0x158..=0x15F | ROLE | SET_LIMITS | 0x477 | 0x479 | 0x47A => Some(Self::Other),
            _ => None,
        }
    }

    /// Whether it is a command that moves or changes the arm: questions are not.
    #[must_use]
    pub const fn acts(self) -> bool {
        !matches!(self, Self::AskLimits(_) | Self::AskFirmware)
    }
}

/// What the controller says of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Who moves the arm: 0 nobody, 1 CAN, 2 teaching.
    pub control: u8,
    /// State of the arm, 0 when it is well.
    pub arm: u8,
    /// How it moves, 1 for joints.
    pub movement: u8,
    /// State of teaching.
    pub teaching: u8,
    /// 0 when the target is reached.
    pub motion: u8,
    /// Point of a stored trajectory.
    pub point: u8,
    /// Joints beyond their range, bit 0 is joint 1.
    pub beyond: u8,
    /// Joints that the controller does not reach, bit 0 is joint 1.
    pub unreached: u8,
}

/// What a joint's driver says slowly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Driver {
    /// Supply, 0.1 V.
    pub supply_decivolts: u16,
    /// Power stage, degrees Celsius.
    pub stage_celsius: i16,
    /// Motor, degrees Celsius.
    pub motor_celsius: i8,
    /// [`DRIVER_ENABLED`] and faults.
    pub status: u8,
    /// Supply current, 0.001 A.
    pub current_milliamperes: u16,
}

/// A joint's range and speed, as the controller holds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    /// Joint, 1 to 6.
    pub joint: u8,
    /// Largest angle, 0.1 degrees.
    pub most_decidegrees: i16,
    /// Smallest angle, 0.1 degrees.
    pub least_decidegrees: i16,
    /// Largest speed, 0.001 rad/s.
    pub speed_mrad_s: u16,
}

impl Limits {
    /// Smallest and largest angle.
    #[must_use]
    pub fn range_rad(&self) -> [f64; 2] {
        [self.least_decidegrees, self.most_decidegrees].map(|angle| f64::from(angle) / DECIDEGREES_A_RAD)
    }
    /// Largest speed.
    #[must_use]
    pub fn speed_rad_s(&self) -> f64 {
        f64::from(self.speed_mrad_s) * 1e-3
    }
}

/// A frame of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// Its state.
    Status(Status),
    /// Angles of a pair of joints, 0.001 degrees: pair 0 holds joints 1 and 2.
    Angles(u8, [i32; 2]),
    /// Speed of a joint (1 to 6), 0.001 rad/s, and current, 0.001 A. Its third number, an angle of which the unit is not
    /// documented, is left out.
    Speed(u8, i16, i16),
    /// State of a joint's driver (1 to 6).
    Driver(u8, Driver),
    /// A joint's limits.
    Limits(Limits),
    /// A setting was taken: low byte of its identifier, and whether a zero was set.
    Acknowledge(u8, bool),
    /// Eight characters of the firmware's name.
    Firmware([u8; 8]),
}

impl Message {
    /// Its frame.
    #[must_use]
    pub fn encode(self) -> CanFrame {
        match self {
            Self::Status(s) => frame(
                STATUS,
                [s.control, s.arm, s.movement, s.teaching, s.motion, s.point, s.beyond, s.unreached],
            ),
            Self::Angles(pair, angles) => frame(ANGLES + u16::from(pair.min(2)), two_words(angles)),
            Self::Speed(joint, speed, current) => {
                let ([a, b], [c, d]) = (speed.to_be_bytes(), current.to_be_bytes());
                frame(SPEED + place(joint), [a, b, c, d, 0, 0, 0, 0])
            }
            Self::Driver(joint, driver) => {
                let [a, b] = driver.supply_decivolts.to_be_bytes();
                let [c, d] = driver.stage_celsius.to_be_bytes();
                let [motor] = driver.motor_celsius.to_be_bytes();
                let [e, f] = driver.current_milliamperes.to_be_bytes();
                frame(DRIVER + place(joint), [a, b, c, d, motor, driver.status, e, f])
            }
            Self::Limits(limits) => {
                let [a, b] = limits.most_decidegrees.to_be_bytes();
                let [c, d] = limits.least_decidegrees.to_be_bytes();
                let [e, f] = limits.speed_mrad_s.to_be_bytes();
                frame(LIMITS, [limits.joint, a, b, c, d, e, f, 0])
            }
            Self::Acknowledge(of, zero_set) => frame(ACKNOWLEDGE, [of, u8::from(zero_set), 0, 0, 0, 0, 0, 0]),
            Self::Firmware(characters) => frame(FIRMWARE, characters),
        }
    }

    /// What the controller says in a frame; `None` when it is not known or has not the bytes.
    #[must_use]
    pub fn decode(frame: &CanFrame) -> Option<Self> {
        let id = frame.id().as_standard_data()?;
        let data: [u8; 8] = frame.data().try_into().ok()?;
        let [a, b, c, d, e, f, g, h] = data;
        let offset = |base: u16| u8::try_from(id - base).ok();
        match id {
            STATUS => Some(Self::Status(Status {
                control: a,
                arm: b,
                movement: c,
                teaching: d,
                motion: e,
                point: f,
                beyond: g,
                unreached: h,
            })),
            0x2A5..=0x2A7 => Some(Self::Angles(offset(ANGLES)?, words(data))),
            0x251..=0x256 => {
                let (speed, current) = (i16::from_be_bytes([a, b]), i16::from_be_bytes([c, d]));
                Some(Self::Speed(offset(SPEED)? + 1, speed, current))
            }
            0x261..=0x266 => {
                let driver = Driver {
                    supply_decivolts: u16::from_be_bytes([a, b]),
                    stage_celsius: i16::from_be_bytes([c, d]),
                    motor_celsius: i8::from_be_bytes([e]),
                    status: f,
                    current_milliamperes: u16::from_be_bytes([g, h]),
                };
                Some(Self::Driver(offset(DRIVER)? + 1, driver))
            }
            LIMITS => Some(Self::Limits(Limits {
                joint: a,
                most_decidegrees: i16::from_be_bytes([b, c]),
                least_decidegrees: i16::from_be_bytes([d, e]),
                speed_mrad_s: u16::from_be_bytes([f, g]),
            })),
            ACKNOWLEDGE => Some(Self::Acknowledge(a, b == 1)),
            FIRMWARE if data != [1, 0, 0, 0, 0, 0, 0, 0] => Some(Self::Firmware(data)),
            _ => None,
        }
    }
}

fn frame(id: u16, data: [u8; 8]) -> CanFrame {
    CanFrame::classic(CanId::standard(id), &data)
}

/// A joint (1 to 6) as the distance from its first identifier.
fn place(joint: u8) -> u16 {
    u16::from(joint.clamp(1, 6)) - 1
}

fn joint_frame(joint: u8, zero: u8, clear: u8) -> CanFrame {
    let [high, low] = NO_ACCELERATION.to_be_bytes();
    frame(JOINT, [joint, zero, 0, high, low, clear, 0, 0])
}

fn two_words([first, second]: [i32; 2]) -> [u8; 8] {
    let ([a, b, c, d], [e, f, g, h]) = (first.to_be_bytes(), second.to_be_bytes());
    [a, b, c, d, e, f, g, h]
}

const fn words([a, b, c, d, e, f, g, h]: [u8; 8]) -> [i32; 2] {
    [i32::from_be_bytes([a, b, c, d]), i32::from_be_bytes([e, f, g, h])]
}
