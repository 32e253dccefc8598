//! Every file in config/ loads, and says what its documents say.
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use taustream_arm::body::{Body, to_parry};
use taustream_arm::{BusKind, Obstacle, Robot, Scene, Settings, Shape};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS, joint_array};

fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
}

fn files_of(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(config().join(folder)).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.sort();
    files
}

#[test]
fn shipped_file_of_every_kind_loads() {
    let (robots, scenes, settings) = (files_of("robots"), files_of("scenes"), files_of("settings"));
    for file in robots.iter().filter(|file| file.extension().is_some_and(|e| e == "toml")) {
        assert!(Robot::load(file).is_ok_and(|robot| robot.file == *file), "{:?}", Robot::load(file).err());
    }
    for file in scenes.iter().filter(|file| file.extension().is_some_and(|e| e == "toml")) {
        Scene::load(file).unwrap_or_else(|faults| panic!("{faults}"));
    }
    for file in &settings {
        Settings::load(file).unwrap_or_else(|faults| panic!("{faults}"));
    }
    // An empty folder would make this pass without a look at anything.
    assert!(
        !robots.is_empty() && scenes.len() >= 3 && !settings.is_empty(),
        "{robots:?} {scenes:?} {settings:?}"
    );
}

/// Goal: the rows are read in the vendor's convention, and the file holds the vendor's numbers.
/// Method: the vendor's own check of the pose with all joints at 0, for the newer arms and, with two offsets changed, the older,
/// whose pose is quoted in whole millimetres (the rows give 203.4 for its 205).
#[test]
fn piper_with_all_joints_at_zero_has_its_flange_where_the_vendor_says() {
    let file = config().join("robots/piper.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let older = text.replacen("-3.0058060377846343", "-3.040712622824521", 1).replacen(
        "-1.793849405199772",
        "-1.7589428201598853",
        1,
    );
    assert_eq!(text.matches("-3.040712622824521").count(), 1, "the older offsets stand in the comment alone");
    for (text, at_mm, slack_mm) in [(text, [56.1, 213.3], 0.05), (older, [55.0, 205.0], 2.0)] {
        let robot = Robot::from_toml(&file, &text).unwrap_or_else(|faults| panic!("{faults}"));
        let flange = robot.chain.frames(&[0.0; MAX_JOINTS])[6];
        let [x, y, z] = flange.translation.vector.into();
        let gap_mm = (x * 1e3 - at_mm[0]).abs().max((z * 1e3 - at_mm[1]).abs()).max(y.abs() * 1e3);
        assert!(gap_mm < slack_mm, "{x} {y} {z}: {gap_mm} mm off");
        let ahead = flange.rotation * nalgebra::Vector3::z();
        assert!((ahead.x.atan2(ahead.z).to_degrees() - 85.0).abs() < 0.01, "{ahead}");
    }
}

#[test]
fn ur5_contact_rule_lets_neighbours_and_base_and_upper_arm_touch() {
    let robot = Robot::load(&config().join("robots/ur5.toml")).unwrap();
    let mut expected: Vec<(usize, usize)> = (0..6).map(|link| (link, link + 1)).collect();
    // The shoulder's end of the upper arm is beside the base in every pose.
    expected.push((0, 2));
    expected.sort_unstable();
    assert_eq!(robot.allowed_by_rule, expected);
    assert_eq!(Robot::load(&robot.file).unwrap(), robot, "the rule draws the same poses every time");
    for (one, other, may) in [(6, 4, true), (4, 6, true), (3, 5, true), (6, 3, false), (2, 4, false)] {
        assert_eq!(robot.may_touch(one, other), may, "link{one} and link{other}");
    }
}

#[test]
fn vcan6_binds_six_servos_in_joint_order_to_one_virtual_bus() {
    let settings = Settings::load(&config().join("settings/vcan6.toml")).unwrap();
    assert_eq!(settings.servos.len(), 6);
    for (i, servo) in settings.servos.iter().enumerate() {
        assert_eq!((servo.joint, servo.bus, usize::from(servo.node_id)), (i, 0, i + 1));
    }
    assert_eq!(settings.buses[0].kind, BusKind::Virtual);
    assert_eq!((settings.buses[0].interface.as_str(), settings.cycle.period_us), ("vcan0", 1000));
    assert_eq!(settings.robot.name, "ur5");
}

#[expect(clippy::panic, clippy::expect_used, reason = "a helper of tests fails by panicking")]
/// Distance from a point to the surface of an obstacle (below 0 inside), from the definition of each shape.
fn distance_m(obstacle: &Obstacle, point: &Point3<f64>) -> f64 {
    let local = obstacle.pose.inverse_transform_point(point);
    let box_distance_m = |excess: &[f64]| {
        let outside = excess.iter().map(|e| e.max(0.0).powi(2)).sum::<f64>().sqrt();
        outside + excess.iter().fold(f64::NEG_INFINITY, |most, e| most.max(*e)).min(0.0)
    };
    let radial_m = local.x.hypot(local.y);
    match &obstacle.shape {
        Shape::Sphere { radius_m } => local.coords.norm() - radius_m,
        Shape::Box { size_m } => {
            box_distance_m(&[0, 1, 2].map(|axis| local[axis].abs() - 0.5 * size_m[axis]))
        }
        Shape::Cylinder { radius_m, length_m } => {
            box_distance_m(&[radial_m - radius_m, local.z.abs() - 0.5 * length_m])
        }
        Shape::Capsule { radius_m, length_m } => {
            radial_m.hypot((local.z.abs() - 0.5 * length_m).max(0.0)) - radius_m
        }
        Shape::Mesh { .. } => {
            let mesh = Body::new(&obstacle.shape, &obstacle.pose).expect("a mesh");
            let at = Pose::translation(point.x, point.y, point.z);
            let point = Body::new(&Shape::Sphere { radius_m: 0.0 }, &at).expect("a point");
            let here = to_parry(&Pose::identity());
            mesh.distance_m(&mesh.placed(&here), &point, &point.placed(&here))
        }
        Shape::Hull { .. } | Shape::Cloud(_) => panic!("shipped scenes have none"),
    }
}

