//! Energising and de-energising one operational drive: which controlword is right for which statusword.
//!
//! Everything follows from the newest statusword and the drive target; the enable command is sent only to a drive whose own
//! last word was "switched on" or "operation enabled". Enabling begins only on the change of the target from disabled
//! to enabled: a drive that drops out by itself is never energised again by an unchanged target.
use crate::bring_up::brake::BrakeView;
use crate::bring_up::fault::BringUpFault;
use crate::codec::cia402_words::{
    CONTROL_ENABLE, CONTROL_FAULT_RESET, CONTROL_OFF, CONTROL_QUICK_STOP, CONTROL_SHUTDOWN,
    CONTROL_SWITCH_ON, DriveStep, STATUS_FOLLOWS,
};
use crate::servo::{DriveState, DriveTarget, Nanos};

/// Cycles for which 0 is sent before the rising edge of fault reset, so that a latched RPDO has surely passed.
const RESET_LOW_CYCLES: u8 = 3;
/// Time that an edge of fault reset has to act before the next one: some drives take the first one for the fault's
/// acknowledgement and the second for the reset.
const RESET_EDGE: Nanos = Nanos(250_000_000);
/// How often a drive may fall back on its way up while it has no torque: a supply that charges lets drives do so.
const FALLS_MAX: u8 = 2;
/// Answers in a row without "follows the target" that make a fault.
const NOT_FOLLOWING_MAX: u8 = 3;

/// The last feedback of the drive, and when it may be trusted.
#[derive(Clone, Copy, Debug)]
pub struct Received {
    /// Newest statusword.
    pub status: u16,
    /// The statusword is recent.
    pub fresh: bool,
    /// The command is close enough to the measured position to energise.
    pub command_near: bool,
    /// The drive has said that it is in the mode of its settings.
    pub in_mode: bool,
    /// It homes itself, and follows nothing.
    pub homes: bool,
    /// The brake that its master works.
    pub brake: BrakeView,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Not to be energised.
    Off,
    /// Climbing; since when at this rung, and how often it has fallen back.
    Enabling { since: Nanos, rung: u8, falls: u8 },
    /// Energised, following.
    On,
    /// Stepping down; since when at this rung.
    Disabling { since: Nanos, rung: u8 },
    /// Holding since before this master; kept as it is.
    Kept,
    /// From that hold to following; since when.
    TakingOver { since: Nanos },
}

/// Which target goes out beside the controlword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetSource {
    /// State of the drive.
    Measured,
    /// What it has held since before this master, or was commanded last.
    Held,
    /// The command.
    Command,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reset {
    Idle,
    /// Sending 0 before an edge; when the first edge came.
    Low {
        left: u8,
        began: Option<Nanos>,
    },
    /// Sending the edge until the fault is gone, or the next edge is due.
    High {
        since: Nanos,
        began: Nanos,
    },
}

/// The power state machine of one drive.
#[derive(Clone, Debug)]
pub struct Power {
    phase: Phase,
    reset: Reset,
    last_target: DriveTarget,
    fault: Option<BringUpFault>,
    not_following: u8,
    /// Cycles in which that many answers come.
    not_following_max: u8,
    step_timeout: Nanos,
    /// Controlword that lets an enabled drive follow setpoints.
    follow: u16,
}

/// How far towards operation enabled a state is.
fn rung(step: Option<DriveStep>) -> u8 {
    match step {
        Some(DriveStep::ReadyToSwitchOn) => 1,
        Some(DriveStep::SwitchedOn) => 2,
        Some(DriveStep::OperationEnabled) => 3,
        _ => 0,
    }
}

/// States in which a drive holds its load.
fn holds(step: Option<DriveStep>) -> bool {
    matches!(step, Some(DriveStep::OperationEnabled | DriveStep::QuickStopActive))
}

/// A drive that follows must keep its torque until its brake is closed.
fn holds_for_brake(step: Option<DriveStep>, brake: BrakeView) -> bool {
    step == Some(DriveStep::OperationEnabled) && !brake.closed
}

impl Power {
    /// De-energised; `step_timeout` bounds each confirmation, an answer comes every `answer_every` cycles, and `mode_bits` are set
    /// in the controlword of an enabled drive.
    #[must_use]
    pub const fn new(step_timeout: Nanos, answer_every: u8, mode_bits: u16) -> Self {
        Self {
            phase: Phase::Off,
            reset: Reset::Idle,
            last_target: DriveTarget::TorqueOff,
            fault: None,
            not_following: 0,
            not_following_max: NOT_FOLLOWING_MAX.saturating_mul(answer_every),
            step_timeout,
            follow: CONTROL_ENABLE | mode_bits,
        }
    }

