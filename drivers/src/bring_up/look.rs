//! What a node is found to be when it is looked at, before anything is written: silent, off, ours, or somebody else's.
use crate::bring_up::adopt::Finding;
use crate::bring_up::cia402::{LISTEN_LEAST, LOOK_AGAIN, Node, Setpoint, Stage};
use crate::bring_up::pace::Cycle;
use crate::bring_up::power::Power;
use crate::bring_up::trouble::Trouble;
use crate::codec::canopen::NmtCommand;
use crate::codec::cia402_words::{DriveStep, STATUS_ENERGISED};
use crate::codec::object;
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::{DriveWish, Nanos};

impl Node {
    /// The setpoint that changes nothing, for a drive that is held and not in the cycle yet.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn keeping(&self) -> Option<Setpoint> {
        let waits = matches!(self.stage, Stage::Held { .. } | Stage::Rejoin { .. });
        let target_counts = self.held.filter(|_| waits)?;
        Some(Setpoint { control: Power::keeping(self.status), target_counts })
    }

    pub(super) fn settle_look(&mut self, cycle: Cycle, job: SdoJob, outcome: SdoOutcome) {
        let now = cycle.now;
        match outcome {
            SdoOutcome::Value(value) => match value.as_unsigned(2).map(u16::try_from) {
                Some(Ok(status)) => self.looked(cycle, status),
                _ => self.refuse(Trouble::WrongWidth.code(), job),
            },
            SdoOutcome::Aborted(code) => self.refuse(code, job),
            SdoOutcome::TimedOut => {
                self.heard = false;
                self.listen(now, Some(Trouble::NoAnswer));
            }
            SdoOutcome::Written => {}
        }
    }

    fn looked(&mut self, cycle: Cycle, status: u16) {
        let Cycle { now, wish, other_master } = cycle;
        self.status = status;
        let next = Nanos(now.0.saturating_add(LOOK_AGAIN.0));
        if status & STATUS_ENERGISED != 0 {
            self.looked_energised(cycle, next);
            return;
        }
        if self.ask_error() {
            // Found in fault: its code is read before anything is reset, and stands by when the fault is reported.
            return;
        }
        let since = if let Stage::Listen { since, .. } = self.stage { since } else { now };
        let listened = self.age(now, since) >= LISTEN_LEAST.0;
        if wish == DriveWish::Disabled && listened && !other_master {
            self.nmt = Some(NmtCommand::ResetCommunication);
            self.stage = Stage::Reset { since: now };
        } else {
            let trouble = other_master.then_some(Trouble::OtherMaster);
            self.stage = Stage::Listen { since, next, trouble };
        }
    }

    pub(super) fn rejoin(&mut self, now: Nanos, tries: u8) {
        self.nmt = Some(NmtCommand::Start);
        self.stage = Stage::Rejoin { since: now, tries };
    }

    pub(super) fn unowned(&mut self, now: Nanos, trouble: Trouble, object: u32) {
        self.stage = Stage::Unowned { next: Nanos(now.0.saturating_add(LOOK_AGAIN.0)), trouble, object };
    }

    pub(super) fn settle_verify(&mut self, now: Nanos, job: SdoJob, outcome: SdoOutcome) {
        match self.adoption.settle(now, job, outcome) {
            Finding::More => {}
            Finding::Holds(counts) => {
                self.held = Some(counts);
                // Looked at again at once: it may have dropped out meanwhile.
                self.stage = Stage::Held { next: now };
            }
            Finding::Foreign(trouble, object) => self.unowned(now, trouble, object),
            Finding::Silent => {
                self.heard = false;
                self.listen(now, Some(Trouble::NoAnswer));
            }
        }
    }

    /// Energised before this master has done anything: left as it is, whatever the finding.
    pub(super) fn looked_energised(&mut self, cycle: Cycle, next: Nanos) {
        let Cycle { now, wish, other_master } = cycle;
        if wish == DriveWish::TorqueOff {
            self.unowned(now, Trouble::Foreign, 0);
            self.torque_off_by_sdo();
            return;
        }
        match self.stage {
            Stage::Held { .. } => self.stage = Stage::Held { next },
            // What was written by others stays so; only another master may have ended.
            Stage::Unowned { trouble, object, .. } if other_master || trouble != Trouble::OtherMaster => {
                self.stage = Stage::Unowned { next, trouble, object };
            }
            _ if other_master => self.unowned(now, Trouble::OtherMaster, 0),
            Stage::Listen { since, .. } if self.age(now, since) < LISTEN_LEAST.0 => {
                self.stage = Stage::Listen { since, next, trouble: None };
            }
            Stage::Listen { .. }
            | Stage::Verify
            | Stage::Rejoin { .. }
            | Stage::Unowned { .. }
            | Stage::Reset { .. }
            | Stage::Configure { .. }
            | Stage::Start { .. }
            | Stage::Operational { .. }
            | Stage::Gone(_)
            | Stage::Refused { .. } => {
                if self.adoption.begin(DriveStep::from_status(self.status)) {
                    self.stage = Stage::Verify;
                } else {
                    self.unowned(now, Trouble::Foreign, object::STATUSWORD.packed());
                }
            }
        }
    }
}
