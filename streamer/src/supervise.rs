//! The supervisor: turns one cycle's facts into events, and events into the next phase by the table of `phases`.
//!
//! It is the only owner of the phase. What it decides steers the next cycle: what the drives are wished to be, how the
//! speed along the path changes, whether the trajectory is dropped. Nothing resumes by itself after a fault. While
//! drives hold, the commanded pose stays the truth: measured replaces commanded only when every drive is off.
use crate::facts::{Braking, Cause, Decision, Facts, TRANSITIONS_MAX, Transition};
use crate::intake::{Answers, Leave};
use crate::phases::{self, Event};
use crate::track::ScaleOrder;
use crate::turns::Turns;
use crate::watch::Watch;
use crate::words::{Answer, Why};
use taustream_arm::Settings;
use taustream_arm::settings::Supervision;
use taustream_drivers::{DriveState, DriveWish, Nanos, ServoStatus};
use taustream_messages::{FaultReason, Phase};
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS};

/// How long the drives may take to come to rest after a stall before the arm stays paused, s.
const STALL_REST_S: f64 = 1.0;
/// How long leaving orderly may take: the longest ramp, the drives' time-out and a margin, s.
const LEAVE_S_MAX: f64 = 10.0;
/// How long torque off is repeated before leaving at once, s.
const LEAVE_AT_ONCE_S: f64 = 0.05;

/// What one cycle's judgement asks of the other stages.
#[derive(Clone, Copy, Debug, Default)]
pub struct Orders {
    /// How the speed along the path changes.
    pub speed: Option<ScaleOrder>,
    /// The trajectory is dropped and the last pose held.
    pub drop_trajectory: bool,
    /// This pose becomes the commanded one.
    pub pose_rad: Option<JointArray>,
    /// Drives are asked to forget their faults.
    pub clear_faults: bool,
    /// Failed buses are started over, as this command asked.
    pub restore_buses: Option<u64>,
    /// The changes of phase, in order.
    pub transitions: [Option<Transition>; TRANSITIONS_MAX],
    /// The cycle ends after this one; true: orderly.
    pub leave: Option<bool>,
}

/// The arm's phase and everything that decides it.
#[derive(Debug)]
pub struct Supervisor {
    pub(crate) rules: Supervision,
    pub(crate) limits: [JointLimits; MAX_JOINTS],
    pub(crate) joints: usize,
    stall_resume_s: f64,
    watchdog_s: f64,
    pub(crate) watch: Watch,
    pub(crate) phase: Phase,
    since: Nanos,
    cause: Option<Cause>,
    /// In fault: the drives hold instead of being off.
    pub(crate) holds: bool,
    /// Drives are kept that were found holding at start.
    pub(crate) adopted: bool,
    pub(crate) turns: Turns,
    pub(crate) torque_off: bool,
    pub(crate) speed: f64,
    /// Somebody has chosen the speed since the start.
    pub(crate) speed_chosen: bool,
    /// A stall froze the motion; it goes on when the drives rest.
    pub(crate) stalled_since: Option<Nanos>,
    pub(crate) resetting_since: Option<Nanos>,
    /// Failed buses are being started over, for this `clear-fault`.
    pub(crate) restoring: Option<u64>,
    pub(crate) leaving: Leave,
    leaving_since: Nanos,
}

