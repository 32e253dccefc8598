//! Statusword, controlword and process data of a CiA 402 drive in cyclic synchronous position.
//!
//! Source: CiA 402-2, finite state automaton.
use crate::codec::canopen::{COB_RPDO1, COB_TPDO1, cob, node_of};
use crate::frame::CanFrame;
use std::f64::consts::TAU;
use taustream_arm::{Cia402, Servo};

/// State of the finite state automaton of a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveStep {
    /// Starting up; no command acts.
    NotReady,
    /// Power stage locked.
    SwitchOnDisabled,
    /// Power stage may be switched on.
    ReadyToSwitchOn,
    /// Power stage on, no torque.
    SwitchedOn,
    /// Torque; targets are followed.
    OperationEnabled,
    /// Stopping by quick stop, or holding after it.
    QuickStopActive,
    /// Stopping because of a fault.
    FaultReaction,
    /// Fault; torque off.
    Fault,
}

/// Statusword bit: the drive warns.
pub const STATUS_WARNING: u16 = 1 << 7;
/// Statusword bit that all energised states have: operation enabled, quick stop active, fault reaction active.
pub const STATUS_ENERGISED: u16 = 1 << 2;
/// Statusword bit: a limit of the drive acts, as its maker defines it.
pub const STATUS_LIMIT: u16 = 1 << 11;
/// Statusword bit in CSP: the drive follows the target.
pub const STATUS_FOLLOWS: u16 = 1 << 12;

/// Statusword bit in homing mode: the home position is found.
pub const STATUS_HOMED: u16 = 1 << 12;
/// Statusword bit in homing mode: homing has failed.
pub const STATUS_HOMING_ERROR: u16 = 1 << 13;
/// Statusword bit: the target is reached; in homing mode, the motor stands.
pub const STATUS_REACHED: u16 = 1 << 10;

/// Controlword: disable voltage.
pub const CONTROL_OFF: u16 = 0x0000;
/// Controlword: quick stop.
pub const CONTROL_QUICK_STOP: u16 = 0x0002;
/// Controlword: shutdown, to ready-to-switch-on.
pub const CONTROL_SHUTDOWN: u16 = 0x0006;
/// Controlword: switch on; from operation-enabled, disable operation.
pub const CONTROL_SWITCH_ON: u16 = 0x0007;
/// Controlword: enable operation.
pub const CONTROL_ENABLE: u16 = 0x000F;
/// Controlword bit in interpolated position mode: interpolate.
pub const CONTROL_INTERPOLATE: u16 = 0x0010;
/// Controlword bit in homing mode: start, and go on.
pub const CONTROL_HOME: u16 = 0x0010;
/// Controlword bit: come to rest.
pub const CONTROL_HALT: u16 = 0x0100;
/// Controlword: fault reset (rising edge).
pub const CONTROL_FAULT_RESET: u16 = 0x0080;

impl DriveStep {
    /// Its name in CiA 402.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::NotReady => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReaction => "fault reaction active",
            Self::Fault => "fault",
        }
    }
    /// The state that a statusword states; `None` for a pattern that the table does not have.
    #[must_use]
    pub fn from_status(status: u16) -> Option<Self> {
        match (status & 0x004F, status & 0x006F) {
            (0x0000, _) => Some(Self::NotReady),
            (0x0040, _) => Some(Self::SwitchOnDisabled),
            (0x0008, _) => Some(Self::Fault),
            (0x000F, _) => Some(Self::FaultReaction),
            (_, 0x0021) => Some(Self::ReadyToSwitchOn),
            (_, 0x0023) => Some(Self::SwitchedOn),
            (_, 0x0027) => Some(Self::OperationEnabled),
            (_, 0x0007) => Some(Self::QuickStopActive),
            _ => None,
        }
    }
}

/// The first RPDO: controlword and target position, in counts.
#[must_use]
pub fn encode_rpdo(node: u8, control: u16, target_counts: i32) -> CanFrame {
    CanFrame::classic(cob(COB_RPDO1, node), &six(control, target_counts))
}

/// Node, controlword and target of a first RPDO; `None` for other frames and lengths.
#[must_use]
pub fn decode_rpdo(frame: &CanFrame) -> Option<(u8, u16, i32)> {
    six_of(frame, COB_RPDO1)
}

