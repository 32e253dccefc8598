//! Planning: what it returns is safe by an independent check, what it cannot do it says, and seeds decide.
mod common;
use common::{assert_safe, pose, random_spheres, scene, sphere, ur5, ur5_distances_m};
use std::path::PathBuf;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, LimitSet};
use taustream_optimizers::{METHODS, Problem, Setup, by_name};
use taustream_planner::budget::Budget;
use taustream_planner::refine::{PathProblem, refine};
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::Space;
use taustream_planner::world::World;
use taustream_planner::{Plan, PlanError, PlanOptions, PlannerKind, PoseOf, Remedy, plan, verify};

fn options(seed: u64, deadline_ms: u64, planner: PlannerKind) -> PlanOptions {
    PlanOptions { seed, deadline: Duration::from_millis(deadline_ms), planner, ..PlanOptions::default() }
}

/// A pose that the independent check finds free, away from the edge of the margin.
fn free_pose(robot: &Robot, scene: &Scene, rng: &mut SeededRng) -> JointArray {
    loop {
        let q = pose(std::array::from_fn(|_| rng.within(-3.1, 3.1)));
        let (spheres_m, links_m) = ur5_distances_m(robot, scene, &q);
        if spheres_m > scene.margin_m + 0.01 && links_m > 0.01 {
            return q;
        }
    }
}

/// Goal: no planner returns a motion that an independent dense sampler finds in collision or too fast.
#[test]
fn planned_motions_in_random_scenes_are_safe_by_an_independent_check() {
    let robot = ur5();
    let (mut found, mut round) = (0, 0);
    for seed in 0..25 {
        let mut rng = SeededRng::new(seed, 100);
        let scene = random_spheres(&mut rng);
        let (start, goal) = (free_pose(&robot, &scene, &mut rng), free_pose(&robot, &scene, &mut rng));
        let ibfoa = PlannerKind::from_name("ibfoa").expect("registered");
        let kinds =
            [PlannerKind::Auto, PlannerKind::Straight, PlannerKind::RrtConnect, ibfoa, PlannerKind::Rrt];
        let kind = kinds[usize::try_from(seed).expect("small") % 5];
        let Ok(plan) = plan(&robot, &scene, &start, &goal, &options(seed, 600, kind)) else { continue };
        found += 1;
        round += usize::from(!plan.how.starts_with("straight"));
        assert_safe(&robot, &scene, &plan.trajectory, &goal, &format!("seed {seed}, {}", plan.how));
        let proof = verify(&robot, &scene, &plan.trajectory).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert_eq!(proof, plan.proof, "seed {seed}: the proof is a function of the motion");
    }
    // Random poses of a UR5 in +-pi are often in parts that do not hang together.
    assert!(found >= 10 && round >= 4, "{found} found, {round} of them round something");
}

/// Goal: joints that are slow against what they accelerate at move near the time that their velocity limit asks for, with
/// few strokes: a message holds 512, and a cut has to keep some of them beside its own.
#[test]
fn long_motion_of_slow_joints_fits_into_one_message_near_full_speed() {
    for velocity_rad_s in [0.5, 0.1, 0.01, 1e-3] {
        let mut robot = ur5();
        for joint in &mut robot.joints {
            joint.limits.motion.velocity_rad_s = velocity_rad_s;
        }
        let empty = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
        let (start, goal) =
            (pose([-3.0, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([3.0, -0.7, 0.7, -1.57, -1.57, 0.0]));
        let plan = plan(&robot, &empty, &start, &goal, &options(0, 500, PlannerKind::Auto))
            .unwrap_or_else(|e| panic!("{velocity_rad_s} rad/s: {e}"));
        let (took_s, least_s) = (plan.proof.duration_s, 6.0 / velocity_rad_s);
        assert!(plan.trajectory.strokes().len() <= 64, "{velocity_rad_s} rad/s");
        assert!(took_s < 1.07 * least_s + 0.5, "{velocity_rad_s} rad/s: {took_s} s against {least_s} s");
        assert!(verify(&robot, &empty, &plan.trajectory).is_ok(), "{velocity_rad_s} rad/s");
    }
}

#[test]
fn independent_check_sees_a_motion_through_a_sphere() {
    let robot = ur5();
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    let free = Scene { file: PathBuf::new(), margin_m: 0.02, obstacles: Vec::new(), zones: Vec::new() };
    let through = plan(&robot, &free, &start, &goal, &options(0, 500, PlannerKind::Straight)).expect("free");
    let pillar = Scene { obstacles: vec![sphere("ball", [-0.7, 0.0, 0.3], 0.05)], ..free };
    let caught = std::panic::catch_unwind(|| {
        assert_safe(&robot, &pillar, &through.trajectory, &goal, "planted");
    });
    assert!(caught.is_err(), "the checker itself must fail on a planted fault");
}

#[test]
fn planning_one_seed_gives_one_answer_on_any_thread() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    // Only a run that the clock did not cut promises the same answer; a busy machine may need some tries for one.
    let run = || -> Plan {
        for _ in 0..20 {
            let options = options(7, 2_000, PlannerKind::RrtConnect);
            let plan = plan(&robot, &scene, &start, &goal, &options).expect("found");
            if !plan.how.contains("cut short") {
                return plan;
            }
        }
        panic!("the clock cut in twenty times");
    };
    let first = run();
    let (second, third) = std::thread::scope(|s| {
        let (a, b) = (s.spawn(run), s.spawn(run));
        (a.join().expect("no panic"), b.join().expect("no panic"))
    });
    for other in [second, third] {
        assert_eq!((&first.trajectory, &first.how), (&other.trajectory, &other.how));
    }
    let other_seed = plan(&robot, &scene, &start, &goal, &options(8, 2_000, PlannerKind::RrtConnect));
    assert_ne!(first.trajectory, other_seed.expect("found").trajectory, "another seed, another motion");
}

/// Goal: the plain tree, chosen by name, finds its way round pillars with one tree, and says that it was the one.
#[test]
fn planning_with_the_plain_tree_by_name_goes_round_pillars() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    let rrt = PlannerKind::from_name("rrt").expect("a planner");
    let plan = plan(&robot, &scene, &start, &goal, &options(2, 4_000, rrt)).expect("found");
    assert_eq!(verify(&robot, &scene, &plan.trajectory).as_ref(), Ok(&plan.proof));
    assert!(plan.how.contains("RRT (") && !plan.how.contains("Connect"), "{}", plan.how);
}

