//! Starts inside the margin or at its edge: an arm that stopped there, or sagged, is led out.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, scene, sphere, ur5, ur5_distances_m};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::budget::Budget;
use taustream_planner::plan::{StartMargin, Task, plan_through_until, plan_until};
use taustream_planner::rng::SeededRng;
use taustream_planner::world::World;
use taustream_planner::{Blend, Plan, PlanError, PlanOptions, PlannerKind, PoseOf, Violation, plan, verify};

const START: [f64; 6] = [-0.5, -0.7, 0.7, -1.57, -1.57, 0.0];
const GOAL: [f64; 6] = [0.5, -0.7, 0.7, -1.57, -1.57, 0.0];

fn options(seed: u64, planner: PlannerKind) -> PlanOptions {
    PlanOptions { seed, deadline: Duration::from_secs(5), planner, ..PlanOptions::default() }
}

fn replan(robot: &Robot, scene: &Scene, start: &JointArray, goal: &JointArray) -> Result<Plan, PlanError> {
    let (start_rad, goal_rad, margin) = (*start, *goal, StartMargin::AsItStands);
    plan_until(&Task { robot, scene, start_rad, goal_rad, margin }, &options(1, PlannerKind::Auto), None)
}

/// The least distance to an obstacle, by the world that the planner uses.
fn distance_m(world: &World, q: &JointArray) -> f64 {
    world.closest(q).expect("obstacles").1
}

/// Where the arm stands when it swings from START towards the front pillar and stops `gap_m` before it.
fn near_pillar(robot: &Robot, scene: &Scene, gap_m: f64) -> JointArray {
    let world = World::new(robot, scene).expect("builds");
    let at = |turn: f64| pose([-0.5 + turn, -0.7, 0.7, -1.57, -1.57, 0.0]);
    let turns = (0..=100).map(|i| f64::from(i) * 0.01);
    let nearest = turns.min_by(|a, b| distance_m(&world, &at(*a)).total_cmp(&distance_m(&world, &at(*b))));
    let (mut free, mut near) = (0.0, nearest.expect("turns"));
    assert!(distance_m(&world, &at(free)) > gap_m && distance_m(&world, &at(near)) < gap_m);
    for _ in 0..60 {
        let middle = 0.5 * (free + near);
        if distance_m(&world, &at(middle)) > gap_m { free = middle } else { near = middle }
    }
    at(free)
}

/// When a motion has left the margin for good, and the least distance before: dense samples.
fn leaves(robot: &Robot, scene: &Scene, motion: &Trajectory) -> (f64, f64) {
    let world = World::new(robot, scene).expect("builds");
    let (mut left_s, mut least_m) = (0.0, f64::INFINITY);
    for i in 0..=2_000 {
        let t_s = motion.duration_s() * f64::from(i) / 2_000.0;
        if world.contact(&motion.sample(t_s).position_rad).is_some() {
            left_s = t_s;
            least_m = least_m.min(distance_m(&world, &motion.sample(t_s).position_rad));
        }
    }
    (left_s, least_m)
}

#[test]
fn replan_start_inside_the_margin_leaves_it_soon_and_says_so() {
    let (robot, scene) = (ur5(), scene("pillars"));
    for gap_m in [0.0185, 0.0117, 0.004, 0.0015] {
        let start = near_pillar(&robot, &scene, gap_m);
        for goal in [pose(START), pose(GOAL)] {
            let plan = replan(&robot, &scene, &start, &goal).unwrap_or_else(|e| panic!("{gap_m} m: {e}"));
            println!("{gap_m} m: {:.2} s, {}", plan.proof.duration_s, plan.how);
            let margin = format!("margin {:.4} m for the first ", gap_m - 5e-4);
            let why = "s: the start is nearer to front_pillar than 0.0200 m";
            assert!(plan.how.starts_with(&margin) && plan.how.contains(why), "{}", plan.how);
            let (left_s, least_m) = leaves(&robot, &scene, &plan.trajectory);
            assert!(left_s < 0.5 * plan.trajectory.duration_s(), "{gap_m} m: left at {left_s} s");
            assert!(
                least_m > gap_m - 5e-4 && plan.proof.clearance_m > gap_m - 5e-4,
                "{gap_m} m: {least_m} m"
            );
            assert_eq!(plan.trajectory.base_rad().map(f64::to_bits), start.map(f64::to_bits));
            let end = plan.trajectory.end_rad();
            assert!(end.iter().zip(&goal).all(|(e, g)| (e - g).abs() < 1e-9), "ends at {end:?}");
            // Who is strict stays so.
            let error = verify(&robot, &scene, &plan.trajectory).unwrap_err();
            let words = "nearer than the margin from t = 0.000 s: ";
            assert!(error.to_string().starts_with(words), "{error}");
            assert!(error.to_string().contains("less than the 0.0200 m required"), "{error}");
        }
    }
}

