//! Whether a bus still carries setpoints: lost cycles, frames that are not acknowledged, error frames, a lost interface.
//!
//! After a bus fault no setpoint is sent on that bus until `clear-fault` has started it over. Its
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
    /// From the settings. A bus that does not acknowledge must be reported as such before its missing feedback shows as late
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
    echoes: Echoes,
    newest_error: ErrorFrame,
    error_frames: u64,
}

/// What one cycle has seen of a link, beside [`BusState`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BusActivity {
    /// The drives were to be energised: lost setpoints matter.
    pub(crate) live: bool,
    /// Own frames that came back, since the link was opened; `None` where none do.
    pub(crate) confirmed: Option<u64>,
    /// They come back when they were on the wire ([`taustream_drivers::CanLink::confirms_from_wire`]).
    pub(crate) from_wire: bool,
    /// Frames that were lost in receiving, since the link was opened.
    pub(crate) overflowed: u64,
    /// More has arrived than this cycle took.
    pub(crate) more: bool,
    /// Whether frames of earlier cycles waited in the interface's queue; `None` when nobody asked.
    pub(crate) queued: Option<bool>,
}

/// Own frames on their way back.
///
/// Their count alone does not tell a bus that nobody acknowledges from a computer that reads too slowly: frames that
/// come back are lost where a receive queue overflows, and then the count is off for good. So frames that are
/// overdue are compared with the bus only while the interface's queue holds them, or while none comes back at all from
/// an interface that has put them on the wire itself. All others were sent, and are written off.
#[derive(Debug)]
struct Echoes {
    /// Frames passed to the link since the link was opened.
    sent: u64,
    /// Frames that will not come back any more.
    missing: u64,
    /// [`Self::sent`], and what had come back, at the end of each of the last cycles, as a ring.
    history: [(u64, u64); CYCLES_MAX],
    slot: usize,
    /// Cycles in a row in which frames were overdue.
    overdue_cycles: u32,
    /// Cycles in a row in which old frames waited in the interface's queue.
    queued_cycles: u32,
    overflowed: u64,
    /// Cycles for which the receive path still counts as behind.
    behind_cycles: usize,
}

/// What overdue frames say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Overdue {
    /// Nothing: there are none, or it is too early.
    No,
    /// Nobody acknowledges them.
    Unconfirmed,
    /// They came back, or will, but this computer reads them too slowly.
    Unread,
}

impl Echoes {
    const NONE: Self = Self {
        sent: 0,
        missing: 0,
        history: [(0, 0); CYCLES_MAX],
        slot: 0,
        overdue_cycles: 0,
        queued_cycles: 0,
        overflowed: 0,
        behind_cycles: 0,
    };

    /// Takes in one cycle, in which so many frames were handed over; frames are overdue after `depth` cycles.
    fn observe(&mut self, sent: u32, depth: usize, seen: BusActivity) -> Overdue {
        self.sent = self.sent.saturating_add(u64::from(sent));
        let confirmed = seen.confirmed.unwrap_or(self.sent);
        // Those that were written off and come back after all are late, not lost.
        self.missing = self.missing.min(self.sent.saturating_sub(confirmed));
        self.slot = (self.slot + 1) % CYCLES_MAX;
        self.history[self.slot] = (self.sent, confirmed);
        let (sent_then, confirmed_then) = self.history[(self.slot + CYCLES_MAX - depth) % CYCLES_MAX];
        let overdue = sent_then > confirmed.saturating_add(self.missing);
        self.overdue_cycles = if overdue { self.overdue_cycles.saturating_add(1) } else { 0 };
        self.queued_cycles =
            if overdue && seen.queued == Some(true) { self.queued_cycles.saturating_add(1) } else { 0 };
        let found = if overdue { self.explain(confirmed > confirmed_then, depth, seen) } else { Overdue::No };
        self.behind_cycles = self.behind_cycles.saturating_sub(1);
        if seen.more || seen.overflowed != self.overflowed || found == Overdue::Unread {
            self.behind_cycles = 2 * depth;
        }
        self.overflowed = seen.overflowed;
        found
    }

