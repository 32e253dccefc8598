//! Smoothing by the kernel: what it keeps, what it costs, and what it refuses.
mod common;
use common::SeededRng;
use taustream_motion::smoothing::{Kernel, moments, smooth};
use taustream_motion::stroke::Phi;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory, TrajectoryError};

fn one(value: f64) -> JointArray {
    let mut array = [0.0; MAX_JOINTS];
    array[0] = value;
    array
}

/// Goal: the closed forms are the kernel's. Method: the trapezium rule on phi itself.
#[test]
fn moments_are_those_of_the_kernel() {
    for n in [4, 5, 6, 8, 10, 64] {
        let steps = 200_000;
        let (mut mean, mut square) = (0.0, 0.0);
        for i in 0..steps {
            let s = (f64::from(i) + 0.5) / f64::from(steps);
            let share = Phi::at(n, s).d1 / f64::from(steps);
            mean += s * share;
            square += s * s * share;
        }
        let [ours, spread] = moments(n);
        assert!((ours - mean).abs() < 1e-9, "n {n}: mean {ours}, {mean}");
        assert!((spread - (square - mean * mean).sqrt()).abs() < 1e-9, "n {n}: deviation {spread}");
    }
}

/// Goal: the delay and the cut corner are what the header says. Method: a motion at constant speed comes out as itself,
/// late; one at constant acceleration is off by the variance of the kernel.
#[test]
fn motion_of_constant_speed_comes_out_late_and_one_of_constant_acceleration_off_by_the_variance() {
    let (span_s, n, width_s) = (4.0, 6, 0.5);
    let kernel = Kernel { n, width_s, parts: 256 };
    let (delay_s, [_, spread]) = (kernel.delay_s(span_s), moments(n));
    let line = smooth(1, span_s, &kernel, |t| one(0.3 + 0.7 * t)).unwrap();
    let parabola = smooth(1, span_s, &kernel, |t| one(0.5 * 2.0 * t * t)).unwrap();
    for i in 0..=200 {
        let t = 0.7 + 0.015 * f64::from(i);
        let (line, parabola) = (line.sample(t), parabola.sample(t));
        let ripple = (line.position_rad[0] - 0.3 - 0.7 * (t - delay_s)).abs();
        assert!(ripple < 1e-7 && (line.velocity_rad_s[0] - 0.7).abs() < 1e-4, "{t}: {ripple:e}");
        let off = parabola.position_rad[0] - (t - delay_s) * (t - delay_s);
        let spacing_s = kernel.spacing_s(span_s);
        // Each part of the motion counts at once, which widens the kernel by that of a uniform one.
        let expected = spread * spread * width_s * width_s + spacing_s * spacing_s / 12.0;
        assert!((off - expected).abs() < 0.02 * expected, "{t}: {off:e} against {expected:e}");
    }
}

/// Goal: derivatives are averaged: what keeps limits keeps them, up to the ripple. Method: random motions timed to use an
/// arm's limits in full, smoothed by random kernels of 16 parts, and looked at closely. With three parts a kernel they break.
#[test]
fn motion_inside_its_limits_stays_inside_up_to_the_ripple() {
    const LIMITS: [f64; 3] = [3.0, 15.0, 150.0];
    let share = |motion: &Trajectory| {
        let mut share: f64 = 0.0;
        for i in 0..4_000 {
            let q = motion.sample(motion.duration_s() * f64::from(i) / 4_000.0);
            let uses =
                |values: JointArray, limit: f64| values.iter().fold(0.0, |m: f64, x| m.max(x.abs())) / limit;
            let [v, a, j] = [q.velocity_rad_s, q.acceleration_rad_s2, q.jerk_rad_s3];
            let [v, a, j] = [uses(v, LIMITS[0]), uses(a, LIMITS[1]).sqrt(), uses(j, LIMITS[2]).cbrt()];
            share = share.max(v).max(a).max(j);
        }
        share
    };
    let mut coarse_breaks = 0;
    for seed in 0..60 {
        let mut rng = SeededRng::from_seed(seed);
        let motion = rng.trajectory(3, 8, 1.0);
        let scale = share(&motion);
        let span_s = motion.duration_s() * scale;
        let (n, kernels) = (rng.whole(5, 8), rng.whole(8, 25));
        let smoothed = |a_kernel: u32| {
            let kernel = Kernel { n, width_s: span_s / f64::from(kernels), parts: kernels * a_kernel };
            smooth(3, span_s, &kernel, |t| motion.sample(t / scale).position_rad).unwrap()
        };
        let fine = smoothed(16);
        assert_eq!(fine.base_rad().map(f64::to_bits), motion.base_rad().map(f64::to_bits));
        let ends = fine.end_rad().into_iter().zip(motion.end_rad()).map(|(a, b)| (a - b).abs());
        assert!(ends.fold(0.0, f64::max) < 1e-12);
        assert!(share(&fine) < 1.01, "seed {seed}: {} of the limits in time", share(&fine));
        coarse_breaks += u32::from(share(&smoothed(3)) > 1.05);
    }
    assert!(coarse_breaks > 10, "only {coarse_breaks} of 60 show that the spacing matters");
}

#[test]
fn parts_in_which_nothing_moves_take_no_strokes() {
    let step = |t: f64| one((t - 40.0).clamp(0.0, 1.0) + (t - 90.0).clamp(0.0, 1.0));
    let kernel = Kernel { n: 6, width_s: 0.4, parts: 10_000 };
    let smoothed = smooth(1, 100.0, &kernel, step).unwrap();
    assert!((200..=204).contains(&smoothed.strokes().len()), "{}", smoothed.strokes().len());
    assert!((smoothed.end_rad()[0] - 2.0).abs() < 1e-12 && smoothed.sample(60.0).position_rad[0] > 0.999_999);
    let still = smooth(1, 100.0, &kernel, |_| one(0.5)).unwrap();
    assert!(still.strokes().is_empty() && still.base_rad()[0].to_bits() == 0.5_f64.to_bits());
}

#[test]
fn motion_that_is_too_much_for_strokes_is_refused() {
    let kernel = |n, width_s, parts| Kernel { n, width_s, parts };
    let refused = |kernel: Kernel, span_s| smooth(1, span_s, &kernel, one).unwrap_err();
    assert_eq!(refused(kernel(6, 0.1, 513), 10.0), TrajectoryError::StrokeCount { strokes: 513 });
    for (kernel, span_s) in [
        (kernel(3, 0.1, 8), 10.0),
        (kernel(6, 0.0, 8), 10.0),
        (kernel(6, f64::NAN, 8), 10.0),
        (kernel(6, 0.1, 8), f64::NAN),
        (kernel(6, 0.1, 8), 1e6),
    ] {
        let _refused = refused(kernel, span_s);
    }
    assert!(smooth(1, 1.0, &kernel(6, 0.1, 8), |_| one(f64::NAN)).is_err());
    assert!(smooth(1, 1.0, &kernel(6, 0.1, 0), one).is_ok_and(|t| t.strokes().is_empty()));
}