    /// What the master found, until [`Self::clear`].
    #[must_use]
    pub const fn fault(&self) -> Option<BringUpFault> {
        self.fault
    }

    /// Energised, as it was asked to.
    pub(super) fn is_on(&self) -> bool {
        self.phase == Phase::On
    }

    /// Whether the brake is to be released, for a drive with this statusword; `None`: it is left as it is.
    pub(super) fn wants_brake_released(&self, status: u16, in_mode: bool) -> Option<bool> {
        let enabled = DriveStep::from_status(status) == Some(DriveStep::OperationEnabled);
        match self.phase {
            Phase::Enabling { .. } => Some(enabled && in_mode && status & STATUS_FOLLOWS != 0),
            Phase::On => Some(enabled),
            Phase::Off | Phase::Disabling { .. } => Some(false),
            Phase::Kept | Phase::TakingOver { .. } => None,
        }
    }

    /// A controlword is the one of a drive that follows.
    pub(super) const fn follows(&self, control: u16) -> bool {
        control == self.follow
    }

    /// Which target goes out.
    #[must_use]
    pub fn target_source(&self) -> TargetSource {
        match self.phase {
            Phase::Off => TargetSource::Measured,
            // One that steps down holds what it held, for as long as its brake takes to close: a drive that was kept has no command.
            Phase::Kept | Phase::Disabling { .. } => TargetSource::Held,
            Phase::Enabling { .. } | Phase::On | Phase::TakingOver { .. } => TargetSource::Command,
        }
    }

    /// Keeps a drive that was found holding.
    pub fn adopt(&mut self) {
        (self.phase, self.last_target) = (Phase::Kept, DriveTarget::Keep);
    }

    /// The controlword that changes nothing about a drive that holds.
    #[must_use]
    pub fn keeping(&self, status: u16) -> u16 {
        match DriveStep::from_status(status) {
            Some(DriveStep::OperationEnabled) => self.follow,
            Some(DriveStep::QuickStopActive) => CONTROL_QUICK_STOP,
            _ => CONTROL_OFF,
        }
    }

    /// Follows the target while the drive is not operational, so that an old change does not energise it later.
    pub fn watch(&mut self, drive_target: DriveTarget) {
        self.last_target = drive_target;
    }

    /// Takes a fault found elsewhere (heartbeat); the first one stays.
    pub fn note(&mut self, fault: BringUpFault) {
        self.fault.get_or_insert(fault);
    }

    /// Clears the fault and, when the drive is in fault, starts the reset sequence.
    pub fn clear(&mut self, status: u16) {
        self.fault = None;
        self.not_following = 0;
        if DriveStep::from_status(status) == Some(DriveStep::Fault) {
            self.reset = Reset::Low { left: RESET_LOW_CYCLES, began: None };
        }
    }

    /// The controlword for this cycle.
    ///
    /// Real time: arithmetic only.
    pub fn control(&mut self, now: Nanos, drive_target: DriveTarget, received: Received) -> u16 {
        let before = self.last_target;
        self.last_target = drive_target;
        let step = DriveStep::from_status(received.status);
        if drive_target == DriveTarget::TorqueOff {
            self.phase = Phase::Off;
            if before != DriveTarget::TorqueOff {
                self.reset = Reset::Idle;
                return CONTROL_OFF;
            }
        }
        match (before, drive_target, self.phase) {
            (DriveTarget::Keep, DriveTarget::Enabled, Phase::Kept) => {
                self.phase = Phase::TakingOver { since: now };
            }
            (DriveTarget::Disabled | DriveTarget::Keep, DriveTarget::Enabled, _) => {
                self.try_enable(now, step);
            }
            (_, DriveTarget::Keep, Phase::On | Phase::TakingOver { .. }) => self.phase = Phase::Kept,
            (_, DriveTarget::Keep, Phase::Enabling { .. }) => {
                self.phase = Phase::Disabling { since: now, rung: rung(step) };
            }
            _ => {}
        }
        self.advance(now, drive_target, step, received);
        match self.phase {
            Phase::Off => self.control_off(now, drive_target, step, received.brake),
            Phase::Enabling { .. } | Phase::On => self.control_up(step, received),
            Phase::Disabling { .. } if holds_for_brake(step, received.brake) => self.follow,
            Phase::Disabling { .. } => Self::control_down(step),
            Phase::Kept => self.keeping(received.status),
            Phase::TakingOver { .. } => self.follow,
        }
    }

