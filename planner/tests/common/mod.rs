//! What the planner's tests share: shipped files, random scenes, and an independent check of motions.
//!
//! The check knows nothing of the planner: its own matrices from the Denavit-Hartenberg rows, its own point-to-segment
//! distances, dense samples. It sees spheres and the capsules of the robot file only.
#![expect(dead_code, reason = "every test binary includes this file and uses a part of it")]
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use std::path::{Path, PathBuf};
use taustream_arm::rng::SeededRng;
use taustream_arm::{LinkShape, Obstacle, Robot, Scene, Settings, Shape};
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};

pub(crate) fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").join(name)
}

pub(crate) fn ur5() -> Robot {
    Robot::load(&config("robots/ur5.toml")).expect("shipped")
}

pub(crate) fn scene(name: &str) -> Scene {
    Scene::load(&config(&format!("scenes/{name}.toml"))).expect("shipped")
}

pub(crate) fn vcan6() -> Settings {
    Settings::load(&config("settings/vcan6.toml")).expect("shipped")
}

pub(crate) fn pose(values: [f64; 6]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose[..6].copy_from_slice(&values);
    pose
}

pub(crate) fn sphere(name: &str, center_m: [f64; 3], radius_m: f64) -> Obstacle {
    let [x, y, z] = center_m;
    let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
    Obstacle { name: name.to_owned(), pose, shape: Shape::Sphere { radius_m } }
}

/// Two to five spheres round the arm, none of them at its base.
pub(crate) fn random_spheres(rng: &mut SeededRng) -> Scene {
    let mut obstacles = Vec::new();
    let count = 2 + rng.index(4);
    while obstacles.len() < count {
        let center_m = [rng.within(-0.8, 0.8), rng.within(-0.8, 0.8), rng.within(0.0, 0.9)];
        let radius_m = rng.within(0.05, 0.18);
        if center_m[0].hypot(center_m[1]) > 0.25 + radius_m {
            obstacles.push(sphere(&format!("sphere{}", obstacles.len()), center_m, radius_m));
        }
    }
    Scene { file: PathBuf::new(), margin_m: 0.02, obstacles, zones: Vec::new() }
}

/// UR5 rows (a, alpha, d) in m and rad, from the data sheet and not from the shipped file.
const UR5: [[f64; 3]; 6] = [
    [0.0, std::f64::consts::FRAC_PI_2, 0.089_159],
    [-0.425, 0.0, 0.0],
    [-0.392_25, 0.0, 0.0],
    [0.0, std::f64::consts::FRAC_PI_2, 0.109_15],
    [0.0, -std::f64::consts::FRAC_PI_2, 0.094_65],
    [0.0, 0.0, 0.082_3],
];

type Matrix = [[f64; 4]; 4];

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; 4]; 4];
    for (i, row) in c.iter_mut().enumerate() {
        for (j, cell) in row.iter_mut().enumerate() {
            *cell = (0..4).map(|k| a[i][k] * b[k][j]).sum();
        }
    }
    c
}

/// The seven frames of a UR5, base first.
fn ur5_frames(q: &JointArray) -> Vec<Matrix> {
    let mut frame: Matrix =
        [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
    let mut frames = vec![frame];
    for (angle, [a, alpha, d]) in q.iter().zip(UR5) {
        let ((st, ct), (sa, ca)) = (angle.sin_cos(), alpha.sin_cos());
        let row = [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ];
        frame = product(&frame, &row);
        frames.push(frame);
    }
    frames
}

/// Origins of the seven frames of a UR5.
pub(crate) fn ur5_origins_m(q: &JointArray) -> Vec<[f64; 3]> {
    ur5_frames(q).iter().map(|frame| [frame[0][3], frame[1][3], frame[2][3]]).collect()
}

/// Least distance of the bare segments between the origins to spheres, as the papers model an arm.
pub(crate) fn ur5_segments_to_spheres_m(scene: &Scene, q: &JointArray) -> f64 {
    let origins = ur5_origins_m(q);
    let mut least_m = f64::INFINITY;
    for obstacle in &scene.obstacles {
        let Shape::Sphere { radius_m } = obstacle.shape else { panic!("spheres only") };
        let c = obstacle.pose.translation.vector;
        for link in origins.windows(2) {
            least_m = least_m.min(point_to_segment_m([c.x, c.y, c.z], link[0], link[1]) - radius_m);
        }
    }
    least_m
}

/// A capsule of a link, in the base frame.
struct Capsule {
    link: usize,
    ends_m: [[f64; 3]; 2],
    radius_m: f64,
}

/// The shapes of the links in a pose; those of the base have link 0.
fn ur5_capsules(robot: &Robot, q: &JointArray) -> Vec<Capsule> {
    let frames = ur5_frames(q);
    let place = |frame: &Matrix, p: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|i| frame[i][0] * p[0] + frame[i][1] * p[1] + frame[i][2] * p[2] + frame[i][3])
    };
    let capsule = |shape: &LinkShape| {
        let (radius_m, length_m) = match shape.shape {
            Shape::Capsule { radius_m, length_m } => (radius_m, length_m),
            Shape::Sphere { radius_m } => (radius_m, 0.0),
            Shape::Box { .. }
            | Shape::Cylinder { .. }
            | Shape::Mesh { .. }
            | Shape::Hull { .. }
            | Shape::Cloud(_) => {
                panic!("capsules only")
            }
        };
        let end = |side: f64| {
            let p = shape.pose * Point3::new(0.0, 0.0, side * length_m);
            place(&frames[shape.frame], [p.x, p.y, p.z])
        };
        Capsule { link: shape.link, ends_m: [end(-0.5), end(0.5)], radius_m }
    };
    robot.shapes.iter().map(capsule).collect()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn point_to_segment_m(p: [f64; 3], a: [f64; 3], b: [f64; 3]) -> f64 {
    let (ab, ap) = (minus(b, a), minus(p, a));
    let t = if dot(ab, ab) > 0.0 { (dot(ab, ap) / dot(ab, ab)).clamp(0.0, 1.0) } else { 0.0 };
    let d = minus(ap, [ab[0] * t, ab[1] * t, ab[2] * t]);
    dot(d, d).sqrt()
}

