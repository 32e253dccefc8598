//! The measurement: how late this computer wakes the cycle up.
use super::finding::Finding;
use serde::Serialize;
use std::fmt;
use std::time::Duration;
use taustream_streamer::bench::WakeUps;

/// Share of the period that a good controller stays within.
const GOOD: f64 = 0.1;
/// Share of the period from which on the streamer counts a cycle as late.
const LATE: f64 = 0.5;
/// Cells of the longest bar.
const BAR: u64 = 40;

/// What was measured, and whether the kernel stands by it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Latency {
    #[serde(flatten)]
    pub(crate) wake_ups: WakeUps,
    /// How long was measured.
    pub(crate) seconds: f64,
    /// True when the kernel is made for a bound.
    pub(crate) bounded: bool,
}

impl Latency {
    /// The grade of the worst wake-up against the period.
    pub(crate) fn evaluate(&self) -> Finding {
        const NAME: &str = "wake-up latency";
        const REMEDY: &str = "fix the findings above, then measure for minutes under the load of operation: \
                            taustream doctor --seconds 600";
        let lateness = &self.wake_ups.lateness;
        let (p50, p99, max) = (us(lateness.p50_ns), us(lateness.p99_ns), us(lateness.max_ns));
        let period_us = f64::from(self.wake_ups.period_us);
        let how = if self.wake_ups.realtime { "" } else { ", WITHOUT real-time rights" };
        let what = format!(
            "p50 {p50:.0} us, p99 {p99:.0} us, worst {max:.0} us of a period of {period_us:.0} us in {} s{how}",
            self.seconds
        );
        if max > LATE * period_us || self.wake_ups.skipped > 0 {
            Finding::problem(NAME, format!("{what}: cycles will be late"), REMEDY)
        } else if max > GOOD * period_us || !self.wake_ups.realtime {
            Finding::warning(NAME, what, REMEDY)
        } else {
            Finding::ok(NAME, what)
        }
    }
}

impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let w = &self.wake_ups;
        writeln!(f, "wake-ups by lateness ({} in all, {} deadlines skipped):", w.lateness.count, w.skipped)?;
        let most = w.histogram.iter().map(|bin| bin.count).max().unwrap_or(0).max(1);
        let last = w.histogram.iter().rposition(|bin| bin.count > 0).unwrap_or(0);
        for bin in w.histogram.iter().take(last + 1) {
            let range = bin.at_most_us.map_or_else(
                || format!("above {}", bin.above_us),
                |high| format!("{} to {high}", bin.above_us),
            );
            // One that came shows, however many others there are.
            let cells = (bin.count * BAR).div_ceil(most);
            let bar = "#".repeat(usize::try_from(cells).unwrap_or(0));
            writeln!(f, "  {range:>14} us {:>9}  {bar}", bin.count)?;
        }
        for missing in &w.missing {
            writeln!(f, "  {missing}")?;
        }
        let bound = if self.bounded {
            "The worst of a short time is no worst case: measure for hours, under load, before an arm depends on it."
        } else {
            "This kernel promises no bound: under load it will be worse than this, by any amount."
        };
        write!(f, "{bound}")
    }
}

/// Nanoseconds as microseconds.
fn us(ns: u64) -> f64 {
    Duration::from_nanos(ns).as_secs_f64() * 1e6
}
