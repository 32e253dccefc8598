//! What a robot file says, key by key, before anything is derived from it.
//!
//! The digest is taken over this and nothing else, so whatever changes the meaning of a setpoint must be here.
use crate::document::{Node, Value};
use crate::reader::{Book, Bounds, Table};
use crate::robot::link_name;
use std::f64::consts::TAU;
use taustream_motion::{JointLimits, LimitSet, MAX_JOINTS};

/// Which convention a Denavit-Hartenberg row follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowKind {
    /// `dh`: a and alpha of this frame, behind the joint.
    Standard,
    /// `mdh`: a and alpha of the last frame, in front of the joint (Craig).
    Modified,
}

/// One `[[joint]]` table.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointRow {
    pub(crate) name: String,
    pub(crate) kind: RowKind,
    pub(crate) a_m: f64,
    pub(crate) alpha_rad: f64,
    pub(crate) d_m: f64,
    pub(crate) theta_offset_rad: f64,
    pub(crate) link_radius_m: f64,
    pub(crate) limits: JointLimits,
}

/// A robot file without faults.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Description {
    pub(crate) name: String,
    pub(crate) joints: Vec<JointRow>,
    /// Link pairs, lower index first, sorted, each once.
    pub(crate) allowed_contacts: Vec<(usize, usize)>,
}

/// Arms of this project reach a few metres; more is a slip of the unit (millimetres).
const LENGTH_M: Bounds = Bounds::within(-10.0, 10.0, "m");
const ANGLE_RAD: Bounds = Bounds::within(-TAU, TAU, "rad");
const RADIUS_M: Bounds = Bounds::within(0.0, 1.0, "m (0: no shape)");
/// Sixteen turns; a larger number is a slip of the unit (degrees).
const POSITION_RAD: Bounds = Bounds::within(-100.0, 100.0, "rad");
const VELOCITY_RAD_S: Bounds = Bounds::above(0.0, 100.0, "rad/s");
const ACCELERATION_RAD_S2: Bounds = Bounds::above(0.0, 1e4, "rad/s^2");
const JERK_RAD_S3: Bounds = Bounds::above(0.0, 1e7, "rad/s^3");

/// Stop limits where the file gives none, as multiples of the motion limits.
const STOP_ACCELERATION_RATIO: f64 = 2.0;
const STOP_JERK_RATIO: f64 = 4.0;

impl Description {
    /// Reads every key; `None` after a fault that leaves nothing to describe.
    pub(crate) fn read(book: &Book, node: Node) -> Option<Self> {
        let mut top = Table::top(book, node)?;
        let name = top.name("name");
        // Rows are not asked for when a URDF was to give the geometry: one fault says it, not one a joint.
        let from_urdf = refuse_urdf(&mut top);
        let tables = top.tables("joint");
        let count = tables.len();
        if !(1..=MAX_JOINTS).contains(&count) {
            top.fault("joint", &format!("{count} tables"), "1 to 8 tables [[joint]], base to tip");
        }
        let rows: Vec<Option<JointRow>> =
            tables.into_iter().map(|table| read_joint(table, from_urdf)).collect();
        let allowed = read_contacts(&mut top, count);
        top.done();
        check_names(book, &rows);
        check_kinds(book, &rows);
        let joints: Vec<JointRow> = rows.into_iter().flatten().collect();
        book.is_clean().then_some(Self { name: name?, joints, allowed_contacts: allowed })
    }
}

/// Robots from URDF are a later version; until then the keys are refused by name, not as unknown ones.
fn refuse_urdf(top: &mut Table<'_>) -> bool {
    let mut found = false;
    for key in ["urdf", "srdf", "tip_link"] {
        if let Some(node) = top.take(key) {
            let expected = "Denavit-Hartenberg rows (dh or mdh in each [[joint]]); \
                            robots from URDF files come in a later version";
            top.fault(key, &node.to_string(), expected);
            found = true;
        }
    }
    found
}

/// Every key is read before the first `?`, so that one fault does not hide the next.
fn read_joint(mut table: Table<'_>, from_urdf: bool) -> Option<JointRow> {
    let name = table.name("name");
    let row = read_row(&mut table, from_urdf);
    let link_radius_m = if from_urdf {
        table.number_or("link_radius_m", 0.0, &RADIUS_M)
    } else {
        table.number("link_radius_m", &RADIUS_M)
    };
    let position_rad = table.interval("position_rad", &POSITION_RAD);
    let motion = table.table("motion", "a table of velocity_rad_s, acceleration_rad_s2, jerk_rad_s3");
    let motion = motion.and_then(read_motion);
    let stop = match table.table_if_there("stop") {
        Some(stop) => read_stop(stop, motion.as_ref()),
        None => motion.map(default_stop),
    };
    table.done();
    let (kind, [a_m, alpha_rad, d_m, theta_offset_rad]) = row?;
    let limits = JointLimits { position_rad: position_rad?, motion: motion?, stop: stop? };
    Some(JointRow {
        name: name?,
        kind,
        a_m,
        alpha_rad,
        d_m,
        theta_offset_rad,
        link_radius_m: link_radius_m?,
        limits,
    })
}

