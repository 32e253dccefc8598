//! The time scale: a chain of changes of any durations, at any instants, stays in its range and is smooth.
mod common;
use common::{SeededRng, slope};
use proptest::prelude::*;
use taustream_motion::ramp::SHAPES;
use taustream_motion::time_scale::{RAMP_S_MAX, RAMPS_MAX, Ramp, Scale, TimeScale, scaled};
use taustream_motion::{MAX_JOINTS, Setpoint};

fn ramp(start_s: f64, duration_s: f64, shape: usize) -> Ramp {
    Ramp { start_s, duration_s, shape: &SHAPES[shape % SHAPES.len()] }
}

/// A scale with up to eight changes that overlap, of different durations, and when the last was asked for.
fn chain(rng: &mut SeededRng) -> (TimeScale, f64) {
    let mut scale = TimeScale::settled(rng.within(0.0, 1.0));
    let mut now_s = rng.within(0.0, 100.0);
    for _ in 0..rng.whole(1, 8) {
        now_s += rng.within(0.0, 0.1);
        let later_s = if rng.whole(0, 3) == 0 { rng.within(0.0, 0.3) } else { 0.0 };
        let shape = rng.whole(0, 5) as usize;
        let ramp = ramp(now_s + later_s, rng.within(0.02, 0.8), shape);
        let target = [0.0, 1.0, rng.within(-0.2, 1.2)][rng.whole(0, 2) as usize];
        scale.change(target, ramp, now_s);
    }
    (scale, now_s)
}

#[test]
fn sigma_under_any_changes_stays_in_its_range_and_differentiates_to_its_derivatives() {
    for seed in 0..500 {
        let mut rng = SeededRng::from_seed(seed);
        let (scale, from_s) = chain(&mut rng);
        for _ in 0..60 {
            let t_s = from_s + rng.within(0.0, 1.5);
            let exact = scale.sample(t_s);
            assert!((0.0..=1.0).contains(&exact.sigma), "seed {seed}: {exact:?}");
            let d1 = slope(|t| scale.sample(t).sigma, t_s, 1e-4);
            let d2 = slope(|t| scale.sample(t).sigma_d1_s, t_s, 1e-4);
            // A change of 0.02 s has second derivatives of 1e4.
            assert!((d1 - exact.sigma_d1_s).abs() < 1e-3, "seed {seed} at {t_s}: {d1} {exact:?}");
            assert!((d2 - exact.sigma_d2_s2).abs() < 5.0, "seed {seed} at {t_s}: {d2} {exact:?}");
        }
    }
}

fn bits(scale: Scale) -> [u64; 3] {
    [scale.sigma, scale.sigma_d1_s, scale.sigma_d2_s2].map(f64::to_bits)
}

#[test]
fn time_scale_once_settled_is_exactly_what_was_requested() {
    for seed in 0..300 {
        let mut rng = SeededRng::from_seed(seed);
        let (mut scale, now_s) = chain(&mut rng);
        let target = if seed % 2 == 0 { 0.0 } else { rng.within(0.0, 1.0) };
        if !scale.change(target, ramp(now_s, 0.4, 0), now_s) {
            continue;
        }
        assert!(!scale.is_settled(now_s) && !scale.is_settled(now_s + 0.399));
        let end_s = now_s + 0.4 + 1e-9;
        assert!(scale.is_settled(end_s));
        assert_eq!(bits(scale.sample(end_s)), [target.to_bits(), 0, 0], "seed {seed}");
        let advance_s = scale.advance_s(end_s, end_s + 0.001);
        assert_eq!(advance_s.to_bits(), (target * ((end_s + 0.001) - end_s)).to_bits(), "seed {seed}");
    }
}

#[test]
fn changes_that_have_no_weight_are_forgotten_without_changing_a_bit() {
    let mut compared = 0;
    for seed in 0..300 {
        let mut rng = SeededRng::from_seed(seed);
        let (scale, now_s) = chain(&mut rng);
        let mut forgot = scale;
        let later_s = now_s + rng.within(0.0, 0.6);
        // A change far ahead has no weight yet; asking for it forgets.
        if !forgot.change(0.5, ramp(later_s + 10.0, 1.0, 0), later_s) {
            continue;
        }
        compared += 1;
        for _ in 0..50 {
            let at_s = later_s + rng.within(0.0, 0.9);
            assert_eq!(bits(forgot.sample(at_s)), bits(scale.sample(at_s)), "seed {seed}");
        }
    }
    assert!(compared > 200, "{compared}");
}

