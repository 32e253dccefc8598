//! Reaching a position or a pose of the tip: any chain, any place that it can reach, and clear words about others.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests; a failure in them fails the test")]
mod common;

use common::{config, pose, sphere, ur5, ur5_origins_m};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, joint_array};
use taustream_planner::budget::Budget;
use taustream_planner::goals::{
    ERROR_M_MAX, ERROR_RAD_MAX, Inverse, LineError, Orientation, TipSpeed, plan_line,
};
use taustream_planner::rng::SeededRng;
use taustream_planner::{
    Finder, GoalError, PlanOptions, Reached, Situation, StartMargin, TipTarget, plan_to_any, plan_to_tip,
    verify,
};

fn scene(obstacles: Vec<taustream_arm::Obstacle>) -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.02, obstacles, zones: Vec::new() }
}

fn piper() -> Robot {
    Robot::load(&config("robots/piper.toml")).expect("shipped")
}

/// A chain of standard rows (a, alpha, d), without shapes, whose joints turn by up to two radians.
fn chain(rows: &[[f64; 3]]) -> Robot {
    let mut text = String::from("name = \"chain\"\n");
    for (i, [a, alpha, d]) in rows.iter().enumerate() {
        write!(
            text,
            "[[joint]]\nname = \"j{i}\"\nlink_radius_m = 0.0\nposition_rad = [-2, 2]\n\
             dh = {{ a_m = {a}, alpha_rad = {alpha}, d_m = {d}, theta_offset_rad = 0.0 }}\n\
             motion = {{ velocity_rad_s = {}, acceleration_rad_s2 = 10, jerk_rad_s3 = 100 }}\n",
            1.0 + 0.5 * (i as f64)
        )
        .expect("a string");
    }
    Robot::from_toml(Path::new("chain.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"))
}

fn two_joints() -> Robot {
    chain(&[[0.5, 0.0, 0.1], [0.2, 0.0, 0.0]])
}

fn eight_joints() -> Robot {
    let quarter = std::f64::consts::FRAC_PI_2;
    let row = |i: u32| [0.1, if i.is_multiple_of(2) { quarter } else { -quarter }, 0.05 * f64::from(i % 3)];
    chain(&(0..8).map(row).collect::<Vec<_>>())
}

fn reach(
    robot: &Robot,
    scene: &Scene,
    start_rad: JointArray,
    target_m: [f64; 3],
    seed: u64,
) -> Result<Reached, GoalError> {
    let deadline = Duration::from_secs(4);
    let options = PlanOptions { seed, deadline, keeps_deadline: false, ..PlanOptions::default() };
    let situation = Situation { robot, scene, start_rad, margin: StartMargin::Scene };
    plan_to_tip(&situation, (&TipTarget::position(target_m), Finder::Inverse), &options, None)
}

fn tip_m(robot: &Robot, q: &JointArray) -> [f64; 3] {
    robot.chain.frames(q)[robot.joints.len()].translation.vector.into()
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

/// What every answer promises.
fn assert_reached(robot: &Robot, scene: &Scene, target_m: [f64; 3], reached: &Reached, who: &str) {
    let end = reached.plan.trajectory.end_rad();
    let off_m = distance_m(tip_m(robot, &end), target_m);
    assert!(off_m <= reached.error.position_m, "{who}: {off_m:e} m off, promised {:?}", reached.error);
    assert!(reached.error.position_m <= 2.0 * ERROR_M_MAX, "{who}: {:?}", reached.error);
    for (q, joint) in end.iter().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        assert!((low - 1e-12..=high + 1e-12).contains(q), "{who}: {} at {q}", joint.name);
    }
    assert_eq!(verify(robot, scene, &reached.plan.trajectory).as_ref(), Ok(&reached.plan.proof), "{who}");
    let as_said = end.iter().zip(reached.pose_rad).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(as_said, "{who}: ends at {end:?}, said {:?}", reached.pose_rad);
}

