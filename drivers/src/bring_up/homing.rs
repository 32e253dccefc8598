//! Homing of one energised drive: out of its position mode, homed, and back to where it then holds.
//!
//! The drive moves by itself. While it is in homing mode its target means nothing, and is where it was measured, so that a drive that
//! fell back to its position mode would stand. Before it returns to that mode the target is what the drive holds, and it stays
//! so until the command of the joint is there too: no command in the old position units can reach it.
//!
//! Homing goes on only while it is requested, cycle by cycle: without the request, without feedback or beyond its time the
//! drive is stopped by halt, and by quick stop if it does not rest then.
//!
//! Source: CiA 402-2, "Homing mode", statusword bits 10, 12 and 13, controlword bits 4 and 8.
use crate::bring_up::cia402::Node;
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::homing_plan::HomingPlan;
use crate::codec::cia402_words::{
    CONTROL_ENABLE, CONTROL_HALT, CONTROL_HOME, CONTROL_QUICK_STOP, STATUS_FOLLOWS, STATUS_HOMED,
    STATUS_HOMING_ERROR, STATUS_REACHED,
};
use crate::codec::error_text::is_of_the_transfer;
use crate::codec::object;
use crate::codec::sdo::SdoBytes;
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::{DriveState, HomingState, Nanos};

/// A joint that moves by less than the plan's counts within this time stands.
const STILL: Nanos = Nanos(100_000_000);
/// Pause after a change of mode, bits or target, so that the newest answer is one to it.
const ANSWERED: Nanos = Nanos(50_000_000);
/// How long a drive may go on showing the end of an earlier homing after the start of this one.
const STALE: Nanos = Nanos(500_000_000);
/// How long halt may take to bring the joint to rest before quick stop.
const HALT_MAX: Nanos = Nanos(1_000_000_000);
/// Pause between two looks at the modes display, and between two tries to return to the position mode.
const AGAIN: Nanos = Nanos(20_000_000);
/// Mode of operation.
const MODE_HOMING: u8 = 6;

/// What a step of a parameter does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    /// It is read; only what differs is written.
    Compare,
    Write,
    /// It is read back.
    Prove,
}

/// Where the homing is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// The drive follows its commands.
    #[default]
    Idle,
    /// Its objects are being written; it still follows.
    Parameters { at: usize, access: Access },
    /// Into homing mode; asked for the display since it was written.
    Leave { since: Nanos, written: bool, asked: Nanos },
    /// In homing mode; since when.
    Ready { since: Nanos },
    /// The start bit is set.
    Run { since: Nanos },
    /// Being stopped; by quick stop once halt has not done it.
    Halt { since: Nanos, quick: bool },
    /// Homed; until it stands.
    Settle { since: Nanos },
    /// What it holds is being read.
    Demand,
    /// Back to the position mode, with the target where it holds.
    Return { since: Nanos, held: i32, written: bool, asked: Nanos },
    /// In its position mode; until it follows.
    Follow { since: Nanos, held: i32 },
    /// It holds there until the command is there too.
    Ended { held: i32 },
    /// It lost its torque on the way: back to the position mode, whatever it does.
    Restore { written: bool, asked: Nanos },
}

/// Which target goes out while a drive is not commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HomingTarget {
    /// The last one, which it still follows.
    Last,
    /// Where it is.
    Measured,
    /// This one, counts.
    Held(i32),
}

/// The homing of one drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Homing {
    stage: Stage,
    /// It is to home itself in this cycle.
    pub(super) requested: bool,
    outcome: HomingState,
    /// Bits of the statusword before the start; those that have changed since do not count any more.
    before: u16,
    /// The halt bit stays set until the drive is in its position mode again.
    halted: bool,
    /// Where it was last seen to begin to stand, and when.
    anchor: (i32, Nanos),
}

impl Homing {
    /// Nothing is known of the drive any more.
    pub(super) fn forget(&mut self) {
        *self = Self { requested: self.requested, ..Self::default() };
    }

    pub(super) fn is_idle(&self) -> bool {
        self.stage == Stage::Idle
    }

