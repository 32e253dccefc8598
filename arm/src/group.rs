//! Groups: joints that belong together, as the arms of a robot with two (`[[group]]` of the robot file).
//!
//! A motion may be asked for by the values of one group; the other joints hold. A joint is in one group at most, so that two groups
//! never ask the same joint for two things.
use crate::description::Joint;
use crate::document::shown;
use crate::reader::Table;
use std::fmt::Write as _;
use taustream_motion::MAX_JOINTS;

/// Joints that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Its name, each once.
    pub name: String,
    /// Indices of the joints, in the robot's order.
    pub joints: Vec<usize>,
    /// Index of the tip that it leads, into [`crate::Robot::tips`]; none where it leads several or none.
    pub tip: Option<usize>,
}

impl Group {
    /// The joints that are not in it, of a robot with so many, a bit each.
    #[must_use]
    pub fn others(&self, joints: usize) -> u32 {
        let bit = |joint: usize| if self.joints.contains(&joint) { 0 } else { 1 << joint };
        (0..joints.min(MAX_JOINTS)).map(bit).sum()
    }
}

/// A tip that a robot leads: the name of its link, and its frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tip {
    /// Name of its link.
    pub name: String,
    /// Index into the chain's frames.
    pub frame: usize,
}

/// Tips by name, each with the joints that move it.
type Tips = [(String, Vec<usize>)];

/// Takes every `[[group]]`; joints and tips are not known after a fault in the geometry.
pub(crate) fn read(top: &mut Table<'_>, known: Option<(&[Joint], &Tips)>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for mut table in top.tables("group") {
        let name = table.name("name");
        let tip_link = table.text_if_there("tip_link", "the name of a tip link");
        let names = read_joints(&mut table);
        let made = known.and_then(|(joints, tips)| {
            let tip = tip_link.as_deref().map(|tip| find_tip(&table, tip, tips));
            let members = match (&names, tip) {
                (Some(names), _) => find_joints(&table, names, joints),
                (None, Some(tip)) => tip.and_then(|tip| moved_only(&table, tip, tips)),
                (None, None) => {
                    table.fault(
                        "tip_link",
                        "missing",
                        "the tip that the group leads, or joints = [..], or both",
                    );
                    None
                }
            };
            let members = members?;
            let tip = match tip {
                Some(named) => Some(named?),
                None => only_tip(&members, tips),
            };
            Some(Group { name: name.clone()?, joints: members, tip })
        });
        if let (Some(group), Some((joints, _))) = (made, known)
            && is_apart(&table, &group, &groups, joints)
        {
            groups.push(group);
        }
        table.done();
    }
    groups
}

/// Names of joints; `None` where the key is not there.
fn read_joints(table: &mut Table<'_>) -> Option<Vec<String>> {
    let node = table.take("joints")?;
    let names = node.value.texts().filter(|names| !names.is_empty());
    if names.is_none() {
        table.fault("joints", &node.to_string(), "a list of names of joints");
    }
    Some(names.unwrap_or_default())
}

fn find_tip(table: &Table<'_>, name: &str, tips: &Tips) -> Option<usize> {
    let found = tips.iter().position(|(tip, _)| tip == name);
    if found.is_none() {
        let names = listed(tips.iter().map(|(name, _)| name.as_str()));
        table.fault("tip_link", &shown(name), &format!("a tip of the robot: {names}"));
    }
    found
}

/// Joints by name, in the robot's order.
fn find_joints(table: &Table<'_>, names: &[String], joints: &[Joint]) -> Option<Vec<usize>> {
    let mut members = Vec::with_capacity(names.len());
    for name in names {
        match joints.iter().position(|joint| joint.name == *name) {
            Some(joint) if !members.contains(&joint) => members.push(joint),
            Some(_) => {
                table.fault("joints", &shown(name), "each joint once");
                return None;
            }
            None => {
                let known = listed(joints.iter().map(|joint| joint.name.as_str()));
                table.fault("joints", &shown(name), &format!("joints of the robot: {known}"));
                return None;
            }
        }
    }
    members.sort_unstable();
    (!members.is_empty()).then_some(members)
}

/// The joints that move a tip and no other.
fn moved_only(table: &Table<'_>, tip: usize, tips: &Tips) -> Option<Vec<usize>> {
    let (name, movers) = tips.get(tip)?;
    let is_shared = |joint: &usize| {
        tips.iter().enumerate().any(|(other, (_, movers))| other != tip && movers.contains(joint))
    };
    let own: Vec<usize> = movers.iter().copied().filter(|joint| !is_shared(joint)).collect();
    if own.is_empty() {
        let expected = "a tip with joints that move no other tip, or joints = [..]";
        table.fault("tip_link", &shown(name), expected);
        return None;
    }
    Some(own)
}

/// The tip that all of some joints move, when there is one only.
fn only_tip(members: &[usize], tips: &Tips) -> Option<usize> {
    let mut led =
        tips.iter().enumerate().filter(|(_, (_, movers))| members.iter().all(|j| movers.contains(j)));
    let (tip, _) = led.next()?;
    led.next().is_none().then_some(tip)
}

/// False after a fault: its name, or one of its joints, is another group's.
fn is_apart(table: &Table<'_>, group: &Group, groups: &[Group], joints: &[Joint]) -> bool {
    if groups.iter().any(|other| other.name == group.name) {
        table.fault("name", &shown(&group.name), "each group's name once");
        return false;
    }
    let shared = group.joints.iter().find_map(|joint| {
        let other = groups.iter().find(|other| other.joints.contains(joint))?;
        Some((joints.get(*joint)?, other))
    });
    if let Some((joint, other)) = shared {
        let value = format!("{} is in group {} already", shown(&joint.name), shown(&other.name));
        table.fault("joints", &value, "each joint in one group at most");
        return false;
    }
    true
}

fn listed<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let mut list = String::new();
    for name in names {
        let apart = if list.is_empty() { "" } else { ", " };
        // Writing to a string cannot fail.
        let _ = write!(list, "{apart}{}", shown(name));
    }
    list
}
