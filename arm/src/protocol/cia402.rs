//! CANopen CiA 402, cyclic synchronous position.
use super::identifiers::Use;
use super::{FdUse, Protocol, Registration, ServoProtocol};
use crate::brake::{self, BrakeSettings};
use crate::bus_load::flow::{Cia402Bus, Flow};
use crate::bus_load::frame::{Format, Frame};
use crate::drive_features::{self, DriveFeatures, OptionalObject, PositionMode};
use crate::drive_scale::{self, Overruled, ScaleObject};
use crate::drive_torque::{self, TorqueSettings};
use crate::homing::{self, HomingSettings};
use crate::profile_limits::ProfileLimits;
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use crate::trust::{Feedback, Reaction};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;

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
    /// What the drive lacks or does in its own time.
    pub features: DriveFeatures,
    /// How it finds its zero by itself; `None`: it is not asked to.
    pub homing: Option<HomingSettings>,
    /// The brake that its master releases; `None`: it works its brake by itself, or has none.
    pub brake: Option<BrakeSettings>,
    /// Its torques; `None`: none are sent, and none read.
    pub torque: Option<TorqueSettings>,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "cia402",
    words: "CANopen CiA 402, cyclic synchronous position",
    keys: &[
        "gear_ratio",
        "counts_per_rev",
        "home_offset_counts",
        "overruled_objects",
        "absent_objects",
        "master_supervision",
        "boot_timeout_s",
        "late_mode_display",
        "position_mode",
        "following_window_rad",
        "following_timeout_ms",
        "write_soft_limits",
        "digital_inputs",
        "profile_limits",
        "homing",
        "brake",
        "torque",
    ],
    // 127 is refused later, because it is this master.
    node_id: [1, 127],
    read: |table| read(table).map(Protocol::from),
};

const GEAR_RATIO: Bounds = Bounds::above(0.0, 1e5, "motor revolutions a link revolution");
const COUNTS_PER_REV: Bounds = Bounds::within(1.0, 4_294_967_296.0, "counts a motor revolution");
const HOME_OFFSET_COUNTS: [i64; 2] = [i32::MIN as i64, i32::MAX as i64];
/// Time between two looks at the digital inputs of a drive whose statusword does not change, ms.
pub const DIGITAL_INPUTS_MS: u16 = 200;
/// Data bytes of an SDO request and of its answer.
const SDO_BYTES: u32 = 8;
/// Control or status word and a 32-bit position.
const PDO_BYTES: u32 = 6;
/// A torque behind them.
const TORQUE_BYTES: u32 = 2;

/// Identifiers with which a CANopen node sends and receives, each plus its node id.
///
/// Source: CiA 301 (predefined connection set).
const NODE: [(u16, &str); 12] = [
    (0x080, "the emergency message"),
    (0x180, "TPDO 1"),
    (0x200, "RPDO 1"),
    (0x280, "TPDO 2"),
    (0x300, "RPDO 2"),
    (0x380, "TPDO 3"),
    (0x400, "RPDO 3"),
    (0x480, "TPDO 4"),
    (0x500, "RPDO 4"),
    (0x580, "the SDO reply"),
    (0x600, "the SDO request"),
    (0x700, "the heartbeat"),
];
/// What all CANopen nodes of a bus share.
const SHARED: [(u16, &str); 3] = [(0x000, "NMT"), (0x080, "SYNC"), (0x77F, "the master's heartbeat")];

/// Requests for the digital inputs of so many drives, and their answers.
fn digital_inputs(drives: u32, format: Format) -> Flow {
    Flow {
        what: "digital inputs, by SDO",
        frame: Frame::standard(format, SDO_BYTES),
        rate_hz: f64::from(2 * drives) * 1000.0 / f64::from(DIGITAL_INPUTS_MS),
        burst: 2 * drives,
    }
}