    /// The drive is not checked for whether it follows.
    pub(super) fn suspends_following(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Parameters { .. } | Stage::Ended { .. })
    }

    /// The state to report of a drive whose power stage is in `state`.
    pub(super) fn state(&self, state: DriveState) -> DriveState {
        match (self.stage, state) {
            (Stage::Idle, _) => state,
            (Stage::Restore { .. }, DriveState::Disabled) => DriveState::Disabling,
            (_, DriveState::Enabled) => DriveState::Homing,
            _ => state,
        }
    }

    /// What has become of it, as far as is known.
    pub(super) fn outcome(&self) -> HomingState {
        match self.stage {
            Stage::Ended { .. } => self.outcome,
            Stage::Idle | Stage::Restore { .. } => HomingState::None,
            Stage::Parameters { .. } | Stage::Leave { .. } => HomingState::Preparing,
            Stage::Ready { .. }
            | Stage::Run { .. }
            | Stage::Halt { .. }
            | Stage::Settle { .. }
            | Stage::Demand => HomingState::Running,
            Stage::Return { .. } | Stage::Follow { .. } => HomingState::Returning,
        }
    }

    /// What the drive holds and will follow, counts.
    pub(super) fn held(&self) -> Option<i32> {
        match self.stage {
            Stage::Return { held, .. } | Stage::Follow { held, .. } | Stage::Ended { held } => Some(held),
            Stage::Idle
            | Stage::Parameters { .. }
            | Stage::Leave { .. }
            | Stage::Ready { .. }
            | Stage::Run { .. }
            | Stage::Halt { .. }
            | Stage::Settle { .. }
            | Stage::Demand
            | Stage::Restore { .. } => None,
        }
    }

    /// The target in place of the command; `None` where the command is followed.
    pub(super) fn target(&self) -> Option<HomingTarget> {
        match self.stage {
            Stage::Idle | Stage::Parameters { .. } | Stage::Restore { .. } => None,
            Stage::Leave { .. } => Some(HomingTarget::Last),
            Stage::Ready { .. }
            | Stage::Run { .. }
            | Stage::Halt { .. }
            | Stage::Settle { .. }
            | Stage::Demand => Some(HomingTarget::Measured),
            Stage::Return { held, .. } | Stage::Follow { held, .. } | Stage::Ended { held } => {
                Some(HomingTarget::Held(held))
            }
        }
    }

    /// The controlword in place of the one of a drive that follows.
    pub(super) fn control(&self, follow: u16) -> u16 {
        let halt = if self.halted { CONTROL_HALT } else { 0 };
        match self.stage {
            Stage::Idle
            | Stage::Parameters { .. }
            | Stage::Follow { .. }
            | Stage::Ended { .. }
            | Stage::Restore { .. } => follow,
            Stage::Run { .. } if !self.requested => CONTROL_ENABLE | CONTROL_HALT,
            Stage::Run { .. } => CONTROL_ENABLE | CONTROL_HOME,
            Stage::Halt { quick: true, .. } => CONTROL_QUICK_STOP,
            Stage::Halt { quick: false, .. } => CONTROL_ENABLE | CONTROL_HALT,
            Stage::Leave { .. }
            | Stage::Ready { .. }
            | Stage::Settle { .. }
            | Stage::Demand
            | Stage::Return { .. } => CONTROL_ENABLE | halt,
        }
    }

    /// The command of the joint is `counts`: the drive is given back to it when it is what the drive holds.
    pub(super) fn release_at(&mut self, counts: Option<i32>) {
        if let Stage::Ended { held } = self.stage
            && !self.requested
            && counts.is_some_and(|counts| counts.abs_diff(held) <= 1)
        {
            self.stage = Stage::Idle;
        }
    }

    fn fail(&mut self, code: u32, object: u32) {
        if self.outcome == HomingState::None {
            self.outcome = HomingState::Failed { code, object };
        }
    }
}

impl Node {
    /// Says whether the drive is to home itself in this cycle.
    ///
    /// Real time: a store.
    pub fn request_homing(&mut self, requested: bool) {
        self.homing.requested = requested && self.homing_plan.is_some();
    }

    /// What the stages of homing do by themselves.
    pub(super) fn advance_homing(&mut self, now: Nanos) {
        let Some(plan) = self.homing_plan else { return };
        self.note_movement(now, plan.still_counts);
        let on = self.power.is_on();
        if self.homing.is_idle() {
            if self.homing.requested && on && self.power.fault().is_none() && self.sdo.is_idle() {
                let (requested, anchor) = (true, self.homing.anchor);
                self.homing = Homing { requested, anchor, ..Homing::default() };
                self.next_parameter(now, &plan, 0);
            }
            return;
        }
        if !on {
            self.lose_torque();
        }
        let fresh = self.age(now, self.tpdo_at) <= self.timeouts.feedback.0;
        match self.homing.stage {
            Stage::Idle | Stage::Ended { .. } => {}
            Stage::Parameters { at, access } => self.advance_parameter(&plan, at, access),
            Stage::Leave { since, written, asked } => self.advance_leave(now, since, written, asked),
            Stage::Ready { since } => self.advance_ready(now, since, fresh),
            Stage::Run { since } => self.advance_run(now, since, &plan, fresh),
            Stage::Halt { since, quick } => self.advance_halt(now, since, quick, fresh),
            Stage::Settle { since } => {
                if fresh && self.stands(now) && self.age(now, since) >= STILL.0 {
                    self.homing.stage = Stage::Demand;
                } else if self.age(now, since) >= self.timeouts.step.0 {
                    self.homing.outcome = HomingState::None;
                    self.stop_homing(now, BringUpFault::HomingNotAtRest);
                }
            }
            Stage::Demand => {
                if self.sdo.is_idle() {
                    self.sdo.begin(SdoJob::Read(object::POSITION_DEMAND));
                }
            }
            Stage::Return { since, held, written, asked } => {
                self.advance_return(now, (since, held), written, asked);
            }
            Stage::Follow { since, held } => self.advance_follow(now, since, held),
            Stage::Restore { written, asked } => self.advance_restore(now, written, asked),
        }
    }

