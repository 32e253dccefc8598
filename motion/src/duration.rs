//! How long a stroke must take: the shortest duration inside the limits, in closed form.
use crate::peaks::{PeakConstants, peak_constants};
use crate::stroke::{DURATION_S_MIN, N_MAX, N_MIN};
use crate::{JointArray, JointLimits, LimitSet, MAX_JOINTS};

/// Shortest duration of one stroke of one joint inside `limits` (s), and at least [`DURATION_S_MIN`].
///
/// Infinite when no duration serves: a joint that moves with a limit that is not positive, or a number that is not
/// finite.
#[must_use]
pub fn stroke_duration_s(delta_rad: f64, limits: &LimitSet, n: u32) -> f64 {
    duration_s(delta_rad, limits, &peak_constants(n))
}

/// Shortest duration of one stroke of all joints inside their motion limits (s); see [`stroke_duration_s`].
#[must_use]
pub fn joints_duration_s(delta_rad: &JointArray, limits: &[JointLimits; MAX_JOINTS], n: u32) -> f64 {
    let peaks = peak_constants(n);
    let each_s =
        delta_rad.iter().zip(limits).map(|(delta, limits)| duration_s(*delta, &limits.motion, &peaks));
    each_s.fold(DURATION_S_MIN, f64::max)
}

/// The n of [`N_MIN`] to [`N_MAX`] with which a stroke of all joints is shortest, and that duration (s). Of equal
/// ones the smallest n, which has the least peak velocity.
#[must_use]
pub fn best_n(delta_rad: &JointArray, limits: &[JointLimits; MAX_JOINTS]) -> (u32, f64) {
    let mut best = (N_MIN, joints_duration_s(delta_rad, limits, N_MIN));
    for n in N_MIN + 1..=N_MAX {
        let duration_s = joints_duration_s(delta_rad, limits, n);
        if duration_s < best.1 {
            best = (n, duration_s);
        }
    }
    best
}

fn duration_s(delta_rad: f64, limits: &LimitSet, peaks: &PeakConstants) -> f64 {
    let delta = delta_rad.abs();
    if delta == 0.0 {
        return DURATION_S_MIN;
    }
    let LimitSet { velocity_rad_s: v, acceleration_rad_s2: a, jerk_rad_s3: j } = *limits;
    // Not `<=`: NaN is no limit either.
    if !(v > 0.0 && a > 0.0 && j > 0.0 && delta.is_finite()) {
        return f64::INFINITY;
    }
    let velocity_s = peaks.c_v * delta / v;
    let acceleration_s = libm::sqrt(peaks.c_a * delta / a);
    let jerk_s = libm::cbrt(peaks.c_j * delta / j);
    velocity_s.max(acceleration_s).max(jerk_s).max(DURATION_S_MIN)
}