/// Segment to segment by many points of one: above the truth by at most half of their spacing.
fn segments_m(a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]) -> f64 {
    let along = minus(b, a);
    (0..=64)
        .map(|i| {
            let t = f64::from(i) / 64.0;
            point_to_segment_m([a[0] + along[0] * t, a[1] + along[1] * t, a[2] + along[2] * t], c, d)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Least distances of a UR5 in a pose: of its moving links to spheres, and between links that may not touch.
pub(crate) fn ur5_distances_m(robot: &Robot, scene: &Scene, q: &JointArray) -> (f64, f64) {
    let capsules = ur5_capsules(robot, q);
    let (mut spheres_m, mut links_m) = (f64::INFINITY, f64::INFINITY);
    for obstacle in &scene.obstacles {
        let Shape::Sphere { radius_m } = obstacle.shape else { panic!("spheres only") };
        let c = obstacle.pose.translation.vector;
        for capsule in capsules.iter().filter(|capsule| capsule.link > 0) {
            let [from, to] = capsule.ends_m;
            let d = point_to_segment_m([c.x, c.y, c.z], from, to);
            spheres_m = spheres_m.min(d - radius_m - capsule.radius_m);
        }
    }
    for (i, a) in capsules.iter().enumerate() {
        for b in capsules.iter().skip(i + 1) {
            if a.link != b.link && !robot.may_touch(a.link, b.link) {
                let ([a0, a1], [b0, b1]) = (a.ends_m, b.ends_m);
                links_m = links_m.min(segments_m(a0, a1, b0, b1) - a.radius_m - b.radius_m);
            }
        }
    }
    (spheres_m, links_m)
}

/// Least distances of a whole motion at dense samples, first differences of positions against velocity limits, and
/// whether it ends where it should.
pub(crate) fn assert_safe(robot: &Robot, scene: &Scene, motion: &Trajectory, goal: &JointArray, who: &str) {
    const STEP_S: f64 = 1e-3;
    let steps = (motion.duration_s() / STEP_S).ceil();
    assert!(steps > 0.0, "{who}: a motion takes time");
    let at = |i: f64| motion.sample(i * STEP_S).position_rad;
    let mut i = 0.0;
    while i <= steps {
        let q = at(i);
        let (spheres_m, links_m) = ur5_distances_m(robot, scene, &q);
        assert!(spheres_m > scene.margin_m, "{who}: {spheres_m} m from a sphere at {} s", i * STEP_S);
        assert!(links_m > robot.margins.all_m, "{who}: links {links_m} m apart at {} s", i * STEP_S);
        let next = at(i + 1.0);
        for (j, joint) in robot.joints.iter().enumerate() {
            let speed = (next[j] - q[j]).abs() / STEP_S;
            assert!(
                speed <= joint.limits.motion.velocity_rad_s * (1.0 + 1e-6),
                "{who}: joint {j} at {speed}"
            );
        }
        i += 1.0;
    }
    for (j, (end, goal)) in motion.end_rad().iter().zip(goal).enumerate() {
        assert!((end - goal).abs() < 1e-9, "{who}: joint {j} ends at {end}, not at {goal}");
    }
}

/// Least distance of the links of two UR5s that may meet, the second one's base in the frame of the first: one of them moves.
pub(crate) fn ur5_pair_distance_m(
    robot: &Robot,
    [a_rad, b_rad]: [&JointArray; 2],
    base_of_b: &Isometry3<f64>,
) -> f64 {
    let moved = |p: [f64; 3]| -> [f64; 3] { (base_of_b * Point3::from(p)).into() };
    let (a, b) = (ur5_capsules(robot, a_rad), ur5_capsules(robot, b_rad));
    let mut least_m = f64::INFINITY;
    for one in &a {
        for other in b.iter().filter(|other| one.link > 0 || other.link > 0) {
            let [from, to] = one.ends_m;
            let [c, d] = other.ends_m.map(moved);
            least_m = least_m.min(segments_m(from, to, c, d) - one.radius_m - other.radius_m);
        }
    }
    least_m
}