/// Goal: a motion through way points begins where the arm stands, inside the margin too, and keeps its corners; who is strict refuses it.
#[test]
fn replan_through_points_from_inside_the_margin_leaves_it_soon_and_says_so() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let via = pose([-0.6, -0.9, 0.9, -1.4, -1.57, 0.3]);
    for gap_m in [0.0185, 0.004, 0.0015] {
        let start = near_pillar(&robot, &scene, gap_m);
        let points = [start, via, pose(START)];
        let near = PlanOptions { blend: Blend::Radians(0.05), ..options(1, PlannerKind::Auto) };
        let through = |margin| plan_through_until((&robot, &scene, margin), &points, &near, None);
        let strict = through(StartMargin::Scene);
        assert!(
            matches!(strict, Err(PlanError::InsideMargin { which: PoseOf::Start, .. })),
            "{gap_m} m: {strict:?}"
        );
        let plan = through(StartMargin::AsItStands).unwrap_or_else(|e| panic!("{gap_m} m: {e}"));
        let margin = format!("margin {:.4} m for the first ", gap_m - 5e-4);
        assert!(plan.how.starts_with(&margin), "{}", plan.how);
        let (left_s, least_m) = leaves(&robot, &scene, &plan.trajectory);
        assert!(
            left_s < 0.5 * plan.trajectory.duration_s() && least_m > gap_m - 5e-4,
            "{gap_m} m: {least_m} m"
        );
        assert_eq!(plan.trajectory.base_rad().map(f64::to_bits), start.map(f64::to_bits));
        let end = plan.trajectory.end_rad();
        assert!(end.iter().zip(&points[2]).all(|(e, g)| (e - g).abs() < 1e-9), "ends at {end:?}");
        let passes = (0..=2_000).map(|i| {
            let t_s = plan.trajectory.duration_s() * f64::from(i) / 2_000.0;
            let at_rad = plan.trajectory.sample(t_s).position_rad;
            at_rad.iter().zip(&via).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        });
        assert!(
            passes.fold(f64::INFINITY, f64::min) < 0.4,
            "{gap_m} m: the way point is passed too far away"
        );
    }
}

