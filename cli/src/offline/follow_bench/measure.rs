//! Lag, error and peaks of logged setpoints.
use super::TICK_S;
use serde::Serialize;

/// Largest lag that is looked for, s.
const LAG_S_MAX: f64 = 1.0;
/// Shifts that are tried first and last, s.
const SHIFTS_S: [f64; 2] = [0.01, 0.5e-3];
/// Of the setpoints, one in so many is compared: they are close to their neighbours.
const COMPARED: usize = 5;

/// What is measured of a motion that follows.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct Measured {
    /// Shift of least error, ms.
    pub(super) lag_ms: f64,
    /// Error after that shift, rad (rms).
    pub(super) rms_rad: f64,
    /// Peaks of velocity, acceleration and jerk: finite differences of the setpoints.
    pub(super) velocity_rad_s: f64,
    pub(super) acceleration_rad_s2: f64,
    pub(super) jerk_rad_s3: f64,
}

/// Compares setpoints at 0, 1, 2 .. ms with the motion that was meant, those of the first `skipped` ms left out.
pub(super) fn measure(setpoints: &[f64], skipped: usize, meant: &dyn Fn(f64) -> f64) -> Measured {
    let error = |lag_s: f64| {
        let compared = || setpoints.iter().enumerate().skip(skipped).step_by(COMPARED);
        let squares = compared().map(|(k, q)| (q - meant(k as f64 * TICK_S - lag_s)).powi(2));
        (squares.sum::<f64>() / compared().count().max(1) as f64).sqrt()
    };
    let best = |from_s: f64, to_s: f64, step_s: f64| {
        let (mut lag_s, mut best) = (from_s, (from_s, f64::INFINITY));
        while lag_s <= to_s {
            let now = error(lag_s);
            if now < best.1 {
                best = (lag_s, now);
            }
            lag_s += step_s;
        }
        best
    };
    let (near_s, _) = best(0.0, LAG_S_MAX, SHIFTS_S[0]);
    let (lag_s, rms_rad) = best((near_s - SHIFTS_S[0]).max(0.0), near_s + SHIFTS_S[0], SHIFTS_S[1]);
    let [velocity_rad_s, acceleration_rad_s2, jerk_rad_s3] = peaks(setpoints.get(skipped..).unwrap_or(&[]));
    Measured { lag_ms: lag_s * 1e3, rms_rad, velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 }
}

/// Largest first, second and third difference.
pub(super) fn peaks(setpoints: &[f64]) -> [f64; 3] {
    let mut row = setpoints.to_vec();
    let mut peaks = [0.0; 3];
    for peak in &mut peaks {
        row = row.iter().zip(row.iter().skip(1)).map(|(a, b)| (b - a) / TICK_S).collect();
        *peak = row.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    }
    peaks
}