/// The row of exactly one of the two conventions.
fn read_row(table: &mut Table<'_>, from_urdf: bool) -> Option<(RowKind, [f64; 4])> {
    const KEYS: &str = "a table of a_m, alpha_rad, d_m, theta_offset_rad";
    let standard = table.table_if_there("dh");
    let modified = table.table_if_there("mdh");
    let (kind, mut row) = match (standard, modified) {
        (Some(row), None) => (RowKind::Standard, row),
        (None, Some(row)) => (RowKind::Modified, row),
        (Some(_), Some(_)) => {
            table.fault("mdh", "given beside dh", "one of dh (standard) and mdh (modified, Craig)");
            return None;
        }
        (None, None) => {
            // A row that is there but is no table was refused as such already.
            if !from_urdf && !table.had("dh") && !table.had("mdh") {
                table.fault("dh", "missing", &format!("{KEYS} (or mdh, the modified convention)"));
            }
            return None;
        }
    };
    let a_m = row.number("a_m", &LENGTH_M);
    let alpha_rad = row.number("alpha_rad", &ANGLE_RAD);
    let d_m = row.number("d_m", &LENGTH_M);
    let theta_offset_rad = row.number("theta_offset_rad", &ANGLE_RAD);
    row.done();
    Some((kind, [a_m?, alpha_rad?, d_m?, theta_offset_rad?]))
}

/// No default: what plans may ask of a joint is the owner's word, not ours.
fn read_motion(mut table: Table<'_>) -> Option<LimitSet> {
    let velocity_rad_s = table.number("velocity_rad_s", &VELOCITY_RAD_S);
    let acceleration_rad_s2 = table.number("acceleration_rad_s2", &ACCELERATION_RAD_S2);
    let jerk_rad_s3 = table.number("jerk_rad_s3", &JERK_RAD_S3);
    table.done();
    Some(LimitSet {
        velocity_rad_s: velocity_rad_s?,
        acceleration_rad_s2: acceleration_rad_s2?,
        jerk_rad_s3: jerk_rad_s3?,
    })
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
fn read_stop(mut table: Table<'_>, motion: Option<&LimitSet>) -> Option<LimitSet> {
    let acceleration_rad_s2 = table.number("acceleration_rad_s2", &ACCELERATION_RAD_S2);
    let jerk_rad_s3 = table.number("jerk_rad_s3", &JERK_RAD_S3);
    let above = |key: &'static str, stop: Option<f64>, motion: Option<f64>| {
        if let (Some(stop), Some(motion)) = (stop, motion)
            && stop <= motion
        {
            let expected =
                format!("more than the motion limit {motion:?}: the difference is the room for slowing down");
            table.fault(key, &format!("{stop:?}"), &expected);
        }
    };
    above("acceleration_rad_s2", acceleration_rad_s2, motion.map(|m| m.acceleration_rad_s2));
    above("jerk_rad_s3", jerk_rad_s3, motion.map(|m| m.jerk_rad_s3));
    table.done();
    Some(LimitSet {
        velocity_rad_s: motion?.velocity_rad_s,
        acceleration_rad_s2: acceleration_rad_s2?,
        jerk_rad_s3: jerk_rad_s3?,
    })
}

/// Pairs of link names as pairs of indices.
fn read_contacts(top: &mut Table<'_>, joints: usize) -> Vec<(usize, usize)> {
    let Some(node) = top.take("allowed_contacts") else { return Vec::new() };
    let Value::List(items) = &node.value else {
        top.fault(
            "allowed_contacts",
            &node.to_string(),
            "a list of pairs of links: [[\"link3\", \"link5\"]]",
        );
        return Vec::new();
    };
    let mut pairs = Vec::new();
    for (i, item) in items.iter().enumerate() {
        match pair_of(item, joints) {
            Some(pair) if !pairs.contains(&pair) => pairs.push(pair),
            Some(_) => top.book().add(
                item.line,
                &format!("allowed_contacts[{i}]"),
                &item.to_string(),
                "each pair once",
            ),
            None => {
                let expected = format!("two different links of \"base\", \"link1\" to \"link{joints}\"");
                top.book().add(item.line, &format!("allowed_contacts[{i}]"), &item.to_string(), &expected);
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

fn pair_of(item: &Node, joints: usize) -> Option<(usize, usize)> {
    let Value::List(names) = &item.value else { return None };
    let [first, second] = names.as_slice() else { return None };
    let index = |node: &Node| {
        let Value::Text(name) = &node.value else { return None };
        (0..=joints).find(|link| link_name(*link) == *name)
    };
    let (first, second) = (index(first)?, index(second)?);
    (first != second).then_some((first.min(second), first.max(second)))
}

/// Settings bind servos by joint name: two of one name would leave a joint to chance.
fn check_names(book: &Book, rows: &[Option<JointRow>]) {
    for (i, joint) in rows.iter().enumerate() {
        let Some(joint) = joint else { continue };
        if rows.iter().take(i).flatten().any(|other| other.name == joint.name) {
            book.add(
                None,
                &format!("joint[{i}].name"),
                &format!("{:?}", joint.name),
                "each joint's name once",
            );
        }
    }
}

/// One arm has one convention: a mixed table is a copying mistake, and a silent one.
fn check_kinds(book: &Book, rows: &[Option<JointRow>]) {
    let Some(first) = rows.iter().flatten().next() else { return };
    for (i, joint) in rows.iter().enumerate() {
        let Some(joint) = joint.as_ref().filter(|joint| joint.kind != first.kind) else { continue };
        let (key, other) = match joint.kind {
            RowKind::Standard => ("dh", "mdh"),
            RowKind::Modified => ("mdh", "dh"),
        };
        let expected = format!("{other}, as in joint {:?}: one convention for the whole arm", first.name);
        book.add(None, &format!("joint[{i}].{key}"), "a row", &expected);
    }
}