/// Goal: whatever the arm can reach is reached, by arms of two to eight joints.
/// Method: the tip's place in random poses of each arm is a place that it can reach.
#[test]
fn positions_of_random_poses_are_reached_by_arms_of_two_to_eight_joints() {
    let empty = scene(Vec::new());
    for (name, robot) in
        [("ur5", ur5()), ("piper", piper()), ("two joints", two_joints()), ("eight joints", eight_joints())]
    {
        let mut rng = SeededRng::new(5, 60);
        let mut random = || -> JointArray {
            std::array::from_fn(|j| {
                robot.joints.get(j).map_or(0.0, |joint| {
                    let [low, high] = joint.limits.position_rad;
                    rng.within(low, high)
                })
            })
        };
        let world = taustream_planner::world::World::new(&robot, &empty).expect("builds");
        let mut free = || loop {
            let q = random();
            if world.contact(&q).is_none() {
                return q;
            }
        };
        for seed in 0..5 {
            let (start, target_m) = (free(), tip_m(&robot, &free()));
            let who = format!("{name}, seed {seed}, to {target_m:?}");
            let reached =
                reach(&robot, &empty, start, target_m, seed).unwrap_or_else(|e| panic!("{who}: {e}"));
            assert_reached(&robot, &empty, target_m, &reached, &who);
        }
    }
}

/// Goal: the error is the real one, by other kinematics than the planner's, and one seed gives one answer.
#[test]
fn position_of_a_ur5_is_reached_by_independent_kinematics_and_repeats() {
    let (robot, balls) = (ur5(), scene(vec![sphere("ball", [0.45, 0.1, 0.35], 0.1)]));
    let (start, target_m) = (pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]), [0.45, -0.25, 0.3]);
    let once = reach(&robot, &balls, start, target_m, 11).expect("reached");
    let origins = ur5_origins_m(&once.plan.trajectory.end_rad());
    assert!(distance_m(origins[6], target_m) <= once.error.position_m, "{:?}", origins[6]);
    assert!(once.poses >= 2, "{} poses to choose from", once.poses);
    let again = reach(&robot, &balls, start, target_m, 11).expect("reached");
    assert!(again.plan.trajectory == once.plan.trajectory, "one seed, two motions: {}", once.plan.how);
}

#[test]
fn position_on_the_axis_of_the_base_is_reached_although_the_arm_is_singular_there() {
    let (robot, empty) = (piper(), scene(Vec::new()));
    for target_m in [[0.0, 0.0, 0.45], [0.0, 0.0, 0.6]] {
        let reached = reach(&robot, &empty, pose([0.3, 0.5, -0.5, 0.0, 0.0, 0.0]), target_m, 2)
            .unwrap_or_else(|e| panic!("{target_m:?}: {e}"));
        assert_reached(&robot, &empty, target_m, &reached, "axis");
    }
    // A UR5's wrist stands 0.10915 m aside of the arm's plane, and its last link of 0.0823 m cannot bring the tip back.
    let start = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let error = reach(&ur5(), &empty, start, [0.0, 0.0, 0.75], 2).unwrap_err();
    let GoalError::Missed { by_m, .. } = error else { panic!("{error}") };
    assert!((by_m - (0.109_15 - 0.082_3)).abs() < 1e-6, "{error}");
    // Stretched out to the last: here every lever is at right angles to the way that is left.
    let (robot, far_m) = (two_joints(), [0.7, 0.0, 0.1]);
    let reached = reach(&robot, &empty, pose([0.3, 0.4, 0.0, 0.0, 0.0, 0.0]), far_m, 2).expect("the edge");
    assert_reached(&robot, &empty, far_m, &reached, "edge");
}

