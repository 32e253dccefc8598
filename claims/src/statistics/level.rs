//! How often an interval may miss the truth.
use statrs::distribution::{ContinuousCDF, Normal};

/// The share of experiments whose interval misses the truth, on both sides together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level(f64);

impl Level {
    /// Intervals that hold the truth in 95 of 100 experiments.
    pub const FIVE_PERCENT: Self = Self(super::SIGNIFICANT);

    /// What each of so many intervals may miss for all of them together to miss no more than this (Bonferroni).
    #[must_use]
    pub fn over(self, intervals: usize) -> Self {
        Self(self.0 / intervals.max(1) as f64)
    }

    /// The share itself.
    #[must_use]
    pub const fn share(self) -> f64 {
        self.0
    }

    /// What one side may miss.
    pub(super) fn tail(self) -> f64 {
        0.5 * self.0
    }

    /// Quantile of the standard normal distribution.
    pub(super) fn z(self) -> f64 {
        Normal::standard().inverse_cdf(1.0 - self.tail())
    }
}
