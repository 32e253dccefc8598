//! The proof of limits: what it accepts keeps them, what it refuses breaks them, and it always comes to an end.
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
mod common;
use common::{SeededRng, random_limits, ur5_limits};
use std::time::Instant;
use taustream_motion::duration::{best_n, joints_duration_s};
use taustream_motion::limits::{Quantity, TOLERANCE, check_motion};
use taustream_motion::range::POSITION_TOLERANCE_RAD;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{
    JointArray, JointLimits, LimitSet, MAX_JOINTS, MAX_STROKES, Setpoint, Stroke, Trajectory,
};

/// Highest magnitudes on a dense grid, which knows nothing of the proof.
fn scan(trajectory: &Trajectory, steps: u32) -> Setpoint {
    let mut most = Setpoint::default();
    let mut cursor = Cursor::at_start(trajectory);
    for step in 0..=steps {
        let at = cursor.sample(trajectory, trajectory.duration_s() * f64::from(step) / f64::from(steps));
        for (most, values) in [
            (&mut most.velocity_rad_s, at.velocity_rad_s),
            (&mut most.acceleration_rad_s2, at.acceleration_rad_s2),
            (&mut most.jerk_rad_s3, at.jerk_rad_s3),
        ] {
            for (most, value) in most.iter_mut().zip(values) {
                *most = most.max(value.abs());
            }
        }
    }
    most
}

/// Limits that leave each joint `factor` of its scanned peaks.
fn limits_round(peaks: &Setpoint, factor: f64) -> [JointLimits; MAX_JOINTS] {
    let mut limits = ur5_limits();
    for (joint, limits) in limits.iter_mut().enumerate() {
        limits.motion = LimitSet {
            velocity_rad_s: peaks.velocity_rad_s[joint] * factor,
            acceleration_rad_s2: peaks.acceleration_rad_s2[joint] * factor,
            jerk_rad_s3: peaks.jerk_rad_s3[joint] * factor,
        };
    }
    limits
}

/// Goal: on overlapping strokes too, the proof says what a dense scan says, within one part in a thousand either way, and
/// its peaks are upper bounds that close.
#[test]
fn proof_of_overlapping_strokes_agrees_with_a_dense_scan_on_both_sides() {
    for seed in 0..60 {
        let mut rng = SeededRng::from_seed(seed);
        let count = rng.whole(1, 24);
        let trajectory = rng.trajectory(6, count, 3.0);
        let most = scan(&trajectory, 40_000);
        let peaks = check_motion(&trajectory, &limits_round(&most, 1.001));
        let peaks = peaks.unwrap_or_else(|violation| panic!("seed {seed}: {violation}"));
        for (bounds, seen) in [
            (peaks.velocity_rad_s, most.velocity_rad_s),
            (peaks.acceleration_rad_s2, most.acceleration_rad_s2),
            (peaks.jerk_rad_s3, most.jerk_rad_s3),
        ] {
            for (bound, seen) in bounds.into_iter().zip(seen).take(6) {
                assert!(bound >= seen * (1.0 - 1e-12), "seed {seed}: bound {bound} below {seen}");
                assert!(bound <= seen * 1.0015, "seed {seed}: bound {bound} far above {seen}");
            }
        }
        let violation = check_motion(&trajectory, &limits_round(&most, 0.999)).unwrap_err();
        assert!(violation.proven, "seed {seed}: {violation}");
    }
}

/// Goal: the evidence is true. Method: each quantity's limit alone lowered by 1 % below its peak; the report must name
/// joint and quantity, and its value must be what the trajectory does there.
#[test]
fn violation_of_each_quantity_names_joint_and_a_value_that_is_reached() {
    for seed in 0..30 {
        let mut rng = SeededRng::from_seed(seed);
        let trajectory = rng.trajectory(6, 8, 2.0);
        let most = scan(&trajectory, 30_000);
        let joint = rng.whole(0, 5) as usize;
        for quantity in [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk] {
            let mut limits = limits_round(&most, 1.01);
            let motion = &mut limits[joint].motion;
            let limit = match quantity {
                Quantity::Velocity | Quantity::Position => &mut motion.velocity_rad_s,
                Quantity::Acceleration => &mut motion.acceleration_rad_s2,
                Quantity::Jerk => &mut motion.jerk_rad_s3,
            };
            *limit *= 0.98;
            let violation = check_motion(&trajectory, &limits).unwrap_err();
            assert!(violation.proven && violation.joint == joint, "seed {seed}: {violation}");
            assert_eq!(violation.quantity, quantity, "seed {seed}");
            let at = trajectory.sample(violation.at_s);
            let reached = match quantity {
                Quantity::Position => at.position_rad,
                Quantity::Velocity => at.velocity_rad_s,
                Quantity::Acceleration => at.acceleration_rad_s2,
                Quantity::Jerk => at.jerk_rad_s3,
            }[joint];
            assert!(
                (violation.value - reached.abs()).abs() < 1e-6 * reached.abs(),
                "seed {seed}: {violation}"
            );
            assert!(violation.value > violation.limit, "seed {seed}: {violation}");
        }
    }
}

