//! Homing of one joint: when it may begin, what watches it, and how the arm goes on after it.
//!
//! The drive moves the joint by itself, so nothing else may move: it begins only at rest, every other joint holds, and no
//! trajectory is accepted before the operator has enabled the arm again. The request to the drive is a level, said anew in each
//! cycle: whatever ends the phase ends the homing.
//!
//! While the drive homes, the joint is commanded where it is measured, and afterwards where the drive says that it holds; so the
//! commanded pose, and with it the planner's, follows, and the drive is given back to its command without a step.
use crate::answer::AnswerReason;
use crate::cycle_state::{Cause, CycleState};
use crate::phases::Event;
use crate::supervise::{Actions, Supervisor};
use taustream_arm::{Cia402, Settings};
use taustream_drivers::{DriveState, DriveTarget, HomingState, JointSet, Nanos, ServoStatus};
use taustream_messages::{FaultReason, Phase};
use taustream_motion::{JointArray, MAX_JOINTS};

/// A homing that was asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HomingRun {
    joint: usize,
    /// Every drive was energised.
    pub(crate) energised: bool,
    /// The drive has begun.
    begun: bool,
    /// It is not to go on.
    stopping: bool,
    /// When it was asked for, energised, or stopped.
    since: Nanos,
}

/// The joints whose drives are set up to home themselves.
pub(crate) fn homing_joints(settings: &Settings) -> JointSet {
    let homes = |servo: &&taustream_arm::Servo| {
        servo.protocol.get::<Cia402>().is_some_and(|cia402| cia402.homing.is_some())
    };
    let joints = settings.servos.iter().filter(homes).filter(|servo| servo.joint < MAX_JOINTS);
    joints.fold(JointSet::EMPTY, |all, servo| all.union(JointSet::of(servo.joint)))
}

impl Supervisor {
    /// The joint whose drive is to home itself in the next cycle.
    ///
    /// Real time: a comparison.
    #[must_use]
    pub fn homing_joint(&self) -> Option<usize> {
        let goes_on = |run: &HomingRun| run.energised && !run.stopping && self.phase == Phase::Homing;
        self.homing.filter(goes_on).map(|run| run.joint)
    }

    /// Begins the homing of a joint.
    ///
    /// Real time: bounded work, no allocation.
    pub(crate) fn home(
        &mut self,
        joint: u32,
        cycle_state: &CycleState,
        actions: &mut Actions,
    ) -> Result<AnswerReason, AnswerReason> {
        let (joint, mut pose_rad) = self.check_homing(joint, cycle_state)?;
        if let Some(position_rad) = pose_rad.get_mut(joint) {
            // The same place, without an offset.
            *position_rad -= self.referencing.begin_homing(joint);
        }
        self.watch.restart(&pose_rad);
        actions.pose_rad = Some(pose_rad);
        let since = cycle_state.tick.wake_time;
        self.step(Event::HomeRequested, cycle_state, actions);
        self.homing = Some(HomingRun { joint, energised: false, begun: false, stopping: false, since });
        Ok(AnswerReason::Homing { joint })
    }

    /// The joint, and the pose that is held while it homes, if it may do so now.
    pub(crate) fn check_homing(
        &self,
        joint: u32,
        cycle_state: &CycleState,
    ) -> Result<(usize, JointArray), AnswerReason> {
        let joint = usize::try_from(joint).unwrap_or(usize::MAX);
        if joint >= self.joints + self.axes.len() {
            return Err(AnswerReason::NoSuchJoint { joint });
        }
        if !self.homing_joints.contains(joint) {
            return Err(AnswerReason::NoHoming { joint });
        }
        match self.phase {
            Phase::Locked if self.adopted => return Err(AnswerReason::AdoptFirst),
            Phase::Disabled | Phase::Holding | Phase::Locked => {}
            Phase::Configuring => {
                let reason = self.first_not(cycle_state, DriveState::Disabled);
                return Err(reason.unwrap_or(AnswerReason::SpeedUnknown));
            }
            Phase::Fault | Phase::FastStopping | Phase::Braking => {
                return Err(AnswerReason::ClearFirst { cause: self.cause() });
            }
            Phase::Enabling | Phase::Disabling | Phase::Homing => return Err(AnswerReason::Wait),
            Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping => {
                return Err(AnswerReason::StopFirst);
            }
        }
        if let Some(axis) = self.moving_axis(cycle_state) {
            return Err(AnswerReason::AxisInMotion { axis });
        }
        let measured_rad = self.measured_pose(cycle_state)?;
        let holds = self.phase != Phase::Disabled;
        Ok((joint, if holds { cycle_state.commanded_rad } else { measured_rad }))
    }

