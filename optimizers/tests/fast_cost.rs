//! The fast cost against the plain one, through what users of the library see.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
#[path = "../../planner/tests/common/mod.rs"]
mod common;
use common::{config, sphere, ur5};
use std::f64::consts::PI;
use std::path::PathBuf;
use taustream_arm::rng::SeededRng;
use taustream_arm::{Robot, Scene};
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::cost::{ControlPointCost, CostError, CostModel, Level, PaperCost};
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case};
use taustream_optimizers::{Problem, Progress, Reading, Run, Setup, by_name};

/// Decision vectors between the straight line and anything.
fn vectors(problem: &ControlPointCost, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = SeededRng::new(seed, 0);
    let straight = problem.straight();
    let one = |i: usize| {
        let spread = [0.01, 0.3, 1.0, 3.0][i % 4];
        straight.iter().map(|x| (x + spread * rng.within(-1.0, 1.0)).clamp(-PI, PI)).collect()
    };
    (0..count).map(one).collect()
}

fn random_case(robot: &Robot, points: usize, model: CostModel, seed: u64) -> ControlPointCost<'_> {
    let case = Case::random(robot, &model, seed).expect("room");
    case.problem(robot, points, model).expect("fits")
}

/// Goal: nothing but the path's length is approximate, for any arm, numbers of the model and instructions.
#[test]
fn fast_cost_has_the_yardsticks_penalty_and_a_path_within_a_hundred_thousandth() {
    let paper = CostModel::default();
    let models = [
        paper,
        CostModel { waypoints_per_segment: 17, ..paper },
        CostModel { expansion_m: 0.0, weights: [7000.0, 300.0, 1e5], ..paper },
        CostModel { reading: Reading::Printed, expansion_m: 2.0, ..paper },
    ];
    let piper = Robot::load(&config("robots/piper.toml")).expect("shipped");
    for robot in [ur5(), piper] {
        let (mut worst, mut hits, mut all) = (0.0_f64, 0, 0);
        for (seed, model) in (0..).zip(models) {
            // The printed sum is taken without the draw, whose ends keep off the spheres.
            let case = Case::random(&robot, &paper, seed).expect("room");
            for points in [1, CONTROL_POINTS, 6] {
                let problem = case.problem(&robot, points, model).expect("fits");
                for level in Level::available() {
                    let problem = problem.clone().on(level);
                    for x in vectors(&problem, 40, seed) {
                        let (fast, plain) =
                            (problem.rate(&x).expect("x"), problem.rate_exactly(&x).expect("x"));
                        let same = |c: PaperCost| (c.penalty.to_bits(), c.collision, c.poses);
                        assert_eq!(same(fast), same(plain), "seed {seed}, {}, {x:?}", level.name());
                        worst = worst.max((fast.path_length_m / plain.path_length_m - 1.0).abs());
                        let cost = (fast.cost / plain.cost - 1.0).abs();
                        assert!(cost < 4e-5, "{}: cost {cost:e}", level.name());
                        hits += u32::from(plain.collision);
                        all += 1;
                    }
                }
            }
        }
        println!("{}: path {worst:e}, {hits} of {all} collide", robot.name);
        assert!(worst < 1e-5 && hits * 30 > all && hits * 10 < all * 9, "{worst:e}, {hits} of {all}");
    }
}

/// Goal: what an optimiser reports is the reference's cost.
#[test]
fn winner_is_evaluated_again_by_the_reference_cost() {
    let robot = ur5();
    let problem = random_case(&robot, CONTROL_POINTS, CostModel::default(), 2);
    let (is_over, mut watch) = (|| false, |_: &Progress| ());
    let run = Run { seed: 4, evaluations_max: 300, guesses: &[], is_over: &is_over, watch: &mut watch };
    let optimizer = by_name("gwo", Setup { evaluations: Some(300), ..Setup::default() }).expect("registered");
    let found = optimizer.minimise(&problem, run).expect("sane");
    let exact = problem.rate_exactly(&found.x).expect("x").cost;
    assert_eq!((found.cost.to_bits(), found.progress.best.to_bits()), (exact.to_bits(), exact.to_bits()));
    assert_ne!(exact.to_bits(), problem.cost(&found.x).to_bits(), "the fast cost happens to be exact here");
}

#[test]
fn fast_cost_of_what_makes_no_sense_is_refused_or_infinite() {
    let robot = ur5();
    let scene = Scene {
        file: PathBuf::new(),
        margin_m: 0.0,
        obstacles: vec![sphere("a", [0.4, 0.3, 0.5], 0.1)],
        zones: Vec::new(),
    };
    let ends: [JointArray; 2] = [[0.1; MAX_JOINTS], [1.0; MAX_JOINTS]];
    let new = |ends, points| ControlPointCost::new(&robot, &scene, ends, points, CostModel::default());
    for points in [0, 101, usize::MAX] {
        assert!(matches!(new(ends, points), Err(CostError::Model { .. })), "{points} control points");
    }
    assert!(matches!(new([[f64::NAN; MAX_JOINTS], ends[1]], 1), Err(CostError::Model { .. })));
    let problem = new(ends, 2).expect("fits");
    for bad in [vec![], vec![0.0; 11], vec![0.0; 13], vec![f64::NAN; 12], vec![f64::INFINITY; 12]] {
        assert!(problem.rate(&bad).is_none() && problem.cost(&bad).is_infinite(), "{bad:?}");
    }
    // Angles of many turns are the reference's.
    for far in [1e3, 1e9, 1e300] {
        let (fast, plain) = (problem.rate(&[far; 12]), problem.rate_exactly(&[far; 12]));
        assert_eq!(fast.map(|c| c.penalty.to_bits()), plain.map(|c| c.penalty.to_bits()), "{far}");
    }
}
