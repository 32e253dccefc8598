//! The proof: corrupted motions are refused with the offender, and nothing slips through between samples.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, scene, sphere, ur5};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion};
use std::path::PathBuf;
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::limits::Quantity;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::rng::SeededRng;
use taustream_planner::{PlanOptions, PlannerKind, Violation, plan, verify};

const START: [f64; 6] = [-0.5, -0.7, 0.7, -1.57, -1.57, 0.0];
const GOAL: [f64; 6] = [0.5, -0.7, 0.7, -1.57, -1.57, 0.0];

fn planned() -> Trajectory {
    let options = PlanOptions { planner: PlannerKind::RrtConnect, ..PlanOptions::default() };
    plan(&ur5(), &scene("pillars"), &pose(START), &pose(GOAL), &options).expect("found").trajectory
}

fn with_strokes(motion: &Trajectory, change: impl Fn(usize, &mut Stroke)) -> Trajectory {
    let mut strokes = motion.strokes().to_vec();
    strokes.iter_mut().enumerate().for_each(|(i, s)| change(i, s));
    Trajectory::new(motion.joints(), *motion.base_rad(), &strokes).expect("still sorted")
}

fn scene_of(margin_m: f64, obstacles: Vec<Obstacle>) -> Scene {
    Scene { file: PathBuf::new(), margin_m, obstacles, zones: Vec::new() }
}

fn still(name: &str, center_m: [f64; 3], shape: Shape) -> Obstacle {
    let [x, y, z] = center_m;
    let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::identity());
    Obstacle { name: name.to_owned(), pose, shape }
}

#[test]
fn verify_corrupted_motions_are_refused_and_the_original_is_not() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let good = planned();
    let proof = verify(&robot, &scene, &good).expect("the planner proved it");
    assert!(proof.clearance_m > 0.0 && !proof.clearance_between.0.is_empty());

    // Too fast: all times two percent shorter.
    let fast = with_strokes(&good, |_, s| {
        s.start_s *= 0.98;
        s.duration_s *= 0.98;
    });
    let error = verify(&robot, &scene, &fast).unwrap_err();
    assert!(matches!(error, Violation::Limit { .. }), "{error}");

    // A via point shifted: what the arm draws back by, it does not draw back by.
    let shifted = with_strokes(&good, |_, s| {
        s.delta_rad[1] = 0.0;
        s.delta_rad[2] = 0.0;
    });
    let error = verify(&robot, &scene, &shifted).unwrap_err();
    assert!(
        matches!(&error, Violation::Collision { contact, .. } if contact.between.1 == "front_pillar"),
        "{error}"
    );

    // Beyond the position range, slowly.
    let far = with_strokes(&good, |i, s| {
        s.start_s *= 20.0;
        s.duration_s *= 20.0;
        if i == 0 {
            s.delta_rad[5] += 3.5;
        }
    });
    let error = verify(&robot, &scene, &far).unwrap_err();
    assert!(
        matches!(&error, Violation::Limit { name, violation } if name == "wrist_3" && violation.quantity == Quantity::Position),
        "{error}"
    );

    let five = Trajectory::new(5, [0.0; MAX_JOINTS], &[]).expect("empty");
    assert_eq!(verify(&robot, &scene, &five), Err(Violation::Joints { got: 5, expected: 6 }));
}

#[test]
fn verify_straight_line_through_an_obstacle_names_pair_time_and_depth() {
    let (robot, empty) = (ur5(), scene_of(0.02, Vec::new()));
    let options = PlanOptions { planner: PlannerKind::Straight, ..PlanOptions::default() };
    let through = plan(&robot, &empty, &pose(START), &pose(GOAL), &options).expect("free").trajectory;
    let error = verify(&robot, &scene("pillars"), &through).unwrap_err();
    let Violation::Collision { from_s, at_s, contact } = &error else { panic!("{error}") };
    assert!(contact.between.1 == "front_pillar" && contact.distance_m < 0.0 && contact.required_m > 0.0);
    // The arm meets the pillar before the middle, and is deepest near it.
    let middle_s = 0.5 * through.duration_s();
    assert!(*from_s > 0.0 && *from_s < middle_s && *at_s > *from_s, "{error}");
    assert!(error.to_string().contains("touches front_pillar"), "{error}");
}