/// Goal: of two violations the earlier is reported, whichever is worse.
#[test]
fn violation_that_begins_first_is_reported_though_a_later_one_is_worse() {
    let limits = ur5_limits();
    let stroke = |start_s, joint: usize, delta: f64| {
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad[joint] = delta;
        Stroke { start_s, duration_s: 1.0, n: 10, delta_rad }
    };
    // One second allows 1.04 rad (acceleration) and 1.08 rad (jerk).
    let strokes = [stroke(0.0, 0, 0.5), stroke(2.0, 1, 1.2), stroke(4.0, 2, 3.0)];
    let trajectory = Trajectory::new(6, [0.0; MAX_JOINTS], &strokes).unwrap();
    let violation = check_motion(&trajectory, &limits).unwrap_err();
    assert!(violation.joint == 1 && violation.at_s > 2.0 && violation.at_s < 3.0, "{violation}");
    assert!(violation.to_string().contains("joint 2"), "joints are counted from 1 for people: {violation}");
}

#[test]
fn position_on_its_limit_passes_and_a_hair_beyond_does_not() {
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[3] = -1.5;
    let stroke = Stroke { start_s: 0.0, duration_s: 3.0, n: 8, delta_rad };
    let mut base_rad: JointArray = [0.0; MAX_JOINTS];
    base_rad[3] = 0.7;
    let trajectory = Trajectory::new(6, base_rad, &[stroke]).unwrap();
    let end_rad = trajectory.end_rad()[3];
    let check = |low_rad, high_rad| {
        let mut limits = ur5_limits();
        limits[3].position_rad = [low_rad, high_rad];
        check_motion(&trajectory, &limits)
    };
    assert!(check(end_rad, 0.7).is_ok());
    let low = check(end_rad + 3.0 * POSITION_TOLERANCE_RAD, 0.7).unwrap_err();
    assert!(low.quantity == Quantity::Position && low.joint == 3 && low.proven, "{low}");
    assert!(check(end_rad, 0.7 - 3.0 * POSITION_TOLERANCE_RAD).is_ok(), "it begins outside and comes in");
    assert!(check(end_rad + 0.1, 0.7).unwrap_err().value < end_rad + 0.01, "not at its worst");
    // A swing beyond the range in the middle of a motion whose ends are inside.
    let mut back = stroke;
    back.start_s = 2.0;
    back.delta_rad[3] = 1.5;
    let swing = Trajectory::new(6, base_rad, &[stroke, back]).unwrap();
    let mut limits = ur5_limits();
    limits[3].position_rad = [-0.5, 1.0];
    let violation = check_motion(&swing, &limits).unwrap_err();
    assert!(violation.quantity == Quantity::Position && violation.value < -0.5, "{violation}");
}

#[test]
fn trajectory_without_strokes_is_checked_by_its_base() {
    let mut base_rad = [0.0; MAX_JOINTS];
    assert!(check_motion(&Trajectory::new(6, base_rad, &[]).unwrap(), &ur5_limits()).is_ok());
    base_rad[1] = 21.0;
    let violation = check_motion(&Trajectory::new(6, base_rad, &[]).unwrap(), &ur5_limits()).unwrap_err();
    assert!(violation.quantity == Quantity::Position && violation.joint == 1 && violation.proven);
}

#[test]
fn limits_that_are_zero_or_no_number_let_nothing_move() {
    let mut rng = SeededRng::from_seed(3);
    let trajectory = rng.trajectory(6, 2, 1.0);
    for bad in [0.0, -1.0, f64::NAN] {
        for which in 0..4 {
            let mut limits = [JointLimits {
                motion: LimitSet { velocity_rad_s: 1e9, acceleration_rad_s2: 1e9, jerk_rad_s3: 1e9 },
                ..ur5_limits()[0]
            }; MAX_JOINTS];
            let JointLimits { position_rad, motion, .. } = &mut limits[2];
            match which {
                0 => motion.velocity_rad_s = bad,
                1 => motion.acceleration_rad_s2 = bad,
                2 => motion.jerk_rad_s3 = bad,
                _ => *position_rad = [bad, bad],
            }
            let violation = check_motion(&trajectory, &limits).unwrap_err();
            assert_eq!(violation.joint, 2, "{which} {bad}: {violation}");
        }
    }
}

/// Strokes so large that only their sum is small: rounding alone could hide a violation, so they are refused.
#[test]
fn huge_strokes_that_cancel_are_refused_for_their_rounding() {
    let mut up = Stroke { start_s: 0.0, duration_s: 5.0, n: 6, delta_rad: [0.0; MAX_JOINTS] };
    up.delta_rad[0] = 1e13;
    let mut down = up;
    down.delta_rad[0] = -1e13;
    let trajectory = Trajectory::new(6, [0.0; MAX_JOINTS], &[up, down]).unwrap();
    assert!(check_motion(&trajectory, &ur5_limits()).is_err());
}

