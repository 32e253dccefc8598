//! Arms with branches: which joint moves what, in every bound of the proof.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::ur5;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::PathBuf;
use taustream_arm::scene::Shape;
use taustream_arm::{LinkShape, Obstacle, Robot, Scene};
use taustream_motion::chain::{Chain, ChainJoint, Pose};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS};
use taustream_planner::budget::Budget;
use taustream_planner::collide::{StraightEdge, SweepRules, sweep};
use taustream_planner::lanes::Lanes;
use taustream_planner::world::{Other, Snapshot, World};

/// A rod along x from its joint, 0.5 m long.
fn rod(frame: usize) -> LinkShape {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), FRAC_PI_2);
    let pose = Pose::from_parts(nalgebra::Translation3::new(0.25, 0.0, 0.0), turn);
    LinkShape { link: frame, frame, pose, shape: Shape::Capsule { radius_m: 0.02, length_m: 0.5 } }
}

/// Rods that turn about vertical axes at these places of the base, all on one level: branches of one joint each.
fn rods(places_m: &[[f64; 2]]) -> Robot {
    let joint = |[x, y]: &[f64; 2]| ChainJoint {
        kind: JointKind::Revolute,
        pre: Pose::translation(*x, *y, 0.0),
        axis: Vector3::z_axis(),
        offset: 0.0,
        post: Pose::identity(),
    };
    let joints: Vec<ChainJoint> = places_m.iter().map(joint).collect();
    let mut robot = ur5();
    robot.joints.truncate(joints.len());
    robot.chain = Chain::tree(&joints, &vec![0; joints.len()], &[joints.len()]).expect("a tree");
    robot.links = (0..=joints.len()).map(|i| format!("l{i}")).collect();
    robot.shapes = (1..=joints.len()).map(rod).collect();
    (robot.allowed_by_file, robot.allowed_by_rule) = (Vec::new(), Vec::new());
    robot
}

fn scene(obstacles: Vec<Obstacle>) -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.0, obstacles, zones: Vec::new() }
}

fn pose(angles: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(angles).for_each(|(slot, angle)| *slot = *angle);
    pose
}

/// Goal: a rod that sweeps through one on another branch is stopped there, whichever of the two has the later frame.
/// Method: both ends and the middle of the motion are free, and the other rod stands still. Were the joint taken for one that carries
/// both rods, as in a serial arm, it would drop out of the pair, and one look at the middle would settle the motion.
#[test]
fn arm_that_sweeps_through_another_is_blocked_where_they_meet() {
    let scene = scene(Vec::new());
    for sweeping in [0, 1] {
        let robot = rods(&[[0.0, 0.0], [0.9, 0.0]]);
        let world = World::new(&robot, &scene).expect("builds");
        assert_eq!(world.pairs().len(), 1);
        // Towards each other their ends overlap by 0.1 m. The one goes from there nearly once around, and a bit too far.
        let at = |angle: f64| if sweeping == 0 { pose(&[angle, PI]) } else { pose(&[0.0, PI + angle]) };
        let (from_rad, to_rad) = (at(0.4), at(6.6));
        let mut snapshot = Snapshot::default();
        let middle = std::array::from_fn(|j| 0.5 * (from_rad[j] + to_rad[j]));
        for (name, q) in [("start", &from_rad), ("middle", &middle), ("goal", &to_rad)] {
            assert!(world.is_free(q, 0.02, &mut snapshot), "sweeping {sweeping}: {name} is meant to be free");
        }
        let edge = StraightEdge { from_rad: &from_rad, to_rad: &to_rad };
        let blocked = sweep(&world, &edge, [0.0, 1.0], &SweepRules::PROOF, &Budget::unbounded());
        let blocked = blocked.expect_err("the rods meet");
        assert!(blocked.pair.is_some(), "sweeping {sweeping}: {blocked:?}");
        let q: JointArray = std::array::from_fn(|j| from_rad[j] + (to_rad[j] - from_rad[j]) * blocked.at);
        assert!(!world.is_free(&q, 1e-5, &mut snapshot), "sweeping {sweeping}: {blocked:?}");
        assert!(!Lanes::new(&world).are_free(&[from_rad, q, to_rad], 1e-5), "sweeping {sweeping}");
    }
}

/// Goal: what moves on another branch costs a proof nothing: a rod that stands still 1 mm from an obstacle is proven by one look.
#[test]
fn joints_of_another_branch_do_not_loosen_the_proof() {
    let near = Obstacle {
        name: "near".to_owned(),
        pose: Pose::translation(0.25, 0.071, 0.0),
        shape: Shape::Sphere { radius_m: 0.05 },
    };
    let scene = scene(vec![near]);
    let robot = rods(&[[0.0, 0.0], [0.0, -3.0], [0.0, -6.0]]);
    let world = World::new(&robot, &scene).expect("builds");
    let (from_rad, to_rad) = (pose(&[0.0, -3.0, 3.0]), pose(&[0.0, 3.0, -3.0]));
    let turn_rad = pose(&[0.0, 6.0, 6.0]);
    let (mut snapshot, mut moves_m) = (Snapshot::default(), Vec::new());
    world.place(&from_rad, &mut snapshot);
    world.moves_m((&snapshot, &world.every_body()), &turn_rad, &mut moves_m);
    for pair in world.pairs() {
        let moved_m = world.pair_moves_m(pair, &moves_m);
        let moves = pair.link > 0 || pair.other != Other::Obstacle(0);
        assert!(moved_m.is_finite() && (moved_m > 0.0) == moves, "{pair:?}: {moved_m}");
    }
    let edge = StraightEdge { from_rad: &from_rad, to_rad: &to_rad };
    let proven = sweep(&world, &edge, [0.0, 1.0], &SweepRules::PROOF, &Budget::unbounded()).expect("clear");
    let alone = StraightEdge { from_rad: &from_rad, to_rad: &from_rad };
    let still = sweep(&world, &alone, [0.0, 1.0], &SweepRules::PROOF, &Budget::unbounded()).expect("clear");
    assert_eq!(still.checks, 1);
    // The two that turn are 3 m apart: two levels of halves settle them.
    assert!(proven.checks <= 7, "{} poses for arms that are far apart", proven.checks);
    assert!((proven.sampled_m - still.sampled_m).abs() < 1e-12 && proven.sampled_m < 1.1e-3, "{proven:?}");
}