fn read(table: &mut Table<'_>) -> Option<Cia402> {
    let gear_ratio = table.number("gear_ratio", &GEAR_RATIO);
    let counts_per_rev = table.number("counts_per_rev", &COUNTS_PER_REV);
    let [low, high] = HOME_OFFSET_COUNTS;
    let home_offset = table.integer_or("home_offset_counts", 0, low, high);
    let overruled = drive_scale::read_overruled(table);
    let features = drive_features::read(table);
    let homing = homing::read(table);
    let brake = brake::read(table);
    let torque = drive_torque::read(table);
    Some(Cia402 {
        gear_ratio: gear_ratio?,
        counts_per_rev: counts_per_rev?,
        home_offset_counts: i32::try_from(home_offset?).ok()?,
        overruled: overruled?,
        features: features?,
        homing: homing?,
        brake: brake?,
        torque: torque?,
    })
}

impl Cia402 {
    /// A drive has one unit of velocities.
    fn check_units(&self, table: &Table<'_>) {
        let (limits, homing) = (self.features.profile_limits, self.homing);
        if let (Some(limits), Some(homing)) = (limits, homing)
            && limits.velocity_unit != homing.velocity_unit
        {
            let value = format!("{:?}", limits.velocity_unit.word());
            let expected = format!("{:?}, the unit of [servo.homing]", homing.velocity_unit.word());
            table.fault("profile_limits.velocity_unit", &value, &expected);
        }
    }
}

impl ServoProtocol for Cia402 {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    fn gear_ratio(&self) -> f64 {
        self.gear_ratio
    }

