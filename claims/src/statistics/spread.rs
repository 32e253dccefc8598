//! Whether one sample is spread more than another.
//!
//! Source: Brown and Forsythe, "Robust tests for the equality of variances", JASA 69, 1974: Welch's comparison of the
//! distances from each sample's median.
use super::{Estimate, Level, Summary, quantile, welch};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// The mean distance from the median of the first sample over that of the second, less one, with its interval (of
/// Welch, the second taken for exact); and Brown and Forsythe's two-sided probability of such a difference by chance.
#[must_use]
pub fn spread(first: &[f64], second: &[f64], level: Level) -> (Estimate, f64) {
    let away = |values: &[f64]| {
        let median = quantile(values, 0.5);
        Summary::of(&values.iter().map(|v| (v - median).abs()).collect::<Vec<_>>())
    };
    let (a, b) = (away(first), away(second));
    let Some(p) = welch(a.moments(), b.moments()).filter(|_| b.mean > 0.0) else {
        return (Estimate::UNKNOWN, f64::NAN);
    };
    let [va, vb] = [a, b].map(|s| s.sd * s.sd / s.n as f64);
    let freedom = (va + vb).powi(2) / (va * va / (a.n - 1) as f64 + vb * vb / (b.n - 1) as f64);
    let reach =
        StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - level.tail()));
    let (value, half) = (a.mean / b.mean - 1.0, reach * (va + vb).sqrt() / b.mean);
    (Estimate { value, interval: [value - half, value + half] }, p)
}