/// Goal: what is proven for the first stretch is not what is proven after it.
/// Method: an independent sampler on spheres; starts that are pushed against one of them, random goals.
#[test]
fn replan_from_inside_the_margin_of_spheres_keeps_what_it_says_by_an_independent_check() {
    let robot = ur5();
    let mut planned = 0;
    for seed in 0..150 {
        let mut rng = SeededRng::new(seed, 300);
        let free = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
        let start = pose(std::array::from_fn(|_| rng.within(-2.0, 2.0)));
        let goal = pose(std::array::from_fn(|_| rng.within(-2.0, 2.0)));
        let gap_m = rng.within(0.002, 0.019);
        let mut ball = sphere("ball", [rng.within(-0.6, 0.6), rng.within(-0.6, 0.6), 0.6], 1e-6);
        let one = |ball| Scene { obstacles: vec![ball], ..free.clone() };
        let (room_m, links_m) = ur5_distances_m(&robot, &one(ball.clone()), &start);
        if !(0.04..0.4).contains(&room_m) || links_m < 0.01 {
            continue;
        }
        ball.shape = taustream_arm::Shape::Sphere { radius_m: room_m - gap_m };
        let scene = one(ball);
        let (goal_m, goal_links_m) = ur5_distances_m(&robot, &scene, &goal);
        if goal_m < 0.03 || goal_links_m < 0.01 {
            continue;
        }
        let Ok(plan) = replan(&robot, &scene, &start, &goal) else { continue };
        planned += 1;
        let said: f64 = plan.how.split(' ').nth(6).expect("a time").parse().expect("a number");
        assert!(plan.how.contains("for the first"), "seed {seed}: {}", plan.how);
        for i in 0..=3_000 {
            let t_s = plan.trajectory.duration_s() * f64::from(i) / 3_000.0;
            let (ball_m, links_m) =
                ur5_distances_m(&robot, &scene, &plan.trajectory.sample(t_s).position_rad);
            // Said to a hundredth of a second.
            let keep_m = if t_s > said + 0.005 { 0.02 } else { gap_m - 6e-4 };
            assert!(ball_m > keep_m && links_m > 0.0, "seed {seed}: {ball_m} m at {t_s} s; {}", plan.how);
        }
    }
    assert!(planned >= 8, "{planned} planned");
}

/// A margin so wide that no short way leads out of it: the arm can be moved all the same.
#[test]
fn replan_start_with_no_exit_nearby_keeps_the_reduced_margin_throughout_and_says_so() {
    let robot = ur5();
    let (start, goal) =
        (pose([0.0, -0.4, 0.2, -1.57, -1.57, 0.0]), pose([2.9, -1.3, 0.7, -1.57, -1.57, 0.0]));
    let at = |x: f64| Scene {
        file: PathBuf::new(),
        margin_m: 0.6,
        obstacles: vec![sphere("ball", [-x, 0.0, 0.2], 0.02)],
        zones: Vec::new(),
    };
    let (mut near, mut far) = (0.7, 1.7);
    for _ in 0..50 {
        let middle = 0.5 * (near + far);
        let (gap_m, _) = ur5_distances_m(&robot, &at(middle), &start);
        if gap_m < 0.05 { near = middle } else { far = middle }
    }
    let scene = at(far);
    let plan = replan(&robot, &scene, &start, &goal).unwrap_or_else(|e| panic!("{far} m: {e}"));
    let words = "margin 0.0495 m along the whole motion: the start is nearer to ball than 0.6000 m; ";
    assert!(plan.how.starts_with(words), "{}", plan.how);
    for i in 0..=1_000 {
        let t_s = plan.trajectory.duration_s() * f64::from(i) / 1_000.0;
        let (ball_m, _) = ur5_distances_m(&robot, &scene, &plan.trajectory.sample(t_s).position_rad);
        assert!(ball_m > 0.0494, "{ball_m} m at {t_s} s");
    }
}

#[test]
fn planning_strictly_distinguishes_touching_from_being_near_and_touching_starts_stay_refused() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let near = near_pillar(&robot, &scene, 0.0112);
    let strict = |start: &JointArray, goal: &JointArray| {
        plan(&robot, &scene, start, goal, &options(0, PlannerKind::Auto)).unwrap_err()
    };
    let error = strict(&near, &pose(START));
    assert!(matches!(&error, PlanError::InsideMargin { which: PoseOf::Start, .. }), "{error}");
    let words = "start nearer than the margin";
    let by = "is 0.0112 m from front_pillar, 0.0088 m less than the 0.0200 m required";
    assert!(error.to_string().starts_with(words) && error.to_string().contains(by), "{error}");
    assert!(matches!(strict(&pose(START), &near), PlanError::InsideMargin { which: PoseOf::Goal, .. }));

    for gap_m in [-0.01, 0.000_9] {
        let touching = near_pillar(&robot, &scene, gap_m);
        let error = replan(&robot, &scene, &touching, &pose(START)).unwrap_err();
        let touches = matches!(error, PlanError::InCollision { which: PoseOf::Start, .. });
        let near = matches!(error, PlanError::InsideMargin { which: PoseOf::Start, .. });
        assert!(if gap_m < 0.0 { touches } else { near }, "{error}");
    }
    // The goal keeps the full margin whoever asks.
    let error = replan(&robot, &scene, &pose(START), &near).unwrap_err();
    assert!(matches!(error, PlanError::InsideMargin { which: PoseOf::Goal, .. }), "{error}");
}

