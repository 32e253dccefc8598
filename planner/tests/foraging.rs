//! Foraging in joint space: what comes back is a path of proven edges, and virtual obstacles lead out of traps.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{config, pose, scene, ur5};
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use taustream_arm::{Robot, Scene};
use taustream_motion::JointArray;
use taustream_planner::budget::Budget;
use taustream_planner::foraging::{Foraged, Numbers, forage};
use taustream_planner::rng::SeededRng;
use taustream_planner::tree::Space;
use taustream_planner::world::World;

const CHECKS: usize = 20_000;

fn search(
    world: &World,
    budget: &Budget,
    numbers: &Numbers,
    seed: u64,
    ends: [&JointArray; 2],
) -> (Foraged, usize) {
    let space = Space::new(world, budget);
    let foraged = forage(&space, ends, numbers, CHECKS, &mut SeededRng::new(seed, 0)).expect("sane numbers");
    (foraged, space.checks())
}

/// From between two pillars to between the next two: the straight line hits the one in the middle.
fn pillars() -> (Robot, Scene, [JointArray; 2]) {
    let ends = [pose([-0.5, -0.7, 0.7, -1.57, -1.57, 0.0]), pose([0.5, -0.7, 0.7, -1.57, -1.57, 0.0])];
    (ur5(), scene("pillars"), ends)
}

#[test]
fn found_path_is_made_of_proven_edges_and_one_seed_gives_it_on_any_thread() {
    let (robot, scene, [start, goal]) = pillars();
    let world = World::new(&robot, &scene).expect("builds");
    let run = |seed| search(&world, &Budget::unbounded(), &Numbers::ROBUST, seed, [&start, &goal]);
    let mut paths = Vec::new();
    for seed in 0..4 {
        let (foraged, checks) = run(seed);
        let path = foraged.path.clone().unwrap_or_else(|| panic!("seed {seed}: {foraged:?}"));
        assert_eq!((path.first(), path.last()), (Some(&start), Some(&goal)), "seed {seed}");
        let budget = Budget::unbounded();
        let space = Space::new(&world, &budget);
        assert!(path.windows(2).all(|p| space.is_edge_free(&p[0], &p[1])), "seed {seed}");
        assert!(checks <= CHECKS + 4_000, "seed {seed}: {checks} poses"); // One edge more, at most.
        paths.push(path);
    }
    assert_ne!(paths[0], paths[1], "another seed, another path");
    let elsewhere = std::thread::scope(|s| s.spawn(|| run(0)).join().expect("no panic"));
    assert_eq!(elsewhere.0.path.as_ref(), Some(&paths[0]));
}

/// Goal: the escape is what gets the arm round the pillar; the same search without it, on the same budget, is held by
/// the trap more often.
#[test]
fn virtual_obstacles_lead_out_of_traps_that_hold_plain_foraging() {
    let (robot, scene, [start, goal]) = pillars();
    let world = World::new(&robot, &scene).expect("builds");
    let (mut robust, mut plain, mut set) = (0, 0, 0);
    for seed in 0..12 {
        let [with, without] = [Numbers::ROBUST, Numbers::PLAIN]
            .map(|numbers| search(&world, &Budget::unbounded(), &numbers, seed, [&start, &goal]).0);
        robust += u32::from(with.path.is_some());
        plain += u32::from(without.path.is_some());
        set += with.virtuals.len();
        assert!(without.virtuals.is_empty() && with.restarts == 0, "seed {seed}");
    }
    println!("with {robust} of 12 ({set} virtual obstacles), without {plain} of 12");
    assert!(robust > plain && set > 0, "with {robust} of 12 ({set} virtual obstacles), without {plain}");
}

#[test]
fn budget_clock_and_cancellation_end_a_search() {
    let (robot, scene, [start, goal]) = pillars();
    let world = World::new(&robot, &scene).expect("builds");
    let budget = Budget::unbounded();
    let nothing =
        forage(&Space::new(&world, &budget), [&start, &goal], &Numbers::ROBUST, 0, &mut SeededRng::new(0, 0));
    assert_eq!(nothing, Ok(Foraged::default()));
    let cancelled = AtomicBool::new(true);
    for budget in [Budget::until(Duration::ZERO, None), Budget::until(Duration::MAX, Some(&cancelled))] {
        let (foraged, checks) = search(&world, &budget, &Numbers::ROBUST, 0, [&start, &goal]);
        assert_eq!(foraged.path, None);
        assert!(checks < 1_000, "{checks} poses after the end");
    }
}

#[test]
fn numbers_that_make_no_sense_are_refused_by_name() {
    let (robot, scene, [start, goal]) = pillars();
    let world = World::new(&robot, &scene).expect("builds");
    let budget = Budget::unbounded();
    let sane = Numbers::ROBUST;
    for (numbers, word) in [
        (Numbers { bacteria: 0, ..sane }, "bacteria"),
        (Numbers { bacteria: usize::MAX, ..sane }, "bacteria"),
        (Numbers { observed: 0, ..sane }, "observed"),
        (Numbers { trace_max: 0, ..sane }, "trace"),
        (Numbers { virtual_max: usize::MAX, ..sane }, "virtual"),
        (Numbers { step_m: 0.0, ..sane }, "step"),
        (Numbers { step_m: f64::NAN, ..sane }, "step"),
        (Numbers { goal_depth: f64::NAN, ..sane }, "depth"),
        (Numbers { retreat_m: -1.0, ..sane }, "length"),
        (Numbers { obstacle: [f64::INFINITY, 1.0], ..sane }, "height"),
    ] {
        let space = Space::new(&world, &budget);
        let refused = forage(&space, [&start, &goal], &numbers, 100, &mut SeededRng::new(0, 0));
        let words = refused.expect_err(word).to_string();
        assert!(words.contains(word), "{words}");
    }
}

/// Where start and goal are one pose, the goal is a step away, or the arm has another number of joints.
#[test]
fn odd_questions_are_answered() {
    let robot = Robot::load(&config("robots/piper.toml")).expect("shipped");
    let empty = Scene::default();
    let world = World::new(&robot, &empty).expect("builds");
    let middle = pose(std::array::from_fn(|j| {
        let [low, high] = robot.joints[j].limits.position_rad;
        0.5 * (low + high)
    }));
    for by_rad in [0.0, 1e-9, 0.05] {
        let mut goal = middle;
        goal[0] += by_rad;
        let (foraged, _) = search(&world, &Budget::unbounded(), &Numbers::ROBUST, 1, [&middle, &goal]);
        assert_eq!(foraged.path, Some(vec![middle, goal]), "{by_rad} rad away");
    }
}
