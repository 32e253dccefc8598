//! What is believed is durable first: before drives are energised, or a reference is changed, a record on the disk says so.
//!
//! The command waits for the pose store, cycle by cycle, and is then decided anew. The cycle never waits, and no stop asks
//! for a record: it ends the waiting command instead.
use crate::answer::{AnswerReason, CommandAnswer};
use crate::cycle_state::{CycleState, PendingCommand};
use crate::intake::Shutdown;
use crate::supervise::{Actions, Supervisor};
use crate::write_ahead::{JointNow, Requester};
use taustream_drivers::Nanos;
use taustream_messages::{Command, Phase, ReferenceState};

/// How long the disk may take, s.
const RECORD_S_MAX: f64 = 1.0;
/// How long leaving waits for a record of rest, s.
pub(crate) const LEAVE_RECORD_S_MAX: f64 = 1.5;

/// A command that waits for its record.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    pending: PendingCommand,
    number: u32,
    since: Nanos,
    phase: Phase,
    stopped: bool,
}

/// The records of a supervisor.
#[derive(Debug)]
pub(crate) struct Records {
    /// `None`: nobody keeps the last pose, and nothing waits for it.
    requester: Option<Requester>,
    waiting: Option<Waiting>,
    /// A record says that the arm is under way, and something may be energised.
    open: bool,
}

impl Records {
    pub(crate) fn new(requester: Requester) -> Self {
        Self { requester: Some(requester), waiting: None, open: false }
    }
    /// Nobody keeps the last pose.
    pub(crate) fn none() -> Self {
        Self { requester: None, waiting: None, open: false }
    }
    /// Rest is on the disk, as far as somebody keeps it.
    pub(crate) fn is_rest_recorded(&self) -> bool {
        self.requester.as_ref().is_none_or(Requester::is_rest_recorded)
    }
}

impl Supervisor {
    /// Requests the record that `pending` needs; `None` when it needs none, or waits already.
    pub(crate) fn begin_record(
        &mut self,
        pending: PendingCommand,
        cycle_state: &CycleState,
    ) -> Option<Result<(), AnswerReason>> {
        let needed = match pending.command {
            Command::Enable => {
                matches!(self.phase, Phase::Disabled) || self.adopted && self.phase == Phase::Locked
            }
            Command::Reference { .. } | Command::Home { .. } => true,
            Command::Disable
            | Command::Pause
            | Command::Resume
            | Command::Stop
            | Command::FastStop
            | Command::TorqueOff
            | Command::Speed { .. }
            | Command::Axis { .. }
            | Command::ClearFault => false,
        };
        if !needed || self.shutting_down != Shutdown::No || self.records.requester.is_none() {
            return None;
        }
        if self.records.waiting.is_some() {
            return Some(Err(AnswerReason::Wait));
        }
        let mut homing = None;
        let checked = if let Command::Reference { joint, at_rad } = pending.command {
            self.check_reference(joint, at_rad, cycle_state).map(|_| ())
        } else if let Command::Home { joint } = pending.command {
            self.check_homing(joint, cycle_state).map(|(joint, _)| homing = Some(joint))
        } else {
            self.trusted_pose(cycle_state).map(|_| ())
        };
        if let Err(why) = checked {
            return Some(Err(why));
        }
        let mut joints = [JointNow::UNKNOWN; _];
        for (joint, servo) in self.servos(cycle_state) {
            let resolved = self.referencing.resolved(joint);
            // A joint that homes is not referenced by what was known before, whatever becomes of it.
            let homes = homing == Some(joint);
            let reference_state = if homes { ReferenceState::Homing } else { resolved.reference_state };
            let offset_rad = resolved.offset_rad;
            if let Some(slot) = joints.get_mut(joint) {
                *slot = JointNow { position_rad: servo.position_rad, offset_rad, reference_state };
            }
        }
        let number = self.records.requester.as_mut()?.request(&joints);
        self.records.open = true;
        self.records.waiting = Some(Waiting {
            pending,
            number,
            since: cycle_state.tick.wake_time,
            phase: self.phase,
            stopped: false,
        });
        Some(Ok(()))
    }

    /// Whether a stop, a fault or the end of the streamer has come before the record of a command that waits.
    fn ends_waiting(&self, waiting: &Waiting, cycle_state: &CycleState) -> bool {
        waiting.stopped
            || self.shutting_down != Shutdown::No
            || (self.phase == Phase::Fault && waiting.phase != Phase::Fault)
            || cycle_state.commands.iter().flatten().any(|pending| ends(pending.command))
    }

    /// A command that stops the arm ends one that waits, also when both came in the same cycle.
    pub(crate) fn stop_waiting(&mut self, command: Command) {
        if let Some(waiting) = &mut self.records.waiting {
            waiting.stopped |= ends(command);
        }
    }

    /// Decides the command that waits, if its record is written or will not be.
    ///
    /// Real time: bounded work, no allocation.
    pub(crate) fn settle_record(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Option<CommandAnswer> {
        let waiting = self.records.waiting?;
        let Waiting { pending, number, since, .. } = waiting;
        let waited_s = cycle_state.tick.wake_time.since_s(since);
        let late_s = cycle_state.tick.wake_time.since_s(pending.valid_until);
        let stored = self.records.requester.as_ref()?.answer(number);
        let result = match stored {
            _ if late_s > 0.0 => Err(AnswerReason::TooLate { late_s }),
            _ if self.ends_waiting(&waiting, cycle_state) => Err(AnswerReason::Overtaken),
            Some(Err(fault)) => Err(AnswerReason::NotRecorded { fault }),
            None if waited_s > RECORD_S_MAX => Err(AnswerReason::RecordLate { waited_s }),
            None => return None,
            Some(Ok(())) => {
                if let Command::Reference { joint, at_rad } = pending.command {
                    self.reference(joint, at_rad, cycle_state)
                } else if let Command::Home { joint } = pending.command {
                    self.home(joint, cycle_state, actions)
                } else {
                    self.enable(cycle_state, actions)
                }
            }
        };
        self.records.waiting = None;
        let (accepted, why) = match result {
            Ok(why) => (true, why),
            Err(why) => (false, why),
        };
        Some(CommandAnswer { sequence: pending.sequence, accepted, phase: self.phase, why })
    }

    /// Says when nothing is energised any more, so that rest may be recorded again.
    ///
    /// Real time: two atomic stores.
    pub(crate) fn release_record(&mut self, cycle_state: &CycleState) {
        let off = match self.phase {
            Phase::Configuring | Phase::Disabled => true,
            Phase::Fault => !self.holds,
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Locked
            | Phase::Homing
            | Phase::Disabling => false,
        };
        let records = &self.records;
        if records.open && off && records.waiting.is_none() && self.energised(cycle_state).is_none() {
            if let Some(requester) = &records.requester {
                requester.release(cycle_state.tick.number);
            }
            self.records.open = false;
        }
    }
}

/// Commands after which nothing is energised that was asked for before.
fn ends(command: Command) -> bool {
    matches!(command, Command::Stop | Command::FastStop | Command::TorqueOff | Command::Disable)
}
