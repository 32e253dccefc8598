//! Denavit-Hartenberg rows: geometry as a robot file states it itself.
use crate::capsule::Capsule;
use crate::mass::{self, Weight};
use crate::reader::{Bounds, FaultList, Table};
use std::f64::consts::TAU;
use taustream_motion::JointKind;

/// Which convention a row follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowKind {
    /// `dh`: a and alpha of this frame, behind the joint.
    Standard,
    /// `mdh`: a and alpha of the last frame, in front of the joint (Craig).
    Modified,
}

/// One row, and the shape of its link: the radius of a capsule along the row, or capsules of its own.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    pub(crate) kind: RowKind,
    /// What the joint adds its position to: theta, or d of a prismatic joint.
    pub(crate) joint_kind: JointKind,
    pub(crate) a_m: f64,
    pub(crate) alpha_rad: f64,
    pub(crate) d_m: f64,
    pub(crate) theta_offset_rad: f64,
    /// Of the capsule along the row; 0 for none.
    pub(crate) link_radius_m: f64,
    /// Of the link behind the joint, in the row's frame.
    pub(crate) capsules: Vec<Capsule>,
    /// Of the link behind the joint.
    pub(crate) weight: Option<Weight>,
}

/// Arms of this project reach a few metres; more is a slip of the unit (millimetres).
const LENGTH_M: Bounds = Bounds::within(-10.0, 10.0, "m");
const ANGLE_RAD: Bounds = Bounds::within(-TAU, TAU, "rad");
const RADIUS_M: Bounds = Bounds::within(0.0, 1.0, "m (0: no shape)");

/// Takes the row of a joint's table.
pub(crate) fn read(table: &mut Table<'_>, joint_kind: JointKind) -> Option<Row> {
    let row = read_row(table);
    let shape = read_shape(table, joint_kind);
    let weight = Weight::read(table, mass::LINK);
    let (kind, [a_m, alpha_rad, d_m, theta_offset_rad]) = row?;
    let ((link_radius_m, capsules), weight) = (shape?, weight?);
    Some(Row { kind, joint_kind, a_m, alpha_rad, d_m, theta_offset_rad, link_radius_m, capsules, weight })
}

/// Either a radius along the row or capsules.
fn read_shape(table: &mut Table<'_>, joint_kind: JointKind) -> Option<(f64, Vec<Capsule>)> {
    if !table.has("link_capsules") {
        table.take("link_capsules");
        let radius_m = table.number("link_radius_m", &RADIUS_M)?;
        if radius_m > 0.0 && joint_kind.is_prismatic() {
            let expected =
                "link_capsules (or 0: no shape): the line of a prismatic joint's row changes its length";
            table.fault("link_radius_m", &format!("{radius_m:?}"), expected);
            return None;
        }
        return Some((radius_m, Vec::new()));
    }
    let capsules = Capsule::read_list(table, "link_capsules");
    if table.take("link_radius_m").is_some() {
        table.fault("link_radius_m", "given beside link_capsules", "one of the two");
        return None;
    }
    capsules.map(|capsules| (0.0, capsules))
}

/// The row of exactly one of the two conventions.
fn read_row(table: &mut Table<'_>) -> Option<(RowKind, [f64; 4])> {
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
            if !table.had("dh") && !table.had("mdh") {
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

/// An arm whose links weigh something in part only would make every energy wrong, and silently so.
pub(crate) fn check_weights(fault_list: &FaultList, rows: &[Option<(&str, &Row)>]) {
    let weighs = |row: &Option<(&str, &Row)>| row.is_some_and(|(_, row)| row.weight.is_some());
    if !rows.iter().any(weighs) {
        return;
    }
    for (i, _) in rows.iter().enumerate().filter(|(_, row)| row.is_some() && !weighs(row)) {
        let expected = "a mass for each link, or for none (0 kg is one)";
        fault_list.add(None, &format!("joint[{i}].link_mass_kg"), "missing", expected);
    }
}

/// One arm has one convention: a mixed table is a copying mistake, and a silent one. `rows` are joints' names with their rows.
pub(crate) fn check_kinds(fault_list: &FaultList, rows: &[Option<(&str, &Row)>]) {
    let Some((first_name, first)) = rows.iter().flatten().next() else { return };
    for (i, row) in rows.iter().enumerate() {
        let Some((_, row)) = row.filter(|(_, row)| row.kind != first.kind) else { continue };
        let (key, other) = match row.kind {
            RowKind::Standard => ("dh", "mdh"),
            RowKind::Modified => ("mdh", "dh"),
        };
        let expected = format!("{other}, as in joint {first_name:?}: one convention for the whole arm");
        fault_list.add(None, &format!("joint[{i}].{key}"), "a row", &expected);
    }
}
