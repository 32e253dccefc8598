//! The grid of deadlines: which one a wake-up serves, and which ones it gave up.
//!
//! Deadlines are absolute multiples of the period on `CLOCK_MONOTONIC`. One that has passed is skipped and counted,
//! never made up for: two sendings closer than half a period would reach the drives as a burst. All of this is a
//! function of the wake-up time, so a recorded run replays exactly.
use taustream_drivers::Nanos;

/// One run of the cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tick {
    /// Index of the deadline on the grid; it counts skipped ones too, so differences are times in periods.
    pub number: u64,
    /// When the cycle should have begun.
    pub deadline: Nanos,
    /// When it did.
    pub wake_time: Nanos,
    /// Deadlines given up since the last run.
    pub skipped: u64,
    /// How long the run before this one took, ns; 0 in the first.
    pub last_cycle_ns: u64,
}

impl Tick {
    /// How late the wake-up was, ns.
    #[must_use]
    pub fn lateness_ns(&self) -> u64 {
        self.wake_time.0.saturating_sub(self.deadline.0)
    }
}

/// The deadlines of one run of the streamer.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    origin_ns: u64,
    period_ns: u64,
    served: u64,
    next: u64,
}

impl Schedule {
    /// A grid whose first deadline is one period after `now`. A period of zero counts as 1 us.
    #[must_use]
    pub fn starting_after(now: Nanos, period_us: u32) -> Self {
        Self { origin_ns: now.0, period_ns: u64::from(period_us.max(1)) * 1_000, served: 0, next: 1 }
    }

    /// When to wake up next.
    #[must_use]
    pub fn deadline(&self) -> Nanos {
        self.time_of(self.next)
    }

    /// The tick that a wake-up at `wake_time` serves; plans the next deadline at least half a period later.
    ///
    /// Real time: no loop, no allocation.
    pub fn wake(&mut self, wake_time: Nanos) -> Tick {
        let passed = wake_time.0.saturating_sub(self.origin_ns) / self.period_ns;
        let number = self.next.max(passed);
        let skipped = number - self.served - 1;
        self.served = number;
        self.next = number + 1;
        let spacing_ns = self.deadline().0.saturating_sub(wake_time.0);
        if spacing_ns < self.period_ns / 2 {
            self.next += 1;
        }
        Tick { number, deadline: self.time_of(number), wake_time, skipped, last_cycle_ns: 0 }
    }

    fn time_of(&self, number: u64) -> Nanos {
        Nanos(self.origin_ns + number * self.period_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    #[test]
    fn schedule_woken_on_time_serves_every_deadline() {
        let mut schedule = Schedule::starting_after(Nanos(500), 1_000);
        for number in 1..100 {
            let deadline = schedule.deadline();
            let tick = schedule.wake(Nanos(deadline.0 + 20_000));
            assert_eq!((tick.number, tick.skipped, tick.deadline), (number, 0, deadline));
            assert_eq!(tick.lateness_ns(), 20_000);
        }
    }

    #[test]
    fn schedule_woken_late_skips_and_counts_what_passed() {
        let mut schedule = Schedule::starting_after(Nanos(0), 1_000);
        schedule.wake(Nanos(PERIOD_NS));
        let tick = schedule.wake(Nanos(7 * PERIOD_NS + 100_000));
        assert_eq!((tick.number, tick.skipped), (7, 5));
        assert_eq!(schedule.deadline(), Nanos(8 * PERIOD_NS));
    }

    /// Goal: whatever the wake-ups, sendings keep half a period of distance, and every deadline is either
    /// served or counted as skipped.
    #[test]
    fn schedule_under_any_lateness_keeps_spacing_and_loses_no_deadline() {
        for seed in 0..200_u64 {
            let mut schedule = Schedule::starting_after(Nanos(1_000), 1_000);
            let (mut state, mut last_wake_time, mut accounted) = (seed * 2 + 1, 0, 0);
            for _ in 0..500 {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let late_ns = (state >> 33) % if state % 7 == 0 { 9_000_000 } else { 900_000 };
                let wake_time = Nanos(schedule.deadline().0 + late_ns);
                let tick = schedule.wake(wake_time);
                accounted += 1 + tick.skipped;
                assert_eq!(tick.number, accounted, "seed {seed}");
                assert!(
                    wake_time.0 - last_wake_time >= PERIOD_NS / 2,
                    "seed {seed}: {} ns apart",
                    wake_time.0 - last_wake_time
                );
                last_wake_time = wake_time.0;
            }
        }
    }
}
