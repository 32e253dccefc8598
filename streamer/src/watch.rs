//! Supervision of what the drives answer: state, age of feedback, jumps, tracking error, rest.
//!
//! A setpoint of cycle N is sent behind SYNC N, applied at SYNC N+1 and interpolated up to SYNC N+2; the position
//! that cycle M receives was sampled at SYNC M-1. So a measured position is compared with the command of two cycles
//! ago ([`TRANSPORT_CYCLES`]): what is left is the drive's own following error, not the bus's delay. A drive that gets
//! a setpoint every k cycles interpolates over k, and lags by k - 1 more, whenever it is due.
use crate::cycle_state::{BUSES_MAX, BusState, Cause, CycleState, LostSetpoints};
use taustream_arm::Settings;
use taustream_arm::settings::{SETPOINT_EVERY_MAX, Supervision};
use taustream_drivers::{DriveState, Nanos, ServoStatus};
use taustream_messages::{BusFault, FaultReason};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Cycles from a command to the measured position that answers it.
pub const TRANSPORT_CYCLES: usize = 2;
/// Commands that are remembered: enough for the slowest setpoints that settings may ask for.
const COMMANDS: usize = TRANSPORT_CYCLES + SETPOINT_EVERY_MAX as usize;
/// Cycles over which speed is measured to tell rest: long enough for coarse encoders.
const REST_CYCLES: usize = 32;
/// Most that one cycle adds to the time in which the loop ran: a wake-up that is late by more is a stall.
const ATTENDED_PERIODS_MAX: f64 = 2.0;
/// Speed below which a joint rests.
pub const REST_RAD_S: f64 = 0.05;

/// One joint's answers.
#[derive(Clone, Copy, Debug)]
struct Answers {
    received: Option<Nanos>,
    /// [`Watch::attended_s`] when it was received.
    attended_s: f64,
    position_rad: f64,
    jump_rad: f64,
    jump_limit_rad: f64,
    tracking_rad: f64,
    tracking_rad_max: f64,
    /// The command less the measured position that answers it.
    lag_rad: f64,
    /// Cycles in a row in which the drive sent its position.
    commanded_cycles: u32,
    past_rad: [f64; REST_CYCLES],
    past_at: [Nanos; REST_CYCLES],
}

impl Answers {
    const NONE: Self = Self {
        received: None,
        attended_s: 0.0,
        position_rad: f64::NAN,
        jump_rad: 0.0,
        jump_limit_rad: f64::INFINITY,
        tracking_rad: 0.0,
        tracking_rad_max: 0.0,
        lag_rad: f64::NAN,
        commanded_cycles: 0,
        past_rad: [f64::NAN; REST_CYCLES],
        past_at: [Nanos(0); REST_CYCLES],
    };
}

/// What the drives of all joints have answered lately.
#[derive(Debug)]
pub struct Watch {
    rules: Supervision,
    /// Tracking error that stops the arm, by slot.
    tracking_rad_max: JointArray,
    /// Joints and axes.
    joints: usize,
    velocity_rad_s_max: JointArray,
    period_s: f64,
    /// Index of each joint's bus.
    bus_of: [usize; MAX_JOINTS],
    /// Cycles from a command to the measured position that answers it, by joint.
    transport_cycles: [usize; MAX_JOINTS],
    commands_rad: [JointArray; COMMANDS],
    answers: [Answers; MAX_JOINTS],
    slot: usize,
    /// When the last cycle woke.
    wake_time: Option<Nanos>,
    /// Time in which the loop ran. Drives answer SYNC: while none is sent, missing feedback is no fault of theirs.
    attended_s: f64,
}

