//! Li, Xing and Qin (2025): its spline against scipy (`oracles/spline.py`), and its objective of time and impact.
#![expect(clippy::expect_used, reason = "helpers of tests; a failure in them fails the test")]
use taustream_optimizers::papers::spline::{Spline, SplineError};
use taustream_optimizers::papers::spline_time::{HARD, SplineTime};
use taustream_optimizers::{Problem, Progress, Reading, Run, Setup, by_name};

const POINTS_RAD: [f64; 6] = [0.3, -1.2, 0.8, 0.75, 2.1, -0.4];
const TIMES_S: [f64; 5] = [0.9, 1.7, 0.4, 2.2, 1.1];
/// Time, then position to snap, as scipy has them.
const SCIPY: [(f64, [f64; 5]); 7] = [
    (0.0, [0.3, 0.0, 0.0, 0.0, -283.151_673_234]),
    (0.31, [0.233_131_587_999, -0.749_939_977_115, -5.574_931_365_71, -16.836_072_349_9, 91.334_262_423_5]),
    (0.9, [-1.2, -3.283_389_959_41, 1.944_763_272_4, 28.844_188_852_7, -16.791_394_241_6]),
    (2.05, [-0.432_969_501_894, 3.513_450_769_94, -1.883_099_287_52, -21.108_874_926_3, 29.028_396_225_2]),
    (2.6, [0.8, 0.608_145_111_181, -5.658_719_419_44, 10.393_596_333_4, 58.708_997_925_2]),
    (4.4, [3.599_472_624_09, 1.591_909_354_24, -7.909_969_473_21, -12.641_355_397_6, 38.941_715_923_9]),
    (6.3, [-0.4, 0.0, 0.0, 0.0, 211.442_383_724]),
];
const SCIPY_JERK_RMS: f64 = 16.480_526_542_8;

fn points(joints: usize) -> Vec<Vec<f64>> {
    POINTS_RAD.iter().map(|p| (0..joints).map(|j| p * (j as f64 + 1.0)).collect()).collect()
}

#[test]
fn spline_and_its_derivatives_agree_with_scipy() {
    let spline = Spline::through(&points(2), &TIMES_S).expect("a spline");
    assert!((spline.total_s() - 6.3).abs() < 1e-12 && spline.joints() == 2);
    for (time_s, theirs) in SCIPY {
        for (order, theirs) in theirs.into_iter().enumerate() {
            for joint in 0..2 {
                let ours = spline.at(joint, time_s, order).expect("a joint");
                let theirs = theirs * (joint as f64 + 1.0);
                let gap = (ours - theirs).abs();
                assert!(
                    gap < 1e-8 * theirs.abs().max(1.0),
                    "order {order} at {time_s} s: {ours}, scipy {theirs}"
                );
            }
        }
    }
    assert_eq!((spline.at(2, 1.0, 0), spline.at(0, 1.0, 9)), (None, Some(0.0)));
}

#[test]
fn spline_goes_through_its_points_and_joins_up_to_the_sixth_derivative() {
    let spline = Spline::through(&points(1), &TIMES_S).expect("a spline");
    let joins = spline.joins_s();
    assert_eq!(joins.len(), 6);
    for (time_s, point) in joins.iter().zip(POINTS_RAD) {
        assert!((spline.at(0, *time_s, 0).expect("there") - point).abs() < 1e-10);
    }
    for time_s in &joins[1..5] {
        for order in 0..=6 {
            let [before, after] = [-1e-9, 1e-9].map(|d| spline.at(0, time_s + d, order).expect("there"));
            let next = spline.at(0, *time_s, order + 1).expect("there").abs();
            let gap = (before - after).abs();
            // The seventh derivative jumps; by order six it is what the gap is made of.
            assert!(gap < 1e-5 * (1.0 + next + before.abs()), "order {order} at {time_s}: a jump of {gap:e}");
        }
    }
}

#[test]
fn spline_refuses_what_does_not_fit_and_names_it() {
    let one = |points: &[f64]| points.iter().map(|p| vec![*p]).collect::<Vec<_>>();
    let bad = [
        (one(&[1.0]), vec![], "1 points are given"),
        (one(&[]), vec![], "0 points are given"),
        (one(&[0.0; 501]), vec![1.0; 500], "501 points are given"),
        (one(&[0.0, 1.0]), vec![1.0, 1.0], "2 intervals are given for 2 points"),
        (one(&[0.0, 1.0, 2.0]), vec![1.0, 0.0], "interval 1 (from 0) lasts 0 s"),
        (one(&[0.0, 1.0]), vec![f64::NAN], "interval 0 (from 0) lasts NaN s"),
        (one(&[0.0, 1.0, 2.0]), vec![f64::MAX, f64::MAX], "a finite time above 0"),
        (one(&[0.0, f64::NAN]), vec![1.0], "point 1 (from 0) has 1 joints or one that is no number"),
        (vec![vec![0.0, 1.0], vec![0.0]], vec![1.0], "point 1 (from 0) has 1 joints"),
        (one(&[0.0, 1.0, 2.0, 0.0]), vec![1.0, 1e-300, 1.0], "differ too much"),
    ];
    for (points, times, text) in bad {
        let refusal = Spline::through(&points, &times).expect_err(text).to_string();
        assert!(refusal.contains(text), "{refusal}, not {text}");
    }
    let extreme = Spline::through(&one(&[0.0, 1.0, 0.5]), &[1e-8, 1.0]);
    let is_sane = match &extreme {
        Ok(s) => {
            s.at(0, f64::NAN, 0).is_some_and(f64::is_finite) && s.at(0, 1e300, 3).is_some_and(f64::is_finite)
        }
        Err(e) => matches!(e, SplineError::Singular { .. }),
    };
    assert!(is_sane, "{extreme:?}");
}

