//! Effects with their intervals.
//!
//! Sources: Hodges and Lehmann, "Estimates of location based on rank tests", Annals of Mathematical Statistics 34, 1963;
//! Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22, 1927.
//! tests/statistics.rs holds them against scipy and R.
use super::wilcoxon::ranks_outside;
use super::{Level, quantile};
use statrs::distribution::{Binomial, DiscreteCDF};

/// An estimate with the interval that misses the truth as often as a [`Level`] allows.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The estimate.
    pub value: f64,
    /// Lower and upper end; infinite when the sample is too small for one.
    pub interval: [f64; 2],
}

impl Estimate {
    /// Of a sample that says nothing.
    pub const UNKNOWN: Self = Self { value: f64::NAN, interval: [f64::NEG_INFINITY, f64::INFINITY] };

    /// The estimate and both ends through a function that rises.
    #[must_use]
    pub fn map(self, rising: impl Fn(f64) -> f64) -> Self {
        Self { value: rising(self.value), interval: self.interval.map(rising) }
    }
}

/// The shift of differences (Hodges and Lehmann): the median of the means of all pairs of them, with the interval of the
/// signed-rank test; without one where the sample is too small for the level. Differences that are no numbers are left
/// out.
#[must_use]
pub fn shift(differences: &[f64], level: Level) -> Estimate {
    let known: Vec<f64> = differences.iter().copied().filter(|d| d.is_finite()).collect();
    let mut means = Vec::with_capacity(known.len() * (known.len() + 1) / 2);
    for (i, a) in known.iter().enumerate() {
        means.extend(known.iter().skip(i).map(|b| 0.5 * (a + b)));
    }
    if means.is_empty() {
        return Estimate::UNKNOWN;
    }
    means.sort_by(f64::total_cmp);
    let value = quantile(&means, 0.5);
    let Some(outer) = ranks_outside(known.len(), level) else {
        return Estimate { value, ..Estimate::UNKNOWN };
    };
    let at = |i: usize| means.get(i).copied().unwrap_or(f64::NAN);
    Estimate { value, interval: [at(outer), at(means.len() - 1 - outer)] }
}

/// A share of runs, with Wilson's interval.
#[must_use]
pub fn share(count: usize, of: usize, level: Level) -> Estimate {
    if of == 0 {
        return Estimate::UNKNOWN;
    }
    let (p, n, z) = (count as f64 / of as f64, of as f64, level.z());
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt() / (1.0 + z * z / n);
    // Exact where none or all do.
    let low = if count == 0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if count == of { 1.0 } else { (middle + half).min(1.0) };
    Estimate { value: p, interval: [low, high] }
}

/// The median, between the order statistics that hold it.
#[must_use]
pub fn median(values: &[f64], level: Level) -> Estimate {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    sorted.sort_by(f64::total_cmp);
    let (value, n) = (quantile(&sorted, 0.5), sorted.len());
    let Ok(coin) = Binomial::new(0.5, n as u64) else { return Estimate::UNKNOWN };
    // So many of the lowest and of the highest may be left out.
    let outer = (0..n / 2).take_while(|k| coin.cdf(*k as u64) <= level.tail()).count();
    if outer == 0 {
        return Estimate { value, ..Estimate::UNKNOWN };
    }
    Estimate { value, interval: [sorted[outer - 1], sorted[n - outer]] }
}
