//! Straight moves against Ruckig's jerk-limited optimum, at random limits and lengths.
use super::line::LineLimits;
use super::*;
use crate::rng::SeededRng;
use rsruckig::prelude::{InputParameter, Ruckig, ThrowErrorHandler, Trajectory as RuckigTrajectory};
use taustream_motion::LimitSet;
use taustream_motion::limits::check_motion;

const JOINTS: usize = 6;
/// Joints that turn as far as they like.
const FREE: JointLimits = JointLimits {
    position_rad: [-100.0, 100.0],
    motion: LimitSet { velocity_rad_s: 0.0, acceleration_rad_s2: 0.0, jerk_rad_s3: 0.0 },
    stop: LimitSet { velocity_rad_s: 0.0, acceleration_rad_s2: 0.0, jerk_rad_s3: 0.0 },
};

/// Ruckig's duration along the line, which the tightest joint of each limit decides.
fn ruckig_s(line: &LineLimits) -> f64 {
    let mut input = InputParameter::<1>::new(None);
    input.target_position[0] = 1.0;
    input.max_velocity[0] = line.velocity;
    input.max_acceleration[0] = line.acceleration;
    input.max_jerk[0] = line.jerk;
    let mut ruckig = Ruckig::<1, ThrowErrorHandler>::new(None, 0.001);
    let mut trajectory = RuckigTrajectory::<1>::new(None);
    ruckig.calculate(&input, &mut trajectory).expect("a move from rest to rest");
    trajectory.get_duration()
}

fn random_case(seed: u64) -> (JointArray, [JointLimits; MAX_JOINTS]) {
    let mut rng = SeededRng::new(seed, 0);
    let mut power = |low: f64, high: f64| 10_f64.powf(rng.within(low, high));
    let mut limits = [FREE; MAX_JOINTS];
    for joint in limits.iter_mut().take(JOINTS) {
        joint.motion = LimitSet {
            velocity_rad_s: power(-1.0, 1.0),
            acceleration_rad_s2: power(-1.0, 3.0),
            jerk_rad_s3: power(0.0, 4.0),
        };
    }
    let length_rad = power(-5.0, 1.3);
    let mut to_rad = [0.0; MAX_JOINTS];
    to_rad.iter_mut().take(JOINTS).for_each(|to| *to = length_rad * rng.within(-1.0, 1.0));
    (to_rad, limits)
}

/// Goal: straight moves near the optimum with few strokes, whatever the arm and the length.
/// Method: random limits over decades. Planted fault: a fit of no rounds fails it (1.22 in the median, 1.26).
#[test]
fn a_straight_move_takes_at_most_1_12_optima_with_64_strokes() {
    let (mut ratios, mut worst) = (Vec::new(), (0.0, 0));
    for seed in 0..400 {
        let (to_rad, limits) = random_case(seed);
        let corners_rad = [[0.0; MAX_JOINTS], to_rad];
        let path = Path { corners_rad: &corners_rad, joints: JOINTS, limits: &limits };
        let motion = path.stopping().expect("a timing").trajectory;
        assert!(motion.strokes().len() <= 64, "seed {seed}: {} strokes", motion.strokes().len());
        assert!(
            motion.strokes().iter().all(|s| s.delta_rad.iter().zip(&to_rad).all(|(d, to)| d * to >= 0.0))
        );
        check_motion(&motion, &limits).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        for (end, to) in motion.end_rad().iter().zip(&to_rad) {
            assert!((end - to).abs() < 1e-14 * length(&to_rad), "seed {seed}: ends at {end}, not {to}");
        }
        let line = LineLimits::between(&corners_rad[0], &to_rad, (JOINTS, &limits)).expect("a line");
        let (own, optimum_s) = (line.optimum(), ruckig_s(&line));
        assert!(
            (own.duration_s() / optimum_s - 1.0).abs() < 1e-6,
            "seed {seed}: {own:?}, Ruckig {optimum_s} s"
        );
        // Strokes of 1 ms and more cannot be shorter than so.
        if optimum_s > 0.01 {
            let ratio = motion.duration_s() / optimum_s;
            ratios.push(ratio);
            worst = if ratio > worst.0 { (ratio, seed) } else { worst };
        }
    }
    ratios.sort_by(f64::total_cmp);
    println!("median {:.4}, worst {:.4} of {} moves", ratios[ratios.len() / 2], worst.0, ratios.len());
    assert!(worst.0 <= 1.12, "seed {}: {} optima", worst.1, worst.0);
}

/// Goal: twice as many strokes as a move uses come nearer to the optimum, whatever the arm and the length. 1.08 would be bold.
#[test]
fn a_straight_move_of_128_strokes_would_take_at_most_1_09_optima() {
    let mut ratios = Vec::new();
    for seed in 0..400 {
        let (to_rad, limits) = random_case(seed);
        let line = LineLimits::between(&[0.0; MAX_JOINTS], &to_rad, (JOINTS, &limits)).expect("a line");
        let train = Train::of_at_most(&line, 128).expect("a train");
        if ruckig_s(&line) > 0.02 {
            ratios.push(train.duration_s() / ruckig_s(&line));
        }
    }
    ratios.sort_by(f64::total_cmp);
    let (median, worst) = (ratios[ratios.len() / 2], ratios[ratios.len() - 1]);
    println!("128 strokes: median {median:.4}, worst {worst:.4} of {} moves", ratios.len());
    assert!(worst <= 1.09, "{worst} optima");
}

