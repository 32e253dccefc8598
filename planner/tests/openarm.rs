//! Two arms as one robot, the shipped OpenArm: kinematics and torques against Pinocchio, one arm round the other, and both at once.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{config, scene};
use std::time::Duration;
use taustream_arm::body::{Body, to_parry};
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};
use taustream_planner::budget::Budget;
use taustream_planner::collide::{StraightEdge, SweepRules, sweep};
use taustream_planner::held::check_held;
use taustream_planner::rng::SeededRng;
use taustream_planner::world::{Other, Snapshot, World};
use taustream_planner::{PlanOptions, plan, verify};

const JOINTS: usize = 14;

fn openarm() -> Robot {
    Robot::load(&config("robots/openarm.toml")).expect("shipped")
}

fn pose(values: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    pose
}

/// The program beside the numbers has made them from the shipped URDF with Pinocchio.
#[test]
fn tips_and_torques_of_both_arms_agree_with_pinocchio() {
    let robot = openarm();
    let dynamics = robot.dynamics().expect("masses");
    let mut compared = 0;
    for line in include_str!("oracles/openarm.txt").lines() {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().expect("a number")).collect();
        let of = |i: usize| pose(&numbers[JOINTS * i..JOINTS * (i + 1)]);
        let (q, v, a) = (of(0), of(1), of(2));
        let (tips, torques) = numbers[3 * JOINTS..].split_at(6);
        for (tip, expected) in robot.tips.iter().zip(tips.chunks(3)) {
            let at = robot.chain.frame(tip.frame, &q).translation.vector;
            let gap_m = (0..3).map(|k| (at[k] - expected[k]).abs()).fold(0.0, f64::max);
            assert!(gap_m < 1e-9, "{}: {gap_m:e} m", tip.name);
        }
        for (joint, (ours, theirs)) in dynamics.torques_nm(&q, &v, &a).iter().zip(torques).enumerate() {
            assert!((ours - theirs).abs() < 1e-9, "joint {joint}: {ours} Nm, {theirs} Nm");
            compared += 1;
        }
    }
    assert_eq!(compared, 40 * JOINTS);
}

/// Shapes of links that one group moves, as bodies.
fn bodies(robot: &Robot, group: usize) -> Vec<(usize, Body)> {
    let moves =
        |frame: usize| robot.groups[group].joints.iter().any(|joint| robot.chain.moves(*joint, frame));
    let own = robot.shapes.iter().filter(|shape| moves(shape.frame));
    own.map(|shape| (shape.frame, Body::new(&shape.shape, &shape.pose).expect("a body"))).collect()
}

/// Least distance of what the arms move along a motion, by dense samples and without the planner's world.
fn apart_m(robot: &Robot, motion: &Trajectory) -> f64 {
    let arms = [bodies(robot, 0), bodies(robot, 1)];
    let mut least_m = f64::INFINITY;
    for step in 0..=400 {
        let q = motion.sample(motion.duration_s() * f64::from(step) / 400.0).position_rad;
        let frames = robot.chain.frames(&q);
        let placed = arms.each_ref().map(|arm| {
            arm.iter()
                .map(|(frame, body)| (body, body.placed(&to_parry(&frames[*frame]))))
                .collect::<Vec<_>>()
        });
        for (a, at) in &placed[0] {
            for (b, b_at) in &placed[1] {
                least_m = least_m.min(a.distance_m(at, b, b_at));
            }
        }
    }
    least_m
}

/// A pose inside the ranges, its arms forwards more often than not, so that they come into each other's way.
fn random_pose(robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let mut q = [0.0; MAX_JOINTS];
    for (slot, joint) in q.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *slot = rng.within(low, high);
    }
    for (side, sign) in [(0, -1.0), (7, 1.0)] {
        q[side] = sign * rng.within(0.2, 1.6);
        q[side + 1] = sign * rng.within(-0.15, 0.6);
        q[side + 3] = rng.within(0.0, 1.6);
    }
    q
}

