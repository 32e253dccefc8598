//! Whether a bus still carries setpoints: lost cycles, frames that nobody acknowledges, error frames, a lost interface.
//!
//! A bus that has failed is *silent* from then on: no setpoint leaves on it until `clear-fault` has started it over. Its
//! drives have stopped where their own watchdogs left them while the other buses went on along the path, so the first
//! setpoint after an outage would be a step, and whatever still waits in a queue is old. Only torque off is still tried.
use crate::cycle_state::BusState;
use taustream_arm::Settings;
use taustream_drivers::{ErrorFrame, LinkFault};
use taustream_messages::BusFault;

/// Longest history of what was sent, in cycles: a longer wait for confirmations is cut to it.
const CYCLES_MAX: usize = 64;

/// What a bus is forgiven.
#[derive(Clone, Copy, Debug)]
struct Tolerance {
    /// Cycles in a row of which frames were lost.
    lost_cycles: u32,
    /// Cycles that a frame may take until it is seen on the wire.
    unconfirmed_cycles: usize,
}

impl Tolerance {
    /// From the settings. A bus that does not acknowledge must be told as such before its silence shows as late
    /// feedback, and one that is late by less than feedback may be is none: so half of that.
    fn of(settings: &Settings) -> Self {
        let (cycle, rules) = (&settings.cycle, &settings.supervision);
        let cycles = rules.feedback_age_s_max * 0.5e6 / f64::from(cycle.period_us.max(1));
        let most = CYCLES_MAX - 1;
        let unconfirmed = (1..most).find(|n| u32::try_from(*n).is_ok_and(|n| f64::from(n) >= cycles));
        let lost_cycles = settings.lost_cycles_max().max(1);
        let least = usize::try_from(lost_cycles).unwrap_or(most);
        Self { lost_cycles, unconfirmed_cycles: unconfirmed.unwrap_or(most).max(least).min(most) }
    }
}

/// What is remembered of one bus.
#[derive(Debug)]
pub(crate) struct Health {
    tolerance: Tolerance,
    consecutive_lost: u32,
    failed: Option<BusFault>,
    passive: bool,
    /// Frames handed over since the link was opened.
    sent: u64,
    /// The same at the end of each of the last cycles, as a ring.
    history: [u64; CYCLES_MAX],
    slot: usize,
    newest_error: ErrorFrame,
    error_frames: u64,
}

/// What one cycle has seen of a link, beside [`BusState`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BusActivity {
    /// The drives were wished energised: lost setpoints matter.
    pub(crate) live: bool,
    /// Own frames that came back, since the link was opened; `None` where none do.
    pub(crate) confirmed: Option<u64>,
}

impl Health {
    /// A bus of which nothing was sent or heard.
    pub(crate) fn new(settings: &Settings) -> Self {
        Self::with(Tolerance::of(settings))
    }

    fn with(tolerance: Tolerance) -> Self {
        Self {
            tolerance,
            consecutive_lost: 0,
            failed: None,
            passive: false,
            sent: 0,
            history: [0; CYCLES_MAX],
            slot: 0,
            newest_error: ErrorFrame::default(),
            error_frames: 0,
        }
    }

    /// Nothing may leave but torque off.
    pub(crate) fn is_silent(&self) -> bool {
        self.failed.is_some()
    }

    /// Why, once it has failed.
    pub(crate) fn failed(&self) -> Option<BusFault> {
        self.failed
    }

    /// The link was started over: what was lost, unconfirmed or told by its controller is history.
    pub(crate) fn start_over(&mut self) {
        let fresh = Self::with(self.tolerance);
        *self = Self { newest_error: self.newest_error, error_frames: self.error_frames, ..fresh };
    }

    /// Takes an error frame.
    ///
    /// Real time: arithmetic only.
    pub(crate) fn take_error(&mut self, error: ErrorFrame, found: &mut BusState) {
        self.newest_error = error;
        self.error_frames = self.error_frames.saturating_add(1);
        found.errors += 1;
        if error.is_bus_off() {
            self.fail(BusFault::BusOff);
        } else if error.is_restarted() {
            self.fail(BusFault::Restarted);
        } else if error.is_passive() {
            self.passive = true;
        } else if error.is_recovered() {
            self.passive = false;
        }
    }

    /// Judges the cycle that ends, and completes its facts.
    ///
    /// Real time: arithmetic only.
    pub(crate) fn evaluate(&mut self, seen: BusActivity, found: &mut BusState) {
        self.sent = self.sent.saturating_add(u64::from(found.sent));
        let confirmed = seen.confirmed.unwrap_or(self.sent);
        let complete = found.sent == found.requested;
        self.consecutive_lost = if complete { 0 } else { self.consecutive_lost.saturating_add(1) };
        // What was sent so many cycles ago and is not confirmed now is as good as lost.
        let depth = self.tolerance.unconfirmed_cycles;
        self.slot = (self.slot + 1) % CYCLES_MAX;
        self.history[self.slot] = self.sent;
        let overdue = self.history[(self.slot + CYCLES_MAX - depth) % CYCLES_MAX] > confirmed;
        match found.fault {
            Some(LinkFault::Gone) => self.fail(BusFault::Gone),
            Some(LinkFault::Down) => self.fail(BusFault::Down),
            Some(LinkFault::QueueFull) if self.is_lost(seen) => self.fail(BusFault::QueueFull),
            Some(LinkFault::Os(_)) if self.is_lost(seen) => self.fail(BusFault::System),
            Some(LinkFault::QueueFull | LinkFault::Os(_)) | None if overdue && seen.live => {
                self.fail(BusFault::Unconfirmed);
            }
            Some(LinkFault::QueueFull | LinkFault::Os(_)) | None => {}
        }
        found.consecutive_lost = self.consecutive_lost;
        found.in_flight = u32::try_from(self.sent.saturating_sub(confirmed)).unwrap_or(u32::MAX);
        found.failed = self.failed;
        found.passive = self.passive;
        (found.newest_error, found.error_frames) = (self.newest_error, self.error_frames);
    }

    /// Before drives are energised nothing depends on a cycle: drives that have no power yet do not acknowledge, and
    /// waiting for them is no fault.
    fn is_lost(&self, seen: BusActivity) -> bool {
        seen.live && self.consecutive_lost >= self.tolerance.lost_cycles
    }

    /// The first trouble is the one to report, unless a later one says more: a lost interface hides behind a full queue.
    fn fail(&mut self, bus_fault: BusFault) {
        if self.failed.is_none_or(|before| severity(bus_fault) > severity(before)) {
            self.failed = Some(bus_fault);
        }
    }
}

/// How much a trouble tells of its cause.
fn severity(bus_fault: BusFault) -> u8 {
    match bus_fault {
        BusFault::QueueFull | BusFault::Unconfirmed | BusFault::System | BusFault::ErrorPassive => 0,
        BusFault::Down | BusFault::BusOff | BusFault::Restarted => 1,
        BusFault::Gone => 2,
    }
}
