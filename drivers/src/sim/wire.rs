//! A bus with a bit rate: one frame at a time, the lowest identifier first, and queues that overflow.
//!
//! Pure: frames and times in, frames and times out. The master's side is one queue, first in first out, as the kernel's
//! is: only its head takes part in arbitration. A drive has a mailbox for each identifier that it sends under, as drives
//! have one for each PDO. A frame for which there is no room is lost, as it is behind ENOBUFS.
//!
//! What is simple: no bit errors and no repetitions, so no error frames; every frame is acknowledged; all masters of an
//! interface share one queue, whose length does not push back (a vcan takes everything).
use super::bit_time::{arbitration, nanoseconds};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use std::collections::VecDeque;
use taustream_arm::BusKind;
use taustream_arm::bus_load::frame::BitRates;

/// Frames that a drive's mailbox holds.
const MAILBOX_FRAMES: usize = 2;
/// Drives' frames that wait on a bus, over all mailboxes: more than any arm's drives have between them.
const MAILBOXES_MAX: usize = 256;
/// The load is also given for the fullest such stretch of time.
const WINDOW_NS: u64 = 100_000_000;

/// Who sends a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// The streamer, or any other process on the interface.
    Master,
    /// A simulated drive.
    Drive,
}

/// A frame that has left the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delivered {
    /// When its last bit, and the pause behind it, had passed.
    pub at: Nanos,
    /// Who sent it.
    pub sender: Sender,
    /// The frame.
    pub frame: CanFrame,
}

/// What a wire has seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounters {
    /// Frames delivered.
    pub delivered: u64,
    /// Frames lost because their queue was full, the master's.
    pub lost_from_master: u64,
    /// Frames lost because their mailbox was full, the drives'.
    pub lost_from_drives: u64,
    /// Time in which bits passed, ns.
    pub busy_ns: u64,
    /// The same in the fullest `WINDOW_NS` that has ended.
    pub fullest_window_ns: u64,
    /// Most frames that waited on the master's side.
    pub longest_queue: usize,
    /// Longest time from hand-over to delivery, ns.
    pub longest_wait_ns: u64,
}

/// A frame that waits.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    since: Nanos,
    frame: CanFrame,
}

/// A frame on the wire.
#[derive(Clone, Copy, Debug)]
struct Passing {
    ends: Nanos,
    since: Nanos,
    sender: Sender,
    frame: CanFrame,
}

/// One bus in time.
#[derive(Clone, Debug)]
pub struct Wire {
    rates: BitRates,
    queue_max: usize,
    master: VecDeque<Waiting>,
    drives: Vec<Waiting>,
    passing: Option<Passing>,
    free_at: Nanos,
    window: (Nanos, u64),
    began: Option<Nanos>,
    counters: WireCounters,
}

impl Wire {
    /// The wire of a bus, whose master side holds `queue_max` frames; none for a virtual bus.
    #[must_use]
    pub fn new(kind: BusKind, queue_max: usize) -> Option<Self> {
        let nominal_bit_s = kind.bitrate_bit_s()?;
        let data_bit_s = kind.data_bitrate_bit_s().unwrap_or(nominal_bit_s);
        Some(Self {
            rates: BitRates { nominal_bit_s, data_bit_s },
            queue_max,
            master: VecDeque::new(),
            drives: Vec::new(),
            passing: None,
            free_at: Nanos(0),
            window: (Nanos(0), 0),
            began: None,
            counters: WireCounters::default(),
        })
    }

    /// What it has seen so far.
    #[must_use]
    pub fn counters(&self) -> WireCounters {
        self.counters
    }

    /// Frames that wait now: on the master's side, and in the drives' mailboxes.
    #[must_use]
    pub fn waiting(&self) -> (usize, usize) {
        (self.master.len(), self.drives.len())
    }

    /// Share of the time since the first frame in which bits passed, in percent; and in the fullest tenth of a second.
    #[must_use]
    pub fn load_percent(&self, now: Nanos) -> (f64, f64) {
        let began = self.began.unwrap_or(now);
        #[expect(clippy::cast_precision_loss, reason = "2^53 ns are 104 days")]
        let share = |part: u64, whole: u64| 100.0 * part as f64 / whole.max(1) as f64;
        let all = share(self.counters.busy_ns, now.0.saturating_sub(began.0));
        (all, share(self.counters.fullest_window_ns, WINDOW_NS))
    }

