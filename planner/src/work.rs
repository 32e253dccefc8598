//! How much work a plan may take: the clock that aborts, and the evaluations that are granted.
//!
//! Stages are granted evaluations, which are the same on every machine; the clock only aborts. So one seed gives
//! one answer wherever the clock did not cut in, and [`Work::was_cut`] tells whether it did.
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Questions between two looks at the clock: a look costs tens of microseconds on a virtual machine.
const LOOK_EVERY: u32 = 16;

/// The deadline of one plan, and its cancellation.
#[derive(Debug)]
pub struct Work<'a> {
    started: Instant,
    deadline: Instant,
    cancel: Option<&'a AtomicBool>,
    asked: Cell<u32>,
    cut: Cell<bool>,
}

impl<'a> Work<'a> {
    /// Starts the clock.
    #[must_use]
    pub fn until(deadline: Duration, cancel: Option<&'a AtomicBool>) -> Self {
        let started = Instant::now();
        // A deadline beyond the clock's range is none: a century serves.
        let deadline = started.checked_add(deadline).unwrap_or(started + Duration::from_secs(3_153_600_000));
        Self { started, deadline, cancel, asked: Cell::new(0), cut: Cell::new(false) }
    }

    /// Without a deadline that anybody lives to see.
    #[must_use]
    pub fn unbounded() -> Self {
        Self::until(Duration::MAX, None)
    }

    /// True from the deadline on, or when cancelled. Every loop of planning asks.
    #[must_use]
    pub fn is_over(&self) -> bool {
        if self.cut.get() {
            return true;
        }
        let asked = self.asked.get().wrapping_add(1);
        self.asked.set(asked);
        if asked % LOOK_EVERY == 1 {
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