impl Watch {
    /// No feedback yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        Self {
            rules: Supervision { lost_cycles_max: settings.lost_cycles_max(), ..settings.supervision },
            tracking_rad_max: std::array::from_fn(|slot| settings.tracking_error_rad_max(slot)),
            joints: settings.slots(),
            velocity_rad_s_max: settings.slot_limits().map(|l| l.stop.velocity_rad_s),
            period_s: f64::from(settings.cycle.period_us) * 1e-6,
            bus_of: bus_of(settings),
            transport_cycles: transport_cycles(settings),
            commands_rad: [[0.0; MAX_JOINTS]; COMMANDS],
            answers: [Answers::NONE; MAX_JOINTS],
            slot: 0,
            wake_time: None,
            attended_s: 0.0,
        }
    }

    /// Takes in what this cycle has sent and received.
    ///
    /// Real time: no allocation.
    pub fn observe(&mut self, cycle_state: &CycleState) {
        if cycle_state.setpoints_sent() {
            self.commands_rad.rotate_right(1);
            self.commands_rad[0] = cycle_state.commanded_rad;
        }
        let elapsed_s = self.wake_time.map_or(0.0, |wake_time| cycle_state.tick.wake_time.since_s(wake_time));
        self.wake_time = Some(cycle_state.tick.wake_time);
        self.attended_s += elapsed_s.min(ATTENDED_PERIODS_MAX * self.period_s);
        self.slot = (self.slot + 1) % REST_CYCLES;
        let joints = self.answers.iter_mut().zip(&cycle_state.servos).zip(&self.transport_cycles);
        for (joint, (((answer, servo), transport_cycles), speed_max)) in
            joints.zip(&self.velocity_rad_s_max).enumerate().take(self.joints)
        {
            let command = self.commands_rad.get(*transport_cycles);
            let command_rad = command.and_then(|pose| pose.get(joint)).copied().unwrap_or(f64::NAN);
            answer.past_rad[self.slot] = servo.position_rad;
            let sent = servo.state.reports() && servo.position_rad.is_finite();
            answer.commanded_cycles = if sent { answer.commanded_cycles.saturating_add(1) } else { 0 };
            answer.past_at[self.slot] = cycle_state.tick.wake_time;
            let Some(received) = servo.received else { continue };
            if answer.received == Some(received) {
                continue;
            }
            if let Some(before) = answer.received {
                // A joint may move on while answers are missing; more than that is a jump.
                let missed_s = (received.since_s(before) - self.period_s).max(0.0);
                answer.jump_rad = (servo.position_rad - answer.position_rad).abs();
                answer.jump_limit_rad = self.rules.position_jump_rad_max + missed_s * speed_max;
            }
            (answer.received, answer.position_rad) = (Some(received), servo.position_rad);
            answer.attended_s = self.attended_s;
            answer.lag_rad = command_rad - servo.position_rad;
            answer.tracking_rad = answer.lag_rad.abs();
            if cycle_state.live {
                answer.tracking_rad_max = answer.tracking_rad_max.max(answer.tracking_rad);
            }
        }
    }

    /// Begins again at a pose that has become the commanded one.
    ///
    /// Real time: copies.
    pub fn restart(&mut self, pose_rad: &JointArray) {
        self.commands_rad = [*pose_rad; COMMANDS];
        for answer in &mut self.answers {
            (answer.jump_rad, answer.tracking_rad, answer.tracking_rad_max) = (0.0, 0.0, 0.0);
        }
    }

    /// The first reason to stop energised drives: whole bus first, then joint by joint. `enabling` lets drives be
    /// on their way.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn find_cause(&self, cycle_state: &CycleState, enabling: bool) -> Option<Cause> {
        self.find_cause_beside(cycle_state, enabling, None)
    }

    /// The same, of every joint but one.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub(crate) fn find_cause_beside(
        &self,
        cycle_state: &CycleState,
        enabling: bool,
        beside: Option<usize>,
    ) -> Option<Cause> {
        self.bus_cause(cycle_state).or_else(|| {
            (0..self.joints).filter(|joint| Some(*joint) != beside).find_map(|joint| {
                let cause =
                    drive_cause(cycle_state, joint, enabling).or_else(|| self.feedback_cause(joint))?;
                Some(self.blame_receive_path(cycle_state, cause))
            })
        })
    }

    /// A bus that does not carry setpoints any more, or may soon not.
    #[must_use]
    pub fn bus_cause(&self, cycle_state: &CycleState) -> Option<Cause> {
        cycle_state.failed_bus().map(|(bus, bus_fault)| self.failed(cycle_state, bus, bus_fault)).or_else(
            || {
                let found = |test: fn(&BusState) -> bool| cycle_state.buses.iter().position(test);
                let passive = found(|b| b.passive).map(|bus| (bus, BusFault::ErrorPassive));
                let commanded = |(bus, found): (usize, &BusState)| Some((bus, found.other_master?));
                if let Some((bus, id)) = cycle_state.buses.iter().enumerate().find_map(commanded) {
                    return Some(Cause::bus(bus, BusFault::OtherMaster, f64::from(id.raw()), 0.0));
                }
                if let Some(lost) = cycle_state.lost {
                    return Some(self.lost_cause(lost));
                }
                let (bus, bus_fault) =
                    passive.or_else(|| found(|b| b.unread).map(|bus| (bus, BusFault::ReceiveBehind)))?;
                Some(self.failed(cycle_state, bus, bus_fault))
            },
        )
    }

    /// The kernel did not take the setpoints of a joint.
    fn lost_cause(&self, lost: LostSetpoints) -> Cause {
        let bus = self.bus_of.get(lost.joint).copied().unwrap_or(BUSES_MAX);
        let (value, limit) = (f64::from(lost.count), lost.tolerated.map_or(0.0, f64::from));
        Cause { joint: Some(lost.joint), ..Cause::bus(bus, BusFault::SetpointsLost, value, limit) }
    }

    /// Feedback that is late from all joints of a bus whose frames this computer reads too late is no fault of the
    /// drives or of the bus.
    fn blame_receive_path(&self, cycle_state: &CycleState, cause: Cause) -> Cause {
        let late = |joint: usize| self.no_feedback_s(joint) > 0.5 * cause.limit;
        let bus = cause.joint.and_then(|joint| self.bus_of.get(joint)).copied().unwrap_or(BUSES_MAX);
        let all_late = || self.bus_of.iter().take(self.joints).enumerate().all(|(j, b)| *b != bus || late(j));
        let behind = cycle_state.buses.get(bus).is_some_and(|found| found.receive_behind);
        if cause.reason != FaultReason::FeedbackLate || !behind || !all_late() {
            return cause;
        }
        Cause { joint: cause.joint, ..Cause::bus(bus, BusFault::ReceiveBehind, cause.value, cause.limit) }
    }

    /// For how long nothing was heard of a joint while the loop ran, s.
    fn no_feedback_s(&self, joint: usize) -> f64 {
        let answer = self.answers.get(joint).filter(|answer| answer.received.is_some());
        answer.map_or(f64::INFINITY, |answer| self.attended_s - answer.attended_s)
    }

    /// The cause that a failed bus is, with what was counted.
    fn failed(&self, cycle_state: &CycleState, bus: usize, bus_fault: BusFault) -> Cause {
        let found = cycle_state.buses.get(bus).copied().unwrap_or_default();
        let limit = f64::from(self.rules.lost_cycles_max);
        match bus_fault {
            BusFault::QueueFull | BusFault::System => {
                Cause::bus(bus, bus_fault, f64::from(found.consecutive_lost), limit)
            }
            BusFault::Unconfirmed | BusFault::ReceiveBehind => {
                Cause::bus(bus, bus_fault, f64::from(found.in_flight), 0.0)
            }
            BusFault::Down
            | BusFault::Gone
            | BusFault::BusOff
            | BusFault::Restarted
            | BusFault::SetpointsLost
            | BusFault::OtherMaster
            | BusFault::ErrorPassive => Cause::bus(bus, bus_fault, 0.0, 0.0),
        }
    }

    /// Feedback of one joint that is late, jumps, or is far from its command.
    #[must_use]
    pub fn feedback_cause(&self, joint: usize) -> Option<Cause> {
        let answer = self.answers.get(joint)?;
        let rules = &self.rules;
        let checks = [
            (FaultReason::FeedbackLate, self.no_feedback_s(joint), rules.feedback_age_s_max),
            (FaultReason::PositionJump, answer.jump_rad, answer.jump_limit_rad),
            (FaultReason::TrackingError, answer.tracking_rad, self.tracking_limit_rad(joint)),
        ];
        // A value that is not a number is beyond every limit.
        let found = checks.into_iter().find(|(_, value, limit)| value.is_nan() || value > limit);
        found.map(|(reason, value, limit)| Cause::new(reason).at_joint(joint).amount(value, limit))
    }

    /// Feedback of one joint that is late or jumps; for a drive that follows no commands of ours.
    #[must_use]
    pub(crate) fn late_cause(&self, cycle_state: &CycleState, joint: usize) -> Option<Cause> {
        let cause = self.feedback_cause(joint).filter(|cause| cause.reason != FaultReason::TrackingError)?;
        Some(self.blame_receive_path(cycle_state, cause))
    }

    /// What stops a drive that homes itself: its own state, or that it sends no feedback. Its position may jump where it
    /// finds its zero, and follows no command.
    #[must_use]
    pub(crate) fn homing_cause(
        &self,
        cycle_state: &CycleState,
        joint: usize,
        enabling: bool,
    ) -> Option<Cause> {
        let homes = cycle_state.servos.get(joint).is_some_and(|servo| servo.state == DriveState::Homing);
        let warns = |servo: &ServoStatus| {
            let warning = Cause::new(FaultReason::DriveWarning).at_joint(joint).code(servo.status_word);
            servo.warning.then_some(warning)
        };
        let state = if homes {
            cycle_state.servos.get(joint).and_then(warns)
        } else {
            drive_cause(cycle_state, joint, enabling)
        };
        let late = || {
            let (age_s, limit_s) = (self.no_feedback_s(joint), self.rules.feedback_age_s_max);
            let cause = Cause::new(FaultReason::FeedbackLate).at_joint(joint).amount(age_s, limit_s);
            (age_s.is_nan() || age_s > limit_s).then(|| self.blame_receive_path(cycle_state, cause))
        };
        state.or_else(late)
    }

    /// Why a drive is not where it should be.
    #[must_use]
    pub(crate) fn drive_cause(&self, cycle_state: &CycleState, joint: usize) -> Option<Cause> {
        drive_cause(cycle_state, joint, false)
    }

    /// Age of a joint's newest feedback, s; infinite before the first.
    #[must_use]
    pub fn age_s(&self, cycle_state: &CycleState, joint: usize) -> f64 {
        let received = self.answers.get(joint).and_then(|a| a.received);
        received.map_or(f64::INFINITY, |at| cycle_state.tick.wake_time.since_s(at))
    }

    /// The fastest joint and its speed over the last cycles, rad/s. `None` while one of the joints has given feedback for too
    /// short a time to tell: after bring-up, and again after its drive was configured again.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn fastest(&self) -> Option<(usize, f64)> {
        let oldest = (self.slot + 1) % REST_CYCLES;
        let mut worst = (0, 0.0);
        for (joint, answer) in self.answers.iter().enumerate().take(self.joints) {
            let time_s = answer.past_at[self.slot].since_s(answer.past_at[oldest]);
            let moved_rad = (answer.past_rad[self.slot] - answer.past_rad[oldest]).abs();
            let speed = moved_rad / time_s;
            if (answer.commanded_cycles as usize) < REST_CYCLES || !speed.is_finite() {
                return None;
            }
            if speed > worst.1 {
                worst = (joint, speed);
            }
        }
        Some(worst)
    }

    /// True when every joint is known to rest.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        self.fastest().is_some_and(|(_, speed_rad_s)| speed_rad_s <= REST_RAD_S)
    }

    /// Tracking error that stops the arm.
    #[must_use]
    pub(crate) fn tracking_limit_rad(&self, joint: usize) -> f64 {
        self.tracking_rad_max.get(joint).copied().unwrap_or(0.0)
    }

    /// The command of a slot less the measured position that answers it; NaN before the first.
    #[must_use]
    pub(crate) fn lag_rad(&self, joint: usize) -> f64 {
        self.answers.get(joint).map_or(f64::NAN, |answer| answer.lag_rad)
    }

    /// Tracking error of every joint now, and the largest since the last restart, rad.
    #[must_use]
    pub fn tracking_rad(&self) -> (JointArray, JointArray) {
        (self.answers.map(|a| a.tracking_rad), self.answers.map(|a| a.tracking_rad_max))
    }
}

