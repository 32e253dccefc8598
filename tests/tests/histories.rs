//! Random histories of an arm, many and small: random limits and strokes, cuts at random moments, pauses, overrides, stops, stalls, faults,
//! late and hostile messages. What has reached the drives is checked at the time at which it was sent, by differences that know
//! nothing of strokes (`checks`).
//!
//! `TAUSTREAM_HISTORIES=100000` runs more of them, `TAUSTREAM_HISTORIES_FROM=50000` begins at that seed, and
//! `TAUSTREAM_HISTORY=17` runs one again.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::float_cmp,
    clippy::cast_precision_loss,
    unreachable_pub,
    reason = "helpers of tests fail by panicking; setpoints are compared bit by bit; counts are small"
)]
#[path = "histories/checks.rs"]
mod checks;
#[path = "histories/corrupted.rs"]
mod corrupted;
#[path = "../../streamer/tests/harness/mod.rs"]
#[expect(dead_code, reason = "shared with the tests of the streamer, which use more of it")]
mod harness;
#[path = "histories/log.rs"]
mod log;
#[path = "histories/story.rs"]
mod story;

use checks::violations;
use log::Log;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// Histories of an ordinary run; `TAUSTREAM_HISTORIES` replaces it. Each takes some 7 ms of a processor.
const HISTORIES: u64 = 12_000;
/// How many histories after each other are reported: a long run may be ended before the others are done.
const REPORTED: u64 = 5_000;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a whole number"))
}

/// What happened in many histories, so that it can be seen that they are about something.
#[derive(Debug, Default)]
struct Totals {
    setpoints: AtomicU64,
    motions: AtomicU64,
    takeovers: AtomicU64,
    refused: AtomicU64,
    stalls: AtomicU64,
    faults: AtomicU64,
}

impl Totals {
    fn note(&self, log: &Log) {
        let add = |total: &AtomicU64, count: usize| {
            total.fetch_add(count as u64, Ordering::Relaxed);
        };
        add(&self.setpoints, log.cycles.len());
        add(&self.motions, log.motions.iter().filter(|motion| motion.cut_s.is_none()).count());
        add(&self.takeovers, log.takeovers());
        add(&self.refused, log.refused);
        add(&self.stalls, log.stalls);
        add(&self.faults, usize::from(log.faulted));
    }
}

fn history(seed: u64) -> Result<Log, String> {
    let again =
        format!("again: TAUSTREAM_HISTORY={seed} cargo test --workspace --test histories one_history");
    let ended = catch_unwind(AssertUnwindSafe(|| story::tell(seed)));
    let log = ended.map_err(|_| format!("seed {seed}: a panic; {again}"))?;
    match violations(&log).first() {
        None => Ok(log),
        Some(first) => Err(format!("seed {seed}: {first}; {again}\n{}", log.story.join("\n"))),
    }
}

#[test]
fn histories_keep_every_rule() {
    let count = number("TAUSTREAM_HISTORIES").unwrap_or(HISTORIES);
    let first = number("TAUSTREAM_HISTORIES_FROM").unwrap_or(0);
    let (next, done, totals) = (AtomicU64::new(first), AtomicU64::new(0), Totals::default());
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let failures: Vec<String> = thread::scope(|scope| {
        let work = || {
            let mut failures = Vec::new();
            loop {
                let seed = next.fetch_add(1, Ordering::Relaxed);
                if seed >= first + count {
                    return failures;
                }
                match history(seed) {
                    Ok(log) => totals.note(&log),
                    Err(why) => {
                        println!("history {seed} fails: {}", why.lines().next().unwrap_or_default());
                        failures.push(why);
                    }
                }
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if done.is_multiple_of(REPORTED) {
                    println!("{done} of {count} histories have run, up to seed {seed}");
                }
            }
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    println!("{count} histories: {totals:?}");
    assert!(
        failures.is_empty(),
        "{} of {count} fail\n{}",
        failures.len(),
        failures[..failures.len().min(3)].join("\n")
    );
    let seen = [&totals.motions, &totals.takeovers, &totals.refused, &totals.stalls, &totals.faults];
    assert!(count < 500 || seen.iter().all(|total| total.load(Ordering::Relaxed) > count / 10), "{totals:?}");
}

/// The history of the environment; without one, the first.
#[test]
fn one_history() {
    let log = history(number("TAUSTREAM_HISTORY").unwrap_or(0)).unwrap_or_else(|why| panic!("{why}"));
    println!("{}", log.story.join("\n"));
}
