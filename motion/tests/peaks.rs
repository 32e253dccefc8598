//! Peak constants against 40-digit arithmetic, and stroke durations against what they promise.
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
mod common;
use common::{SeededRng, random_limits, ur5_limits};
use taustream_motion::duration::{best_n, joints_duration_s, stroke_duration_s};
use taustream_motion::limits::check_motion;
use taustream_motion::peaks::{PeakConstants, peak_constants};
use taustream_motion::profile::{K_MIN, Profile, Quintic, Septic, TauJ, TauJStar};
use taustream_motion::stroke::{DURATION_S_MIN, N_MAX, N_MIN, Phi};
use taustream_motion::{LimitSet, MAX_JOINTS, Stroke, Trajectory};

/// Written by `peak_constants.py` with 60-digit arithmetic, 40 digits kept.
const TABLE: &str = include_str!("peak_constants.csv");

/// m, the text of n or k, and the five constants in the order of [`five`].
fn table() -> Vec<(u32, &'static str, [f64; 5])> {
    TABLE
        .lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let numbers: Vec<f64> = cells[2..].iter().map(|cell| cell.parse().unwrap()).collect();
            (cells[0].parse().unwrap(), cells[1], numbers.try_into().unwrap())
        })
        .collect()
}

fn five(peaks: &PeakConstants) -> [f64; 5] {
    [peaks.c_v, peaks.c_a, peaks.c_j, peaks.c_a_positive, peaks.c_a_negative]
}

#[test]
fn peak_constants_of_every_n_and_k_agree_with_forty_digits_to_1e_13() {
    let (mut integers, mut reals) = (0, 0);
    for (m, name, exact) in table() {
        let peaks = if name.contains('.') {
            reals += 1;
            let k = name.parse().unwrap();
            if m == 3 { TauJ::new(k).unwrap().peaks() } else { TauJStar::new(k).unwrap().peaks() }
        } else {
            integers += 1;
            peak_constants(name.parse().unwrap())
        };
        for (ours, exact) in five(&peaks).into_iter().zip(exact) {
            let gap = (ours / exact - 1.0).abs();
            assert!(gap < 1e-13, "m {m}, {name}: {ours} against {exact}, off by {gap:e}");
        }
    }
    assert_eq!((integers, reals), (61, 16), "the table is not whole");
}

/// An earlier, independent computation of ours printed seven digits for five k: the checked-in table must round to it.
#[test]
fn table_of_forty_digits_rounds_to_the_published_one() {
    #[rustfmt::skip]
    let printed: [(&str, [f64; 3], [f64; 3]); 5] = [
        ("0.05", [3.263653, 16.36712, 193.7824], [3.298026, 18.64240, 216.4454]),
        ("0.10", [2.651965, 11.21866, 102.2533], [2.842782, 14.43764, 138.6536]),
        ("0.20", [2.212613, 8.606914, 58.49256], [2.519250, 12.60072, 108.4394]),
        ("0.25", [2.109384, 8.341679, 62.58266], [2.449979, 12.76186, 134.4240]),
        ("0.30", [2.041054, 8.456113, 88.85285], [2.410094, 13.42815, 202.9964]),
    ];
    for (k, tau_j, tau_j_star) in printed {
        for (m, printed) in [(3, tau_j), (4, tau_j_star)] {
            let (.., exact) = table().into_iter().find(|row| row.0 == m && row.1 == k).unwrap();
            for (exact, printed) in exact.into_iter().zip(printed) {
                // Half a unit of the seventh digit.
                let unit = 10_f64.powf(printed.log10().floor() - 6.0);
                assert!((exact - printed).abs() <= 0.500_001 * unit, "m {m}, k {k}: {exact} and {printed}");
            }
        }
    }
}

/// Independent of any formula: no sample of a profile may exceed its peaks, and some sample comes close.
#[test]
fn peaks_of_every_profile_bound_a_dense_scan_tightly() {
    let mut profiles: Vec<(String, Box<dyn Profile>)> =
        vec![("quintic".into(), Box::new(Quintic)), ("septic".into(), Box::new(Septic))];
    for k in [1e-3, 0.015, 0.1, 0.18, 0.215, 0.25, 0.28, 0.3, 0.32] {
        profiles.push((format!("Tau-J {k}"), Box::new(TauJ::new(k).unwrap())));
        profiles.push((format!("Tau-J* {k}"), Box::new(TauJStar::new(k).unwrap())));
    }
    for (name, profile) in profiles {
        let peaks = profile.peaks();
        let mut seen = [0.0_f64; 5];
        for step in 0..=200_000 {
            let phi = profile.at(f64::from(step) / 200_000.0);
            let values = [phi.d1.abs(), phi.d2.abs(), phi.d3.abs(), phi.d2, -phi.d2];
            for (seen, value) in seen.iter_mut().zip(values) {
                *seen = seen.max(value);
            }
        }
        for (peak, seen) in five(&peaks).into_iter().zip(seen) {
            assert!(seen <= peak * (1.0 + 1e-12), "{name}: {seen} beyond {peak}");
            assert!(seen >= peak * (1.0 - 1e-5), "{name}: {peak} is never met, only {seen}");
        }
        for (s, value) in [
            (peaks.s_v, profile.at(peaks.s_v).d1.abs() / peaks.c_v),
            (peaks.s_a, profile.at(peaks.s_a).d2.abs() / peaks.c_a),
            (peaks.s_j, profile.at(peaks.s_j).d3.abs() / peaks.c_j),
        ] {
            assert!((value - 1.0).abs() < 1e-9, "{name}: {value} of the peak at s = {s}");
        }
    }
    assert!(TauJStar::new(K_MIN).unwrap().peaks().c_j.is_finite());
}

