//! The limits of one joint, from its table and, where there is one, from the URDF.
//!
//! The kind of the joint decides which keys are read: those in radians, or those in metres. The others are refused, so that no number
//! is taken for what it is not.
use crate::document::shown;
use crate::limit_notices;
use crate::reader::{Bounds, Table};
use crate::urdf::{JointInfo, StatedLimits};
use taustream_motion::{JointKind, JointLimits, LimitSet};

/// The keys of one kind of joint, with what their numbers may be.
struct Keys {
    kind: JointKind,
    position: &'static str,
    /// Velocity, acceleration, jerk.
    rates: [&'static str; 3],
    force: &'static str,
    position_bounds: Bounds,
    rate_bounds: [Bounds; 3],
    force_bounds: Bounds,
    /// What a range of it is within, in words.
    within: &'static str,
}

const REVOLUTE: Keys = Keys {
    kind: JointKind::Revolute,
    position: "position_rad",
    rates: JointKind::Revolute.rate_keys(),
    force: JointKind::Revolute.force_key(),
    // Sixteen turns; a larger number is a slip of the unit (degrees).
    position_bounds: Bounds::within(-100.0, 100.0, "rad"),
    rate_bounds: [
        Bounds::above(0.0, 100.0, "rad/s"),
        Bounds::above(0.0, 1e4, "rad/s^2"),
        Bounds::above(0.0, 1e7, "rad/s^3"),
    ],
    force_bounds: Bounds::above(0.0, 1e6, "Nm"),
    within: "within 100 rad",
};

const PRISMATIC: Keys = Keys {
    kind: JointKind::Prismatic,
    position: "position_m",
    rates: JointKind::Prismatic.rate_keys(),
    force: JointKind::Prismatic.force_key(),
    // A gantry of a hall; a larger number is a slip of the unit (millimetres).
    position_bounds: Bounds::within(-20.0, 20.0, "m"),
    rate_bounds: [
        Bounds::above(0.0, 20.0, "m/s"),
        Bounds::above(0.0, 1e3, "m/s^2"),
        Bounds::above(0.0, 1e6, "m/s^3"),
    ],
    force_bounds: Bounds::above(0.0, 1e6, "N"),
    within: "within 20 m",
};

impl Keys {
    /// The keys of a kind of joint.
    const fn of(kind: JointKind) -> &'static Self {
        match kind {
            JointKind::Revolute => &REVOLUTE,
            JointKind::Prismatic => &PRISMATIC,
        }
    }
    const fn other(&self) -> &'static Self {
        match self.kind {
            JointKind::Revolute => &PRISMATIC,
            JointKind::Prismatic => &REVOLUTE,
        }
    }
}

/// Stop limits where the file gives none, as multiples of the motion limits.
const STOP_ACCELERATION_RATIO: f64 = 2.0;
const STOP_JERK_RATIO: f64 = 4.0;

/// The kind of a joint of rows; revolute where nothing is said. `None` is a fault.
pub(crate) fn read_kind(table: &mut Table<'_>) -> Option<JointKind> {
    const EXPECTED: &str = "\"revolute\" (rad) or \"prismatic\" (m)";
    let all = [JointKind::Revolute, JointKind::Prismatic];
    table.choice_or("kind", EXPECTED, JointKind::Revolute, (&all, JointKind::word))
}

/// The kind that a table seems to mean, where nothing else says it: so that one fault is not followed by others.
pub(crate) fn guess_kind(table: &Table<'_>) -> JointKind {
    if table.has(PRISMATIC.position) { JointKind::Prismatic } else { JointKind::Revolute }
}

/// Refuses a key of the other kind of joint, with the one to write instead.
fn refuse_other(table: &mut Table<'_>, (other, own): (&'static str, &'static str), keys: &Keys) {
    if let Some(node) = table.has(other).then(|| table.take(other)).flatten() {
        let (kind, unit) = (keys.kind.word(), keys.kind.unit());
        table.fault(
            other,
            &node.to_string(),
            &format!("{own}: the joint is {kind}, its numbers are in {unit}"),
        );
    }
}

fn refuse_other_rates(table: &mut Table<'_>, keys: &Keys) {
    for (other, own) in keys.other().rates.into_iter().zip(keys.rates) {
        refuse_other(table, (other, own), keys);
    }
}

/// What is known of a joint's limits besides its table.
pub(crate) enum Known<'a> {
    /// Nothing: the table must say everything.
    Nothing,
    /// A URDF has it.
    Urdf(&'a JointInfo),
    /// A URDF was to have it, but could not be read, or has no such joint: one fault says so, not one a limit.
    Something,
}