    /// Where every joint is, referenced or not: energised there, it stays there. Only if every joint answers, and is at rest.
    fn measured_pose(&self, cycle_state: &CycleState) -> Result<JointArray, AnswerReason> {
        let mut pose_rad = [0.0; MAX_JOINTS];
        for (joint, servo) in self.servos(cycle_state) {
            self.check_answers(cycle_state, (joint, servo))?;
            pose_rad[joint] = servo.position_rad;
        }
        self.check_at_rest()?;
        Ok(pose_rad)
    }

    /// The homing is not to go on; false when none runs.
    pub(crate) fn stop_homing(&mut self, cycle_state: &CycleState) -> bool {
        match &mut self.homing {
            Some(run) if self.phase == Phase::Homing => {
                if !run.stopping {
                    (run.stopping, run.since) = (true, cycle_state.tick.wake_time);
                }
                true
            }
            _ => false,
        }
    }

    /// What the drives say in the phase of homing.
    pub(crate) fn evaluate_homing(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        let Some(mut run) = self.homing else {
            self.step(Event::HomingEnded, cycle_state, actions);
            return;
        };
        let servo = cycle_state.servos.get(run.joint).copied().unwrap_or(ServoStatus::UNKNOWN);
        let enabling = !run.energised;
        let others = self.watch.find_cause_beside(cycle_state, enabling, Some(run.joint));
        let found = others.or_else(|| self.watch.homing_cause(cycle_state, run.joint, enabling));
        let failed = match servo.homing {
            HomingState::Failed { code, object } => {
                let cause = Cause::new(FaultReason::HomingFailed).at_joint(run.joint).code(code);
                let [stated, expected] = servo.refused_numbers;
                Some(Cause { object, ..cause.amount(stated, expected) })
            }
            // By the drive's own driver, for want of feedback.
            HomingState::Aborted if !run.stopping => {
                Some(Cause::new(FaultReason::HomingFailed).at_joint(run.joint))
            }
            HomingState::None
            | HomingState::Preparing
            | HomingState::Running
            | HomingState::Returning
            | HomingState::Attained
            | HomingState::Aborted => None,
        };
        let overdue = || {
            let waits = enabling || (run.stopping && servo.state != DriveState::Homing) || !run.begun;
            let limit_s = self.rules.drive_timeout_s;
            let is_over = waits && cycle_state.tick.wake_time.since_s(run.since) > limit_s;
            let first = self.servos(cycle_state).find(|(_, s)| s.state != DriveState::Enabled);
            let joint = first.map_or(run.joint, |(joint, _)| joint);
            is_over.then(|| Cause::new(FaultReason::BringUp).at_joint(joint).amount(limit_s, limit_s))
        };
        if let Some(cause) = found.or(failed).or_else(overdue) {
            self.raise(Event::StopFault, cause, cycle_state, actions);
            return;
        }
        let all_enabled = self.all(cycle_state, |s| s.state == DriveState::Enabled);
        if enabling && all_enabled {
            (run.energised, run.since) = (true, cycle_state.tick.wake_time);
        }
        run.begun |= servo.state == DriveState::Homing;
        if servo.homing == HomingState::Attained && !run.stopping {
            (run.stopping, run.since) = (true, cycle_state.tick.wake_time);
        }
        self.homing = Some(run);
        if run.energised && run.stopping && all_enabled {
            self.watch.restart(&cycle_state.commanded_rad);
            self.step(Event::HomingEnded, cycle_state, actions);
        } else if enabling && run.stopping {
            // Nothing has moved, and not every drive is energised.
            self.step(Event::DisableRequested, cycle_state, actions);
        }
    }

    /// A joint whose drive homes itself is commanded where it is, in whatever phase the arm is meanwhile, and referenced where
    /// its drive has found its home position.
    pub(crate) fn follow_homing(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        if self.drive_target() != DriveTarget::Enabled {
            return;
        }
        for (joint, servo) in self.servos(cycle_state) {
            let at_rad = match servo.homing {
                HomingState::None | HomingState::Preparing => continue,
                HomingState::Running => servo.position_rad,
                HomingState::Returning | HomingState::Attained | HomingState::Aborted => {
                    servo.hold_position_rad
                }
                HomingState::Failed { .. } => servo.hold_position_rad,
            };
            if servo.homing == HomingState::Attained {
                self.referencing.end_homing(joint);
            }
            if at_rad.is_finite() {
                let pose_rad = actions.pose_rad.get_or_insert(cycle_state.commanded_rad);
                pose_rad[joint] = at_rad;
            }
        }
    }
}
