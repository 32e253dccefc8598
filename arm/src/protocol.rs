//! What a servo speaks, with the numbers that only its protocol needs, and whether they can hold the joint.
//!
//! A number of one protocol means nothing to another, so the keys of a protocol are unknown keys beside the name of
//! another. Everything here moves the arm or says how it falls: no key has a default.
use crate::document::shown;
use crate::drive_scale::{self, Overruled};
use crate::reader::{Bounds, Table};
use crate::robot::{Robot, RobotJoint};
use crate::text::counted;
use crate::trust::Reaction;
use std::f64::consts::TAU;

/// Which protocol a servo speaks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Protocol {
    /// CANopen CiA 402, cyclic synchronous position.
    Cia402(Cia402),
    /// Damiao motors (DM-J4310 and its family).
    Damiao(Damiao),
}

/// How a CiA 402 drive counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cia402 {
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Encoder counts a motor revolution.
    pub counts_per_rev: f64,
    /// The drive's home offset (0x607C) with which the joint's zero was determined, counts.
    pub home_offset_counts: i32,
    /// Objects of the drive that are not compared with these settings.
    pub overruled: Overruled,
}

/// How a Damiao motor is addressed, scaled and held. Its angles are those of its output shaft, behind its own gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Damiao {
    /// Identifier of the frames that it sends (register 7, `MST_ID`).
    pub feedback_id: u16,
    /// How it is commanded (register 10, `CTRL_MODE`).
    pub mode: DamiaoMode,
    /// Positions on the wire span minus to plus this (register 21, `PMAX`).
    pub position_range_rad: f64,
    /// Velocities on the wire span minus to plus this (register 22, `VMAX`).
    pub velocity_range_rad_s: f64,
    /// Torques on the wire span minus to plus this (register 23, `TMAX`).
    pub torque_range_nm: f64,
    /// Without a command for this long it disables itself: limp (register 9, `TIMEOUT`).
    pub watchdog_ms: u32,
}

/// A Damiao motor's mode of control.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DamiaoMode {
    /// Position, velocity and torque with gains in every command: `tau = kp (p - q) + kd (v - w) + t`.
    Mit {
        /// kp.
        stiffness_nm_rad: f64,
        /// kd.
        damping_nm_s_rad: f64,
        /// Time in which both gains rise from 0 when the motor is energised.
        gain_ramp_ms: u32,
    },
    /// Position and largest speed; the motor's own loops follow.
    PosVel,
}

impl Protocol {
    /// The name in settings files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Cia402(_) => "cia402",
            Self::Damiao(_) => "damiao",
        }
    }
    /// Motor revolutions a link revolution. A Damiao motor states the angle of its output shaft.
    #[must_use]
    pub const fn gear_ratio(&self) -> f64 {
        match self {
            Self::Cia402(cia402) => cia402.gear_ratio,
            Self::Damiao(_) => 1.0,
        }
    }
    /// What its servos can do when commands stop coming.
    #[must_use]
    pub const fn reactions(&self) -> &'static [Reaction] {
        match self {
            Self::Cia402(_) => &Reaction::ALL,
            Self::Damiao(_) => &[Reaction::Limp],
        }
    }
    /// How it counts, if it is a CiA 402 drive.
    #[must_use]
    pub const fn as_cia402(&self) -> Option<&Cia402> {
        match self {
            Self::Cia402(cia402) => Some(cia402),
            Self::Damiao(_) => None,
        }
    }
    /// How it is addressed and held, if it is a Damiao motor.
    #[must_use]
    pub const fn as_damiao(&self) -> Option<&Damiao> {
        match self {
            Self::Damiao(damiao) => Some(damiao),
            Self::Cia402(_) => None,
        }
    }
}

const EXPECTED: &str = "\"cia402\" (CANopen CiA 402, cyclic synchronous position) or \"damiao\" (Damiao motors, MIT or POS_VEL mode)";

/// Protocols that are planned for.
const LATER: [&str; 5] = ["piper", "robstride", "myactuator", "cubemars", "odrive"];

const CIA402_KEYS: [&str; 4] = ["gear_ratio", "counts_per_rev", "home_offset_counts", "overruled_objects"];
const DAMIAO_KEYS: [&str; 9] = [
    "feedback_id",
    "mode",
    "position_range_rad",
    "velocity_range_rad_s",
    "torque_range_nm",
    "watchdog_ms",
    "stiffness_nm_rad",
    "damping_nm_s_rad",
    "gain_ramp_ms",
];

