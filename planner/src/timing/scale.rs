//! The factor on all times after which strokes fit the motion limits.
use taustream_motion::stroke::Phi;
use taustream_motion::{JointLimits, MAX_JOINTS, Stroke};

/// Factor on all times after which peaks, sampled every so often while something runs, fit the motion limits.
pub(crate) fn scale_to_fit(
    strokes: &[Stroke],
    joints: usize,
    limits: &[JointLimits; MAX_JOINTS],
    every_s: f64,
) -> f64 {
    let end_s = strokes.last().map_or(0.0, Stroke::end_s);
    let mut scale: f64 = 0.0;
    let (mut first, mut t_s) = (0, every_s * 0.5);
    while t_s < end_s {
        while strokes.get(first).is_some_and(|s| s.has_ended(t_s)) {
            first += 1;
        }
        if let Some(next) = strokes.get(first).filter(|next| next.start_s >= t_s) {
            // Nothing runs: a long rest costs nothing.
            t_s = next.start_s + every_s * 0.5;
        }
        let (mut v, mut a, mut j) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for stroke in strokes.iter().skip(first).take_while(|s| s.start_s < t_s) {
            let (phi, rate) = (stroke.phi(t_s), 1.0 / stroke.duration_s);
            let (d1, d2, d3) = scaled(&phi, rate);
            for (i, delta) in stroke.delta_rad.iter().enumerate().take(joints) {
                v[i] += delta * d1;
                a[i] += delta * d2;
                j[i] += delta * d3;
            }
        }
        for (i, limits) in limits.iter().enumerate().take(joints) {
            let m = limits.motion;
            scale = scale
                .max(used(v[i], m.velocity_rad_s))
                .max(used(a[i], m.acceleration_rad_s2).sqrt())
                .max(used(j[i], m.jerk_rad_s3).cbrt());
        }
        t_s += every_s;
    }
    scale
}

fn scaled(phi: &Phi, rate: f64) -> (f64, f64, f64) {
    (phi.d1 * rate, phi.d2 * rate * rate, phi.d3 * rate * rate * rate)
}

/// Share of a limit that is used; something over nothing is infinite, nothing over nothing is nothing.
pub(crate) fn used(value: f64, limit: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.abs() / limit }
}
