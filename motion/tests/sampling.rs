//! Strokes and their sums: exact ends, the bits of the cursor, and derivatives against independent numerical ones.
mod common;
use common::{SeededRng, slope};
use proptest::prelude::*;
use taustream_motion::stroke::{N_MAX, N_MIN, Phi};
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, MAX_JOINTS, MAX_STROKES, Setpoint, Stroke, Trajectory, TrajectoryError};

fn bits(setpoint: &Setpoint) -> [[u64; MAX_JOINTS]; 4] {
    [setpoint.position_rad, setpoint.velocity_rad_s, setpoint.acceleration_rad_s2, setpoint.jerk_rad_s3]
        .map(|values| values.map(f64::to_bits))
}

/// Goal: what the formulas call velocity, acceleration and jerk are the derivatives of what they call position.
/// Method: Richardson differences of each quantity, on strokes and on overlapping sums, away from nothing: across joins
/// too, because the sum is C3.
#[test]
fn sums_of_strokes_anywhere_differentiate_to_their_velocity_acceleration_and_jerk() {
    for seed in 0..400 {
        let mut rng = SeededRng::from_seed(seed);
        let count = rng.whole(1, 12);
        let trajectory = rng.trajectory(6, count, 3.0);
        for _ in 0..20 {
            let t_s = rng.within(-0.1, trajectory.duration_s() + 0.1);
            let near_edge = trajectory
                .strokes()
                .iter()
                .any(|s| (t_s - s.start_s).abs() < 3e-3 || (t_s - s.end_s()).abs() < 3e-3);
            let at = trajectory.sample(t_s);
            for joint in 0..6 {
                let p = |t| trajectory.sample(t).position_rad[joint];
                let v = |t| trajectory.sample(t).velocity_rad_s[joint];
                let a = |t| trajectory.sample(t).acceleration_rad_s2[joint];
                // The snap jumps where a stroke starts, so the stencil loses its order there.
                let scale = if near_edge { 3e-2 } else { 1e-6 };
                for (name, numeric, exact, size) in [
                    ("velocity", slope(p, t_s, 2e-3), at.velocity_rad_s[joint], 30.0),
                    ("acceleration", slope(v, t_s, 2e-3), at.acceleration_rad_s2[joint], 1e3),
                    ("jerk", slope(a, t_s, 2e-3), at.jerk_rad_s3[joint], 1e5),
                ] {
                    let gap = (numeric - exact).abs();
                    assert!(gap < scale * size, "seed {seed}, t {t_s}, joint {joint}: {name} off by {gap:e}");
                }
            }
        }
    }
}

/// The differentiation above must be able to fail: a derivative off by one part in a thousand is seen.
#[test]
fn numerical_derivative_of_a_corrupted_velocity_is_seen_to_differ() {
    let trajectory = SeededRng::from_seed(7).trajectory(6, 3, 1.0);
    let t_s = 0.5 * trajectory.duration_s();
    let at = trajectory.sample(t_s).velocity_rad_s[0];
    let numeric = slope(|t| trajectory.sample(t).position_rad[0], t_s, 2e-3);
    assert!((numeric - at).abs() < 1e-6 * at.abs().max(1.0));
    assert!((numeric - at * 1.001).abs() > 1e-4 * at.abs());
    assert!(at.abs() > 0.05, "a test of nothing");
}

#[test]
fn stroke_at_its_ends_is_exact_and_at_rest() {
    for n in N_MIN..=N_MAX {
        assert_eq!(Phi::at(n, 0.0), Phi::BEFORE, "n {n}");
        assert_eq!(Phi::at(n, 1.0), Phi::AFTER, "n {n}");
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad[2] = 0.1 + f64::from(n);
        let stroke = Stroke { start_s: 0.3, duration_s: 0.7, n, delta_rad };
        let trajectory = Trajectory::new(3, [0.0; MAX_JOINTS], &[stroke]).unwrap();
        for t_s in [0.0, 0.3, -5.0, f64::NEG_INFINITY] {
            assert_eq!(bits(&trajectory.sample(t_s)), bits(&Setpoint::default()), "n {n}, t {t_s}");
        }
        let end = Setpoint { position_rad: delta_rad, ..Setpoint::default() };
        for t_s in [stroke.end_s(), 2.0, f64::INFINITY] {
            assert_eq!(bits(&trajectory.sample(t_s)), bits(&end), "n {n}, t {t_s}");
        }
    }
}

