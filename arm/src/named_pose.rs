//! Poses with a name: `[[pose]]` in the robot file, and the group states of an SRDF file that state every joint.
use crate::description::Joint;
use crate::document::shown;
use crate::group::Group;
use crate::reader::{Bounds, Table, numbers_of};
use taustream_motion::{JointArray, MAX_JOINTS};

/// A pose that the owner has named.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPose {
    /// Its name, each once in a group, and once among those of all joints.
    pub name: String,
    /// Index of the group that it is a pose of, into [`crate::Robot::groups`]; none for all joints.
    pub group: Option<usize>,
    /// One angle a joint, or its position in m of a prismatic one; unused slots, and joints of other groups, are zero.
    pub position_rad: JointArray,
}

/// A group state of an SRDF: its name, and joints by name with what they are set to (rad).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GroupState {
    pub(crate) name: String,
    pub(crate) joints: Vec<(String, f64)>,
}

/// The pose of a joint is checked against its range, whose bounds are narrower.
const ANGLE_RAD: Bounds = Bounds::within(-1e3, 1e3, "rad");

/// Takes every `[[pose]]`; the joints are not known after a fault in the geometry.
pub(crate) fn read(top: &mut Table<'_>, joints: Option<&[Joint]>, groups: &[Group]) -> Vec<NamedPose> {
    let mut poses: Vec<NamedPose> = Vec::new();
    for mut table in top.tables("pose") {
        let name = table.name("name");
        let group = read_group(&mut table, groups);
        let members = joints.zip(group).map(|(joints, group)| members(joints, groups, group));
        let key = key_of(&mut table, members.as_deref());
        let node = table.need(key, "a list of one position a joint");
        let angles = node.zip(members.as_ref()).and_then(|(node, members)| {
            let key = table.path_of(key);
            numbers_of(table.fault_list(), &key, &node, members.len(), &ANGLE_RAD)
        });
        if let (Some(name), Some(group), Some(angles), Some(members)) = (name, group, angles, members) {
            if poses.iter().any(|pose| pose.name == name && pose.group == group) {
                table.fault("name", &shown(&name), "each pose's name once");
            } else if let Some(words) = outside(&members, &angles) {
                table.fault(key, &words, "every joint inside its limits");
            } else {
                poses.push(NamedPose { name, group, position_rad: spread(&members, &angles) });
            }
        }
        table.done();
    }
    poses
}

/// The key of a pose's positions: in rad where all of its joints turn, else each in the unit of its joint. The other one is refused.
fn key_of(table: &mut Table<'_>, members: Option<&[(usize, &Joint)]>) -> &'static str {
    const KEYS: [&str; 2] = ["position_rad", "position"];
    let Some(members) = members else {
        return if table.has(KEYS[1]) { KEYS[1] } else { KEYS[0] };
    };
    let slides = members.iter().any(|(_, joint)| joint.kind.is_prismatic());
    let [other, own] = if slides { KEYS } else { [KEYS[1], KEYS[0]] };
    if let Some(node) = table.has(other).then(|| table.take(other)).flatten() {
        let units: Vec<&str> = members.iter().map(|(_, joint)| joint.kind.unit()).collect();
        table.fault(other, &node.to_string(), &format!("{own}, one number a joint, in {}", units.join(", ")));
    }
    own
}

/// The group that a pose is of; the outer `None` is a fault.
#[expect(clippy::option_option, reason = "a missing group and a faulty one are distinguished")]
fn read_group(table: &mut Table<'_>, groups: &[Group]) -> Option<Option<usize>> {
    let Some(name) = table.text_if_there("group", "the name of a [[group]]") else { return Some(None) };
    let found = groups.iter().position(|group| group.name == name);
    if found.is_none() {
        let names: Vec<String> = groups.iter().map(|group| shown(&group.name)).collect();
        let known = if names.is_empty() { "the file has none".to_owned() } else { names.join(", ") };
        table.fault("group", &shown(&name), &format!("a [[group]] of the file: {known}"));
    }
    found.map(Some)
}

/// The joints of a group, or all, with their indices.
fn members<'j>(joints: &'j [Joint], groups: &[Group], group: Option<usize>) -> Vec<(usize, &'j Joint)> {
    let group = group.and_then(|group| groups.get(group));
    let is_in = |(index, _): &(usize, &Joint)| group.is_none_or(|group| group.joints.contains(index));
    joints.iter().enumerate().filter(is_in).collect()
}

