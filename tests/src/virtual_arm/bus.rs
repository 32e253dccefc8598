//! One CAN bus in virtual time: the interface's queue, the wire, the receive queue of the master, and what goes wrong with
//! them.
//!
//! A bus with a bit rate carries one frame at a time (`taustream_drivers::sim::Wire`); a virtual one delivers at once, as a
//! vcan does. Like SocketCAN, a batch is taken frame by frame until the queue is full, own frames come back when they were on
//! the wire, and a bus-off or a downed interface drops what is queued. Frames that nobody acknowledges stay in the queue and
//! leave late, when the bus is whole again: stale setpoints, as on a real bus.
use std::collections::VecDeque;
use taustream_arm::BusKind;
use taustream_drivers::link::Sent;
use taustream_drivers::sim::Wire;
use taustream_drivers::sim::wire::{Delivered, Sender};
use taustream_drivers::{CanFrame, CanId, FrameBatch, LinkFault, Nanos};

/// Frames and echoes that wait to be read; more overflow, as in a socket's receive buffer.
const INCOMING_MAX: usize = 512;
/// Most arrivals that one read takes.
const READ_MAX: usize = taustream_drivers::frame::BATCH_MAX;
/// Flag of an error frame.
const ERROR_FLAG: u32 = 0x2000_0000;
/// Error class of a controller's state, and its states in byte 1.
const CONTROLLER: (u32, u8, u8) = (0x004, 0x20, 0x40);
/// Error classes of a controller that has left the bus, and of one that is back.
const BUS_OFF: u32 = 0x040;
const RESTARTED: u32 = 0x100;

/// Whether the interface can carry frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interface {
    /// It can.
    #[default]
    Up,
    /// It is down.
    Down,
    /// It does not exist.
    Gone,
    /// Its controller has left the bus.
    BusOff,
}

/// What a bus does wrong at the moment.
#[derive(Clone, Copy, Debug, Default)]
pub struct BusDisturbance {
    /// Whether frames can be carried at all.
    pub interface: Interface,
    /// No node acknowledges: frames stay in the queue.
    pub unacknowledged: bool,
    /// Most frames that are taken of a batch.
    pub takes_max: Option<usize>,
    /// Own frames come back so much later.
    pub echo_delay_ns: u64,
    /// So many of the next echoes are lost.
    pub echoes_lost: u64,
    /// So many of the next arrivals find the receive queue full.
    pub arrivals_lost: u64,
}

/// Something that waits to be read.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    at: Nanos,
    /// None: an own frame that was on the wire.
    frame: Option<CanFrame>,
}

/// A frame that has left the wire, and the cycle in which the master handed it over.
#[derive(Clone, Copy, Debug)]
pub struct OnWire {
    /// The frame, its time and who sent it.
    pub delivered: Delivered,
    /// Cycle of a master's frame.
    pub tick: u64,
}

/// One bus.
#[derive(Debug)]
pub struct VirtualBus {
    kind: BusKind,
    queue_max: usize,
    wire: Option<Wire>,
    /// What the master handed over and is not on the wire yet, with its cycle.
    queued: VecDeque<(u64, CanFrame)>,
    incoming: VecDeque<Arrival>,
    disturbance: BusDisturbance,
    now: Nanos,
    tick: u64,
    confirmed: u64,
    overflowed: u64,
}

impl VirtualBus {
    /// A bus whose interface queues `queue_max` frames.
    #[must_use]
    pub fn new(kind: BusKind, queue_max: usize) -> Self {
        Self {
            kind,
            queue_max,
            wire: Wire::new(kind, queue_max),
            queued: VecDeque::new(),
            incoming: VecDeque::new(),
            disturbance: BusDisturbance::default(),
            now: Nanos(0),
            tick: 0,
            confirmed: 0,
            overflowed: 0,
        }
    }

    /// What it does wrong now.
    #[must_use]
    pub fn disturbance(&self) -> BusDisturbance {
        self.disturbance
    }

    /// A cycle begins that sends and receives at this instant.
    pub fn begin_cycle(&mut self, now: Nanos, tick: u64) {
        (self.now, self.tick) = (now, tick);
    }

    /// Changes what goes wrong, from `now` on.
    pub fn disturb(&mut self, now: Nanos, change: impl FnOnce(&mut BusDisturbance)) {
        let before = self.disturbance;
        change(&mut self.disturbance);
        let after = self.disturbance;
        if before.interface != after.interface {
            self.queued.clear();
            self.wire = Wire::new(self.kind, self.queue_max);
        }
        match (before.interface, after.interface) {
            (Interface::Up, Interface::BusOff) => self.push_error(now, BUS_OFF, 0),
            (Interface::BusOff, Interface::Up) => self.push_error(now, RESTARTED, 0),
            _ => {}
        }
        let (class, passive, active) = CONTROLLER;
        match (before.unacknowledged, after.unacknowledged) {
            (false, true) => self.push_error(now, class, passive),
            (true, false) => {
                self.push_error(now, class, active);
                self.resend(now);
            }
            _ => {}
        }
    }

