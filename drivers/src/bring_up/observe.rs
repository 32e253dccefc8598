//! What a node is found to be when it is looked at, before anything is written: without feedback, off, ours, or of another master.
use crate::bring_up::adopt::Finding;
use crate::bring_up::cia402::{DriveSetpoint, Node, NodeStage, OBSERVE_AGAIN, OBSERVE_MIN};
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::timing::BringUpCycle;
use crate::codec::canopen::NmtCommand;
use crate::codec::cia402_words::{DriveStep, STATUS_ENERGISED};
use crate::codec::object;
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::{DriveTarget, Nanos};

impl Node {
    /// The setpoint that changes nothing, for a drive that is held and not in the cycle yet.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn keeping(&self) -> Option<DriveSetpoint> {
        let waits = matches!(self.stage, NodeStage::Held { .. } | NodeStage::Rejoin { .. });
        let target_counts = self.held.filter(|_| waits)?;
        Some(DriveSetpoint { control: self.power.keeping(self.status), target_counts })
    }

    pub(super) fn settle_observation(&mut self, cycle: BringUpCycle, job: SdoJob, outcome: SdoOutcome) {
        let now = cycle.now;
        match outcome {
            SdoOutcome::Value(value) => match value.as_unsigned(2).map(u16::try_from) {
                Some(Ok(status)) => self.looked(cycle, status),
                _ => self.refuse(BringUpFault::WrongWidth.code(), job),
            },
            SdoOutcome::Aborted(code) => self.refuse(code, job),
            SdoOutcome::TimedOut => {
                self.received = false;
                self.observe(now, Some(BringUpFault::NoAnswer));
            }
            SdoOutcome::Written => {}
        }
    }

    fn looked(&mut self, cycle: BringUpCycle, status: u16) {
        let BringUpCycle { now, drive_target, other_master } = cycle;
        self.status = status;
        // A drive that answers has not been restarting: a boot-up from here on is another one.
        self.reset_sent = false;
        let next = Nanos(now.0.saturating_add(OBSERVE_AGAIN.0));
        if status & STATUS_ENERGISED != 0 {
            self.looked_energised(cycle, next);
            return;
        }
        if self.request_error() {
            // Found in fault: its code is read before anything is reset, and stands by when the fault is reported.
            return;
        }
        let since = if let NodeStage::Observe { since, .. } = self.stage { since } else { now };
        let observed = self.age(now, since) >= OBSERVE_MIN.0;
        if drive_target == DriveTarget::Disabled && observed && !other_master {
            self.nmt = Some(NmtCommand::ResetCommunication);
            self.reset_sent = true;
            self.stage = NodeStage::Reset { since: now };
        } else {
            let fault = other_master.then_some(BringUpFault::OtherMaster);
            self.stage = NodeStage::Observe { since, next, fault };
        }
    }

    /// Asks a drive in fault for its error code, once: its emergency message was lost, or came before we listened.
    pub(super) fn request_error(&mut self) -> bool {
        let due = self.in_fault() && self.emcy == 0 && !self.requested_error && self.sdo.is_idle();
        if due {
            self.requested_error = true;
            self.sdo.begin(SdoJob::Read(object::ERROR_CODE));
        }
        due
    }

    pub(super) fn rejoin(&mut self, now: Nanos, tries: u8) {
        self.nmt = Some(NmtCommand::Start);
        self.stage = NodeStage::Rejoin { since: now, tries };
    }

    pub(super) fn unowned(&mut self, now: Nanos, fault: BringUpFault, object: u32) {
        self.stage = NodeStage::Unowned { next: Nanos(now.0.saturating_add(OBSERVE_AGAIN.0)), fault, object };
    }

    pub(super) fn settle_verify(&mut self, now: Nanos, job: SdoJob, outcome: SdoOutcome) {
        match self.adoption.settle(now, job, outcome) {
            Finding::More => {}
            Finding::Holds(counts) => {
                self.held = Some(counts);
                // Looked at again at once: it may have dropped out meanwhile.
                self.stage = NodeStage::Held { next: now };
            }
            Finding::Foreign(fault, object) => self.unowned(now, fault, object),
            Finding::Differs(contradiction) => {
                self.numbers = [contradiction.stated, contradiction.expected];
                self.unowned(now, BringUpFault::ScaleDiffers, contradiction.object.packed());
            }
            Finding::NoReply => {
                self.received = false;
                self.observe(now, Some(BringUpFault::NoAnswer));
            }
        }
    }

    /// Energised before this master has done anything: left as it is, whatever the finding.
    pub(super) fn looked_energised(&mut self, cycle: BringUpCycle, next: Nanos) {
        let BringUpCycle { now, drive_target, other_master } = cycle;
        if drive_target == DriveTarget::TorqueOff {
            self.unowned(now, BringUpFault::Foreign, 0);
            self.torque_off_by_sdo();
            return;
        }
        match self.stage {
            NodeStage::Held { .. } => self.stage = NodeStage::Held { next },
            // What was written by others stays so; only another master may have ended.
            NodeStage::Unowned { fault, object, .. }
                if other_master || fault != BringUpFault::OtherMaster =>
            {
                self.stage = NodeStage::Unowned { next, fault, object };
            }
            _ if other_master => self.unowned(now, BringUpFault::OtherMaster, 0),
            NodeStage::Observe { since, .. } if self.age(now, since) < OBSERVE_MIN.0 => {
                self.stage = NodeStage::Observe { since, next, fault: None };
            }
            NodeStage::Observe { .. }
            | NodeStage::Verify
            | NodeStage::Rejoin { .. }
            | NodeStage::Unowned { .. }
            | NodeStage::Reset { .. }
            | NodeStage::Configure { .. }
            | NodeStage::Start { .. }
            | NodeStage::Operational { .. }
            | NodeStage::Gone(_)
            | NodeStage::Refused { .. } => {
                if self.adoption.begin(DriveStep::from_status(self.status)) {
                    self.stage = NodeStage::Verify;
                } else {
                    self.unowned(now, BringUpFault::Foreign, object::STATUSWORD.packed());
                }
            }
        }
    }
}
