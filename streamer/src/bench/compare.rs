//! Several arms side by side in one run: what one settings file's cycle costs beside another's.
//!
//! Each round gives every arm a slice, so that all meet the same machine. An arm's links are opened for its slice and
//! closed behind it: two arms may name the same interface, and no socket of one receives the frames of the other.
use super::{
    Bench, BenchError, BenchOptions, Quantiles, Times, WARM_UP, on_the_real_time_thread, quantiles, ratio,
};
use serde::Serialize;
use taustream_arm::Settings;

/// One arm's share of a comparison.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// The arm's name.
    pub arm: String,
    /// What carried the frames.
    pub link: String,
    /// Its buses.
    pub buses: usize,
    /// Its joints.
    pub joints: usize,
    /// Period, us.
    pub period_us: u32,
    /// Ran at real-time priority with locked memory.
    pub realtime: bool,
    /// Time of the whole cycle.
    pub cycle: Quantiles,
    /// Time of the same system calls in a bare loop.
    pub bare: Quantiles,
    /// Median cycle time over that of the first arm.
    pub p50_ratio: f64,
    /// 99 % cycle time over that of the first arm.
    pub p99_ratio: f64,
}

/// Measures the cycle of `options.settings` and of the arms `beside` it alternately. `options.seconds` is the time of each.
///
/// # Errors
/// As for [`super::cycle`].
pub fn compare(options: &BenchOptions, beside: &[Settings]) -> Result<Vec<Compared>, BenchError> {
    let (seconds, slices) = (options.seconds, options.slices);
    if !(0.1..=3_600.0).contains(&seconds) || !(2..=10_000).contains(&slices) {
        return Err(BenchError::Options { seconds, slices });
    }
    let arm = |settings: &Settings| BenchOptions { settings: settings.clone(), ..options.clone() };
    let arms: Vec<BenchOptions> = [&options.settings].into_iter().chain(beside).map(arm).collect();
    let cycle = options.settings.cycle;
    on_the_real_time_thread(cycle, options.allow_non_realtime, move |realtime| {
        alternate(&arms, slices, realtime)
    })
}

fn alternate(arms: &[BenchOptions], slices: u32, realtime: bool) -> Result<Vec<Compared>, BenchError> {
    let mut links = vec![String::new(); arms.len()];
    let times: Result<Vec<_>, BenchError> = arms.iter().map(|_| Ok((Times::new()?, Times::new()?))).collect();
    let mut times = times?;
    for _ in 0..slices {
        for ((arm, link), (streamer, bare)) in arms.iter().zip(&mut links).zip(&mut times) {
            let period_us = arm.settings.cycle.period_us.max(1);
            let slice_s = arm.seconds / f64::from(2 * slices);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 3.6e9")]
            let cycles = (slice_s * 1e6 / f64::from(period_us)) as u64 + WARM_UP;
            let mut bench = Bench::prepare(arm)?;
            bench.bare_slice(period_us, cycles, bare);
            bench.streamer_slice(period_us, cycles, streamer);
            link.clone_from(&bench.link);
            bench.peers.close();
        }
    }
    let first = times.first().map(|(streamer, _)| quantiles(&streamer.cycle));
    let rows = arms.iter().zip(links).zip(&times).map(|((arm, link), (streamer, bare))| {
        let cycle = quantiles(&streamer.cycle);
        let first = first.unwrap_or(cycle);
        Compared {
            arm: arm.settings.name.clone(),
            link,
            buses: arm.settings.buses.len(),
            joints: arm.settings.robot.joints.len(),
            period_us: arm.settings.cycle.period_us,
            realtime,
            cycle,
            bare: quantiles(&bare.cycle),
            p50_ratio: ratio(cycle.p50_ns, first.p50_ns),
            p99_ratio: ratio(cycle.p99_ns, first.p99_ns),
        }
    });
    Ok(rows.collect())
}