/// A goal inside a cage of spheres: every way in is shut, the goal itself is free.
#[test]
fn planning_to_an_unreachable_goal_fails_at_the_deadline_and_says_what_was_tried() {
    let robot = ur5();
    let mut rng = SeededRng::new(3, 0);
    let open = Scene { file: PathBuf::new(), margin_m: 0.0, obstacles: Vec::new(), zones: Vec::new() };
    let goal = free_pose(&robot, &open, &mut rng);
    let start = free_pose(&robot, &open, &mut rng);
    let elbow = common::ur5_origins_m(&goal)[3];
    // Six balls round the elbow's end, each a centimetre from the links beside it, hold the arm where it is.
    let mut obstacles = Vec::new();
    for (i, axis) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
        for sign in [-1.0, 1.0] {
            for reach_m in [0.2, 0.3, 0.4] {
                let center_m = std::array::from_fn(|k| elbow[k] + sign * reach_m * axis[k]);
                let mut ball = sphere(&format!("ball{i}"), center_m, 1e-3);
                let (gap_m, _) =
                    ur5_distances_m(&robot, &Scene { obstacles: vec![ball.clone()], ..open.clone() }, &goal);
                if gap_m > 0.005 {
                    ball.shape = taustream_arm::Shape::Sphere { radius_m: gap_m - 0.002 };
                    obstacles.push(ball);
                }
            }
        }
    }
    let caged = Scene { obstacles, ..open };
    let (start_gap_m, _) = ur5_distances_m(&robot, &caged, &start);
    assert!(caged.obstacles.len() >= 6 && start_gap_m > 0.0, "start {start_gap_m} m");
    // That it comes back at all is what is tried here: how late depends on what else the computer does.
    let result = plan(&robot, &caged, &start, &goal, &options(1, 400, PlannerKind::Auto));
    let Err(PlanError::NotFound { tried, .. }) = result else { panic!("{result:?}") };
    assert!(tried.contains("straight line (blocked") && tried.contains("RRT-Connect"), "{tried}");
}

#[test]
fn planning_bad_poses_are_distinguished_and_named() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let home = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let try_goal =
        |goal| plan(&robot, &scene, &home, &goal, &options(0, 200, PlannerKind::Auto)).unwrap_err();
    let try_start =
        |start| plan(&robot, &scene, &start, &home, &options(0, 200, PlannerKind::Auto)).unwrap_err();

    let far = pose([0.0, -1.57, 4.0, -1.57, -1.57, 0.0]);
    let error = try_goal(far);
    assert!(
        matches!(&error, PlanError::OutsideLimits { which: PoseOf::Goal, joint: 2, name, by_rad, .. }
            if name == "elbow" && (by_rad - 0.8584).abs() < 1e-9),
        "{error:?}"
    );
    assert!(error.to_string().contains("joint 3 (elbow)") && error.to_string().contains("0.8584"), "{error}");
    assert!(matches!(try_start(far), PlanError::OutsideLimits { which: PoseOf::Start, .. }));

    let into_pillar = pose([0.0, -0.7, 0.7, -1.57, -1.57, 0.0]);
    let error = try_goal(into_pillar);
    assert!(error.to_string().contains("front_pillar"), "{error}");
    assert!(matches!(error, PlanError::InCollision { which: PoseOf::Goal, .. }));
    assert!(matches!(try_start(into_pillar), PlanError::InCollision { which: PoseOf::Start, .. }));

    let mut nan = home;
    nan[4] = f64::NAN;
    assert!(matches!(try_goal(nan), PlanError::BadPose { which: PoseOf::Goal, joint: 4, .. }));
    let mut seventh = home;
    seventh[6] = 0.1;
    assert!(matches!(try_goal(seventh), PlanError::BadPose { joint: 6, joints: 6, .. }));
}

