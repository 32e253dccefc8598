//! What says whether two samples differ.
//!
//! Distributions and the test of Mann and Whitney come from statrs. The signed-rank test is ours: statrs has none.
//! tests/statistics.rs holds all of it against scipy.
mod interval;
mod level;
mod spread;
mod summary;
mod unpaired;
mod wilcoxon;

pub use interval::{Estimate, median, share, shift};
pub use level::Level;
pub use spread::spread;
pub use summary::{Summary, quantile};
pub use unpaired::{Moments, mann_whitney, welch};
pub use wilcoxon::{Paired, wilcoxon};

/// What counts as a difference that is not by chance.
pub const SIGNIFICANT: f64 = 0.05;
