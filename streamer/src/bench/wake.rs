//! How late the kernel wakes a thread up: the streamer's own sleep, at its priority, without its work.
use super::{BenchError, Quantiles, WARM_UP, histogram, quantiles};
use crate::rt;
use crate::tick::Schedule;
use serde::Serialize;
use taustream_arm::settings::CycleSettings;

/// Upper ends of the bins of the histogram, us.
const BINS_US: [u64; 11] = [5, 10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000, 10_000];

/// Wake-ups between two lateness values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Bin {
    /// Later than this, us.
    pub above_us: u64,
    /// At most this late, us; none for the last bin.
    pub at_most_us: Option<u64>,
    /// How many.
    pub count: u64,
}

/// What was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WakeUps {
    /// Period, us.
    pub period_us: u32,
    /// Ran at real-time priority with locked memory.
    pub realtime: bool,
    /// Rights that were missing, with their remedies.
    pub missing: Vec<String>,
    /// How late.
    pub lateness: Quantiles,
    /// Deadlines that passed while the thread was not run at all.
    pub skipped: u64,
    /// The same as a histogram.
    pub histogram: Vec<Bin>,
}

/// Sleeps to absolute deadlines for `seconds` at the priority and on the CPU of `cycle`, as far as rights allow.
///
/// # Errors
/// When no thread can be had, or the time is none.
pub fn wake_ups(cycle: &CycleSettings, seconds: f64) -> Result<WakeUps, BenchError> {
    if !(0.01..=3_600.0).contains(&seconds) {
        return Err(BenchError::Options { seconds, slices: 1 });
    }
    let cycle = *cycle;
    let work = move || measure(&cycle, seconds);
    let thread = std::thread::Builder::new()
        .name("wake-ups".into())
        .stack_size(2 << 20)
        .spawn(work)
        .map_err(|e| BenchError::System(e.to_string()))?;
    #[expect(clippy::disallowed_methods, reason = "a measurement ends by itself, and no arm is there")]
    let measured = thread.join().map_err(|_| BenchError::System("the measurement has panicked".into()));
    measured?
}

fn measure(cycle: &CycleSettings, seconds: f64) -> Result<WakeUps, BenchError> {
    let mut missing: Vec<String> = rt::lock_memory().err().iter().map(ToString::to_string).collect();
    let entered = rt::enter(cycle.priority, cycle.cpu);
    missing.extend(entered.err().into_iter().flatten().map(|e| e.to_string()));

    let mut times = histogram()?;
    let mut counts = [0_u64; BINS_US.len() + 1];
    let mut skipped = 0;
    let period_us = cycle.period_us.max(1);
    let mut schedule = Schedule::starting_after(rt::now(), period_us);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 3.6e9")]
    let wake_ups = (seconds * 1e6 / f64::from(period_us)) as u64 + WARM_UP;
    for number in 0..wake_ups {
        rt::sleep_until(schedule.deadline());
        let tick = schedule.wake(rt::now());
        if number >= WARM_UP {
            let lateness_ns = tick.lateness_ns();
            times.saturating_record(lateness_ns);
            let bin = BINS_US.partition_point(|us| us * 1_000 < lateness_ns);
            counts.iter_mut().skip(bin).take(1).for_each(|count| *count += 1);
            skipped += tick.skipped;
        }
    }
    let edges = std::iter::once(0).chain(BINS_US);
    let ends = BINS_US.into_iter().map(Some).chain(std::iter::once(None));
    let bins = edges.zip(ends).zip(counts);
    let histogram = bins.map(|((above_us, at_most_us), count)| Bin { above_us, at_most_us, count }).collect();
    let realtime = missing.is_empty();
    Ok(WakeUps { period_us, realtime, missing, lateness: quantiles(&times), skipped, histogram })
}
