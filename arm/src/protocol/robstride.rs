//! `RobStride` motors (RS00 to RS06), private protocol.
use super::identifiers::Use;
use super::motors::{self, MitGains, UsableRange, WireRanges};
use super::{Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::Flow;
use crate::bus_load::frame::{Format, Frame};
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::stall::AfterStall;
use serde_json::Value;

/// How a `RobStride` motor is addressed, scaled and held. Its angles are those of its output shaft, behind its own gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobStride {
    /// Identifier of this master.
    pub host_id: u8,
    /// What the wire spans: of the model and its firmware, and in no parameter.
    pub ranges: WireRanges,
    /// What kp and kd of a command span, from 0.
    pub gains_max: [f64; 2],
    /// The gains.
    pub gains: MitGains,
    /// Largest torque that it gives (parameter 0x700B, `limit_torque`); of another model it is another.
    pub torque_limit_nm: f64,
    /// Without a frame for this long it drops its torque (parameter 0x7028, `canTimeout`).
    pub watchdog_ms: u32,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "robstride",
    words: "RobStride motors, private protocol",
    keys: &[
        "host_id",
        "position_range_rad",
        "velocity_range_rad_s",
        "torque_range_nm",
        "stiffness_range_nm_rad",
        "damping_range_nm_s_rad",
        "torque_limit_nm",
        "watchdog_ms",
        "stiffness_nm_rad",
        "damping_nm_s_rad",
        "gain_ramp_ms",
    ],
    node_id: [1, 127],
    read: |table| read(table).map(Protocol::from),
};

/// Above every motor: answers to the master never look like requests to one of them. 0xFE is who "get id" is answered to.
const HOST_ID: [i64; 2] = [0x80, 0xFD];
/// The maker's own tools use it.
const USUAL_HOST_ID: i64 = 0xFD;
const STIFFNESS_RANGE: Bounds = Bounds::above(0.0, 100_000.0, "Nm/rad");
const DAMPING_RANGE: Bounds = Bounds::above(0.0, 10_000.0, "Nm s/rad");
/// Every command and every feedback, with 29-bit identifiers.
const FRAME_BYTES: u32 = 8;
/// In the rest of a range a feedback cannot be distinguished from a version, and next to it the field repeats.
const USABLE: UsableRange =
    UsableRange { share: 127.0 / 128.0, wider: "another motor: its firmware fixes the range" };

fn read(table: &mut Table<'_>) -> Option<RobStride> {
    let host_id = table.integer_or("host_id", USUAL_HOST_ID, HOST_ID[0], HOST_ID[1]);
    let ranges = WireRanges::read(table);
    let stiffness_max = table.number("stiffness_range_nm_rad", &STIFFNESS_RANGE);
    let damping_max = table.number("damping_range_nm_s_rad", &DAMPING_RANGE);
    // A range that is no number says nothing of the gains.
    let most = [stiffness_max.unwrap_or(f64::MAX), damping_max.unwrap_or(f64::MAX)];
    let gains = MitGains::read(table, most);
    // The wire cuts torques off at its range, so a limit above it is another model's.
    let torque_most = ranges.map_or(f64::MAX, |ranges| ranges.torque_nm);
    let torque_limit_nm = table.number("torque_limit_nm", &Bounds::above(0.0, torque_most, "Nm"));
    let watchdog_ms = motors::read_watchdog(table);
    Some(RobStride {
        host_id: u8::try_from(host_id?).ok()?,
        ranges: ranges?,
        gains_max: [stiffness_max?, damping_max?],
        gains: gains?,
        torque_limit_nm: torque_limit_nm?,
        watchdog_ms: watchdog_ms?,
    })
}

impl ServoProtocol for RobStride {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    /// The velocity stands in every command, so the motor continues meanwhile.
    fn after_stall(&self) -> AfterStall {
        AfterStall::GoOn
    }

    fn carries_torque(&self) -> bool {
        true
    }

    fn measures_torque(&self) -> bool {
        true
    }

    /// Source: "RS00 User Manual" of 2026-04-28, section 4.1: the receiver is in the lowest byte, of what a motor sends the
    /// motor in the one above.
    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let feedback = 2 << 24 | u32::from(node_id) << 8 | u32::from(self.host_id);
        vec![
            Use::extended([u32::from(node_id), 0xFF], "requests of every type", "node_id"),
            Use::extended([feedback, 0x1F00_FFFF], "feedback", "node_id"),
        ]
    }

    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, sign_and_zero_rad: [f64; 2]) {
        self.ranges.check_joint(table, joint, sign_and_zero_rad, &USABLE);
    }

    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        motors::check_watchdog(fault_list, at, self.watchdog_ms, settings);
        self.gains.check_ramp(fault_list, at, settings);
        motors::check_every_cycle(fault_list, at, servo, settings);
    }

    fn flows(&self, servos: &[Protocol], _: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        let frame = Frame { format, extended: true, bytes: FRAME_BYTES };
        motors::exchange(servos, cycle_hz, frame)
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        let [stiffness_max, damping_max] = self.gains_max;
        [
            vec![("host_id", self.host_id.into())],
            self.ranges.entries(),
            vec![
                ("stiffness_range_nm_rad", stiffness_max.into()),
                ("damping_range_nm_s_rad", damping_max.into()),
                ("torque_limit_nm", self.torque_limit_nm.into()),
                ("watchdog_ms", self.watchdog_ms.into()),
            ],
            self.gains.entries(),
        ]
        .concat()
    }

    fn sentence(&self) -> String {
        let (host, gains, ranges) = (self.host_id, self.gains.sentence(), self.ranges.sentence());
        let (limit_nm, watchdog_ms) = (self.torque_limit_nm, self.watchdog_ms);
        format!("master 0x{host:02X}, {gains}, {ranges}, at most {limit_nm} Nm, limp after {watchdog_ms} ms")
    }
}
