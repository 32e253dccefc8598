//! One motor from silence to following commands.
//!
//! First it is only asked for feedback: a motor that is energised before this master has configured it is left as it is.
//! Then its parameters are compared with the settings, mode and watchdog written, and both looked at once more before
//! every energising. Parameters are never asked for while it follows commands.
//! All times are on the driver's stall-free clock, which does not advance while the master itself is stalled.
mod configuration;
mod power;

use super::{AnsweringMotor, Ask, MotorFault, MotorFeedback, Outbox, PowerWord, Reply};
use crate::bring_up::timing::{BringUpCycle, Timeouts};
use crate::codec::mit::MitState;
use crate::frame::CanFrame;
use crate::servo::{DriveState, DriveTarget, Nanos};

/// Pause between two looks at a motor that is waited for.
const OBSERVE_AGAIN: Nanos = Nanos(100_000_000);
/// How long the bus is listened to before anything is written: a foreign master shows itself in this time.
const OBSERVE_MIN: Nanos = Nanos(100_000_000);
/// An answer that has not come by then was lost; it is requested again.
const REQUEST_AGAIN: Nanos = Nanos(20_000_000);
/// A special command is repeated after this, until the motor's status shows it.
const REPEAT: Nanos = Nanos(20_000_000);
/// What a change of mode takes (Damiao's library).
const SETTLE: Nanos = Nanos(100_000_000);
/// Writes without a confirmation that are repeated before a value that differs is refused.
const SEND_AGAIN_MAX: u8 = 10;
/// Without feedback for so long, at one request a cycle, the motor is gone.
const NO_REPLY: Nanos = Nanos(350_000_000);

/// State of the bring-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MotorStage {
    /// Asking for feedback, changing nothing.
    Observe { since: Nanos },
    /// Found energised; watched, left alone.
    Unowned,
    /// At this job of [`AnsweringMotor::configure`].
    Configure { job: usize, since: Nanos },
    /// Configured, not energised.
    Ready,
    /// At this job of [`AnsweringMotor::verify`], on the way to energised.
    Verify { job: usize, since: Nanos },
    /// Waiting for a fresh position.
    Arm { since: Nanos },
    /// The enable command is sent until the motor says that it is energised.
    Enable { since: Nanos, next: Nanos },
    /// Energised; gains rise.
    Ramp { since: Nanos },
    /// Energised; following.
    On,
    /// The disable command is sent until the motor says that it is not energised.
    Disable { since: Nanos },
    /// Without torque, or not as it was left; waits for the drive target to be disabled.
    Gone,
    /// A parameter does not fit.
    Refused { code: u32, object: u32 },
}

const NOT_MEASURED: MitState = MotorFeedback::NONE.state;

/// The command for a motor in this cycle, motor side.
#[derive(Clone, Copy, Debug)]
pub struct MotorTarget {
    /// Wanted angle.
    pub position_rad: f64,
    /// Wanted velocity.
    pub velocity_rad_s: f64,
    /// Torque on top.
    pub torque_nm: f64,
}

/// The master's image of one motor.
#[derive(Clone, Debug)]
pub struct Machine<M> {
    motor: M,
    timeouts: Timeouts,
    near_rad: f64,
    stage: MotorStage,
    last_target: DriveTarget,
    fault: Option<MotorFault>,
    /// What was asked last and not answered yet.
    requested: Option<Ask>,
    requested_at: Nanos,
    /// The newest parameter that was answered.
    answer: Option<[u8; 4]>,
    /// A feedback has come since this was looked at.
    looked: bool,
    received: bool,
    feedback: MotorFeedback,
    measured: MitState,
    measured_at: Nanos,
    /// Clearing an error since, and when to repeat it.
    clearing: Option<(Nanos, Nanos)>,
    set_zero: bool,
    sent_again: u8,
    sent_rad: f64,
}

impl<M: AnsweringMotor> Machine<M> {
    /// A motor of which nothing is known. Energised only when its command is within `near_rad` of where it stands.
    #[must_use]
    pub const fn new(motor: M, timeouts: Timeouts, near_rad: f64) -> Self {
        Self {
            motor,
            timeouts,
            near_rad,
            stage: MotorStage::Observe { since: Nanos(0) },
            last_target: DriveTarget::TorqueOff,
            fault: None,
            requested: None,
            requested_at: Nanos(0),
            answer: None,
            looked: false,
            received: false,
            feedback: MotorFeedback::NONE,
            measured: NOT_MEASURED,
            measured_at: Nanos(0),
            clearing: None,
            set_zero: false,
            sent_again: 0,
            sent_rad: 0.0,
        }
    }