/// Range, motion and stop limits of a joint of a kind (rad, or m).
pub(crate) fn read_limits(
    table: &mut Table<'_>,
    (kind, known): (JointKind, &Known<'_>),
    notices: &mut Vec<String>,
) -> Option<JointLimits> {
    let keys = Keys::of(kind);
    refuse_other(table, (keys.other().position, keys.position), keys);
    let position_rad = read_position(table, (keys, known));
    let motion = read_motion(table, (keys, known), notices);
    let stop = match table.table_if_there("stop") {
        Some(stop) => read_stop(stop, keys, motion.as_ref()),
        None => motion.map(default_stop),
    };
    limit_notices::of_range(table, (kind, position_rad), notices);
    limit_notices::of_motion(table, (kind, motion.as_ref()), notices);
    if let (Some(stop), Known::Urdf(joint_info)) = (&stop, known) {
        limit_notices::of_stop(joint_info, stop, notices);
    }
    Some(JointLimits { position_rad: position_rad?, motion: motion?, stop: stop? })
}

/// The greatest torque or force, from the table or else from the URDF; the outer `None` is a fault.
#[expect(clippy::option_option, reason = "a missing torque and a faulty one are distinguished")]
pub(crate) fn read_torque(
    table: &mut Table<'_>,
    (kind, known): (JointKind, &Known<'_>),
    notices: &mut Vec<String>,
) -> Option<Option<f64>> {
    let keys = Keys::of(kind);
    let key = keys.force;
    refuse_other(table, (keys.other().force, key), keys);
    let stated = if let Known::Urdf(joint_info) = known { joint_info.limits.effort } else { None };
    if !table.has(key) {
        table.take(key);
        return Some(stated);
    }
    let given = table.number(key, &keys.force_bounds)?;
    if let (Known::Urdf(joint_info), Some(stated)) = (known, stated.filter(|stated| given > *stated)) {
        let name = shown(&joint_info.name);
        notices.push(format!(
            "joint {name}: {key} = {given} is above the URDF's effort of {stated} {}",
            kind.force_unit()
        ));
    }
    Some(Some(given))
}

/// A URDF's range is where the mechanics end, so a file may narrow it and never widen it.
fn read_position(table: &mut Table<'_>, (keys, known): (&Keys, &Known<'_>)) -> Option<[f64; 2]> {
    let (key, bounds) = (keys.position, &keys.position_bounds);
    let stated = match known {
        Known::Nothing => return table.interval(key, bounds),
        Known::Something if !table.has(key) => {
            table.take(key);
            return None;
        }
        Known::Something => None,
        Known::Urdf(joint_info) => joint_info.position_rad,
    };
    if table.has(key) {
        let [low, high] = table.interval(key, bounds)?;
        if let Some([lowest, highest]) = stated
            && (low < lowest || high > highest)
        {
            let value = format!("[{low:?}, {high:?}]");
            table.fault(key, &value, &format!("a range inside the URDF's [{lowest:?}, {highest:?}]"));
            return None;
        }
        return Some([low, high]);
    }
    table.take(key);
    match stated {
        Some([low, high]) if low < high && bounds.hold(low) && bounds.hold(high) => Some([low, high]),
        Some([low, high]) => {
            let value = format!("[{low:?}, {high:?}] by the URDF");
            table.fault(
                key,
                &value,
                &format!("a range with the lowest below the highest, {}; give one here", keys.within),
            );
            None
        }
        None => {
            let expected =
                "[lowest, highest]: the URDF states no range (the joint is continuous, or has no limit)";
            table.fault(key, "missing", expected);
            None
        }
    }
}

/// The three motion limits, each from the table or else from the URDF. Nothing that moves an arm has another default.
fn read_motion(
    table: &mut Table<'_>,
    (keys, known): (&Keys, &Known<'_>),
    notices: &mut Vec<String>,
) -> Option<LimitSet> {
    let [velocity, acceleration, jerk] = keys.rates;
    let expected = format!("a table of {velocity}, {acceleration}, {jerk}");
    let stated =
        if let Known::Urdf(joint_info) = known { joint_info.limits } else { StatedLimits::default() };
    let whole =
        [stated.velocity, stated.acceleration, stated.jerk].iter().all(|v| v.is_some_and(|v| v > 0.0));
    if whole && !table.has("motion") {
        table.take("motion");
        return from_urdf(table, keys, &stated);
    }
    let mut motion = table.table("motion", &expected)?;
    refuse_other_rates(&mut motion, keys);
    let mut limit = |key, (attribute, unit), stated, bounds: &Bounds| {
        let read = read_limit(&mut motion, known, (key, attribute, stated), bounds);
        let (given, stated, Known::Urdf(joint_info)) = (read?, stated.filter(|v| *v > 0.0), known) else {
            return read;
        };
        if stated.is_some_and(|stated| given > stated) {
            let (name, stated) = (shown(&joint_info.name), stated.unwrap_or(0.0));
            notices.push(format!(
                "joint {name}: motion.{key} = {given} is above the URDF's limit of {stated} {unit}"
            ));
        }
        Some(given)
    };
    let [of_velocity, of_acceleration, of_jerk] = &keys.rate_bounds;
    let unit = |order| keys.kind.rate_unit(order);
    let velocity_rad_s = limit(velocity, ("velocity", unit(1)), stated.velocity, of_velocity);
    let acceleration_rad_s2 =
        limit(acceleration, ("acceleration", unit(2)), stated.acceleration, of_acceleration);
    let jerk_rad_s3 = limit(jerk, ("jerk", unit(3)), stated.jerk, of_jerk);
    motion.done();
    Some(LimitSet {
        velocity_rad_s: velocity_rad_s?,
        acceleration_rad_s2: acceleration_rad_s2?,
        jerk_rad_s3: jerk_rad_s3?,
    })
}

/// All motion limits by the URDF, whose numbers must be inside the bounds of the file's.
fn from_urdf(table: &Table<'_>, keys: &Keys, stated: &StatedLimits) -> Option<LimitSet> {
    let checked = |attribute: &str, value: Option<f64>, bounds: &Bounds| {
        let value = value?;
        if bounds.hold(value) {
            return Some(value);
        }
        let expected =
            format!("{} as limit.{attribute} of the URDF; give motion limits here", bounds.words());
        table.fault("motion", &format!("{value} by the URDF"), &expected);
        None
    };
    let [of_velocity, of_acceleration, of_jerk] = &keys.rate_bounds;
    let velocity_rad_s = checked("velocity", stated.velocity, of_velocity);
    let acceleration_rad_s2 = checked("acceleration", stated.acceleration, of_acceleration);
    let jerk_rad_s3 = checked("jerk", stated.jerk, of_jerk);
    Some(LimitSet {
        velocity_rad_s: velocity_rad_s?,
        acceleration_rad_s2: acceleration_rad_s2?,
        jerk_rad_s3: jerk_rad_s3?,
    })
}

/// One motion limit: the file's, or else what the URDF states above 0.
fn read_limit(
    motion: &mut Table<'_>,
    known: &Known<'_>,
    (key, attribute, stated): (&'static str, &str, Option<f64>),
    bounds: &Bounds,
) -> Option<f64> {
    if motion.has(key) {
        return motion.number(key, bounds);
    }
    match (known, stated) {
        (Known::Nothing, _) => return motion.number(key, bounds),
        (Known::Urdf(_), Some(stated)) if bounds.hold(stated) => {
            motion.take(key);
            return Some(stated);
        }
        (Known::Something, _) => {
            motion.take(key);
            return None;
        }
        (Known::Urdf(_), _) => {}
    }
    motion.take(key);
    let value = match stated {
        Some(stated) => format!("missing, and the URDF's limit.{attribute} is {stated}"),
        None => format!("missing, and the URDF states no limit.{attribute}"),
    };
    let zero = if stated == Some(0.0) { " (0 in a URDF means that nobody knew it)" } else { "" };
    motion.fault(key, &value, &format!("{}; state it here{zero}", bounds.words()));
    None
}

/// The design's ratios: where `a_m + v_m |sigma'| <= a_s`, they leave one whole motion acceleration for slowing down.
fn default_stop(motion: LimitSet) -> LimitSet {
    LimitSet {
        velocity_rad_s: motion.velocity_rad_s,
        acceleration_rad_s2: STOP_ACCELERATION_RATIO * motion.acceleration_rad_s2,
        jerk_rad_s3: STOP_JERK_RATIO * motion.jerk_rad_s3,
    }
}

/// Stop limits must lie above the motion limits: the difference is all the room there is for slowing down.
fn read_stop(mut table: Table<'_>, keys: &Keys, motion: Option<&LimitSet>) -> Option<LimitSet> {
    let [_, acceleration, jerk] = keys.rates;
    for other in keys.other().rates.into_iter().zip(keys.rates).skip(1) {
        refuse_other(&mut table, other, keys);
    }
    let [_, of_acceleration, of_jerk] = &keys.rate_bounds;
    let acceleration_rad_s2 = table.number(acceleration, of_acceleration);
    let jerk_rad_s3 = table.number(jerk, of_jerk);
    let above = |key: &'static str, stop: Option<f64>, motion: Option<f64>| {
        if let (Some(stop), Some(motion)) = (stop, motion)
            && stop <= motion
        {
            let expected =
                format!("more than the motion limit {motion:?}: the difference is needed for slowing down");
            table.fault(key, &format!("{stop:?}"), &expected);
        }
    };
    above(acceleration, acceleration_rad_s2, motion.map(|m| m.acceleration_rad_s2));
    above(jerk, jerk_rad_s3, motion.map(|m| m.jerk_rad_s3));
    table.done();
    Some(LimitSet {
        velocity_rad_s: motion?.velocity_rad_s,
        acceleration_rad_s2: acceleration_rad_s2?,
        jerk_rad_s3: jerk_rad_s3?,
    })
}
