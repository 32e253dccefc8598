//! Position limits of whole trajectories: the tolerance at the ends, what happens between samples, and joints that begin
//! outside, which may only come in.
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
mod common;
use common::{SeededRng, ur5_limits};
use taustream_motion::limits::{LimitViolation, Quantity, check_motion};
use taustream_motion::range::{POSITION_TOLERANCE_RAD, PermittedRange};
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Stroke, Trajectory};

/// Rates that no stroke of these tests reaches: only positions decide.
const FAST: LimitSet = LimitSet { velocity_rad_s: 1e3, acceleration_rad_s2: 1e5, jerk_rad_s3: 1e8 };

fn limits(joint: usize, position_rad: [f64; 2]) -> [JointLimits; MAX_JOINTS] {
    let mut limits = ur5_limits().map(|l| JointLimits { motion: FAST, stop: FAST, ..l });
    limits[joint].position_rad = position_rad;
    limits
}

fn strokes(joint: usize, base_rad: f64, strokes: &[(f64, f64)]) -> Trajectory {
    let mut base: JointArray = [0.0; MAX_JOINTS];
    base[joint] = base_rad;
    let strokes: Vec<Stroke> = strokes
        .iter()
        .map(|(start_s, delta)| {
            let mut delta_rad = [0.0; MAX_JOINTS];
            delta_rad[joint] = *delta;
            Stroke { start_s: *start_s, duration_s: 1.0, n: 6, delta_rad }
        })
        .collect();
    Trajectory::new(6, base, &strokes).unwrap()
}

/// Lowest and highest angle of a joint, to a fraction of the tolerances used below: a dense scan, then finer ones.
fn extremes_rad(trajectory: &Trajectory, joint: usize) -> [f64; 2] {
    let at = |t_s: f64| trajectory.sample(t_s).position_rad[joint];
    [-1.0, 1.0].map(|side| {
        let (mut from_s, mut to_s) = (0.0, trajectory.duration_s());
        for steps in [20_000_u32, 1_000, 1_000] {
            let step_s = (to_s - from_s) / f64::from(steps);
            let instants = (0..=steps).map(|i| from_s + step_s * f64::from(i));
            let best_s = instants.max_by(|a, b| (side * at(*a)).total_cmp(&(side * at(*b)))).unwrap();
            (from_s, to_s) = ((best_s - step_s).max(0.0), (best_s + step_s).min(trajectory.duration_s()));
        }
        at(0.5 * (from_s + to_s))
    })
}

/// Goal: the position limits hold between samples, too, on both sides alike, to a millionth of a radian.
/// Method: random sums of strokes that swing back and forth; limits put just inside and just outside of what a search for
/// the extremes finds, which knows nothing of the proof.
#[test]
fn swings_between_samples_are_seen_on_both_sides() {
    const HAIR_RAD: f64 = 1e-6;
    let mut swings = 0;
    for seed in 0..200 {
        let mut rng = SeededRng::from_seed(seed);
        let count = rng.whole(2, 12);
        let trajectory = rng.trajectory(1, count, 2.0);
        let [low_rad, high_rad] = extremes_rad(&trajectory, 0);
        let ends = [trajectory.base_rad()[0], trajectory.end_rad()[0]];
        let is_swing = |extreme: f64| ends.iter().all(|end| (end - extreme).abs() > 1e-3);
        let check = |low_rad, high_rad| check_motion(&trajectory, &limits(0, [low_rad, high_rad]));
        // The tolerance is part of the limits: here it is taken off again.
        let (low, high) = (low_rad + POSITION_TOLERANCE_RAD, high_rad - POSITION_TOLERANCE_RAD);
        let passed = check(low - HAIR_RAD, high + HAIR_RAD);
        assert!(passed.is_ok(), "seed {seed}: {passed:?}");
        if is_swing(low_rad) {
            swings += 1;
            let refused = check(low + HAIR_RAD, high + 1.0).unwrap_err();
            assert!(refused.quantity == Quantity::Position && refused.value < low, "seed {seed}: {refused}");
        }
        if is_swing(high_rad) {
            swings += 1;
            let refused = check(low - 1.0, high - HAIR_RAD).unwrap_err();
            assert!(refused.quantity == Quantity::Position && refused.value > high, "seed {seed}: {refused}");
        }
    }
    assert!(swings > 100, "only {swings} swings");
}

fn is_position(result: Result<impl Sized, LimitViolation>) -> bool {
    result.is_err_and(|violation| violation.quantity == Quantity::Position)
}

