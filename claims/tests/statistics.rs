//! The tests of significance against scipy (oracles/statistics.py prints the numbers).
use taustream_claims::statistics::{
    Level, Moments, Summary, mann_whitney, median, share, shift, spread, welch, wilcoxon,
};

const LEVEL: Level = Level::FIVE_PERCENT;
const A: [f64; 12] = [0.31, 1.42, -0.77, 2.05, 0.11, 0.93, -1.18, 0.46, 1.71, -0.29, 0.64, 1.09];
const B: [f64; 12] = [0.52, 0.37, -0.91, 1.14, 0.83, -0.46, -1.97, 0.05, 0.22, -0.33, 1.51, -0.72];
const TIED: [f64; 10] = [1.0, 2.0, 2.0, 3.0, 5.0, 5.0, 5.0, 8.0, 8.0, 9.0];
const OTHER: [f64; 10] = [1.0, 1.0, 3.0, 1.0, 4.0, 3.0, 7.0, 5.0, 8.0, 4.0];

fn long() -> (Vec<f64>, Vec<f64>) {
    let i = (0..60).map(f64::from);
    (i.clone().map(|i| (1.7 * i).sin() + 0.2).collect(), i.map(|i| (2.3 * i).cos()).collect())
}

#[track_caller]
fn near(ours: f64, scipy: f64, tolerance: f64) {
    assert!((ours - scipy).abs() <= tolerance * scipy, "{ours} against {scipy}");
}

/// statrs's error function is good to about 1e-10.
const NORMAL: f64 = 1e-9;

#[test]
fn signed_ranks_without_ties_are_counted_exactly() {
    near(wilcoxon(&A, &B).p, 0.063_964_843_75, 1e-14);
    near(wilcoxon(&B, &A).p, 0.063_964_843_75, 1e-14);
}

#[test]
fn signed_ranks_with_ties_and_equal_pairs_are_corrected() {
    let paired = wilcoxon(&TIED, &OTHER);
    assert_eq!((paired.less, paired.more, paired.equal), (2, 6, 2));
    near(paired.p, 0.137_563_893_909_903_28, NORMAL);
}

#[test]
fn signed_ranks_of_many_pairs_are_normal() {
    let (a, b) = long();
    near(wilcoxon(&a, &b).p, 0.231_594_922_770_157_47, NORMAL);
}

#[test]
fn tests_without_pairs_agree_too() {
    let (a, b) = long();
    near(mann_whitney(&A, &B).unwrap(), 0.236_584_093_321_876_13, NORMAL);
    near(mann_whitney(&a, &b).unwrap(), 0.068_166_891_275_851_24, NORMAL);
    for (low, high) in [([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]), ([4.0, 5.0, 6.0], [1.0, 2.0, 3.0])] {
        near(mann_whitney(&low, &high).unwrap(), 0.080_855_598_370_052_24, NORMAL);
    }
    let boa = Moments { n: 30, mean: 28.9127, sd: 0.023 };
    let gwo = Moments { n: 12, mean: 27.9115, sd: 0.89 };
    near(welch(boa, gwo).unwrap(), 0.002_489_508_426_946_215_4, NORMAL);
}

#[test]
fn summary_has_the_quartiles_of_numpy() {
    let s = Summary::of(&A);
    for (ours, numpy) in [(s.q1, 0.01), (s.median, 0.55), (s.q3, 1.1725), (s.mean, 0.54)] {
        assert!((ours - numpy).abs() < 1e-14, "{ours} against {numpy}");
    }
    near(s.sd, 0.976_803_692_942_166_6, 1e-14);
}

#[test]
fn samples_that_say_nothing_have_no_difference() {
    let nothing = wilcoxon(&[], &[]);
    assert!(nothing.p >= 1.0 && !nothing.is_less());
    assert!(wilcoxon(&[1.0; 40], &[1.0; 40]).p >= 1.0);
    let infinite = wilcoxon(&[f64::INFINITY, 1.0], &[f64::INFINITY, f64::NAN]);
    assert!(infinite.equal == 1 && infinite.p >= 1.0);
    assert_eq!(mann_whitney(&[], &[1.0]), None);
    assert_eq!(mann_whitney(&[f64::NAN], &[1.0]), None);
    let single = Moments { n: 1, mean: 0.0, sd: 0.0 };
    assert_eq!(welch(single, single), None);
    let still = |mean| Moments { n: 5, mean, sd: 0.0 };
    assert_eq!((welch(still(1.0), still(1.0)), welch(still(1.0), still(2.0))), (Some(1.0), Some(0.0)));
}

#[test]
fn shifts_shares_medians_and_spreads_have_the_intervals_of_the_oracle() {
    let differences: Vec<f64> = A.iter().zip(&B).map(|(a, b)| a - b).collect();
    let (long_one, _) = long();
    let cases = [
        ("shift", shift(&differences, LEVEL), [0.535, -0.04, 1.14]),
        ("shift at one of four looks", shift(&differences, LEVEL.over(4)), [0.535, -0.29, 1.3]),
        ("share of none", share(0, 30, LEVEL), [0.0, 0.0, 0.113_513_393_173_968_75]),
        ("share of half", share(52, 100, LEVEL), [0.52, 0.423_165_777_652_239_56, 0.615_354_482_419_480_9]),
        ("median", median(&A, LEVEL), [0.55, -0.29, 1.42]),
        (
            "median of many",
            median(&long_one, LEVEL),
            [0.159_340_449_430_604_9, -0.233_765_540_975_684_03, 0.621_778_283_385_981],
        ),
        (
            "spread",
            spread(&A, &B, LEVEL).0,
            [0.030_235_162_374_020_02, -0.621_794_598_573_129_4, 0.682_264_923_321_169_1],
        ),
    ];
    for (what, ours, [value, low, high]) in cases {
        for (ours, scipy) in [(ours.value, value), (ours.interval[0], low), (ours.interval[1], high)] {
            assert!((ours - scipy).abs() <= 1e-9, "{what}: {ours} against {scipy}");
        }
    }
    near(spread(&A, &B, LEVEL).1, 0.924_250_774_621_126_3, NORMAL);
    // Too few for any interval.
    for ours in
        [shift(&differences[..5], LEVEL), shift(&differences[..7], LEVEL.over(4)), median(&A[..5], LEVEL)]
    {
        assert!(ours.interval.iter().all(|end| end.is_infinite()), "{ours:?}");
    }
    assert!(shift(&[], LEVEL).value.is_nan() && share(0, 0, LEVEL).value.is_nan());
}