/// Goal: the sum is C3 where strokes start and end. Method: values a hair to both sides of each join; the difference
/// must vanish with the distance, also for the jerk, whose slope (the snap) is bounded.
#[test]
fn sums_at_every_join_are_continuous_up_to_the_jerk() {
    for seed in 0..200 {
        let trajectory = SeededRng::from_seed(seed).trajectory(4, 8, 2.0);
        for stroke in trajectory.strokes() {
            for join_s in [stroke.start_s, stroke.end_s()] {
                let gap = |h: f64| {
                    let (before, after) = (trajectory.sample(join_s - h), trajectory.sample(join_s + h));
                    (0..4).map(|j| (before.jerk_rad_s3[j] - after.jerk_rad_s3[j]).abs()).fold(0.0, f64::max)
                };
                let (wide, narrow) = (gap(1e-5), gap(1e-8));
                assert!(narrow < 0.1, "seed {seed}: jerk jumps by {narrow} at {join_s}");
                assert!(narrow <= wide * 0.1 + 1e-3, "seed {seed}: {narrow} does not shrink from {wide}");
            }
        }
    }
}

proptest! {
    /// A cursor that goes forward, stands still and goes back gives the bits of the plain sum.
    #[test]
    fn cursor_at_any_sequence_of_times_has_the_bits_of_the_plain_sum(
        seed in 0_u64..1_000_000, count in 0_u32..40, steps in prop::collection::vec(-0.3_f64..1.0, 1..60),
    ) {
        let trajectory = SeededRng::from_seed(seed).trajectory(6, count, 4.0);
        let mut cursor = if seed % 2 == 0 { Cursor::at_start(&trajectory) } else { Cursor::default() };
        let mut t_s = -0.5;
        for (index, step) in steps.iter().enumerate() {
            t_s += step * 0.4;
            if index % 9 == 5 {
                t_s = trajectory.strokes().get(index % count.max(1) as usize).map_or(t_s, Stroke::end_s);
            }
            let (fast, plain) = (cursor.sample(&trajectory, t_s), trajectory.sample(t_s));
            prop_assert_eq!(bits(&fast), bits(&plain), "seed {}, t {}", seed, t_s);
        }
        let last = cursor.sample(&trajectory, trajectory.duration_s());
        prop_assert_eq!(last.position_rad.map(f64::to_bits), trajectory.end_rad().map(f64::to_bits));
    }

    /// Every position between two instants lies within the travel bound of both.
    #[test]
    fn travel_bound_between_two_instants_holds_everything_between(
        seed in 0_u64..1_000_000, count in 1_u32..20, from in 0.0_f64..1.0, to in 0.0_f64..1.0,
    ) {
        let trajectory = SeededRng::from_seed(seed).trajectory(6, count, 4.0);
        let (t1_s, t2_s) = (from * trajectory.duration_s(), to * trajectory.duration_s());
        let bound_rad = trajectory.travel_bound_rad(t1_s, t2_s);
        let swapped_rad = trajectory.travel_bound_rad(t2_s, t1_s);
        prop_assert_eq!(bound_rad.map(f64::to_bits), swapped_rad.map(f64::to_bits));
        let ends = [trajectory.sample(t1_s), trajectory.sample(t2_s)];
        let mut travelled_rad = [0.0; MAX_JOINTS];
        let mut last = ends[0];
        for step in 1..=50 {
            let between = trajectory.sample(t1_s + (t2_s - t1_s) * f64::from(step) / 50.0);
            for joint in 0..6 {
                travelled_rad[joint] += (between.position_rad[joint] - last.position_rad[joint]).abs();
                for end in &ends {
                    let gap = (between.position_rad[joint] - end.position_rad[joint]).abs();
                    prop_assert!(gap <= bound_rad[joint] + 1e-13, "seed {}: {} beyond", seed, gap);
                }
            }
            last = between;
        }
        for joint in 0..6 {
            prop_assert!(travelled_rad[joint] <= bound_rad[joint] + 1e-12, "seed {}", seed);
        }
    }

    /// Numbers of any kind make a trajectory or an error, never a panic.
    #[test]
    fn trajectory_of_any_bits_is_made_or_refused(
        joints in 0_usize..20, base in prop::collection::vec(any::<f64>(), MAX_JOINTS),
        raw in prop::collection::vec((any::<f64>(), any::<f64>(), any::<u32>(), any::<f64>()), 0..6),
        t_s in any::<f64>(),
    ) {
        let base_rad: JointArray = base.try_into().unwrap();
        let strokes: Vec<Stroke> = raw.into_iter()
            .map(|(start_s, duration_s, n, delta)| Stroke { start_s, duration_s, n, delta_rad: [delta; MAX_JOINTS] })
            .collect();
        if let Ok(trajectory) = Trajectory::new(joints, base_rad, &strokes) {
            let _ = trajectory.sample(t_s);
            let _ = Cursor::at_start(&trajectory).sample(&trajectory, t_s);
            let _ = taustream_motion::limits::check_motion(&trajectory, &common::ur5_limits());
        }
    }
}

