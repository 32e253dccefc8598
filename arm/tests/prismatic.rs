//! Prismatic joints in robot files, in URDF, in the digest and in trajectory files.
use std::path::Path;
use taustream_arm::{Robot, TrajectoryFile};
use taustream_motion::{JointKind, MAX_JOINTS, Trajectory};

const LIFT: &str = "name = \"l\"\n\
    [[joint]]\nname = \"lift\"\nkind = \"prismatic\"\nlink_radius_m = 0.0\nposition_m = [-0.1, 0.5]\n\
    dh = { a_m = 0.1, alpha_rad = 0.0, d_m = 0.4, theta_offset_rad = 0.3 }\n\
    motion = { velocity_m_s = 0.25, acceleration_m_s2 = 1.0, jerk_m_s3 = 10.0 }\n\
    stop = { acceleration_m_s2 = 2.0, jerk_m_s3 = 40.0 }\nforce_n_max = 900.0\n\
    [[joint]]\nname = \"arm\"\nlink_radius_m = 0.0\nposition_rad = [-2.0, 2.0]\n\
    dh = { a_m = 0.5, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }\n\
    motion = { velocity_rad_s = 1.0, acceleration_rad_s2 = 2.0, jerk_rad_s3 = 20.0 }\n";

fn read(text: &str) -> Result<Robot, String> {
    Robot::from_toml(Path::new("l.toml"), text).map_err(|faults| faults.to_string())
}

fn file(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

#[test]
fn prismatic_row_slides_by_its_position_beyond_d() {
    let robot = read(LIFT).expect("a robot");
    let [lift, arm] = robot.joints.as_slice() else { panic!("two joints") };
    assert_eq!((lift.kind, arm.kind), (JointKind::Prismatic, JointKind::Revolute));
    assert_eq!((lift.limits.position_rad, lift.torque_nm_max), ([-0.1, 0.5], Some(900.0)));
    assert!((lift.limits.motion.velocity_rad_s - 0.25).abs() < 1e-15);
    let mut pose = [0.0; MAX_JOINTS];
    pose[0] = 0.2;
    let at = robot.chain.frame(1, &pose).translation.vector;
    let (sin, cos) = 0.3_f64.sin_cos();
    assert!(
        (at.x - 0.1 * cos).abs() < 1e-12 && (at.y - 0.1 * sin).abs() < 1e-12 && (at.z - 0.6).abs() < 1e-12
    );
    // 0.4 m of d and 0.5 m of stroke, and what counts as inside.
    assert!((robot.extension_m(0) - 0.901).abs() < 1e-12 && robot.extension_m(1) == 0.0);
}

#[test]
fn keys_of_the_other_kind_are_refused_with_what_to_write_instead() {
    for (from, to, words) in [
        (
            "position_m = [-0.1",
            "position_rad = [-0.1",
            &["position_rad", "position_m: the joint is prismatic", " m"][..],
        ),
        ("velocity_m_s", "velocity_rad_s", &["velocity_rad_s", "velocity_m_s: the joint is prismatic"]),
        (
            "stop = { acceleration_m_s2",
            "stop = { acceleration_rad_s2",
            &["acceleration_m_s2: the joint is prismatic"],
        ),
        ("force_n_max", "torque_nm_max", &["force_n_max: the joint is prismatic"]),
        (
            "position_rad = [-2.0",
            "position_m = [-2.0",
            &["position_rad: the joint is revolute, its numbers are in rad"],
        ),
        ("jerk_rad_s3", "jerk_m_s3", &["jerk_rad_s3: the joint is revolute"]),
        ("kind = \"prismatic\"", "kind = \"linear\"", &["kind = \"linear\"", "\"prismatic\" (m)"]),
        ("kind = \"prismatic\"\n", "", &["position_rad: the joint is revolute"]),
        (
            "link_radius_m = 0.0\nposition_m",
            "link_radius_m = 0.1\nposition_m",
            &["link_capsules", "changes its length"],
        ),
        ("position_m = [-0.1, 0.5]", "position_m = [-100, 500]", &["-20 to 20 m"]),
        ("velocity_m_s = 0.25", "velocity_m_s = 250", &["20 m/s"]),
    ] {
        assert!(LIFT.contains(from), "{from}");
        let faults = read(&LIFT.replacen(from, to, 1)).expect_err(to);
        assert!(words.iter().all(|word| faults.contains(word)), "{to}: {faults}");
    }
}

#[test]
fn poses_of_joints_of_both_kinds_are_in_their_own_units() {
    let pose = |key: &str| format!("{LIFT}[[pose]]\nname = \"up\"\n{key} = [0.4, 1.0]\n");
    let robot = read(&pose("position")).expect("a robot");
    assert!((robot.pose("up").expect("a pose")[0] - 0.4).abs() < 1e-15);
    let faults = read(&pose("position_rad")).expect_err("rad of a lift");
    assert!(faults.contains("position, one number a joint, in m, rad"), "{faults}");
    let faults = read(&pose("position").replace("[0.4, 1.0]", "[0.7, 1.0]")).expect_err("outside");
    assert!(faults.contains("0.7 m of [-0.1, 0.5]"), "{faults}");
}

/// Goal: the same numbers for a joint that turns are another robot.
#[test]
fn kind_of_a_joint_is_in_the_digest() {
    let turning = LIFT
        .replace("kind = \"prismatic\"\n", "")
        .replace("position_m", "position_rad")
        .replace("_m_s", "_rad_s")
        .replace("force_n_max", "torque_nm_max");
    let (slides, turns) = (read(LIFT).expect("a robot"), read(&turning).expect("a robot"));
    assert_eq!(slides.limits(), turns.limits());
    assert_ne!(slides.digest, turns.digest);
}

#[test]
fn urdf_with_prismatic_joints_is_read_with_its_limits() {
    let robot = Robot::load(&file("tests/robots/gantry.toml")).expect("a robot");
    let kinds: Vec<JointKind> = robot.joints.iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds, [JointKind::Prismatic, JointKind::Revolute, JointKind::Prismatic, JointKind::Revolute]);
    assert!((0..4).all(|joint| robot.chain.kind(joint) == kinds[joint]));
    let [slide, _, telescope, _] = robot.joints.as_slice() else { panic!("four joints") };
    assert_eq!((slide.limits.position_rad, slide.torque_nm_max), ([-1.0, 1.0], Some(900.0)));
    assert!((slide.limits.motion.velocity_rad_s - 0.8).abs() < 1e-15);
    let [low, high] = telescope.limits.position_rad;
    assert!(low.abs() < 1e-15 && (high - 0.6).abs() < 1e-15, "narrowed by the robot file: {low} to {high}");
    // The axis of a URDF need not have unit length; the joint moves by its position all the same.
    let mut pose = [0.0; MAX_JOINTS];
    let at = |pose: &[f64; MAX_JOINTS]| robot.chain.frame(1, pose).translation.vector;
    let before = at(&pose);
    pose[0] = 0.35;
    assert!(((at(&pose) - before).norm() - 0.35).abs() < 1e-12);
}