/// CANopen node ids; 127 is refused later, because it is this master.
const CIA402_NODE_ID: [i64; 2] = [1, 127];
/// Feedback tells only four bits of the id.
const DAMIAO_ID: [i64; 2] = [1, 15];
/// 0x7FF is where registers are requested; 0 would win over everything else on the bus.
const FEEDBACK_ID: [i64; 2] = [1, 0x7FE];
const GEAR_RATIO: Bounds = Bounds::above(0.0, 1e5, "motor revolutions a link revolution");
const COUNTS_PER_REV: Bounds = Bounds::within(1.0, 4_294_967_296.0, "counts a motor revolution");
const RANGE_RAD: Bounds = Bounds::above(0.0, 1000.0, "rad");
const RANGE_RAD_S: Bounds = Bounds::above(0.0, 1000.0, "rad/s");
const RANGE_NM: Bounds = Bounds::above(0.0, 10_000.0, "Nm");
/// What 12 bits of a command span in every MIT protocol.
const STIFFNESS: Bounds = Bounds::above(0.0, 500.0, "Nm/rad");
/// Never 0: stiffness without damping oscillates.
const DAMPING: Bounds = Bounds::above(0.0, 5.0, "Nm s/rad");
const HOME_OFFSET_COUNTS: [i64; 2] = [i32::MIN as i64, i32::MAX as i64];
const WATCHDOG_MS: [i64; 2] = [1, 10_000];
const GAIN_RAMP_MS: [i64; 2] = [1, 10_000];

/// What is known by name and not spoken yet: not a slip of the pen, so it is not called unknown.
fn later_words(name: &str, robot: Option<&Robot>) -> String {
    let sound = robot.map_or_else(String::new, |robot| {
        let (joints, shapes) = (robot.joints.len(), robot.shapes.len());
        format!(
            "; the robot itself is valid ({}: {}, {}), so `plan --robot` can use it",
            robot.name,
            counted(joints, "joint"),
            counted(shapes, "collision shape")
        )
    });
    format!("{name} is known and comes in a later version{sound}")
}

/// Reads node id and protocol of a servo; the robot only lends words to a refusal.
pub(crate) fn read(table: &mut Table<'_>, robot: Option<&Robot>) -> (Option<u8>, Option<Protocol>) {
    let name = table.text("protocol", EXPECTED);
    match name.as_deref() {
        Some("cia402") => (read_id(table, CIA402_NODE_ID), read_cia402(table).map(Protocol::Cia402)),
        Some("damiao") => (read_id(table, DAMIAO_ID), read_damiao(table).map(Protocol::Damiao)),
        other => {
            if let Some(other) = other {
                let later = LATER.contains(&other);
                let words = if later {
                    format!("{EXPECTED}; {}", later_words(other, robot))
                } else {
                    EXPECTED.to_owned()
                };
                table.fault("protocol", &shown(other), &words);
            }
            // Their protocol is unknown, so none of them is called unknown.
            for key in CIA402_KEYS.into_iter().chain(DAMIAO_KEYS) {
                table.take(key);
            }
            (read_id(table, CIA402_NODE_ID), None)
        }
    }
}

fn read_id(table: &mut Table<'_>, [low, high]: [i64; 2]) -> Option<u8> {
    u8::try_from(table.integer("node_id", low, high)?).ok()
}

fn read_cia402(table: &mut Table<'_>) -> Option<Cia402> {
    let gear_ratio = table.number("gear_ratio", &GEAR_RATIO);
    let counts_per_rev = table.number("counts_per_rev", &COUNTS_PER_REV);
    let [low, high] = HOME_OFFSET_COUNTS;
    let home_offset = table.integer_or("home_offset_counts", 0, low, high);
    let overruled = drive_scale::read_overruled(table);
    Some(Cia402 {
        gear_ratio: gear_ratio?,
        counts_per_rev: counts_per_rev?,
        home_offset_counts: i32::try_from(home_offset?).ok()?,
        overruled: overruled?,
    })
}

fn read_damiao(table: &mut Table<'_>) -> Option<Damiao> {
    let feedback_id = table.integer("feedback_id", FEEDBACK_ID[0], FEEDBACK_ID[1]);
    let mode = read_damiao_mode(table);
    let position_range_rad = table.number("position_range_rad", &RANGE_RAD);
    let velocity_range_rad_s = table.number("velocity_range_rad_s", &RANGE_RAD_S);
    let torque_range_nm = table.number("torque_range_nm", &RANGE_NM);
    let watchdog_ms = table.integer("watchdog_ms", WATCHDOG_MS[0], WATCHDOG_MS[1]);
    Some(Damiao {
        feedback_id: u16::try_from(feedback_id?).ok()?,
        mode: mode?,
        position_range_rad: position_range_rad?,
        velocity_range_rad_s: velocity_range_rad_s?,
        torque_range_nm: torque_range_nm?,
        watchdog_ms: u32::try_from(watchdog_ms?).ok()?,
    })
}

