//! Robots with several tips: a torso that turns and carries two arms, its groups, and what is refused.
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;
use taustream_arm::Robot;
use taustream_motion::MAX_JOINTS;

const URDF: &str = r#"<robot name="torso">
  <link name="floor"/>
  <joint name="stand" type="fixed"><parent link="floor"/><child link="base"/><origin xyz="0 0 0.1"/></joint>
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <joint name="waist" type="revolute"><parent link="base"/><child link="torso"/>
    <origin xyz="0 0 0.2"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <link name="torso"><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="left_plate" type="fixed"><parent link="torso"/><child link="left_mount"/><origin xyz="0 0.2 0.3" rpy="-0.3 0 0"/></joint>
  <link name="left_mount"/>
  <joint name="left_shoulder" type="revolute"><parent link="left_mount"/><child link="left_arm"/>
    <origin xyz="0 0.1 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <link name="left_arm"><collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.04"/></geometry></collision></link>
  <joint name="left_wrist" type="revolute"><parent link="left_arm"/><child link="left_hand"/>
    <origin xyz="0.3 0 0"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <link name="left_hand"><collision><geometry><sphere radius="0.04"/></geometry></collision></link>
  <joint name="left_flange" type="fixed"><parent link="left_hand"/><child link="left_tcp"/><origin xyz="0.1 0 0" rpy="0 0.5 0"/></joint>
  <link name="left_tcp"/>
  <joint name="left_eye_plate" type="fixed"><parent link="left_hand"/><child link="left_eye"/><origin xyz="0 0 0.05"/></joint>
  <link name="left_eye"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
  <joint name="right_shoulder" type="revolute"><parent link="torso"/><child link="right_arm"/>
    <origin xyz="0 -0.3 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="9"/></joint>
  <link name="right_arm"><collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.04"/></geometry></collision></link>
  <joint name="right_flange" type="fixed"><parent link="right_arm"/><child link="right_tcp"/><origin xyz="0.2 0 0"/></joint>
  <link name="right_tcp"/>
</robot>"#;

const TIPS: &str = "tip_links = [\"left_tcp\", \"right_tcp\"]\n";
const GROUPS: &str = "[[group]]\nname = \"left\"\ntip_link = \"left_tcp\"\n\
                      [[group]]\nname = \"right\"\njoints = [\"right_shoulder\"]\n";
const NAMES: [&str; 4] = ["waist", "left_shoulder", "left_wrist", "right_shoulder"];

/// A robot file beside the URDF, with these tips, and these tables behind the joints'.
#[expect(clippy::unwrap_used, reason = "a helper of tests fails by panicking")]
fn load(tips: &str, joints: &[&str], tables: &str) -> Result<Robot, String> {
    // Written once: a file that is read while it is written is cut short.
    static DIR: OnceLock<PathBuf> = OnceLock::new();
    let dir = DIR.get_or_init(|| {
        let dir = std::env::temp_dir().join(format!("taustream-groups-{}", std::process::id()));
        fs::create_dir_all(&dir).unwrap();
        fs::write(dir.join("torso.urdf"), URDF).unwrap();
        dir
    });
    let joint = |name: &&str| {
        format!("[[joint]]\nname = \"{name}\"\nmotion = {{ acceleration_rad_s2 = 5, jerk_rad_s3 = 50 }}\n")
    };
    let joints: String = joints.iter().map(joint).collect();
    let text = format!("name = \"torso\"\nurdf = \"torso.urdf\"\n{tips}{joints}{tables}");
    Robot::from_toml(&dir.join("torso.toml"), &text).map_err(|faults| faults.to_string())
}

fn torso(tables: &str) -> Result<Robot, String> {
    load(TIPS, &NAMES, tables)
}

#[test]
fn tree_of_a_urdf_has_the_joints_of_all_paths_once_and_each_tip_its_frame() {
    let robot = torso(GROUPS).unwrap();
    let names: Vec<&str> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, NAMES);
    let chain = &robot.chain;
    assert_eq!((0..4).map(|joint| chain.parent_frame(joint)).collect::<Vec<_>>(), [0, 1, 2, 1]);
    let tips: Vec<(&str, usize)> = robot.tips.iter().map(|tip| (tip.name.as_str(), tip.frame)).collect();
    assert_eq!((tips.as_slice(), chain.tips()), (&[("left_tcp", 3), ("right_tcp", 4)][..], &[3, 4][..]));
    assert!(chain.moves(0, 4) && !chain.moves(1, 4) && !chain.moves(3, 3));
    let groups: Vec<(&str, &[usize], Option<usize>)> =
        robot.groups.iter().map(|g| (g.name.as_str(), g.joints.as_slice(), g.tip)).collect();
    // The waist moves both tips: it belongs to neither arm.
    assert_eq!(groups, [("left", &[1, 2][..], Some(0)), ("right", &[3][..], Some(1))]);
    assert_eq!(robot.groups[0].others(4), 0b1001);
}

