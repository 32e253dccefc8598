//! Poses with a name: `[[pose]]` in the robot file, and the group states of an SRDF file that state every joint.
use crate::description::Joint;
use crate::document::shown;
use crate::reader::{Bounds, Table, numbers_of};
use taustream_motion::{JointArray, MAX_JOINTS};

/// A pose that the owner has named.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedPose {
    /// Its name, each once.
    pub name: String,
    /// One angle a joint; unused slots are zero.
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
pub(crate) fn read(top: &mut Table<'_>, joints: Option<&[Joint]>) -> Vec<NamedPose> {
    let mut poses: Vec<NamedPose> = Vec::new();
    for mut table in top.tables("pose") {
        let name = table.name("name");
        let node = table.need("position_rad", "a list of one angle a joint");
        let angles = node.zip(joints).and_then(|(node, joints)| {
            let key = table.path_of("position_rad");
            numbers_of(table.fault_list(), &key, &node, joints.len(), &ANGLE_RAD)
        });
        if let (Some(name), Some(angles), Some(joints)) = (name, angles, joints) {
            if poses.iter().any(|pose| pose.name == name) {
                table.fault("name", &shown(&name), "each pose's name once");
            } else if let Some(words) = outside(joints, &angles) {
                table.fault("position_rad", &words, "every joint inside its limits");
            } else {
                poses.push(NamedPose { name, position_rad: padded(&angles) });
            }
        }
        table.done();
    }
    poses
}

/// The group states that state every joint of the arm inside its limits, unless the robot file has one of that name. What
/// is left out for another reason than belonging to other joints is said.
pub(crate) fn of_states(
    states: &[GroupState],
    joints: &[Joint],
    own: &[NamedPose],
    notices: &mut Vec<String>,
) -> Vec<NamedPose> {
    let mut poses: Vec<NamedPose> = own.to_vec();
    for state in states {
        let of = |joint: &Joint| state.joints.iter().find(|(name, _)| *name == joint.name);
        let angles: Vec<f64> = joints.iter().filter_map(|joint| Some(of(joint)?.1)).collect();
        if angles.len() < joints.len() || poses.iter().any(|pose| pose.name == state.name) {
            continue;
        }
        match outside(joints, &angles) {
            Some(words) => {
                let name = &state.name;
                notices.push(format!("SRDF group state {name:?} is left out: {words} is outside its limits"));
            }
            None => poses.push(NamedPose { name: state.name.clone(), position_rad: padded(&angles) }),
        }
    }
    poses
}

fn outside(joints: &[Joint], angles: &[f64]) -> Option<String> {
    let mut both = joints.iter().zip(angles);
    let (joint, angle) = both.find(|(joint, angle)| !joint.limits.is_inside(**angle))?;
    let [low, high] = joint.limits.position_rad;
    Some(format!("joint {:?} at {angle} rad of [{low}, {high}]", joint.name))
}

fn padded(angles: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(angles).for_each(|(slot, angle)| *slot = *angle);
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
