//! A sample in a few numbers.
use super::Moments;

/// A sample in a few numbers.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Summary {
    /// How many values.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// Their deviation, with n - 1; 0 for a single value.
    pub sd: f64,
    /// The least one.
    pub least: f64,
    /// Lower quartile.
    pub q1: f64,
    /// The middle one.
    pub median: f64,
    /// Upper quartile.
    pub q3: f64,
    /// The largest one.
    pub most: f64,
}

impl Summary {
    /// Of values; all NaN for none.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let n = values.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        let sd = if n > 1 { (squares / (n - 1) as f64).sqrt() } else { 0.0 };
        let [least, q1, median, q3, most] = [0.0, 0.25, 0.5, 0.75, 1.0].map(|q| quantile(values, q));
        Self { n, mean, sd, least, q1, median, q3, most }
    }

    /// What Welch's test needs.
    #[must_use]
    pub fn moments(&self) -> Moments {
        Moments { n: self.n, mean: self.mean, sd: self.sd }
    }
}

/// The value below which a share `q` of a sample lies, linear between two values; NaN for an empty sample.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = q.clamp(0.0, 1.0) * (sorted.len().max(1) - 1) as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to the last index")]
    let below = place.floor() as usize;
    let Some(&low) = sorted.get(below) else { return f64::NAN };
    let high = sorted.get(below + 1).copied().unwrap_or(low);
    let share = place - place.floor();
    // Equal values stay what they are, infinite ones too.
    if share == 0.0 || low.total_cmp(&high).is_eq() { low } else { low + share * (high - low) }
}