    /// Why frames are overdue. `some_came` tells that others came back meanwhile.
    fn explain(&mut self, some_came: bool, depth: usize, seen: BusActivity) -> Overdue {
        // A bus that is nearly full still holds some of the last cycle's frames when the next one begins.
        if usize::try_from(self.queued_cycles).is_ok_and(|cycles| cycles >= depth) {
            return Overdue::Unconfirmed;
        }
        if seen.more {
            // They may be among those that wait to be read.
            let long = usize::try_from(self.overdue_cycles).is_ok_and(|cycles| cycles > depth);
            return if long { Overdue::Unread } else { Overdue::No };
        }
        match (seen.from_wire, seen.queued) {
            (true, Some(_)) if !some_came => Overdue::Unconfirmed,
            // The queue is asked first, before the next cycle's frames are in it.
            (true, None | Some(true)) => Overdue::No,
            (true, Some(false)) | (false, _) => {
                self.missing = self.sent.saturating_sub(seen.confirmed.unwrap_or(self.sent));
                Overdue::Unread
            }
        }
    }

    /// Frames passed to the link that may still come back.
    fn in_flight(&self) -> u64 {
        let (sent, confirmed) = self.history[self.slot];
        sent.saturating_sub(confirmed).saturating_sub(self.missing)
    }
}

impl Health {
    /// A bus on which nothing was sent or received.
    pub(crate) fn new(settings: &Settings) -> Self {
        Self::with(Tolerance::of(settings))
    }

    fn with(tolerance: Tolerance) -> Self {
        Self {
            tolerance,
            consecutive_lost: 0,
            failed: None,
            passive: false,
            echoes: Echoes::NONE,
            newest_error: ErrorFrame::default(),
            error_frames: 0,
        }
    }

    /// Nothing may leave but torque off.
    pub(crate) fn is_silent(&self) -> bool {
        self.failed.is_some()
    }

    /// Whether frames are overdue: then [`BusActivity::queued`] is worth a system call.
    pub(crate) fn asks_for_queue(&self) -> bool {
        self.echoes.overdue_cycles > 0
    }

    /// Why, once it has failed.
    pub(crate) fn failed(&self) -> Option<BusFault> {
        self.failed
    }

    /// The link was restarted: earlier losses, unconfirmed frames and error frames do not count any more.
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

    /// Evaluates the cycle that ends, and completes its state.
    ///
    /// Real time: arithmetic only.
    pub(crate) fn evaluate(&mut self, seen: BusActivity, found: &mut BusState) {
        let complete = found.sent == found.requested;
        self.consecutive_lost = if complete { 0 } else { self.consecutive_lost.saturating_add(1) };
        let overdue = self.echoes.observe(found.sent, self.tolerance.unconfirmed_cycles, seen);
        let unread_at_length = overdue == Overdue::Unread && seen.more;
        match found.fault {
            Some(LinkFault::Gone) => self.fail(BusFault::Gone),
            Some(LinkFault::Down) => self.fail(BusFault::Down),
            Some(LinkFault::QueueFull) if self.is_lost(seen) => self.fail(BusFault::QueueFull),
            Some(LinkFault::Os(_)) if self.is_lost(seen) => self.fail(BusFault::System),
            Some(LinkFault::QueueFull | LinkFault::Os(_)) | None
                if overdue == Overdue::Unconfirmed && seen.live =>
            {
                self.fail(BusFault::Unconfirmed);
            }
            Some(LinkFault::QueueFull | LinkFault::Os(_)) | None => {}
        }
        found.consecutive_lost = self.consecutive_lost;
        found.in_flight = u32::try_from(self.echoes.in_flight()).unwrap_or(u32::MAX);
        (found.echoes_missing, found.overflowed) = (self.echoes.missing, self.echoes.overflowed);
        (found.receive_behind, found.unread) = (self.echoes.behind_cycles > 0, unread_at_length);
        found.failed = self.failed;
        found.passive = self.passive;
        (found.newest_error, found.error_frames) = (self.newest_error, self.error_frames);
    }

    /// Before drives are energised nothing depends on a cycle: drives that have no power yet do not acknowledge, and
    /// waiting for them is no fault.
    fn is_lost(&self, seen: BusActivity) -> bool {
        seen.live && self.consecutive_lost >= self.tolerance.lost_cycles
    }

    /// The first fault is the one to report, unless a later one says more: a lost interface hides behind a full queue.
    fn fail(&mut self, bus_fault: BusFault) {
        if self.failed.is_none_or(|before| severity(bus_fault) > severity(before)) {
            self.failed = Some(bus_fault);
        }
    }
}

/// How specific a fault is about its cause.
fn severity(bus_fault: BusFault) -> u8 {
    match bus_fault {
        BusFault::QueueFull
        | BusFault::Unconfirmed
        | BusFault::System
        | BusFault::ErrorPassive
        | BusFault::ReceiveBehind
        | BusFault::OtherMaster
        | BusFault::SetpointsLost => 0,
        BusFault::Down | BusFault::BusOff | BusFault::Restarted => 1,
        BusFault::Gone => 2,
    }
}
