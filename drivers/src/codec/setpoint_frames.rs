//! Which frame carries which drive's setpoint, and in which cycle.
//!
//! Plain: the first RPDO of each drive holds controlword and target. Packed: the targets of two drives share a frame
//! of eight bytes, of which each drive skips the other's four (a dummy entry of its mapping, CiA 301 section
//! 7.5.2.36); their controlwords then have frames of their own, sent when they change and repeated now and then.
//! Of an odd number of drives the last one stays plain.
use crate::codec::canopen::{COB_PDO_STEP, COB_RPDO1, cob};
use crate::frame::{CanFrame, CanId};
use taustream_arm::Traffic;
use taustream_arm::bus_load::CONTROL_REPEAT_TURNS;

/// One frame's worth of setpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// A drive by its place among the drives of the bus.
    One(usize),
    /// Two drives, in the order of their parts.
    Pair([usize; 2]),
}

/// Identifier of a frame that two drives share: that of the first one's second RPDO, which nothing else uses.
#[must_use]
pub const fn shared_cob_id(first_node: u8) -> CanId {
    cob(COB_RPDO1 + COB_PDO_STEP, first_node)
}

/// The frame that two drives share: one target each, in counts.
#[must_use]
pub fn encode_pair(first_node: u8, targets_counts: [i32; 2]) -> CanFrame {
    let [a, b, c, d] = targets_counts[0].to_le_bytes();
    let [e, f, g, h] = targets_counts[1].to_le_bytes();
    CanFrame::classic(shared_cob_id(first_node), &[a, b, c, d, e, f, g, h])
}

/// The first RPDO of a drive whose target comes in a shared frame: its controlword alone.
#[must_use]
pub fn encode_control(node: u8, control: u16) -> CanFrame {
    CanFrame::classic(cob(COB_RPDO1, node), &control.to_le_bytes())
}

/// When each group of a bus gets its setpoints.
#[derive(Clone, Copy, Debug)]
pub struct SendSchedule {
    every: u64,
    stagger: bool,
    cycle: u64,
}

impl SendSchedule {
    /// From the first cycle on.
    #[must_use]
    pub fn new(traffic: Traffic) -> Self {
        Self { every: u64::from(traffic.setpoint_every.max(1)), stagger: traffic.stagger, cycle: 0 }
    }

    /// The next cycle begins.
    ///
    /// Real time: arithmetic only.
    pub fn advance(&mut self) {
        self.cycle = self.cycle.wrapping_add(1);
    }

    /// Whether this cycle carries the setpoints of a group.
    #[must_use]
    pub fn is_due(&self, group: usize) -> bool {
        self.phase(group).is_multiple_of(self.every)
    }

    /// Whether this turn of a group repeats its controlwords. The groups take turns in this too: all repetitions in
    /// one cycle would be a burst.
    #[must_use]
    pub fn repeats_control(&self, group: usize) -> bool {
        let turn = self.phase(group) / self.every;
        self.is_due(group) && (turn + group as u64).is_multiple_of(u64::from(CONTROL_REPEAT_TURNS))
    }

    fn phase(&self, group: usize) -> u64 {
        self.cycle.wrapping_add(if self.stagger { group as u64 } else { 0 })
    }
}

/// The groups of `drives` drives on a bus.
#[must_use]
pub fn groups(drives: usize, packed: bool) -> Vec<Group> {
    let alone = |drives: std::ops::Range<usize>| drives.map(Group::One);
    if !packed {
        return alone(0..drives).collect();
    }
    let pairs = (0..drives / 2).map(|pair| Group::Pair([2 * pair, 2 * pair + 1]));
    pairs.chain(alone(drives / 2 * 2..drives)).collect()
}
