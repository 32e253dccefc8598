//! Which servo of which bus moves which joint or axis.
//!
//! A wrong sign, gear or zero sends a joint the wrong way at full speed, so none of them has a default, and every
//! angle that the joint may be commanded must be a position that the servo can represent.
use crate::axis::{Axis, ReadAxis};
use crate::document::{Node, shown};
use crate::protocol;
use crate::protocol::identifiers::Use;
use crate::reader::{Bounds, Table};
use crate::robot::{Robot, RobotJoint};
use crate::settings::{Bus, BusKind, FEEDBACK_EVERY_MAX, SETPOINT_EVERY_MAX, Servo, Traffic};
use crate::{stall, trust};
use std::collections::BTreeSet;

/// Longest interface name of Linux (IFNAMSIZ without its closing zero).
const INTERFACE_BYTES_MAX: usize = 15;
/// CiA 301 lists 10 kbit/s to 1 Mbit/s.
const BITRATE_BIT_S: [i64; 2] = [10_000, 1_000_000];
/// ISO 11898-2 specifies transceivers up to 5 Mbit/s, and 8 Mbit/s with signal improvement.
const DATA_BITRATE_BIT_S_MAX: i64 = 8_000_000;
const ZERO_RAD: Bounds = Bounds::within(-100.0, 100.0, "rad");
const FEEDBACK_RAD: Bounds = Bounds::within(-1e6, 1e6, "rad");

/// Reads the buses; a faulty one keeps its place as `None`, so that the indices of the others hold.
pub(crate) fn read_buses(top: &mut Table<'_>) -> Vec<Option<Bus>> {
    let tables = top.tables("bus");
    if tables.is_empty() && !top.had("bus") {
        top.fault("bus", "missing", "at least one table [[bus]]");
    }
    // Two buses on one interface would each take its lock, and the second would be refused at start: better said here.
    let (mut names, mut interfaces) = (BTreeSet::new(), BTreeSet::new());
    let mut buses = Vec::new();
    for mut table in tables {
        let name = table.name("name");
        let interface = read_interface(&mut table);
        let kind = read_bus_kind(&mut table);
        let traffic = read_traffic(&mut table);
        if let Some(name) = &name
            && !names.insert(name.clone())
        {
            table.fault("name", &shown(name), "each bus's name once");
        }
        if let Some(interface) = &interface
            && !interfaces.insert(interface.clone())
        {
            table.fault("interface", &shown(interface), "each interface on one bus only");
        }
        table.done();
        let whole = name.zip(interface).zip(kind).zip(traffic);
        buses.push(whole.map(|(((name, interface), kind), traffic)| Bus { name, interface, kind, traffic }));
    }
    buses
}

/// The kernel's own rules for interface names, so that opening it can only fail because it is not there.
fn read_interface(table: &mut Table<'_>) -> Option<String> {
    let expected = "the name of a network interface, 1 to 15 bytes, such as \"can0\"";
    let interface = table.text("interface", expected)?;
    let plain = |b: u8| b.is_ascii_graphic() && b != b'/' && b != b':';
    let dots = interface == "." || interface == "..";
    if interface.len() <= INTERFACE_BYTES_MAX && interface.bytes().all(plain) && !dots {
        return Some(interface);
    }
    table.fault("interface", &shown(&interface), expected);
    None
}

/// `virtual = true` or a bit rate: a bus whose load cannot be known is only taken where it has none.
fn read_bus_kind(table: &mut Table<'_>) -> Option<BusKind> {
    let expected = "virtual = true (vcan) or bitrate_bit_s, one of the two";
    let is_virtual = table.flag_or("virtual", false);
    let [low, high] = BITRATE_BIT_S;
    let bitrate = table.integer_if_there("bitrate_bit_s", low, high);
    // The data phase is the faster one, or bit rate switch has no purpose.
    let slowest = bitrate.flatten().unwrap_or(low);
    let data = table.integer_if_there("data_bitrate_bit_s", slowest, DATA_BITRATE_BIT_S_MAX);
    let (is_virtual, bitrate, data) = (is_virtual?, bitrate?, data?);
    let rate = |bit_s: i64| u32::try_from(bit_s).ok();
    match (is_virtual, bitrate, data) {
        (true, None, None) => Some(BusKind::Virtual),
        (false, Some(bitrate), None) => Some(BusKind::Classic { bitrate_bit_s: rate(bitrate)? }),
        (false, Some(bitrate), Some(data)) => {
            Some(BusKind::Fd { bitrate_bit_s: rate(bitrate)?, data_bitrate_bit_s: rate(data)? })
        }
        (true, Some(_), _) => {
            table.fault("bitrate_bit_s", "given beside virtual = true", expected);
            None
        }
        (true, None, Some(_)) => {
            table.fault("data_bitrate_bit_s", "given beside virtual = true", expected);
            None
        }
        (false, None, _) => {
            table.fault("bitrate_bit_s", "missing", expected);
            None
        }
    }
}

