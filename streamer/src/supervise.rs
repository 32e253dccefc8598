//! The supervisor: converts the state of one cycle into events, and events into the next phase by the table of `phases`.
//!
//! It is the only owner of the phase. What it decides steers the next cycle: the target of the drives, how the
//! speed along the path changes, whether the trajectory is dropped. Nothing resumes by itself after a fault. While
//! drives hold, the commanded pose stays the truth: measured replaces commanded only when every drive is off.
use crate::answer::{AnswerReason, CommandAnswer};
use crate::axes::AxisRequests;
use crate::cycle_state::{Braking, Cause, CycleState, Decision, TRANSITIONS_MAX, Transition};
use crate::homing::{HomingRun, homing_joints};
use crate::intake::{Answers, Shutdown};
use crate::phases::{self, Event};
use crate::record_first::{LEAVE_RECORD_S_MAX, Records};
use crate::referencing::Referencing;
use crate::stall::Stalls;
use crate::watch::Watch;
use taustream_arm::settings::Supervision;
use taustream_arm::{Axis, Settings};
use taustream_drivers::{DriveState, DriveTarget, JointSet, Nanos, ServoStatus};
use taustream_messages::{FaultReason, Pause, PauseReason, Phase};
use taustream_motion::stopping::{SpeedRequest, StopRules};
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS};

/// Highest speed override of a motion that begins outside the position limits.
const INWARDS_SPEED_MAX: f64 = 0.25;
/// How long leaving orderly may take after the longest stop of the arm: the drives' time-out, the record and a margin, s.
const SHUTDOWN_AT_REST_S_MAX: f64 = 10.0;
/// How long torque off is repeated before leaving at once, s.
const SHUTDOWN_AT_ONCE_S: f64 = 0.05;

/// What the evaluation of one cycle requires of the other stages.
#[derive(Clone, Copy, Debug, Default)]
pub struct Actions {
    /// How the speed along the path changes.
    pub speed: Option<SpeedRequest>,
    /// The trajectory is dropped and the last pose held.
    pub drop_trajectory: bool,
    /// This pose becomes the commanded one.
    pub pose_rad: Option<JointArray>,
    /// The faults of the drives are being reset.
    pub clear_faults: bool,
    /// What is asked of the axes beside the path.
    pub axes: AxisRequests,
    /// Failed buses are restarted, as this command asked.
    pub restore_buses: Option<u64>,
    /// The changes of phase, in order.
    pub transitions: [Option<Transition>; TRANSITIONS_MAX],
    /// The cycle ends after this one; true: orderly.
    pub shutdown: Option<bool>,
}

/// The arm's phase and everything that decides it.
#[derive(Debug)]
pub struct Supervisor {
    pub(crate) rules: Supervision,
    pub(crate) limits: [JointLimits; MAX_JOINTS],
    /// Joints of the path.
    pub(crate) joints: usize,
    /// Joints and axes.
    slots: usize,
    /// Axes beside the path.
    pub(crate) axes: Vec<Axis>,
    pub(crate) watch: Watch,
    pub(crate) phase: Phase,
    since: Nanos,
    cause: Option<Cause>,
    /// In fault: the drives hold instead of being off.
    pub(crate) holds: bool,
    /// Drives are kept that were found holding at start.
    pub(crate) adopted: bool,
    pub(crate) referencing: Referencing,
    /// Joints whose drives are set up to home themselves.
    pub(crate) homing_joints: JointSet,
    /// In the phase of homing: what was asked for.
    pub(crate) homing: Option<HomingRun>,
    pub(crate) torque_off: bool,
    pub(crate) speed: f64,
    /// The commanded pose, or the start of the motion that runs, is outside the position limits.
    pub(crate) outside: bool,
    /// The speed was set since the start.
    pub(crate) speed_chosen: bool,
    /// Each enable begins at the first speed: a joint falls when commands stop.
    pub(crate) begins_slowly: bool,
    pub(crate) stalls: Stalls,
    /// Why the arm is paused, or about to be.
    paused_by: Option<Pause>,
    pub(crate) resetting_since: Option<Nanos>,
    /// Failed buses are being restarted, for this `clear-fault`.
    pub(crate) restoring: Option<u64>,
    pub(crate) shutting_down: Shutdown,
    shutdown_since: Nanos,
    shutdown_s_max: f64,
    pub(crate) records: Records,
}

