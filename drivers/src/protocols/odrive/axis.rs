//! One `ODrive` axis from silence to following setpoints.
//!
//! The drive sends its heartbeat and its encoder estimates by itself. First it is only received: one that is energised
//! before this master has configured it is left as it is. Then hardware and firmware are compared with the settings, its
//! velocity limit and its watchdog where the settings know their endpoints, and once more before every energising. While it
//! follows, a cycle has one frame for it. All times are on the driver's stall-free clock, which does not advance while the
//! master itself is stalled.
mod power;
mod steps;

use super::fault::{OdriveFault, counted, error_code, object};
use super::frames::{
    Command, ERROR_WATCHDOG, EndpointValue, InputPosition, Message, STATE_CLOSED_LOOP, STATE_IDLE, Version,
};
use super::sim::Endpoints;
use crate::bring_up::timing::{BringUpCycle, Timeouts};
use crate::servo::{DriveState, DriveTarget, Nanos};

/// How long the bus is received before anything is sent: a foreign master shows itself in this time.
const OBSERVE_MIN: Nanos = Nanos(100_000_000);
/// Without estimates for so long, or without heartbeats for so long and four of their periods, the drive is gone.
const NO_REPLY: Nanos = Nanos(350_000_000);
/// A question, or a command that was not confirmed, is repeated after this.
const REPEAT: Nanos = Nanos(50_000_000);
/// From firmware 0.6.11 a write is confirmed: what is read back comes later than that.
const SETTLE: Nanos = Nanos(100_000_000);

/// State of the bring-up.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Receiving, sending nothing.
    Observe { since: Nanos },
    /// Found energised; watched, left alone.
    Unowned,
    /// At this step of the list.
    Step { at: usize, since: Nanos, enabling: bool },
    /// Configured, not energised.
    Ready,
    /// Closed loop was requested, then, and is waited for.
    Enable { since: Nanos, requested: Nanos },
    /// Energised; following.
    On,
    /// Idle is requested until the drive says so.
    Disable { since: Nanos },
    /// Without torque, or not as it was left; waits for the drive target to be disabled.
    Gone,
    /// What it states does not fit the settings.
    Refused { fault: OdriveFault, numbers: [f64; 2] },
}

/// How the drive's watchdog comes to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Watchdog {
    /// It is written and read back.
    Written {
        /// Timeout.
        timeout_s: f32,
        /// Where.
        endpoints: Endpoints,
    },
    /// The owner has set it with the maker's tool; nothing of it is read.
    Owner,
}

/// What the settings say of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisPlan {
    /// Product line, version and variant.
    pub hardware: [u8; 3],
    /// Major, minor and revision.
    pub firmware: [u8; 3],
    /// Its watchdog.
    pub watchdog: Watchdog,
    /// Greatest speed of the joint, at the motor.
    pub speed_turns_s: f64,
    /// Period of its heartbeat.
    pub heartbeat: Nanos,
}

/// A setpoint, at the motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTarget {
    /// Turns.
    pub position_turns: f64,
    /// Turns per second.
    pub velocity_turns_s: f64,
    /// Nm of the motor.
    pub torque_nm: f64,
}

/// What the drive says of itself every so often.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Heartbeat {
    errors: u32,
    state: u8,
    at: Nanos,
}

/// What the encoder says.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimates {
    position_turns: f32,
    velocity_turns_s: f32,
    at: Nanos,
}

/// Frames of one cycle for a drive.
pub type CycleFrames = [Option<Command>; 4];

/// The master's image of one drive.
#[derive(Clone, Debug)]
pub struct Axis {
    plan: AxisPlan,
    timeouts: Timeouts,
    near_turns: f64,
    stage: Stage,
    last_target: DriveTarget,
    fault: Option<OdriveFault>,
    lost_master: bool,
    heartbeat: Option<Heartbeat>,
    estimates: Option<Estimates>,
    version: Option<Version>,
    answer: Option<(u16, EndpointValue)>,
    /// When to repeat what was sent last.
    next: Nanos,
    /// The value of this step was written then.
    written: Option<Nanos>,
    clearing: Option<Nanos>,
    sent: InputPosition,
}

