//! Robots from URDF files: the chain, the geometry that hangs on it, and what is said about the rest.
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::{Robot, Shape};
use taustream_motion::{JointArray, MAX_JOINTS};

fn robots() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/robots")
}

#[expect(clippy::panic, reason = "a helper of tests fails by panicking")]
fn load(name: &str) -> Robot {
    Robot::load(&robots().join(name)).unwrap_or_else(|faults| panic!("{faults}"))
}

fn pose(values: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    pose
}

fn pairs(robot: &Robot, list: &[(usize, usize)]) -> Vec<String> {
    list.iter().map(|(a, b)| format!("{}-{}", robot.links[*a], robot.links[*b])).collect()
}

#[test]
fn nasty_urdf_gives_the_joints_between_base_and_tip_in_its_own_order() {
    let robot = load("nasty.toml");
    let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["turn", "swing", "spin", "bend"]);
    assert_eq!(robot.ends, Some(["plinth".to_owned(), "tool0".to_owned()]));
    let ranges: Vec<[f64; 2]> = robot.joints.iter().map(|joint| joint.limits.position_rad).collect();
    assert_eq!(ranges, [[-2.5, 2.4], [-2.0, 2.0], [-6.0, 6.0], [-1.5, 1.9]], "given, stated, given, stated");
    let speeds: Vec<f64> = robot.joints.iter().map(|joint| joint.limits.motion.velocity_rad_s).collect();
    assert_eq!(speeds, [2.25, 1.5, 3.5, 3.0], "given above the URDF's, given, stated, stated");
    assert_eq!(robot.joints[0].limits.stop.acceleration_rad_s2.to_bits(), 25.0_f64.to_bits());
}

/// Goal: the URDF's effort is the joint's torque, 0 is none, and the robot file may state another; what a link weighs nothing
/// beside others that do is said.
#[test]
fn efforts_are_torques_and_links_without_mass_beside_others_are_named() {
    let nasty = load("nasty.toml");
    let torques: Vec<Option<f64>> = nasty.joints.iter().map(|joint| joint.torque_nm_max).collect();
    assert_eq!(torques, [Some(50.0), None, Some(10.0), Some(10.0)]);
    let mut balls = load("ur5_balls.toml");
    assert!(balls.joints.iter().all(|joint| joint.torque_nm_max == Some(150.0)));
    assert_eq!(balls.mass_doubt(), None);
    balls.masses.retain(|mass| mass.frame == balls.joints.len());
    let doubt = balls.mass_doubt().unwrap();
    assert!(doubt.contains("INCOMPLETE") && doubt.contains("upper_arm_link"), "{doubt}");
    balls.masses.clear();
    assert_eq!(balls.mass_doubt(), None, "nothing is computed from no masses");
}

/// The chain written out by hand, one origin after the other.
#[test]
fn nasty_tip_stands_where_its_origins_and_axes_say() {
    let robot = load("nasty.toml");
    let origin = |xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]| {
        Isometry3::from_parts(Translation3::from(xyz), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    };
    let turn = |axis: [f64; 3], angle_rad: f64| {
        let axis = nalgebra::Unit::new_normalize(Vector3::from(axis));
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, angle_rad))
    };
    for q in [[0.0; 4], [0.3, -1.1, 2.2, 0.9], [-2.0, 1.7, -5.0, -1.2]] {
        let hand = origin([0.0; 3], [0.0, 0.0, -0.7])
            * origin([0.01, 0.02, 0.15], [0.3, 0.2, -0.1])
            * turn([0.0, 0.0, -1.0], q[0])
            * origin([0.0, 0.05, 0.2], [-1.1, 0.6, 2.9])
            * origin([-0.04, 0.0, 0.03], [0.0; 3])
            * turn([1.0, 0.0, 0.0], q[1])
            * origin([0.0, 0.3, 0.02], [3.3, -0.9, 0.45])
            * turn([1.0, 2.0, -0.5], q[2])
            * origin([0.22, 0.05, 0.01], [6.0, 7.0, -8.0])
            * turn([-0.3, 0.1, 0.9], q[3]);
        let tip = hand * origin([0.01, -0.02, 0.12], [0.2, 0.3, 0.4]);
        let ours = robot.chain.frames(&pose(&q))[4];
        assert!((ours.to_homogeneous() - tip.to_homogeneous()).norm() < 1e-12, "{q:?}");
        // The camera hangs beside the tip, held at the lowest angle that it can have.
        let camera = robot.links.iter().position(|link| link == "camera").unwrap();
        let shape = robot.shapes.iter().find(|shape| shape.link == camera).unwrap();
        let here = robot.chain.frames(&pose(&q))[shape.frame] * shape.pose;
        let there = hand
            * origin([0.05, 0.0, 0.08], [0.0, 0.0, 0.5])
            * turn([0.0, 1.0, 0.0], 0.2)
            * origin([0.02, 0.0, 0.0], [0.0; 3]);
        assert!((here.to_homogeneous() - there.to_homogeneous()).norm() < 1e-12, "{q:?}");
    }
}