impl Supervisor {
    /// A supervisor of an arm of which nothing is known.
    #[must_use]
    pub(crate) fn new(settings: &Settings, records: Records) -> Self {
        let limits = settings.robot.limits();
        let joints = settings.robot.joints.len();
        let rules = &settings.supervision;
        Self {
            rules: *rules,
            limits,
            joints,
            slots: settings.slots().min(MAX_JOINTS),
            axes: settings.axes.clone(),
            watch: Watch::new(settings),
            phase: Phase::Configuring,
            since: Nanos(0),
            cause: None,
            holds: false,
            adopted: false,
            referencing: Referencing::new(settings),
            homing_joints: homing_joints(settings),
            homing: None,
            torque_off: false,
            speed_chosen: false,
            begins_slowly: settings.servos.iter().any(|servo| servo.limp_risk_acknowledged),
            outside: false,
            speed: (rules.first_speed_percent / 100.0).clamp(0.0, 1.0),
            stalls: Stalls::new(&settings.cycle),
            paused_by: None,
            resetting_since: None,
            restoring: None,
            shutting_down: Shutdown::No,
            shutdown_since: Nanos(0),
            shutdown_s_max: StopRules::new(&limits, joints).longest_stop_s() + SHUTDOWN_AT_REST_S_MAX,
            records,
        }
    }

    /// The referencing of the joints.
    #[must_use]
    pub fn referencing(&self) -> &Referencing {
        &self.referencing
    }
    pub(crate) fn referencing_mut(&mut self) -> &mut Referencing {
        &mut self.referencing
    }
    /// Drives are kept that were found holding at start.
    #[must_use]
    pub fn has_adopted(&self) -> bool {
        self.adopted
    }
    /// The speed override is still that of the start, and reduced.
    #[must_use]
    pub fn is_first_speed(&self) -> bool {
        !self.speed_chosen && self.speed < 1.0
    }
    /// The phase.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }
    /// The fault, if there is one.
    #[must_use]
    pub fn cause(&self) -> Option<Cause> {
        self.cause
    }
    /// Why the arm is paused, or about to be.
    #[must_use]
    pub fn paused_by(&self) -> Option<Pause> {
        self.paused_by
    }
    /// The speed override, 0 to 1: what was chosen, and no more than [`Self::inwards_speed`] from outside the limits.
    #[must_use]
    pub fn speed(&self) -> f64 {
        if self.outside { self.speed.min(self.inwards_speed()) } else { self.speed }
    }
    /// The speed override of a motion that begins outside the position limits.
    #[must_use]
    pub fn inwards_speed(&self) -> f64 {
        (self.rules.first_speed_percent / 100.0).clamp(0.0, INWARDS_SPEED_MAX)
    }
    /// What is known of the feedback.
    #[must_use]
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// What the drives should be.
    #[must_use]
    pub fn drive_target(&self) -> DriveTarget {
        if self.torque_off {
            return DriveTarget::TorqueOff;
        }
        match self.phase {
            Phase::Configuring | Phase::Disabled | Phase::Disabling => DriveTarget::Disabled,
            Phase::Fault if !self.holds => DriveTarget::Disabled,
            Phase::Fault | Phase::Locked if self.adopted => DriveTarget::Keep,
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Homing
            | Phase::Fault
            | Phase::Locked => DriveTarget::Enabled,
        }
    }

    /// Evaluates one cycle: its state first, then its commands, then leaving. `answers` takes the commands' answers.
    ///
    /// Real time: bounded work, no allocation.
    pub fn evaluate(
        &mut self,
        cycle_state: &CycleState,
        shutdown: Shutdown,
        answers: &mut Answers,
    ) -> Actions {
        let mut actions = Actions::default();
        self.watch.observe(cycle_state);
        self.note_outside(cycle_state);
        self.evaluate_motion(cycle_state, &mut actions);
        self.evaluate_stall(cycle_state, &mut actions);
        self.evaluate_drives(cycle_state, &mut actions);
        let [answers @ .., restored, recorded] = answers;
        *restored = self.evaluate_restored(cycle_state, &mut actions);
        *recorded = self.settle_record(cycle_state, &mut actions);
        for (pending, answer) in cycle_state.commands.iter().zip(answers) {
            *answer = pending.and_then(|pending| self.command(pending, cycle_state, &mut actions));
        }
        self.evaluate_shutdown(shutdown, cycle_state, &mut actions);
        self.release_record(cycle_state);
        self.follow_homing(cycle_state, &mut actions);
        self.follow_measured(cycle_state, &mut actions);
        actions
    }

