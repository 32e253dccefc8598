//! What a robot file says, key by key, before anything is derived from it.
//!
//! The digest is taken over this and nothing else, so whatever changes the meaning of a setpoint must be here.
use crate::capsule::Capsule;
use crate::document::{Node, Value, shown};
use crate::group::{self, Group};
use crate::joint_limits::{Known, guess_kind, read_kind, read_limits, read_torque};
use crate::link_margin::LinkMargins;
use crate::mass::{self, Weight};
use crate::modelled::{self, Listed};
use crate::named_pose::{self, NamedPose};
use crate::reader::{FaultList, Table};
use crate::robot::link_name;
use crate::rows::{self, Row, RowKind};
use crate::urdf::{self, UrdfArm};
use taustream_motion::{JointKind, JointLimits, MAX_JOINTS};

/// One joint of the arm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
    pub(crate) limits: JointLimits,
    /// Nm, or N of a prismatic joint.
    pub(crate) torque_nm_max: Option<f64>,
}

/// Where links and joints are.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Geometry {
    /// One row a joint.
    Rows(Vec<Row>),
    /// A URDF's chain from base to tip.
    Urdf(Box<UrdfArm>),
}

impl Geometry {
    /// The tips, each with the joints that move it.
    pub(crate) fn tips(&self) -> Vec<(String, Vec<usize>)> {
        match self {
            Self::Rows(rows) => vec![(link_name(rows.len()), (0..rows.len()).collect())],
            Self::Urdf(arm) => arm.tips(),
        }
    }
}

/// A robot file without faults.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Description {
    pub(crate) name: String,
    /// Base to tip.
    pub(crate) joints: Vec<Joint>,
    pub(crate) geometry: Geometry,
    /// Link pairs, lower index first, sorted, each once.
    pub(crate) allowed_contacts: Vec<(usize, usize)>,
    /// Of the base, in its frame; none beside a URDF.
    pub(crate) base_capsules: Vec<Capsule>,
    /// Links that are acknowledged to have no shape.
    pub(crate) unmodelled_links: Vec<String>,
    /// What links keep from each other.
    pub(crate) margins: LinkMargins,
    /// What the tip carries, in its frame.
    pub(crate) payload: Option<Weight>,
    /// Gravity in the base's frame.
    pub(crate) gravity_m_s2: [f64; 3],
    /// Poses that the robot file names.
    pub(crate) poses: Vec<NamedPose>,
    /// Joints that belong together.
    pub(crate) groups: Vec<Group>,
    /// What the owner should know about the joints' limits, as text.
    pub(crate) notices: Vec<String>,
}

impl Description {
    /// Reads every key; `None` after a fault that leaves nothing to describe.
    pub(crate) fn read(fault_list: &FaultList, node: Node) -> Option<Self> {
        let mut top = Table::top(fault_list, node)?;
        let name = top.name("name");
        let mut notices = Vec::new();
        let from_urdf = top.has("urdf");
        let listed = modelled::read(&mut top);
        let base_capsules =
            if from_urdf { Some(Vec::new()) } else { Capsule::read_list(&mut top, "base_capsules") };
        let read = if from_urdf {
            read_urdf(&mut top, &listed, &mut notices)
        } else {
            read_rows(&mut top, &mut notices)
        };
        let allowed_contacts = read_contacts(&mut top, read.links.as_deref());
        let margins = LinkMargins::read(&mut top, read.links.as_deref());
        let payload = read_payload(&mut top);
        let joints = read.whole.as_ref().map(|(joints, _)| joints.as_slice());
        let tips = read.whole.as_ref().map(|(_, geometry)| geometry.tips());
        let groups = group::read(&mut top, joints.zip(tips.as_deref()));
        let poses = named_pose::read(&mut top, joints, &groups);
        if let (Some(Some(_)), Some([_, _, ..])) = (&payload, tips.as_deref()) {
            top.fault("payload", "a table", "a payload only where the robot has one tip");
        }
        let gravity_m_s2 = Weight::read_gravity(&mut top);
        top.done();
        let (joints, geometry) = read.whole?;
        let (name, payload, gravity_m_s2, margins) = (name?, payload?, gravity_m_s2?, margins?);
        let described = Self {
            name,
            joints,
            geometry,
            allowed_contacts,
            margins,
            base_capsules: base_capsules?,
            unmodelled_links: listed.iter().map(|listed| listed.name.clone()).collect(),
            payload,
            gravity_m_s2,
            poses,
            groups,
            notices,
        };
        modelled::check(fault_list, &listed, &read.links.unwrap_or_default(), |link| {
            described.has_shape(link)
        });
        fault_list.is_clean().then_some(described)
    }
}

