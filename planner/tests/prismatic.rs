//! Robots with prismatic joints: kinematics and forces against Pinocchio, contacts on the way of a lift, and plans of an arm on one.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;

use common::{config, scene};
use std::path::{Path, PathBuf};
use std::time::Duration;
use taustream_arm::body::{Body, to_parry};
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::budget::Budget;
use taustream_planner::collide::{StraightEdge, SweepRules, sweep};
use taustream_planner::goals::{Finder, Situation, TipTarget, plan_to_tip};
use taustream_planner::plan::{PoseOf, StartMargin, check_pose};
use taustream_planner::rng::SeededRng;
use taustream_planner::torque::TorqueLimits;
use taustream_planner::world::World;
use taustream_planner::{PlanOptions, plan, verify};

fn gantry() -> Robot {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/robots/gantry.toml");
    Robot::load(&file).expect("a robot")
}

fn lift() -> Robot {
    Robot::load(&config("robots/ur5-lift.toml")).expect("shipped")
}

fn pose(values: &[f64]) -> JointArray {
    let mut pose = [0.0; MAX_JOINTS];
    pose.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
    pose
}

fn options(seed: u64) -> PlanOptions {
    PlanOptions {
        seed,
        deadline: Duration::from_millis(500),
        keeps_deadline: false,
        ..PlanOptions::default()
    }
}

/// The program beside the numbers has made them from the same URDF with Pinocchio.
#[test]
fn tip_forces_and_torques_of_a_gantry_agree_with_pinocchio() {
    const JOINTS: usize = 4;
    let robot = gantry();
    let dynamics = robot.dynamics().expect("masses");
    let mut compared = 0;
    for line in include_str!("oracles/gantry.txt").lines() {
        let numbers: Vec<f64> = line.split(' ').map(|word| word.parse().expect("a number")).collect();
        let of = |i: usize| pose(&numbers[JOINTS * i..JOINTS * (i + 1)]);
        let (q, v, a) = (of(0), of(1), of(2));
        let (tip, forces) = numbers[3 * JOINTS..].split_at(3);
        let at = robot.chain.frame(robot.chain.tip_frame(), &q).translation.vector;
        assert!((0..3).all(|k| (at[k] - tip[k]).abs() < 1e-9), "{at:?} instead of {tip:?}");
        for (joint, (ours, theirs)) in dynamics.torques_nm(&q, &v, &a).iter().zip(forces).enumerate() {
            assert!((ours - theirs).abs() < 1e-9, "joint {joint}: {ours}, {theirs}");
            compared += 1;
        }
    }
    assert_eq!(compared, 60 * JOINTS);
}

fn plate(name: &str, size_m: [f64; 3], at_m: [f64; 3]) -> Obstacle {
    Obstacle {
        name: name.to_owned(),
        pose: Pose::translation(at_m[0], at_m[1], at_m[2]),
        shape: Shape::Box { size_m },
    }
}

fn only(obstacle: Obstacle) -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: vec![obstacle], zones: Vec::new() }
}

/// Goal: what a prismatic joint pushes through a thin thing is found, however short the levers about its axis are.
/// Method: the slide of the gantry carries its hand through a wall as thin as a sheet, off the middle of the way. The distances from the
/// axis of the slide, taken for levers, would call the way free.
#[test]
fn slide_through_a_sheet_is_blocked_where_it_meets_it() {
    let robot = gantry();
    let ends = [pose(&[-0.9, 0.0, 0.3, 0.0]), pose(&[0.9, 0.0, 0.3, 0.0])];
    for (number, x_m) in [-0.61, -0.33, 0.17, 0.47].into_iter().enumerate() {
        let scene = only(plate("sheet", [0.002, 2.0, 3.0], [x_m, 0.0, -1.0]));
        let world = World::new(&robot, &scene).expect("builds");
        assert!(ends.iter().all(|end| world.contact(end).is_none()), "the ends are free");
        let edge = StraightEdge { from_rad: &ends[0], to_rad: &ends[1] };
        let rules = SweepRules::PROOF;
        let blocked = sweep(&world, &edge, [0.0, 1.0], &rules, &Budget::unbounded()).expect_err("in the way");
        let (pair, distance_m) = blocked.pair.expect("a pair");
        assert_eq!(world.names(&pair).1, "sheet", "{number}");
        assert!(distance_m < 1e-4, "{number}: {distance_m}");
        let reach_s = 2.0;
        let stroke = Stroke {
            start_s: 0.0,
            duration_s: 8.0 * reach_s,
            n: 6,
            delta_rad: std::array::from_fn(|j| ends[1][j] - ends[0][j]),
        };
        let motion = Trajectory::new(4, ends[0], &[stroke]).expect("sound");
        let said = verify(&robot, &scene, &motion).expect_err("a collision").to_string();
        assert!(said.contains("sheet"), "{said}");
    }
}