/// A stick of one joint and 1 m, thin as a needle.
fn stick() -> Robot {
    let directory = std::env::temp_dir().join(format!("taustream-stick-{}", std::process::id()));
    std::fs::create_dir_all(&directory).expect("temporary directory");
    let file = directory.join("stick.toml");
    let text = "name = \"stick\"\n[[joint]]\nname = \"turn\"\n\
        dh = { a_m = 1.0, alpha_rad = 0.0, d_m = 0.0, theta_offset_rad = 0.0 }\nlink_radius_m = 0.0001\n\
        position_rad = [-3.1, 3.1]\n\
        motion = { velocity_rad_s = 3.0, acceleration_rad_s2 = 30.0, jerk_rad_s3 = 600.0 }\n\
        stop = { acceleration_rad_s2 = 60.0, jerk_rad_s3 = 2400.0 }\n";
    std::fs::write(&file, text).expect("written");
    let robot = Robot::load(&file).expect("a good file");
    std::fs::remove_dir_all(&directory).expect("removed");
    robot
}

/// Goal: a contact of a tenth of a millisecond, at an instant that no regular sampling hits, is found, and its time is
/// the one that geometry gives.
#[test]
fn verify_needle_thinner_than_any_sampling_step_is_caught_at_the_right_time() {
    let robot = stick();
    let mut missed_by_sampling = 0;
    for seed in 0..40 {
        let mut rng = SeededRng::new(seed, 0);
        let angle = rng.within(-1.0, 1.0);
        let (x, y): (f64, f64) = (0.9 * angle.cos(), 0.9 * angle.sin());
        let needle = Shape::Cylinder { radius_m: 1e-4, length_m: 1.0 };
        let needle = scene_of(0.0, vec![still("needle", [x, y, 0.0], needle)]);
        let options = PlanOptions { planner: PlannerKind::Straight, ..PlanOptions::default() };
        let (mut start, mut goal) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        (start[0], goal[0]) = (-1.5, 1.5);
        let motion =
            plan(&robot, &scene_of(0.0, Vec::new()), &start, &goal, &options).expect("free").trajectory;

        // The surfaces meet when the stick's axis is 0.2 mm from the needle's: this much before the angle.
        let meets_rad = angle - (2e-4_f64 / 0.9).asin();
        let touching = |t: f64| (motion.sample(t).position_rad[0] - angle).abs() < angle - meets_rad;
        let samples = (motion.duration_s() / 1e-3).ceil();
        let mut t = 0.0;
        let mut seen = false;
        while t < samples {
            seen |= touching(t * 1e-3);
            t += 1.0;
        }
        missed_by_sampling += u32::from(!seen);

        let error = verify(&robot, &needle, &motion).unwrap_err();
        let Violation::Collision { from_s, .. } = error else { panic!("seed {seed}: {error}") };
        let there_rad = motion.sample(from_s).position_rad[0];
        // Never late; early by what is taken away from iterated distances, 0.05 mm, and a resolution.
        let early_rad = meets_rad - there_rad;
        assert!((-1e-6..8e-5).contains(&early_rad), "seed {seed}: at {there_rad}, expected {meets_rad}");
    }
    assert!(
        missed_by_sampling > 20,
        "only {missed_by_sampling} of 40 needles are thin enough to show anything"
    );
}

/// Goal: the bracket of the least clearance is what it says. Method: an obstacle beside the path; the margin is put
/// just below and just above the densely sampled least distance.
#[test]
fn verify_margin_just_inside_and_just_outside_the_least_distance() {
    let robot = ur5();
    let options = PlanOptions { planner: PlannerKind::Straight, ..PlanOptions::default() };
    let empty = scene_of(0.0, Vec::new());
    let motion = plan(&robot, &empty, &pose(START), &pose(GOAL), &options).expect("free").trajectory;
    let mut decided = 0;
    for seed in 0..30 {
        let mut rng = SeededRng::new(seed, 0);
        let center_m = [rng.within(-1.0, -0.5), rng.within(-0.5, 0.5), rng.within(0.3, 0.9)];
        let ball = |margin_m| scene_of(margin_m, vec![sphere("ball", center_m, 0.05)]);
        let least_m = (0..=20_000)
            .map(|i| motion.duration_s() * f64::from(i) / 20_000.0)
            .map(|t| common::ur5_distances_m(&robot, &ball(0.0), &motion.sample(t).position_rad).0)
            .fold(f64::INFINITY, f64::min);
        if least_m < 1e-3 {
            continue;
        }
        decided += 1;
        // 20,000 samples of a 1 m/s motion are 0.1 mm apart; at the least distance the error is of second order.
        let proof = verify(&robot, &ball(least_m - 2e-5), &motion);
        let proof = proof.unwrap_or_else(|e| panic!("seed {seed}, least {least_m}: {e}"));
        if proof.clearance_between.1 == "ball" {
            let below_m = least_m - proof.clearance_m;
            assert!((-1e-9..1.1e-3).contains(&below_m), "seed {seed}: {below_m} m below {least_m}");
        } else {
            assert!(proof.clearance_m <= least_m, "seed {seed}");
        }
        let error = verify(&robot, &ball(least_m + 2e-5), &motion).unwrap_err();
        assert!(matches!(error, Violation::Collision { .. }), "seed {seed}: {error}");
    }
    assert!(decided > 10, "{decided} balls beside the path");
}

