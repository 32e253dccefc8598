//! The brake against an independent solver, and its limits by independent integration.
mod common;
use common::{SeededRng, slope};
use proptest::prelude::*;
use rsruckig::prelude::{
    ControlInterface, DataArrayOrVec, InputParameter, Ruckig, Synchronization, ThrowErrorHandler,
    Trajectory as RuckigTrajectory,
};
use taustream_motion::brake::{Brake, JointState};

struct Case {
    start: JointState,
    acceleration: f64,
    jerk: f64,
}

/// Any state inside the acceleration limit, or up to twice beyond it.
fn case(rng: &mut SeededRng, beyond: f64) -> Case {
    let acceleration = rng.within(1.0, 30.0);
    let start = JointState {
        position_rad: rng.within(-3.0, 3.0),
        velocity_rad_s: rng.within(-3.5, 3.5),
        acceleration_rad_s2: acceleration * rng.within(-beyond, beyond),
    };
    Case { start, acceleration, jerk: rng.within(5.0, 600.0) }
}

/// Goal: the brake is time-optimal and ends where the optimum ends.
/// Method: rsruckig in velocity control. Each joint for itself (`Synchronization::None`), because the
/// time-synchronised stops of its version 3.0.1 break the jerk limit.
#[test]
fn brake_from_any_state_takes_the_time_and_distance_of_the_independent_solver() {
    let mut solver = Ruckig::<1, ThrowErrorHandler>::new(None, 0.001);
    let mut input = InputParameter::<1>::new(None);
    input.control_interface = ControlInterface::Velocity;
    input.synchronization = Synchronization::None;
    let mut trajectory = RuckigTrajectory::<1>::new(None);
    for seed in 0..20_000 {
        // Every fourth starts beyond the acceleration limit, as after a change of limits or a fault.
        let Case { start, acceleration, jerk } =
            case(&mut SeededRng::from_seed(seed), if seed % 4 == 0 { 2.0 } else { 1.0 });
        let brake = Brake::from_state(start, acceleration, jerk);
        input.current_position[0] = start.position_rad;
        input.current_velocity[0] = start.velocity_rad_s;
        input.current_acceleration[0] = start.acceleration_rad_s2;
        input.max_acceleration[0] = acceleration;
        input.max_jerk[0] = jerk;
        solver.calculate(&input, &mut trajectory).unwrap();
        let gap_s = (brake.duration_s() - trajectory.get_duration()).abs();
        assert!(
            gap_s < 1e-9,
            "seed {seed}: {} s against {} s",
            brake.duration_s(),
            trajectory.get_duration()
        );
        for part in 0..=10 {
            let t_s = brake.duration_s() * f64::from(part) / 10.0;
            let (mut p, mut v, mut a) = (
                DataArrayOrVec::new(None, 0.0),
                DataArrayOrVec::new(None, 0.0),
                DataArrayOrVec::new(None, 0.0),
            );
            trajectory.at_time(
                t_s,
                &mut Some(&mut p),
                &mut Some(&mut v),
                &mut Some(&mut a),
                &mut None,
                &mut None,
            );
            let (state, _) = brake.sample(t_s);
            let gaps = [
                (state.position_rad - p[0]).abs(),
                (state.velocity_rad_s - v[0]).abs(),
                (state.acceleration_rad_s2 - a[0]).abs() / jerk,
            ];
            assert!(gaps.iter().all(|gap| *gap < 1e-8), "seed {seed}, t {t_s}: {gaps:?}");
        }
    }
}

/// Steps of the independent integration.
const STEPS: u32 = 2_000;

/// Goal: position, velocity, acceleration and jerk belong together, limits hold, and the end is rest.
/// Method: sums of the jerk over small steps, and Richardson differences; neither knows the closed form.
#[test]
fn brake_from_any_state_integrates_to_rest_inside_its_limits() {
    for seed in 0..2_000 {
        let Case { start, acceleration, jerk } = case(&mut SeededRng::from_seed(seed), 1.0);
        let brake = Brake::from_state(start, acceleration, jerk);
        let step_s = brake.duration_s() / f64::from(STEPS);
        let mut sum = start;
        for step in 0..STEPS {
            // The middle of the step stands for all of it, which is exact but where the jerk changes.
            let (state, jerk_now) = brake.sample((f64::from(step) + 0.5) * step_s);
            assert!(
                jerk_now.abs() <= jerk && state.acceleration_rad_s2.abs() <= acceleration * (1.0 + 1e-12)
            );
            sum = JointState {
                position_rad: sum.position_rad + step_s * sum.velocity_rad_s,
                velocity_rad_s: sum.velocity_rad_s + step_s * sum.acceleration_rad_s2,
                acceleration_rad_s2: sum.acceleration_rad_s2 + step_s * jerk_now,
            };
        }
        let scale = jerk * brake.duration_s() * 3.0 / f64::from(STEPS);
        assert!(sum.acceleration_rad_s2.abs() <= 2.0 * scale, "seed {seed}: ends at {sum:?}");
        let settle = scale * brake.duration_s() * 2.0 + 1e-9;
        assert!(sum.velocity_rad_s.abs() <= settle, "seed {seed}: ends at {sum:?}");
        let off_rad = (sum.position_rad - brake.rest_rad()).abs();
        assert!(
            off_rad <= settle * brake.duration_s() * 2.0 + 4.0 * step_s,
            "seed {seed}: {off_rad} rad off"
        );

        let t_s = SeededRng::from_seed(!seed).within(0.05, 0.95) * brake.duration_s();
        let h = 1e-3 * brake.duration_s();
        let v = slope(|t| brake.sample(t).0.position_rad, t_s, h);
        let gap = (v - brake.sample(t_s).0.velocity_rad_s).abs();
        assert!(gap < 1e-5 * jerk, "seed {seed}: velocity off by {gap:e}");
    }
}