    /// A motion that begins outside counts as outside until it ends.
    fn note_outside(&mut self, cycle_state: &CycleState) {
        let runs = matches!(
            self.phase,
            Phase::Moving
                | Phase::Pausing
                | Phase::Paused
                | Phase::Stopping
                | Phase::FastStopping
                | Phase::Braking
        );
        if !runs {
            self.outside = self.first_outside(&cycle_state.commanded_rad).is_some();
        }
    }

    /// The first joint of a pose that is outside its range by more than the tolerance.
    pub(crate) fn first_outside(&self, pose_rad: &JointArray) -> Option<usize> {
        let mut joints = self.limits.iter().zip(pose_rad).take(self.joints);
        joints.position(|(limits, position_rad)| !limits.is_inside(*position_rad))
    }

    /// Applies an event to the table, and what every entry into a phase brings with it.
    pub(crate) fn step(&mut self, event: Event, cycle_state: &CycleState, actions: &mut Actions) -> bool {
        let Some(to) = phases::next(self.phase, event) else { return false };
        let transition =
            Transition { tick: cycle_state.tick.number, from: self.phase, to, event, cause: self.cause };
        if let Some(slot) = actions.transitions.iter_mut().find(|slot| slot.is_none()) {
            *slot = Some(transition);
        }
        (self.phase, self.since) = (to, cycle_state.tick.wake_time);
        if event == Event::StalledLong {
            self.paused_by = Some(Pause { reason: PauseReason::Stall, gap_s: self.stalls.gap_s() });
        } else if event == Event::PauseRequested {
            self.paused_by = Some(Pause { reason: PauseReason::Operator, gap_s: 0.0 });
        } else if to != Phase::Paused {
            self.paused_by = None;
        }
        if to != Phase::Homing {
            self.homing = None;
        }
        // Drives that follow commands, or are de-energised, are no longer kept.
        self.adopted &= !matches!(to, Phase::Holding | Phase::Disabling | Phase::Disabled);
        match to {
            Phase::Holding | Phase::Fault | Phase::Disabling | Phase::Locked => {
                actions.drop_trajectory = true;
            }
            Phase::Stopping | Phase::Pausing => {
                actions.speed = Some(SpeedRequest::Stop);
                self.stalls.release();
            }
            Phase::FastStopping => {
                actions.speed = Some(SpeedRequest::FastStop);
                self.stalls.release();
            }
            Phase::Configuring
            | Phase::Disabled
            | Phase::Enabling
            | Phase::Moving
            | Phase::Paused
            | Phase::Homing
            | Phase::Braking => {}
        }
        true
    }

    pub(crate) fn raise(
        &mut self,
        event: Event,
        cause: Cause,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) {
        let cause = self.stalls.blame(cause, cycle_state);
        // Drives that were on their way to energised go back; drives that carry the arm hold.
        let requested = matches!(self.drive_target(), DriveTarget::Enabled | DriveTarget::Keep);
        let rising = self.phase == Phase::Enabling
            || (self.phase == Phase::Homing && self.homing.is_some_and(|run| !run.energised));
        let holds = requested && (!rising || self.adopted);
        let before = self.cause.replace(cause);
        if phases::next(self.phase, event).is_none() {
            self.cause = before;
            return;
        }
        self.holds = holds && event != Event::HardFault;
        self.adopted &= self.holds;
        self.step(event, cycle_state, actions);
    }

    fn evaluate_motion(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        if cycle_state.trajectory_result.is_some_and(|v| matches!(v.decision, Decision::Accepted { .. })) {
            self.stalls.release();
            self.step(Event::Accepted, cycle_state, actions);
        }
        if let Some(trip) = cycle_state.trip {
            let cause = Cause::new(FaultReason::Guard).at_joint(trip.joint).amount(trip.value, trip.limit);
            // In a fast stop the first cause stays the one to report.
            let cause = if self.phase == Phase::FastStopping { self.cause.unwrap_or(cause) } else { cause };
            self.raise(Event::GuardTrip, cause, cycle_state, actions);
        }
        if let Some(trip) = cycle_state.axis_trip {
            let cause = Cause::new(FaultReason::Guard).at_joint(trip.joint).amount(trip.value, trip.limit);
            self.raise(Event::StopFault, cause, cycle_state, actions);
        }
        if self.phase == Phase::Braking {
            if cycle_state.braking == Braking::Rested {
                self.step(Event::AtRest, cycle_state, actions);
            }
        } else if cycle_state.end_reached {
            self.step(Event::EndReached, cycle_state, actions);
        } else if cycle_state.at_rest {
            self.step(Event::AtRest, cycle_state, actions);
        }
    }