impl Description {
    /// True when a link has a shape; one with a part that could not be read counts as having none.
    fn has_shape(&self, link: usize) -> bool {
        match &self.geometry {
            Geometry::Urdf(arm) => {
                arm.parts.iter().any(|part| part.link == link) && !arm.skipped.contains(&link)
            }
            Geometry::Rows(rows) => {
                // A modified row's own capsule lies before its joint.
                let along = |row: &Row| match row.kind {
                    RowKind::Standard => 0,
                    RowKind::Modified => 1,
                };
                let by_radius = |(i, row): (usize, &Row)| {
                    let is_last = link == rows.len() && i + 1 == link;
                    row.link_radius_m > 0.0 && (i + 1 == link + along(row) || is_last)
                };
                let own = link
                    .checked_sub(1)
                    .and_then(|i| rows.get(i))
                    .map_or(&self.base_capsules, |row| &row.capsules);
                !own.is_empty() || rows.iter().enumerate().any(by_radius)
            }
        }
    }
}

/// Joints and geometry, and as much of it as there is after a fault.
struct Read {
    /// Names of the links.
    links: Option<Vec<String>>,
    whole: Option<(Vec<Joint>, Geometry)>,
}

fn read_rows(top: &mut Table<'_>, notices: &mut Vec<String>) -> Read {
    // Asked for, so that it is listed among the known keys.
    top.take("urdf");
    for key in urdf::KEYS.iter().skip(1) {
        if let Some(node) = top.take(key) {
            top.fault(key, &node.to_string(), "this key only beside `urdf`");
        }
    }
    let tables = top.tables("joint");
    let count = tables.len();
    if !(1..=MAX_JOINTS).contains(&count) {
        top.fault(
            "joint",
            &format!("{count} tables"),
            &format!("1 to {MAX_JOINTS} tables [[joint]], base to tip"),
        );
    }
    let mut read: Vec<Option<(Joint, Row)>> = Vec::new();
    for mut table in tables {
        // Every key is read before the first `?`, so that one fault does not hide the next.
        let name = table.name("name");
        let stated = read_kind(&mut table);
        let kind = stated.unwrap_or_else(|| guess_kind(&table));
        let row = rows::read(&mut table, kind);
        let limits = read_limits(&mut table, (kind, &Known::Nothing), notices);
        let torque = read_torque(&mut table, (kind, &Known::Nothing), notices);
        table.done();
        let joint = |((name, limits), torque_nm_max)| Joint { name, kind, limits, torque_nm_max };
        read.push(name.zip(limits).zip(torque).map(joint).zip(row));
    }
    check_names(
        top.fault_list(),
        &read.iter().map(|j| j.as_ref().map(|(j, _)| j.name.as_str())).collect::<Vec<_>>(),
    );
    let rows: Vec<_> =
        read.iter().map(|j| j.as_ref().map(|(joint, row)| (joint.name.as_str(), row))).collect();
    rows::check_kinds(top.fault_list(), &rows);
    rows::check_weights(top.fault_list(), &rows);
    let (joints, rows): (Vec<Joint>, Vec<Row>) = read.into_iter().flatten().unzip();
    // The names of the links follow from the number of tables, faulty ones included.
    let links = (0..=count).map(link_name).collect();
    Read { links: Some(links), whole: (joints.len() == count).then_some((joints, Geometry::Rows(rows))) }
}

