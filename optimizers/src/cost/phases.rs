//! The profile of a stroke at equal time steps: one table for all segments and all evaluations.
use taustream_motion::stroke::Phi;

/// phi at step / steps for every step before the last: where a stroke ends, the next one starts.
pub(super) fn phases(n: u32, steps: usize) -> Vec<f64> {
    (0..steps).map(|step| Phi::at(n, step as f64 / steps as f64).value).collect()
}
