//! The master's end of a [`VirtualBus`], as the cycle sees it.
use super::bus::{Interface, VirtualBus};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use taustream_drivers::link::{OpenError, Sent};
use taustream_drivers::{CanFrame, CanLink, FrameBatch, LinkFault};

/// A bus that the link and the world share. One thread uses it; the lock is there because a link must be `Send`.
#[derive(Clone, Debug)]
pub struct SharedBus(Arc<Mutex<VirtualBus>>);

impl SharedBus {
    /// Shares a bus.
    #[must_use]
    pub fn new(bus: VirtualBus) -> Self {
        Self(Arc::new(Mutex::new(bus)))
    }

    /// The bus.
    pub fn get(&self) -> MutexGuard<'_, VirtualBus> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A link to a virtual bus.
#[derive(Debug)]
pub struct VirtualLink {
    interface: String,
    bus: SharedBus,
}

impl VirtualLink {
    /// A link by this interface.
    #[must_use]
    pub fn new(interface: String, bus: SharedBus) -> Self {
        Self { interface, bus }
    }
}

impl CanLink for VirtualLink {
    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        self.bus.get().send(frames)
    }

    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        self.bus.get().receive(into)
    }

    fn describe(&self) -> String {
        format!("virtual bus {}", self.interface)
    }

    fn confirmed(&self) -> Option<u64> {
        Some(self.bus.get().confirmed())
    }

    fn confirms_from_wire(&self) -> bool {
        self.bus.get().has_wire()
    }

    fn overflowed(&self) -> u64 {
        self.bus.get().overflowed()
    }

    fn has_queued(&self) -> bool {
        self.bus.get().has_queued()
    }

    fn reopen(&mut self) -> Result<(), OpenError> {
        let mut bus = self.bus.get();
        let interface = self.interface.clone();
        let disturbance = bus.disturbance();
        let refused = match disturbance.interface {
            Interface::Up if disturbance.unacknowledged && bus.has_wire() => Some("error-passive"),
            Interface::Up => None,
            Interface::BusOff => Some("bus-off"),
            Interface::Down | Interface::Gone => {
                return Err(OpenError::Down { interface, command: String::new() });
            }
        };
        if let Some(state) = refused {
            return Err(OpenError::Unfit { interface, state, remedy: String::new() });
        }
        if bus.has_queued() {
            return Err(OpenError::Queued { interface, bytes: 1 });
        }
        bus.reopen();
        Ok(())
    }
}
