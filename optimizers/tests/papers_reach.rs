//! Lv et al. (2019): its arm and its reward against an independent program, and which methods reach its target.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use taustream_optimizers::papers::reach::{FiveJointArm, Reach, Reward};
use taustream_optimizers::{Problem, Progress, Reading, Run, Setup, by_name};

/// Angles, tip in mm, error in mm, cost: what `oracles/reach.py` prints.
const PYTHON: [([f64; 4], [f64; 3], f64, f64); 8] = [
    ([0.0; 4], [37.0, 0.0, 337.0], 277.375_804_671, 1_770.239_286_73),
    (
        [0.9, 0.92, 0.84, -1.54],
        [151.222_831_66, 190.564_693_997, 172.755_670_492],
        1.231_001_580_38,
        76.315_187_160_8,
    ),
    (
        [0.9, 0.09, 1.13, -0.09],
        [152.247_940_879, 191.856_493_804, 170.602_340_453],
        1.879_143_090_21,
        74.926_669_879,
    ),
    (
        [-2.24, -1.31, 1.06, -1.11],
        [150.469_963_123, 190.237_413_211, 174.900_037_36],
        3.179_525_492_77,
        81.821_143_665_6,
    ),
    (
        [0.89, 0.12, 1.47, -0.67],
        [153.442_428_675, 189.439_939_438, 162.924_776_529],
        9.723_053_262_43,
        85.099_080_944_6,
    ),
    (
        [0.9, 1.49, -0.23, -1.17],
        [151.837_859_782, 191.339_726_739, 171.770_905_438],
        0.804_941_512_731,
        75.633_458_075_1,
    ),
    (
        [0.903, 0.129, 0.903, 0.202],
        [151.101_144_255, 191.588_952_76, 172.184_404_462],
        0.097_429_231_797_8,
        71.986_928_796_9,
    ),
    (
        [-1.1, 0.4, -2.0, 1.3],
        [-27.284_596_595_2, 53.607_674_654_5, 231.847_333_825],
        233.368_118_017,
        1_190.060_337_44,
    ),
];

fn close(what: &str, ours: f64, theirs: f64) {
    assert!((ours - theirs).abs() <= 1e-9 * theirs.abs().max(1.0), "{what}: {ours}, Python has {theirs}");
}

#[test]
fn reach_arm_and_cost_agree_with_the_python_program() {
    let task = FiveJointArm::task(Reading::Corrected);
    for (angles, tip_mm, error_mm, cost) in PYTHON {
        let ours = FiveJointArm::position_m(&angles);
        for (ours, theirs) in ours.iter().zip(tip_mm) {
            close("tip", ours * 1000.0, theirs);
        }
        close("error", task.error_m(&angles) * 1000.0, error_mm);
        close("cost", task.cost(&angles), cost);
    }
}

#[test]
fn reach_refuses_numbers_that_do_not_go_together_and_names_them() {
    let good = FiveJointArm::task(Reading::Corrected);
    assert!(good.checked().is_ok());
    let reward = good.reward;
    let bad = [
        (Reach { start_rad: &[0.0; 3], ..good }, "the start's number of joints is 3"),
        (Reach { start_rad: &[0.0, f64::NAN, 0.0, 0.0], ..good }, "the start is NaN"),
        (Reach { target_m: [0.0, f64::INFINITY, 0.0], ..good }, "the target is inf"),
        (Reach { speeds_rad_s: &[0.2, 0.2, 0.2, 0.0], ..good }, "a speed is 0"),
        (Reach { speeds_rad_s: &[0.2; 5], ..good }, "the number of speeds is 5"),
        (Reach { reward: Reward { inner_m: 1e-3, ..reward }, ..good }, "s is 0.001"),
        (Reach { reward: Reward { error_max_m: 1e-6, ..reward }, ..good }, "the threshold is 0.000005"),
        (Reach { reward: Reward { punishment: f64::NAN, ..reward }, ..good }, "e_max, K or j is NaN"),
    ];
    for (task, text) in bad {
        let refusal = task.checked().err().map(|r| r.to_string()).unwrap_or_default();
        assert!(refusal.contains(text), "{refusal}, not {text}");
    }
}