impl Axis {
    /// A drive of which nothing is known. Energised only when its command is within `near_turns` of where it stands.
    #[must_use]
    pub const fn new(plan: AxisPlan, timeouts: Timeouts, near_turns: f64) -> Self {
        Self {
            plan,
            timeouts,
            near_turns,
            stage: Stage::Observe { since: Nanos(0) },
            last_target: DriveTarget::TorqueOff,
            fault: None,
            lost_master: false,
            heartbeat: None,
            estimates: None,
            version: None,
            answer: None,
            next: Nanos(0),
            written: None,
            clearing: None,
            sent: InputPosition { position_turns: 0.0, velocity_mturns_s: 0, torque_mnm: 0 },
        }
    }

    /// Position in turns and velocity in turns per second; `None` before the first that were numbers.
    #[must_use]
    pub fn measured(&self) -> Option<(f64, f64)> {
        let estimates = self.estimates?;
        Some((f64::from(estimates.position_turns), f64::from(estimates.velocity_turns_s)))
    }

    /// State of the axis.
    #[must_use]
    pub fn status_word(&self) -> u32 {
        self.heartbeat.map_or(0, |heartbeat| u32::from(heartbeat.state))
    }

    /// Its watchdog disarmed it while it was in use.
    #[must_use]
    pub const fn lost_master(&self) -> bool {
        self.lost_master
    }

    /// Where the drive is.
    #[must_use]
    pub fn state(&self) -> DriveState {
        match self.stage {
            Stage::Observe { .. }
                if self.heartbeat.is_none() || self.fault == Some(OdriveFault::NoAnswer) =>
            {
                DriveState::Absent
            }
            Stage::Observe { .. } | Stage::Step { enabling: false, .. } => DriveState::Configuring,
            Stage::Unowned => DriveState::EnergisedUnowned,
            Stage::Refused { .. } => DriveState::Refused,
            Stage::Gone => DriveState::Fault,
            _ if self.fault.is_some() || self.errors() != 0 => DriveState::Fault,
            Stage::Ready => DriveState::Disabled,
            Stage::Step { .. } | Stage::Enable { .. } => DriveState::Enabling,
            Stage::On => DriveState::Enabled,
            Stage::Disable { .. } => DriveState::Disabling,
        }
    }

    /// The code to report, the object that it concerns and its two numbers.
    #[must_use]
    pub fn error(&self) -> (u32, u32, [f64; 2]) {
        let plain = |code: u32| (code, 0, [0.0; 2]);
        match (self.stage, error_code(self.errors()), self.fault) {
            (Stage::Refused { fault, numbers }, ..) => (fault.code(), object(fault), numbers),
            (Stage::Unowned, ..) => plain(OdriveFault::Unowned.code()),
            (_, Some(code), _) => plain(code),
            // What disarmed it says more than that it was disarmed.
            (_, None, Some(OdriveFault::DroppedOut)) if self.lost_master => {
                plain(error_code(ERROR_WATCHDOG).unwrap_or(0))
            }
            (_, None, Some(fault)) => plain(fault.code()),
            (_, None, None) => plain(0),
        }
    }

    /// Takes what the drive sends. True when it was a position.
    ///
    /// Real time: arithmetic only.
    pub fn take(&mut self, now: Nanos, message: Message) -> bool {
        match message {
            Message::Heartbeat { errors, state, .. } => {
                self.heartbeat = Some(Heartbeat { errors, state, at: now });
            }
            Message::Estimates { position_turns, velocity_turns_s } => {
                // A drive without calibration sends what is no number: as good as nothing.
                if position_turns.is_finite() && velocity_turns_s.is_finite() {
                    self.estimates = Some(Estimates { position_turns, velocity_turns_s, at: now });
                    return true;
                }
            }
            Message::Version(version) => self.version = Some(version),
            Message::Endpoint(endpoint, Some(value)) => self.answer = Some((endpoint, value)),
            Message::Endpoint(_, None) | Message::Error { .. } => {}
        }
        false
    }