#[test]
fn geometry_of_each_link_goes_with_the_frame_that_carries_it() {
    let robot = load("nasty.toml");
    let frames = |name: &str| {
        let link = robot.links.iter().position(|link| link == name).unwrap();
        let of: Vec<usize> = robot.shapes.iter().filter(|s| s.link == link).map(|s| s.frame).collect();
        of
    };
    for (link, expected) in [
        ("plinth", vec![0]),
        ("base", vec![0]),
        ("column", vec![1, 1]),
        ("upper", vec![2]),
        ("fore", vec![3]),
        ("hand", vec![4]),
        ("palm", vec![4]),
        ("left_finger", vec![4]),
        ("camera", vec![4]),
    ] {
        assert_eq!(frames(link), expected, "{link}");
    }
    // What stands still stands where the root has it, seen from the base link.
    let plinth = robot.shapes.iter().find(|shape| robot.links[shape.link] == "plinth").unwrap();
    assert!((plinth.pose.translation.vector - Vector3::new(0.0, 0.0, -0.2)).norm() < 1e-12);
    assert_eq!(robot.masses.iter().map(|m| (m.frame, m.mass_kg)).collect::<Vec<_>>(), [(0, 4.5), (4, 0.4)]);
}

#[test]
fn moments_of_a_urdf_are_read_and_those_of_no_body_are_said_and_left_out() {
    let robot = load("nasty.toml");
    let moments: Vec<f64> = robot.masses.iter().map(|m| m.inertia_kg_m2.trace()).collect();
    assert_eq!(moments.len(), 2);
    assert!((moments[0] - 3.0).abs() < 1e-12 && moments[1] == 0.0, "{moments:?}");

    let folder = std::env::temp_dir().join(format!("taustream-urdf-moments-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let urdf = fs::read_to_string(robots().join("ur5_balls.urdf")).unwrap();
    // The upper arm's mass, and moments that no body has.
    let odd = urdf.replacen("0.28\"/><inertia ixx=\"0.01\"", "0.28\"/><inertia ixx=\"-0.5\"", 1);
    assert_ne!(odd, urdf);
    fs::write(folder.join("ur5_balls.urdf"), odd).unwrap();
    let toml = fs::read_to_string(robots().join("ur5_balls.toml")).unwrap();
    let payload = "payload = { mass_kg = 2.5, center_m = [0.0, 0.0, 0.1] }\n";
    let toml = format!("{payload}{toml}").replace("srdf = \"", &format!("srdf = \"{}/", robots().display()));
    let read = Robot::from_toml(&folder.join("ur5_balls.toml"), &toml);
    fs::remove_dir_all(&folder).unwrap();
    let robot = read.unwrap_or_else(|faults| panic!("{faults}"));
    assert!(robot.notices.iter().any(|n| n.contains("belong to no body")), "{:?}", robot.notices);
    let zeros = robot.masses.iter().filter(|m| m.inertia_kg_m2.trace() == 0.0);
    assert_eq!(
        zeros.map(|m| m.mass_kg).collect::<Vec<_>>(),
        [8.4, 2.5],
        "the odd one, and the payload's point"
    );
    let payload = robot.masses.last().unwrap();
    assert_eq!(
        (payload.frame, robot.links[payload.link].clone()),
        (6, robot.ends.clone().unwrap()[1].clone())
    );
}

#[test]
fn ignored_parts_of_a_urdf_are_reported() {
    let robot = load("nasty.toml");
    let all = robot.notices.join("\n");
    for words in [
        "joint \"left_finger_slide\" (prismatic) is not between base and tip: held at 0 m",
        "joint \"right_finger_slide\" (prismatic) is to follow joint \"left_finger_slide\", which is ignored: held at 0.005 m",
        "joint \"camera_tilt\" (revolute) is not between base and tip: held at 0.2 rad",
        "shell.obj counts as its convex hull",
        "link \"camera_cover\" has visual but no collision geometry",
        "joint \"turn\": motion.velocity_rad_s = 2.25 is above the URDF's limit of 2 rad/s",
        "link hand: its centre of mass (0.0341, -0.0010, -0.1172) m lies 0.0150 m OUTSIDE of its collision shapes",
    ] {
        assert!(all.contains(words), "{words:?} is missing in:\n{all}");
    }
    assert_eq!(robot.notices.len(), 7, "{all}");
    assert_eq!(robot.bare_links, ["world", "bracket_frame", "tool0", "camera_cover"]);
}

#[test]
fn contacts_come_from_file_srdf_and_rule_each_in_its_own_list() {
    let robot = load("nasty.toml");
    assert_eq!(pairs(&robot, &robot.allowed_by_file), ["palm-camera"]);
    let srdf = pairs(&robot, &robot.allowed_by_srdf);
    assert!(srdf.contains(&"hand-palm".to_owned()) && srdf.contains(&"upper-camera".to_owned()), "{srdf:?}");
    assert!(!srdf.contains(&"fore-camera".to_owned()), "enabled again: {srdf:?}");
    let rule = pairs(&robot, &robot.allowed_by_rule);
    // bracket_frame has no geometry, so column and upper are neighbours.
    for pair in [
        "plinth-base",
        "base-column",
        "column-upper",
        "upper-fore",
        "fore-hand",
        "hand-palm",
        "palm-left_finger",
    ] {
        assert!(rule.contains(&pair.to_owned()), "{pair} is missing in {rule:?}");
    }
    let index = |name: &str| robot.links.iter().position(|link| link == name).unwrap();
    assert!(
        robot.may_touch(index("camera"), index("upper")) && !robot.may_touch(index("camera"), index("fore"))
    );
    assert!(!robot.may_touch(index("base"), index("hand")));
}

#[test]
fn mesh_becomes_a_hull_that_holds_its_corners_and_is_scaled_and_mirrored() {
    let robot = load("nasty.toml");
    let hull = robot.shapes.iter().find_map(|shape| {
        let Shape::Hull { vertices_m, rounding_m, .. } = &shape.shape else { return None };
        Some((vertices_m.clone(), *rounding_m))
    });
    let (vertices_m, rounding_m) = hull.expect("a mesh");
    // Mirrored in z: from the wide ring at 0 down to the narrow one at -90 mm.
    let reach = |f: fn(&Point3<f64>) -> f64| vertices_m.iter().map(f).fold(f64::MIN, f64::max);
    assert!((reach(|v| -v.z) - 0.09).abs() < 1e-6 && reach(|v| v.z).abs() < 1e-6);
    assert!((reach(|v| v.x.hypot(v.y)) - 0.06).abs() < 1e-6 && rounding_m < 1e-3, "{rounding_m}");
}

/// Goal: whatever decides where the arm is or what it can hit changes the digest, and nothing else does.
#[test]
fn digest_follows_the_meaning_of_a_urdf_and_not_its_writing() {
    let text = fs::read_to_string(robots().join("ur5_balls.urdf")).unwrap();
    let srdf = fs::read_to_string(robots().join("ur5_balls.srdf")).unwrap();
    let robot = fs::read_to_string(robots().join("ur5_balls.toml")).unwrap();
    let folder = std::env::temp_dir().join(format!("taustream-urdf-digest-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let digest = |urdf: &str, srdf: &str| {
        fs::write(folder.join("ur5_balls.urdf"), urdf).unwrap();
        fs::write(folder.join("ur5_balls.srdf"), srdf).unwrap();
        Robot::from_toml(&folder.join("r.toml"), &robot)
            .unwrap_or_else(|faults| panic!("{faults}"))
            .digest_hex()
    };
    let mut seen = vec![digest(&text, &srdf)];
    for (from, to) in [
        ("0 0.13585 0", "0 0.13586 0"),
        ("radius=\"0.04\"", "radius=\"0.041\""),
        ("xyz=\"0 0.07 0\"", "xyz=\"0 0.07 0.01\""),
        ("<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 -1 0\"/>"),
        ("mass value=\"3.7\"", "mass value=\"3.8\""),
        ("name=\"palm\"", "name=\"hand\""),
        ("offset=\"0\"", "offset=\"0.01\""),
        ("rpy=\"0 0 1.57\"", "rpy=\"0 0 1.58\""),
    ] {
        let edited = text
            .replacen(from, to, 1)
            .replace("link=\"palm\"", if to.contains("hand") { "link=\"hand\"" } else { "link=\"palm\"" });
        assert_ne!(edited, text, "{from:?} stands nowhere");
        let srdf = if to.contains("hand") { srdf.replace("palm", "hand") } else { srdf.clone() };
        let new = digest(&edited, &srdf);
        assert!(!seen.contains(&new), "{from:?} -> {to:?} leaves the digest as it was");
        seen.push(new);
    }
    let fewer = digest(
        &text,
        &srdf.replace("<disable_collisions link1=\"wrist_2_link\" link2=\"palm\" reason=\"Never\"/>", ""),
    );
    assert!(!seen.contains(&fewer));
    let same = text
        .replace("rpy=\"0 0 0\"", "rpy=\"0.0 -0 0e3\"")
        .replace("<link name=\"table\"/>", "<!-- Oak. -->\n<link name=\"table\"></link>\n<gazebo/>");
    assert_ne!(same, text);
    assert_eq!(digest(&same, &srdf), seen[0]);
    fs::remove_dir_all(&folder).unwrap();
}

/// A part of the URDF of the UR5 has the shipped rows' kinematics, seen from another zero.
#[test]
fn ur5_of_balls_reaches_where_the_rows_of_the_ur5_reach() {
    let balls = load("ur5_balls.toml");
    let rows = Robot::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml")).unwrap();
    for i in 0..200 {
        let q: Vec<f64> = (0..6).map(|j| (f64::from(i) * 0.7 + f64::from(j) * 1.3).sin() * 3.0).collect();
        let (by_urdf, by_rows) = (balls.chain.frames(&pose(&q))[6], rows.chain.frames(&pose(&q))[6]);
        // The ROS description looks along +x where the rows look along -x, half a turn about the column.
        let half = Isometry3::rotation(Vector3::z() * std::f64::consts::PI);
        let gap_m = ((half * by_rows).translation.vector - by_urdf.translation.vector).norm();
        assert!(gap_m < 1e-9, "pose {i}: {gap_m:e} m apart");
    }
}

/// The robot of the published problems, where its file is at hand: it is not part of this project.
#[test]
fn ur5_spherized_of_the_published_problems_loads_and_knows_what_may_touch() {
    let Some(folder) = mbm() else { return };
    let toml = ur5_spherized(&folder);
    let robot = Robot::from_toml(&folder.join("ur5.toml"), &toml).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(
        (robot.joints.len(), robot.ends.clone()),
        (6, Some(["base_link".to_owned(), "tool0".to_owned()]))
    );
    assert!(robot.shapes.len() > 30 && robot.shapes.iter().all(|s| matches!(s.shape, Shape::Sphere { .. })));
    let index = |name: &str| robot.links.iter().position(|link| link == name).unwrap();
    assert!(robot.may_touch(index("wrist_2_link"), index("ee_link")));
    assert!(!robot.may_touch(index("base_link"), index("wrist_3_link")));
}

fn ur5_spherized(folder: &Path) -> String {
    let mut text = format!(
        "name = \"ur5_spherized\"\nurdf = {:?}\nsrdf = {:?}\nbase_link = \"base_link\"\ntip_link = \"tool0\"\n",
        folder.join("ur5_spherized.urdf"),
        folder.join("ur5.srdf")
    );
    for joint in ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"] {
        text += &format!(
            "[[joint]]\nname = \"{joint}_joint\"\nmotion = {{ acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }}\n"
        );
    }
    text
}

/// The folder of the published problems: `$TAUSTREAM_MBM_DIR`, or `shared/mbm` beside the project. Its absence is said.
fn mbm() -> Option<PathBuf> {
    let named = std::env::var_os("TAUSTREAM_MBM_DIR").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/mbm"));
    if folder.join("ur5_spherized.urdf").is_file() {
        return Some(folder);
    }
    eprintln!(
        "SKIPPED ur5_spherized: {} has no ur5_spherized.urdf; TAUSTREAM_MBM_DIR names another folder",
        folder.display()
    );
    None
}

/// An arm of two joints by a URDF 1.2.
#[expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]
fn two_joints(limit: &str, table: &str) -> Result<Robot, taustream_arm::Faults> {
    let folder = std::env::temp_dir().join(format!(
        "taustream-urdf-limits-{}-{:x}",
        std::process::id(),
        limit.len() * 1000 + table.len()
    ));
    fs::create_dir_all(&folder).unwrap();
    let joint = |name: &str, parent: &str, child: &str| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"0 0 0.3\"/>\
             <axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" {limit}/></joint><link name=\"{child}\"><collision><geometry>\
             <sphere radius=\"0.05\"/></geometry></collision></link>"
        )
    };
    let urdf = format!(
        "<robot name=\"two\" version=\"1.2\"><link name=\"l0\"/>{}{}</robot>",
        joint("j1", "l0", "l1"),
        joint("j2", "l1", "l2")
    );
    fs::write(folder.join("two.urdf"), urdf).unwrap();
    let text = format!(
        "name = \"two\"\nurdf = \"two.urdf\"\ntip_link = \"l2\"\n[[joint]]\nname = \"j1\"\n{table}\n[[joint]]\nname = \"j2\"\n{table}\n"
    );
    let read = Robot::from_toml(&folder.join("two.toml"), &text);
    fs::remove_dir_all(&folder).unwrap();
    read
}

