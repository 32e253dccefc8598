//! What the operator may ask, phase by phase, and the answer. Every refusal says why and what to do.
//!
//! Stops are never refused: they depend on the time scale alone, which keeps a slot back for them.
use crate::facts::{Asked, Cause, Facts};
use crate::intake::Leave;
use crate::phases::Event;
use crate::supervise::{Orders, Supervisor, is_energised};
use crate::track::ScaleOrder;
use crate::watch::REST_RAD_S;
use crate::words::{Answer, Why};
use taustream_drivers::{DriveState, ServoStatus};
use taustream_messages::{Command, FaultReason, Phase};
use taustream_motion::{JointArray, MAX_JOINTS};

impl Supervisor {
    /// Takes a command over, or says why not; `None` when the answer has to wait for a bus.
    ///
    /// Real time: bounded work, no allocation.
    pub(crate) fn command(&mut self, asked: Asked, facts: &Facts, orders: &mut Orders) -> Option<Answer> {
        if asked.command == Command::ClearFault && self.begin_restoring(asked.sequence, facts, orders) {
            return None;
        }
        let result = match asked.command {
            Command::Enable | Command::Resume if self.leaving != Leave::No => Err(Why::Leaving),
            Command::Enable => self.enable(facts, orders),
            Command::Disable => self.disable(facts, orders),
            Command::Pause => self.pause(facts, orders),
            Command::Resume => self.resume(facts, orders),
            Command::Stop => self.stop(facts, orders),
            Command::FastStop => self.fast_stop(facts, orders),
            Command::TorqueOff => {
                self.switch_off(facts, orders);
                Ok(Why::TorqueOff)
            }
            Command::Speed { percent } => self.set_speed(percent, facts, orders),
            Command::ClearFault => self.clear_fault(facts, orders),
            Command::Reference { joint, at_rad } => self.reference(joint, at_rad, facts),
        };
        let (accepted, why) = match result {
            Ok(why) => (true, why),
            Err(why) => (false, why),
        };
        Some(Answer { sequence: asked.sequence, accepted, phase: self.phase, why })
    }

    /// Whether clearing the fault is a matter of failed buses alone; if so, has them started over.
    fn begin_restoring(&mut self, sequence: u64, facts: &Facts, orders: &mut Orders) -> bool {
        let begins = self.phase == Phase::Fault
            && self.restoring.is_none()
            && facts.failed_bus().is_some()
            && self.held_in_reach(facts).is_none();
        if begins {
            self.restoring = Some(sequence);
            orders.restore_buses = Some(sequence);
        }
        begins
    }

    /// A drive that carries torque on a bus that is well.
    fn held_in_reach(&self, facts: &Facts) -> Option<usize> {
        let (mut servos, out_of_reach) = (self.servos(facts), &facts.out_of_reach);
        servos.find(|(joint, s)| !out_of_reach[*joint] && is_energised(s.state)).map(|(joint, _)| joint)
    }

    fn enable(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        match self.phase {
            Phase::Locked if self.adopted => {
                let pose_rad = self.trusted_pose(facts)?;
                self.watch.restart(&pose_rad);
                orders.pose_rad = Some(pose_rad);
                self.step(Event::TakeOverAsked, facts, orders);
                Ok(Why::TakingOver)
            }
            Phase::Locked => {
                self.step(Event::EnableAsked, facts, orders);
                Ok(Why::Unlocked)
            }
            Phase::Disabled => {
                let pose_rad = self.trusted_pose(facts)?;
                self.watch.restart(&pose_rad);
                orders.pose_rad = Some(pose_rad);
                self.step(Event::EnableAsked, facts, orders);
                Ok(Why::Enabling)
            }
            // All drives ready, yet still configuring: only their speeds are missing.
            Phase::Configuring => {
                Err(self.first_not(facts, DriveState::Disabled).unwrap_or(Why::SpeedUnknown))
            }
            Phase::Fault | Phase::FastStopping | Phase::Braking => Err(Why::ClearFirst),
            Phase::Disabling => Err(Why::Wait),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping => Ok(Why::Already),
        }
    }