    /// Clears findings, clears errors of the drive, and tries a refused drive again from the start.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self, now: Nanos) {
        match self.stage {
            Stage::Refused { .. } => self.observe(now, None),
            Stage::Ready => {
                (self.fault, self.lost_master) = (None, false);
                (self.clearing, self.next) = ((self.errors() != 0).then_some(now), now);
            }
            Stage::On => self.fault = None,
            Stage::Observe { .. }
            | Stage::Unowned
            | Stage::Step { .. }
            | Stage::Enable { .. }
            | Stage::Disable { .. }
            | Stage::Gone => {}
        }
    }

    /// Clears everything that is known of it, as at start.
    ///
    /// Real time: no allocation.
    pub fn start_over(&mut self, now: Nanos) {
        self.forget();
        self.lost_master = false;
        self.observe(now, None);
    }

    /// This cycle's frames to the drive; a setpoint is the first.
    ///
    /// Real time: no allocation, bounded work.
    pub fn cycle(&mut self, cycle: BringUpCycle, target: Option<AxisTarget>) -> CycleFrames {
        let before = std::mem::replace(&mut self.last_target, cycle.drive_target);
        if cycle.drive_target == DriveTarget::TorqueOff && before != DriveTarget::TorqueOff {
            return only(Some(self.torque_off(cycle.now)));
        }
        let rises = cycle.drive_target == DriveTarget::Enabled
            && matches!(before, DriveTarget::Disabled | DriveTarget::Keep);
        let wanted = cycle.drive_target == DriveTarget::Enabled;
        match self.stage {
            Stage::Observe { since } => only(self.observing(cycle, since)),
            Stage::Unowned => only(self.unowned(cycle)),
            Stage::Step { enabling: true, .. } | Stage::Enable { .. } if !wanted => {
                only(Some(self.disable(cycle.now)))
            }
            Stage::Step { at, since, enabling } => self.stepping(cycle.now, (at, since, enabling), target),
            Stage::Ready => only(self.ready(cycle.now, rises)),
            Stage::Enable { since, requested } => self.enabling(cycle.now, (since, requested), target),
            Stage::On => only(self.following(cycle, target)),
            Stage::Disable { since } => only(self.disabling(cycle.now, since)),
            Stage::Gone => only(self.gone(cycle)),
            Stage::Refused { .. } => only(None),
        }
    }

    fn go(&mut self, fault: OdriveFault) {
        self.clearing = None;
        (self.fault, self.stage) = (Some(fault), Stage::Gone);
    }

    /// Back to the start, where nothing is changed before the drive has been looked at.
    fn observe(&mut self, now: Nanos, fault: Option<OdriveFault>) {
        (self.fault, self.clearing) = (fault, None);
        self.stage = Stage::Observe { since: now };
    }

    fn forget(&mut self) {
        (self.heartbeat, self.estimates, self.version, self.answer) = (None, None, None, None);
    }

    /// This command, when it is due again.
    fn again(&mut self, now: Nanos, command: Command) -> Option<Command> {
        (now >= self.next).then(|| {
            self.next = later(now, REPEAT);
            command
        })
    }

    /// In any state but idle it may carry torque: it calibrates or searches.
    fn is_energised(&self) -> bool {
        self.heartbeat.is_some_and(|heartbeat| heartbeat.state > STATE_IDLE)
    }
    fn is_following(&self) -> bool {
        self.heartbeat.is_some_and(|heartbeat| heartbeat.state == STATE_CLOSED_LOOP)
    }
    fn errors(&self) -> u32 {
        self.heartbeat.map_or(0, |heartbeat| counted(heartbeat.errors, heartbeat.state <= STATE_IDLE))
    }
    /// Heartbeat and estimates have come lately.
    fn is_heard(&self, now: Nanos) -> bool {
        let beats = NO_REPLY.0.max(self.plan.heartbeat.0.saturating_mul(4));
        self.heartbeat.is_some_and(|heartbeat| age(now, heartbeat.at) < beats)
            && self.estimates.is_some_and(|estimates| age(now, estimates.at) < NO_REPLY.0)
    }
}

const fn only(command: Option<Command>) -> CycleFrames {
    [command, None, None, None]
}

const fn age(now: Nanos, then: Nanos) -> u64 {
    now.0.saturating_sub(then.0)
}

const fn later(now: Nanos, by: Nanos) -> Nanos {
    Nanos(now.0.saturating_add(by.0))
}