    /// What waited for an acknowledgement leaves from now on.
    fn resend(&mut self, now: Nanos) {
        self.wire = Wire::new(self.kind, self.queue_max);
        if let Some(wire) = &mut self.wire {
            for (_, frame) in &self.queued {
                wire.offer(now, Sender::Master, *frame);
            }
        }
    }

    fn push_error(&mut self, at: Nanos, class: u32, state: u8) {
        let id = CanId::from_raw(ERROR_FLAG | class);
        self.arrive(at, Some(CanFrame::classic(id, &[0, state, 0, 0, 0, 0, 0, 0])));
    }

    /// The master hands a batch over: frame by frame, until the queue is full.
    pub fn send(&mut self, frames: &[CanFrame]) -> Sent {
        let fault = match self.disturbance.interface {
            Interface::Up => None,
            Interface::Down => Some(LinkFault::Down),
            Interface::Gone => Some(LinkFault::Gone),
            Interface::BusOff => Some(LinkFault::QueueFull),
        };
        if fault.is_some() {
            return Sent { count: 0, fault };
        }
        let most = self.disturbance.takes_max.unwrap_or(frames.len());
        let taken = frames.iter().take(most).take_while(|frame| self.take(**frame)).count();
        let fault = (taken < frames.len()).then_some(LinkFault::QueueFull);
        Sent { count: taken, fault }
    }

    fn take(&mut self, frame: CanFrame) -> bool {
        if self.queued.len() >= self.queue_max {
            return false;
        }
        let taken = self.wire.as_mut().is_none_or(|wire| wire.offer(self.now, Sender::Master, frame));
        if taken {
            self.queued.push_back((self.tick, frame));
        }
        if taken && self.wire.is_none() {
            // An interface without a wire hands own frames back as it takes them.
            self.echo(self.now);
        }
        taken
    }

    fn echo(&mut self, at: Nanos) {
        if self.disturbance.echoes_lost > 0 {
            self.disturbance.echoes_lost -= 1;
        } else {
            self.arrive(Nanos(at.0 + self.disturbance.echo_delay_ns), None);
        }
    }

    /// A drive, or another node, wants a frame sent.
    pub fn offer(&mut self, now: Nanos, frame: CanFrame) {
        let whole = self.disturbance.interface == Interface::Up && !self.disturbance.unacknowledged;
        match &mut self.wire {
            Some(wire) if whole => {
                wire.offer(now, Sender::Drive, frame);
            }
            None if whole => self.arrive(now, Some(frame)),
            Some(_) | None => {}
        }
    }

    /// The next frame that has left the wire by `until`. A drive's frame has arrived then; a master's is still to be handed
    /// to the drives.
    pub fn next_by(&mut self, until: Nanos) -> Option<OnWire> {
        if self.disturbance.unacknowledged || self.disturbance.interface != Interface::Up {
            return None;
        }
        let delivered = if let Some(wire) = &mut self.wire {
            wire.next_by(until)?
        } else {
            let (_, frame) = *self.queued.front()?;
            Delivered { at: until, sender: Sender::Master, frame }
        };
        let tick = match delivered.sender {
            Sender::Drive => {
                self.arrive(delivered.at, Some(delivered.frame));
                self.tick
            }
            Sender::Master => {
                if self.wire.is_some() {
                    self.echo(delivered.at);
                }
                self.queued.pop_front()?.0
            }
        };
        Some(OnWire { delivered, tick })
    }

    fn arrive(&mut self, at: Nanos, frame: Option<CanFrame>) {
        if self.disturbance.arrivals_lost > 0 {
            self.disturbance.arrivals_lost -= 1;
            self.overflowed += 1;
        } else if self.incoming.len() >= INCOMING_MAX {
            self.overflowed += 1;
        } else {
            let place = self.incoming.partition_point(|other| other.at <= at);
            self.incoming.insert(place, Arrival { at, frame });
        }
    }

    /// The master reads what has arrived.
    pub fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        into.clear();
        if self.disturbance.interface == Interface::Gone {
            return Some(LinkFault::Gone);
        }
        let mut read = 0;
        while read < READ_MAX
            && let Some(arrival) = self.incoming.pop_front_if(|arrival| arrival.at <= self.now)
        {
            read += 1;
            match arrival.frame {
                Some(frame) => {
                    into.push(frame);
                }
                None => self.confirmed += 1,
            }
        }
        into.set_more(read == READ_MAX);
        (self.disturbance.interface == Interface::Down).then_some(LinkFault::Down)
    }

    /// Own frames that came back.
    #[must_use]
    pub fn confirmed(&self) -> u64 {
        self.confirmed
    }

    /// Own frames come back from the wire.
    #[must_use]
    pub fn has_wire(&self) -> bool {
        self.wire.is_some()
    }

    /// Arrivals that were lost.
    #[must_use]
    pub fn overflowed(&self) -> u64 {
        self.overflowed
    }

    /// Frames of the master wait in the interface's queue.
    #[must_use]
    pub fn has_queued(&self) -> bool {
        !self.queued.is_empty()
    }

    /// The master opens the interface again.
    pub fn reopen(&mut self) {
        self.incoming.clear();
        (self.confirmed, self.overflowed) = (0, 0);
    }
}
