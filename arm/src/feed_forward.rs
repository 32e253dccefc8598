//! The `[feed_forward]` section of a settings file: which torque is commanded beside the position.
//!
//! It only makes sense where the masses are known and the protocol carries a torque; both are checked here. Nothing that moves
//! the arm has a default.
use crate::document::shown;
use crate::protocol::Protocol;
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::{Robot, RobotJoint};
use crate::settings::{Servo, Settings};
use taustream_motion::MAX_JOINTS;

/// Torque that is commanded beside the position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeedForward {
    /// The torque that holds the arm's masses against gravity.
    pub gravity: bool,
    /// The torque that accelerates them, Coriolis and centrifugal terms included.
    pub inertia: bool,
    /// Share of the computed torque that is commanded, friction included.
    pub share: f64,
    /// What is commanded to each joint of the robot; `None`: no torque.
    pub joints: [Option<JointTorque>; MAX_JOINTS],
}

/// Torque of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTorque {
    /// Greatest torque.
    pub torque_nm_max: f64,
    /// Fastest change of the torque.
    pub rate_nm_s_max: f64,
    /// Dry friction that is compensated in motion.
    pub coulomb_nm: f64,
    /// Viscous friction that is compensated.
    pub viscous_nm_s_rad: f64,
}

impl FeedForward {
    /// True when the masses of the arm enter.
    #[must_use]
    pub const fn uses_masses(&self) -> bool {
        self.gravity || self.inertia
    }
}

/// Greatest torque at the joint that the frames of a servo carry, where its settings state one.
fn torque_range_nm(protocol: &Protocol) -> Option<f64> {
    let entries = protocol.entries();
    entries.iter().find(|(key, _)| *key == "torque_range_nm").and_then(|(_, range)| range.as_f64())
}

const SHARE: Bounds = Bounds::above(0.0, 1.0, "");
const TORQUE_NM: Bounds = Bounds::above(0.0, 1e5, "Nm");
const RATE_NM_S: Bounds = Bounds::above(0.0, 1e6, "Nm/s");
const COULOMB_NM: Bounds = Bounds::within(0.0, 1e5, "Nm");
const VISCOUS_NM_S_RAD: Bounds = Bounds::within(0.0, 1e4, "Nm s/rad");

/// Reads the section; the outer `None` is a fault, the inner one says that there is none.
pub(crate) fn read(
    top: &mut Table<'_>,
    robot: Option<&Robot>,
    servos: &[Servo],
) -> Option<Option<FeedForward>> {
    if !top.has("feed_forward") {
        top.take("feed_forward");
        return Some(None);
    }
    let mut table = top.table("feed_forward", "a table [feed_forward]")?;
    let gravity = table.flag("gravity");
    let inertia = table.flag("inertia");
    let share = table.number("share", &SHARE);
    let mut joints = [None; MAX_JOINTS];
    let tables = table.tables("joint");
    let is_empty = tables.is_empty();
    for mut joint in tables {
        read_joint(&mut joint, robot, servos, &mut joints);
        joint.done();
    }
    if is_empty {
        let expected = "one table [[feed_forward.joint]] for each joint that gets a torque";
        table.fault("joint", "missing", expected);
    }
    table.done();
    Some(Some(FeedForward { gravity: gravity?, inertia: inertia?, share: share?, joints }))
}

