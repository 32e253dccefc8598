//! Counts and angles: the one formula that turns setpoints into what a drive is sent.
use super::SeededRng;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use taustream_drivers::codec::cia402::{CountScale, counts_from_rad, rad_from_counts};
use taustream_drivers::codec::cia402_words::interpolation_period;

fn servo(sign: f64, gear_ratio: f64, counts_per_rev: f64, zero_offset_rad: f64) -> CountScale {
    CountScale { sign, gear_ratio, counts_per_rev, zero_offset_rad }
}

#[test]
fn encoding_of_known_angles_gives_the_counts_worked_out_by_hand() {
    let plain = servo(1.0, 101.0, 131_072.0, 0.0);
    assert_eq!(counts_from_rad(&plain, 0.0), 0);
    // A quarter turn: 101 * 131072 / 4.
    assert_eq!(counts_from_rad(&plain, FRAC_PI_2), 3_309_568);
    assert_eq!(counts_from_rad(&plain, -FRAC_PI_2), -3_309_568);
    // Reversed motor, zero a quarter turn below: link angle 0 is a quarter turn above zero, and counts fall.
    let turned = servo(-1.0, 101.0, 131_072.0, -FRAC_PI_2);
    assert_eq!(counts_from_rad(&turned, -FRAC_PI_2), 0);
    assert_eq!(counts_from_rad(&turned, 0.0), -3_309_568);
    // Half a turn of a 10:1 gear with 1000 counts.
    assert_eq!(counts_from_rad(&servo(1.0, 10.0, 1_000.0, 0.0), PI), 5_000);
    assert_eq!(counts_from_rad(&servo(1.0, 10.0, 1_000.0, PI), PI), 0);
}

#[test]
fn encoding_of_halves_rounds_away_from_zero() {
    // With 2 pi counts a turn an angle is its own count, exactly.
    let own = servo(1.0, 1.0, TAU, 0.0);
    for (rad, counts) in [(0.5, 1), (-0.5, -1), (1.5, 2), (-1.5, -2), (2.5, 3), (-2.5, -3), (0.499_999, 0)] {
        assert_eq!(counts_from_rad(&own, rad), counts, "{rad}");
    }
    let reversed = servo(-1.0, 1.0, TAU, 0.0);
    assert_eq!((counts_from_rad(&reversed, 2.5), counts_from_rad(&reversed, -2.5)), (-3, 3));
}

#[test]
fn encoding_at_the_ends_of_i32_saturates() {
    let own = servo(1.0, 1.0, TAU, 0.0);
    assert_eq!(counts_from_rad(&own, 2_147_483_647.0), i32::MAX);
    assert_eq!(counts_from_rad(&own, -2_147_483_648.0), i32::MIN);
    for (rad, counts) in [(1e300, i32::MAX), (f64::INFINITY, i32::MAX), (-1e300, i32::MIN), (f64::NAN, 0)] {
        assert_eq!(counts_from_rad(&own, rad), counts, "{rad}");
    }
}

#[test]
fn encoding_there_and_back_gives_the_same_counts() {
    for seed in 0..20_000 {
        let mut rng = SeededRng::from_seed(seed);
        let sign = if rng.chance(0.5) { 1.0 } else { -1.0 };
        let any = servo(sign, rng.within(1.0, 200.0), rng.within(500.0, 2e6), rng.within(-7.0, 7.0));
        let counts = i32::from(rng.word() >> 2) * (1 << 15) + i32::from(rng.word()) - (1 << 28);
        let rad = rad_from_counts(&any, counts);
        assert_eq!(counts_from_rad(&any, rad), counts, "seed {seed}");
        let step_rad = TAU / (any.gear_ratio * any.counts_per_rev);
        let angle = rng.within(-7.0, 7.0);
        let error = (rad_from_counts(&any, counts_from_rad(&any, angle)) - angle).abs();
        assert!(error <= 0.5 * step_rad * (1.0 + 1e-6) + 1e-14, "seed {seed}: off by {error:e} rad");
    }
}

#[test]
fn interpolation_period_is_exact_or_refused() {
    let cases = [
        (1_000, Some((1, -3))),
        (2_000, Some((2, -3))),
        (500, Some((5, -4))),
        (250, Some((250 / 10, -5))),
        (125, Some((125, -6))),
        (1_250, Some((125, -5))),
        (10_000, Some((1, -2))),
        (0, None),
        (1_001, None),
    ];
    for (period_us, expected) in cases {
        assert_eq!(interpolation_period(period_us), expected, "{period_us} us");
    }
}
