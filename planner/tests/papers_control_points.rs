//! Seed paper 000: its random cases and its planning problem.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
mod common;
use common::{pose, ur5};
use taustream_planner::optimize::{End, Found, Parallel, Problem, Progress, Run, Setup, by_name};
use taustream_planner::papers::control_points::{CONTROL_POINTS, Case};
use taustream_planner::{CostModel, paper_cost};

fn case(seed: u64) -> Case {
    Case::draw(&ur5(), &CostModel::default(), seed).expect("a UR5 has room")
}

#[test]
fn paper_cases_leave_both_ends_free_and_repeat() {
    for seed in 0..20 {
        let case = case(seed);
        assert_eq!((case.scene.obstacles.len(), &self::case(seed)), (3, &case));
        for end in case.ends_rad {
            let (spheres_m, _) = common::ur5_distances_m(&ur5(), &case.scene, &end);
            // The helper takes the link's radius off; the paper's limit is 0.1 m from the bare segment.
            let bare_m = spheres_m + common::UR5_RADIUS_M;
            assert!(bare_m >= 0.1 - 1e-9, "seed {seed}: an end is {bare_m} m from a sphere");
        }
    }
    assert_ne!(case(1), case(2));
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
    let go = |method: &str, problem: &dyn Problem| -> Found {
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
