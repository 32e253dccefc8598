//! Position limits in planning: goals at a limit, starts outside, and what is said about both.
#![expect(clippy::approx_constant, reason = "3.1416 is the limit of the shipped arm")]
mod common;
use common::{config, pose, scene, ur5};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::range::PermittedRange;
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::plan::{StartMargin, Task, plan_until};
use taustream_planner::rng::SeededRng;
use taustream_planner::{Plan, PlanError, PlanOptions, PoseOf, plan, verify};

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

fn open() -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() }
}

fn options() -> PlanOptions {
    PlanOptions { deadline: Duration::from_secs(5), ..PlanOptions::default() }
}

fn replan(robot: &Robot, scene: &Scene, start: &JointArray, goal: &JointArray) -> Result<Plan, PlanError> {
    let margin = StartMargin::AsItStands;
    plan_until(&Task { robot, scene, start_rad: *start, goal_rad: *goal, margin }, &options(), None)
}

/// Every sample is permitted by what was reached before it, and the end is inside, without the tolerance.
fn assert_comes_in(robot: &Robot, motion: &Trajectory, who: &str) {
    let limits = robot.limits();
    for (joint, limits) in limits.iter().enumerate().take(robot.joints.len()) {
        let mut permitted = PermittedRange::around(limits, motion.base_rad()[joint]);
        for i in 0..=5_000 {
            let q = motion.sample(motion.duration_s() * f64::from(i) / 5_000.0).position_rad[joint];
            let [low, high] = permitted.ends_rad();
            assert!(q >= low - 1e-12 && q <= high + 1e-12, "{who}: joint {joint} at {q} of [{low}, {high}]");
            permitted = permitted.narrowed_to(q);
        }
        let end = motion.end_rad()[joint];
        assert!(limits.outside_rad(end).abs() < 1e-300, "{who}: joint {joint} ends at {end}");
    }
}

/// Goal: a goal at a limit, as printed or as rounding leaves it, is reached, ends inside, and can be left again.
#[test]
fn goal_at_a_limit_is_reached_inside_and_left_again() {
    for (file, joint, home) in [("ur5", 5, HOME), ("piper", 0, [0.0, 0.5, -0.5, 0.0, 0.0, 0.0])] {
        let robot = Robot::load(&config(&format!("robots/{file}.toml"))).unwrap();
        let [low, high] = robot.joints[joint].limits.position_rad;
        let printed = |limit: f64| (limit * 1e4).round() * 1e-4;
        for at_rad in [high, low, printed(high), printed(low), high + 4.5e-16, low - 9e-4] {
            let mut goal = pose(home);
            goal[joint] = at_rad;
            let there = plan(&robot, &open(), &pose(home), &goal, &options());
            let there = there.unwrap_or_else(|e| panic!("{file}, {at_rad}: {e}"));
            assert_comes_in(&robot, &there.trajectory, file);
            // One count of an encoder further out, as it is measured after the brake has closed.
            let mut stands = there.trajectory.end_rad();
            stands[joint] += 2e-4 * at_rad.signum();
            let back = plan(&robot, &open(), &stands, &pose(home), &options());
            let back = back.unwrap_or_else(|e| panic!("{file}, back from {at_rad}: {e}"));
            assert!(verify(&robot, &open(), &back.trajectory).is_ok(), "{file}, back from {at_rad}");
        }
        let mut beyond = pose(home);
        beyond[joint] = high + 1.1e-3;
        let error = plan(&robot, &open(), &pose(home), &beyond, &options()).unwrap_err();
        assert!(matches!(error, PlanError::OutsideLimits { which: PoseOf::Goal, .. }), "{error}");
    }
}