/// How often setpoints and answers come; without the keys, every cycle.
fn read_traffic(table: &mut Table<'_>) -> Option<Traffic> {
    let setpoint_every = table.integer_or("setpoint_every", 1, 1, i64::from(SETPOINT_EVERY_MAX));
    let stagger = table.flag_or("stagger", false);
    let feedback_every = table.integer_or("feedback_every", 1, 1, i64::from(FEEDBACK_EVERY_MAX));
    let packed = table.flag_or("packed", false);
    if stagger == Some(true) && setpoint_every == Some(1) {
        let expected = "stagger together with setpoint_every of 2 or more: with setpoint_every = 1 there is nothing to stagger";
        table.fault("stagger", "true", expected);
    }
    Some(Traffic {
        setpoint_every: u32::try_from(setpoint_every?).ok()?,
        stagger: stagger?,
        feedback_every: u32::try_from(feedback_every?).ok()?,
        packed: packed?,
    })
}

/// What servos are bound to: joints, then axes.
#[derive(Clone, Copy)]
struct Bound<'a> {
    robot: Option<&'a Robot>,
    axes: &'a [ReadAxis],
}

impl Bound<'_> {
    /// Name and limits behind a slot.
    fn slot(&self, slot: usize) -> Option<&RobotJoint> {
        let robot = self.robot?;
        match slot.checked_sub(robot.joints.len()) {
            None => robot.joints.get(slot),
            Some(axis) => self.axes.get(axis)?.as_ref().map(|axis| &axis.output),
        }
    }
    /// As messages name it.
    fn name(&self, slot: usize) -> String {
        let joints = self.robot.map_or(0, |robot| robot.joints.len());
        let kind = if slot < joints { "joint" } else { "axis" };
        self.slot(slot)
            .map_or_else(|| format!("{kind} {}", slot + 1), |found| format!("{kind} {}", found.name))
    }
}

/// Reads the servos and puts them in the order of the joints, axes behind them; complete only when no fault was noted.
pub(crate) fn read_servos(
    top: &mut Table<'_>,
    (robot, axes): (Option<&Robot>, &[ReadAxis]),
    buses: &[Option<Bus>],
) -> Vec<Servo> {
    let tables = top.tables("servo");
    let bound = Bound { robot, axes };
    let mut taken_slots = BTreeSet::new();
    let mut nodes = BTreeSet::new();
    let mut uses = Vec::new();
    // Buses that carry a servo.
    let mut busy = BTreeSet::new();
    let mut servos = Vec::new();
    for mut table in tables {
        let joint = read_slot(&mut table, bound, &mut taken_slots);
        let bus = read_bus(&mut table, buses);
        let servo = read_servo(&mut table, joint, bus);
        busy.extend(bus);
        if let Some(servo) = &servo {
            if nodes.insert((servo.bus, servo.protocol.name(), servo.node_id)) {
                check_identifiers(&table, servo, bound, &mut uses);
            } else {
                let id = servo.node_id.to_string();
                table.fault("node_id", &id, "each node id once on a bus: two servos would answer");
            }
            if let Some(joint) = bound.slot(servo.joint) {
                servo.protocol.check_joint(&table, joint, [servo.sign, servo.zero_offset_rad]);
                trust::check_reaction(&table, servo, joint);
                trust::check_feedback(&table, servo, joint);
            }
        }
        table.done();
        servos.extend(servo);
    }
    report_unbound(top, bound, &taken_slots);
    // An idle bus would be locked, opened and watched for nothing, and is most often a servo with the wrong bus.
    for (i, bus) in buses.iter().enumerate().filter(|(i, _)| !busy.contains(i)) {
        if let Some(bus) = bus {
            top.fault_list().add(
                None,
                &format!("bus[{i}].name"),
                &shown(&bus.name),
                "a bus with at least one servo",
            );
        }
    }
    servos.sort_by_key(|servo| servo.joint);
    servos
}

/// Joints and axes without a servo.
fn report_unbound(top: &Table<'_>, bound: Bound<'_>, taken: &BTreeSet<usize>) {
    let Some(robot) = bound.robot else { return };
    for (i, joint) in robot.joints.iter().enumerate().filter(|(i, _)| !taken.contains(i)) {
        let expected =
            format!("one table [[servo]] with joint = {:?} (joint {} of the robot)", joint.name, i + 1);
        top.fault("servo", "missing", &expected);
    }
    let first = robot.joints.len();
    for (_, axis) in bound.axes.iter().enumerate().filter(|(i, _)| !taken.contains(&(first + i))) {
        if let Some(axis) = axis {
            top.fault("servo", "missing", &format!("one table [[servo]] with axis = {:?}", axis.name()));
        }
    }
}

/// The joint or the axis that a servo moves, as a slot.
fn read_slot(table: &mut Table<'_>, bound: Bound<'_>, taken: &mut BTreeSet<usize>) -> Option<usize> {
    if table.has("axis") && !table.has("joint") {
        table.take("joint");
        return read_axis(table, bound, taken);
    }
    let slot = read_joint(table, bound.robot, taken);
    if table.take("axis").is_some() {
        table.fault("axis", "given beside joint", "joint or axis, one of the two");
        return None;
    }
    slot
}

