//! `MyActuator` RMD motors (X series, protocol V4), motion mode or position mode.
use super::identifiers::Use;
use super::motors::{self, MitGains, UsableRange, WireRanges};
use super::{Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::{Exchange, Flow, periodic};
use crate::bus_load::frame::{Format, Frame};
use crate::document::shown;
use crate::reader::{FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::stall::AfterStall;
use serde_json::Value;

/// Characters that a motor has for its model.
pub const MODEL_BYTES: usize = 7;

/// How an RMD motor is scaled and held. Its angles are those of its output shaft, behind its own gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MyActuator {
    /// Its model as it states it (command 0xB5), padded with zeros.
    pub model: [u8; MODEL_BYTES],
    /// How it is commanded.
    pub mode: MyActuatorMode,
    /// Without a command for this long it cuts its output (command 0xB3).
    pub watchdog_ms: u32,
}

/// A motor's mode of control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MyActuatorMode {
    /// Position, velocity and torque with gains in every command (0x400), and what the wire spans.
    Motion(MitGains, WireRanges),
    /// Position and largest speed (0xA4); the motor's own loops follow.
    Position,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "myactuator",
    words: "MyActuator RMD motors, motion or position mode",
    keys: &[
        "model",
        "mode",
        "position_range_rad",
        "velocity_range_rad_s",
        "torque_range_nm",
        "watchdog_ms",
        "stiffness_nm_rad",
        "damping_nm_s_rad",
        "gain_ramp_ms",
    ],
    node_id: [1, 32],
    read: |table| read(table).map(Protocol::from),
};

/// What 12 bits of a command span of kp and kd.
const GAINS_MAX: [f64; 2] = [500.0, 5.0];
/// Every request and every reply.
const FRAME_BYTES: u32 = 8;
/// How often a motor that follows is asked for its errors, which its replies in motion mode do not state.
pub const STATUS_EVERY_COMMANDS: u32 = 20;
/// An angle in 0.01 degrees that fits 32 bits, rad.
const ANGLE_MAX_RAD: f64 = 2_147_483_647.0 * 0.01 * std::f64::consts::PI / 180.0;
/// Speed limits are whole degrees a second in 16 bits, rad/s.
const SPEED_MAX_RAD_S: f64 = 65_535.0 * std::f64::consts::PI / 180.0;
const USABLE: UsableRange = UsableRange { share: 1.0, wider: "another motor: the range is the firmware's" };
/// Source: "Servo Motor Control Protocol V4.2", sections 2, 3 and 5.
const OWN: [(u16, &str); 4] = [
    (0x140, "commands"),
    (0x240, "replies"),
    (0x400, "motion mode commands"),
    (0x500, "motion mode replies"),
];

fn read(table: &mut Table<'_>) -> Option<MyActuator> {
    let model = read_model(table);
    let mode = read_mode(table);
    let watchdog_ms = motors::read_watchdog(table);
    Some(MyActuator { model: model?, mode: mode?, watchdog_ms: watchdog_ms? })
}

fn read_model(table: &mut Table<'_>) -> Option<[u8; MODEL_BYTES]> {
    let expected = "the motor's model as it states it, 1 to 7 characters such as \"X8S2V10\" (the refusal of another one shows it)";
    let text = table.text("model", expected)?;
    let mut model = [0; MODEL_BYTES];
    let fits =
        !text.is_empty() && text.len() <= MODEL_BYTES && text.bytes().all(|byte| byte.is_ascii_graphic());
    if !fits {
        table.fault("model", &shown(&text), expected);
        return None;
    }
    model.iter_mut().zip(text.bytes()).for_each(|(slot, byte)| *slot = byte);
    Some(model)
}

/// Gains and ranges belong to motion mode alone: beside `position` they are unknown keys.
fn read_mode(table: &mut Table<'_>) -> Option<MyActuatorMode> {
    let expected = "\"motion\" (gains in every command) or \"position\" (the motor's own loops)";
    let name = table.text("mode", expected)?;
    match name.as_str() {
        "motion" => {
            let gains = MitGains::read(table, GAINS_MAX);
            let ranges = WireRanges::read(table);
            Some(MyActuatorMode::Motion(gains?, ranges?))
        }
        "position" => Some(MyActuatorMode::Position),
        other => {
            table.fault("mode", &shown(other), expected);
            None
        }
    }
}