#[test]
fn position_out_of_reach_is_refused_with_how_far_it_is() {
    let (robot, empty) = (two_joints(), scene(Vec::new()));
    let error = reach(&robot, &empty, [0.0; MAX_JOINTS], [0.9, 0.0, 0.1], 1).unwrap_err();
    // The bound counts the first joint's height, which does not help; it never says too little.
    let GoalError::TooFar { distance_m, reach_m } = error.clone() else { panic!("{error}") };
    assert!(distance_m > reach_m && reach_m >= 0.7, "{error}");
    assert!(error.to_string().contains("out of reach"), "{error}");
    // In the hole round the base, whose rim is where the second joint ends at two radians; and above the arm's plane.
    let rim_m = (0.25 + 0.04 + 2.0 * 0.5 * 0.2 * 2.0_f64.cos()).sqrt();
    for (target_m, off_m) in [([0.1, 0.0, 0.1], rim_m - 0.1), ([0.6, 0.0, 0.25], 0.15)] {
        let error = reach(&robot, &empty, [0.0; MAX_JOINTS], target_m, 1).unwrap_err();
        let GoalError::Missed { tries, by_m, .. } = error.clone() else { panic!("{error}") };
        assert!(tries >= 4 && (by_m - off_m).abs() < 1e-6, "{error}, not {off_m}");
    }
    for (axis, bad) in [('x', f64::NAN), ('y', f64::INFINITY), ('z', f64::NEG_INFINITY)] {
        let mut target_m = [0.4, 0.0, 0.1];
        target_m[usize::from(axis as u8 - b'x')] = bad;
        let error = reach(&robot, &empty, [0.0; MAX_JOINTS], target_m, 1).unwrap_err();
        assert!(matches!(error, GoalError::BadPosition { axis: a, .. } if a == axis), "{error}");
    }
    let error =
        reach(&robot, &empty, joint_array([9.0, 0.0, 0.0, 0.0, 0.0, 0.0]), [0.4, 0.0, 0.1], 1).unwrap_err();
    assert!(error.to_string().contains("start outside limits"), "{error}");
}

#[test]
fn position_inside_an_obstacle_is_refused_by_its_name() {
    let (robot, target_m) = (ur5(), [0.45, -0.25, 0.3]);
    let ball = scene(vec![sphere("ball", target_m, 0.05)]);
    let error = reach(&robot, &ball, pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]), target_m, 1).unwrap_err();
    assert!(matches!(error, GoalError::NoClearPose { .. }), "{error}");
    let words = error.to_string();
    assert!(words.contains("ball") && words.contains("another position"), "{words}");
}

#[test]
fn position_is_reached_by_the_papers_method_and_others_by_name() {
    let (robot, empty) = (ur5(), scene(Vec::new()));
    let (start_rad, target_m) = (pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]), [0.45, -0.25, 0.3]);
    for name in ["iepso", "de", "iwo", "gwo"] {
        let finder = Finder::swarm(name).expect("registered");
        let options = PlanOptions { seed: 4, deadline: Duration::from_secs(4), ..PlanOptions::default() };
        let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
        let reached = plan_to_tip(&situation, (&TipTarget::position(target_m), finder), &options, None)
            .unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(reached.plan.how.starts_with(&name.to_uppercase()), "{}", reached.plan.how);
        assert_reached(&robot, &empty, target_m, &reached, &reached.plan.how);
    }
}

/// Goal: polishing never makes a pose worse, stays inside the ranges, and from near the target ends on it.
#[test]
fn polishing_ends_on_the_target_from_nearby_and_never_makes_worse() {
    let (mut there, mut tried) = (0, 0);
    for (robot, slack_rad) in [(ur5(), 0.1), (piper(), 0.1), (eight_joints(), 0.1), (two_joints(), 0.05)] {
        for seed in 0..100 {
            let mut rng = SeededRng::new(seed, 61);
            let mut q = [0.0; MAX_JOINTS];
            let mut near = [0.0; MAX_JOINTS];
            for (j, joint) in robot.joints.iter().enumerate() {
                let [low, high] = joint.limits.position_rad;
                q[j] = rng.within(low, high);
                near[j] = (q[j] + rng.within(-slack_rad, slack_rad)).clamp(low, high);
            }
            let target = TipTarget::position(tip_m(&robot, &q));
            let polished = Inverse::new(&robot, &target, 1.0).polish(&near);
            let [before, after] = [&near, &polished].map(|q| target.error(&robot, q).position_m);
            assert!(after <= before, "seed {seed}: {before} became {after}");
            for (q, joint) in polished.iter().zip(&robot.joints) {
                let [low, high] = joint.limits.position_rad;
                assert!((low..=high).contains(q), "seed {seed}: {q}");
            }
            tried += 1;
            there += u32::from(after < 1e-9);
        }
    }
    assert!(there * 100 >= tried * 97, "{there} of {tried}");
}