#[test]
fn spline_time_refuses_limits_that_are_none() {
    for (limits, text) in [
        (vec![], "joint 0 (from 0 of 1) has the limit NaN"),
        (vec![[1.0; 3]; 2], "joint 1 (from 0 of 1) has the limit NaN"),
        (vec![[1.0, f64::NAN, 1.0]], "joint 0 (from 0 of 1) has the limit NaN"),
        (vec![[1.0, 1.0, 0.0]], "has the limit 0;"),
    ] {
        let refusal = SplineTime::new(&points(1), &limits, [0.1, 3.0], Reading::Corrected).expect_err(text);
        assert!(refusal.to_string().contains(text), "{refusal}");
    }
    assert!(SplineTime::new(&points(1), &[[1.0; 3]], [f64::NAN, 3.0], Reading::Corrected).is_err());
}

#[test]
fn spline_time_adds_up_as_printed_and_as_corrected() {
    let wide = [[1e9; 3]];
    let printed = SplineTime::new(&points(1), &wide, [0.1, 3.0], Reading::Printed).expect("a problem");
    let evaluated = printed.evaluate(&TIMES_S).expect("a spline");
    assert!((evaluated.jerk_rad_s3 - SCIPY_JERK_RMS).abs() < 1e-8 * SCIPY_JERK_RMS, "{evaluated:?}");
    assert!((evaluated.cost - (0.4 * 6.3 + 0.6 * SCIPY_JERK_RMS)).abs() < 1e-7, "{evaluated:?}");

    // Jerk is broken by half of its limit, speed by nothing, acceleration is none.
    let peak = [3.6, 9.0, 36.0];
    let jerk = evaluated_peak(&TIMES_S);
    let tight = [[peak[0] * 9.0, peak[1] * 9.0, jerk / 1.5]];
    let printed = SplineTime::new(&points(1), &tight, [0.1, 3.0], Reading::Printed).expect("a problem");
    let broken = printed.evaluate(&TIMES_S).expect("a spline");
    assert_eq!(broken.broken, 1);
    assert!((broken.cost - evaluated.cost - 0.5).abs() < 1e-9, "{broken:?}");
    let corrected = SplineTime::new(&points(1), &tight, [0.1, 3.0], Reading::Corrected).expect("a problem");
    let hard = corrected.evaluate(&TIMES_S).expect("a spline");
    assert!((hard.excess - 0.5).abs() < 1e-9 && hard.cost > HARD * 0.5, "{hard:?}");
}

/// The highest jerk at the samples of the objective.
fn evaluated_peak(times_s: &[f64]) -> f64 {
    let spline = Spline::through(&points(1), times_s).expect("a spline");
    let joins = spline.joins_s();
    let samples =
        joins.windows(2).flat_map(|p| (0..=24).map(move |i| p[0] + (p[1] - p[0]) * f64::from(i) / 24.0));
    samples.map(|t| spline.at(0, t, 3).expect("there").abs()).fold(0.0, f64::max)
}

/// Goal: the objective does what it is for: the optimised motion is better than even times, and keeps its limits.
#[test]
fn spline_time_optimised_beats_even_times_within_the_limits() {
    let limits = [[4.0, 12.0, 60.0]];
    let problem = SplineTime::new(&points(1), &limits, [0.2, 6.0], Reading::Corrected).expect("a problem");
    for method in ["isma", "sma", "de"] {
        let optimizer =
            by_name(method, Setup { evaluations: Some(2_000), ..Setup::default() }).expect("registered");
        let (is_over, mut watch) = (|| false, |_: &Progress| ());
        let run = Run { seed: 1, evaluations_max: 2_000, guesses: &[], is_over: &is_over, watch: &mut watch };
        let found = optimizer.minimise(&problem, run).expect("sane");
        let evaluated = problem.evaluate(&found.x).expect("a spline");
        let even =
            (1..=58).map(|i| problem.cost(&[0.2 + 0.1 * f64::from(i); 5])).fold(f64::INFINITY, f64::min);
        assert!(evaluated.broken == 0 && evaluated.cost < even, "{method}: {evaluated:?}, even times {even}");
    }
}