/// Gains belong to MIT commands alone: beside `pos_vel` they are unknown keys.
fn read_damiao_mode(table: &mut Table<'_>) -> Option<DamiaoMode> {
    let expected = "\"mit\" (gains in every command) or \"pos_vel\" (the motor's own loops)";
    let name = table.text("mode", expected)?;
    match name.as_str() {
        "mit" => {
            let stiffness_nm_rad = table.number("stiffness_nm_rad", &STIFFNESS);
            let damping_nm_s_rad = table.number("damping_nm_s_rad", &DAMPING);
            let gain_ramp_ms = table.integer("gain_ramp_ms", GAIN_RAMP_MS[0], GAIN_RAMP_MS[1]);
            Some(DamiaoMode::Mit {
                stiffness_nm_rad: stiffness_nm_rad?,
                damping_nm_s_rad: damping_nm_s_rad?,
                gain_ramp_ms: u32::try_from(gain_ramp_ms?).ok()?,
            })
        }
        "pos_vel" => Some(DamiaoMode::PosVel),
        other => {
            table.fault("mode", &shown(other), expected);
            None
        }
    }
}

/// Every angle and speed that the joint may be commanded must be one that the servo can represent.
pub(crate) fn check_joint(
    table: &Table<'_>,
    protocol: &Protocol,
    joint: &RobotJoint,
    [sign, zero_offset_rad]: [f64; 2],
) {
    match protocol {
        Protocol::Cia402(cia402) => check_counts(table, cia402, joint, [sign, zero_offset_rad]),
        Protocol::Damiao(damiao) => check_ranges(table, damiao, joint, [sign, zero_offset_rad]),
    }
}

/// Both ends of the joint's range as a CiA 402 target position (0x607A), which is an i32.
fn check_counts(table: &Table<'_>, cia402: &Cia402, joint: &RobotJoint, [sign, zero_rad]: [f64; 2]) {
    let counts_per_rad = sign * cia402.gear_ratio * cia402.counts_per_rev / TAU;
    for position_rad in joint.limits.position_rad {
        // The same arithmetic as the codec's; rounding moves it by half a count at most.
        let counts = (position_rad - zero_rad) * counts_per_rad;
        if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&counts.round()) {
            let value = format!("{:?}", cia402.counts_per_rev);
            let expected = format!(
                "counts that fit 32 bits: joint {} at {position_rad} rad would be {counts:.0} counts",
                joint.name
            );
            table.fault("counts_per_rev", &value, &expected);
            return;
        }
    }
}

/// Share of a range that joints may use: in the rest, feedback of a motor cannot be distinguished from the value of a register.
const USED_RANGE: f64 = 127.0 / 128.0;

/// Both ends of the joint's range, and its speed, inside what the wire spans: outside they would be cut off silently.
fn check_ranges(table: &Table<'_>, damiao: &Damiao, joint: &RobotJoint, [sign, zero_rad]: [f64; 2]) {
    let range_rad = damiao.position_range_rad;
    let used_rad = USED_RANGE * range_rad;
    for position_rad in joint.limits.position_rad {
        let motor_rad = (position_rad - zero_rad) * sign;
        if motor_rad.abs() > used_rad {
            let expected = format!(
                "at least {:.4} rad: joint {} at {position_rad} rad is {motor_rad:.4} rad of its motor, {:.4} rad \
                 outside what can be used of the range; choose another zero_offset_rad, narrower limits of the joint, \
                 or a wider PMAX in the motor",
                motor_rad.abs() / USED_RANGE,
                joint.name,
                motor_rad.abs() - used_rad
            );
            table.fault("position_range_rad", &format!("{range_rad:?}"), &expected);
            break;
        }
    }
    let (range_rad_s, speed_rad_s) = (damiao.velocity_range_rad_s, joint.limits.stop.velocity_rad_s);
    if speed_rad_s > range_rad_s {
        let expected =
            format!("at least {speed_rad_s} rad/s, the limit of joint {}, or a slower joint", joint.name);
        table.fault("velocity_range_rad_s", &format!("{range_rad_s:?}"), &expected);
    }
}