    /// The drive is not energised any more, or not as it was asked to be.
    fn lose_torque(&mut self) {
        self.homing.stage = match self.homing.stage {
            Stage::Idle | Stage::Parameters { .. } | Stage::Ended { .. } => Stage::Idle,
            Stage::Restore { .. } => return,
            Stage::Leave { .. }
            | Stage::Ready { .. }
            | Stage::Run { .. }
            | Stage::Halt { .. }
            | Stage::Settle { .. }
            | Stage::Demand
            | Stage::Return { .. }
            | Stage::Follow { .. } => Stage::Restore { written: false, asked: Nanos(0) },
        };
        self.sdo.cancel();
    }

    /// Takes the answer to a request of homing.
    pub(super) fn settle_homing(&mut self, now: Nanos, job: SdoJob, outcome: SdoOutcome) {
        let value = if let SdoOutcome::Value(value) = outcome { Some(value) } else { None };
        let shown = value.and_then(|value| value.as_unsigned(1));
        let is_display = job.address() == object::MODE_DISPLAY;
        match self.homing.stage {
            Stage::Parameters { at, access } => {
                self.settle_parameter(now, (at, access), job, outcome);
            }
            Stage::Leave { written: false, .. } => match outcome {
                SdoOutcome::Written => {
                    self.homing.stage = Stage::Leave { since: now, written: true, asked: now };
                }
                SdoOutcome::Aborted(code) => self.give_up(now, code, job),
                SdoOutcome::Value(_) | SdoOutcome::TimedOut => {
                    self.give_up(now, BringUpFault::NoAnswer.code(), job);
                }
            },
            Stage::Leave { written: true, .. } if is_display && shown == Some(u32::from(MODE_HOMING)) => {
                self.homing.stage = Stage::Ready { since: now };
            }
            Stage::Demand => {
                let measured = self.position.unwrap_or_default();
                let demand = value.and_then(|value| value.as_unsigned(4)).map(u32::cast_signed);
                // A demand far from the position counts in other units, or is an old one.
                let near = |demand: &i32| demand.abs_diff(measured) <= self.plan.near_counts;
                let held = demand.filter(near).unwrap_or(measured);
                self.homing.stage = Stage::Return { since: now, held, written: false, asked: now };
            }
            Stage::Return { held, written: false, .. } if outcome == SdoOutcome::Written => {
                self.homing.stage = Stage::Return { since: now, held, written: true, asked: now };
            }
            Stage::Return { held, written: true, .. }
                if is_display && shown == Some(self.position_mode()) =>
            {
                self.mode.is_right = true;
                self.homing.halted = false;
                self.homing.stage = Stage::Follow { since: now, held };
            }
            Stage::Restore { written: false, .. } if outcome == SdoOutcome::Written => {
                self.homing.stage = Stage::Restore { written: true, asked: now };
            }
            Stage::Restore { written: true, .. } if is_display => {
                let late = self.plan.features.late_mode_display;
                self.mode.is_right = shown == Some(self.position_mode());
                if self.mode.is_right || late {
                    self.homing = Homing::default();
                } else {
                    self.homing.stage = Stage::Restore { written: false, asked: now };
                }
            }
            Stage::Idle
            | Stage::Leave { .. }
            | Stage::Ready { .. }
            | Stage::Run { .. }
            | Stage::Halt { .. }
            | Stage::Settle { .. }
            | Stage::Return { .. }
            | Stage::Follow { .. }
            | Stage::Ended { .. }
            | Stage::Restore { .. } => {}
        }
    }

    fn position_mode(&self) -> u32 {
        u32::from(self.plan.features.position_mode.number())
    }