/// The travel bound is exact where strokes do not overlap: a bound that is always too large would pass the tests above.
#[test]
fn travel_bound_of_a_single_stroke_is_its_travel() {
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[0] = -2.0;
    let stroke = Stroke { start_s: 1.0, duration_s: 2.0, n: 10, delta_rad };
    let trajectory = Trajectory::new(1, [0.0; MAX_JOINTS], &[stroke]).unwrap();
    for (from_s, to_s) in [(0.0, 9.0), (1.2, 1.3), (2.0, 2.5), (0.0, 1.0), (3.0, 4.0)] {
        let travel = trajectory.sample(from_s).position_rad[0] - trajectory.sample(to_s).position_rad[0];
        let bound = trajectory.travel_bound_rad(from_s, to_s)[0];
        assert!((bound - travel).abs() < 1e-12, "{from_s}..{to_s}: {bound} for {travel}");
    }
}

#[test]
fn sample_at_no_number_gives_no_number_for_what_moves() {
    let trajectory = SeededRng::from_seed(1).trajectory(3, 2, 1.0);
    let setpoint = trajectory.sample(f64::NAN);
    assert!((0..3).all(|joint| setpoint.position_rad[joint].is_nan()));
    let mut cursor = Cursor::at_start(&trajectory);
    let _ = cursor.sample(&trajectory, 0.7);
    let _ = cursor.sample(&trajectory, f64::NAN);
    // And it leaves no trace.
    assert_eq!(bits(&cursor.sample(&trajectory, 0.9)), bits(&trajectory.sample(0.9)));
}

#[test]
fn trajectory_of_bad_numbers_is_refused_with_the_offender() {
    let good = Stroke { start_s: 1.0, duration_s: 1.0, n: 10, delta_rad: [0.0; MAX_JOINTS] };
    let base = [0.0; MAX_JOINTS];
    let refuse = |strokes: &[Stroke]| Trajectory::new(6, base, strokes).unwrap_err().to_string();
    let mut moves_unused = good;
    moves_unused.delta_rad[7] = 0.1;
    let mut nan = good;
    nan.delta_rad[1] = f64::NAN;
    for (strokes, part) in [
        (vec![good, Stroke { start_s: 0.5, ..good }], "stroke 1 starts before"),
        (vec![Stroke { n: 3, ..good }], "n is 3"),
        (vec![Stroke { n: 65, ..good }], "n is 65"),
        (vec![Stroke { duration_s: 0.0, ..good }], "at least 0.001 s"),
        (vec![Stroke { duration_s: f64::INFINITY, ..good }], "duration_s is not finite"),
        (vec![Stroke { start_s: -1.0, ..good }], "0 s or later"),
        (vec![Stroke { start_s: f64::NAN, ..good }], "start_s is not finite"),
        (vec![Stroke { start_s: 86_400.0, ..good }], "ends by 86400 s"),
        (vec![moves_unused], "joint 7 moves"),
        (vec![nan], "delta_rad is not finite"),
        (vec![good; MAX_STROKES + 1], "513 strokes"),
    ] {
        let sentence = refuse(&strokes);
        assert!(sentence.contains(part), "{sentence} lacks {part}");
    }
    assert!(matches!(Trajectory::new(0, base, &[]), Err(TrajectoryError::JointCount { joints: 0 })));
    assert!(matches!(Trajectory::new(17, base, &[]), Err(TrajectoryError::JointCount { joints: 17 })));
    let mut bad_base = base;
    bad_base[6] = 1.0;
    assert!(matches!(Trajectory::new(6, bad_base, &[]), Err(TrajectoryError::Base { joint: 6, .. })));
    assert!(Trajectory::new(6, base, &[good; MAX_STROKES]).is_ok());
}
