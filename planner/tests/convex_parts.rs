//! Forked links: a link in their gap can be planned for, because they count as convex parts and not as one hull.
#![expect(clippy::unwrap_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::pose;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::{Robot, Scene, Shape};
use taustream_motion::JointArray;
use taustream_planner::world::World;
use taustream_planner::{PlanOptions, plan, verify};

/// A fork of three boxes that points up, as lower and upper corners.
const FORK_M: [[[f64; 3]; 2]; 3] = [
    [[-0.06, -0.03, 0.0], [0.06, 0.03, 0.02]],
    [[-0.06, -0.03, 0.02], [-0.04, 0.03, 0.2]],
    [[0.04, -0.03, 0.02], [0.06, 0.03, 0.2]],
];
/// What a fork is without its gap.
const BLOCK_M: [[[f64; 3]; 2]; 1] = [[[-0.06, -0.03, 0.0], [0.06, 0.03, 0.2]]];

/// A Wavefront file of boxes.
fn obj(boxes: &[[[f64; 3]; 2]]) -> String {
    let mut text = String::new();
    for (k, ends) in boxes.iter().enumerate() {
        for i in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| ends[i >> axis & 1][axis]);
            writeln!(text, "v {x} {y} {z}").unwrap();
        }
        for face in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
            let [a, b, c, d] = face.map(|corner| 8 * k + corner + 1);
            writeln!(text, "f {a} {b} {c} {d}").unwrap();
        }
    }
    text
}

/// An arm whose fork is the mesh; a wheel above it carries a finger that hangs into the gap when all joints are at 0.
fn arm(name: &str, boxes: &[[[f64; 3]; 2]]) -> Robot {
    let folder = std::env::temp_dir().join(format!("taustream-fork-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("fork.obj"), obj(boxes)).unwrap();
    let link = |name: &str, shape: &str| {
        format!("<link name=\"{name}\"><collision><geometry>{shape}</geometry></collision></link>")
    };
    let joint = |name: &str, ends: [&str; 2], z_m: f64, axis: &str| {
        let [parent, child] = ends;
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"0 0 {z_m}\"/>\
             <axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" velocity=\"1\" effort=\"1\"/></joint>"
        )
    };
    let finger =
        "<collision><origin xyz=\"0 0 -0.1\"/><geometry><box size=\"0.02 0.02 0.2\"/></geometry></collision>";
    let urdf = [
        link("foot", "<sphere radius=\"0.02\"/>"),
        link("fork", "<mesh filename=\"fork.obj\"/>"),
        link("wheel", "<sphere radius=\"0.01\"/>"),
        format!("<link name=\"finger\">{finger}</link>"),
        joint("turn", ["foot", "fork"], 0.1, "0 0 1"),
        joint("spin", ["fork", "wheel"], 0.3, "0 0 1"),
        joint("swing", ["wheel", "finger"], 0.0, "1 0 0"),
    ];
    fs::write(folder.join("arm.urdf"), format!("<robot name=\"forked\">{}</robot>", urdf.concat())).unwrap();
    let motion = "motion = { acceleration_rad_s2 = 1.0, jerk_rad_s3 = 10.0 }";
    let joints = ["turn", "spin", "swing"].map(|name| format!("[[joint]]\nname = \"{name}\"\n{motion}\n"));
    let toml = format!("name = \"forked\"\nurdf = \"arm.urdf\"\ntip_link = \"finger\"\n{}", joints.concat());
    let robot = Robot::from_toml(&folder.join("arm.toml"), &toml);
    fs::remove_dir_all(&folder).unwrap();
    robot.unwrap_or_else(|faults| panic!("{faults}"))
}

fn at([turn, spin, swing]: [f64; 3]) -> JointArray {
    pose([turn, spin, swing, 0.0, 0.0, 0.0])
}

fn hulls(robot: &Robot) -> usize {
    robot.shapes.iter().filter(|shape| matches!(shape.shape, Shape::Hull { .. })).count()
}

/// Goal: a link in the gap of a fork is free there, and still collides with the fork's walls; as one hull, the fork holds it.
/// Method: poses inside, outside and through a wall, for the fork and for the block that fills it; then a plan out of the gap.
#[test]
fn link_in_the_gap_of_a_fork_is_free_and_meets_its_walls() {
    let (fork, block) = (arm("gap", &FORK_M), arm("block", &BLOCK_M));
    assert!(hulls(&fork) >= 3 && hulls(&block) == 1, "{:?}", fork.notices);
    assert!(fork.notices.iter().any(|n| n.contains(" convex parts, together ")), "{:?}", fork.notices);
    assert_ne!(fork.digest, block.digest);
    let scene = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
    let (world, filled) = (World::new(&fork, &scene).unwrap(), World::new(&block, &scene).unwrap());

    let (inside, outside) = (at([0.5, 0.3, 0.1]), at([-0.5, 0.0, 2.8]));
    assert!(world.contact(&inside).is_none() && world.contact(&outside).is_none());
    let hit = filled.contact(&inside).unwrap();
    assert_eq!(hit.between, ("finger".to_owned(), "fork".to_owned()));
    assert!(hit.touches() && filled.contact(&outside).is_none());
    // Turned by a quarter, the finger swings into a wall.
    let through = at([0.0, 1.57, 0.4]);
    assert!(world.contact(&through).unwrap().touches());

    let options = PlanOptions { deadline: Duration::from_secs(20), ..PlanOptions::default() };
    let planned = plan(&fork, &scene, &inside, &outside, &options).unwrap();
    assert!(verify(&fork, &scene, &planned.trajectory).is_ok());
    assert!(verify(&block, &scene, &planned.trajectory).is_err());
    assert!(plan(&block, &scene, &inside, &outside, &options).is_err());
}