fn random_pose(robot: &Robot, rng: &mut SeededRng) -> JointArray {
    let mut q = [0.0; MAX_JOINTS];
    for (slot, joint) in q.iter_mut().zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        *slot = rng.within(low, high);
    }
    q
}

fn tip_target(robot: &Robot, q: &JointArray, tolerance_rad: [f64; 3]) -> TipTarget {
    let tip = robot.chain.frames(q)[robot.joints.len()];
    let orientation = Some(Orientation { rotation: tip.rotation, tolerance_rad });
    TipTarget { orientation, ..TipTarget::position(tip.translation.vector.into()) }
}

/// Angle between two rotations by their matrices, independently of the planner's rotation vectors.
fn angle_between_rad(robot: &Robot, a: &JointArray, b: &JointArray) -> f64 {
    let [a, b] = [a, b].map(|q| robot.chain.frames(q)[robot.joints.len()].rotation.to_rotation_matrix());
    // Frobenius: the difference of rotations by an angle has the norm 2 sqrt(2) sin(angle / 2).
    2.0 * ((a.matrix() - b.matrix()).norm() / 8.0_f64.sqrt()).min(1.0).asin()
}

/// Goal: a pose that the arm has is found again, exactly, clear or not, whatever the start.
/// Method: poses of the tip in random poses of the joints, of arms with six to eight joints.
#[test]
fn tip_poses_of_random_poses_are_reached_exactly_in_position_and_orientation() {
    let empty = scene(Vec::new());
    for (name, robot) in [("ur5", ur5()), ("piper", piper()), ("eight joints", eight_joints())] {
        let world = taustream_planner::world::World::new(&robot, &empty).expect("builds");
        let mut rng = SeededRng::new(8, 64);
        let mut free = || loop {
            let q = random_pose(&robot, &mut rng);
            if world.contact_within(&q, 1e-3).is_none() {
                return q;
            }
        };
        for seed in 0..5 {
            let (start_rad, there) = (free(), free());
            let target = tip_target(&robot, &there, [0.0; 3]);
            let options = PlanOptions { seed, ..PlanOptions::default() };
            let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
            let who = format!("{name}, seed {seed}");
            let reached = plan_to_tip(&situation, (&target, Finder::Inverse), &options, None)
                .unwrap_or_else(|e| panic!("{who}: {e}"));
            assert_reached(&robot, &empty, target.position_m, &reached, &who);
            let angle_rad = angle_between_rad(&robot, &there, &reached.plan.trajectory.end_rad());
            assert!(angle_rad <= 3.0 * ERROR_RAD_MAX, "{who}: turned by {angle_rad:e} rad");
        }
    }
}

#[test]
fn inverse_kinematics_finds_all_eight_poses_of_a_ur5() {
    let robot = ur5();
    let empty = scene(Vec::new());
    let q = pose([0.4, -1.1, 1.3, -0.9, -1.2, 0.3]);
    let target = tip_target(&robot, &q, [0.0; 3]);
    let mut found: Vec<JointArray> = Vec::new();
    let world = taustream_planner::world::World::new(&robot, &empty).expect("builds");
    for seed in 0..200 {
        let (start_rad, what) = (pose([0.0; 6]), (&target, Finder::Inverse));
        let Some((pose, _)) = taustream_planner::goals::one_try(&world, start_rad, what, seed).expect("runs")
        else {
            continue;
        };
        let is_known = |other: &JointArray| other.iter().zip(&pose).all(|(a, b)| (a - b).abs() < 1e-3);
        if !found.iter().any(is_known) {
            found.push(pose);
        }
    }
    assert_eq!(found.len(), 8, "{found:?}");
}

