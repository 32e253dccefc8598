//! What the operator may ask, phase by phase, and the answer. Every refusal says why and what to do.
//!
//! Stops are never refused: they depend on the time scale alone, which keeps a slot back for them.
use crate::answer::{AnswerReason, CommandAnswer};
use crate::cycle_state::{Cause, CycleState, PendingCommand};
use crate::intake::Shutdown;
use crate::phases::Event;
use crate::supervise::{Actions, Supervisor, is_energised};
use crate::watch::REST_RAD_S;
use taustream_drivers::{DriveState, ServoStatus};
use taustream_messages::{AxisGoal, Command, FaultReason, Phase, ReferenceState};
use taustream_motion::stopping::SpeedRequest;
use taustream_motion::{JointArray, MAX_JOINTS};

impl Supervisor {
    /// Takes a command over, or says why not; `None` when the answer has to wait for a bus.
    ///
    /// Real time: bounded work, no allocation.
    pub(crate) fn command(
        &mut self,
        pending: PendingCommand,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Option<CommandAnswer> {
        let now = cycle_state.tick.wake_time;
        if now > pending.valid_until && !stops_the_arm(pending.command) {
            let (accepted, why) = (false, AnswerReason::TooLate { late_s: now.since_s(pending.valid_until) });
            return Some(CommandAnswer { sequence: pending.sequence, accepted, phase: self.phase, why });
        }
        if pending.command == Command::ClearFault
            && self.begin_restoring(pending.sequence, cycle_state, actions)
        {
            return None;
        }
        self.stop_waiting(pending.command);
        match self.begin_record(pending, cycle_state) {
            Some(Ok(())) => return None,
            Some(Err(why)) => {
                return Some(CommandAnswer {
                    sequence: pending.sequence,
                    accepted: false,
                    phase: self.phase,
                    why,
                });
            }
            None => {}
        }
        let result = match pending.command {
            Command::Enable | Command::Resume | Command::Axis { .. } | Command::Home { .. }
                if self.shutting_down != Shutdown::No =>
            {
                Err(AnswerReason::ShuttingDown)
            }
            Command::Enable => self.enable(cycle_state, actions),
            Command::Disable => self.disable(cycle_state, actions),
            Command::Pause => self.pause(cycle_state, actions),
            Command::Resume => self.resume(cycle_state, actions),
            Command::Stop => self.stop(cycle_state, actions),
            Command::FastStop => self.fast_stop(cycle_state, actions),
            Command::TorqueOff => {
                self.switch_off(cycle_state, actions);
                Ok(AnswerReason::TorqueOff)
            }
            Command::Speed { percent } => self.set_speed(percent, cycle_state, actions),
            Command::ClearFault => self.clear_fault(cycle_state, actions),
            Command::Reference { joint, at_rad } => self.reference(joint, at_rad, cycle_state),
            Command::Home { joint } => self.home(joint, cycle_state, actions),
            Command::Axis { axis, goal, force } => self.axis((axis, goal, force), cycle_state, actions),
        };
        let (accepted, why) = match result {
            Ok(why) => (true, why),
            Err(why) => (false, why),
        };
        Some(CommandAnswer { sequence: pending.sequence, accepted, phase: self.phase, why })
    }

    /// Whether clearing the fault is a matter of failed buses alone; if so, has them restarted.
    fn begin_restoring(&mut self, sequence: u64, cycle_state: &CycleState, actions: &mut Actions) -> bool {
        let begins = self.phase == Phase::Fault
            && self.restoring.is_none()
            && cycle_state.failed_bus().is_some()
            && self.energised_in_reach(cycle_state).is_none();
        if begins {
            self.restoring = Some(sequence);
            actions.restore_buses = Some(sequence);
        }
        begins
    }

    /// A drive that carries torque on a bus that is well.
    fn energised_in_reach(&self, cycle_state: &CycleState) -> Option<usize> {
        let (mut servos, unreachable) = (self.servos(cycle_state), &cycle_state.unreachable);
        servos.find(|(joint, s)| !unreachable[*joint] && is_energised(s.state)).map(|(joint, _)| joint)
    }

    pub(crate) fn enable(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        match self.phase {
            Phase::Locked if self.adopted => {
                let pose_rad = self.trusted_pose(cycle_state)?;
                self.watch.restart(&pose_rad);
                actions.pose_rad = Some(pose_rad);
                self.step(Event::AdoptRequested, cycle_state, actions);
                Ok(AnswerReason::TakingOver)
            }
            Phase::Locked => {
                self.all_referenced(cycle_state)?;
                self.step(Event::EnableRequested, cycle_state, actions);
                Ok(AnswerReason::Unlocked)
            }
            Phase::Disabled => {
                let pose_rad = self.trusted_pose(cycle_state)?;
                self.watch.restart(&pose_rad);
                actions.pose_rad = Some(pose_rad);
                if self.begins_slowly {
                    self.speed = (self.rules.first_speed_percent / 100.0).clamp(0.0, 1.0);
                    self.speed_chosen = false;
                }
                self.step(Event::EnableRequested, cycle_state, actions);
                Ok(self.first_outside(&pose_rad).map_or(AnswerReason::Enabling, |joint| {
                    AnswerReason::EnablingOutside {
                        joint,
                        position_rad: pose_rad[joint],
                        range_rad: self.limits[joint].position_rad,
                        percent: self.inwards_speed() * 100.0,
                    }
                }))
            }
            // All drives ready, yet still configuring: only their speeds are missing.
            Phase::Configuring => {
                Err(self.first_not(cycle_state, DriveState::Disabled).unwrap_or(AnswerReason::SpeedUnknown))
            }
            Phase::Fault | Phase::FastStopping | Phase::Braking => {
                Err(AnswerReason::ClearFirst { cause: self.cause() })
            }
            Phase::Disabling | Phase::Homing => Err(AnswerReason::Wait),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping => Ok(AnswerReason::Already),
        }
    }

    /// The pose to energise at: the angle of each joint, or what its drive holds. Only if every joint answers,
    /// is referenced, and at rest. A joint outside its range is energised, too: from there it may only move inwards.
    pub(crate) fn trusted_pose(&self, cycle_state: &CycleState) -> Result<JointArray, AnswerReason> {
        let mut pose_rad = [0.0; MAX_JOINTS];
        for (joint, servo) in self.servos(cycle_state) {
            self.check_answers(cycle_state, (joint, servo))?;
            self.check_referenced(joint)?;
            let holds = servo.state == DriveState::Adopted;
            let position_rad = if holds { servo.hold_position_rad } else { servo.position_rad };
            let (error_rad, limit_rad) =
                ((position_rad - servo.position_rad).abs(), self.watch.tracking_limit_rad(joint));
            if error_rad.is_nan() || error_rad > limit_rad {
                return Err(AnswerReason::Tracking { joint, error_rad, limit_rad });
            }
            pose_rad[joint] = position_rad;
        }
        self.check_at_rest()?;
        Ok(pose_rad)
    }

    /// That a joint has answered just now, with an angle and without a warning.
    pub(crate) fn check_answers(
        &self,
        cycle_state: &CycleState,
        (joint, servo): (usize, &ServoStatus),
    ) -> Result<(), AnswerReason> {
        let age_s = self.watch.age_s(cycle_state, joint);
        if age_s > self.rules.feedback_age_s_max || !servo.position_rad.is_finite() {
            return Err(AnswerReason::NoFeedback { joint, age_s });
        }
        if servo.warning {
            return Err(AnswerReason::Warns { joint, status_word: servo.status_word });
        }
        Ok(())
    }

    /// That every joint stands still.
    pub(crate) fn check_at_rest(&self) -> Result<(), AnswerReason> {
        let (joint, speed_rad_s) = self.watch.fastest().ok_or(AnswerReason::SpeedUnknown)?;
        if speed_rad_s > REST_RAD_S {
            return Err(AnswerReason::NotAtRest { joint, speed_rad_s, limit_rad_s: REST_RAD_S });
        }
        Ok(())
    }

    fn check_referenced(&self, joint: usize) -> Result<(), AnswerReason> {
        let resolved = self.referencing.resolved(joint);
        let (reference_state, by_rad) = (resolved.reference_state, resolved.by_rad);
        if reference_state.is_referenced() {
            Ok(())
        } else if reference_state == ReferenceState::Homing {
            Err(AnswerReason::NotHomed { joint })
        } else {
            Err(AnswerReason::NotReferenced { joint, reference_state, by_rad })
        }
    }

    /// After a homing drives hold, of which some may not be referenced yet.
    fn all_referenced(&self, cycle_state: &CycleState) -> Result<(), AnswerReason> {
        self.servos(cycle_state).try_for_each(|(joint, _)| self.check_referenced(joint))
    }

    fn disable(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        match self.phase {
            Phase::Fault if self.holds => {
                (self.holds, self.adopted) = (false, false);
                // Nothing is sent on a failed bus: its drives have stopped by their own watchdogs.
                match cycle_state.failed_bus() {
                    Some((bus, _)) if self.energised_in_reach(cycle_state).is_none() => {
                        Err(AnswerReason::Unreachable { bus })
                    }
                    Some(_) | None => Ok(AnswerReason::Disabling),
                }
            }
            Phase::Configuring | Phase::Disabled | Phase::Disabling | Phase::Fault => {
                Ok(AnswerReason::Already)
            }
            Phase::Holding | Phase::Paused if self.moving_axis(cycle_state).is_some() => {
                Err(AnswerReason::AxisInMotion { axis: self.moving_axis(cycle_state).unwrap_or(0) })
            }
            Phase::Enabling | Phase::Holding | Phase::Paused | Phase::Locked => {
                self.step(Event::DisableRequested, cycle_state, actions);
                Ok(AnswerReason::Disabling)
            }
            Phase::Moving
            | Phase::Pausing
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Homing => Err(AnswerReason::StopFirst),
        }
    }

    fn pause(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        actions.axes.stop_all = true;
        if self.stop_homing(cycle_state) {
            Ok(AnswerReason::HomingStops)
        } else if self.step(Event::PauseRequested, cycle_state, actions) {
            Ok(AnswerReason::Pausing)
        } else if self.moving_axis(cycle_state).is_some() {
            Ok(AnswerReason::AxesStop)
        } else if matches!(self.phase, Phase::Pausing | Phase::Paused) {
            Ok(AnswerReason::Already)
        } else {
            Err(AnswerReason::NothingMoves)
        }
    }

    fn resume(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        let paused = matches!(self.phase, Phase::Pausing | Phase::Paused);
        if paused && !cycle_state.can_ramp {
            Err(AnswerReason::TooManyRamps)
        } else if paused {
            actions.speed = Some(SpeedRequest::Change(self.speed()));
            self.step(Event::ResumeRequested, cycle_state, actions);
            Ok(AnswerReason::Resuming)
        } else if self.phase == Phase::Moving {
            Ok(AnswerReason::Already)
        } else if self.phase == Phase::Fault {
            Err(AnswerReason::ClearFirst { cause: self.cause() })
        } else {
            Err(AnswerReason::NothingToResume)
        }
    }

    fn stop(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        actions.axes.stop_all = true;
        if self.stop_homing(cycle_state) {
            Ok(AnswerReason::HomingStops)
        } else if self.step(Event::StopRequested, cycle_state, actions) {
            Ok(AnswerReason::Stopping)
        } else if self.phase == Phase::Holding && self.moving_axis(cycle_state).is_some() {
            Ok(AnswerReason::AxesStop)
        } else if matches!(self.phase, Phase::Stopping | Phase::FastStopping | Phase::Braking) {
            Ok(AnswerReason::Already)
        } else {
            Ok(AnswerReason::NothingMoves)
        }
    }

    fn fast_stop(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        match self.phase {
            Phase::FastStopping | Phase::Braking | Phase::Fault => Ok(AnswerReason::Already),
            Phase::Configuring | Phase::Disabled | Phase::Disabling => Ok(AnswerReason::NothingMoves),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::Homing
            | Phase::Locked => {
                self.raise(Event::StopFault, Cause::new(FaultReason::Operator), cycle_state, actions);
                Ok(AnswerReason::FastStopping)
            }
        }
    }

    fn set_speed(
        &mut self,
        percent: f64,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        let moving = self.phase == Phase::Moving;
        let changes = moving && !self.stalls.is_frozen();
        if changes && !cycle_state.can_ramp {
            return Err(AnswerReason::TooManyRamps);
        }
        self.speed = (percent / 100.0).clamp(0.0, 1.0);
        self.speed_chosen = true;
        if changes {
            actions.speed = Some(SpeedRequest::Change(self.speed()));
        }
        let limit = self.inwards_speed() * 100.0;
        let held = self.outside && percent > limit;
        Ok(if held {
            AnswerReason::SpeedHeld { percent, limit }
        } else {
            AnswerReason::SpeedSet { percent, moving }
        })
    }

    fn clear_fault(
        &mut self,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        if matches!(self.phase, Phase::FastStopping | Phase::Braking) {
            return Err(AnswerReason::Wait);
        } else if self.phase != Phase::Fault {
            return Err(AnswerReason::NoFault);
        }
        if self.restoring.is_some() {
            return Err(AnswerReason::Wait);
        }
        if let Some((bus, _)) = cycle_state.failed_bus()
            && let Some(joint) = self.energised_in_reach(cycle_state)
        {
            return Err(AnswerReason::HoldsBesideFailed { joint, bus });
        }
        if let Some(bus) = cycle_state.buses.iter().position(|b| b.passive) {
            return Err(AnswerReason::BusPassive { bus });
        }
        if self.holds {
            self.may_hold_on(cycle_state)?;
            // What the last try to take them over has found.
            actions.clear_faults = self.adopted;
            self.clear(Event::ClearedHolding, cycle_state, actions);
            return Ok(AnswerReason::ClearedHolding);
        }
        let foreign = self.servos(cycle_state).find(|(_, s)| s.state == DriveState::EnergisedUnowned);
        if let Some((joint, _)) = foreign {
            return Err(AnswerReason::Unowned { joint });
        }
        // Drives that hold from before continue to hold; they are adopted once all drives are known.
        if let Some((joint, state)) = self.energised(cycle_state)
            && state != DriveState::Adopted
        {
            return Err(AnswerReason::StillEnergised { joint });
        }
        actions.clear_faults = true;
        let faulty = |s: &ServoStatus| matches!(s.state, DriveState::Fault | DriveState::Refused);
        if self.servos(cycle_state).any(|(_, s)| faulty(s)) {
            self.resetting_since = Some(cycle_state.tick.wake_time);
            // Every drive is off. One that restarted, or lost its master, after `torque-off` is looked at again only when the
            // target is disabled: under torque off its fault would stay for ever.
            self.torque_off = false;
            return Ok(AnswerReason::Resetting);
        }
        self.clear(Event::ClearedOff, cycle_state, actions);
        Ok(AnswerReason::ClearedOff)
    }

    /// A fault is cleared while drives hold only if every one of them does, and no other fault remains.
    fn may_hold_on(&self, cycle_state: &CycleState) -> Result<(), AnswerReason> {
        for (joint, servo) in self.servos(cycle_state) {
            let kept = self.adopted && matches!(servo.state, DriveState::Adopted | DriveState::Disabled);
            if kept {
                continue;
            }
            if servo.state == DriveState::Homing {
                // On its way back to following.
                return Err(AnswerReason::Wait);
            }
            if servo.state != DriveState::Enabled {
                return Err(AnswerReason::PartlyEnergised { joint, state: servo.state });
            }
            if servo.warning {
                return Err(AnswerReason::Warns { joint, status_word: servo.status_word });
            }
            if let Some(cause) = self.watch.feedback_cause(joint) {
                return Err(if cause.reason == FaultReason::FeedbackLate {
                    AnswerReason::NoFeedback { joint, age_s: cause.value }
                } else {
                    AnswerReason::Tracking { joint, error_rad: cause.value, limit_rad: cause.limit }
                });
            }
        }
        Ok(())
    }

    /// The angle of a joint set by the operator: accepted only while nothing is energised and the arm is at rest.
    pub(crate) fn reference(
        &mut self,
        joint: u32,
        at_rad: f64,
        cycle_state: &CycleState,
    ) -> Result<AnswerReason, AnswerReason> {
        let (joint, position_rad) = self.check_reference(joint, at_rad, cycle_state)?;
        let at_rad = self.referencing.set_reference(joint, position_rad, at_rad)?;
        Ok(AnswerReason::Referenced { joint, at_rad })
    }

    /// The joint and where it was measured, if its reference may be changed to `at_rad` now.
    pub(crate) fn check_reference(
        &self,
        joint: u32,
        at_rad: f64,
        cycle_state: &CycleState,
    ) -> Result<(usize, f64), AnswerReason> {
        let joint = usize::try_from(joint).unwrap_or(usize::MAX);
        let Some(servo) = cycle_state.servos.get(joint).filter(|_| joint < self.joints + self.axes.len())
        else {
            return Err(AnswerReason::NoSuchJoint { joint });
        };
        if let Some((energised, state)) = self.energised(cycle_state) {
            return Err(AnswerReason::Energised { joint: energised, state });
        }
        let age_s = self.watch.age_s(cycle_state, joint);
        if age_s > self.rules.feedback_age_s_max || !servo.position_rad.is_finite() {
            return Err(AnswerReason::NoFeedback { joint, age_s });
        }
        let (moving, speed_rad_s) = self.watch.fastest().ok_or(AnswerReason::SpeedUnknown)?;
        if speed_rad_s > REST_RAD_S {
            return Err(AnswerReason::NotAtRest { joint: moving, speed_rad_s, limit_rad_s: REST_RAD_S });
        }
        self.referencing.check_reference(joint, servo.position_rad, at_rad)?;
        Ok((joint, servo.position_rad))
    }
}

/// Commands that only ever slow the arm down on its path: late is better than never.
fn stops_the_arm(command: Command) -> bool {
    match command {
        Command::Pause | Command::Stop | Command::FastStop => true,
        Command::Enable
        | Command::Disable
        | Command::Resume
        | Command::TorqueOff
        | Command::Speed { .. }
        | Command::ClearFault
        | Command::Home { .. }
        | Command::Reference { .. } => false,
        // A request to stop stops the axis, however late.
        Command::Axis { goal, .. } => goal == AxisGoal::Stop,
    }
}
