//! Shapes of links: the shipped arms' hold the real ones, and what has none is refused or named.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use taustream_arm::body::{Body, to_parry};
use taustream_arm::{LinkShape, Robot, Shape};
use taustream_motion::MAX_JOINTS;

fn shipped(name: &str) -> (PathBuf, String) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../config/robots/{name}.toml"));
    let text = std::fs::read_to_string(&file).expect("shipped files are readable");
    (file, text)
}

fn load(name: &str) -> Robot {
    let (file, text) = shipped(name);
    Robot::from_toml(&file, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

/// Distance of a point, in a link's frame, to the nearest axis of the link's capsules, less the radius.
fn outside_m(robot: &Robot, link: usize, point: &Point3<f64>) -> f64 {
    let capsules = robot.shapes.iter().filter(|shape| shape.link == link).map(LinkShape::segment);
    let to_capsule_m = |segment: Option<([Point3<f64>; 2], f64)>| {
        let ([a, b], radius_m) = segment.expect("shipped links are capsules");
        let along = b - a;
        let share = if along.norm() > 0.0 { (point - a).dot(&along) / along.norm_squared() } else { 0.0 };
        (point - (a + along * share.clamp(0.0, 1.0))).norm() - radius_m
    };
    capsules.map(to_capsule_m).fold(f64::INFINITY, f64::min)
}

/// Goal: the capsules of the shipped UR5 hold the real links.
/// Method: the balls of the public UR5 of the `MotionBenchMaker` problems, which are not part of this project; with all joints at 0 its
/// links stand where ours do, turned by half a turn about the column.
#[test]
fn ur5_capsules_hold_the_balls_of_the_public_ur5() {
    let named = std::env::var_os("TAUSTREAM_MBM_DIR").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/mbm"));
    if !folder.join("ur5_spherized.urdf").is_file() {
        let folder = folder.display();
        eprintln!(
            "SKIPPED ur5_spherized: {folder} has no ur5_spherized.urdf; TAUSTREAM_MBM_DIR names another folder"
        );
        return;
    }
    let joint = |name: &str| {
        format!(
            "[[joint]]\nname = \"{name}_joint\"\nmotion = {{ acceleration_rad_s2 = 9.0, jerk_rad_s3 = 90.0 }}\n"
        )
    };
    let joints =
        ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"].map(joint).concat();
    let text = format!(
        "name = \"ur5_spherized\"\nurdf = \"ur5_spherized.urdf\"\nsrdf = \"ur5.srdf\"\nbase_link = \"base_link\"\ntip_link = \"tool0\"\n{joints}"
    );
    let public =
        Robot::from_toml(&folder.join("public.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"));
    let ours = load("ur5");
    let turned =
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_euler_angles(0.0, 0.0, PI));
    let names = [
        "base_link",
        "shoulder_link",
        "upper_arm_link",
        "forearm_link",
        "wrist_1_link",
        "wrist_2_link",
        "wrist_3_link",
    ];
    let (theirs_at, ours_at) =
        (public.chain.frames(&[0.0; MAX_JOINTS]), ours.chain.frames(&[0.0; MAX_JOINTS]));
    let mut balls = 0;
    for (link, name) in names.iter().enumerate() {
        let at = public.links.iter().position(|other| other == name).expect("a link of the public UR5");
        for shape in public.shapes.iter().filter(|shape| shape.link == at) {
            let Shape::Sphere { radius_m } = shape.shape else { panic!("a ball") };
            let centre = turned * theirs_at[shape.frame] * shape.pose * Point3::origin();
            let out_m = outside_m(&ours, link, &(ours_at[link].inverse() * centre)) + radius_m;
            assert!(out_m <= 0.0, "{name}: a ball at {centre} stands {out_m} m out of our capsules");
            balls += 1;
        }
    }
    assert_eq!(balls, 23, "every ball of the seven links was looked at");
}

#[test]
fn centre_of_mass_outside_of_its_link_is_said() {
    let (file, text) = shipped("ur5");
    let robot = load("ur5");
    assert_eq!(robot.notices, Vec::<String>::new());
    assert_eq!(robot.bare_links, Vec::<String>::new(), "base and all links have shapes");
    for mass in &robot.masses {
        let out_m = outside_m(&robot, mass.link, &mass.center_m);
        assert!(out_m < -0.02, "link {}: {out_m} m", mass.link);
    }
    // As it was before the capsules were fitted: a capsule along the row of the upper arm.
    let own = "link_capsules = [\n    { from_m = [0.0, 0.0, 0.1315], to_m = [0.425, 0.0, 0.1315], radius_m = 0.085 },\n]";
    assert!(text.contains(own));
    let along = text.replacen(own, "link_radius_m = 0.06", 1);
    let robot = Robot::from_toml(&file, &along).unwrap_or_else(|faults| panic!("{faults}"));
    let [notice] = robot.notices.as_slice() else { panic!("{:?}", robot.notices) };
    assert!(
        notice.starts_with("link link2: its centre of mass (0.2125, 0.0000, 0.1134) m lies 0.0534 m OUTSIDE"),
        "{notice}"
    );
}

/// Goal: the pose that the vendor calls zero is one to plan from and to. Distances are ours between capsules.
#[test]
fn piper_at_zero_keeps_its_links_apart() {
    let robot = load("piper");
    let frames = robot.chain.frames(&[0.0; MAX_JOINTS]);
    let placed: Vec<_> = robot
        .shapes
        .iter()
        .map(|shape| {
            let body = Body::new(&shape.shape, &shape.pose).expect("a shape");
            let at = body.placed(&to_parry(&frames[shape.frame]));
            (shape.link, body, at)
        })
        .collect();
    let mut looked_at = 0;
    for (i, (a, body, at)) in placed.iter().enumerate() {
        for (b, other, other_at) in placed.iter().skip(i + 1).filter(|(b, ..)| !robot.may_touch(*a, *b)) {
            let distance_m = body.distance_m(at, other, other_at);
            assert!(distance_m > 0.003, "{} and {}: {distance_m} m", robot.links[*a], robot.links[*b]);
            looked_at += 1;
        }
    }
    assert!(looked_at > 15, "{looked_at} pairs");
    let by_rule: Vec<(usize, usize)> =
        robot.allowed_by_rule.iter().copied().filter(|(a, b)| b - a > 1).collect();
    assert_eq!(by_rule, [(0, 2), (3, 5)], "which touch in every pose");
    assert_eq!(robot.unlisted_links, Vec::<String>::new());
}

/// Two joints by rows.
fn rows(kind: &str, top: &str, shapes: [&str; 2]) -> String {
    let joint = |(i, shape): (usize, &str)| {
        format!(
            "[[joint]]\nname = \"j{i}\"\n{kind} = {{ a_m = 0.3, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }}\n{shape}\n\
             position_rad = [-2, 2]\nmotion = {{ velocity_rad_s = 1, acceleration_rad_s2 = 2, jerk_rad_s3 = 3 }}\n"
        )
    };
    format!("name = \"r\"\n{top}\n{}", shapes.into_iter().enumerate().map(joint).collect::<String>())
}

#[test]
fn link_that_moves_without_a_shape_is_refused_unless_it_is_listed() {
    let read = |text: &str| Robot::from_toml(Path::new("r.toml"), text);
    let bare = rows("dh", "", ["link_radius_m = 0.05", "link_radius_m = 0.0"]);
    let robot = read(&bare).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(robot.unlisted_links, ["link2"]);
    let refused = robot.require_modelled().expect_err("link2 has no shape").to_string();
    assert!(refused.contains("\"link2\"") && refused.contains("unmodelled_links = [\"link2\"]"), "{refused}");

    let listed =
        rows("dh", "unmodelled_links = [\"link2\"]", ["link_radius_m = 0.05", "link_radius_m = 0.0"]);
    let robot = read(&listed).unwrap_or_else(|faults| panic!("{faults}"));
    assert!(robot.require_modelled().is_ok());
    assert_eq!(robot.unmodelled_links, ["link2"]);

    // The base stands still; the last link of modified rows is the end of its capsule.
    for kind in ["dh", "mdh"] {
        let robot =
            read(&rows(kind, "", ["link_radius_m = 0.05"; 2])).unwrap_or_else(|faults| panic!("{faults}"));
        assert!(robot.require_modelled().is_ok(), "{kind}: {:?}", robot.unlisted_links);
    }
    for (top, words) in [
        (
            "unmodelled_links = [\"link1\"]",
            "unmodelled_links[0] = \"link1\": expected a link without collision shape",
        ),
        ("unmodelled_links = [\"hand\"]", "unmodelled_links[0] = \"hand\": expected the name of a link"),
        (
            "unmodelled_links = [\"link2\", \"link2\"]",
            "unmodelled_links[1] = \"link2\": expected each link once",
        ),
        ("unmodelled_links = \"link2\"", "unmodelled_links = \"link2\": expected a list of names"),
        ("unmodelled_links = [2]", "unmodelled_links = [2]: expected a list of names"),
    ] {
        let text = rows("dh", top, ["link_radius_m = 0.05", "link_radius_m = 0.0"]);
        let said = read(&text).expect_err("a bad list").to_string();
        assert!(said.contains(words), "{words:?} is missing in {said}");
    }
}

#[test]
fn capsules_of_a_row_stand_in_its_frame_in_both_conventions() {
    let own = "link_capsules = [{ from_m = [0.1, 0, 0.2], to_m = [0.1, 0.3, 0.2], radius_m = 0.04 }]";
    let base = "base_capsules = [{ from_m = [0, 0, 0], to_m = [0, 0, 0], radius_m = 0.1 }]";
    for kind in ["dh", "mdh"] {
        let text = rows(kind, base, [own, own]);
        let robot = Robot::from_toml(Path::new("r.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"));
        assert_eq!(
            robot.shapes.iter().map(|s| (s.link, s.frame)).collect::<Vec<_>>(),
            [(0, 0), (1, 1), (2, 2)]
        );
        assert_eq!(robot.shapes[0].shape, Shape::Sphere { radius_m: 0.1 });
        let (ends, radius_m) = robot.shapes[2].segment().expect("a capsule");
        assert!((radius_m - 0.04).abs() < 1e-15);
        for (end, wanted) in ends.iter().zip([Point3::new(0.1, 0.0, 0.2), Point3::new(0.1, 0.3, 0.2)]) {
            assert!((end - wanted).norm() < 1e-12, "{kind}: {end}");
        }
    }
    for (shape, words) in [
        ("link_capsules = []", "joint[0].link_capsules = 0 capsules: expected 1 to 8 capsules"),
        ("link_capsules = 3", "joint[0].link_capsules = 3: expected a list of tables"),
        (
            "link_capsules = [{ from_m = [0, 0], to_m = [0, 0, 1], radius_m = 0.1 }]",
            "link_capsules[0].from_m",
        ),
        (
            "link_capsules = [{ from_m = [0, 0, 0], to_m = [0, 0, 300], radius_m = 0.1 }]",
            "link_capsules[0].to_m[2] = 300",
        ),
        ("link_capsules = [{ from_m = [0, 0, 0], to_m = [0, 0, 1], radius_m = 0 }]", "above 0 up to 1 m"),
        ("link_capsules = [{ from_m = [0, 0, 0], to_m = [0, 0, 1], radius_m = 1, a = 1 }]", "no such key"),
        (&format!("{own}\nlink_radius_m = 0.1"), "one of the two"),
    ] {
        let said = Robot::from_toml(Path::new("r.toml"), &rows("dh", "", [shape, own]))
            .expect_err("bad")
            .to_string();
        assert!(said.contains(words), "{words:?} is missing in {said}");
    }
}

#[test]
fn range_that_looks_like_degrees_is_said() {
    let text = rows("dh", "", ["link_radius_m = 0.05"; 2]).replacen("[-2, 2]", "[-90, 90]", 1);
    let robot = Robot::from_toml(Path::new("r.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"));
    let [notice] = robot.notices.as_slice() else { panic!("{:?}", robot.notices) };
    assert!(notice.contains("joint[0].position_rad = [-90, 90]"), "{notice}");
    assert!(notice.contains("LOOKS LIKE DEGREES; in rad these would be [-1.5708, 1.5708]"), "{notice}");
}

#[test]
fn motion_limits_that_are_hardly_meant_are_said() {
    let plain = rows("dh", "", ["link_radius_m = 0.05"; 2]);
    let motion = plain.lines().find(|line| line.starts_with("motion = ")).expect("limits");
    for (limits, words) in [
        (
            "velocity_rad_s = 90.0, acceleration_rad_s2 = 4.0, jerk_rad_s3 = 20.0",
            "in rad/s this would be 1.5708",
        ),
        (
            "velocity_rad_s = 2.8e-8, acceleration_rad_s2 = 4.0, jerk_rad_s3 = 20.0",
            "takes at least 35714286 s",
        ),
        ("velocity_rad_s = 1.0, acceleration_rad_s2 = 1e-4, jerk_rad_s3 = 20.0", "takes at least 200 s"),
        ("velocity_rad_s = 1.0, acceleration_rad_s2 = 4.0, jerk_rad_s3 = 3.2e-5", "takes at least 100 s"),
    ] {
        let text = plain.replacen(motion, &format!("motion = {{ {limits} }}"), 1);
        let robot = Robot::from_toml(Path::new("r.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"));
        let [notice] = robot.notices.as_slice() else { panic!("{limits}: {:?}", robot.notices) };
        assert!(notice.starts_with("joint[0].motion.") && notice.contains(words), "{notice}");
    }
}

#[test]
fn pair_that_touches_in_most_poses_is_found_and_one_that_may_is_not() {
    let wide = "link_capsules = [{ from_m = [-0.25, 0, 0], to_m = [0, 0, 0], radius_m = 0.09 }]";
    let three = rows(
        "dh",
        "base_capsules = [{ from_m = [0, 0, 0], to_m = [0, 0, 0.1], radius_m = 0.25 }]",
        [wide, wide],
    );
    let read =
        |text: &str| Robot::from_toml(Path::new("r.toml"), text).unwrap_or_else(|faults| panic!("{faults}"));
    let robot = read(&three);
    let found = robot.often_touching();
    let [(pair, share)] = found.as_slice() else { panic!("{found:?} beside {:?}", robot.allowed_by_rule) };
    assert_eq!(*pair, (0, 2));
    assert!((0.5..1.0).contains(share), "{share}");
    let allowed =
        three.replacen("name = \"r\"", "name = \"r\"\nallowed_contacts = [[\"base\", \"link2\"]]", 1);
    assert_eq!(read(&allowed).often_touching(), Vec::new());
}