    /// The pose to energise at: where each joint stands, or what its drive holds from before. Only if every joint answers,
    /// is referenced, rests, and stands inside its range.
    fn trusted_pose(&self, facts: &Facts) -> Result<JointArray, Why> {
        let mut pose_rad = [0.0; MAX_JOINTS];
        for (joint, servo) in self.servos(facts) {
            let age_s = self.watch.age_s(facts, joint);
            if age_s > self.rules.feedback_age_s_max || !servo.position_rad.is_finite() {
                return Err(Why::NoFeedback { joint, age_s });
            }
            if servo.warning {
                return Err(Why::Warns { joint, status_word: servo.status_word });
            }
            let resolved = self.turns.resolved(joint);
            if !resolved.standing.is_referenced() {
                let (standing, by_rad) = (resolved.standing, resolved.by_rad);
                return Err(Why::NotReferenced { joint, standing, by_rad });
            }
            let range_rad = self.limits[joint].position_rad;
            let holds = servo.state == DriveState::Adopted;
            let position_rad = if holds { servo.held_rad } else { servo.position_rad };
            let (error_rad, limit_rad) =
                ((position_rad - servo.position_rad).abs(), self.rules.tracking_error_rad_max);
            if error_rad.is_nan() || error_rad > limit_rad {
                return Err(Why::Tracking { joint, error_rad, limit_rad });
            }
            if !(range_rad[0]..=range_rad[1]).contains(&position_rad) {
                return Err(Why::OutOfRange { joint, position_rad, range_rad });
            }
            pose_rad[joint] = position_rad;
        }
        let (joint, speed_rad_s) = self.watch.fastest().ok_or(Why::SpeedUnknown)?;
        if speed_rad_s > REST_RAD_S {
            return Err(Why::NotAtRest { joint, speed_rad_s, limit_rad_s: REST_RAD_S });
        }
        Ok(pose_rad)
    }

    fn disable(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        match self.phase {
            Phase::Fault if self.holds => {
                (self.holds, self.adopted) = (false, false);
                // Nothing is said on a failed bus: its drives are where their own watchdogs have left them.
                match facts.failed_bus() {
                    Some((bus, _)) if self.held_in_reach(facts).is_none() => Err(Why::OutOfReach { bus }),
                    Some(_) | None => Ok(Why::Disabling),
                }
            }
            Phase::Configuring | Phase::Disabled | Phase::Disabling | Phase::Fault => Ok(Why::Already),
            Phase::Enabling | Phase::Holding | Phase::Paused | Phase::Locked => {
                self.step(Event::DisableAsked, facts, orders);
                Ok(Why::Disabling)
            }
            Phase::Moving | Phase::Pausing | Phase::Stopping | Phase::FastStopping | Phase::Braking => {
                Err(Why::StopFirst)
            }
        }
    }

    fn pause(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        if self.step(Event::PauseAsked, facts, orders) {
            Ok(Why::Pausing)
        } else if matches!(self.phase, Phase::Pausing | Phase::Paused) {
            Ok(Why::Already)
        } else {
            Err(Why::NothingMoves)
        }
    }

    fn resume(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        let paused = matches!(self.phase, Phase::Pausing | Phase::Paused);
        if paused && !facts.can_ramp {
            Err(Why::TooManyRamps)
        } else if paused {
            orders.speed = Some(ScaleOrder::Wish(self.speed));
            self.step(Event::ResumeAsked, facts, orders);
            Ok(Why::Resuming)
        } else if self.phase == Phase::Moving {
            Ok(Why::Already)
        } else if self.phase == Phase::Fault {
            Err(Why::ClearFirst)
        } else {
            Err(Why::NothingToResume)
        }
    }

    fn stop(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        if self.step(Event::StopAsked, facts, orders) {
            Ok(Why::Stopping)
        } else if matches!(self.phase, Phase::Stopping | Phase::FastStopping | Phase::Braking) {
            Ok(Why::Already)
        } else {
            Ok(Why::NothingMoves)
        }
    }

    fn fast_stop(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        match self.phase {
            Phase::FastStopping | Phase::Braking | Phase::Fault => Ok(Why::Already),
            Phase::Configuring | Phase::Disabled | Phase::Disabling => Ok(Why::NothingMoves),
            Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::Locked => {
                self.raise(Event::StopFault, Cause::new(FaultReason::Operator), facts, orders);
                Ok(Why::FastStopping)
            }
        }
    }

