//! The clock that all processes of a host share.
use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

/// `CLOCK_MONOTONIC` now, ns.
#[must_use]
pub fn now_ns() -> u64 {
    ns_after(Duration::ZERO)
}

/// `CLOCK_MONOTONIC` at some time from now, ns.
pub(crate) fn ns_after(time: Duration) -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    let part = |value: i64| u64::try_from(value).unwrap_or(0);
    let later = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
    (part(now.tv_sec) * 1_000_000_000 + part(now.tv_nsec)).saturating_add(later)
}
