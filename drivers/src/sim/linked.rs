//! Simulated servos behind modelled buses: a bus with a bit rate delivers each frame when its last bit has passed, a virtual one
//! at once.
use super::simulator::ServoSimulator;
use super::wire::{Delivered, Sender, Wire};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use taustream_arm::Bus;

/// Simulated drives and the wires that they hang on.
#[derive(Clone, Debug)]
pub struct LinkedSimulator {
    /// The drives.
    pub simulator: ServoSimulator,
    wires: Vec<Option<Wire>>,
    scratch: Vec<Vec<CanFrame>>,
}

impl LinkedSimulator {
    /// Puts the servos behind their buses; the master's side of each holds `queue_max` frames.
    #[must_use]
    pub fn new(simulator: ServoSimulator, buses: &[Bus], queue_max: usize) -> Self {
        let wires = buses.iter().map(|bus| Wire::new(bus.kind, queue_max)).collect();
        Self { simulator, wires, scratch: vec![Vec::new(); buses.len()] }
    }

    /// The wire of a bus that has a bit rate.
    #[must_use]
    pub fn wire(&self, bus: usize) -> Option<&Wire> {
        self.wires.get(bus)?.as_ref()
    }

    /// Lets time pass; `out` takes what each bus has delivered from the drives.
    pub fn advance(&mut self, now: Nanos, out: &mut [Vec<CanFrame>]) {
        (0..self.wires.len()).for_each(|bus| self.deliver_by(now, bus, out));
        self.simulator.advance(now, &mut self.scratch);
        self.pass_on(now, out);
    }

    /// Hands over what a master sent on a bus.
    pub fn receive(&mut self, now: Nanos, bus: usize, frames: &[CanFrame], out: &mut [Vec<CanFrame>]) {
        // What has left the queue by now makes room in it.
        self.deliver_by(now, bus, out);
        match self.wires.get_mut(bus).and_then(Option::as_mut) {
            Some(wire) => frames.iter().for_each(|frame| {
                wire.offer(now, Sender::Master, *frame);
            }),
            None => self.simulator.receive(now, bus, frames, out),
        }
    }

    /// When something is due by itself.
    #[must_use]
    pub fn next_due(&self) -> Option<Nanos> {
        let wires = self.wires.iter().flatten().filter_map(Wire::next_due);
        wires.chain(self.simulator.next_due()).min()
    }

    fn deliver_by(&mut self, now: Nanos, bus: usize, out: &mut [Vec<CanFrame>]) {
        while let Some(delivered) = self.wires.get_mut(bus).and_then(|wire| wire.as_mut()?.next_by(now)) {
            self.deliver(bus, delivered, out);
        }
    }

    fn deliver(&mut self, bus: usize, delivered: Delivered, out: &mut [Vec<CanFrame>]) {
        match delivered.sender {
            Sender::Drive => out.get_mut(bus).into_iter().for_each(|out| out.push(delivered.frame)),
            Sender::Master => {
                self.simulator.receive(delivered.at, bus, &[delivered.frame], &mut self.scratch);
                self.pass_on(delivered.at, out);
            }
        }
    }

    /// What drives have said goes onto their wire, or straight out where there is none.
    fn pass_on(&mut self, now: Nanos, out: &mut [Vec<CanFrame>]) {
        for ((said, wire), out) in self.scratch.iter_mut().zip(&mut self.wires).zip(out) {
            match wire {
                Some(wire) => said.drain(..).for_each(|frame| {
                    wire.offer(now, Sender::Drive, frame);
                }),
                None => out.append(said),
            }
        }
    }
}