/// Index of each joint's bus.
fn bus_of(settings: &Settings) -> [usize; MAX_JOINTS] {
    let mut buses = [BUSES_MAX; MAX_JOINTS];
    for servo in &settings.servos {
        if let Some(slot) = buses.get_mut(servo.joint) {
            *slot = servo.bus;
        }
    }
    buses
}

/// Cycles from a command to the position that answers it, by joint.
fn transport_cycles(settings: &Settings) -> [usize; MAX_JOINTS] {
    let mut cycles = [TRANSPORT_CYCLES; MAX_JOINTS];
    for servo in &settings.servos {
        let every = settings.buses.get(servo.bus).map_or(1, |bus| bus.traffic.setpoint_every);
        if let Some(slot) = cycles.get_mut(servo.joint) {
            *slot = TRANSPORT_CYCLES + every.clamp(1, SETPOINT_EVERY_MAX) as usize - 1;
        }
    }
    cycles
}

/// A drive that is not where it should be, or that warns.
fn drive_cause(cycle_state: &CycleState, joint: usize, enabling: bool) -> Option<Cause> {
    let servo = cycle_state.servos.get(joint)?;
    let cause = |reason, code| Cause::new(reason).at_joint(joint).code(code);
    let fault = cause(FaultReason::DriveFault, servo.error_code).amount(f64::from(servo.status_word), 0.0);
    let dropped = cause(FaultReason::DriveDropped, servo.status_word);
    let warning = cause(FaultReason::DriveWarning, servo.status_word);
    match servo.state {
        DriveState::Fault => Some(fault),
        // Being adopted, until it fails.
        DriveState::Adopted if enabling => (servo.error_code != 0).then_some(fault),
        // A warning is the drive's last word before it drops out: the arm stops while it still can.
        DriveState::Enabled => servo.warning.then_some(warning),
        DriveState::Disabled | DriveState::Enabling => (!enabling).then_some(dropped),
        DriveState::Absent
        | DriveState::Configuring
        | DriveState::EnergisedUnowned
        | DriveState::Adopted
        | DriveState::Homing
        | DriveState::Disabling
        | DriveState::Refused => Some(dropped),
    }
}