fn read_joint(
    table: &mut Table<'_>,
    robot: Option<&Robot>,
    servos: &[Servo],
    joints: &mut [Option<JointTorque>; MAX_JOINTS],
) {
    let name = table.text("joint", "the name of a joint of the robot");
    let torque_nm_max = table.number("torque_nm_max", &TORQUE_NM);
    let rate_nm_s_max = table.number("rate_nm_s_max", &RATE_NM_S);
    let coulomb_nm = table.number_or("coulomb_nm", 0.0, &COULOMB_NM);
    let viscous_nm_s_rad = table.number_or("viscous_nm_s_rad", 0.0, &VISCOUS_NM_S_RAD);
    // Without a robot there is nothing to hold the name against; its own faults say why there is none.
    let (Some(name), Some(robot)) = (name, robot) else { return };
    let Some(index) = robot.joints.iter().position(|joint| joint.name == name) else {
        let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
        let expected = format!("a joint of robot {}: {}", robot.name, names.join(", "));
        return table.fault("joint", &shown(&name), &expected);
    };
    if let (Some(joint), Some(torque_nm)) = (robot.joints.get(index), torque_nm_max) {
        check_torque(table, (joint, torque_nm), servos.iter().find(|servo| servo.joint == index));
    }
    let read = torque_nm_max.zip(rate_nm_s_max).zip(coulomb_nm.zip(viscous_nm_s_rad));
    let (Some(slot), Some(((torque_nm_max, rate_nm_s_max), (coulomb_nm, viscous_nm_s_rad)))) =
        (joints.get_mut(index), read)
    else {
        return;
    };
    if coulomb_nm > torque_nm_max {
        let expected = format!("at most torque_nm_max = {torque_nm_max:?}");
        table.fault("coulomb_nm", &format!("{coulomb_nm:?}"), &expected);
    }
    if slot.replace(JointTorque { torque_nm_max, rate_nm_s_max, coulomb_nm, viscous_nm_s_rad }).is_some() {
        table.fault("joint", &shown(&name), "each joint once");
    }
}

/// The limit against what the joint's drive bears and its protocol carries.
fn check_torque(table: &Table<'_>, (joint, torque_nm): (&RobotJoint, f64), servo: Option<&Servo>) {
    let value = format!("{torque_nm:?}");
    if let Some(most_nm) = joint.torque_nm_max.filter(|most_nm| torque_nm > *most_nm) {
        let expected =
            format!("at most {most_nm:?} Nm, the greatest torque of joint {} in the robot file", joint.name);
        table.fault("torque_nm_max", &value, &expected);
    }
    let Some(servo) = servo else { return };
    if !servo.protocol.carries_torque() {
        let expected = format!(
            "a joint whose protocol carries a torque beside the position (a Damiao motor in mode \"mit\", a CiA 402 drive with offset = true in [servo.torque]); that of joint {} is {:?}",
            joint.name,
            servo.protocol.name()
        );
        table.fault("joint", &shown(&joint.name), &expected);
    }
    if let Some(range_nm) = torque_range_nm(&servo.protocol).filter(|range_nm| torque_nm > *range_nm) {
        let expected = format!(
            "at most torque_range_nm = {range_nm:?} of the joint's servo, the most that a frame carries"
        );
        table.fault("torque_nm_max", &value, &expected);
    }
}

/// The section against the robot: a torque from masses that are not known would push the arm.
pub(crate) fn check_masses(fault_list: &FaultList, settings: &Settings) {
    let Some(feed_forward) = settings.feed_forward else { return };
    let key = if feed_forward.gravity { "feed_forward.gravity" } else { "feed_forward.inertia" };
    if !feed_forward.uses_masses() {
        let has_friction = |joint: &JointTorque| joint.coulomb_nm > 0.0 || joint.viscous_nm_s_rad > 0.0;
        if !feed_forward.joints.iter().flatten().any(has_friction) {
            let expected = "true, or inertia = true, or friction of a joint: there is no torque to command";
            fault_list.add(None, "feed_forward.gravity", "false", expected);
        }
        return;
    }
    let robot = &settings.robot;
    let doubt = match robot.dynamics() {
        Err(_) => Some(format!("robot {} states no mass of anything that moves", robot.name)),
        Ok(_) => robot.mass_doubt(),
    };
    if let Some(doubt) = doubt {
        let expected = format!("false until the masses of the robot file are known ({doubt})");
        fault_list.add(None, key, "true", &expected);
    }
}