#[test]
fn reach_reward_agrees_with_the_python_program_and_joins_at_its_inner_threshold() {
    let errors_mm = [1e9, 674.0, 100.0, 1.0, 0.005_000_1, 0.005, 0.001, 1e-6, 0.5e-6, 1e-7, 0.0];
    let theirs = [
        10_000.0,
        10_000.0,
        266.107_628_663,
        68.380_807_686_1,
        67.379_470_090_8,
        0.0,
        -9.600_960_096_01,
        -11.998_799_88,
        -12.0,
        -21.6,
        -24.0,
    ];
    let reward = Reward::PAPER_003;
    for (error_mm, theirs) in errors_mm.into_iter().zip(theirs) {
        close("reward", reward.of(error_mm / 1000.0), theirs);
    }
    // As printed, the inner reward is a punishment where it begins: 8 - 4 e/s at e = 0.01 eps is -392, times -3.
    let printed = Reward { reading: Reading::Printed, ..reward };
    close("printed", printed.of(0.05e-6), 1_176.0);
    close("printed, outside", printed.of(1e-6), reward.of(1e-6));
}

/// Best cost and error in millimetres.
fn run(method: &str, reading: Reading, iterations: usize, seed: u64) -> (f64, f64) {
    let evaluations = Some(iterations * 40);
    let optimizer = by_name(method, Setup { reading, evaluations }).expect("registered");
    let task = FiveJointArm::task(Reading::Corrected);
    let (is_over, mut watch) = (|| false, |_: &Progress| ());
    let evaluations_max = iterations * 44;
    let run = Run { seed, evaluations_max, guesses: &[], is_over: &is_over, watch: &mut watch };
    let found = optimizer.minimise(&task, run).expect("sane");
    (found.cost, task.error_m(&found.x) * 1000.0)
}

/// Goal: ten runs agree with thirty runs of an independent implementation.
#[test]
fn reach_is_solved_by_differences_and_damped_particles_and_not_by_undamped_ones() {
    let reached = |method: &str, iterations: usize| {
        let runs = (1..=10).map(|seed| run(method, Reading::Corrected, iterations, seed));
        runs.filter(|(_, error_mm)| *error_mm <= 0.005).count()
    };
    // There: DE 30 of 30 after 106 generations (median), SPSO 29 of 30 after 116, IEPSO 30 of 30 after 584, GA 3 of 30
    // after 816, the original PSO 0 of 30.
    let counts = [("de", 250), ("spso", 300), ("iepso", 1000), ("ga", 1000), ("pso", 1000)]
        .map(|(method, iterations)| reached(method, iterations));
    assert!(counts[0] == 10 && counts[1] >= 8 && counts[2] >= 9, "DE, SPSO, IEPSO, GA, PSO: {counts:?}");
    assert!(counts[3] <= 4 && counts[4] == 0, "DE, SPSO, IEPSO, GA, PSO: {counts:?}");
}

#[test]
fn reach_is_never_better_than_the_base_joint_alone_allows() {
    // The base has to turn by atan2(0.19162, 0.151171) = 0.9030 rad at 0.2 rad/s; the reward ends at 24.
    let bound = 0.191_62_f64.atan2(0.151_171) / 0.2 - 24.0;
    let costs: Vec<f64> = (1..=6).map(|seed| run("de", Reading::Corrected, 1000, seed).0).collect();
    assert!(costs.iter().all(|c| *c >= bound - 1e-6), "{costs:?} against {bound}");
    // Either way round the arm can go; the other way ends at -12.81.
    assert!(costs.iter().any(|c| *c < -18.0), "{costs:?}");
}

/// Goal: the exchange term as printed pushes every joint to its upper bound.
#[test]
fn reach_by_iepso_as_printed_ends_with_more_angle_than_corrected() {
    let mean_angle = |reading| {
        let optimizer = by_name("iepso", Setup { reading, evaluations: Some(40_000) }).expect("registered");
        let task = FiveJointArm::task(Reading::Corrected);
        let one = |seed| {
            let (is_over, mut watch) = (|| false, |_: &Progress| ());
            let run =
                Run { seed, evaluations_max: 40_000, guesses: &[], is_over: &is_over, watch: &mut watch };
            let x = optimizer.minimise(&task, run).expect("sane").x;
            x.iter().zip(task.bounds()).map(|(x, [low, high])| (x - low) / (high - low)).sum::<f64>() / 4.0
        };
        (1..=10).map(one).sum::<f64>() / 10.0
    };
    let (printed, corrected) = (mean_angle(Reading::Printed), mean_angle(Reading::Corrected));
    assert!(printed > corrected + 0.02, "printed {printed} of the ranges, corrected {corrected}");
}
