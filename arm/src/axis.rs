//! Axes that are not joints of the path: grippers, lifts, indexing tables.
//!
//! An axis has a servo like a joint (`[[servo]]` with `axis =` in place of `joint =`) and takes a slot behind the joints. Its own
//! unit is rad or m; inside it is the angle of the servo's output, so that no driver knows an axis from a joint. Nothing that
//! moves it has a default.
use crate::document::shown;
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::{Robot, RobotJoint};
use crate::settings::{Servo, Settings};
use std::collections::BTreeSet;
pub use taustream_motion::axis::AXES_MAX;
use taustream_motion::brake::{Brake, JointState};
use taustream_motion::{JointKind, JointLimits, LimitSet, MAX_JOINTS};

/// Stop limits as multiples of the motion limits, as of joints that state none.
const STOP_RATIOS: [f64; 2] = [2.0, 4.0];

/// The unit in which an axis is commanded and reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisUnit {
    /// Radians.
    Rad,
    /// Metres.
    Metre,
}

impl AxisUnit {
    /// The word in settings, and behind numbers.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Rad => "rad",
            Self::Metre => "m",
        }
    }
    /// The unit of the force that belongs to it.
    #[must_use]
    pub const fn force_word(self) -> &'static str {
        match self {
            Self::Rad => "Nm",
            Self::Metre => "N",
        }
    }
}

/// What an axis does when the arm stops by a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnFault {
    /// It comes to rest and goes on holding what it holds.
    Hold,
    /// It comes to rest, and moves its command to where it is measured: it presses no longer.
    Relax,
}

impl OnFault {
    /// The word in settings.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Relax => "relax",
        }
    }
}

/// How an axis notices that it touches something, at the servo's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisContact {
    /// Distance of the measured angle behind the command.
    pub lag_rad: f64,
    /// Torque that is contact too, and the most that a command may ask for; `None`: by the distance alone.
    pub torque_nm: Option<f64>,
    /// Either must last this long.
    pub time_s: f64,
    /// In contact, the command is this far ahead of the measured angle at most.
    pub squeeze_rad: f64,
}

/// One axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name, and the limits of its servo's output.
    pub output: RobotJoint,
    /// The unit in which it is commanded and reported.
    pub unit: AxisUnit,
    /// Units that it travels a radian of its servo's output; 1 for [`AxisUnit::Rad`].
    pub unit_per_rad: f64,
    /// Angle of the output where it is open.
    pub open_rad: f64,
    /// Angle of the output where it is closed.
    pub closed_rad: f64,
    /// Distance of the measured angle from the command that stops the arm.
    pub tracking_error_rad_max: f64,
    /// How it notices contact; `None`: it does not.
    pub contact: Option<AxisContact>,
    /// What it does when the arm stops by a fault.
    pub on_fault: OnFault,
    /// The link of the robot whose shape covers it, open and closed: index into [`Robot::links`]. `None`: nothing does, as its
    /// owner acknowledges.
    pub covered_by: Option<usize>,
}

impl Axis {
    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.output.name
    }
    /// Angle of the output in the axis's own unit.
    #[must_use]
    pub fn in_unit(&self, rad: f64) -> f64 {
        rad * self.unit_per_rad
    }
    /// Angle of the output of a position in the axis's own unit.
    #[must_use]
    pub fn to_rad(&self, value: f64) -> f64 {
        value / self.unit_per_rad
    }
    /// A torque of the output as the force of the axis: N for an axis in m, Nm otherwise. Losses are left out.
    #[must_use]
    pub fn force_of(&self, torque_nm: f64) -> f64 {
        torque_nm / self.unit_per_rad
    }
    /// The torque of the output that gives this force. Losses are left out.
    #[must_use]
    pub fn torque_nm_of(&self, force: f64) -> f64 {
        force * self.unit_per_rad
    }
    /// Lowest and highest position in the axis's own unit.
    #[must_use]
    pub fn range(&self) -> [f64; 2] {
        self.output.limits.position_rad.map(|rad| self.in_unit(rad))
    }
}

