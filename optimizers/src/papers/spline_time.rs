//! How long each piece of a spline should last: time against impact (Li, Xing and Qin 2025).
//!
//! F = Kt F1 + Kj F2 + Kp Fp with F1 the whole time, F2 the sum over the joints of their jerk's root mean square, and
//! Fp the number of limits that are broken, one for each joint and each of speed, acceleration and jerk.
//!
//! Source: eq. 1 to 4. Corrected against printed: time and jerk are divided by reference values before they are added
//! (the paper says "normalised" and not how; printed, they are added as they are); and a broken limit costs, beside
//! Kp, [`HARD`] times the share by which it is broken, since 0.5 buys any limit. The limits themselves are not in the
//! paper. Peaks are the highest of [`SAMPLES`] samples a piece.
use super::quadrature::gauss;
use super::spline::{Spline, SplineError};
use crate::{Problem, Reading};

/// What breaking a limit by its whole value costs in the corrected reading.
pub const HARD: f64 = 1_000.0;
/// Samples a piece for the peaks.
pub const SAMPLES: u32 = 24;
/// Weights of time, impact and penalty.
pub const PAPER_001: [f64; 3] = [0.4, 0.6, 0.5];

/// Limits of one joint: speed (rad/s), acceleration (rad/s²), jerk (rad/s³).
pub type JointLimit = [f64; 3];

/// The problem.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineTime {
    points_rad: Vec<Vec<f64>>,
    limits: Vec<JointLimit>,
    bounds_s: Vec<[f64; 2]>,
    /// What time and jerk are divided by.
    reference: [f64; 2],
    reading: Reading,
}

/// The objective and its parts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineCost {
    /// F1.
    pub time_s: f64,
    /// F2.
    pub jerk_rad_s3: f64,
    /// Fp.
    pub broken: usize,
    /// Sum of the shares by which limits are broken.
    pub excess: f64,
    /// F.
    pub cost: f64,
}

impl SplineTime {
    /// The problem of moving through points with pieces that last from `bounds_s[0]` to `bounds_s[1]` each. What time
    /// and jerk are compared with is the curve whose pieces all last the mean of the two.
    ///
    /// # Errors
    /// When there is no spline through the points, or a joint's limits are missing or make no sense.
    pub fn new(
        points_rad: &[Vec<f64>],
        limits: &[JointLimit],
        bounds_s: [f64; 2],
        reading: Reading,
    ) -> Result<Self, SplineError> {
        let joints = points_rad.first().map_or(0, Vec::len);
        if limits.len() != joints {
            return Err(SplineError::Limit { joint: limits.len().min(joints), joints, value: f64::NAN });
        }
        // NaN would never be broken.
        let bad = |(joint, limit): (usize, &JointLimit)| {
            limit.iter().find(|l| l.is_nan() || **l <= 0.0).map(|&value| SplineError::Limit {
                joint,
                joints,
                value,
            })
        };
        if let Some(refusal) = limits.iter().enumerate().find_map(bad) {
            return Err(refusal);
        }
        let intervals = points_rad.len().saturating_sub(1);
        let middle_s = 0.5 * (bounds_s[0] + bounds_s[1]);
        let spline = Spline::through(points_rad, &vec![middle_s; intervals])?;
        let reference = match reading {
            // Points that do not differ need no jerk.
            Reading::Corrected => [spline.total_s(), impact(&spline).max(f64::MIN_POSITIVE)],
            Reading::Printed => [1.0, 1.0],
        };
        let (points_rad, limits) = (points_rad.to_vec(), limits.to_vec());
        Ok(Self { points_rad, limits, bounds_s: vec![bounds_s; intervals], reference, reading })
    }

    /// The objective of intervals.
    ///
    /// # Errors
    /// When there is no such spline.
    pub fn evaluate(&self, intervals_s: &[f64]) -> Result<SplineCost, SplineError> {
        let spline = Spline::through(&self.points_rad, intervals_s)?;
        let (time_s, jerk_rad_s3) = (spline.total_s(), impact(&spline));
        let (mut broken, mut excess) = (0, 0.0);
        for (joint, limits) in self.limits.iter().enumerate() {
            for (order, limit) in limits.iter().enumerate() {
                let peak = peak(&spline, joint, order + 1);
                if peak > *limit {
                    (broken, excess) = (broken + 1, excess + (peak / limit - 1.0));
                }
            }
        }
        let ([kt, kj, kp], [time, jerk]) = (PAPER_001, self.reference);
        let mut cost = kt * time_s / time + kj * jerk_rad_s3 / jerk + kp * broken as f64;
        if self.reading == Reading::Corrected {
            cost += HARD * excess;
        }
        Ok(SplineCost { time_s, jerk_rad_s3, broken, excess, cost })
    }
}

impl Problem for SplineTime {
    fn bounds(&self) -> &[[f64; 2]] {
        &self.bounds_s
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.evaluate(x).map_or(f64::INFINITY, |evaluated| evaluated.cost)
    }
}

/// Sum over the joints of their jerk's root mean square. Between two joins the jerk has degree four, so that the rule
/// is exact.
fn impact(spline: &Spline) -> f64 {
    let joins = spline.joins_s();
    let rms = |joint: usize| {
        let jerk = |t: f64| spline.at(joint, t, 3).unwrap_or(0.0);
        let piece = |p: &[f64]| if let [a, b] = p { gauss(*a, *b, |t| jerk(t).powi(2)) } else { 0.0 };
        (joins.windows(2).map(piece).sum::<f64>() / spline.total_s()).sqrt()
    };
    (0..spline.joints()).map(rms).sum()
}

fn peak(spline: &Spline, joint: usize, order: usize) -> f64 {
    let mut peak: f64 = 0.0;
    for piece in spline.joins_s().windows(2) {
        let [a, b] = piece else { continue };
        for i in 0..=SAMPLES {
            let at_s = a + (b - a) * f64::from(i) / f64::from(SAMPLES);
            peak = peak.max(spline.at(joint, at_s, order).unwrap_or(0.0).abs());
        }
    }
    peak
}