/// Questions whose straight line is blocked by a pair of links of different arms: start and goal are free, and of the goal the right
/// arm stands as at the start.
fn blocked_by_the_other_arm(robot: &Robot, scene: &Scene, wanted: usize) -> Vec<[JointArray; 2]> {
    let world = World::new(robot, scene).expect("builds");
    let moves = |group: usize, body: usize| {
        let frame = world.link_bodies().nth(body).map_or(0, |(frame, _)| frame);
        robot.groups[group].joints.iter().any(|joint| robot.chain.moves(*joint, frame))
    };
    let mut snapshot = Snapshot::default();
    let mut found = Vec::new();
    for seed in 0..20_000 {
        let mut rng = SeededRng::new(seed, 90);
        let start = random_pose(robot, &mut rng);
        let mut goal = random_pose(robot, &mut rng);
        goal[7..JOINTS].copy_from_slice(&start[7..JOINTS]);
        if ![start, goal].iter().all(|q| world.is_free(q, 0.01, &mut snapshot)) {
            continue;
        }
        let edge = StraightEdge { from_rad: &start, to_rad: &goal };
        let blocked = sweep(&world, &edge, [0.0, 1.0], &SweepRules::EDGE, &Budget::unbounded()).err();
        let Some((pair, _)) = blocked.and_then(|blocked| blocked.pair) else { continue };
        let Other::Link(other) = pair.other else { continue };
        if (moves(0, pair.link) && moves(1, other)) || (moves(1, pair.link) && moves(0, other)) {
            found.push([start, goal]);
            if found.len() == wanted {
                break;
            }
        }
    }
    found
}

fn options(seed: u64) -> PlanOptions {
    PlanOptions { seed, deadline: Duration::from_secs(20), ..PlanOptions::default() }
}

/// Goal: where the other arm is in the way of the straight line, a way round it is found, in which it does not move by a bit.
/// Method: questions that are blocked by a pair of links of two arms; distances of the arms' own shapes along the answer, by dense
/// samples; the whole motion verified for the robot as it is shipped.
#[test]
fn left_arm_is_led_round_the_right_one_which_holds() {
    let (robot, scene) = (openarm(), scene("open"));
    let questions = blocked_by_the_other_arm(&robot, &scene, 6);
    assert_eq!(questions.len(), 6, "the arms hardly meet");
    let held_joints = robot.groups[0].others(JOINTS);
    assert_eq!(held_joints, 0b11_1111_1000_0000);
    let mut led = 0;
    for (seed, [start, goal]) in (1..).zip(&questions) {
        let holding = robot.holding(held_joints, start);
        let Ok(found) = plan(&holding, &scene, start, goal, &options(seed)) else { continue };
        led += 1;
        check_held(&robot, &found.trajectory, held_joints).expect("the right arm holds");
        for step in 0..=100 {
            let q = found.trajectory.sample(found.proof.duration_s * f64::from(step) / 100.0).position_rad;
            assert_eq!(q[7..JOINTS].map_bits(), start[7..JOINTS].map_bits());
        }
        let (least_m, proven_m) = (apart_m(&robot, &found.trajectory), found.proof.clearance_m);
        assert!(least_m >= 0.003 && proven_m <= least_m + 1e-6, "{least_m} m here, {proven_m} m proven");
        let proof = verify(&robot, &scene, &found.trajectory).expect("for the whole robot");
        assert!(proof.clearance_m > 0.0);
    }
    assert!(led >= 4, "only {led} of 6 questions were answered");
}

trait Bits {
    fn map_bits(&self) -> Vec<u64>;
}

impl Bits for [f64] {
    fn map_bits(&self) -> Vec<u64> {
        self.iter().map(|q| q.to_bits()).collect()
    }
}

/// Goal: both arms are led at once, fourteen joints in one motion, and keep apart.
#[test]
fn both_arms_are_led_at_once_and_keep_apart() {
    let (robot, scene) = (openarm(), scene("open"));
    let questions = blocked_by_the_other_arm(&robot, &scene, 4);
    let mut led = 0;
    for (seed, pair) in (1..).zip(questions.chunks(2)) {
        let [[start, _], [_, goal]] = pair else { continue };
        let Ok(found) = plan(&robot, &scene, start, goal, &options(seed)) else { continue };
        led += 1;
        let end = found.trajectory.end_rad();
        let moved =
            |joints: std::ops::Range<usize>| joints.into_iter().any(|j| (end[j] - start[j]).abs() > 0.1);
        assert!(moved(0..7) && moved(7..JOINTS));
        assert!((0..JOINTS).all(|j| (end[j] - goal[j]).abs() < 1e-6));
        let (least_m, proven_m) = (apart_m(&robot, &found.trajectory), found.proof.clearance_m);
        assert!(least_m >= 0.003 && proven_m <= least_m + 1e-6, "{least_m} m here, {proven_m} m proven");
    }
    assert!(led >= 1, "neither of two questions was answered");
}