#[test]
fn ends_on_a_limit_or_an_ulp_or_a_count_outside_are_inside() {
    for outside_rad in [0.0, 4.5e-16, 1e-9, 2e-4, 0.99e-3] {
        for side in [-1.0, 1.0] {
            let end = side * (2.0 + outside_rad);
            assert!(check_motion(&strokes(2, 0.0, &[(0.0, end)]), &limits(2, [-2.0, 2.0])).is_ok(), "{end}");
            assert!(check_motion(&strokes(2, end, &[(0.0, -end)]), &limits(2, [-2.0, 2.0])).is_ok(), "{end}");
        }
    }
    assert!(is_position(check_motion(&strokes(2, 0.0, &[(0.0, 2.0011)]), &limits(2, [-2.0, 2.0]))));
}

/// What a joint may do that begins 0.3 rad outside, on either side; `true` passes.
#[test]
fn joint_outside_may_only_come_in_and_must() {
    type Case<'a> = (&'a str, &'a [(f64, f64)], bool);
    let cases: [Case; 10] = [
        ("stays", &[], false),
        ("comes in", &[(0.0, -0.5)], true),
        ("comes half way", &[(0.0, -0.1)], false),
        ("comes in by overlapping strokes", &[(0.0, -0.2), (0.3, -0.2), (0.6, -0.2)], true),
        ("comes in, then goes back to the limit", &[(0.0, -0.5), (1.5, 0.19)], true),
        ("goes out", &[(0.0, 0.1)], false),
        ("goes out a little first", &[(0.0, 1e-3), (1.0, -0.6)], false),
        ("comes half way, then goes out", &[(0.0, -0.2), (1.5, 0.1)], false),
        ("comes in, then goes out again", &[(0.0, -0.5), (1.5, 0.3)], false),
        ("turns while it is still outside", &[(0.0, -0.5), (0.2, 0.1)], false),
    ];
    for (what, parts, passes) in cases {
        for side in [-1.0, 1.0] {
            let parts: Vec<_> = parts.iter().map(|(start_s, delta)| (*start_s, side * delta)).collect();
            let trajectory = strokes(3, side * 1.3, &parts);
            let result = check_motion(&trajectory, &limits(3, [-1.0, 1.0]));
            assert_eq!(result.is_ok(), passes, "{what}, side {side}: {result:?}");
            assert!(passes || is_position(result), "{what}, side {side}");
        }
    }
}

/// Goal: what the proof lets pass, the ratchet of the guard lets pass, setpoint by setpoint. The proof is stricter: it
/// refuses a stroke that leads outwards beside a larger one that leads inwards, and motions that end outside.
/// Method: several joints outside at once on random sides, random strokes; the proof against the ratchet on samples.
#[test]
fn proof_of_entries_agrees_with_a_ratchet_over_samples() {
    const ROUNDING_RAD: f64 = 1e-9;
    let (mut passed, mut refused) = (0, 0);
    for seed in 0..600 {
        let mut rng = SeededRng::from_seed(seed);
        let mut limits = limits(0, [-1.0, 1.0]);
        limits.iter_mut().for_each(|l| l.position_rad = [-1.0, 1.0]);
        let base_rad = rng.joints(4, 1.5);
        // Mostly inwards, so that some pass.
        let strokes: Vec<Stroke> = (0..rng.whole(1, 3))
            .map(|index| {
                let mut delta_rad = rng.joints(4, 0.35);
                for (delta, base) in delta_rad.iter_mut().zip(&base_rad) {
                    let inwards = rng.within(0.0, 1.0) < 0.9;
                    *delta = if inwards { -delta.abs() * base.signum() } else { *delta };
                }
                Stroke { start_s: f64::from(index) * 0.7, duration_s: 1.0, n: 5, delta_rad }
            })
            .collect();
        let trajectory = Trajectory::new(4, base_rad, &strokes).unwrap();
        let mut permitted: [PermittedRange; 4] =
            std::array::from_fn(|joint| PermittedRange::around(&limits[joint], base_rad[joint]));
        let steps = 4_000;
        let ratchet_holds = (0..=steps).all(|step| {
            let at_rad = trajectory.sample(trajectory.duration_s() * f64::from(step) / f64::from(steps));
            permitted.iter_mut().zip(at_rad.position_rad).all(|(permitted, q)| {
                let [low, high] = permitted.ends_rad();
                let holds = q >= low - ROUNDING_RAD && q <= high + ROUNDING_RAD;
                *permitted = permitted.narrowed_to(q);
                holds
            })
        });
        let proof = check_motion(&trajectory, &limits);
        let ends_inside = trajectory.end_rad().iter().zip(&limits).take(4).all(|(q, l)| l.is_inside(*q));
        assert!(proof.is_err() || (ratchet_holds && ends_inside), "seed {seed}: {proof:?}");
        assert!(proof.as_ref().map_or_else(|v| v.at_s, |_| 0.0) >= 0.0, "seed {seed}: {proof:?}");
        (passed, refused) = (passed + u32::from(proof.is_ok()), refused + u32::from(!ratchet_holds));
    }
    assert!(passed > 50 && refused > 50, "{passed} passed, {refused} refused");
}