    /// What it measured last, motor side; not numbers before the first feedback.
    #[must_use]
    pub const fn measured(&self) -> MitState {
        self.measured
    }

    /// Its states, as its protocol packs them.
    #[must_use]
    pub const fn status_word(&self) -> u32 {
        self.feedback.status_word
    }

    /// It warns.
    #[must_use]
    pub const fn warning(&self) -> bool {
        self.feedback.warning
    }

    /// It disabled itself because no command came for longer than its watchdog.
    #[must_use]
    pub const fn lost_master(&self) -> bool {
        self.received && self.feedback.lost_master
    }

    /// True for a frame by which a master speaks to this motor.
    #[must_use]
    pub fn is_to(&self, frame: &CanFrame) -> bool {
        self.motor.is_to(frame)
    }

    /// Where the motor is.
    #[must_use]
    pub fn state(&self) -> DriveState {
        let faulty = self.fault.is_some();
        match self.stage {
            MotorStage::Observe { .. } if !self.received => DriveState::Absent,
            MotorStage::Observe { .. } | MotorStage::Configure { .. } => DriveState::Configuring,
            MotorStage::Unowned => DriveState::EnergisedUnowned,
            MotorStage::Refused { .. } => DriveState::Refused,
            MotorStage::Gone => DriveState::Fault,
            _ if faulty || self.in_error() => DriveState::Fault,
            // Who is configured reports where it stands.
            MotorStage::Ready if self.measured.position_rad.is_nan() => DriveState::Configuring,
            MotorStage::Ready => DriveState::Disabled,
            MotorStage::Verify { .. }
            | MotorStage::Arm { .. }
            | MotorStage::Enable { .. }
            | MotorStage::Ramp { .. } => DriveState::Enabling,
            MotorStage::On => DriveState::Enabled,
            MotorStage::Disable { .. } => DriveState::Disabling,
        }
    }

    /// The code to report, and the parameter that it concerns.
    #[must_use]
    pub fn error(&self) -> (u32, u32) {
        match (self.stage, self.fault) {
            (MotorStage::Refused { code, object }, _) => (code, object),
            // Its target and gains came in frames: no parameter tells what it holds, so no hold can be adopted.
            (MotorStage::Unowned, _) => (MotorFault::Unowned.code(M::CODES), 0),
            _ if self.received && self.in_error() => {
                (u32::from(M::CODES) << 16 | u32::from(self.feedback.error), 0)
            }
            (_, Some(fault)) => (fault.code(M::CODES), 0),
            (_, None) => (0, 0),
        }
    }

    /// Takes a frame; none when it is not this motor's, true when it was a feedback whose scale is known.
    ///
    /// Real time: arithmetic only.
    pub fn take(&mut self, now: Nanos, frame: &CanFrame) -> Option<bool> {
        let reply = self.motor.decode(frame)?;
        self.received = true;
        let feedback = match reply {
            Reply::Feedback(feedback) => feedback,
            Reply::Value { parameter, written, value } => {
                let awaited = match self.requested {
                    Some(Ask::Read(requested)) => requested == parameter && !written,
                    Some(Ask::Write(requested, _)) => requested == parameter && written,
                    _ => false,
                };
                if awaited {
                    (self.answer, self.requested) = (Some(value), None);
                }
                return Some(false);
            }
            Reply::Noted => return Some(false),
        };
        (self.feedback, self.looked) = (feedback, true);
        if self.requested == Some(Ask::Refresh) {
            self.requested = None;
        }
        // Its scale is unknown before the ranges were read, and not every reply tells an angle.
        let known = feedback.state.position_rad.is_finite()
            && !matches!(
                self.stage,
                MotorStage::Observe { .. }
                    | MotorStage::Unowned
                    | MotorStage::Configure { .. }
                    | MotorStage::Refused { .. }
            );
        if known {
            (self.measured, self.measured_at) = (feedback.state, now);
        }
        Some(known)
    }