#[test]
fn numbers_of_a_urdf_that_are_changed_keep_their_units() {
    let path = file("tests/robots/gantry.toml");
    let text = std::fs::read_to_string(&path).expect("a file");
    let read = |text: &str| Robot::from_toml(&path, text).map_err(|faults| faults.to_string());
    for (from, to, words) in [
        ("position_m = [0.0, 0.6]", "position_m = [0.0, 0.9]", "a range inside the URDF's [0.0, 0.7]"),
        ("position_m = [0.0, 0.6]", "position_rad = [0.0, 0.6]", "position_m: the joint is prismatic"),
        ("acceleration_m_s2 = 2.0", "acceleration_rad_s2 = 2.0", "acceleration_m_s2: the joint is prismatic"),
        ("name = \"slide\"", "name = \"slide\"\nkind = \"revolute\"", "no such key beside `urdf`"),
    ] {
        assert!(text.contains(from), "{from}");
        let faults = read(&text.replacen(from, to, 1)).expect_err(to);
        assert!(faults.contains(words), "{to}: {faults}");
    }
    let robot = read(&text.replacen("position_m = [0.0, 0.6]", "force_n_max = 400.0", 1)).expect("a robot");
    assert!(
        robot.notices.iter().any(|n| n.contains("force_n_max = 400 is above the URDF's effort of 300 N"))
    );
}

#[test]
fn trajectory_file_of_a_lift_says_which_numbers_are_metres() {
    let robot = read(LIFT).expect("a robot");
    let trajectory = Trajectory::new(2, [0.0; MAX_JOINTS], &[]).expect("rest");
    let file = TrajectoryFile { robot: "l".into(), digest: None, kinds: robot.kinds(), trajectory };
    let text = file.to_json();
    assert!(text.contains("\"units\":[\"m\",\"rad\"]"), "{text}");
    let path = Path::new("m.json");
    assert_eq!(TrajectoryFile::from_json(path, &text).expect("reads"), file);
    for bad in ["[\"m\"]", "[\"m\",\"deg\"]", "\"m\"", "[1,2]"] {
        let faults = TrajectoryFile::from_json(path, &text.replace("[\"m\",\"rad\"]", bad))
            .expect_err(bad)
            .to_string();
        assert!(faults.contains("units"), "{bad}: {faults}");
    }
    let turning = TrajectoryFile { kinds: [JointKind::Revolute; MAX_JOINTS], ..file };
    assert!(!turning.to_json().contains("units"));
}
