//! Wang et al. (2022): its random cases and its planning problem.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
#[path = "../../planner/tests/common/mod.rs"]
mod common;
use common::{pose, ur5};
use taustream_optimizers::cost::{CostModel, paper_cost};
use taustream_optimizers::papers::control_point_count::Growth;
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case};
use taustream_optimizers::{End, Parallel, Problem, Progress, Run, Setup, Solution, by_name};

fn case(seed: u64) -> Case {
    Case::random(&ur5(), &CostModel::default(), seed).expect("a UR5 has room")
}

#[test]
fn paper_cases_leave_both_ends_free_and_repeat() {
    for seed in 0..20 {
        let case = case(seed);
        assert_eq!((case.scene.obstacles.len(), &self::case(seed)), (3, &case));
        for end in case.ends_rad {
            // The paper's limit is 0.1 m from the bare segment.
            let bare_m = common::ur5_segments_to_spheres_m(&case.scene, &end);
            assert!(bare_m >= 0.1 - 1e-9, "seed {seed}: an end is {bare_m} m from a sphere");
        }
    }
    assert_ne!(case(1), case(2));
}

#[test]
fn paper_cases_have_their_spheres_in_the_box() {
    let (robot, model) = (ur5(), CostModel::default());
    for (seed, size, is_ours) in [(1, 0.6, false), (2, 1.0, true), (3, 5.0, false)] {
        let centres_m = Case::CENTRES_M.map(|ends| ends.map(|end| size * end));
        let case = Case::random_within(&robot, &model, &centres_m, seed).expect("room");
        for obstacle in &case.scene.obstacles {
            let at = obstacle.pose.translation.vector;
            let is_inside = centres_m.iter().zip(at.iter()).all(|([low, high], x)| low <= x && x <= high);
            assert!(is_inside, "{at} is not in {centres_m:?}");
        }
        assert_eq!(is_ours, Case::random(&robot, &model, seed) == Some(case), "size {size}");
    }
}

#[test]
fn paper_problem_costs_what_its_motion_costs() {
    let (robot, case) = (ur5(), case(3));
    let problem = case.problem(&robot, CONTROL_POINTS, CostModel::default()).expect("fits");
    let straight = problem.straight();
    assert_eq!((straight.len(), problem.bounds().len()), (6 * CONTROL_POINTS, 18));
    let motion = problem.motion(&straight).expect("a motion");
    let cost = paper_cost(&robot, &case.scene, &motion, &CostModel::default()).expect("fits");
    // The motion's poses are at start + duration * share, the table's at share: they round differently.
    let exact = problem.rate_exactly(&straight).expect("a decision vector");
    assert!((exact.cost / cost.cost - 1.0).abs() < 1e-12 && cost.poses == 481, "{exact:?}, {cost:?}");
    assert_eq!((exact.poses, exact.collision), (cost.poses, cost.collision));
    // The straight line is the least joint travel that there is.
    let travel: f64 = (0..6).map(|j| (case.ends_rad[1][j] - case.ends_rad[0][j]).abs()).sum();
    assert!((cost.joint_travel_rad - travel).abs() < 1e-9, "{cost:?}, {travel}");
    let mut bent = straight.clone();
    bent[6] += 1.0;
    assert!(
        problem.motion(&bent).expect("a motion").sample(12.0).position_rad[0]
            > motion.sample(12.0).position_rad[0] + 0.99
    );
    for bad in [vec![], vec![0.0; 12], vec![f64::NAN; 18], vec![0.0; 24]] {
        assert!(problem.cost(&bad).is_infinite(), "{bad:?}");
    }
    assert_eq!(pose([0.0; 6]).len(), case.ends_rad[0].len());
}

/// Goal: the paper's methods take its problem, and threads change nothing.
#[test]
fn paper_problem_is_improved_by_its_methods_alike_on_any_number_of_threads() {
    let (robot, case) = (ur5(), case(5));
    let problem = case.problem(&robot, CONTROL_POINTS, CostModel::default()).expect("fits");
    let go = |method: &str, problem: &dyn Problem| -> Solution {
        let optimizer =
            by_name(method, Setup { evaluations: Some(400), ..Setup::default() }).expect("registered");
        let (is_over, mut watch) = (|| false, |_: &Progress| ());
        let run = Run { seed: 1, evaluations_max: 400, guesses: &[], is_over: &is_over, watch: &mut watch };
        optimizer.minimise(problem, run).expect("sane")
    };
    for method in ["ibfoa", "bso", "gwo"] {
        let found = go(method, &problem);
        let spread = go(method, &Parallel { problem: &problem, threads: 2 });
        assert_eq!(found, spread, "{method}");
        let first = go(method, &problem).progress;
        assert!(found.end != End::Cut && found.cost < 1e9 && first == found.progress, "{method}: {found:?}");
    }
}

/// Goal: the criterion takes one control point where the straight line is free, more where it pays, and never an answer
/// that is dearer than one it left out by more than what it asks another to save.
#[test]
fn growth_takes_as_many_control_points_as_pay() {
    let (robot, model) = (ur5(), CostModel::default());
    let greedy = by_name("greedy-bfoa", Setup::default()).expect("registered");
    let growth = Growth { control_points_max: 4, evaluations_each: 150, saves: 0.02 };
    let mut counts = Vec::new();
    for seed in 0..8 {
        let case = case(seed);
        let problem = |count: usize| case.problem(&robot, count, model);
        let chosen = growth.choose(&problem, greedy.as_ref(), 1, &|| false).expect("sane");
        let one = problem(1).expect("sane");
        let straight = one.rate_exactly(&one.straight()).expect("rated");
        assert!(chosen.cost <= straight.cost + 1e-6, "seed {seed}: dearer than the straight line");
        let own = problem(chosen.control_points).expect("sane").rate_exactly(&chosen.x).expect("rated");
        assert!((own.cost - chosen.cost).abs() <= 0.0 && own.collision == chosen.collides, "seed {seed}");
        assert!(chosen.evaluations <= 150 * 4, "seed {seed}");
        if !straight.collision {
            // Its joint travel is the least there is, and the rest of the cost is small beside it.
            assert_eq!((chosen.control_points, chosen.collides), (1, false), "seed {seed}");
            assert!(chosen.evaluations <= 300, "seed {seed}: went on though nothing paid");
        }
        counts.push(chosen.control_points);
        assert_eq!(growth.choose(&problem, greedy.as_ref(), 1, &|| false).expect("sane"), chosen);
    }
    assert!(counts.contains(&1) && counts.iter().any(|c| *c > 1), "{counts:?}");
    let case = case(0);
    let problem = |count: usize| case.problem(&robot, count, model);
    for bad in [
        Growth { control_points_max: 0, ..growth },
        Growth { evaluations_each: 0, ..growth },
        Growth { saves: f64::NAN, ..growth },
    ] {
        assert!(bad.choose(&problem, greedy.as_ref(), 1, &|| false).is_err(), "{bad:?}");
    }
}