/// The chain written out by hand, one origin after the other; and a camera beside the tip, in the tip's frame.
#[test]
fn tips_and_what_hangs_beside_them_stand_where_their_origins_and_axes_say() {
    let robot = torso("").unwrap();
    let mut q = [0.0; MAX_JOINTS];
    q[..4].copy_from_slice(&[0.4, -0.7, 1.1, 0.9]);
    let shift = |x, y, z| Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
    let turn = |axis: Vector3<f64>, angle: f64| {
        let turn = UnitQuaternion::from_scaled_axis(axis * angle);
        Isometry3::from_parts(Translation3::identity(), turn)
    };
    let torso_at = shift(0.0, 0.0, 0.3) * turn(Vector3::z(), q[0]);
    let left_arm = torso_at
        * shift(0.0, 0.2, 0.3)
        * turn(Vector3::x(), -0.3)
        * shift(0.0, 0.1, 0.0)
        * turn(Vector3::y(), q[1]);
    let left_hand = left_arm * shift(0.3, 0.0, 0.0) * turn(Vector3::z(), q[2]);
    let left_tcp = left_hand * shift(0.1, 0.0, 0.0) * turn(Vector3::y(), 0.5);
    let right_tcp = torso_at * shift(0.0, -0.3, 0.3) * turn(Vector3::y(), q[3]) * shift(0.2, 0.0, 0.0);
    let frames = robot.chain.frames(&q);
    for (name, frame, expected) in [
        ("torso", 1, torso_at),
        ("left arm", 2, left_arm),
        ("left tip", 3, left_tcp),
        ("right tip", 4, right_tcp),
    ] {
        let gap = (frames[frame].to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(gap < 1e-12, "{name}: {gap:e}");
    }
    let eye = robot.links.iter().position(|link| link == "left_eye").unwrap();
    let shape = robot.shapes.iter().find(|shape| shape.link == eye).unwrap();
    let gap = (frames[shape.frame] * shape.pose).translation.vector
        - (left_hand * shift(0.0, 0.0, 0.05)).translation.vector;
    assert!(gap.norm() < 1e-12, "{gap}");
    // One tip of the same file is a serial arm, and the other arm stands still with the torso.
    let left = load("tip_link = \"left_tcp\"\n", &NAMES[..3], "").unwrap();
    assert!(left.chain.is_serial() && left.groups.is_empty() && left.tips.len() == 1);
    let gap = (left.chain.frames(&q)[3].to_homogeneous() - left_tcp.to_homogeneous()).amax();
    assert!(gap < 1e-12, "{gap:e}");
}

#[test]
fn digest_covers_tips_and_groups() {
    let digests = [
        torso("").unwrap().digest,
        torso(GROUPS).unwrap().digest,
        torso(&GROUPS.replace("\"right\"", "\"other\"")).unwrap().digest,
        torso(&GROUPS.replace("[\"right_shoulder\"]", "[\"waist\", \"right_shoulder\"]")).unwrap().digest,
        load("tip_links = [\"right_tcp\", \"left_tcp\"]\n", &NAMES, "").unwrap().digest,
    ];
    for (i, digest) in digests.iter().enumerate() {
        assert!(!digests[..i].contains(digest), "digest {i} is another's");
    }
}

#[test]
fn poses_of_a_group_have_its_values_and_a_name_that_others_may_have() {
    let pose = |group: &str, name: &str, angles: &str| {
        format!("[[pose]]\nname = \"{name}\"\n{group}position_rad = {angles}\n")
    };
    let left = pose("group = \"left\"\n", "home", "[0.5, -0.5]");
    let tables = [
        GROUPS,
        &left,
        &pose("group = \"right\"\n", "home", "[1.5]"),
        &pose("", "home", "[0, 0.1, 0.2, 0.3]"),
    ];
    let robot = torso(&tables.concat()).unwrap();
    assert_eq!(robot.poses.iter().map(|pose| pose.group).collect::<Vec<_>>(), [Some(0), Some(1), None]);
    assert_eq!(robot.poses[0].position_rad[..4], [0.0, 0.5, -0.5, 0.0]);
    assert_eq!(robot.poses[1].position_rad[..4], [0.0, 0.0, 0.0, 1.5]);
    assert_eq!(robot.pose("home").unwrap()[..4], [0.0, 0.1, 0.2, 0.3], "the pose of all joints");
    for (tables, words) in [
        (format!("{GROUPS}{left}{left}"), "each pose's name once"),
        (
            format!("{GROUPS}{}", pose("group = \"middle\"\n", "a", "[0]")),
            "a [[group]] of the file: \"left\", \"right\"",
        ),
        (pose("group = \"left\"\n", "a", "[0]"), "the file has none"),
        (format!("{GROUPS}{}", pose("group = \"left\"\n", "a", "[0, 0, 0]")), "a list of 2 numbers"),
        (format!("{GROUPS}{}", pose("group = \"right\"\n", "a", "[2.5]")), "every joint inside its limits"),
    ] {
        let faults = torso(&tables).unwrap_err();
        assert!(faults.contains(words), "{tables}: {faults}");
    }
}

#[test]
fn robot_that_holds_some_joints_lets_only_the_others_move() {
    let robot = torso(GROUPS).unwrap();
    let mut at = [0.0; MAX_JOINTS];
    at[..4].copy_from_slice(&[0.1, 0.2, 0.3, 0.4]);
    let holding = robot.holding(robot.groups[1].others(4), &at);
    let ranges: Vec<[f64; 2]> = holding.joints.iter().map(|joint| joint.limits.position_rad).collect();
    assert_eq!(ranges, [[0.1, 0.1], [0.2, 0.2], [0.3, 0.3], [-2.0, 2.0]]);
    assert_eq!((holding.digest, &holding.groups), (robot.digest, &robot.groups));
}

#[test]
fn tips_and_groups_that_make_no_sense_are_refused_with_key_and_remedy() {
    let with = |tips: &str| load(tips, &NAMES, "");
    for (made, words) in [
        (with(""), "tip_link"),
        (with("tip_links = []\n"), "a list of links, each once"),
        (with("tip_links = [1]\n"), "a list of links"),
        (with("tip_links = [\"left_tcp\", \"left_tcp\"]\n"), "each tip once"),
        (with("tip_links = [\"left_tcp\", \"nose\"]\n"), "nose"),
        (with("tip_links = [\"left_tcp\", \"base\"]\n"), "a link that a joint moves against the base"),
        (with("tip_links = [\"left_tcp\", \"left_eye\"]\n"), "rigid with each other"),
        (with("tip_link = \"left_tcp\"\ntip_links = [\"right_tcp\"]\n"), "one of the two"),
        (load(TIPS, &NAMES[..3], ""), "right_shoulder"),
        (torso("[[group]]\nname = \"a\"\n"), "the tip that the group leads"),
        (
            torso("[[group]]\nname = \"a\"\ntip_link = \"nose\"\n"),
            "a tip of the robot: \"left_tcp\", \"right_tcp\"",
        ),
        (torso("[[group]]\nname = \"a\"\njoints = [\"knee\"]\n"), "joints of the robot: \"waist\""),
        (torso("[[group]]\nname = \"a\"\njoints = []\n"), "a list of names of joints"),
        (torso("[[group]]\nname = \"a\"\njoints = [\"waist\", \"waist\"]\n"), "each joint once"),
        (torso("[[group]]\njoints = [\"waist\"]\n"), "group[0].name"),
        (torso("[[group]]\nname = \"a\"\njoints = [\"waist\"]\nspeed = 1\n"), "speed"),
        (torso(&format!("{GROUPS}{GROUPS}")), "each group's name once"),
        (
            torso(&format!("{GROUPS}[[group]]\nname = \"both\"\njoints = [\"waist\", \"left_wrist\"]\n")),
            "\"left_wrist\" is in group \"left\" already",
        ),
    ] {
        let faults = made.err().unwrap_or_else(|| panic!("accepted, without {words}"));
        assert!(faults.contains(words), "without {words}: {faults}");
    }
    let payload = load(&format!("{TIPS}payload = {{ mass_kg = 1.0, center_m = [0, 0, 0] }}\n"), &NAMES, "");
    assert!(payload.unwrap_err().contains("one tip"));
}
