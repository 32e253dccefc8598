//! How much work a plan may take: the clock that aborts, and the evaluations that are granted.
//!
//! Stages are granted evaluations, which are the same on every machine; the clock only aborts. So one seed gives
//! one answer wherever the clock did not cut in, and [`Budget::was_cut`] tells whether it did.
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Evaluations between two looks at the clock: a look costs tens of microseconds on a virtual machine, a distance
/// of two bodies tenths of one, to a large mesh tens.
const LOOK_EVERY: usize = 256;

/// The deadline of one plan, and its cancellation.
#[derive(Debug)]
pub struct Budget<'a> {
    started: Instant,
    deadline: Instant,
    cancel: Option<&'a AtomicBool>,
    /// Evaluations until the next look.
    left: Cell<usize>,
    cut: Cell<bool>,
}

impl<'a> Budget<'a> {
    /// Starts the clock.
    #[must_use]
    pub fn until(deadline: Duration, cancel: Option<&'a AtomicBool>) -> Self {
        let started = Instant::now();
        // A deadline beyond the clock's range is none: a century serves.
        let deadline = started.checked_add(deadline).unwrap_or(started + Duration::from_secs(3_153_600_000));
        Self { started, deadline, cancel, left: Cell::new(0), cut: Cell::new(false) }
    }

    /// Without a deadline that anybody lives to see.
    #[must_use]
    pub fn unbounded() -> Self {
        Self::until(Duration::MAX, None)
    }

    /// True from the deadline on, or when cancelled. Every loop of planning asks; looks at the clock.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.is_over_after(LOOK_EVERY)
    }

    /// Like [`Self::is_over`] for short work: looks at the clock once in a few hundred evaluations.
    #[must_use]
    pub fn is_over_after(&self, evaluations: usize) -> bool {
        if self.cut.get() {
            return true;
        }
        let left = self.left.get().saturating_sub(evaluations);
        self.left.set(left);
        if left == 0 {
            self.left.set(LOOK_EVERY);
            let cancelled = self.cancel.is_some_and(|c| c.load(Ordering::Relaxed));
            self.cut.set(cancelled || Instant::now() >= self.deadline);
        }
        self.cut.get()
    }

    /// True when some loop has met the deadline.
    #[must_use]
    pub fn was_cut(&self) -> bool {
        self.cut.get()
    }

    /// Time since the start.
    #[must_use]
    pub fn elapsed_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}