/// The first TPDO: statusword and actual position, in counts.
#[must_use]
pub fn encode_tpdo(node: u8, status: u16, position_counts: i32) -> CanFrame {
    CanFrame::classic(cob(COB_TPDO1, node), &six(status, position_counts))
}

/// Node, statusword and position of a first TPDO; `None` for other frames and lengths.
#[must_use]
pub fn decode_tpdo(frame: &CanFrame) -> Option<(u8, u16, i32)> {
    six_of(frame, COB_TPDO1)
}

/// The first RPDO of a drive whose setpoints carry a torque: controlword, target, and torque offset in thousandths.
#[must_use]
pub fn encode_rpdo_with_torque(node: u8, control: u16, target_counts: i32, per_mille: i16) -> CanFrame {
    let [a, b, c, d, e, f] = six(control, target_counts);
    let [g, h] = per_mille.to_le_bytes();
    CanFrame::classic(cob(COB_RPDO1, node), &[a, b, c, d, e, f, g, h])
}

/// Node, statusword, position and torque in thousandths of a first TPDO that carries one; `None` for other frames and lengths.
#[must_use]
pub fn decode_tpdo_with_torque(frame: &CanFrame) -> Option<(u8, u16, i32, i16)> {
    let node = node_of(frame, COB_TPDO1)?;
    let [a, b, c, d, e, f, g, h] = *frame.data() else { return None };
    let status = u16::from_le_bytes([a, b]);
    Some((node, status, i32::from_le_bytes([c, d, e, f]), i16::from_le_bytes([g, h])))
}

fn six(word: u16, counts: i32) -> [u8; 6] {
    let [a, b] = word.to_le_bytes();
    let [c, d, e, f] = counts.to_le_bytes();
    [a, b, c, d, e, f]
}

fn six_of(frame: &CanFrame, base: u16) -> Option<(u8, u16, i32)> {
    let node = node_of(frame, base)?;
    let [a, b, c, d, e, f] = *frame.data() else { return None };
    Some((node, u16::from_le_bytes([a, b]), i32::from_le_bytes([c, d, e, f])))
}

/// How one servo counts: everything between its link angles and its encoder counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountScale {
    /// +1.0 or -1.0: motor direction against link direction.
    pub sign: f64,
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Encoder counts a motor revolution.
    pub counts_per_rev: f64,
    /// Link angle at count 0.
    pub zero_offset_rad: f64,
}

impl CountScale {
    /// Of a servo; none when it speaks another protocol and has no counts.
    #[must_use]
    pub fn of(servo: &Servo) -> Option<Self> {
        let Cia402 { gear_ratio, counts_per_rev, .. } = *servo.protocol.get::<Cia402>()?;
        Some(Self { sign: servo.sign, gear_ratio, counts_per_rev, zero_offset_rad: servo.zero_offset_rad })
    }
}

/// Encoder counts of a link angle: `round_half_away((position - zero) * sign * gear * counts_per_rev / 2 pi)`.
///
/// This is the one place where setpoints become counts; recordings are checked against it bit by bit, so the order
/// of the operations is part of the contract. Saturates at the ends of i32 (files whose range does not fit are
/// refused); not-a-number gives 0, and no caller may send that.
///
/// Real time: arithmetic only.
#[must_use]
pub fn counts_from_rad(scale: &CountScale, position_rad: f64) -> i32 {
    let turns = (position_rad - scale.zero_offset_rad) * scale.sign * scale.gear_ratio;
    let counts = (turns * scale.counts_per_rev / TAU).round();
    #[expect(clippy::cast_possible_truncation, reason = "saturation is the documented behaviour")]
    let counts = counts as i32;
    counts
}

/// The link angle of encoder counts.
///
/// Real time: arithmetic only.
#[must_use]
pub fn rad_from_counts(scale: &CountScale, counts: i32) -> f64 {
    f64::from(counts) * TAU / (scale.sign * scale.gear_ratio * scale.counts_per_rev) + scale.zero_offset_rad
}

/// Value and power of ten of object 0x60C2 for a period; `None` when it cannot be stated exactly.
#[must_use]
pub fn interpolation_period(period_us: u32) -> Option<(u8, i8)> {
    if period_us == 0 {
        return None;
    }
    let (mut value, mut exponent) = (period_us, -6_i8);
    while value % 10 == 0 {
        value /= 10;
        exponent += 1;
    }
    Some((u8::try_from(value).ok()?, exponent))
}