    fn reactions(&self) -> &'static [Reaction] {
        &Reaction::ALL
    }

    fn shapes_traffic(&self) -> bool {
        true
    }

    fn carries_torque(&self) -> bool {
        self.torque.is_some_and(|torque| torque.offset)
    }

    fn measures_torque(&self) -> bool {
        self.torque.is_some_and(|torque| torque.actual)
    }

    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let shared = SHARED.map(|(id, what)| Use::standard(id, what, "node_id").shared());
        let own = NODE.map(|(base, what)| Use::standard(base + u16::from(node_id), what, "node_id"));
        shared.into_iter().chain(own).collect()
    }

    /// Both ends of the joint's range as a target position (0x607A), which is an i32.
    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, [sign, zero_rad]: [f64; 2]) {
        let counts_per_rad = sign * self.gear_ratio * self.counts_per_rev / TAU;
        for position_rad in joint.limits.position_rad {
            // The same arithmetic as the codec's; rounding moves it by half a count at most.
            let counts = (position_rad - zero_rad) * counts_per_rad;
            if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&counts.round()) {
                let value = format!("{:?}", self.counts_per_rev);
                let expected = format!(
                    "counts that fit 32 bits: joint {} at {position_rad} rad would be {counts:.0} counts",
                    joint.name
                );
                table.fault("counts_per_rev", &value, &expected);
                return;
            }
        }
        self.check_units(table);
        let most_rad_s = joint.limits.motion.velocity_rad_s;
        let speeds = self
            .homing
            .filter(HomingSettings::moves)
            .map_or([0.0; 2], |homing| [homing.switch_speed_rad_s, homing.zero_speed_rad_s]);
        for (speed_rad_s, key) in speeds.into_iter().zip(["switch_speed_rad_s", "zero_speed_rad_s"]) {
            if speed_rad_s > most_rad_s {
                let expected =
                    format!("at most {most_rad_s} rad/s, the motion limit of joint {}", joint.name);
                table.fault(&format!("homing.{key}"), &format!("{speed_rad_s:?}"), &expected);
            }
        }
    }

    /// Times and traffic are those of the whole arm, which are checked for all of it.
    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        if self.homing.is_some() && servo.feedback == Feedback::Wraps {
            let expected = "feedback = \"incremental\" or \"multi-turn\": homing resolves no offset of feedback that wraps; \
                            `taustream reference` does";
            fault_list.add(None, &format!("servo[{at}].homing"), "feedback = \"wraps\"", expected);
        }
        let is_packed = settings.buses.get(servo.bus).is_some_and(|bus| bus.traffic.packed);
        let interpolates = self.features.position_mode == PositionMode::Interpolated;
        if self.carries_torque() && (is_packed || interpolates) {
            let given = if is_packed {
                "offset = true on a bus with packed = true"
            } else {
                "offset = true in interpolated position"
            };
            let expected = "a bus without `packed` and position_mode = \"cyclic\": the torque follows the position in the drive's own frame";
            fault_list.add(None, &format!("servo[{at}].torque"), given, expected);
        }
        if self.brake.is_some() && servo.reaction != Reaction::Hold {
            let given = format!("reaction = {:?}", servo.reaction.word());
            let expected = "reaction = \"hold\": a brake that the streamer releases stays released when it is lost, so the drive must hold";
            fault_list.add(None, &format!("servo[{at}].brake"), &given, expected);
        }
    }

    fn flows(&self, servos: &[Protocol], bus: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        // One with a torque counts for all: which of them it is does not matter to the fullest cycle.
        let bytes = |has: fn(&Self) -> bool| {
            let any = servos.iter().filter_map(Protocol::get::<Self>).any(has);
            if any { PDO_BYTES + TORQUE_BYTES } else { PDO_BYTES }
        };
        let cia402 = Cia402Bus {
            drives: u32::try_from(servos.len()).unwrap_or(u32::MAX),
            cycle_hz,
            traffic: bus.traffic,
            setpoint_bytes: bytes(Self::carries_torque),
            answer_bytes: bytes(Self::measures_torque),
            format,
        };
        let reads_inputs =
            |servo: &&Protocol| servo.get::<Self>().is_some_and(|it| it.features.digital_inputs);
        let readers = u32::try_from(servos.iter().filter(reads_inputs).count()).unwrap_or(u32::MAX);
        let inputs = (readers > 0).then(|| digital_inputs(readers, format));
        [cia402.process_data(), cia402.service(), inputs.into_iter().collect()].concat()
    }

    fn fd(&self) -> FdUse {
        FdUse::Planned
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        let overruled: Vec<u16> = self.overruled.objects().map(ScaleObject::index).collect();
        let absent: Vec<u16> = self.features.absent.objects().map(OptionalObject::index).collect();
        vec![
            ("gear_ratio", self.gear_ratio.into()),
            ("counts_per_rev", self.counts_per_rev.into()),
            ("home_offset_counts", self.home_offset_counts.into()),
            ("overruled_objects", overruled.into()),
            ("absent_objects", absent.into()),
            ("master_supervision", self.features.master_supervision.word().into()),
            ("boot_timeout_s", self.features.boot_timeout_s.into()),
            ("late_mode_display", self.features.late_mode_display.into()),
            ("position_mode", self.features.position_mode.word().into()),
            ("following_window_rad", self.features.limits.following_window_rad.into()),
            ("following_timeout_ms", self.features.limits.following_timeout_ms.into()),
            ("write_soft_limits", self.features.limits.soft_limits.into()),
            ("digital_inputs", self.features.digital_inputs.into()),
            ("profile_limits", self.features.profile_limits.map_or(Value::Null, ProfileLimits::entries)),
            ("homing", self.homing.map_or(Value::Null, |homing| homing.entries())),
            ("torque", self.torque.map_or(Value::Null, |torque| torque.entries())),
            ("brake", self.brake.map_or(Value::Null, |brake| brake.entries())),
        ]
    }

    fn sentence(&self) -> String {
        let mut text = format!("gear {}, {} counts/rev", self.gear_ratio, self.counts_per_rev);
        if self.home_offset_counts != 0 {
            let _ = write!(text, ", home offset {} counts", self.home_offset_counts);
        }
        for object in self.overruled.objects() {
            let _ = write!(text, ", 0x{:04X} ({}) of the drive NOT COMPARED", object.index(), object.name());
        }
        for sentence in self.features.sentences() {
            let _ = write!(text, ", {sentence}");
        }
        if let Some(homing) = &self.homing {
            let _ = write!(text, ", {}", homing.sentence());
        }
        if let Some(torque) = &self.torque {
            let _ = write!(text, ", {}", torque.sentence());
        }
        if let Some(brake) = &self.brake {
            let _ = write!(text, ", {}", brake.sentence());
        }
        text
    }
}