/// The keys of one unit, with what their numbers may be.
struct Keys {
    position: &'static str,
    open: &'static str,
    closed: &'static str,
    rates: [&'static str; 3],
    tracking: &'static str,
    lag: &'static str,
    squeeze: &'static str,
    force: &'static str,
    reach: Bounds,
    rate_bounds: [Bounds; 3],
    distance: Bounds,
    force_bounds: Bounds,
}

const RAD: Keys = Keys {
    position: "position_rad",
    open: "open_rad",
    closed: "closed_rad",
    rates: ["velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"],
    tracking: "tracking_error_rad_max",
    lag: "lag_rad",
    squeeze: "squeeze_rad",
    force: "torque_nm_max",
    reach: Bounds::within(-100.0, 100.0, "rad"),
    rate_bounds: [
        Bounds::above(0.0, 100.0, "rad/s"),
        Bounds::above(0.0, 1e4, "rad/s^2"),
        Bounds::above(0.0, 1e7, "rad/s^3"),
    ],
    distance: Bounds::above(0.0, 100.0, "rad"),
    force_bounds: Bounds::above(0.0, 1e5, "Nm"),
};

const METRE: Keys = Keys {
    position: "position_m",
    open: "open_m",
    closed: "closed_m",
    rates: ["velocity_m_s", "acceleration_m_s2", "jerk_m_s3"],
    tracking: "tracking_error_m_max",
    lag: "lag_m",
    squeeze: "squeeze_m",
    force: "force_n_max",
    reach: Bounds::within(-10.0, 10.0, "m"),
    rate_bounds: [
        Bounds::above(0.0, 10.0, "m/s"),
        Bounds::above(0.0, 1e3, "m/s^2"),
        Bounds::above(0.0, 1e6, "m/s^3"),
    ],
    distance: Bounds::above(0.0, 10.0, "m"),
    force_bounds: Bounds::above(0.0, 1e6, "N"),
};

const M_PER_RAD: Bounds = Bounds::within(1e-6, 10.0, "m/rad");
const TIME_MS: [i64; 2] = [1, 1000];
const UNIT_WORDS: &str = "\"rad\" or \"m\": the unit in which the axis is commanded";
const ON_FAULT_WORDS: &str =
    "\"hold\" (it goes on holding what it holds) or \"relax\" (it presses no longer)";

/// What was read of one axis; a faulty one keeps its place, so that the slots of the others hold.
pub(crate) type ReadAxis = Option<Axis>;

/// Reads the axes.
pub(crate) fn read(top: &mut Table<'_>, robot: Option<&Robot>) -> Vec<ReadAxis> {
    let tables = top.tables("axis");
    let count = tables.len();
    let joints = robot.map_or(1, |robot| robot.joints.len());
    let most = AXES_MAX.min(MAX_JOINTS.saturating_sub(joints));
    if count > most {
        let expected =
            format!("at most {most} beside {joints} joints: one streamer drives {MAX_JOINTS} servos");
        top.fault("axis", &format!("{count} tables"), &expected);
    }
    let mut names = BTreeSet::new();
    let mut axes = Vec::with_capacity(count);
    for mut table in tables {
        let name = table.name("name");
        if let Some(name) = &name {
            let is_joint = robot.is_some_and(|robot| robot.joints.iter().any(|joint| joint.name == *name));
            if is_joint || !names.insert(name.clone()) {
                let expected = "a name that no joint of the robot and no other axis has";
                table.fault("name", &shown(name), expected);
            }
        }
        axes.push(read_axis(&mut table, name, robot));
        table.done();
    }
    axes
}

fn read_axis(table: &mut Table<'_>, name: Option<String>, robot: Option<&Robot>) -> ReadAxis {
    let (unit, keys) = read_unit(table)?;
    let unit_per_rad = match unit {
        AxisUnit::Rad => Some(1.0),
        AxisUnit::Metre => table.number("m_per_rad", &M_PER_RAD),
    };
    let position = table.interval(keys.position, &keys.reach);
    let [open, closed] = [keys.open, keys.closed].map(|key| read_end(table, keys, key, position));
    let motion = read_motion(table, keys);
    let tracking = table.number(keys.tracking, &keys.distance);
    let contact = match table.table_if_there("contact") {
        Some(contact) => read_contact(contact, keys, tracking).map(Some),
        None => (!table.had("contact")).then_some(None),
    };
    let on_fault = read_on_fault(table);
    let covered_by = read_cover(table, robot);
    let scale = unit_per_rad?;
    let [velocity, acceleration, jerk] = motion?.map(|rate| rate / scale);
    let motion = LimitSet { velocity_rad_s: velocity, acceleration_rad_s2: acceleration, jerk_rad_s3: jerk };
    let [acceleration_ratio, jerk_ratio] = STOP_RATIOS;
    let limits = JointLimits {
        position_rad: position?.map(|end| end / scale),
        motion,
        stop: LimitSet {
            velocity_rad_s: velocity,
            acceleration_rad_s2: acceleration_ratio * acceleration,
            jerk_rad_s3: jerk_ratio * jerk,
        },
    };
    let contact = contact?.map(|contact| AxisContact {
        lag_rad: contact.lag_rad / scale,
        torque_nm: contact.torque_nm.map(|force| force * scale),
        time_s: contact.time_s,
        squeeze_rad: contact.squeeze_rad / scale,
    });
    Some(Axis {
        output: RobotJoint {
            name: name?,
            kind: JointKind::Revolute,
            limits,
            stroke: limits.position_rad,
            torque_nm_max: None,
        },
        unit,
        unit_per_rad: scale,
        open_rad: open? / scale,
        closed_rad: closed? / scale,
        tracking_error_rad_max: tracking? / scale,
        contact,
        on_fault: on_fault?,
        covered_by: covered_by?,
    })
}

/// The unit; of a wrong one no further key is called unknown.
fn read_unit(table: &mut Table<'_>) -> Option<(AxisUnit, &'static Keys)> {
    let word = table.text("unit", UNIT_WORDS);
    match word.as_deref() {
        Some("rad") => return Some((AxisUnit::Rad, &RAD)),
        Some("m") => return Some((AxisUnit::Metre, &METRE)),
        Some(other) => table.fault("unit", &shown(other), UNIT_WORDS),
        None => {}
    }
    for keys in [&RAD, &METRE] {
        for key in [keys.position, keys.open, keys.closed, keys.tracking] {
            table.take(key);
        }
    }
    for key in ["m_per_rad", "motion", "contact", "on_fault", "covered_by"] {
        table.take(key);
    }
    None
}

fn read_end(
    table: &mut Table<'_>,
    keys: &Keys,
    key: &'static str,
    position: Option<[f64; 2]>,
) -> Option<f64> {
    let at = table.number(key, &keys.reach)?;
    if let Some([low, high]) = position
        && !(low..=high).contains(&at)
    {
        table.fault(
            key,
            &format!("{at:?}"),
            &format!("a position inside {} = [{low:?}, {high:?}]", keys.position),
        );
        return None;
    }
    Some(at)
}

fn read_motion(table: &mut Table<'_>, keys: &Keys) -> Option<[f64; 3]> {
    let expected = format!("a table of {}", keys.rates.join(", "));
    let mut motion = table.table("motion", &expected)?;
    let [velocity, acceleration, jerk] = keys.rates;
    let [velocity_bounds, acceleration_bounds, jerk_bounds] = keys.rate_bounds;
    let rates = [
        motion.number(velocity, &velocity_bounds),
        motion.number(acceleration, &acceleration_bounds),
        motion.number(jerk, &jerk_bounds),
    ];
    motion.done();
    let [velocity, acceleration, jerk] = rates;
    Some([velocity?, acceleration?, jerk?])
}

/// In the axis's own unit: the caller converts it.
fn read_contact(mut table: Table<'_>, keys: &Keys, tracking: Option<f64>) -> Option<AxisContact> {
    let lag = table.number(keys.lag, &keys.distance);
    let force = if table.has(keys.force) {
        table.number(keys.force, &keys.force_bounds).map(Some)
    } else {
        table.take(keys.force);
        Some(None)
    };
    let time_ms = table.integer("time_ms", TIME_MS[0], TIME_MS[1]);
    let squeeze = table.number(keys.squeeze, &keys.distance);
    // A command that is further ahead than supervision accepts would stop the arm while the axis holds its part.
    for (key, distance) in [(keys.lag, lag), (keys.squeeze, squeeze)] {
        if let (Some(distance), Some(tracking)) = (distance, tracking)
            && distance >= tracking
        {
            let expected = format!("less than {} = {tracking:?}, which stops the arm", keys.tracking);
            table.fault(key, &format!("{distance:?}"), &expected);
        }
    }
    if let (Some(lag), Some(squeeze)) = (lag, squeeze)
        && squeeze > lag
    {
        let expected = format!("at most {} = {lag:?}: no more is known to be in the way", keys.lag);
        table.fault(keys.squeeze, &format!("{squeeze:?}"), &expected);
    }
    table.done();
    #[expect(clippy::cast_precision_loss, reason = "at most a thousand")]
    let time_s = time_ms? as f64 * 1e-3;
    Some(AxisContact { lag_rad: lag?, torque_nm: force?, time_s, squeeze_rad: squeeze? })
}

fn read_on_fault(table: &mut Table<'_>) -> Option<OnFault> {
    let word = table.text_if_there("on_fault", ON_FAULT_WORDS);
    match word.as_deref() {
        None if table.had("on_fault") => None,
        None | Some("hold") => Some(OnFault::Hold),
        Some("relax") => Some(OnFault::Relax),
        Some(other) => {
            table.fault("on_fault", &shown(other), ON_FAULT_WORDS);
            None
        }
    }
}

/// The outer `None` is a fault.
fn read_cover(table: &mut Table<'_>, robot: Option<&Robot>) -> Option<Option<usize>> {
    const EXPECTED: &str =
        "the link of the robot whose shape covers the axis, open and closed; or \"nothing\"";
    let name = table.text("covered_by", EXPECTED)?;
    if name == "nothing" {
        return Some(None);
    }
    // Without a robot there is nothing to hold the name against; its own faults say why there is none.
    let robot = robot?;
    let shaped = |link: &usize| robot.shapes.iter().any(|shape| shape.link == *link);
    let found = robot.links.iter().position(|link| *link == name).filter(shaped);
    if found.is_none() {
        let links = robot.links.iter().enumerate().filter(|(link, _)| shaped(link));
        let names: Vec<&str> = links.map(|(_, name)| name.as_str()).collect();
        let expected = format!("{EXPECTED}. Links with a shape: {}", names.join(", "));
        table.fault("covered_by", &shown(&name), &expected);
    }
    found.map(Some)
}

impl Settings {
    /// How many servos are commanded: joints, then axes.
    #[must_use]
    pub fn slots(&self) -> usize {
        self.robot.joints.len() + self.axes.len()
    }
    /// Name and limits behind a slot: a joint, or the output of an axis's servo.
    #[must_use]
    pub fn slot(&self, slot: usize) -> Option<&RobotJoint> {
        let joints = self.robot.joints.len();
        match slot.checked_sub(joints) {
            None => self.robot.joints.get(slot),
            Some(axis) => self.axes.get(axis).map(|axis| &axis.output),
        }
    }
    /// Every slot, joints first.
    pub fn all_slots(&self) -> impl Iterator<Item = &RobotJoint> {
        self.robot.joints.iter().chain(self.axes.iter().map(|axis| &axis.output))
    }
    /// The axis behind a slot; none for a joint.
    #[must_use]
    pub fn axis_at(&self, slot: usize) -> Option<&Axis> {
        self.axes.get(slot.checked_sub(self.robot.joints.len())?)
    }
    /// Limits of all slots.
    #[must_use]
    pub fn slot_limits(&self) -> [JointLimits; MAX_JOINTS] {
        let mut limits = [JointLimits::default(); MAX_JOINTS];
        limits.iter_mut().zip(self.all_slots()).for_each(|(limits, slot)| *limits = slot.limits);
        limits
    }
    /// Distance of a measured angle from its command that stops the arm.
    #[must_use]
    pub fn tracking_error_rad_max(&self, slot: usize) -> f64 {
        let axis = self.axis_at(slot).map(|axis| axis.tracking_error_rad_max);
        axis.unwrap_or(self.supervision.tracking_error_rad_max)
    }
}

/// What an axis asks of its servo.
pub(crate) fn check_servos(fault_list: &FaultList, settings: &Settings) {
    let joints = settings.robot.joints.len();
    for (at, axis) in settings.axes.iter().enumerate() {
        let Some(servo) = settings.servos.iter().find(|servo| servo.joint == joints + at) else { continue };
        check_force(fault_list, at, axis, servo);
        check_tracking(fault_list, at, axis, settings);
        if settings.buses.get(servo.bus).is_some_and(|bus| bus.traffic.setpoint_every > 1) {
            let expected = "a bus with setpoint_every = 1 for a servo of an axis";
            fault_list.add(None, &format!("axis[{at}]"), &format!("axis {}", axis.name()), expected);
        }
    }
}

/// At full speed, contact is noticed late and the command runs on: what is then between it and the axis must not stop the arm.
fn check_tracking(fault_list: &FaultList, at: usize, axis: &Axis, settings: &Settings) {
    let Some(contact) = axis.contact else { return };
    let LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 } = axis.output.limits.stop;
    let start = JointState { velocity_rad_s, ..JointState::default() };
    let braking_rad = Brake::from_state(start, acceleration_rad_s2, jerk_rad_s3).rest_rad();
    // From the measured angle to the command that answers it: two cycles on the bus, one to decide.
    let seen_s = contact.time_s + 3e-6 * f64::from(settings.cycle.period_us);
    let needed_rad = contact.lag_rad + velocity_rad_s * seen_s + braking_rad;
    if axis.tracking_error_rad_max > needed_rad {
        return;
    }
    let key = if axis.unit == AxisUnit::Rad { RAD.tracking } else { METRE.tracking };
    let unit = axis.unit.word();
    let expected = format!(
        "more than {:.6} {unit}: at full speed the command is that far ahead before contact stops it; or less speed",
        axis.in_unit(needed_rad)
    );
    let value = format!("{:?}", axis.in_unit(axis.tracking_error_rad_max));
    fault_list.add(None, &format!("axis[{at}].{key}"), &value, &expected);
}

/// A force is only felt by a servo that says what it feels.
fn check_force(fault_list: &FaultList, at: usize, axis: &Axis, servo: &Servo) {
    let force = axis.contact.and_then(|contact| contact.torque_nm);
    let Some(torque_nm) = force.filter(|_| !servo.protocol.measures_torque()) else { return };
    let key = if axis.unit == AxisUnit::Rad { RAD.force } else { METRE.force };
    let expected = format!(
        "no such key: this software reads no torque of a {} servo, so contact is found by its distance behind the command alone",
        servo.protocol.name()
    );
    fault_list.add(
        None,
        &format!("axis[{at}].contact.{key}"),
        &format!("{:?}", axis.force_of(torque_nm)),
        &expected,
    );
}