/// A train: strokes of one duration, evenly spaced, each a part of one move, stretched until one limit is met.
fn train(count: usize, spacing: f64, limits: &[JointLimits; MAX_JOINTS], rng: &mut SeededRng) -> Trajectory {
    let delta_rad = rng.joints(6, 2.0).map(|delta| delta / count as f64);
    let make = |stretch: f64| {
        let strokes: Vec<Stroke> = (0..count)
            .map(|index| Stroke {
                start_s: stretch * spacing * index as f64,
                duration_s: stretch,
                n: 6,
                delta_rad,
            })
            .collect();
        Trajectory::new(6, [0.0; MAX_JOINTS], &strokes).unwrap()
    };
    let peaks = check_motion(&make(1.0), &[roomy(); MAX_JOINTS]).unwrap();
    let mut stretch = 0.0_f64;
    for (joint, limits) in limits.iter().enumerate().take(6) {
        let motion = limits.motion;
        stretch = stretch
            .max(peaks.velocity_rad_s[joint] / motion.velocity_rad_s)
            .max((peaks.acceleration_rad_s2[joint] / motion.acceleration_rad_s2).sqrt())
            .max((peaks.jerk_rad_s3[joint] / motion.jerk_rad_s3).cbrt());
    }
    make(stretch)
}

fn roomy() -> JointLimits {
    let motion = LimitSet { velocity_rad_s: 1e3, acceleration_rad_s2: 1e3, jerk_rad_s3: 1e3 };
    JointLimits { position_rad: [-100.0, 100.0], motion, stop: motion }
}

#[test]
fn trains_stretched_onto_a_limit_pass_and_faster_ones_do_not() {
    for seed in 0..40 {
        let mut rng = SeededRng::from_seed(seed);
        let limits = random_limits(&mut rng);
        let count = rng.whole(2, 60) as usize;
        let trajectory = train(count, 1.0 / 8.0, &limits, &mut rng);
        assert!(check_motion(&trajectory, &limits).is_ok(), "seed {seed}");
        let faster: Vec<Stroke> = trajectory
            .strokes()
            .iter()
            .map(|s| Stroke { start_s: s.start_s * 0.99, duration_s: s.duration_s * 0.99, ..*s })
            .collect();
        let faster = Trajectory::new(6, [0.0; MAX_JOINTS], &faster).unwrap();
        let violation = check_motion(&faster, &limits).unwrap_err();
        assert!(violation.proven && violation.value > violation.limit * 1.005, "seed {seed}: {violation}");
    }
}

/// Goal: the work is bounded whatever comes. Method: the densest messages, and limits placed where a proof is hardest.
/// Times are printed, not asserted; the cap on evaluations is what bounds them.
#[test]
fn proof_of_the_densest_messages_comes_to_an_end() {
    let mut rng = SeededRng::from_seed(11);
    for (name, spacing_s, duration_s, steps) in [
        ("all overlap", 1e-3, 8.0, 5_000),
        ("half overlap", 0.01, 2.0, 5_000),
        ("chain", 1.0, 1.0, 300_000),
        ("stacked", 0.0, 3.0, 5_000),
    ] {
        let strokes: Vec<Stroke> = (0..MAX_STROKES)
            .map(|index| Stroke {
                start_s: spacing_s * index as f64,
                duration_s: duration_s * rng.within(0.9, 1.0),
                n: rng.whole(4, 64),
                delta_rad: rng.joints(8, 0.02),
            })
            .collect();
        let trajectory = Trajectory::new(8, [0.0; MAX_JOINTS], &strokes).unwrap();
        let most = scan(&trajectory, steps);
        for factor in [2.0, 1.01, 1.0 + 2.0 * TOLERANCE, 1.0 - 0.5 * TOLERANCE, 0.99] {
            let begin = Instant::now();
            let result = check_motion(&trajectory, &limits_round(&most, factor));
            let said = result.map_or_else(|violation| violation.to_string(), |_| "holds".into());
            println!("{name}, limits at {factor} of the peaks: {said}, {:?}", begin.elapsed());
        }
        assert!(check_motion(&trajectory, &limits_round(&most, 1.01)).is_ok(), "{name}");
        assert!(check_motion(&trajectory, &limits_round(&most, 0.99)).is_err(), "{name}");
    }
}

/// The planner's usual case, at both ends of the exponent's range and at its best.
#[test]
fn chain_of_timed_segments_keeps_the_limits_it_was_timed_for() {
    for seed in 0..100 {
        let mut rng = SeededRng::from_seed(seed);
        let limits = random_limits(&mut rng);
        let (mut start_s, mut strokes) = (0.0, Vec::new());
        for _ in 0..rng.whole(1, 20) {
            let delta_rad = rng.joints(6, 0.8);
            let n = if rng.whole(0, 1) == 0 { best_n(&delta_rad, &limits).0 } else { rng.whole(4, 64) };
            let duration_s = joints_duration_s(&delta_rad, &limits, n);
            strokes.push(Stroke { start_s, duration_s, n, delta_rad });
            start_s += duration_s;
        }
        let trajectory = Trajectory::new(6, [0.0; MAX_JOINTS], &strokes).unwrap();
        let proof = check_motion(&trajectory, &limits);
        assert!(proof.is_ok(), "seed {seed}: {}", proof.unwrap_err());
    }
}
