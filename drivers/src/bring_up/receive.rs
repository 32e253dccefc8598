//! What a node sends by itself or in answer, and what it means for the stage.
use crate::bring_up::cia402::{Node, NodeStage};
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::steps::Parts;
use crate::codec::canopen::{Emcy, NmtCommand, NmtState};
use crate::codec::cia402_words::DriveStep;
use crate::codec::emcy::RESET;
use crate::codec::sdo::SdoResponse;
use crate::servo::{DriveTarget, FixedPdos, Nanos};
use taustream_arm::OptionalObject;

/// Heartbeats in a row that deny "operational" before it is believed: one may have been queued before the start.
const DENIALS_MAX: u8 = 2;

impl Node {
    /// Takes process data: statusword and position.
    ///
    /// Real time: arithmetic only. True when it was taken: before the mapping is ours its meaning is not known.
    pub fn take_tpdo(&mut self, now: Nanos, status: u16, position: i32) -> bool {
        self.received = true;
        match self.stage {
            NodeStage::Start { .. } => {
                self.brake.closed_by_bring_up();
                self.stage = NodeStage::Operational { shutdown_since: None };
                self.heartbeat_at = now;
                self.denials = 0;
            }
            NodeStage::Rejoin { .. } => {
                self.stage = NodeStage::Operational { shutdown_since: None };
                self.heartbeat_at = now;
                self.denials = 0;
                self.mode.is_right = true;
                self.power.adopt();
            }
            NodeStage::Operational { .. } => {}
            NodeStage::Observe { .. }
            | NodeStage::Verify
            | NodeStage::Held { .. }
            | NodeStage::Unowned { .. }
            | NodeStage::Reset { .. }
            | NodeStage::Configure { .. }
            | NodeStage::Gone(_)
            | NodeStage::Refused { .. } => return false,
        }
        if self.in_fault() && DriveStep::from_status(status) != Some(DriveStep::Fault) {
            (self.emcy, self.requested_error) = (0, false);
        }
        (self.status, self.position, self.tpdo_at) = (status, Some(position), now);
        if self.plan.features.absent.holds(OptionalObject::ProducerHeartbeat) {
            self.heartbeat_at = now;
        }
        true
    }

    /// Takes an SDO answer.
    ///
    /// Real time: no allocation.
    pub fn take_sdo(&mut self, response: SdoResponse) {
        self.received = true;
        self.sdo.accept(response);
    }

    /// Takes an emergency message.
    ///
    /// Real time: arithmetic only.
    pub fn take_emcy(&mut self, emcy: Emcy) {
        self.received = true;
        self.emcy = emcy.code;
        if emcy.code != RESET {
            self.emergency = (emcy.code, self.emergency.1.wrapping_add(1));
        }
    }

    /// Code of the newest emergency message, "error reset" not counted, and how many came.
    #[must_use]
    pub const fn emergency(&self) -> (u16, u32) {
        self.emergency
    }

    /// Takes a heartbeat or boot-up.
    ///
    /// Real time: arithmetic only.
    pub fn take_heartbeat(&mut self, now: Nanos, state: NmtState) {
        self.received = true;
        self.heartbeat_at = now;
        self.denials = if state == NmtState::Operational { 0 } else { self.denials.saturating_add(1) };
        match (state, self.stage) {
            (NmtState::BootUp, NodeStage::Reset { .. }) => self.booted(now),
            // Later than it may take, and still the answer to our reset: to reset it again would begin the wait anew.
            (NmtState::BootUp, NodeStage::Observe { .. }) if self.reset_sent => self.booted(now),
            (NmtState::BootUp, NodeStage::Operational { .. }) => self.leave(now, BringUpFault::Restarted),
            (NmtState::BootUp, NodeStage::Gone(_)) => {}
            // It has just started: whatever was asked before is lost, and it can be asked at once.
            (NmtState::BootUp, _) => self.observe(now, None),
            // SDO does not work in NMT stopped; pre-operational does not touch the power stage.
            (NmtState::Stopped, NodeStage::Observe { .. }) => self.nmt = Some(NmtCommand::PreOperational),
            (_, NodeStage::Operational { .. }) if self.denials >= DENIALS_MAX => {
                self.leave(now, BringUpFault::LeftOperational);
            }
            _ => {}
        }
    }

    fn booted(&mut self, now: Nanos) {
        self.sdo.cancel();
        (self.reset_sent, self.differs, self.there) = (false, Parts::NONE, None);
        self.fixed_pdos = FixedPdos::NONE;
        self.stage = NodeStage::Configure { step: 0, since: now };
    }

    fn leave(&mut self, now: Nanos, fault: BringUpFault) {
        if self.last_target == DriveTarget::Disabled {
            self.observe(now, Some(fault));
        } else {
            self.sdo.cancel();
            self.close_brake();
            self.stage = NodeStage::Gone(fault);
        }
    }
}