/// The group states that state every joint of the arm, or of one of its groups, inside its limits, unless the robot file has one of
/// that name. What is left out for another reason than belonging to other joints is said.
pub(crate) fn of_states(
    states: &[GroupState],
    (joints, groups): (&[Joint], &[Group]),
    own: &[NamedPose],
    notices: &mut Vec<String>,
) -> Vec<NamedPose> {
    let mut poses: Vec<NamedPose> = own.to_vec();
    for state in states {
        let all = std::iter::once(None).chain((0..groups.len()).map(Some));
        for group in all {
            let members = members(joints, groups, group);
            let of = |joint: &Joint| state.joints.iter().find(|(name, _)| *name == joint.name);
            let angles: Vec<f64> = members.iter().filter_map(|(_, joint)| Some(of(joint)?.1)).collect();
            let is_known = |pose: &NamedPose| pose.name == state.name && pose.group == group;
            if angles.len() < members.len() || poses.iter().any(is_known) {
                continue;
            }
            let name = state.name.clone();
            if let Some(words) = outside(&members, &angles) {
                notices.push(format!("SRDF group state {name:?} is left out: {words} is outside its limits"));
            } else {
                poses.push(NamedPose { name, group, position_rad: spread(&members, &angles) });
            }
            // The groups of a state of all joints are in it.
            break;
        }
    }
    poses
}

fn outside(members: &[(usize, &Joint)], angles: &[f64]) -> Option<String> {
    let mut both = members.iter().zip(angles);
    let ((_, joint), angle) = both.find(|((_, joint), angle)| !joint.limits.is_inside(**angle))?;
    let [low, high] = joint.limits.position_rad;
    Some(format!("joint {:?} at {angle} {} of [{low}, {high}]", joint.name, joint.kind.unit()))
}

fn spread(members: &[(usize, &Joint)], angles: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    for ((joint, _), angle) in members.iter().zip(angles) {
        if let Some(slot) = pose.get_mut(*joint) {
            *slot = *angle;
        }
    }
    pose
}

#[cfg(test)]
mod tests {
    use crate::Robot;
    use std::path::Path;

    fn ur5(tables: &str) -> Result<Robot, String> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        let text = std::fs::read_to_string(file).unwrap();
        Robot::from_toml(Path::new("r.toml"), &format!("{text}\n{tables}")).map_err(|f| f.to_string())
    }

    fn pose(name: &str, angles: &str) -> String {
        format!("[[pose]]\nname = \"{name}\"\nposition_rad = {angles}\n")
    }

    #[test]
    fn poses_of_the_robot_file_are_found_by_name_and_change_no_digest() {
        let robot = ur5(&pose("tucked", "[0, -2.2, 2.2, -1.57, -1.57, 0]")).unwrap();
        let tucked = robot.pose("tucked").unwrap();
        assert!((tucked[1] + 2.2).abs() < 1e-12 && tucked[6].abs() < 1e-12, "{tucked:?}");
        assert!(robot.pose("elsewhere").is_none());
        assert_eq!(robot.digest, ur5("").unwrap().digest, "a name moves nothing");
    }

    #[test]
    fn poses_that_are_none_are_refused_with_key_and_remedy() {
        let good = pose("a", "[0, 0, 0, 0, 0, 0]");
        for (tables, words) in [
            (format!("{good}{good}"), "each pose's name once"),
            (pose("a", "[0, 0, 0]"), "a list of 6 numbers"),
            (pose("a", "[0, 0, 0, 0, 0, nan]"), "pose[0].position_rad[5]"),
            (pose("a", "[0, 0, 0, 0, 0, 90]"), "every joint inside its limits"),
            (pose("", "[0, 0, 0, 0, 0, 0]"), "pose[0].name"),
            ("[[pose]]\nname = \"a\"\n".to_owned(), "pose[0].position_rad"),
            (format!("{good}speed = 3\n"), "speed"),
        ] {
            let faults = ur5(&tables).unwrap_err();
            assert!(faults.contains(words), "{tables}: {faults}");
        }
    }
}