impl MyActuator {
    fn model_text(&self) -> String {
        self.model.iter().filter(|byte| **byte != 0).map(|byte| char::from(*byte)).collect()
    }
}

impl ServoProtocol for MyActuator {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    /// In motion mode the velocity stands in every command, so the motor continues meanwhile.
    fn after_stall(&self) -> AfterStall {
        match self.mode {
            MyActuatorMode::Motion(..) => AfterStall::GoOn,
            MyActuatorMode::Position => AfterStall::Freeze,
        }
    }

    fn carries_torque(&self) -> bool {
        matches!(self.mode, MyActuatorMode::Motion(..))
    }

    fn measures_torque(&self) -> bool {
        matches!(self.mode, MyActuatorMode::Motion(..))
    }

    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let shared = [(0x280, "commands to all motors"), (0x300, "numbering")]
            .map(|(id, what)| Use::standard(id, what, "node_id").shared());
        let own = OWN.map(|(base, what)| Use::standard(base + u16::from(node_id), what, "node_id"));
        shared.into_iter().chain(own).collect()
    }

    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, [sign, zero_rad]: [f64; 2]) {
        match self.mode {
            MyActuatorMode::Motion(_, ranges) => ranges.check_joint(table, joint, [sign, zero_rad], &USABLE),
            MyActuatorMode::Position => {
                let far_rad = joint.limits.position_rad.map(|rad| ((rad - zero_rad) * sign).abs());
                let speed_rad_s = joint.limits.stop.velocity_rad_s;
                if far_rad.iter().any(|rad| *rad > ANGLE_MAX_RAD) || speed_rad_s > SPEED_MAX_RAD_S {
                    let expected = format!(
                        "angles of at most {ANGLE_MAX_RAD:.0} rad and speeds of at most {SPEED_MAX_RAD_S:.0} rad/s: joint {} has more",
                        joint.name
                    );
                    table.fault("mode", "\"position\"", &expected);
                }
            }
        }
    }

    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        motors::check_watchdog(fault_list, at, self.watchdog_ms, settings);
        if let MyActuatorMode::Motion(gains, _) = self.mode {
            gains.check_ramp(fault_list, at, settings);
        }
        motors::check_every_cycle(fault_list, at, servo, settings);
    }

    fn flows(&self, servos: &[Protocol], _: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        let in_position = |protocol: &&Protocol| {
            protocol.get::<Self>().is_some_and(|settings| settings.mode == MyActuatorMode::Position)
        };
        let count = |servos: usize| u32::try_from(servos).unwrap_or(u32::MAX);
        let frame = Frame::standard(format, FRAME_BYTES);
        let position = servos.iter().filter(in_position).count();
        // A command in position mode goes with a question for the angle: two requests and two replies.
        let exchanges = count(servos.len() + position);
        let mut flows = Exchange { servos: exchanges, cycle_hz, command: frame, answer: Some(frame) }.flows();
        let status_hz = cycle_hz / f64::from(STATUS_EVERY_COMMANDS);
        flows.push(periodic("requests and replies of errors", frame, 2 * count(servos.len()), status_hz));
        flows
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        let mode = match self.mode {
            MyActuatorMode::Motion(gains, ranges) => {
                [vec![("mode", "motion".into())], gains.entries(), ranges.entries()].concat()
            }
            MyActuatorMode::Position => vec![("mode", "position".into())],
        };
        [vec![("model", self.model_text().into()), ("watchdog_ms", self.watchdog_ms.into())], mode].concat()
    }

    fn sentence(&self) -> String {
        let mode = match self.mode {
            MyActuatorMode::Motion(gains, ranges) => {
                format!("motion, {}, {}", gains.sentence(), ranges.sentence())
            }
            MyActuatorMode::Position => "position".to_owned(),
        };
        format!("model {}, {mode}, limp after {} ms", self.model_text(), self.watchdog_ms)
    }
}