/// Goal: what is free is used and what is bound is kept.
#[test]
fn tolerances_let_a_five_joint_arm_reach_what_it_cannot_reach_exactly() {
    let empty = scene(Vec::new());
    let quarter = std::f64::consts::FRAC_PI_2;
    let robot = chain(&[
        [0.0, quarter, 0.2],
        [0.4, 0.0, 0.0],
        [0.3, 0.0, 0.0],
        [0.0, quarter, 0.05],
        [0.0, 0.0, 0.1],
    ]);
    let there = joint_array([0.4, 0.5, -0.8, 0.6, 0.7, 0.0]);
    let start_rad = joint_array([0.0, 0.3, -0.3, 0.2, 0.0, 0.0]);
    let exact = tip_target(&robot, &there, [0.0; 3]);
    let turned = |tolerance_rad: [f64; 3]| {
        let orientation = exact.orientation.map(|o| {
            // Turned about an axis that five joints cannot turn about there.
            let by = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(0.05, 0.08, 0.0));
            Orientation { rotation: o.rotation * by, tolerance_rad }
        });
        TipTarget { orientation, ..exact }
    };
    let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
    let reach = |target: &TipTarget| {
        plan_to_tip(&situation, (target, Finder::Inverse), &PlanOptions::default(), None)
    };
    let error = reach(&turned([0.0; 3])).unwrap_err();
    let GoalError::Missed { by_rad: Some(by_rad), .. } = error else { panic!("{error}") };
    assert!(by_rad > 1e-3 && error.to_string().contains("rad off"), "{error}");
    for tolerance_rad in [[0.2; 3], [f64::INFINITY, f64::INFINITY, 0.0]] {
        let target = turned(tolerance_rad);
        let reached = reach(&target).unwrap_or_else(|e| panic!("{tolerance_rad:?}: {e}"));
        assert_reached(&robot, &empty, target.position_m, &reached, "with tolerance");
        let off_rad = reached.error.turned_rad.expect("an orientation");
        let inside =
            off_rad.iter().zip(tolerance_rad).all(|(off, most)| off.abs() <= most.max(ERROR_RAD_MAX));
        assert!(inside, "{off_rad:?}");
    }
}