    /// What it has seen, as one line of `key=value`.
    #[must_use]
    pub fn in_words(&self, bus: &str, now: Nanos) -> String {
        let (load, fullest) = self.load_percent(now);
        let WireCounters { delivered, lost_from_master, lost_from_drives, longest_queue, .. } = self.counters;
        let longest_wait_us = self.counters.longest_wait_ns / 1000;
        format!(
            "bus {bus:?} load_percent={load:.1} fullest_100ms_percent={fullest:.1} delivered={delivered} \
             lost_from_master={lost_from_master} lost_from_drives={lost_from_drives} longest_queue={longest_queue} \
             longest_wait_us={longest_wait_us}"
        )
    }

    /// Takes a frame that a node wants sent at `now`, which never goes back. False when its queue is full.
    pub fn offer(&mut self, now: Nanos, sender: Sender, frame: CanFrame) -> bool {
        let waiting = Waiting { since: now, frame };
        match sender {
            Sender::Master if self.master.len() < self.queue_max => {
                self.master.push_back(waiting);
                self.counters.longest_queue = self.counters.longest_queue.max(self.master.len());
                true
            }
            Sender::Master => {
                self.counters.lost_from_master += 1;
                false
            }
            Sender::Drive => {
                let same = self.drives.iter().filter(|other| other.frame.id() == frame.id()).count();
                let fits = same < MAILBOX_FRAMES && self.drives.len() < MAILBOXES_MAX;
                if fits {
                    self.drives.push(waiting);
                } else {
                    self.counters.lost_from_drives += 1;
                }
                fits
            }
        }
    }

    /// The next frame whose end comes by `until`; call again until there is none. Its receivers may offer its answer
    /// at the time of its end before the next call.
    pub fn next_by(&mut self, until: Nanos) -> Option<Delivered> {
        self.begin(until);
        let passing = self.passing.take_if(|passing| passing.ends <= until)?;
        self.free_at = passing.ends;
        self.counters.delivered += 1;
        let waited_ns = passing.ends.0.saturating_sub(passing.since.0);
        self.counters.longest_wait_ns = self.counters.longest_wait_ns.max(waited_ns);
        Some(Delivered { at: passing.ends, sender: passing.sender, frame: passing.frame })
    }

    /// When the frame on the wire ends, or the next one could.
    #[must_use]
    pub fn next_due(&self) -> Option<Nanos> {
        let passing = self.passing.map(|passing| passing.ends);
        passing.or_else(|| (!self.master.is_empty() || !self.drives.is_empty()).then_some(self.free_at))
    }

    /// Arbitration, when the wire is free by `until` and a frame waits.
    fn begin(&mut self, until: Nanos) {
        if self.passing.is_some() {
            return;
        }
        let heads = self.master.front().into_iter().chain(&self.drives);
        let Some(first) = heads.map(|waiting| waiting.since).min() else { return };
        let start = self.free_at.max(first);
        if start > until {
            return;
        }
        let key = |waiting: &Waiting| arbitration(&waiting.frame);
        let master = self.master.front().filter(|head| head.since <= start).map(key);
        let mailboxes = self.drives.iter().enumerate().filter(|(_, waiting)| waiting.since <= start);
        // The earlier of two equal ones: a mailbox keeps its order.
        let drive = mailboxes.map(|(at, waiting)| (key(waiting), at)).min();
        let (sender, next) = match (master, drive) {
            (Some(master), Some((drive, _))) if master <= drive => (Sender::Master, self.master.pop_front()),
            (_, Some((_, at))) => (Sender::Drive, Some(self.drives.remove(at))),
            (_, None) => (Sender::Master, self.master.pop_front()),
        };
        let Some(Waiting { since, frame }) = next else { return };
        let takes_ns = nanoseconds(&frame, self.rates);
        self.count(start, takes_ns);
        self.passing = Some(Passing { ends: Nanos(start.0 + takes_ns), since, sender, frame });
    }

    fn count(&mut self, start: Nanos, takes_ns: u64) {
        self.began.get_or_insert(start);
        self.counters.busy_ns += takes_ns;
        let (opened, busy_ns) = &mut self.window;
        if start.0.saturating_sub(opened.0) >= WINDOW_NS {
            self.counters.fullest_window_ns = self.counters.fullest_window_ns.max(*busy_ns);
            (*opened, *busy_ns) = (start, 0);
        }
        *busy_ns += takes_ns;
    }
}