#[test]
fn planning_to_where_the_arm_is_gives_a_motion_that_stays() {
    let (robot, scene) = (ur5(), scene("open"));
    let home = pose([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
    let plan = plan(&robot, &scene, &home, &home, &options(0, 200, PlannerKind::Auto)).expect("there");
    assert_eq!((plan.trajectory.base_rad(), plan.trajectory.end_rad()), (&home, home));
    assert_eq!(plan.how, "already there");
}

#[test]
fn planning_without_any_time_fails_clearly() {
    let (robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    for kind in PlannerKind::all() {
        let error = plan(&robot, &scene, &start, &goal, &options(0, 0, kind)).unwrap_err();
        assert!(matches!(error, PlanError::NotFound { remedy: Remedy::Clock(_), .. }), "{kind:?}: {error}");
        assert!(error.to_string().contains("deadline"), "{error}");
    }
}

/// Goal: a longer deadline is advised only where it can help.
#[test]
fn planning_that_more_time_cannot_help_names_what_can() {
    let (mut robot, scene) = (ur5(), scene("pillars"));
    let (start, goal) =
        (pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0]));
    let error = |robot: &Robot, kind| {
        plan(robot, &scene, &start, &goal, &options(0, 2_000, kind)).unwrap_err().to_string()
    };
    let straight = error(&robot, PlannerKind::Straight);
    assert!(straight.contains("front_pillar") && straight.contains("try another planner"), "{straight}");
    assert!(!straight.contains("deadline"), "{straight}");
    let rested = robot.joints[0].limits.motion;
    for spoil in [
        LimitSet { velocity_rad_s: 2.794_826e-8, ..rested },
        LimitSet { acceleration_rad_s2: 1e-11, ..rested },
        LimitSet { jerk_rad_s3: 1e-15, ..rested },
    ] {
        robot.joints[0].limits.motion = spoil;
        let slow = error(&robot, PlannerKind::Auto);
        assert!(
            slow.starts_with("the motion would take at least ") && slow.contains("(shoulder_pan)"),
            "{slow}"
        );
        assert!(slow.contains("velocity_rad_s = ") && !slow.contains("deadline"), "{slow}");
        // A joint that does not move does not matter.
        let still = plan(&robot, &scene, &start, &start, &options(0, 2_000, PlannerKind::Auto));
        assert!(still.is_ok(), "{still:?}");
    }
}

#[test]
fn planner_names_are_read_as_they_are_written() {
    for kind in PlannerKind::all() {
        assert_eq!(PlannerKind::from_name(kind.name()), Some(kind));
    }
    assert_eq!(PlannerKind::from_name("teleport"), None);
}

/// Goal: whichever method is chosen by name, refinement proposes a path between the same ends that is no dearer than
/// the one it was given.
#[test]
fn refinement_takes_every_optimiser_by_name() {
    let mut rng = SeededRng::new(3, 100);
    let (robot, scene) = (ur5(), random_spheres(&mut rng));
    let world = World::new(&robot, &scene).expect("builds");
    let budget = Budget::unbounded();
    let space = Space::new(&world, &budget);
    let line = [free_pose(&robot, &scene, &mut rng), free_pose(&robot, &scene, &mut rng)];
    let problem = PathProblem::new(&space, line[0], line[1]);
    for method in METHODS {
        let optimizer =
            by_name(method.name, Setup { evaluations: Some(150), ..Setup::default() }).expect("named");
        let (corners, found) = refine(&problem, &line, optimizer.as_ref(), 150, 1)
            .expect("sane")
            .expect("something was evaluated");
        assert_eq!((corners.len(), [corners[0], corners[4]]), (5, line), "{}", method.name);
        let straight: Vec<f64> = (1..4)
            .flat_map(|i| (0..6).map(move |j| line[0][j] + (line[1][j] - line[0][j]) * f64::from(i) / 4.0))
            .collect();
        assert!(found.cost <= problem.cost(&straight) + 1e-6, "{}: {}", method.name, found.cost);
        assert!(found.progress.evaluations <= 150, "{}", method.name);
    }
}