    /// Clears findings, clears an error of the motor, and tries a refused motor again from the start.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self, now: Nanos) {
        match self.stage {
            MotorStage::Refused { .. } => self.observe(now, None),
            MotorStage::Ready if self.in_error() => self.clearing = Some((now, now)),
            MotorStage::Ready | MotorStage::On | MotorStage::Ramp { .. } => self.fault = None,
            MotorStage::Observe { .. }
            | MotorStage::Unowned
            | MotorStage::Configure { .. }
            | MotorStage::Verify { .. }
            | MotorStage::Arm { .. }
            | MotorStage::Enable { .. }
            | MotorStage::Disable { .. }
            | MotorStage::Gone => {}
        }
    }

    /// Clears everything that is known of it, as at start.
    ///
    /// Real time: no allocation.
    pub fn start_over(&mut self, now: Nanos) {
        self.observe(now, None);
        self.motor.forget();
        (self.received, self.feedback, self.measured) = (false, MotorFeedback::NONE, NOT_MEASURED);
    }

    /// Makes the angle where it stands its zero, in the next cycle; false unless it is configured and not energised.
    pub fn set_zero(&mut self) -> bool {
        let able = self.motor.sets_zero()
            && self.stage == MotorStage::Ready
            && !self.in_error()
            && self.last_target == DriveTarget::Disabled;
        self.set_zero |= able;
        able
    }

    /// This cycle's request to the motor: one at most.
    ///
    /// Real time: no allocation, bounded work.
    pub fn request(&mut self, cycle: BringUpCycle, target: Option<MotorTarget>, out: &mut Outbox<'_>) {
        if let Some(ask) = self.ask(cycle, target) {
            self.motor.encode(ask, out);
        }
    }

    fn ask(&mut self, cycle: BringUpCycle, target: Option<MotorTarget>) -> Option<Ask> {
        let before = std::mem::replace(&mut self.last_target, cycle.drive_target);
        if cycle.drive_target == DriveTarget::TorqueOff && before != DriveTarget::TorqueOff {
            return self.torque_off(cycle.now);
        }
        let rises = cycle.drive_target == DriveTarget::Enabled
            && matches!(before, DriveTarget::Disabled | DriveTarget::Keep);
        let looked = std::mem::take(&mut self.looked);
        let status = looked.then_some(self.feedback.power);
        match self.stage {
            MotorStage::Observe { since } => self.observing(cycle, since, status),
            MotorStage::Unowned => self.unowned(cycle, status),
            MotorStage::Configure { job, since } => self.configuring(cycle.now, status, (job, since)),
            MotorStage::Ready => self.ready(cycle.now, status, rises),
            MotorStage::Verify { .. } | MotorStage::Arm { .. } | MotorStage::Enable { .. }
                if cycle.drive_target != DriveTarget::Enabled =>
            {
                self.disable(cycle.now)
            }
            MotorStage::Verify { job, since } => self.verifying(cycle.now, (job, since)),
            MotorStage::Arm { since } => self.arming(cycle.now, target, since),
            MotorStage::Enable { since, next } => self.enabling(cycle.now, status, target, (since, next)),
            MotorStage::Ramp { .. } | MotorStage::On => self.following(cycle, status, target),
            MotorStage::Disable { since } => self.disabling(cycle.now, status, since),
            MotorStage::Gone => self.gone(cycle),
            MotorStage::Refused { .. } => None,
        }
    }

    fn go(&mut self, fault: MotorFault) -> Option<Ask> {
        (self.requested, self.answer, self.clearing) = (None, None, None);
        self.fault = Some(fault);
        self.stage = MotorStage::Gone;
        Some(Ask::Refresh)
    }

    /// Back to the start, where nothing is changed before the motor has been looked at.
    fn observe(&mut self, now: Nanos, fault: Option<MotorFault>) {
        (self.requested, self.answer, self.clearing) = (None, None, None);
        (self.fault, self.set_zero, self.looked, self.sent_again) = (fault, false, false, 0);
        self.stage = MotorStage::Observe { since: now };
    }

    fn look(&mut self, now: Nanos) -> Option<Ask> {
        let due = self.requested_at == Nanos(0) || age(now, self.requested_at) >= OBSERVE_AGAIN.0;
        due.then(|| self.send_request(now, Ask::Refresh))
    }

    fn send_request(&mut self, now: Nanos, request: Ask) -> Ask {
        (self.requested, self.requested_at) = (Some(request), now);
        request
    }

    const fn in_error(&self) -> bool {
        matches!(self.feedback.power, PowerWord::Error)
    }
}

const fn age(now: Nanos, then: Nanos) -> u64 {
    now.0.saturating_sub(then.0)
}