/// Method: random poses with one to three joints pushed out by up to half a radian, on either side.
#[test]
fn start_outside_is_led_inwards_first_and_said() {
    let robot = ur5();
    let mut led = 0;
    for seed in 0..12 {
        let mut rng = SeededRng::new(seed, 900);
        let mut start = pose(HOME);
        let count = 1 + rng.index(3);
        let joints = [[0, 3, 5], [5, 4, 0], [3, 5, 4]][rng.index(3)];
        for joint in joints.into_iter().take(count) {
            let side = if rng.unit() < 0.5 { -1.0 } else { 1.0 };
            start[joint] = side * (3.1416 + rng.within(0.002, 0.5));
        }
        let goal = pose([0.4, -1.3, 1.2, -1.6, -1.4, 0.3]);
        let strict = plan(&robot, &open(), &start, &goal, &options()).unwrap_err().to_string();
        assert!(strict.contains("start outside limits") && strict.contains("taustream recover"), "{strict}");
        let plan = match replan(&robot, &open(), &start, &goal) {
            Ok(plan) => plan,
            // The stretched pose may touch itself.
            Err(
                PlanError::InCollision { .. } | PlanError::InsideMargin { .. } | PlanError::NotFound { .. },
            ) => continue,
            Err(e) => panic!("seed {seed}: {e}"),
        };
        assert!(plan.how.starts_with("led inwards first, from outside the limits: "), "{}", plan.how);
        for joint in joints.into_iter().take(count) {
            assert!(plan.how.contains(&robot.joints[joint].name), "{}", plan.how);
        }
        assert_comes_in(&robot, &plan.trajectory, &format!("seed {seed}"));
        assert!(verify(&robot, &open(), &plan.trajectory).is_ok(), "seed {seed}");
        let end = plan.trajectory.end_rad();
        assert!(end.iter().zip(&goal).all(|(e, g)| (e - g).abs() < 1e-9), "seed {seed}");
        led += 1;
    }
    assert!(led >= 4, "{led} of 12 were led inwards");
}

#[test]
fn start_outside_goes_to_the_nearest_pose_inside_and_nowhere_else() {
    let robot = ur5();
    let mut start = pose(HOME);
    (start[0], start[5]) = (-3.3, 3.2516);
    let mut goal = start;
    (goal[0], goal[5]) = (-3.1416, 3.1416);
    let plan = replan(&robot, &open(), &start, &goal).unwrap();
    assert_comes_in(&robot, &plan.trajectory, "recover");
    assert!(plan.how.contains("shoulder_pan by 0.1584 rad, wrist_3 by 0.1100 rad"), "{}", plan.how);
    let still = plan.trajectory.strokes().iter().flat_map(|s| &s.delta_rad[1..5]);
    assert!(still.copied().all(|delta| delta.abs() < 1e-300), "other joints moved");
    for joint in [0, 5] {
        let (from, to) = (start[joint], plan.trajectory.end_rad()[joint]);
        for i in 0..=2_000 {
            let at = plan.trajectory.duration_s() * f64::from(i) / 2_000.0;
            let q = plan.trajectory.sample(at).position_rad[joint];
            assert!(q >= from.min(to) - 1e-9 && q <= from.max(to) + 1e-9, "joint {joint} goes by {q}");
        }
    }
}

/// An arm outside its limits that stands inside the margin of an obstacle as well.
#[test]
fn start_outside_and_inside_the_margin_is_led_out_of_both() {
    let (robot, mut scene) = (ur5(), scene("pillars"));
    let mut start = pose([-0.5, -0.7, 0.7, -1.57, -1.57, 3.3]);
    // The strict planner refuses the start for its limits: compared with the joint inside.
    let inside = pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]);
    let touches = |turn: f64, margin_m: f64| {
        let mut at = inside;
        at[0] = turn;
        let scene = Scene { margin_m, ..scene.clone() };
        plan(&robot, &scene, &at, &at, &options()).is_err()
    };
    let near = (0..1_000).map(|i| -0.5 + f64::from(i) * 1e-3).find(|turn| touches(*turn, 0.01)).unwrap();
    (start[0], start[5]) = (near - 1e-3, 3.3);
    scene.margin_m = 0.02;
    let goal = pose([-0.5, -0.9, 0.7, -1.57, -1.57, 0.0]);
    let plan = replan(&robot, &scene, &start, &goal).unwrap();
    assert!(plan.how.contains("led inwards first") && plan.how.contains("margin 0.0"), "{}", plan.how);
    assert_comes_in(&robot, &plan.trajectory, "both");
}