fn length(of: &JointArray) -> f64 {
    of.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Goal: lengths over seven decades under an arm's own limits; the shortest moves take their strokes' least duration.
#[test]
fn every_length_is_timed_with_few_strokes() {
    for (v, a, j) in [(3.15, 15.0, 150.0), (2.175, 10.0, 5_000.0), (3.0, 2.0, 10.0), (0.5, 15.0, 150.0)] {
        let mut limits = [FREE; MAX_JOINTS];
        limits[0].motion = LimitSet { velocity_rad_s: v, acceleration_rad_s2: a, jerk_rad_s3: j };
        for step in 0..=29 {
            let distance_rad = 10_f64.powf(f64::from(step) / 4.0 - 6.0);
            let mut corners_rad = [[0.0; MAX_JOINTS]; 2];
            corners_rad[1][0] = distance_rad;
            let path = Path { corners_rad: &corners_rad, joints: 1, limits: &limits };
            let motion = path.stopping().expect("a timing").trajectory;
            check_motion(&motion, &limits).unwrap_or_else(|e| panic!("{distance_rad} rad: {e}"));
            assert!(motion.strokes().len() <= 64);
            let optimum_s = LineLimits::between(&corners_rad[0], &corners_rad[1], (1, &limits))
                .expect("a line")
                .optimum()
                .duration_s();
            let most_s = (1.12 * optimum_s).max(2e-3_f64.max(1.5 * optimum_s).min(0.012));
            assert!(
                motion.duration_s() <= most_s,
                "{distance_rad} rad: {} of {optimum_s} s",
                motion.duration_s()
            );
        }
    }
}

/// A path of five points, `total_rad` long, whose segments differ in length by up to three times.
fn random_path(seed: u64, total_rad: f64) -> Vec<JointArray> {
    let mut rng = SeededRng::new(seed, 1);
    let mut corners_rad = vec![[0.0; MAX_JOINTS]];
    for _ in 0..4 {
        let mut next = corners_rad[corners_rad.len() - 1];
        let length = rng.within(0.5, 1.5);
        next.iter_mut().take(JOINTS).for_each(|q| *q += length * rng.within(-1.0, 1.0));
        corners_rad.push(next);
    }
    let length_rad: f64 = corners_rad.windows(2).map(|pair| distance(&pair[0], &pair[1])).sum();
    for corner in &mut corners_rad {
        corner.iter_mut().for_each(|q| *q *= total_rad / length_rad);
    }
    corners_rad
}

/// Distance from a path.
fn off_path(corners_rad: &[JointArray], pose_rad: &JointArray) -> f64 {
    let to_segment = |pair: &[JointArray]| {
        let (from, to) = (&pair[0], &pair[1]);
        let along: f64 = (0..JOINTS).map(|j| (to[j] - from[j]) * (pose_rad[j] - from[j])).sum();
        let share = (along / distance(from, to).powi(2)).clamp(0.0, 1.0);
        distance(&std::array::from_fn(|j| from[j] + share * (to[j] - from[j])), pose_rad)
    };
    corners_rad.windows(2).map(to_segment).fold(f64::INFINITY, f64::min)
}

/// Goal: a rounded path keeps its distance and the limits, ends where it should, and is faster than stops.
/// Method: an independent distance on a fine sampling. Planted fault: a tube as wide as what is allowed fails it.
#[test]
fn rounded_paths_stay_within_their_deviation_and_limits() {
    let mut limits = [FREE; MAX_JOINTS];
    limits.iter_mut().take(JOINTS).for_each(|l| {
        l.motion = LimitSet { velocity_rad_s: 3.15, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
    });
    let (mut made, mut shares) = (0, Vec::new());
    for seed in 0..40 {
        let total_rad = 0.3 * 40_f64.powf(f64::from(u32::try_from(seed).expect("small")) / 39.0);
        let corners_rad = random_path(seed, total_rad);
        let path = Path { corners_rad: &corners_rad, joints: JOINTS, limits: &limits };
        for deviation_rad in [0.02, 0.1, 0.4] {
            let Some(timed) = path.rounded(&[deviation_rad; 3], f64::INFINITY) else { continue };
            made += 1;
            let timed = if check_motion(&timed.trajectory, &limits).is_err() {
                timed.slower(1.002).expect("a motion")
            } else {
                timed
            };
            check_motion(&timed.trajectory, &limits).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            let motion = &timed.trajectory;
            let most_rad = (0..=3_000)
                .map(|i| {
                    off_path(
                        &corners_rad,
                        &motion.sample(f64::from(i) / 3e3 * motion.duration_s()).position_rad,
                    )
                })
                .fold(0.0, f64::max);
            assert!(most_rad <= deviation_rad * 1.01, "seed {seed}: {most_rad} of {deviation_rad} rad");
            assert!(distance(&motion.end_rad(), &corners_rad[4]) < 1e-12);
            let stops_s = path.stopping().expect("a motion").trajectory.duration_s();
            shares.push(motion.duration_s() / stops_s);
        }
    }
    shares.sort_by(f64::total_cmp);
    println!("{made} of 120 rounded; share of the time with stops: median {:.3}", shares[shares.len() / 2]);
    assert!(made >= 110, "only {made} of 120 paths were rounded");
    assert!(shares[shares.len() / 2] < 0.75 && shares.iter().all(|share| *share < 1.05), "{shares:?}");
}
