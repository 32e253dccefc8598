//! What links keep from each other: in plans, proofs, goals and starts, as the robot file says.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, ur5};
use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
use taustream_planner::collide::SweepRules;
use taustream_planner::plan::{StartMargin, Task, plan_until};
use taustream_planner::world::World;
use taustream_planner::{Plan, PlanError, PlanOptions, PoseOf, Violation, plan, verify};

const HOME: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

fn open() -> Scene {
    Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() }
}

fn options() -> PlanOptions {
    PlanOptions { deadline: Duration::from_secs(5), ..PlanOptions::default() }
}

/// Reading it tries which links touch, in thousands of poses.
static SHIPPED: LazyLock<Robot> = LazyLock::new(ur5);

/// The shipped arm whose links keep `margin_m` from each other.
fn arm(margin_m: f64) -> Robot {
    let mut robot = SHIPPED.clone();
    robot.margins.all_m = margin_m;
    robot
}

fn gap_m(q: &JointArray) -> f64 {
    let (robot, scene) = (arm(0.0), open());
    let world = World::new(&robot, &scene).unwrap();
    world.closest(q).unwrap().1
}

/// The elbow folded until two links are `gap` apart.
fn folded(gap: f64) -> JointArray {
    let at = |elbow: f64| pose([0.0, -1.57, elbow, -1.57, -1.57, 0.0]);
    let (mut free, mut near) = (1.57, 3.1);
    assert!(gap_m(&at(free)) > gap && gap_m(&at(near)) < gap, "no fold of the elbow passes {gap} m");
    for _ in 0..60 {
        let middle = 0.5 * (free + near);
        if gap_m(&at(middle)) > gap { free = middle } else { near = middle }
    }
    at(free)
}

fn replan(robot: &Robot, start: &JointArray, goal: &JointArray) -> Result<Plan, PlanError> {
    let (scene, margin) = (open(), StartMargin::AsItStands);
    let task = Task { robot, scene: &scene, start_rad: *start, goal_rad: *goal, margin };
    plan_until(&task, &options(), None)
}

#[test]
fn goal_between_contact_and_margin_is_refused_unless_the_pair_says_zero() {
    let goal = folded(0.001);
    let error = plan(&arm(0.003), &open(), &pose(HOME), &goal, &options()).unwrap_err();
    assert!(matches!(error, PlanError::InsideMargin { which: PoseOf::Goal, .. }), "{error}");
    let words = error.to_string();
    assert!(words.contains("0.0010 m from") && words.contains("0.0030 m required"), "{words}");

    let mut robot = arm(0.003);
    let PlanError::InsideMargin { contact, .. } = error else { panic!("not a margin") };
    let link = |name: &str| robot.links.iter().position(|link| link == name).unwrap();
    let (a, b) = (link(&contact.between.0), link(&contact.between.1));
    robot.margins.pairs.push(((a.min(b), a.max(b)), 0.0));
    let planned = plan(&robot, &open(), &pose(HOME), &goal, &options()).unwrap();
    assert!(planned.proof.clearance_m < 0.001 && planned.proof.clearance_required_m.abs() < 1e-12);
    // The same motion for the arm with the margin: the proof sees it.
    let refused = verify(&arm(0.003), &open(), &planned.trajectory).unwrap_err();
    assert!(matches!(&refused, Violation::Collision { contact, .. } if !contact.touches()), "{refused}");
    assert!(refused.to_string().starts_with("nearer than the margin"), "{refused}");
}

/// Goal: a swing below the margin between two ends that keep it is seen, however short, and by how much is right.
#[test]
fn proof_sees_a_swing_below_the_margin_between_the_ends() {
    let near = folded(0.004);
    let back = folded(0.0028);
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[2] = back[2] - near[2];
    let there = Stroke { start_s: 0.0, duration_s: 1.0, n: 6, delta_rad };
    delta_rad[2] = -delta_rad[2];
    let again = Stroke { start_s: 1.0, duration_s: 1.0, n: 6, delta_rad };
    let swing = Trajectory::new(6, near, &[there, again]).unwrap();
    for (margin_m, passes) in [(0.0027, true), (0.0029, false), (0.0035, false)] {
        let result = verify(&arm(margin_m), &open(), &swing);
        assert_eq!(result.is_ok(), passes, "margin {margin_m}: {result:?}");
    }
    let proof = verify(&arm(0.0), &open(), &swing).unwrap();
    assert!((0.0018..=0.0028).contains(&proof.clearance_m), "{} m", proof.clearance_m);
}

/// Goal: whatever goal is accepted can be reached: goals must keep what edges need.
#[test]
fn goal_at_the_edge_of_the_margin_is_refused_or_reached() {
    let robot = arm(0.003);
    let mut reached = 0;
    for extra_m in [-1e-4, 5e-5, 1e-4, 1.9e-4, 3e-4, 3.9e-4, 4.2e-4, 6e-4] {
        let result = plan(&robot, &open(), &pose(HOME), &folded(0.003 + extra_m), &options());
        match result {
            Ok(_) => reached += 1,
            Err(PlanError::InsideMargin { which: PoseOf::Goal, .. }) => {
                assert!(extra_m <= SweepRules::EDGE_END_M, "{extra_m} m beyond the margin");
            }
            Err(e) => panic!("{extra_m} m beyond the margin: {e}"),
        }
    }
    assert_eq!(reached, 2);
}

#[test]
fn start_nearer_than_the_margin_of_links_is_led_out_and_a_strict_one_refused() {
    let robot = arm(0.003);
    for gap in [0.0025, 0.001, 0.0004] {
        let start = folded(gap);
        let strict = plan(&robot, &open(), &start, &pose(HOME), &options()).unwrap_err();
        assert!(matches!(strict, PlanError::InsideMargin { which: PoseOf::Start, .. }), "{strict}");
        let plan = replan(&robot, &start, &pose(HOME)).unwrap_or_else(|e| panic!("{gap} m: {e}"));
        assert!(plan.how.starts_with("margin 0.00") && plan.how.contains("for the first"), "{}", plan.how);
        let least_m = (0..=2_000)
            .map(|i| {
                gap_m(
                    &plan
                        .trajectory
                        .sample(plan.trajectory.duration_s() * f64::from(i) / 2_000.0)
                        .position_rad,
                )
            })
            .fold(f64::INFINITY, f64::min);
        assert!(least_m > gap - 5.1e-4, "{gap} m: {least_m} m on the way");
    }
    let touching = folded(-0.001);
    let error = replan(&robot, &touching, &pose(HOME)).unwrap_err();
    assert!(matches!(error, PlanError::InCollision { which: PoseOf::Start, .. }), "{error}");
}