/// The URDF gives the joints and their order; the tables give what a URDF does not know.
fn read_urdf(top: &mut Table<'_>, listed: &[Listed], notices: &mut Vec<String>) -> Read {
    let arm = UrdfArm::read(top, listed);
    let joint_info = arm.as_ref().map(UrdfArm::joints);
    let mut limits: Vec<Option<(JointLimits, Option<f64>)>> =
        vec![None; joint_info.as_ref().map_or(0, Vec::len)];
    let mut names: Vec<Option<String>> = Vec::new();
    for mut table in top.tables("joint") {
        let name = table.text("name", "the name of a joint of the URDF");
        let at = joint_info.as_ref().zip(name.as_ref()).and_then(|(joint_info, name)| {
            let at = joint_info.iter().position(|joint| joint.name == *name);
            if at.is_none() {
                let known: Vec<&str> = joint_info.iter().map(|joint| joint.name.as_str()).collect();
                table.fault(
                    "name",
                    &shown(name),
                    &format!("a joint between base and tip: {}", known.join(", ")),
                );
            }
            at
        });
        let (kind, known) = match at.and_then(|at| joint_info.as_ref()?.get(at)) {
            Some(joint) => (joint.kind, Known::Urdf(joint)),
            None => (guess_kind(&table), Known::Something),
        };
        if let Some(node) = table.has("kind").then(|| table.take("kind")).flatten() {
            table.fault(
                "kind",
                &node.to_string(),
                "no such key beside `urdf`, which states the type of the joint",
            );
        }
        let read = read_limits(&mut table, (kind, &known), notices);
        let read = read.zip(read_torque(&mut table, (kind, &known), notices));
        table.done();
        if let Some(slot) = at.and_then(|at| limits.get_mut(at)) {
            *slot = read;
        }
        names.push(name);
    }
    check_names(top.fault_list(), &names.iter().map(Option::as_deref).collect::<Vec<_>>());
    let links = arm.as_ref().map(UrdfArm::links);
    let Some((arm, joint_info)) = arm.zip(joint_info) else { return Read { links, whole: None } };
    for joint in joint_info.iter().filter(|joint| !names.iter().flatten().any(|name| *name == joint.name)) {
        let expected = format!(
            "one table [[joint]] with name = {}: limits that the URDF does not state have no default",
            shown(&joint.name)
        );
        top.fault("joint", "missing", &expected);
    }
    let joints: Option<Vec<Joint>> = joint_info
        .into_iter()
        .zip(limits)
        .map(|(joint_info, limits)| {
            let (limits, torque_nm_max) = limits?;
            Some(Joint { name: joint_info.name, kind: joint_info.kind, limits, torque_nm_max })
        })
        .collect();
    Read { links, whole: joints.map(|joints| (joints, Geometry::Urdf(Box::new(arm)))) }
}

/// What the tip carries, if anything; the outer `None` is a fault.
fn read_payload(top: &mut Table<'_>) -> Option<Option<Weight>> {
    if !top.has("payload") {
        top.take("payload");
        return Some(None);
    }
    let mut table = top.table("payload", "a table of mass_kg, center_m and inertia_kg_m2")?;
    if !table.has("mass_kg") {
        table.number("mass_kg", &mass::MASS_KG);
    }
    let payload = Weight::read(&mut table, mass::PAYLOAD);
    table.done();
    payload
}

/// Pairs of link names as pairs of indices; the names are not known after a fault in the geometry.
fn read_contacts(top: &mut Table<'_>, links: Option<&[String]>) -> Vec<(usize, usize)> {
    let Some(node) = top.take("allowed_contacts") else { return Vec::new() };
    let Value::List(items) = &node.value else {
        top.fault(
            "allowed_contacts",
            &node.to_string(),
            "a list of pairs of links: [[\"link3\", \"link5\"]]",
        );
        return Vec::new();
    };
    let Some(links) = links else { return Vec::new() };
    let mut pairs = Vec::new();
    for (i, item) in items.iter().enumerate() {
        let key = format!("allowed_contacts[{i}]");
        match pair_of(item, links) {
            Some(pair) if !pairs.contains(&pair) => pairs.push(pair),
            Some(_) => top.fault_list().add(item.line, &key, &item.to_string(), "each pair once"),
            None => top.fault_list().add(item.line, &key, &item.to_string(), &two_links_of(links)),
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Names of links that a fault lists.
const LINKS_SHOWN_MAX: usize = 30;

/// What a pair of links is expected to be.
pub(crate) fn two_links_of(links: &[String]) -> String {
    let names: Vec<String> = links.iter().take(LINKS_SHOWN_MAX).map(|name| shown(name)).collect();
    let more = if links.len() > LINKS_SHOWN_MAX { ", .." } else { "" };
    format!("two different links of {}{more}", names.join(", "))
}

/// A pair of names as indices, lower first.
pub(crate) fn pair_of(item: &Node, links: &[String]) -> Option<(usize, usize)> {
    let Value::List(names) = &item.value else { return None };
    let [first, second] = names.as_slice() else { return None };
    let index = |node: &Node| {
        let Value::Text(name) = &node.value else { return None };
        links.iter().position(|link| link == name)
    };
    let (first, second) = (index(first)?, index(second)?);
    (first != second).then_some((first.min(second), first.max(second)))
}

/// Settings bind servos by joint name: two of one name would leave a joint to chance.
fn check_names(fault_list: &FaultList, names: &[Option<&str>]) {
    for (i, name) in names.iter().enumerate() {
        let Some(name) = name else { continue };
        if names.iter().take(i).flatten().any(|other| other == name) {
            fault_list.add(None, &format!("joint[{i}].name"), &shown(name), "each joint's name once");
        }
    }
}
