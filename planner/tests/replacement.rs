//! Motions that replace running ones: durations beside Ruckig's optimum.
#![expect(clippy::unwrap_used, reason = "helpers of tests; a failure in them fails the test")]
use rsruckig::prelude::{
    ControlInterface, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Trajectory};
use taustream_planner::budget::Budget;
use taustream_planner::replacement::{replacement, to_rest};
use taustream_planner::rng::SeededRng;
use taustream_planner::timing::Path;

const JOINTS: usize = 6;

/// Limits that differ from joint to joint, over some decades.
fn limits(rng: &mut SeededRng) -> [JointLimits; MAX_JOINTS] {
    let spread = rng.within(0.0, 1.0);
    let mut power = |low: f64, high: f64| 10.0_f64.powf(rng.within(low, high));
    let of_arm = [power(-1.0, 1.0), power(0.0, 1.5), power(0.0, 2.0)];
    std::array::from_fn(|_| {
        let velocity_rad_s = of_arm[0] * power(-spread, spread);
        let acceleration_rad_s2 = velocity_rad_s * of_arm[1];
        let jerk_rad_s3 = acceleration_rad_s2 * of_arm[2];
        let motion = LimitSet { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 };
        JointLimits { position_rad: [-1e3, 1e3], motion, stop: motion }
    })
}

/// A straight move as the planner times it.
fn straight(rng: &mut SeededRng, limits: &[JointLimits; MAX_JOINTS]) -> Trajectory {
    let reach = 10.0_f64.powf(rng.within(-1.0, 0.6));
    let (mut from, mut to) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
    for joint in 0..JOINTS {
        from[joint] = rng.within(-1.0, 1.0);
        to[joint] = from[joint] + rng.within(-reach, reach);
    }
    let path = Path { corners_rad: &[from, to], joints: JOINTS, limits };
    path.fastest(&[], &Budget::unbounded()).unwrap().trajectory
}

/// A cut somewhere, and a goal up to 4 rad away.
fn cut(rng: &mut SeededRng, running: &Trajectory, from_s: f64) -> (f64, JointArray) {
    let cut_s = from_s + (running.duration_s() - from_s) * rng.within(0.0, 1.0);
    let mut goal_rad = running.sample(cut_s).position_rad;
    for goal in goal_rad.iter_mut().take(JOINTS) {
        *goal += rng.within(-4.0, 4.0);
    }
    (cut_s, goal_rad)
}

/// Time-optimal duration from a state to rest at the goal, all joints together.
fn optimum_s(
    running: &Trajectory,
    cut_s: f64,
    goal_rad: &JointArray,
    limits: &[JointLimits; MAX_JOINTS],
) -> f64 {
    let state = running.sample(cut_s);
    let mut input = InputParameter::<JOINTS>::new(None);
    input.control_interface = ControlInterface::Position;
    input.synchronization = Synchronization::Time;
    for joint in 0..JOINTS {
        input.current_position[joint] = state.position_rad[joint];
        input.current_velocity[joint] = state.velocity_rad_s[joint];
        input.current_acceleration[joint] = state.acceleration_rad_s2[joint];
        input.target_position[joint] = goal_rad[joint];
        let motion = limits[joint].motion;
        input.max_velocity[joint] = motion.velocity_rad_s;
        input.max_acceleration[joint] = motion.acceleration_rad_s2;
        input.max_jerk[joint] = motion.jerk_rad_s3;
    }
    let mut solution = RuckigTrajectory::new(None);
    Ruckig::<JOINTS, ThrowErrorHandler>::new(None, 0.001).calculate(&input, &mut solution).unwrap();
    solution.get_duration()
}

/// Goal: what the project promises of replacements: 1.15 times Ruckig's state-to-state optimum at the median of random cuts, 1.4
/// at the 95th percentile, and none refused.
#[test]
fn replacements_of_random_cuts_take_little_longer_than_the_optimum() {
    let mut ratios = Vec::new();
    for seed in 0..50 {
        let mut rng = SeededRng::new(seed, 3);
        let motion = LimitSet { velocity_rad_s: 3.1, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
        let limits = [JointLimits { position_rad: [-1e3, 1e3], motion, stop: motion }; MAX_JOINTS];
        let mut running = straight(&mut rng, &limits);
        let mut from_s = 0.0;
        for _ in 0..2 {
            let (cut_s, goal_rad) = cut(&mut rng, &running, from_s);
            let new = replacement(&running, cut_s, &goal_rad, &limits).unwrap();
            ratios.push((new.duration_s() - cut_s) / optimum_s(&running, cut_s, &goal_rad, &limits));
            (running, from_s) = (new, cut_s);
        }
    }
    ratios.sort_by(f64::total_cmp);
    let (median, high) = (ratios[ratios.len() / 2], ratios[ratios.len() * 95 / 100]);
    assert!(median <= 1.15 && high <= 1.4, "median {median}, 95th percentile {high}");
}

/// Goal: arguments that make no sense are refused, without a panic.
#[test]
fn replacement_with_arguments_that_are_no_numbers_is_refused() {
    let mut rng = SeededRng::new(0, 5);
    let limits = limits(&mut rng);
    let running = straight(&mut rng, &limits);
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(replacement(&running, bad, running.base_rad(), &limits).is_none());
        assert!(to_rest(&running, bad, &limits).is_none());
        let mut odd = limits;
        odd[0].motion.jerk_rad_s3 = bad;
        assert!(to_rest(&running, 0.1, &odd).is_none());
    }
    let mut goal_rad = *running.base_rad();
    goal_rad[0] = f64::NAN;
    assert!(replacement(&running, 0.1, &goal_rad, &limits).is_none());
    goal_rad[0] = 1e300;
    assert!(replacement(&running, 0.1, &goal_rad, &limits).is_none());
}
