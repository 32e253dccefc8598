//! What a simulated drive keeps about the network: NMT state, heartbeats made and watched, errors reported.
//!
//! Source: CiA 301 sections 7.2.7 (EMCY), 7.2.8 (NMT and error control).
use super::objects::{CONSUMERS, HISTORY};
use super::power::register_bits;
use crate::codec::canopen::NODE_MAX;
use crate::codec::{Emcy, NmtState};
use crate::frame::CanFrame;
use crate::servo::Nanos;

/// One heartbeat that is watched (0x1016).
#[derive(Clone, Copy, Debug, Default)]
struct Consumer {
    node: u8,
    limit_s: f64,
    /// The newest heartbeat; watching begins with the first.
    newest: Option<Nanos>,
}

/// Heartbeats of others.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Consumers([Consumer; CONSUMERS as usize]);

impl Consumers {
    /// Takes over entry `slot` as written: `node << 16 | ms`; 0 for either turns it off.
    pub(crate) fn set(&mut self, slot: usize, entry: i64) {
        let Some(consumer) = self.0.get_mut(slot) else { return };
        let node = u8::try_from(entry >> 16).ok().filter(|node| (1..=NODE_MAX).contains(node));
        let limit_s = f64::from(u16::try_from(entry & 0xFFFF).unwrap_or(0)) * 1e-3;
        *consumer = Consumer { node: node.unwrap_or(0), limit_s, newest: None };
    }

    /// Notes a heartbeat.
    pub(crate) fn received(&mut self, now: Nanos, node: u8) {
        for consumer in self.0.iter_mut().filter(|consumer| consumer.node == node && consumer.limit_s > 0.0) {
            consumer.newest = Some(now);
        }
    }

    /// The node whose heartbeat has just been found missing; reported once, watched again from its next heartbeat.
    pub(crate) fn lost(&mut self, now: Nanos) -> Option<u8> {
        let late = self
            .0
            .iter_mut()
            .find(|consumer| consumer.newest.is_some_and(|newest| now.since_s(newest) > consumer.limit_s))?;
        late.newest = None;
        Some(late.node)
    }
}

/// NMT state and the heartbeat of the drive itself.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nmt {
    state: NmtState,
    /// Begin of the restart that is under way.
    boot_began: Option<Nanos>,
    beaten: Nanos,
}

impl Nmt {
    /// Restarting, from the first [`Self::boot`] on.
    pub(crate) const fn new() -> Self {
        Self { state: NmtState::BootUp, boot_began: None, beaten: Nanos(0) }
    }

    /// The state; [`NmtState::BootUp`] while restarting.
    pub(crate) const fn state(&self) -> NmtState {
        self.state
    }

    /// Changes the state on command.
    pub(crate) fn set(&mut self, state: NmtState) {
        self.state = state;
    }

    /// Continues a restart; true at the moment it ends.
    pub(crate) fn boot(&mut self, now: Nanos, duration_s: f64) -> bool {
        if self.state != NmtState::BootUp {
            return false;
        }
        let began = *self.boot_began.get_or_insert(now);
        if now.since_s(began) < duration_s {
            return false;
        }
        *self = Self { state: NmtState::PreOperational, boot_began: None, beaten: now };
        true
    }

    /// The heartbeat that is due, every `period_ms` (0x1017; 0 is none).
    pub(crate) fn heartbeat(&mut self, now: Nanos, node: u8, period_ms: i64) -> Option<CanFrame> {
        let period_s = f64::from(u16::try_from(period_ms).unwrap_or(0)) * 1e-3;
        if period_s <= 0.0 || self.state == NmtState::BootUp || now.since_s(self.beaten) < period_s {
            return None;
        }
        self.beaten = now;
        Some(self.state.encode(node))
    }
}

/// Error register (0x1001), newest code (0x603F) and history (0x1003).
#[derive(Clone, Debug, Default)]
pub(crate) struct Errors {
    register: u8,
    code: u16,
    /// Newest first.
    history: [u16; HISTORY as usize],
    count: u8,
}

impl Errors {
    /// Enters an error.
    pub(crate) fn raise(&mut self, code: u16) -> Emcy {
        self.register |= register_bits(code);
        self.code = code;
        self.history.rotate_right(1);
        if let Some(newest) = self.history.first_mut() {
            *newest = code;
        }
        self.count = (self.count + 1).min(HISTORY);
        Emcy { code, error_register: self.register, vendor: [0; 5] }
    }

    /// All errors are gone; the message that says so, unless there was none.
    pub(crate) fn reset(&mut self) -> Option<Emcy> {
        let had = self.register != 0;
        self.register = 0;
        self.code = 0;
        had.then_some(Emcy { code: 0, error_register: 0, vendor: [0; 5] })
    }

    /// Empties the history.
    pub(crate) fn clear_history(&mut self) {
        self.history = [0; HISTORY as usize];
        self.count = 0;
    }

    /// Error register.
    pub(crate) const fn register(&self) -> u8 {
        self.register
    }
    /// Newest code.
    pub(crate) const fn code(&self) -> u16 {
        self.code
    }
    /// Entries of the history.
    pub(crate) const fn count(&self) -> u8 {
        self.count
    }
    /// History entry, 1 is the newest; 0 when there is none.
    pub(crate) fn entry(&self, sub: u8) -> u16 {
        self.history.get(usize::from(sub).wrapping_sub(1)).copied().unwrap_or(0)
    }
}