#[test]
fn best_of_several_goals_is_taken_and_an_unreachable_one_does_no_harm() {
    let (robot, empty) = (ur5(), scene(Vec::new()));
    let start_rad = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let near = pose([0.3, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let far = pose([2.0, -1.0, 1.0, -1.57, -1.57, 0.0]);
    // Folded onto itself.
    let folded = pose([0.1, -1.57, 3.1, -1.57, -1.57, 0.0]);
    let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
    let options = PlanOptions::default();
    let (plan, goal_rad) = plan_to_any(&situation, &[far, folded, near], &options, None).expect("planned");
    assert!(goal_rad.iter().zip(near).all(|(a, b)| (a - b).abs() < 1e-12), "{goal_rad:?}");
    assert!(distance_m(tip_m(&robot, &plan.trajectory.end_rad()), tip_m(&robot, &near)) < 1e-9);
    let error = plan_to_any(&situation, &[folded, folded], &options, None).unwrap_err();
    assert!(matches!(error, GoalError::NoneOf { goals: 2, .. }), "{error}");
    assert!(matches!(plan_to_any(&situation, &[], &options, None), Err(GoalError::NoGoal)));
}

/// Goal: the tip keeps to its line, its speed and its orientation, by independent kinematics.
#[test]
fn tip_keeps_to_its_straight_line_its_speed_and_its_orientation() {
    let (robot, empty) = (ur5(), scene(Vec::new()));
    let start_rad = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
    let from_m = ur5_origins_m(&start_rad)[6];
    for (by_m, linear_m_s) in [([0.1, 0.0, 0.0], 0.25), ([0.0, 0.3, -0.1], 0.1), ([-0.05, -0.2, 0.2], 1.0)] {
        let to_m: [f64; 3] = std::array::from_fn(|i| from_m[i] + by_m[i]);
        let speed = TipSpeed { linear_m_s, ..TipSpeed::default() };
        let line = plan_line(&situation, &TipTarget::position(to_m), &speed, &Budget::unbounded())
            .unwrap_or_else(|e| panic!("{by_m:?}: {e}"));
        let motion = &line.imported.trajectory;
        assert_eq!(verify(&robot, &empty, motion).as_ref(), Ok(&line.imported.proof));
        let length_m = distance_m(from_m, to_m);
        let mut before_m = from_m;
        let steps = (motion.duration_s() / 1e-3).ceil();
        let mut k = 0.0;
        while k <= steps {
            let q = motion.sample(k * 1e-3).position_rad;
            let tip_m = ur5_origins_m(&q)[6];
            let way: [f64; 3] = std::array::from_fn(|i| tip_m[i] - from_m[i]);
            let share = way.iter().zip(by_m).map(|(w, b)| w * b).sum::<f64>() / (length_m * length_m);
            let foot_m: [f64; 3] = std::array::from_fn(|i| from_m[i] + share.clamp(0.0, 1.0) * by_m[i]);
            assert!(distance_m(tip_m, foot_m) <= 1e-3, "{by_m:?}: {} m off", distance_m(tip_m, foot_m));
            let speed_m_s = distance_m(tip_m, before_m) / 1e-3;
            assert!(speed_m_s <= linear_m_s * 1.02, "{by_m:?}: {speed_m_s} m/s");
            assert!(angle_between_rad(&robot, &start_rad, &q) < 5e-3, "{by_m:?} turns");
            before_m = tip_m;
            k += 1.0;
        }
        assert!(distance_m(before_m, to_m) < 1e-6, "{by_m:?}: ends at {before_m:?}, not {to_m:?}");
    }
}

#[test]
fn straight_line_that_the_arm_cannot_follow_is_refused_with_place_and_reason() {
    let (robot, empty) = (ur5(), scene(Vec::new()));
    let start_rad = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let situation = Situation { robot: &robot, scene: &empty, start_rad, margin: StartMargin::Scene };
    let [x, y, z] = ur5_origins_m(&start_rad)[6];
    // Out of reach half way, and across the axis of the base.
    for (to_m, words) in [([x - 0.5, y, z], "left after"), ([-x, -y, z], "left after")] {
        let error =
            plan_line(&situation, &TipTarget::position(to_m), &TipSpeed::default(), &Budget::unbounded())
                .unwrap_err();
        assert!(matches!(error, LineError::Left { .. }) && error.to_string().contains(words), "{error}");
    }
    let here =
        plan_line(&situation, &TipTarget::position([x, y, z]), &TipSpeed::default(), &Budget::unbounded());
    assert_eq!(here.unwrap_err(), LineError::Still);
    let ball = scene(vec![sphere("ball", [x, y + 0.15, z - 0.01], 0.03)]);
    let blocked = Situation { scene: &ball, ..situation };
    let error = plan_line(
        &blocked,
        &TipTarget::position([x, y + 0.3, z]),
        &TipSpeed::default(),
        &Budget::unbounded(),
    )
    .unwrap_err();
    assert!(error.to_string().contains("ball"), "{error}");
}

/// Goal: nobody waits for a line whose requester has gone, and a deadline holds for lines, too.
#[test]
fn straight_line_is_given_up_when_it_is_cancelled_or_its_time_is_over() {
    let robot = ur5();
    let scene = scene(Vec::new());
    let start_rad = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let situation = Situation { robot: &robot, scene: &scene, start_rad, margin: StartMargin::Scene };
    let [.., tip] = robot.chain.frames(&start_rad);
    let [x, y, z]: [f64; 3] = tip.translation.vector.into();
    let (target, speed) = (TipTarget::position([x, y + 0.2, z]), TipSpeed::default());
    let gone = AtomicBool::new(true);
    for budget in [Budget::until(Duration::from_secs(60), Some(&gone)), Budget::until(Duration::ZERO, None)] {
        let error = plan_line(&situation, &target, &speed, &budget).unwrap_err();
        assert!(matches!(error, LineError::NoTime { .. }), "{error}");
    }
    plan_line(&situation, &target, &speed, &Budget::unbounded()).expect("there is such a line");
}