    /// How the drive looks from outside.
    #[must_use]
    pub fn state(&self, status: u16) -> DriveState {
        let step = DriveStep::from_status(status);
        let faulty = matches!(step, Some(DriveStep::Fault | DriveStep::FaultReaction));
        let fault = self.fault.is_some_and(|fault| fault != BringUpFault::DroppedOut);
        match self.phase {
            _ if faulty => DriveState::Fault,
            // It holds, whatever the last try to take it over has found.
            Phase::Kept => DriveState::Adopted,
            _ if fault => DriveState::Fault,
            Phase::Enabling { .. } | Phase::TakingOver { .. } => DriveState::Enabling,
            Phase::On => DriveState::Enabled,
            Phase::Disabling { .. } => DriveState::Disabling,
            // A quick stop that holds is energised, without a request.
            Phase::Off if step == Some(DriveStep::QuickStopActive) => DriveState::Fault,
            Phase::Off if step == Some(DriveStep::OperationEnabled) => DriveState::Disabling,
            Phase::Off => DriveState::Disabled,
        }
    }

    fn try_enable(&mut self, now: Nanos, step: Option<DriveStep>) {
        let ready = matches!(
            step,
            Some(DriveStep::SwitchOnDisabled | DriveStep::ReadyToSwitchOn | DriveStep::SwitchedOn)
        );
        let untroubled = matches!(self.fault, None | Some(BringUpFault::DroppedOut));
        if self.phase == Phase::Off && self.reset == Reset::Idle && ready && untroubled {
            self.fault = None;
            self.not_following = 0;
            self.phase = Phase::Enabling { since: now, rung: rung(step), falls: 0 };
        }
    }

    fn advance(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        step: Option<DriveStep>,
        received: Received,
    ) {
        if drive_target == DriveTarget::Disabled
            && !matches!(self.phase, Phase::Off | Phase::Disabling { .. })
        {
            self.phase = Phase::Disabling { since: now, rung: rung(step) };
        }
        match self.phase {
            Phase::Off => {}
            Phase::Enabling { since, rung: reached, falls } => {
                self.advance_up(now, step, received, (since, reached, falls));
            }
            Phase::On => self.advance_on(step, received),
            Phase::Kept => self.advance_kept(step),
            Phase::TakingOver { since } => self.advance_taking_over(now, step, received, since),
            Phase::Disabling { since, rung: reached } => {
                let at = rung(step);
                if holds_for_brake(step, received.brake) {
                    if received.brake.failed {
                        // It keeps its torque: a joint that nothing holds would fall.
                        self.note(BringUpFault::BrakeNotClosed);
                    }
                    self.phase = Phase::Disabling { since: now, rung: at };
                } else if at == 0 || now.0.saturating_sub(since.0) >= self.step_timeout.0 {
                    // Reached, in fault, or it ignores the shutdown command: voltage off.
                    self.phase = Phase::Off;
                } else if at < reached {
                    self.phase = Phase::Disabling { since: now, rung: at };
                }
            }
        }
    }

    fn advance_up(&mut self, now: Nanos, step: Option<DriveStep>, received: Received, at: (Nanos, u8, u8)) {
        let (since, reached, falls) = at;
        let rung = rung(step);
        if step == Some(DriveStep::SwitchOnDisabled) && (1..=2).contains(&reached) && falls < FALLS_MAX {
            // Its time goes on: it may not climb and fall for ever.
            self.phase = Phase::Enabling { since, rung, falls: falls + 1 };
        } else if rung < reached || matches!(step, Some(DriveStep::Fault | DriveStep::FaultReaction)) {
            self.drop_out(step);
        } else if step == Some(DriveStep::SwitchedOn) && received.fresh && !received.command_near {
            self.note(BringUpFault::CommandFar);
            self.phase = Phase::Off;
        } else if rung == 3 && received.brake.failed {
            self.note(BringUpFault::BrakeNotReleased);
            self.phase = Phase::Disabling { since: now, rung };
        } else if rung == 3
            && received.in_mode
            && received.status & STATUS_FOLLOWS != 0
            && received.brake.released
        {
            self.phase = Phase::On;
        } else if rung > reached {
            self.phase = Phase::Enabling { since: now, rung, falls };
        } else if now.0.saturating_sub(since.0) >= self.step_timeout.0 {
            let wrong_mode = rung == 3 && !received.in_mode;
            self.note(if wrong_mode { BringUpFault::ModeNotTaken } else { BringUpFault::EnableTimeout });
            let braked = holds_for_brake(step, received.brake);
            self.phase = if braked { Phase::Disabling { since: now, rung } } else { Phase::Off };
        }
    }