    fn set_speed(&mut self, percent: f64, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        let moving = self.phase == Phase::Moving;
        if moving && self.stalled_since.is_none() {
            if !facts.can_ramp {
                return Err(Why::TooManyRamps);
            }
            orders.speed = Some(ScaleOrder::Wish((percent / 100.0).clamp(0.0, 1.0)));
        }
        self.speed = (percent / 100.0).clamp(0.0, 1.0);
        self.speed_chosen = true;
        Ok(Why::SpeedSet { percent, moving })
    }

    fn clear_fault(&mut self, facts: &Facts, orders: &mut Orders) -> Result<Why, Why> {
        if matches!(self.phase, Phase::FastStopping | Phase::Braking) {
            return Err(Why::Wait);
        } else if self.phase != Phase::Fault {
            return Err(Why::NoFault);
        }
        if self.restoring.is_some() {
            return Err(Why::Wait);
        }
        if let Some((bus, _)) = facts.failed_bus()
            && let Some(joint) = self.held_in_reach(facts)
        {
            return Err(Why::HoldsBesideFailed { joint, bus });
        }
        if let Some(bus) = facts.buses.iter().position(|b| b.passive) {
            return Err(Why::BusPassive { bus });
        }
        if self.holds {
            self.may_hold_on(facts)?;
            // What the last try to take them over has found.
            orders.clear_faults = self.adopted;
            self.clear(Event::ClearedHolding, facts, orders);
            return Ok(Why::ClearedHolding);
        }
        let foreign = self.servos(facts).find(|(_, s)| s.state == DriveState::EnergisedUnowned);
        if let Some((joint, _)) = foreign {
            return Err(Why::Unowned { joint });
        }
        // Drives that hold from before go on holding; they are adopted once all drives are known.
        if let Some((joint, state)) = self.energised(facts)
            && state != DriveState::Adopted
        {
            return Err(Why::StillEnergised { joint });
        }
        orders.clear_faults = true;
        let faulty = |s: &ServoStatus| matches!(s.state, DriveState::Fault | DriveState::Refused);
        if self.servos(facts).any(|(_, s)| faulty(s)) {
            self.resetting_since = Some(facts.tick.woke);
            return Ok(Why::Resetting);
        }
        self.clear(Event::ClearedOff, facts, orders);
        Ok(Why::ClearedOff)
    }

    /// A fault is forgotten while drives hold only if every one of them does, and nothing is left to complain about.
    fn may_hold_on(&self, facts: &Facts) -> Result<(), Why> {
        for (joint, servo) in self.servos(facts) {
            let kept = self.adopted && matches!(servo.state, DriveState::Adopted | DriveState::Disabled);
            if kept {
                continue;
            }
            if servo.state != DriveState::Enabled {
                return Err(Why::PartlyEnergised { joint, state: servo.state });
            }
            if servo.warning {
                return Err(Why::Warns { joint, status_word: servo.status_word });
            }
            if let Some(cause) = self.watch.feedback_cause(joint) {
                return Err(if cause.reason == FaultReason::FeedbackLate {
                    Why::NoFeedback { joint, age_s: cause.value }
                } else {
                    Why::Tracking { joint, error_rad: cause.value, limit_rad: cause.limit }
                });
            }
        }
        Ok(())
    }

    /// The operator's word about where a joint stands: taken only while nothing is energised and the arm rests.
    fn reference(&mut self, joint: u32, at_rad: f64, facts: &Facts) -> Result<Why, Why> {
        let joint = usize::try_from(joint).unwrap_or(usize::MAX);
        let Some(servo) = facts.servos.get(joint).filter(|_| joint < self.joints) else {
            return Err(Why::NoSuchJoint { joint });
        };
        if let Some((energised, state)) = self.energised(facts) {
            return Err(Why::Energised { joint: energised, state });
        }
        let age_s = self.watch.age_s(facts, joint);
        if age_s > self.rules.feedback_age_s_max || !servo.position_rad.is_finite() {
            return Err(Why::NoFeedback { joint, age_s });
        }
        let (moving, speed_rad_s) = self.watch.fastest().ok_or(Why::SpeedUnknown)?;
        if speed_rad_s > REST_RAD_S {
            return Err(Why::NotAtRest { joint: moving, speed_rad_s, limit_rad_s: REST_RAD_S });
        }
        let at_rad = self.turns.refer(joint, servo.position_rad, at_rad)?;
        Ok(Why::Referenced { joint, at_rad })
    }
}