fn cube(half_m: f64, inside_out: bool) -> Shape {
    let corner = |i: usize| {
        let at = |bit: usize| if i & bit == 0 { -half_m } else { half_m };
        Point3::new(at(1), at(2), at(4))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for [a, b, c, d] in quads {
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    if inside_out {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    Shape::Mesh { vertices_m: (0..8).map(corner).collect(), triangles }
}

#[test]
fn verify_arm_wholly_inside_a_closed_mesh_is_in_collision_whichever_way_it_is_wound() {
    let robot = ur5();
    let stay = Trajectory::new(6, pose(START), &[]).expect("empty");
    for inside_out in [false, true] {
        let room = scene_of(0.0, vec![still("room", [0.0; 3], cube(3.0, inside_out))]);
        let error = verify(&robot, &room, &stay).unwrap_err();
        assert!(
            matches!(&error, Violation::Collision { contact, .. } if contact.between.1 == "room"),
            "{error}"
        );
        let beside = scene_of(0.0, vec![still("room", [6.0, 0.0, 0.0], cube(3.0, inside_out))]);
        verify(&robot, &beside, &stay).expect("3 m beside the base, a reach of 1 m");
    }
}

#[test]
fn verify_box_as_mesh_and_as_box_give_one_clearance() {
    let robot = ur5();
    let options = PlanOptions { planner: PlannerKind::Straight, ..PlanOptions::default() };
    let motion = plan(&robot, &scene_of(0.0, Vec::new()), &pose(START), &pose(GOAL), &options).expect("free");
    for seed in 0..10 {
        let mut rng = SeededRng::new(seed, 0);
        let center_m = [rng.within(-1.2, -0.3), rng.within(-0.6, 0.6), rng.within(0.2, 1.0)];
        let solid = scene_of(0.0, vec![still("block", center_m, Shape::Box { size_m: [0.2; 3] })]);
        let mesh = scene_of(0.0, vec![still("block", center_m, cube(0.1, false))]);
        let (a, b) = (verify(&robot, &solid, &motion.trajectory), verify(&robot, &mesh, &motion.trajectory));
        assert_eq!(a.is_ok(), b.is_ok(), "seed {seed}: {a:?} against {b:?}");
        if let (Ok(a), Ok(b)) = (a, b) {
            assert!((a.clearance_m - b.clearance_m).abs() < 1e-3, "seed {seed}: {a:?} against {b:?}");
        }
    }
}

#[test]
fn verify_hostile_trajectories_never_panic() {
    let (robot, scene) = (ur5(), scene("shelf"));
    let sizes = [0.0, 1e-300, 1e-9, 1.0, 1e3, 1e12, 1e300];
    let mut refused = 0;
    for seed in 0..300 {
        let mut rng = SeededRng::new(seed, 0);
        let mut number = |scale: f64| rng.within(-scale, scale) * sizes[rng.index(sizes.len())];
        let mut base: JointArray = [0.0; MAX_JOINTS];
        base.iter_mut().take(6).for_each(|q| *q = number(1.0));
        let mut strokes: Vec<Stroke> = (0..8)
            .map(|i| {
                let mut delta_rad = [0.0; MAX_JOINTS];
                delta_rad.iter_mut().take(6).for_each(|d| *d = number(2.0));
                let duration_s = number(1.0).abs().clamp(1e-3, 1e3);
                Stroke { start_s: number(1.0).abs().min(1e4), duration_s, n: 4 + 7 * i, delta_rad }
            })
            .collect();
        strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        if let Ok(motion) = Trajectory::new(6, base, &strokes) {
            refused += u32::from(verify(&robot, &scene, &motion).is_err());
        }
    }
    assert!(refused > 200, "{refused} of 300 refused");
}
