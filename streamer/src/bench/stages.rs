//! The time of every stage of the cycle, beside the same two system calls in a bare loop.
//!
//! Stages are timed in slices of their own: the clock reads in between cost time themselves, so they must not stand in
//! the cycle's own figures. What one read costs is measured too.
use super::{BenchError, Quantiles, WARM_UP, histogram, quantiles};
use crate::cycle::{Probe, Stage};
use crate::rt;
use hdrhistogram::Histogram;
use serde::Serialize;
use taustream_drivers::Nanos;

/// One stage's share of the cycle.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StageTime {
    /// Its word.
    pub stage: &'static str,
    /// Its times, a clock read included.
    pub time: Quantiles,
    /// Its part of the time of all stages, percent.
    pub share_percent: f64,
    /// Times of the same system calls in a bare loop, a clock read included; none for stages without system calls.
    pub bare: Option<Quantiles>,
}

/// Times every stage by a clock read after it.
pub(super) struct StageClock {
    last: Nanos,
    warm_up: u64,
    clock_read: Histogram<u64>,
    stages: Vec<Histogram<u64>>,
    bare_send: Histogram<u64>,
    bare_receive: Histogram<u64>,
}

impl StageClock {
    pub(super) fn new() -> Result<Self, BenchError> {
        let stages: Result<Vec<_>, _> = Stage::ALL.iter().map(|_| histogram()).collect();
        Ok(Self {
            last: Nanos(0),
            warm_up: WARM_UP,
            clock_read: histogram()?,
            stages: stages?,
            bare_send: histogram()?,
            bare_receive: histogram()?,
        })
    }

    /// A slice begins: its first cycles do not count.
    pub(super) fn begin_slice(&mut self) {
        self.warm_up = WARM_UP;
    }

    /// A cycle begins: the time of one clock read, then the start of the first stage.
    pub(super) fn begin_cycle(&mut self) {
        self.warm_up = self.warm_up.saturating_sub(1);
        let before = rt::now();
        self.last = rt::now();
        if self.warm_up == 0 {
            self.clock_read.saturating_record(self.last.0.saturating_sub(before.0));
        }
    }

    /// The bare loop's send has ended.
    pub(super) fn sent(&mut self) {
        let ns = self.lap_ns();
        if self.warm_up == 0 {
            self.bare_send.saturating_record(ns);
        }
    }

    /// The bare loop's receive has ended.
    pub(super) fn received(&mut self) {
        let ns = self.lap_ns();
        if self.warm_up == 0 {
            self.bare_receive.saturating_record(ns);
        }
    }

    /// What one clock read takes.
    pub(super) fn clock_read(&self) -> Quantiles {
        quantiles(&self.clock_read)
    }

    /// Every stage in the cycle's order.
    pub(super) fn times(&self) -> Vec<StageTime> {
        // Some time always passes, but a whole of nothing must not make a share that is no number.
        let whole_ns = self.stages.iter().map(total_ns).sum::<f64>().max(1.0);
        let line = |(stage, times): (&Stage, &Histogram<u64>)| StageTime {
            stage: stage.word(),
            time: quantiles(times),
            share_percent: 100.0 * total_ns(times) / whole_ns,
            bare: match stage {
                Stage::Send => Some(quantiles(&self.bare_send)),
                Stage::Receive => Some(quantiles(&self.bare_receive)),
                Stage::Subscribe
                | Stage::Splice
                | Stage::Sample
                | Stage::Guard
                | Stage::Axes
                | Stage::FeedForward
                | Stage::Encode
                | Stage::Supervise
                | Stage::Report => None,
            },
        };
        Stage::ALL.iter().zip(&self.stages).map(line).collect()
    }

    fn lap_ns(&mut self) -> u64 {
        let now = rt::now();
        let ns = now.0.saturating_sub(self.last.0);
        self.last = now;
        ns
    }
}

impl Probe for StageClock {
    fn ended(&mut self, stage: Stage) {
        let ns = self.lap_ns();
        let index = Stage::ALL.iter().position(|s| *s == stage);
        if let Some(times) = index.and_then(|i| self.stages.get_mut(i)).filter(|_| self.warm_up == 0) {
            times.saturating_record(ns);
        }
    }
}

/// Time of all cycles together, ns.
#[expect(clippy::cast_precision_loss, reason = "cycles of an hour are far below 2^53")]
fn total_ns(times: &Histogram<u64>) -> f64 {
    times.mean() * times.len() as f64
}