#[test]
fn changes_beyond_the_slots_are_refused_and_three_slots_are_kept_back_for_stops() {
    let mut scale = TimeScale::settled(1.0);
    let mut taken = 0;
    while scale.can_change(0.01) {
        assert!(scale.change(0.5, ramp(0.01, 1.0, taken), 0.01));
        taken += 1;
    }
    assert_eq!(taken, RAMPS_MAX - 3);
    for _ in 0..3 {
        assert!(scale.change(0.0, ramp(0.02, 0.5, 0), 0.02));
    }
    let before = scale;
    assert!(!scale.change(1.0, ramp(0.03, 0.5, 0), 0.03));
    assert_eq!(bits(scale.sample(0.2)), bits(before.sample(0.2)));
    assert_eq!(bits(scale.sample(0.6)), [0, 0, 0]);
    assert!(scale.can_change(0.6));
}

#[test]
fn change_that_has_not_begun_is_dropped_without_a_trace() {
    let mut scale = TimeScale::settled(1.0);
    assert!(scale.change(0.0, ramp(0.0, 0.3, 0), 0.0));
    let before = scale;
    assert!(scale.change(1.0, ramp(0.3, 0.5, 0), 0.1));
    assert_eq!(scale.requested().to_bits(), 1.0_f64.to_bits());
    scale.drop_pending(0.2);
    assert_eq!(scale.requested().to_bits(), 0.0_f64.to_bits());
    for step in 0..40 {
        let at_s = 0.2 + 0.01 * f64::from(step);
        assert_eq!(bits(scale.sample(at_s)), bits(before.sample(at_s)));
    }
}

/// Steps of Simpson's rule.
const STEPS: u32 = 2_000;

proptest! {
    /// Advance is the integral of sigma (by Simpson's rule), adds up, and never runs back.
    #[test]
    fn advance_over_any_interval_is_the_integral_of_sigma(
        seed in 0_u64..1_000_000, from in 0.0_f64..1.0, periods in 1_u32..40, cut in 0_u32..40,
    ) {
        let mut rng = SeededRng::from_seed(seed);
        let (scale, now_s) = chain(&mut rng);
        let (from, span) = (now_s + from, 1e-3 * f64::from(periods));
        let h = span / f64::from(STEPS);
        let mut sum = 0.0;
        for step in 0..=STEPS {
            let weight = if step == 0 || step == STEPS { 1.0 } else if step % 2 == 1 { 4.0 } else { 2.0 };
            sum += weight * scale.sample(from + h * f64::from(step)).sigma;
        }
        let advance_s = scale.advance_s(from, from + span);
        prop_assert!((advance_s - sum * h / 3.0).abs() < 1e-9, "{} against {}", advance_s, sum * h / 3.0);
        let middle = from + 1e-3 * f64::from(cut.min(periods));
        let parts_s = scale.advance_s(from, middle) + scale.advance_s(middle, from + span);
        prop_assert!((advance_s - parts_s).abs() < 1e-9);
        prop_assert!(scale.advance_s(from + span, from) == 0.0);
    }

    /// Times, durations and requests of any kind: no panic, sigma stays in [0, 1], time does not run back.
    #[test]
    fn time_scale_of_any_bits_stays_in_its_range(
        sigma in any::<f64>(),
        steps in prop::collection::vec((any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()), 0..40),
        at in any::<f64>(), to in any::<f64>(),
    ) {
        let mut scale = TimeScale::settled(sigma);
        for (index, (target, start_s, duration_s, now_s)) in steps.into_iter().enumerate() {
            scale.change(target, ramp(start_s, duration_s, index), now_s);
            if index % 3 == 0 {
                scale.drop_pending(now_s);
            }
            prop_assert!((0.0..=1.0).contains(&scale.sample(at).sigma));
            prop_assert!(scale.advance_s(at, to) >= 0.0);
        }
    }
}

#[test]
fn change_of_no_duration_or_an_endless_one_ends() {
    for duration_s in [0.0, -1.0, f64::INFINITY, f64::NAN] {
        let mut scale = TimeScale::settled(1.0);
        assert!(scale.change(0.0, ramp(5.0, duration_s, 0), 5.0));
        assert!(scale.is_settled(5.0 + RAMP_S_MAX), "{duration_s}");
    }
}

#[test]
fn scaled_at_full_speed_and_at_a_standstill_is_the_motion_and_nothing() {
    let mut setpoint = Setpoint::default();
    setpoint.position_rad[0] = 1.0;
    setpoint.velocity_rad_s[0] = 2.0;
    setpoint.acceleration_rad_s2[0] = 3.0;
    setpoint.jerk_rad_s3[0] = 4.0;
    assert_eq!(scaled(setpoint, Scale { sigma: 1.0, ..Scale::default() }, MAX_JOINTS), setpoint);
    let still = Setpoint { position_rad: setpoint.position_rad, ..Setpoint::default() };
    assert_eq!(scaled(setpoint, Scale::default(), MAX_JOINTS), still);
}
