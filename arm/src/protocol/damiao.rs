//! Damiao motors (DM-J4310 and its family).
use super::identifiers::Use;
use super::motors::{self, MitGains, UsableRange, WireRanges};
use super::{FdUse, Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::Flow;
use crate::bus_load::frame::{Format, Frame};
use crate::document::shown;
use crate::reader::{FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::stall::AfterStall;
use serde_json::Value;

/// How a Damiao motor is addressed, scaled and held. Its angles are those of its output shaft, behind its own gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damiao {
    /// Identifier of the frames that it sends (register 7, `MST_ID`).
    pub feedback_id: u16,
    /// How it is commanded (register 10, `CTRL_MODE`).
    pub mode: DamiaoMode,
    /// What the wire spans (registers 21 to 23, `PMAX`, `VMAX`, `TMAX`).
    pub ranges: WireRanges,
    /// Without a command for this long it disables itself: limp (register 9, `TIMEOUT`).
    pub watchdog_ms: u32,
}

/// A Damiao motor's mode of control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DamiaoMode {
    /// Position, velocity and torque with gains in every command.
    Mit(MitGains),
    /// Position and largest speed; the motor's own loops follow.
    PosVel,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "damiao",
    words: "Damiao motors, MIT or POS_VEL mode",
    keys: &[
        "feedback_id",
        "mode",
        "position_range_rad",
        "velocity_range_rad_s",
        "torque_range_nm",
        "watchdog_ms",
        "stiffness_nm_rad",
        "damping_nm_s_rad",
        "gain_ramp_ms",
    ],
    // Feedback tells only four bits of the id.
    node_id: [1, 15],
    read: |table| read(table).map(Protocol::from),
};

/// 0x7FF is where registers are requested; 0 would win over everything else on the bus.
const FEEDBACK_ID: [i64; 2] = [1, 0x7FE];
/// What 12 bits of a command span of kp and kd.
const GAINS_MAX: [f64; 2] = [500.0, 5.0];
/// Every command and every feedback.
const FRAME_BYTES: u32 = 8;
/// In the rest, feedback of a motor cannot be distinguished from the value of a register.
const USABLE: UsableRange = UsableRange { share: 127.0 / 128.0, wider: "a wider PMAX in the motor" };
/// Identifiers that a motor receives, each plus `ESC_ID`: it answers in its present mode, but receives all of them.
///
/// Source: Damiao's manual (commands at `ESC_ID` plus 0x100 for each mode, feedback at `MST_ID`, registers at 0x7FF).
const COMMANDS: [(u16, &str); 4] = [
    (0x000, "MIT commands"),
    (0x100, "POS_VEL commands"),
    (0x200, "VEL commands"),
    (0x300, "FORCE_POS commands"),
];

fn read(table: &mut Table<'_>) -> Option<Damiao> {
    let feedback_id = table.integer("feedback_id", FEEDBACK_ID[0], FEEDBACK_ID[1]);
    let mode = read_mode(table);
    let ranges = WireRanges::read(table);
    let watchdog_ms = motors::read_watchdog(table);
    Some(Damiao {
        feedback_id: u16::try_from(feedback_id?).ok()?,
        mode: mode?,
        ranges: ranges?,
        watchdog_ms: watchdog_ms?,
    })
}

/// Gains belong to MIT commands alone: beside `pos_vel` they are unknown keys.
fn read_mode(table: &mut Table<'_>) -> Option<DamiaoMode> {
    let expected = "\"mit\" (gains in every command) or \"pos_vel\" (the motor's own loops)";
    let name = table.text("mode", expected)?;
    match name.as_str() {
        "mit" => MitGains::read(table, GAINS_MAX).map(DamiaoMode::Mit),
        "pos_vel" => Some(DamiaoMode::PosVel),
        other => {
            table.fault("mode", &shown(other), expected);
            None
        }
    }
}

impl ServoProtocol for Damiao {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    /// In MIT mode the velocity stands in every command, so the motor continues meanwhile.
    fn after_stall(&self) -> AfterStall {
        match self.mode {
            DamiaoMode::Mit(_) => AfterStall::GoOn,
            DamiaoMode::PosVel => AfterStall::Freeze,
        }
    }

    fn carries_torque(&self) -> bool {
        matches!(self.mode, DamiaoMode::Mit(_))
    }

    fn measures_torque(&self) -> bool {
        true
    }

    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let shared = Use::standard(0x7FF, "register requests", "node_id").shared();
        let own = COMMANDS.map(|(base, what)| Use::standard(base + u16::from(node_id), what, "node_id"));
        let feedback = Use::standard(self.feedback_id, "feedback", "feedback_id");
        [shared].into_iter().chain(own).chain([feedback]).collect()
    }

    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, sign_and_zero_rad: [f64; 2]) {
        self.ranges.check_joint(table, joint, sign_and_zero_rad, &USABLE);
    }

    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        motors::check_watchdog(fault_list, at, self.watchdog_ms, settings);
        if let DamiaoMode::Mit(gains) = self.mode {
            gains.check_ramp(fault_list, at, settings);
        }
        motors::check_every_cycle(fault_list, at, servo, settings);
    }

    fn flows(&self, servos: &[Protocol], _: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        motors::exchange(servos, cycle_hz, Frame::standard(format, FRAME_BYTES))
    }

    fn fd(&self) -> FdUse {
        FdUse::Spoken
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        let mode = match self.mode {
            DamiaoMode::Mit(gains) => [vec![("mode", "mit".into())], gains.entries()].concat(),
            DamiaoMode::PosVel => vec![("mode", "pos_vel".into())],
        };
        [
            vec![("feedback_id", self.feedback_id.into())],
            self.ranges.entries(),
            vec![("watchdog_ms", self.watchdog_ms.into())],
            mode,
        ]
        .concat()
    }

    fn sentence(&self) -> String {
        let mode = match self.mode {
            DamiaoMode::Mit(gains) => gains.sentence(),
            DamiaoMode::PosVel => "pos_vel".to_owned(),
        };
        format!(
            "feedback 0x{:03X}, {mode}, {}, limp after {} ms",
            self.feedback_id,
            self.ranges.sentence(),
            self.watchdog_ms
        )
    }
}