/// Goal: the clearance of edges that move slide and telescope holds everywhere on them.
/// Method: random edges of all joints among random plates; distances at dense poses without the planner's world.
#[test]
fn clearance_of_a_gantry_holds_at_every_pose_between() {
    let robot = gantry();
    let bodies: Vec<Body> =
        robot.shapes.iter().map(|s| Body::new(&s.shape, &s.pose).expect("a body")).collect();
    let (mut proven, mut refused) = (0, 0);
    for seed in 0..300 {
        let mut rng = SeededRng::new(seed, 110);
        let mut at_m = || [rng.within(-1.0, 1.0), rng.within(-0.8, 0.8), rng.within(-1.6, 0.2)];
        let obstacle = plate("plate", [0.7, 0.01, 0.7], at_m());
        let own = Body::new(&obstacle.shape, &Pose::identity()).expect("a body");
        let still = own.placed(&to_parry(&obstacle.pose));
        let scene = only(obstacle);
        let world = World::new(&robot, &scene).expect("builds");
        let mut end = || -> JointArray {
            std::array::from_fn(|j| {
                robot.joints.get(j).map_or(0.0, |joint| {
                    let [low, high] = joint.limits.position_rad;
                    rng.within(low, high)
                })
            })
        };
        let (from, to) = (end(), end());
        let edge = StraightEdge { from_rad: &from, to_rad: &to };
        let Ok(clearance) =
            sweep(&world, &edge, [0.0, 1.0], &SweepRules::LEAST_DISTANCE, &Budget::unbounded())
        else {
            refused += 1;
            continue;
        };
        proven += 1;
        for step in 0..=400 {
            let t = f64::from(step) / 400.0;
            let q: JointArray = std::array::from_fn(|j| from[j] + (to[j] - from[j]) * t);
            let frames = robot.chain.frames(&q);
            for (shape, body) in robot.shapes.iter().zip(&bodies).filter(|(shape, _)| shape.frame > 0) {
                let distance_m = body.distance_m(&body.placed(&to_parry(&frames[shape.frame])), &own, &still);
                assert!(
                    distance_m >= clearance.proven_m - 1e-9,
                    "seed {seed}: {distance_m} below {}",
                    clearance.proven_m
                );
            }
        }
    }
    assert!(proven > 100 && refused > 10, "{proven} proven, {refused} refused");
}

/// Goal: plans of an arm on a lift among obstacles keep every limit and distance, lift included.
#[test]
fn plans_of_an_arm_on_a_lift_move_it_among_obstacles() {
    let (robot, scene) = (lift(), scene("pillars"));
    let home = robot.pose("home").expect("shipped");
    let goal = pose(&[0.55, 0.8, -1.2, 1.3, -1.4, -1.4, 0.3]);
    for seed in 0..4 {
        let found = plan(&robot, &scene, &home, &goal, &options(seed)).expect("a plan");
        let proof = verify(&robot, &scene, &found.trajectory).expect("proven");
        assert!((found.trajectory.end_rad()[0] - 0.55).abs() < 1e-6);
        let world = World::new(&robot, &scene).expect("builds");
        let (mut fastest_m_s, mut nearest_m) = (0.0_f64, f64::INFINITY);
        for step in 0..=2_000 {
            let at = found.trajectory.sample(proof.duration_s * f64::from(step) / 2_000.0);
            fastest_m_s = fastest_m_s.max(at.velocity_rad_s[0].abs());
            let (_, distance_m) = world.closest(&at.position_rad).expect("a pair");
            nearest_m = nearest_m.min(distance_m);
        }
        assert!(fastest_m_s <= 0.25 * (1.0 + 1e-6) && fastest_m_s > 0.1, "{fastest_m_s} m/s");
        assert!(nearest_m >= proof.clearance_m - 1e-9, "{nearest_m} below {}", proof.clearance_m);
    }
}

/// Goal: inverse kinematics uses the lift for what the arm alone does not reach, and says how far both reach.
#[test]
fn tip_goals_above_the_arm_are_reached_by_the_lift() {
    let (robot, empty) = (lift(), Scene::default());
    let home = robot.pose("home").expect("shipped");
    let situation = Situation { robot: &robot, scene: &empty, start_rad: home, margin: StartMargin::Scene };
    // 1.75 m above the floor: the arm reaches 0.4 + 0.1 m of carriage and about 1 m more.
    let target = TipTarget::position([0.2, 0.3, 1.75]);
    let reached = plan_to_tip(&situation, (&target, Finder::Inverse), &options(1), None).expect("a plan");
    assert!(reached.error.position_m < 1e-5 && reached.pose_rad[0] > 0.2, "{reached:?}");
    let lowered = robot.holding(1, &home);
    let low = Situation { robot: &lowered, ..situation };
    assert!(
        plan_to_tip(&low, (&target, Finder::Inverse), &options(1), None).is_err(),
        "the arm alone is too short"
    );
    let far = TipTarget::position([0.0, 0.0, 5.0]);
    let said =
        plan_to_tip(&situation, (&far, Finder::Inverse), &options(1), None).expect_err("too far").to_string();
    assert!(said.contains("reach"), "{said}");
}

#[test]
fn messages_about_a_prismatic_joint_are_in_metres_and_newtons() {
    let robot = lift();
    let outside = check_pose(&robot, PoseOf::Goal, &pose(&[0.7])).expect_err("outside").to_string();
    assert!(outside.contains("lift") && outside.contains("0.7000 m is 0.1000 m outside"), "{outside}");
    let weak = {
        let mut weak = robot.clone();
        weak.joints[0].torque_nm_max = Some(100.0);
        weak
    };
    let stroke = Stroke { start_s: 0.0, duration_s: 4.0, n: 6, delta_rad: pose(&[0.1]) };
    let motion = Trajectory::new(7, robot.pose("home").expect("shipped"), &[stroke]).expect("sound");
    let overload =
        TorqueLimits::of(&weak).expect("masses").prove(&motion).expect_err("too heavy").to_string();
    // 28.97 kg of arm and carriage.
    assert!(overload.contains("force_n_max") && overload.contains("N more than its 100.0 N"), "{overload}");
    let held = robot.dynamics().expect("masses").holding_nm(&robot.pose("home").expect("shipped"))[0];
    let weight_n = robot.masses.iter().map(|mass| mass.mass_kg).sum::<f64>() * 9.806_65;
    assert!((held - weight_n).abs() < 1e-9, "{held} N against {weight_n} N");
    assert!(!outside.contains("rad") && !overload.contains("Nm"), "{outside}; {overload}");
}