#[test]
fn limits_of_urdf_1_2_are_used_where_the_file_gives_none_and_said_where_it_gives_more() {
    let stated = "velocity=\"1.5\" acceleration=\"4\" deceleration=\"3\" jerk=\"30\"";
    let robot = two_joints(stated, "").unwrap_or_else(|faults| panic!("{faults}"));
    let motion = robot.joints[1].limits.motion;
    let limits = [motion.velocity_rad_s, motion.acceleration_rad_s2, motion.jerk_rad_s3];
    assert_eq!(limits.map(f64::to_bits), [1.5, 3.0, 30.0].map(f64::to_bits), "{limits:?}");
    let words = robot.notices.join("\n");
    assert!(
        words.contains("stop.acceleration_rad_s2 = 6 is above the URDF's 3, stop.jerk_rad_s3 = 120"),
        "{words}"
    );

    let given = "motion = { acceleration_rad_s2 = 8.0, jerk_rad_s3 = 80.0 }";
    let robot = two_joints(stated, given).unwrap_or_else(|faults| panic!("{faults}"));
    let words = robot.notices.join("\n");
    for part in [
        "joint \"j1\": motion.acceleration_rad_s2 = 8 is above the URDF's limit of 3 rad/s^2",
        "joint \"j2\": motion.jerk_rad_s3 = 80 is above the URDF's limit of 30 rad/s^3",
    ] {
        assert!(words.contains(part), "{part:?} is missing in {words}");
    }
    let lower = "motion = { acceleration_rad_s2 = 1.0, jerk_rad_s3 = 7.0 }";
    let robot = two_joints(stated, lower).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(robot.notices, Vec::<String>::new());

    let faults = two_joints("velocity=\"1\" acceleration=\"0\" jerk=\"1e9\"", "").unwrap_err().to_string();
    assert!(faults.contains("joint[0].motion = missing"), "{faults}");
    let faults = two_joints("velocity=\"1\" acceleration=\"9\" jerk=\"1e9\"", "").unwrap_err().to_string();
    assert!(faults.contains("limit.jerk of the URDF"), "{faults}");
}