    /// Failed buses are back, or not: the `clear-fault` that asked for it continues, or was refused in the service
    /// thread's own words.
    fn evaluate_restored(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Option<CommandAnswer> {
        let restored = cycle_state.restored?;
        self.restoring = None;
        if !restored.recovered || self.phase != Phase::Fault {
            return None;
        }
        self.clear(Event::ClearedOff, cycle_state, actions);
        let (sequence, phase) = (restored.sequence, self.phase);
        Some(CommandAnswer { sequence, accepted: true, phase, why: AnswerReason::BusRestored })
    }

    fn evaluate_drives(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        self.complete_cause(cycle_state);
        // Buses that just came back are evaluated from the next cycle on.
        let failed = cycle_state.failed_bus().is_some() && cycle_state.restored.is_none();
        match self.phase {
            Phase::Configuring | Phase::Disabled | Phase::Disabling if failed => {
                if let Some(cause) = self.watch.bus_cause(cycle_state) {
                    self.raise(Event::HardFault, cause, cycle_state, actions);
                }
            }
            Phase::Configuring | Phase::Disabled => self.evaluate_bring_up(cycle_state, actions),
            Phase::Disabling => {
                if self.all(cycle_state, |s| s.state == DriveState::Disabled) {
                    self.step(Event::DrivesDisabled, cycle_state, actions);
                } else if let Some(cause) = self.overdue(cycle_state, |s| s.state == DriveState::Disabled) {
                    self.raise(Event::HardFault, cause, cycle_state, actions);
                }
            }
            Phase::Fault => self.evaluate_fault(cycle_state, actions),
            Phase::Locked if self.adopted => self.evaluate_adopted(cycle_state, actions),
            Phase::Homing => self.evaluate_homing(cycle_state, actions),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::Locked => {
                let enabling = self.phase == Phase::Enabling;
                let enabled = |s: &ServoStatus| s.state == DriveState::Enabled;
                if let Some(cause) = self.watch.find_cause(cycle_state, enabling) {
                    self.raise(Event::StopFault, cause, cycle_state, actions);
                } else if enabling && self.all(cycle_state, enabled) {
                    self.step(Event::DrivesEnabled, cycle_state, actions);
                } else if let Some(cause) = self.overdue(cycle_state, enabled).filter(|_| enabling) {
                    self.raise(Event::StopFault, cause, cycle_state, actions);
                }
            }
            // The arm is on its way to rest already; nothing that drives say changes how.
            Phase::FastStopping | Phase::Braking => {}
        }
    }

    fn evaluate_bring_up(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        let bad = self.servos(cycle_state).find_map(|(joint, servo)| {
            let reason = match servo.state {
                DriveState::Refused => FaultReason::ConfigurationRefused,
                DriveState::EnergisedUnowned => FaultReason::EnergisedUnowned,
                DriveState::Fault => return self.watch.drive_cause(cycle_state, joint),
                DriveState::Absent
                | DriveState::Configuring
                | DriveState::Disabled
                | DriveState::Adopted
                | DriveState::Enabling
                | DriveState::Enabled
                | DriveState::Homing
                | DriveState::Disabling => return None,
            };
            let [stated, expected] = servo.refused_numbers;
            let cause = Cause::new(reason).at_joint(joint).code(servo.error_code).amount(stated, expected);
            Some(Cause { object: servo.refused_object, ..cause })
        });
        if let Some(cause) = bad {
            self.raise(Event::HardFault, cause, cycle_state, actions);
        } else if self.all(cycle_state, |s| matches!(s.state, DriveState::Disabled | DriveState::Adopted))
            && self.servos(cycle_state).any(|(_, s)| s.state == DriveState::Adopted)
        {
            self.adopted = true;
            self.step(Event::HoldAdopted, cycle_state, actions);
        } else if self.all(cycle_state, |s| s.state == DriveState::Disabled) && self.watch.fastest().is_some()
        {
            // Ready to be energised includes that rest can be distinguished from motion: the first `enable` is not refused for it.
            self.step(Event::DrivesReady, cycle_state, actions);
        } else {
            self.step(Event::DrivesLost, cycle_state, actions);
        }
    }

    /// Drives that hold from before: each is either kept or off, and those that are kept answer and stay.
    fn evaluate_adopted(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        let without_feedback = |this: &Self, joint| this.watch.age_s(cycle_state, joint).is_infinite();
        let lost = self.servos(cycle_state).find_map(|(joint, servo)| match servo.state {
            DriveState::Disabled => None,
            // Its process data is only being begun.
            DriveState::Adopted if without_feedback(self, joint) => None,
            DriveState::Adopted => {
                let sag_rad = (servo.position_rad - servo.hold_position_rad).abs();
                let limit = self.watch.tracking_limit_rad(joint);
                let far = Cause::new(FaultReason::TrackingError).at_joint(joint).amount(sag_rad, limit);
                let late = self.watch.late_cause(cycle_state, joint);
                late.or_else(|| (sag_rad.is_nan() || sag_rad > limit).then_some(far))
            }
            DriveState::Absent
            | DriveState::Configuring
            | DriveState::EnergisedUnowned
            | DriveState::Enabling
            | DriveState::Enabled
            | DriveState::Homing
            | DriveState::Disabling
            | DriveState::Fault
            | DriveState::Refused => self.watch.drive_cause(cycle_state, joint),
        });
        let begun = |s: &ServoStatus| s.state != DriveState::Adopted || s.received.is_some();
        let overdue = || self.overdue(cycle_state, begun).filter(|_| !self.all(cycle_state, begun));
        let cause = self.watch.bus_cause(cycle_state).or(lost).or_else(overdue);
        if let Some(cause) = cause {
            self.raise(Event::StopFault, cause, cycle_state, actions);
        }
    }

    /// A drive's code may come after its statusword: by its emergency message, or when it is asked.
    fn complete_cause(&mut self, cycle_state: &CycleState) {
        let Some(cause) = &mut self.cause else { return };
        let servo = cause.joint.and_then(|joint| cycle_state.servos.get(joint));
        if let Some(servo) = servo
            && cause.reason == FaultReason::DriveFault
            && cause.code == 0
        {
            cause.code = servo.error_code;
        }
    }

    fn evaluate_fault(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        // Drives that have all dropped out do not come back by themselves.
        if self.holds && self.energised(cycle_state).is_none() {
            (self.holds, self.adopted) = (false, false);
        }
        let Some(since) = self.resetting_since else { return };
        let faulty = |s: &ServoStatus| matches!(s.state, DriveState::Fault | DriveState::Refused);
        if self.servos(cycle_state).any(|(_, s)| faulty(s)) {
            if cycle_state.tick.wake_time.since_s(since) > self.rules.drive_timeout_s {
                self.resetting_since = None;
            }
        } else {
            self.clear(Event::ClearedOff, cycle_state, actions);
        }
    }

    pub(crate) fn clear(&mut self, event: Event, cycle_state: &CycleState, actions: &mut Actions) {
        self.resetting_since = None;
        (self.cause, self.torque_off, self.holds) = (None, false, false);
        self.step(event, cycle_state, actions);
    }

    /// While nothing is energised, the commanded pose is the measured one, so that enabling moves nothing.
    fn follow_measured(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        if self.drive_target() == DriveTarget::Enabled || actions.pose_rad.is_some() {
            return;
        }
        let mut pose_rad = cycle_state.commanded_rad;
        for (joint, servo) in self.servos(cycle_state) {
            if cycle_state.unreachable[joint] {
                // What was measured there is old.
                continue;
            }
            // What holds keeps its own target: following a sag would creep.
            let at_rad = if servo.hold_position_rad.is_finite() {
                servo.hold_position_rad
            } else {
                servo.position_rad
            };
            if at_rad.is_finite() {
                pose_rad[joint] = at_rad;
            }
        }
        actions.pose_rad = Some(pose_rad);
    }

    fn evaluate_shutdown(&mut self, shutdown: Shutdown, cycle_state: &CycleState, actions: &mut Actions) {
        if shutdown > self.shutting_down {
            (self.shutting_down, self.shutdown_since) = (shutdown, cycle_state.tick.wake_time);
        }
        let time_s = cycle_state.tick.wake_time.since_s(self.shutdown_since);
        match self.shutting_down {
            Shutdown::No => {}
            Shutdown::AtOnce => {
                self.switch_off(cycle_state, actions);
                if time_s > SHUTDOWN_AT_ONCE_S {
                    actions.shutdown = Some(false);
                }
            }
            Shutdown::Orderly => {
                actions.axes.stop_all = true;
                let axes_move = cycle_state.axes_moving.contains(&true);
                match self.phase {
                    Phase::Moving | Phase::Pausing | Phase::Paused => {
                        self.step(Event::StopRequested, cycle_state, actions);
                    }
                    Phase::Holding if axes_move => {}
                    Phase::Holding | Phase::Locked | Phase::Enabling => {
                        self.step(Event::DisableRequested, cycle_state, actions);
                    }
                    Phase::Fault => (self.holds, self.adopted) = (false, false),
                    Phase::Homing => {
                        self.stop_homing(cycle_state);
                    }
                    Phase::Configuring
                    | Phase::Disabled
                    | Phase::Stopping
                    | Phase::FastStopping
                    | Phase::Braking
                    | Phase::Disabling => {}
                }
                let off = matches!(self.phase, Phase::Configuring | Phase::Disabled | Phase::Fault);
                let recorded = self.records.is_rest_recorded()
                    || cycle_state.tick.wake_time.since_s(self.since.max(self.shutdown_since))
                        > LEAVE_RECORD_S_MAX;
                if off && self.energised(cycle_state).is_none() && recorded {
                    actions.shutdown = Some(true);
                } else if time_s > self.shutdown_s_max {
                    actions.shutdown = Some(false);
                }
            }
        }
    }

    pub(crate) fn switch_off(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        self.torque_off = true;
        (self.holds, self.adopted) = (false, false);
        self.resetting_since = None;
        let pending = Cause::new(FaultReason::TorqueOff);
        // A fault that stopped the arm before stays the one to report.
        let cause = self.cause.unwrap_or(pending);
        self.raise(Event::HardFault, cause, cycle_state, actions);
    }

    pub(crate) fn servos<'a>(
        &self,
        cycle_state: &'a CycleState,
    ) -> impl Iterator<Item = (usize, &'a ServoStatus)> + use<'a> {
        cycle_state.servos.iter().enumerate().take(self.slots)
    }

    pub(crate) fn all(&self, cycle_state: &CycleState, test: impl Fn(&ServoStatus) -> bool) -> bool {
        self.servos(cycle_state).all(|(_, servo)| test(servo))
    }

    pub(crate) fn first_not(&self, cycle_state: &CycleState, state: DriveState) -> Option<AnswerReason> {
        // A drive that says what is wrong with it comes before one that is only not ready yet.
        let not = |s: &ServoStatus| s.state != state;
        let telling = self.servos(cycle_state).filter(|(_, s)| not(s) && s.error_code != 0);
        let mut others = telling.chain(self.servos(cycle_state).filter(|(_, s)| not(s)));
        others.next().map(|(joint, s)| AnswerReason::NotConfigured {
            joint,
            state: s.state,
            refusal: s.refusal(),
        })
    }

    /// The first drive that carries torque, or did at its last feedback.
    pub(crate) fn energised(&self, cycle_state: &CycleState) -> Option<(usize, DriveState)> {
        self.servos(cycle_state).find(|(_, s)| is_energised(s.state)).map(|(joint, s)| (joint, s.state))
    }

    fn overdue(&self, cycle_state: &CycleState, done: impl Fn(&ServoStatus) -> bool) -> Option<Cause> {
        let limit = self.rules.drive_timeout_s;
        if cycle_state.tick.wake_time.since_s(self.since) <= limit {
            return None;
        }
        let joint = self.servos(cycle_state).find(|(_, s)| !done(s)).map(|(joint, _)| joint);
        Some(Cause { joint, ..Cause::new(FaultReason::BringUp).amount(limit, limit) })
    }
}

/// The drive carries torque.
pub(crate) fn is_energised(state: DriveState) -> bool {
    matches!(
        state,
        DriveState::Enabled
            | DriveState::Enabling
            | DriveState::Homing
            | DriveState::Disabling
            | DriveState::Adopted
            | DriveState::EnergisedUnowned
    )
}