impl Supervisor {
    /// A supervisor of an arm of which nothing is known.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let limits = settings.robot.limits();
        let joints = settings.robot.joints.len();
        let (cycle, rules) = (&settings.cycle, &settings.supervision);
        Self {
            rules: *rules,
            limits,
            joints,
            stall_resume_s: f64::from(cycle.stall_resume_ms) * 1e-3,
            watchdog_s: f64::from(cycle.drive_watchdog_ms) * 1e-3,
            watch: Watch::new(settings),
            phase: Phase::Configuring,
            since: Nanos(0),
            cause: None,
            holds: false,
            adopted: false,
            turns: Turns::new(settings),
            torque_off: false,
            speed_chosen: false,
            speed: (rules.first_speed_percent / 100.0).clamp(0.0, 1.0),
            stalled_since: None,
            resetting_since: None,
            restoring: None,
            leaving: Leave::No,
            leaving_since: Nanos(0),
        }
    }

    /// The turns of the joints.
    #[must_use]
    pub fn turns(&self) -> &Turns {
        &self.turns
    }
    pub(crate) fn turns_mut(&mut self) -> &mut Turns {
        &mut self.turns
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
    /// The speed override, 0 to 1.
    #[must_use]
    pub fn speed(&self) -> f64 {
        self.speed
    }
    /// What is known of the feedback.
    #[must_use]
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// What the drives should be.
    #[must_use]
    pub fn wish(&self) -> DriveWish {
        if self.torque_off {
            return DriveWish::TorqueOff;
        }
        match self.phase {
            Phase::Configuring | Phase::Disabled | Phase::Disabling => DriveWish::Disabled,
            Phase::Fault if !self.holds => DriveWish::Disabled,
            Phase::Fault | Phase::Locked if self.adopted => DriveWish::Keep,
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Fault
            | Phase::Locked => DriveWish::Enabled,
        }
    }

    /// Judges one cycle: its facts first, then its commands, then leaving. `answers` takes the commands' answers.
    ///
    /// Real time: bounded work, no allocation.
    pub fn judge(&mut self, facts: &Facts, leave: Leave, answers: &mut Answers) -> Orders {
        let mut orders = Orders::default();
        self.watch.observe(facts);
        self.judge_motion(facts, &mut orders);
        self.judge_stall(facts, &mut orders);
        self.judge_drives(facts, &mut orders);
        let [answers @ .., restored] = answers;
        *restored = self.judge_restored(facts, &mut orders);
        for (asked, answer) in facts.commands.iter().zip(answers) {
            *answer = asked.and_then(|asked| self.command(asked, facts, &mut orders));
        }
        self.judge_leaving(leave, facts, &mut orders);
        self.follow_measured(facts, &mut orders);
        orders
    }

    /// Applies an event to the table, and what every entry into a phase brings with it.
    pub(crate) fn step(&mut self, event: Event, facts: &Facts, orders: &mut Orders) -> bool {
        let Some(to) = phases::next(self.phase, event) else { return false };
        let transition =
            Transition { tick: facts.tick.number, from: self.phase, to, event, cause: self.cause };
        if let Some(slot) = orders.transitions.iter_mut().find(|slot| slot.is_none()) {
            *slot = Some(transition);
        }
        (self.phase, self.since) = (to, facts.tick.woke);
        // Drives that follow commands, or are let go, are kept no more.
        self.adopted &= !matches!(to, Phase::Holding | Phase::Disabling | Phase::Disabled);
        match to {
            Phase::Holding | Phase::Fault | Phase::Disabling | Phase::Locked => {
                orders.drop_trajectory = true;
            }
            Phase::Stopping | Phase::FastStopping | Phase::Pausing => {
                orders.speed = Some(ScaleOrder::Stop);
                self.stalled_since = None;
            }
            Phase::Configuring
            | Phase::Disabled
            | Phase::Enabling
            | Phase::Moving
            | Phase::Paused
            | Phase::Braking => {}
        }
        true
    }

    pub(crate) fn raise(&mut self, event: Event, cause: Cause, facts: &Facts, orders: &mut Orders) {
        // Drives that were on their way to energised go back; drives that carry the arm hold.
        let wanted = matches!(self.wish(), DriveWish::Enabled | DriveWish::Keep);
        let holds = wanted && (self.phase != Phase::Enabling || self.adopted);
        let before = self.cause.replace(cause);
        if phases::next(self.phase, event).is_none() {
            self.cause = before;
            return;
        }
        self.holds = holds && event != Event::HardFault;
        self.adopted &= self.holds;
        self.step(event, facts, orders);
    }

    fn judge_motion(&mut self, facts: &Facts, orders: &mut Orders) {
        if facts.verdict.is_some_and(|v| matches!(v.decision, Decision::Accepted { .. })) {
            self.stalled_since = None;
            self.step(Event::Accepted, facts, orders);
        }
        if let Some(trip) = facts.trip {
            let cause = Cause::new(FaultReason::Guard).at_joint(trip.joint).amount(trip.value, trip.limit);
            // In a fast stop the first cause stays the one to report.
            let cause = if self.phase == Phase::FastStopping { self.cause.unwrap_or(cause) } else { cause };
            self.raise(Event::GuardTrip, cause, facts, orders);
        }
        if self.phase == Phase::Braking {
            if facts.braking == Braking::Rested {
                self.step(Event::AtRest, facts, orders);
            }
        } else if facts.end_reached {
            self.step(Event::EndReached, facts, orders);
        } else if facts.at_rest {
            self.step(Event::AtRest, facts, orders);
        }
    }

    /// Gaps beyond what the drives bridge (design section 4).
    fn judge_stall(&mut self, facts: &Facts, orders: &mut Orders) {
        let energised = self.wish() == DriveWish::Enabled && self.phase != Phase::Fault;
        if energised && facts.gap_s > self.watchdog_s {
            let cause = Cause::new(FaultReason::Stall).amount(facts.gap_s, self.watchdog_s);
            self.raise(Event::StopFault, cause, facts, orders);
        }
        if self.phase != Phase::Moving {
            return;
        }
        if facts.frozen {
            self.stalled_since = Some(facts.tick.woke);
            if facts.gap_s > self.stall_resume_s {
                self.stalled_since = None;
                self.step(Event::StalledLong, facts, orders);
            }
            return;
        }
        let Some(since) = self.stalled_since else { return };
        if self.watch.is_at_rest() && facts.can_ramp {
            self.stalled_since = None;
            orders.speed = Some(ScaleOrder::Wish(self.speed));
        } else if facts.tick.woke.since_s(since) > STALL_REST_S {
            self.stalled_since = None;
            self.step(Event::StalledLong, facts, orders);
        }
    }

    /// Failed buses are back, or not: the `clear-fault` that asked for it goes on, or was refused in the service
    /// thread's own words.
    fn judge_restored(&mut self, facts: &Facts, orders: &mut Orders) -> Option<Answer> {
        let restored = facts.restored?;
        self.restoring = None;
        if !restored.well || self.phase != Phase::Fault {
            return None;
        }
        self.clear(Event::ClearedOff, facts, orders);
        let (sequence, phase) = (restored.sequence, self.phase);
        Some(Answer { sequence, accepted: true, phase, why: Why::BusRestored })
    }

    fn judge_drives(&mut self, facts: &Facts, orders: &mut Orders) {
        // Buses that just came back are judged from the next cycle on.
        let failed = facts.failed_bus().is_some() && facts.restored.is_none();
        match self.phase {
            Phase::Configuring | Phase::Disabled | Phase::Disabling if failed => {
                if let Some(cause) = self.watch.bus_cause(facts) {
                    self.raise(Event::HardFault, cause, facts, orders);
                }
            }
            Phase::Configuring | Phase::Disabled => self.judge_bring_up(facts, orders),
            Phase::Disabling => {
                if self.all(facts, |s| s.state == DriveState::Disabled) {
                    self.step(Event::DrivesDisabled, facts, orders);
                } else if let Some(cause) = self.overdue(facts, |s| s.state == DriveState::Disabled) {
                    self.raise(Event::HardFault, cause, facts, orders);
                }
            }
            Phase::Fault => self.judge_fault(facts, orders),
            Phase::Locked if self.adopted => self.judge_adopted(facts, orders),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::Locked => {
                let enabling = self.phase == Phase::Enabling;
                let enabled = |s: &ServoStatus| s.state == DriveState::Enabled;
                if let Some(cause) = self.watch.find_cause(facts, enabling) {
                    self.raise(Event::StopFault, cause, facts, orders);
                } else if enabling && self.all(facts, enabled) {
                    self.step(Event::DrivesEnabled, facts, orders);
                } else if let Some(cause) = self.overdue(facts, enabled).filter(|_| enabling) {
                    self.raise(Event::StopFault, cause, facts, orders);
                }
            }
            // The arm is on its way to rest already; nothing that drives say changes how.
            Phase::FastStopping | Phase::Braking => {}
        }
    }

    fn judge_bring_up(&mut self, facts: &Facts, orders: &mut Orders) {
        let bad = self.servos(facts).find_map(|(joint, servo)| {
            let reason = match servo.state {
                DriveState::Refused => FaultReason::ConfigurationRefused,
                DriveState::EnergisedUnowned => FaultReason::EnergisedUnowned,
                DriveState::Fault => FaultReason::DriveFault,
                DriveState::Absent
                | DriveState::Configuring
                | DriveState::Disabled
                | DriveState::Adopted
                | DriveState::Enabling
                | DriveState::Enabled
                | DriveState::Disabling => return None,
            };
            let cause = Cause::new(reason).at_joint(joint).code(servo.error_code);
            Some(Cause { object: servo.refused_object, ..cause })
        });
        if let Some(cause) = bad {
            self.raise(Event::HardFault, cause, facts, orders);
        } else if self.all(facts, |s| matches!(s.state, DriveState::Disabled | DriveState::Adopted))
            && self.servos(facts).any(|(_, s)| s.state == DriveState::Adopted)
        {
            self.adopted = true;
            self.step(Event::HoldAdopted, facts, orders);
        } else if self.all(facts, |s| s.state == DriveState::Disabled) && self.watch.fastest().is_some() {
            // Ready to be energised includes that rest can be told from motion: the first `enable` is not refused for it.
            self.step(Event::DrivesReady, facts, orders);
        } else {
            self.step(Event::DrivesLost, facts, orders);
        }
    }

    /// Drives that hold from before: each is either kept or off, and those that are kept answer and stay.
    fn judge_adopted(&mut self, facts: &Facts, orders: &mut Orders) {
        let rules = self.rules;
        let unheard = |this: &Self, joint| this.watch.age_s(facts, joint).is_infinite();
        let lost = self.servos(facts).find_map(|(joint, servo)| match servo.state {
            DriveState::Disabled => None,
            // Its process data is only being begun.
            DriveState::Adopted if unheard(self, joint) => None,
            DriveState::Adopted => {
                let sag_rad = (servo.position_rad - servo.held_rad).abs();
                let limit = rules.tracking_error_rad_max;
                let far = Cause::new(FaultReason::TrackingError).at_joint(joint).amount(sag_rad, limit);
                let late = self.watch.late_cause(joint);
                late.or_else(|| (sag_rad.is_nan() || sag_rad > limit).then_some(far))
            }
            DriveState::Absent
            | DriveState::Configuring
            | DriveState::EnergisedUnowned
            | DriveState::Enabling
            | DriveState::Enabled
            | DriveState::Disabling
            | DriveState::Fault
            | DriveState::Refused => self.watch.drive_cause(facts, joint),
        });
        let begun = |s: &ServoStatus| s.state != DriveState::Adopted || s.received.is_some();
        let overdue = || self.overdue(facts, begun).filter(|_| !self.all(facts, begun));
        let cause = self.watch.bus_cause(facts).or(lost).or_else(overdue);
        if let Some(cause) = cause {
            self.raise(Event::StopFault, cause, facts, orders);
        }
    }

    fn judge_fault(&mut self, facts: &Facts, orders: &mut Orders) {
        // Drives that have all dropped out do not come back by themselves.
        if self.holds && self.energised(facts).is_none() {
            (self.holds, self.adopted) = (false, false);
        }
        let Some(since) = self.resetting_since else { return };
        let faulty = |s: &ServoStatus| matches!(s.state, DriveState::Fault | DriveState::Refused);
        if self.servos(facts).any(|(_, s)| faulty(s)) {
            if facts.tick.woke.since_s(since) > self.rules.drive_timeout_s {
                self.resetting_since = None;
            }
        } else {
            self.clear(Event::ClearedOff, facts, orders);
        }
    }

    pub(crate) fn clear(&mut self, event: Event, facts: &Facts, orders: &mut Orders) {
        self.resetting_since = None;
        (self.cause, self.torque_off, self.holds) = (None, false, false);
        self.step(event, facts, orders);
    }

    /// While nothing is energised, the commanded pose is the measured one, so that enabling moves nothing.
    fn follow_measured(&mut self, facts: &Facts, orders: &mut Orders) {
        if self.wish() == DriveWish::Enabled || orders.pose_rad.is_some() {
            return;
        }
        let mut pose_rad = facts.commanded_rad;
        for (joint, servo) in self.servos(facts) {
            // What holds keeps its own target: following a sag would creep.
            let at_rad = if servo.held_rad.is_finite() { servo.held_rad } else { servo.position_rad };
            if at_rad.is_finite() {
                pose_rad[joint] = at_rad;
            }
        }
        orders.pose_rad = Some(pose_rad);
    }

    fn judge_leaving(&mut self, leave: Leave, facts: &Facts, orders: &mut Orders) {
        if leave > self.leaving {
            (self.leaving, self.leaving_since) = (leave, facts.tick.woke);
        }
        let time_s = facts.tick.woke.since_s(self.leaving_since);
        match self.leaving {
            Leave::No => {}
            Leave::AtOnce => {
                self.switch_off(facts, orders);
                if time_s > LEAVE_AT_ONCE_S {
                    orders.leave = Some(false);
                }
            }
            Leave::Orderly => {
                match self.phase {
                    Phase::Moving | Phase::Pausing | Phase::Paused => {
                        self.step(Event::StopAsked, facts, orders);
                    }
                    Phase::Holding | Phase::Locked | Phase::Enabling => {
                        self.step(Event::DisableAsked, facts, orders);
                    }
                    Phase::Fault => (self.holds, self.adopted) = (false, false),
                    Phase::Configuring
                    | Phase::Disabled
                    | Phase::Stopping
                    | Phase::FastStopping
                    | Phase::Braking
                    | Phase::Disabling => {}
                }
                let off = matches!(self.phase, Phase::Configuring | Phase::Disabled | Phase::Fault);
                if off && self.energised(facts).is_none() {
                    orders.leave = Some(true);
                } else if time_s > LEAVE_S_MAX {
                    orders.leave = Some(false);
                }
            }
        }
    }

    pub(crate) fn switch_off(&mut self, facts: &Facts, orders: &mut Orders) {
        self.torque_off = true;
        (self.holds, self.adopted) = (false, false);
        self.resetting_since = None;
        let asked = Cause::new(FaultReason::TorqueOff);
        // A fault that stopped the arm before stays the one to report.
        let cause = self.cause.unwrap_or(asked);
        self.raise(Event::HardFault, cause, facts, orders);
    }

    pub(crate) fn servos<'a>(
        &self,
        facts: &'a Facts,
    ) -> impl Iterator<Item = (usize, &'a ServoStatus)> + use<'a> {
        facts.servos.iter().enumerate().take(self.joints)
    }

    pub(crate) fn all(&self, facts: &Facts, test: impl Fn(&ServoStatus) -> bool) -> bool {
        self.servos(facts).all(|(_, servo)| test(servo))
    }

    pub(crate) fn first_not(&self, facts: &Facts, state: DriveState) -> Option<Why> {
        let mut others = self.servos(facts).filter(|(_, s)| s.state != state);
        others.next().map(|(joint, s)| Why::NotConfigured { joint, state: s.state })
    }

    /// The first drive that carries torque, or did when it was last heard.
    pub(crate) fn energised(&self, facts: &Facts) -> Option<(usize, DriveState)> {
        self.servos(facts).find(|(_, s)| is_energised(s.state)).map(|(joint, s)| (joint, s.state))
    }

    fn overdue(&self, facts: &Facts, done: impl Fn(&ServoStatus) -> bool) -> Option<Cause> {
        let limit = self.rules.drive_timeout_s;
        if facts.tick.woke.since_s(self.since) <= limit {
            return None;
        }
        let joint = self.servos(facts).find(|(_, s)| !done(s)).map(|(joint, _)| joint);
        Some(Cause { joint, ..Cause::new(FaultReason::BringUp).amount(limit, limit) })
    }
}

/// The drive carries torque.
pub(crate) fn is_energised(state: DriveState) -> bool {
    matches!(
        state,
        DriveState::Enabled
            | DriveState::Enabling
            | DriveState::Disabling
            | DriveState::Adopted
            | DriveState::EnergisedUnowned
    )
}