    fn note_movement(&mut self, now: Nanos, still_counts: u32) {
        let Some(position) = self.position else { return };
        if position.abs_diff(self.homing.anchor.0) > still_counts {
            self.homing.anchor = (position, now);
        }
    }

    fn stands(&self, now: Nanos) -> bool {
        self.age(now, self.homing.anchor.1) >= STILL.0
    }

    /// To the first parameter from `at` on, or into homing mode.
    fn next_parameter(&mut self, now: Nanos, plan: &HomingPlan, at: usize) {
        let next = plan.parameters.iter().enumerate().skip(at).find(|(_, parameter)| parameter.is_some());
        self.homing.stage = match next {
            Some((at, _)) => Stage::Parameters { at, access: Access::Compare },
            None => Stage::Leave { since: now, written: false, asked: now },
        };
    }

    fn advance_parameter(&mut self, plan: &HomingPlan, at: usize, access: Access) {
        if !self.homing.requested {
            self.sdo.cancel();
            self.homing.stage = Stage::Idle;
            return;
        }
        let Some((address, bytes)) = plan.parameters.get(at).copied().flatten() else { return };
        if self.sdo.is_idle() {
            self.sdo.begin(match access {
                Access::Compare | Access::Prove => SdoJob::Read(address),
                Access::Write => SdoJob::Write(address, bytes),
            });
        }
    }

    fn settle_parameter(
        &mut self,
        now: Nanos,
        (at, access): (usize, Access),
        job: SdoJob,
        outcome: SdoOutcome,
    ) {
        let Some(plan) = self.homing_plan else { return };
        let Some((_, bytes)) = plan.parameters.get(at).copied().flatten() else { return };
        let width = bytes.as_slice().len();
        match (access, outcome) {
            (_, SdoOutcome::TimedOut) => self.give_up(now, BringUpFault::NoAnswer.code(), job),
            (_, SdoOutcome::Aborted(code)) if is_of_the_transfer(code) => self.give_up(now, code, job),
            (Access::Compare | Access::Prove, SdoOutcome::Value(value))
                if value.as_unsigned(width) == Some(bytes.as_u32()) =>
            {
                self.next_parameter(now, &plan, at + 1);
            }
            // No abort of a read says reliably whether the object is absent: the write decides.
            (Access::Compare, _) => {
                self.homing.stage = Stage::Parameters { at, access: Access::Write };
            }
            (Access::Write, SdoOutcome::Written) => {
                self.homing.stage = Stage::Parameters { at, access: Access::Prove };
            }
            (Access::Prove, SdoOutcome::Value(value)) => {
                let stated = value.as_unsigned_of_any_width().unwrap_or_default();
                self.numbers = [f64::from(stated), f64::from(bytes.as_u32())];
                self.give_up(now, BringUpFault::NotTaken.code(), job);
            }
            // An object that cannot be read has confirmed the write, and that is all it can.
            (Access::Prove, _) => self.next_parameter(now, &plan, at + 1),
            (Access::Write, SdoOutcome::Aborted(code)) => self.give_up(now, code, job),
            (Access::Write, SdoOutcome::Value(_)) => {}
        }
    }

    /// Not begun: the drive is in its position mode, or is brought back there.
    fn give_up(&mut self, now: Nanos, code: u32, job: SdoJob) {
        self.homing.fail(code, job.address().packed());
        let held = self.commanded.or(self.position).unwrap_or_default();
        let untouched = matches!(self.homing.stage, Stage::Parameters { .. });
        self.homing.stage = if untouched {
            Stage::Ended { held }
        } else {
            Stage::Return { since: now, held, written: false, asked: now }
        };
    }

    fn advance_leave(&mut self, now: Nanos, since: Nanos, written: bool, asked: Nanos) {
        // The controlword without its mode's bits has to be in effect before bit 4 means the start of homing.
        if self.age(now, since) < ANSWERED.0 || !self.sdo.is_idle() {
            return;
        }
        if !self.homing.requested && !written {
            self.homing.outcome = HomingState::Aborted;
            let held = self.commanded.or(self.position).unwrap_or_default();
            self.homing.stage = Stage::Return { since: now, held, written: false, asked: now };
        } else if !written {
            self.mode.is_right = false;
            self.sdo.begin(SdoJob::Write(object::MODE, SdoBytes::from_u8(MODE_HOMING)));
        } else if self.age(now, since) >= self.timeouts.step.0 {
            self.stop_homing(now, BringUpFault::HomingModeNotTaken);
        } else if self.age(now, asked) >= AGAIN.0 {
            self.homing.stage = Stage::Leave { since, written, asked: now };
            self.sdo.begin(SdoJob::Read(object::MODE_DISPLAY));
        }
    }

