//! What motors that answer each command have in common: gains and ranges of their packed frames, and their watchdog.
use super::Protocol;
use crate::bus_load::flow::{Exchange, Flow};
use crate::bus_load::frame::Frame;
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Servo, Settings, Traffic};
use serde_json::Value;

const RANGE_RAD: Bounds = Bounds::above(0.0, 1000.0, "rad");
const RANGE_RAD_S: Bounds = Bounds::above(0.0, 1000.0, "rad/s");
const RANGE_NM: Bounds = Bounds::above(0.0, 10_000.0, "Nm");
const WATCHDOG_MS: [i64; 2] = [1, 10_000];
const GAIN_RAMP_MS: [i64; 2] = [1, 10_000];

/// Gains that stand in every command: `tau = kp (p - q) + kd (v - w) + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MitGains {
    /// kp.
    pub stiffness_nm_rad: f64,
    /// kd.
    pub damping_nm_s_rad: f64,
    /// Time in which both gains rise from 0 when the motor is energised.
    pub gain_ramp_ms: u32,
}

impl MitGains {
    /// Reads them, up to what the command can say: `most` is of kp and kd. Never 0: stiffness without damping oscillates.
    pub(crate) fn read(table: &mut Table<'_>, [stiffness, damping]: [f64; 2]) -> Option<Self> {
        let stiffness = table.number("stiffness_nm_rad", &Bounds::above(0.0, stiffness, "Nm/rad"));
        let damping = table.number("damping_nm_s_rad", &Bounds::above(0.0, damping, "Nm s/rad"));
        let gain_ramp_ms = table.integer("gain_ramp_ms", GAIN_RAMP_MS[0], GAIN_RAMP_MS[1]);
        Some(Self {
            stiffness_nm_rad: stiffness?,
            damping_nm_s_rad: damping?,
            gain_ramp_ms: u32::try_from(gain_ramp_ms?).ok()?,
        })
    }

    pub(crate) fn entries(&self) -> Vec<(&'static str, Value)> {
        vec![
            ("stiffness_nm_rad", self.stiffness_nm_rad.into()),
            ("damping_nm_s_rad", self.damping_nm_s_rad.into()),
            ("gain_ramp_ms", self.gain_ramp_ms.into()),
        ]
    }

    pub(crate) fn sentence(&self) -> String {
        let Self { stiffness_nm_rad, damping_nm_s_rad, gain_ramp_ms } = self;
        format!("mit {stiffness_nm_rad} Nm/rad, {damping_nm_s_rad} Nm s/rad, ramped in {gain_ramp_ms} ms")
    }

    /// The ramp is a part of enabling, which has its time.
    pub(crate) fn check_ramp(&self, fault_list: &FaultList, at: usize, settings: &Settings) {
        let timeout_s = settings.supervision.drive_timeout_s;
        if f64::from(self.gain_ramp_ms) * 1e-3 > 0.5 * timeout_s {
            let expected = format!(
                "at most half of supervision.drive_timeout_s = {timeout_s}: the ramp is a part of enabling"
            );
            fault_list.add(
                None,
                &format!("servo[{at}].gain_ramp_ms"),
                &self.gain_ramp_ms.to_string(),
                &expected,
            );
        }
    }
}

/// What the numbers of a packed frame span, minus to plus each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WireRanges {
    /// Positions.
    pub position_rad: f64,
    /// Velocities.
    pub velocity_rad_s: f64,
    /// Torques.
    pub torque_nm: f64,
}

impl WireRanges {
    pub(crate) fn read(table: &mut Table<'_>) -> Option<Self> {
        let position_rad = table.number("position_range_rad", &RANGE_RAD);
        let velocity_rad_s = table.number("velocity_range_rad_s", &RANGE_RAD_S);
        let torque_nm = table.number("torque_range_nm", &RANGE_NM);
        Some(Self { position_rad: position_rad?, velocity_rad_s: velocity_rad_s?, torque_nm: torque_nm? })
    }