fn read_axis(table: &mut Table<'_>, bound: Bound<'_>, taken: &mut BTreeSet<usize>) -> Option<usize> {
    let name = table.text("axis", "the name of an [[axis]]")?;
    let named = |axis: &ReadAxis| axis.as_ref().is_some_and(|axis| axis.name() == name);
    let Some(index) = bound.axes.iter().position(named) else {
        // An axis that is itself at fault was reported where it stands.
        if bound.axes.iter().all(Option::is_some) {
            let names: Vec<&str> = bound.axes.iter().flatten().map(Axis::name).collect();
            let expected = match names.as_slice() {
                [] => "the name of an [[axis]], and there is none".to_owned(),
                names => format!("the name of an [[axis]]: {}", names.join(", ")),
            };
            table.fault("axis", &shown(&name), &expected);
        }
        return None;
    };
    let slot = bound.robot?.joints.len() + index;
    if !taken.insert(slot) {
        table.fault("axis", &shown(&name), "one servo an axis");
        return None;
    }
    Some(slot)
}

fn read_joint(table: &mut Table<'_>, robot: Option<&Robot>, bound: &mut BTreeSet<usize>) -> Option<usize> {
    let name = table.text("joint", "the name of a joint of the robot")?;
    // Without a robot there is nothing to hold the name against; its own faults say why there is none.
    let robot = robot?;
    let Some(index) = robot.joints.iter().position(|joint| joint.name == name) else {
        let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
        table.fault(
            "joint",
            &shown(&name),
            &format!("a joint of robot {}: {}", robot.name, names.join(", ")),
        );
        return None;
    };
    if !bound.insert(index) {
        table.fault("joint", &shown(&name), "one servo a joint");
        return None;
    }
    Some(index)
}

fn read_bus(table: &mut Table<'_>, buses: &[Option<Bus>]) -> Option<usize> {
    let name = table.text("bus", "the name of a [[bus]]")?;
    let index = buses.iter().position(|bus| bus.as_ref().is_some_and(|bus| bus.name == name));
    // A bus that is itself at fault was reported where it stands.
    if index.is_none() && buses.iter().all(Option::is_some) {
        let names: Vec<&str> = buses.iter().flatten().map(|bus| bus.name.as_str()).collect();
        table.fault("bus", &shown(&name), &format!("the name of a [[bus]]: {}", names.join(", ")));
    }
    index
}

/// Nothing here but `after_stall` has a default: each of these moves the arm, or says how it falls.
fn read_servo(table: &mut Table<'_>, joint: Option<usize>, bus: Option<usize>) -> Option<Servo> {
    let (node_id, protocol) = protocol::read(table);
    let sign = table.need("sign", SIGN_WORDS).and_then(|node| sign_of(table, &node));
    let zero_offset_rad = table.number("zero_offset_rad", &ZERO_RAD);
    let feedback = trust::read_feedback(table);
    let feedback_range_rad = table.interval("feedback_range_rad", &FEEDBACK_RAD);
    let reaction = trust::read_reaction(table);
    let limp_is_safe = table.flag("limp_is_safe");
    let after_stall = stall::read(table, protocol.as_ref());
    let limp_risk_acknowledged = table.flag_or("limp_risk_acknowledged", false);
    Some(Servo {
        joint: joint?,
        bus: bus?,
        node_id: node_id?,
        protocol: protocol?,
        sign: sign?,
        zero_offset_rad: zero_offset_rad?,
        feedback: feedback?,
        feedback_range_rad: feedback_range_rad?,
        reaction: reaction?,
        limp_is_safe: limp_is_safe?,
        after_stall: after_stall?,
        limp_risk_acknowledged: limp_risk_acknowledged?,
    })
}

/// An identifier in use, by joint and bus.
struct UsedIdentifier {
    bus: usize,
    joint: usize,
    by: Use,
}

/// Holds every identifier of a servo against those of the servos before it, and against its own.
fn check_identifiers(table: &Table<'_>, servo: &Servo, bound: Bound<'_>, taken: &mut Vec<UsedIdentifier>) {
    let mut clashed = false;
    for mine in servo.protocol.identifiers(servo.node_id) {
        let clash = taken.iter().find(|other| other.bus == servo.bus && other.by.clashes(&mine));
        let Some(other) = clash else {
            taken.push(UsedIdentifier { bus: servo.bus, joint: servo.joint, by: mine });
            continue;
        };
        // One message per servo: another id fixes all of them.
        if !clashed {
            clashed = true;
            let name = bound.name(other.joint);
            let value = format!("identifier {} for {}", mine.number(), mine.what);
            let expected =
                format!("an identifier of its own on the bus: {name} has it for {}", other.by.what);
            table.fault(mine.key, &value, &expected);
        }
    }
}

const SIGN_WORDS: &str = "1 or -1: the servo's direction against the link's";

fn sign_of(table: &Table<'_>, node: &Node) -> Option<f64> {
    // Compared as shown text: 1, 1.0, -1 and -1.0 are the only four ways to write it.
    match node.to_string().as_str() {
        "1" | "1.0" => Some(1.0),
        "-1" | "-1.0" => Some(-1.0),
        other => {
            table.fault("sign", other, SIGN_WORDS);
            None
        }
    }
}