    fn advance_ready(&mut self, now: Nanos, since: Nanos, fresh: bool) {
        if !self.homing.requested {
            self.abort_homing(now);
        } else if fresh && self.age(now, since) >= ANSWERED.0 {
            self.homing.before = self.status;
            self.homing.stage = Stage::Run { since: now };
        } else if self.age(now, since) >= self.timeouts.step.0 {
            self.stop_homing(now, BringUpFault::HomingNoFeedback);
        }
    }

    fn advance_run(&mut self, now: Nanos, since: Nanos, plan: &HomingPlan, fresh: bool) {
        let age = self.age(now, since);
        if age >= ANSWERED.0 {
            // A bit that was seen clear is of this homing from then on.
            self.homing.before &= self.status;
        }
        let stale = self.homing.before;
        let is_new = |bit: u16| self.status & bit != 0 && (stale & bit == 0 || age >= STALE.0);
        if !self.homing.requested {
            self.abort_homing(now);
        } else if !fresh {
            self.stop_homing(now, BringUpFault::HomingNoFeedback);
        } else if age >= ANSWERED.0 && is_new(STATUS_HOMING_ERROR) {
            self.stop_homing(now, BringUpFault::HomingError);
        } else if age >= ANSWERED.0 && is_new(STATUS_HOMED) && self.status & STATUS_REACHED != 0 {
            if stale & STATUS_HOMED != 0 && plan.moves {
                self.stop_homing(now, BringUpFault::HomingNotBegun);
            } else {
                self.homing.outcome = HomingState::Attained;
                self.homing.stage = Stage::Settle { since: now };
            }
        } else if age >= plan.timeout.0 {
            self.stop_homing(now, BringUpFault::HomingTimeout);
        }
    }

    fn advance_halt(&mut self, now: Nanos, since: Nanos, quick: bool, fresh: bool) {
        let age = self.age(now, since);
        if fresh && !quick && age >= STILL.0 && self.stands(now) {
            self.homing.stage = Stage::Demand;
        } else if !quick && age >= HALT_MAX.0 {
            // What follows is the drive's quick stop option; its power stage says so.
            self.homing.stage = Stage::Halt { since: now, quick: true };
        } else if quick && age >= HALT_MAX.0 {
            self.power.note(BringUpFault::HomingNotStopped);
        }
    }

    /// The request has gone.
    fn abort_homing(&mut self, now: Nanos) {
        if self.homing.outcome == HomingState::None {
            self.homing.outcome = HomingState::Aborted;
        }
        self.homing.halted = true;
        self.homing.stage = Stage::Halt { since: now, quick: false };
    }

    fn stop_homing(&mut self, now: Nanos, fault: BringUpFault) {
        self.homing.fail(fault.code(), 0);
        self.abort_homing(now);
    }

    fn advance_return(&mut self, now: Nanos, (since, held): (Nanos, i32), written: bool, asked: Nanos) {
        // The target has to have arrived before the mode that follows it.
        if self.age(now, since) < ANSWERED.0 || !self.sdo.is_idle() || self.age(now, asked) < AGAIN.0 {
            return;
        }
        if self.age(now, since) >= self.timeouts.step.0 {
            self.power.note(BringUpFault::ModeNotTaken);
        }
        self.homing.stage = Stage::Return { since, held, written, asked: now };
        self.sdo.begin(if written {
            SdoJob::Read(object::MODE_DISPLAY)
        } else {
            let mode = self.plan.features.position_mode.number();
            SdoJob::Write(object::MODE, SdoBytes::from_u8(mode))
        });
    }

    fn advance_follow(&mut self, now: Nanos, since: Nanos, held: i32) {
        let age = self.age(now, since);
        if age >= ANSWERED.0 && self.status & STATUS_FOLLOWS != 0 {
            self.homing.stage = Stage::Ended { held };
        } else if age >= self.timeouts.step.0 {
            self.power.note(BringUpFault::NotFollowing);
        }
    }

    fn advance_restore(&mut self, now: Nanos, written: bool, asked: Nanos) {
        if !self.sdo.is_idle() || self.age(now, asked) < AGAIN.0 {
            return;
        }
        self.homing.stage = Stage::Restore { written, asked: now };
        self.sdo.begin(if written {
            SdoJob::Read(object::MODE_DISPLAY)
        } else {
            let mode = self.plan.features.position_mode.number();
            SdoJob::Write(object::MODE, SdoBytes::from_u8(mode))
        });
    }
}
