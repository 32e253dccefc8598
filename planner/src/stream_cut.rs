//! Where a stream of targets cuts the motion that runs.
use taustream_messages::{Phase, Report};

/// A cut, in trajectory time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StreamCut {
    /// From when on the motion may differ.
    pub at_s: f64,
    /// From when on the replacement is sampled: strokes that have ended then may be folded.
    pub folded_s: f64,
}

/// The first cut that a piece can keep which reaches the streamer `latency_s` after `now_ns` (CLOCK_MONOTONIC), of a motion that ends
/// at `end_s`: the one that waits, if one does, else the one that runs.
#[must_use]
pub fn cut(report: &Report, now_ns: u64, latency_s: f64, end_s: f64) -> StreamCut {
    let ahead_s = report.trajectory_s + rate(report) * (age_s(report, now_ns) + latency_s);
    if report.successor_id == 0 {
        let at_s = ahead_s.min(end_s);
        return StreamCut { at_s, folded_s: at_s };
    }
    StreamCut { at_s: ahead_s.max(report.successor_from_s).min(end_s), folded_s: report.successor_from_s }
}

/// How fast trajectory time may advance, s a second.
pub(crate) fn rate(report: &Report) -> f64 {
    match Phase::from_code(report.phase) {
        Some(Phase::Paused) => 0.0,
        _ => report.sigma.max(report.speed_percent / 100.0).clamp(0.0, 1.0),
    }
}

/// Age of a report, s; one that is older than a second counts as a second old.
pub(crate) fn age_s(report: &Report, now_ns: u64) -> f64 {
    std::time::Duration::from_nanos(now_ns.saturating_sub(report.time_ns)).as_secs_f64().min(1.0)
}