/// Goal: a pose on a proven motion is a start, wherever the arm was stopped on it.
/// Method: stops all along motions that go as near as the margin, and at the very point that is nearest.
#[test]
fn replan_from_anywhere_on_a_verified_motion_is_never_refused() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let world = World::new(&robot, &scene).expect("builds");
    let mut at_the_edge = 0;
    for seed in 0..3 {
        let kind = [PlannerKind::RrtConnect, PlannerKind::Auto, PlannerKind::RrtConnect][seed];
        let motion =
            plan(&robot, &scene, &pose(START), &pose(GOAL), &options(seed as u64, kind)).expect("found");
        let duration_s = motion.trajectory.duration_s();
        let nearest = (0..=5_000).map(|i| duration_s * f64::from(i) / 5_000.0).min_by(|a, b| {
            let d = |t: f64| distance_m(&world, &motion.trajectory.sample(t).position_rad);
            d(*a).total_cmp(&d(*b))
        });
        // Searches keep more than the margin where there is room: with the margin that the motion just keeps, it goes along the edge.
        let least_m =
            nearest.map_or(0.0, |t_s| distance_m(&world, &motion.trajectory.sample(t_s).position_rad));
        let scene = Scene { margin_m: scene.margin_m.max(least_m - 5e-4), ..scene.clone() };
        let world = World::new(&robot, &scene).expect("builds");
        let stops = (0..=8).map(|i| duration_s * f64::from(i) / 8.0).chain(nearest);
        for t_s in stops {
            let start = motion.trajectory.sample(t_s).position_rad;
            assert!(world.contact(&start).is_none(), "seed {seed}: proven, and yet too near at {t_s} s");
            at_the_edge += u32::from(distance_m(&world, &start) < scene.margin_m + 8e-4);
            for goal in [START, GOAL] {
                let requested =
                    PlanOptions { deadline: Duration::from_secs(2), ..options(5, PlannerKind::RrtConnect) };
                let task = Task {
                    robot: &robot,
                    scene: &scene,
                    start_rad: start,
                    goal_rad: pose(goal),
                    margin: StartMargin::AsItStands,
                };
                plan_until(&task, &requested, None)
                    .unwrap_or_else(|e| panic!("seed {seed}, stopped at {t_s} s: {e}"));
            }
        }
    }
    assert!(at_the_edge > 0, "no stop was at the edge of the margin: the test shows nothing");
}

/// Goal: a hair outside of the margin is a start for the strict planner, too, and keeps the margin.
#[test]
fn planning_start_a_hair_outside_the_margin_is_led_out_under_the_full_margin() {
    let (robot, scene) = (ur5(), scene("pillars"));
    for hair_m in [1e-5, 1e-4, 4e-4] {
        let start = near_pillar(&robot, &scene, scene.margin_m + hair_m);
        let plan = plan(&robot, &scene, &start, &pose(GOAL), &options(2, PlannerKind::Auto))
            .unwrap_or_else(|e| panic!("{hair_m} m outside: {e}"));
        assert!(!plan.how.contains("margin"), "{}", plan.how);
        verify(&robot, &scene, &plan.trajectory).expect("proven with the full margin");
        let proof_of_nothing = verify(&robot, &Scene { margin_m: 0.021, ..scene.clone() }, &plan.trajectory);
        assert!(matches!(proof_of_nothing, Err(Violation::Collision { .. })));
    }
}

#[test]
fn budget_that_is_over_stays_over_and_an_unbounded_one_is_not() {
    let budget = Budget::until(Duration::ZERO, None);
    assert!(budget.is_over() && budget.was_cut() && budget.is_over_after(1));
    let endless = Budget::unbounded();
    assert!((0..10_000).all(|_| !endless.is_over_after(100)) && !endless.was_cut());
}