/// Goal: the duration is shortest: one limit is met exactly, none exceeded.
#[test]
fn stroke_of_its_shortest_duration_meets_one_limit_and_exceeds_none() {
    for seed in 0..2_000 {
        let mut rng = SeededRng::from_seed(seed);
        let limits = random_limits(&mut rng)[0].motion;
        let (delta, n) = (rng.within(-3.0, 3.0), rng.whole(N_MIN, N_MAX));
        let duration_s = stroke_duration_s(delta, &limits, n);
        let c = peak_constants(n);
        let used = [
            c.c_v * delta.abs() / duration_s / limits.velocity_rad_s,
            c.c_a * delta.abs() / duration_s.powi(2) / limits.acceleration_rad_s2,
            c.c_j * delta.abs() / duration_s.powi(3) / limits.jerk_rad_s3,
        ];
        let most = used.into_iter().fold(0.0, f64::max);
        assert!((most - 1.0).abs() < 1e-12 || duration_s == DURATION_S_MIN, "seed {seed}: {used:?}");
    }
}

/// The same for several joints, by the proof over the real motion: accepted as it is, refused when 1 % faster.
#[test]
fn joints_timed_exactly_to_a_limit_pass_and_one_percent_less_time_does_not() {
    for seed in 0..300 {
        let mut rng = SeededRng::from_seed(seed);
        let limits = random_limits(&mut rng);
        let delta_rad = rng.joints(6, 3.0);
        let n = rng.whole(N_MIN, N_MAX);
        let exact_s = joints_duration_s(&delta_rad, &limits, n);
        let make = |duration_s| {
            let stroke = Stroke { start_s: 0.4, duration_s, n, delta_rad };
            Trajectory::new(6, [0.0; MAX_JOINTS], &[stroke]).unwrap()
        };
        let proof = check_motion(&make(exact_s), &limits);
        assert!(proof.is_ok(), "seed {seed}: {}", proof.unwrap_err());
        let refusal = check_motion(&make(exact_s * 0.99), &limits).unwrap_err();
        assert!(refusal.proven, "seed {seed}: {refusal}");
        assert!(refusal.value > refusal.limit * 1.009, "seed {seed}: not at its worst: {refusal}");
    }
}

#[test]
fn best_n_is_no_longer_than_any_other() {
    for seed in 0..50 {
        let mut rng = SeededRng::from_seed(seed);
        let (limits, delta_rad) = (random_limits(&mut rng), rng.joints(6, 2.0));
        let (n, best_s) = best_n(&delta_rad, &limits);
        assert_eq!(best_s.to_bits(), joints_duration_s(&delta_rad, &limits, n).to_bits());
        for n in N_MIN..=N_MAX {
            assert!(best_s <= joints_duration_s(&delta_rad, &limits, n), "seed {seed}, n {n}");
        }
    }
    // Of equal ones the smallest: no move takes the least duration with any n.
    assert_eq!(best_n(&[0.0; MAX_JOINTS], &ur5_limits()), (N_MIN, DURATION_S_MIN));
    // Measured before by other code: 1 rad at the UR5's limits takes 1.46 times the jerk-limited optimum of 0.628 s.
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[0] = 1.0;
    let (_, best_s) = best_n(&delta_rad, &ur5_limits());
    assert!((best_s / 0.628 - 1.46).abs() < 0.01, "{best_s}");
}

#[test]
fn duration_without_a_usable_limit_is_infinite_and_of_no_move_is_least() {
    let good = LimitSet { velocity_rad_s: 1.0, acceleration_rad_s2: 1.0, jerk_rad_s3: 1.0 };
    for bad in [0.0, -1.0, f64::NAN] {
        for limits in [
            LimitSet { velocity_rad_s: bad, ..good },
            LimitSet { acceleration_rad_s2: bad, ..good },
            LimitSet { jerk_rad_s3: bad, ..good },
        ] {
            assert!(stroke_duration_s(1.0, &limits, 10).is_infinite());
            assert!((stroke_duration_s(0.0, &limits, 10) - DURATION_S_MIN).abs() < f64::EPSILON);
        }
    }
    assert!(stroke_duration_s(f64::NAN, &good, 10).is_infinite());
    assert_eq!(Phi::at(0, 0.5), Phi::at(N_MIN, 0.5), "an n that is too small counts as the smallest");
}
