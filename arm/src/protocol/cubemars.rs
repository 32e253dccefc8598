//! `CubeMars` (T-Motor) AK motors in MIT mode, 11-bit firmware.
use super::identifiers::Use;
use super::motors::{self, MitGains, UsableRange, WireRanges};
use super::{Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::Flow;
use crate::bus_load::frame::{Format, Frame};
use crate::reader::{FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::stall::AfterStall;
use serde_json::Value;

/// How a `CubeMars` motor is addressed, scaled and held. Its angles are those of its output shaft, behind its own gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubeMars {
    /// Identifier of the frames that it sends: its own in the manual, 0 in firmware that keeps to its origin.
    pub feedback_id: u16,
    /// What the wire spans: of the model and its firmware. The motor does not tell.
    pub ranges: WireRanges,
    /// The gains.
    pub gains: MitGains,
    /// Without a frame for this long it drops its command: limp. Set in the maker's tool; the motor does not tell.
    pub watchdog_ms: u32,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "cubemars",
    words: "CubeMars AK motors, MIT mode",
    keys: &[
        "feedback_id",
        "position_range_rad",
        "velocity_range_rad_s",
        "torque_range_nm",
        "watchdog_ms",
        "stiffness_nm_rad",
        "damping_nm_s_rad",
        "gain_ramp_ms",
    ],
    node_id: [1, 127],
    read: |table| read(table).map(Protocol::from),
};

const FEEDBACK_ID: [i64; 2] = [0, 0x7FF];
/// What 12 bits of a command span of kp and kd.
const GAINS_MAX: [f64; 2] = [500.0, 5.0];
/// Every command, and a feedback but that of old firmware, which is shorter.
const FRAME_BYTES: u32 = 8;
const USABLE: UsableRange = UsableRange { share: 1.0, wider: "another motor: its firmware fixes the range" };

fn read(table: &mut Table<'_>) -> Option<CubeMars> {
    let feedback_id = table.integer("feedback_id", FEEDBACK_ID[0], FEEDBACK_ID[1]);
    let ranges = WireRanges::read(table);
    let gains = MitGains::read(table, GAINS_MAX);
    let watchdog_ms = motors::read_watchdog(table);
    Some(CubeMars {
        feedback_id: u16::try_from(feedback_id?).ok()?,
        ranges: ranges?,
        gains: gains?,
        watchdog_ms: watchdog_ms?,
    })
}

impl ServoProtocol for CubeMars {
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

    /// Several motors may answer under one identifier that none of them receives: the first byte of the answer is the
    /// motor's.
    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let commands = Use::standard(u16::from(node_id), "commands", "node_id");
        if self.feedback_id == u16::from(node_id) {
            return vec![commands];
        }
        vec![commands, Use::standard(self.feedback_id, "feedback", "feedback_id").shared()]
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
        motors::exchange(servos, cycle_hz, Frame::standard(format, FRAME_BYTES))
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        [
            vec![("feedback_id", self.feedback_id.into())],
            self.ranges.entries(),
            vec![("watchdog_ms", self.watchdog_ms.into())],
            self.gains.entries(),
        ]
        .concat()
    }

    fn sentence(&self) -> String {
        format!(
            "feedback 0x{:03X}, {}, {}, limp after {} ms as set in the motor, which nothing can confirm",
            self.feedback_id,
            self.gains.sentence(),
            self.ranges.sentence(),
            self.watchdog_ms
        )
    }
}
