//! Tests of samples that are not paired.
use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::stats_tests::Alternative;
use statrs::stats_tests::mannwhitneyu::{MannWhitneyUMethod, mannwhitneyu};

/// What a table prints of a sample.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Moments {
    /// How many values.
    pub n: usize,
    /// Their mean.
    pub mean: f64,
    /// Their deviation, with n - 1.
    pub sd: f64,
}

/// Two-sided probability that two samples of one mean differ so (Welch 1947); 1 when neither varies and both are the
/// same, 0 when neither varies and they are not. `None` for samples below two values.
#[must_use]
pub fn welch(a: Moments, b: Moments) -> Option<f64> {
    if a.n < 2 || b.n < 2 {
        return None;
    }
    let [va, vb] = [a, b].map(|m| m.sd * m.sd / m.n as f64);
    let away = (a.mean - b.mean).abs();
    if va + vb == 0.0 {
        return Some(if away == 0.0 { 1.0 } else { 0.0 });
    }
    let freedom = (va + vb).powi(2) / (va * va / (a.n - 1) as f64 + vb * vb / (b.n - 1) as f64);
    let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
    Some(2.0 * student.sf(away / (va + vb).sqrt()))
}

/// Two-sided probability that two unpaired samples of one distribution differ so (Mann and Whitney 1947), normal with
/// corrections for ties and continuity. `None` for an empty sample or one with a NaN.
#[must_use]
pub fn mann_whitney(a: &[f64], b: &[f64]) -> Option<f64> {
    // Not the exact method: statrs 0.19.1 gives 1 for two small samples that do not even overlap.
    let method = MannWhitneyUMethod::AsymptoticInclContinuityCorrection;
    mannwhitneyu(a, b, method, Alternative::TwoSided).ok().map(|(_, p)| p)
}