    fn advance_on(&mut self, step: Option<DriveStep>, received: Received) {
        if step != Some(DriveStep::OperationEnabled) {
            self.drop_out(step);
        } else if received.homes || received.status & STATUS_FOLLOWS != 0 {
            self.not_following = 0;
        } else {
            self.not_following = self.not_following.saturating_add(1);
            if self.not_following >= self.not_following_max {
                // It stays energised: letting go of a drive that still holds would be worse.
                self.note(BringUpFault::NotFollowing);
            }
        }
    }

    fn advance_kept(&mut self, step: Option<DriveStep>) {
        if !holds(step) {
            self.drop_out(step);
        }
    }

    /// Whatever fails here, the drive continues to hold as it did.
    fn advance_taking_over(&mut self, now: Nanos, step: Option<DriveStep>, received: Received, since: Nanos) {
        if !holds(step) {
            self.drop_out(step);
        } else if !received.command_near {
            self.note(BringUpFault::CommandFar);
            self.phase = Phase::Kept;
        } else if step == Some(DriveStep::OperationEnabled)
            && received.in_mode
            && received.status & STATUS_FOLLOWS != 0
        {
            self.phase = Phase::On;
        } else if now.0.saturating_sub(since.0) >= self.step_timeout.0 {
            self.note(BringUpFault::EnableTimeout);
            self.phase = Phase::Kept;
        }
    }

    fn drop_out(&mut self, step: Option<DriveStep>) {
        self.phase = Phase::Off;
        match step {
            Some(DriveStep::QuickStopActive) => self.note(BringUpFault::QuickStopped),
            // The drive says what it has; its emergency code tells more than we could.
            Some(DriveStep::Fault | DriveStep::FaultReaction) => {}
            _ => self.note(BringUpFault::DroppedOut),
        }
    }

    fn control_off(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        step: Option<DriveStep>,
        brake: BrakeView,
    ) -> u16 {
        match self.reset {
            Reset::Low { left: 0, began } => {
                self.reset = Reset::High { since: now, began: began.unwrap_or(now) };
            }
            Reset::Low { left, began } => self.reset = Reset::Low { left: left - 1, began },
            Reset::High { since, began } => {
                let passed = |then: Nanos| now.0.saturating_sub(then.0);
                if step != Some(DriveStep::Fault) || passed(began) >= self.step_timeout.0 {
                    self.reset = Reset::Idle;
                } else if passed(since) >= RESET_EDGE.0 {
                    self.reset = Reset::Low { left: RESET_LOW_CYCLES, began: Some(began) };
                }
            }
            Reset::Idle => {}
        }
        if matches!(self.reset, Reset::High { .. }) {
            CONTROL_FAULT_RESET
        } else if step == Some(DriveStep::QuickStopActive)
            && (drive_target == DriveTarget::Enabled
                || drive_target != DriveTarget::TorqueOff && !brake.closed && !brake.failed)
        {
            // It may be holding a load: keep it in quick stop until the target changes, and its brake is closed.
            CONTROL_QUICK_STOP
        } else {
            CONTROL_OFF
        }
    }

    fn control_up(&self, step: Option<DriveStep>, received: Received) -> u16 {
        match step {
            Some(DriveStep::SwitchOnDisabled) => CONTROL_SHUTDOWN,
            // The step into torque needs a recent word of the drive; staying in it does not: a drive without feedback that
            // still receives must be able to follow the arm to rest.
            Some(DriveStep::SwitchedOn) if received.fresh => CONTROL_ENABLE,
            Some(DriveStep::ReadyToSwitchOn | DriveStep::SwitchedOn) => CONTROL_SWITCH_ON,
            Some(DriveStep::OperationEnabled) => self.follow,
            _ => CONTROL_OFF,
        }
    }

    fn control_down(step: Option<DriveStep>) -> u16 {
        match step {
            Some(DriveStep::OperationEnabled) => CONTROL_SWITCH_ON,
            Some(DriveStep::SwitchedOn) => CONTROL_SHUTDOWN,
            _ => CONTROL_OFF,
        }
    }
}