#[expect(clippy::expect_used, reason = "a helper of tests fails by panicking")]
/// Least distance of each link to any obstacle, by points along the capsules' axes.
fn clearances_m(robot: &Robot, scene: &Scene, pose: &JointArray) -> Vec<(usize, String, f64)> {
    const POINTS: u32 = 200;
    let frames = robot.chain.frames(pose);
    let mut found = Vec::new();
    for shape in &robot.shapes {
        let (ends, radius_m) = shape.segment().expect("links are capsules");
        for obstacle in &scene.obstacles {
            let point = |i: u32| {
                frames[shape.frame] * (ends[0] + (ends[1] - ends[0]) * (f64::from(i) / f64::from(POINTS)))
            };
            let least_m = (0..=POINTS).map(|i| distance_m(obstacle, &point(i))).fold(f64::INFINITY, f64::min);
            found.push((shape.link, obstacle.name.clone(), least_m - radius_m));
        }
    }
    found
}

#[test]
fn shipped_scene_leaves_common_poses_of_the_ur5_free_and_its_foot_always() {
    let robot = Robot::load(&config().join("robots/ur5.toml")).unwrap();
    for file in files_of("scenes").into_iter().filter(|file| file.extension().is_some_and(|e| e == "toml")) {
        let scene = Scene::load(&file).unwrap();
        for pose in COMMON_POSES {
            for (link, obstacle, clearance_m) in clearances_m(&robot, &scene, &pose) {
                let at = file.display();
                assert!(
                    clearance_m > scene.margin_m,
                    "{at}: link {link} and {obstacle}: {clearance_m:.3} m at {pose:?}"
                );
            }
        }
        // The first link only turns about its own axis: it must be free whatever the arm does.
        let foot =
            clearances_m(&robot, &scene, &[0.0; MAX_JOINTS]).into_iter().filter(|(link, ..)| *link == 1);
        assert!(
            foot.map(|(.., clearance_m)| clearance_m).all(|clearance_m| clearance_m > 0.05),
            "{}",
            file.display()
        );
    }
}

/// A scene that nothing has to go round shows nothing: swinging a stretched arm from one gap to the next must hit.
#[test]
fn pillars_stand_in_the_way_of_the_straight_swing_between_their_gaps() {
    let robot = Robot::load(&config().join("robots/ur5.toml")).unwrap();
    let scene = Scene::load(&config().join("scenes/pillars.toml")).unwrap();
    let reach = |pan_rad: f64| joint_array([pan_rad, -0.9, 0.9, -1.57, -1.57, 0.0]);
    let least = |pose: &JointArray| {
        clearances_m(&robot, &scene, pose).into_iter().min_by(|a, b| a.2.total_cmp(&b.2)).unwrap()
    };
    for (from_rad, to_rad, obstacle) in [
        (GAPS_RAD[0], GAPS_RAD[1], "left_pillar"),
        (GAPS_RAD[1], GAPS_RAD[2], "front_pillar"),
        (GAPS_RAD[2], GAPS_RAD[3], "right_ball"),
    ] {
        for end_rad in [from_rad, to_rad] {
            let (link, name, clearance_m) = least(&reach(end_rad));
            assert!(
                clearance_m > scene.margin_m,
                "pan {end_rad}: link {link} and {name}: {clearance_m:.3} m"
            );
        }
        let on_the_way =
            (1..100).map(|i| least(&reach(from_rad + (to_rad - from_rad) * f64::from(i) / 100.0)));
        let (_, name, clearance_m) = on_the_way.min_by(|a, b| a.2.total_cmp(&b.2)).unwrap();
        assert!(name == obstacle && clearance_m < -0.02, "{from_rad} to {to_rad}: {name} {clearance_m:.3} m");
    }
}

/// First joint's angles at which the stretched arm points into a gap, from +y to -y.
const GAPS_RAD: [f64; 4] = [-1.7, -0.65, 0.3, 1.5];

/// Straight up; the usual working pose, straight and to each side; the help's example; folded; reaching up and forward.
const COMMON_POSES: [JointArray; 7] = [
    joint_array([0.0, -1.57, 0.0, -1.57, 0.0, 0.0]),
    joint_array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]),
    joint_array([0.8, -1.57, 1.57, -1.57, -1.57, 0.0]),
    joint_array([-0.8, -1.57, 1.57, -1.57, -1.57, 0.0]),
    joint_array([1.2, -1.3, 1.4, -1.6, -1.57, 0.0]),
    joint_array([0.0, -2.2, 2.2, -1.57, -1.57, 0.0]),
    joint_array([0.0, -1.2, 0.6, -1.57, -1.57, 0.0]),
];