/// Every sampled angle lies in the reported sweep, and the sweep is not wider than what is reached.
#[test]
fn sweep_of_a_brake_is_exactly_what_it_passes_over() {
    for seed in 0..2_000 {
        let Case { start, acceleration, jerk } = case(&mut SeededRng::from_seed(seed), 2.0);
        let brake = Brake::from_state(start, acceleration, jerk);
        let [low_rad, high_rad] = brake.sweep_rad();
        let mut seen = [start.position_rad; 2];
        for step in 0..=4_000 {
            let at_rad = brake.sample(brake.duration_s() * f64::from(step) / 4_000.0).0.position_rad;
            seen = [seen[0].min(at_rad), seen[1].max(at_rad)];
        }
        let outside = (low_rad - seen[0]).max(seen[1] - high_rad);
        assert!(outside < 1e-12, "seed {seed}: {outside:e} rad outside of the sweep");
        let slack = (seen[0] - low_rad).max(high_rad - seen[1]);
        // Between two samples the angle bends by at most a h^2/8.
        let bend = 2.0 * acceleration * (brake.duration_s() / 4_000.0).powi(2) / 8.0 + 1e-12;
        assert!(slack < bend, "seed {seed}: the sweep is {slack:e} rad too wide");
    }
}

#[test]
fn brake_of_a_joint_at_rest_is_nothing_and_stays() {
    let start = JointState { position_rad: 1.25, ..JointState::default() };
    let brake = Brake::from_state(start, 10.0, 100.0);
    assert_eq!(brake.duration_s().to_bits(), 0.0_f64.to_bits());
    for t_s in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(brake.sample(t_s), (start, 0.0));
    }
    assert_eq!(brake.sweep_rad().map(f64::to_bits), [1.25_f64.to_bits(); 2]);
}

/// Tiny, denormal and one-sided states: the sums that cancel must not leave a NaN or a negative time.
#[test]
fn brake_from_tiny_and_one_sided_states_is_finite() {
    let sizes: [f64; 8] = [0.0, -0.0, 5e-324, 1e-300, 1e-160, 1e-17, 1e-9, 1.0];
    for v in sizes.iter().flat_map(|v| [*v, -*v]) {
        for a in sizes.iter().flat_map(|a| [*a, -*a]) {
            // The velocity at which the way back to zero acceleration is the whole brake, and its neighbours.
            for v in [v, -a * a.abs() / 200.0, -a * a.abs() / 200.0 * (1.0 + 1e-15)] {
                let start = JointState { position_rad: 0.5, velocity_rad_s: v, acceleration_rad_s2: a };
                let brake = Brake::from_state(start, 10.0, 100.0);
                assert!(brake.duration_s() >= 0.0 && brake.rest_rad().is_finite(), "{v:e}, {a:e}: {brake:?}");
                let (near, _) = brake.sample(brake.duration_s() * (1.0 - 1e-12));
                assert!(near.velocity_rad_s.abs() < 1e-9, "{v:e}, {a:e}: {near:?}");
            }
        }
    }
}

proptest! {
    /// Numbers of any kind give a brake that is finite wherever its start is, and a length of zero where they are unusable.
    #[test]
    fn brake_from_any_bits_is_finite_or_zero_length(
        p in any::<f64>(), v in any::<f64>(), a in any::<f64>(), limit in any::<f64>(), jerk in any::<f64>(), t in any::<f64>(),
    ) {
        let start = JointState { position_rad: p, velocity_rad_s: v, acceleration_rad_s2: a };
        let brake = Brake::from_state(start, limit, jerk);
        prop_assert!(brake.duration_s().is_finite() && brake.duration_s() >= 0.0);
        let usable = [p, v, a, limit, jerk].iter().all(|x| x.is_finite()) && limit > 0.0 && jerk > 0.0;
        prop_assert!(usable || brake.duration_s() == 0.0);
        let _ = (brake.sample(t), brake.sweep_rad());
        prop_assert!(!p.is_finite() || brake.rest_rad().is_finite(), "{:?}", brake);
    }
}