    pub(crate) fn entries(&self) -> Vec<(&'static str, Value)> {
        vec![
            ("position_range_rad", self.position_rad.into()),
            ("velocity_range_rad_s", self.velocity_rad_s.into()),
            ("torque_range_nm", self.torque_nm.into()),
        ]
    }

    pub(crate) fn sentence(&self) -> String {
        format!("+-{} rad, +-{} rad/s, +-{} Nm", self.position_rad, self.velocity_rad_s, self.torque_nm)
    }

    /// Both ends of the joint's range, and its speed, inside what the wire spans: outside they would be cut off silently.
    pub(crate) fn check_joint(
        &self,
        table: &Table<'_>,
        joint: &RobotJoint,
        [sign, zero_rad]: [f64; 2],
        usable: &UsableRange,
    ) {
        let UsableRange { share: used, wider } = *usable;
        let range_rad = self.position_rad;
        let used_rad = used * range_rad;
        for position_rad in joint.limits.position_rad {
            let motor_rad = (position_rad - zero_rad) * sign;
            if motor_rad.abs() > used_rad {
                let expected = format!(
                    "at least {:.4} rad: joint {} at {position_rad} rad is {motor_rad:.4} rad of its motor, {:.4} rad \
                     outside what can be used of the range; choose another zero_offset_rad, narrower limits of the joint, \
                     or {wider}",
                    motor_rad.abs() / used,
                    joint.name,
                    motor_rad.abs() - used_rad
                );
                table.fault("position_range_rad", &format!("{range_rad:?}"), &expected);
                break;
            }
        }
        let (range_rad_s, speed_rad_s) = (self.velocity_rad_s, joint.limits.stop.velocity_rad_s);
        if speed_rad_s > range_rad_s {
            let expected =
                format!("at least {speed_rad_s} rad/s, the limit of joint {}, or a slower joint", joint.name);
            table.fault("velocity_range_rad_s", &format!("{range_rad_s:?}"), &expected);
        }
    }
}

/// How much of a range of positions joints may use.
pub(crate) struct UsableRange {
    /// The part of it.
    pub(crate) share: f64,
    /// Where a wider range is set: "a wider PMAX in the motor".
    pub(crate) wider: &'static str,
}

/// Reads the time without a command after which a motor disables itself.
pub(crate) fn read_watchdog(table: &mut Table<'_>) -> Option<u32> {
    u32::try_from(table.integer("watchdog_ms", WATCHDOG_MS[0], WATCHDOG_MS[1])?).ok()
}

/// The motor must wait at least as long as the streamer counts on it.
pub(crate) fn check_watchdog(fault_list: &FaultList, at: usize, watchdog_ms: u32, settings: &Settings) {
    let counted_ms = settings.cycle.drive_watchdog_ms;
    if watchdog_ms < counted_ms {
        let expected = format!(
            "at least cycle.drive_watchdog_ms = {counted_ms}: until then the streamer counts on the motor"
        );
        fault_list.add(None, &format!("servo[{at}].watchdog_ms"), &watchdog_ms.to_string(), &expected);
    }
}

/// A bus with one command and one answer a cycle.
pub(crate) fn check_every_cycle(fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
    let bus = settings.buses.get(servo.bus).filter(|bus| bus.traffic != Traffic::EVERY_CYCLE);
    let Some(bus) = bus else { return };
    let value = format!(
        "{} on bus {} with setpoint_every, stagger, feedback_every or packed",
        servo.protocol.name(),
        bus.name
    );
    let expected = "a bus with one command and one answer a cycle: the motor does not interpolate, and answers \
                    each command";
    fault_list.add(None, &format!("servo[{at}].protocol"), &value, expected);
}

/// One command and one answer of the same kind a cycle to each of `servos`.
pub(crate) fn exchange(servos: &[Protocol], cycle_hz: f64, frame: Frame) -> Vec<Flow> {
    let servos = u32::try_from(servos.len()).unwrap_or(u32::MAX);
    Exchange { servos, cycle_hz, command: frame, answer: Some(frame) }.flows()
}
