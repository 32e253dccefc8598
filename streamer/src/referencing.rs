//! The multi-turn offset of each joint: what is added to the angle of a drive to get that of the joint.
//!
//! A drive whose feedback repeats itself, or counts from where it was switched on, tells an angle but for an offset.
//! The offset is resolved at the first feedback of the drive, is valid while feedback comes, and is dropped without it. It is added to
//! the feedback of the drives and subtracted from their commands, so nothing between depends on it. A joint whose offset is
//! not known has none, and is not energised.
use crate::answer::AnswerReason;
use crate::cycle_state::CycleState;
use taustream_arm::revolution::{self, OUTSIDE_RAD_MAX, OffsetError as Possible, PERIOD_SHARE_MAX};
use taustream_arm::{Feedback, Servo, Settings};
use taustream_drivers::{DriveState, JointCommand, Nanos};
use taustream_messages::ReferenceState;
use taustream_motion::{JointArray, MAX_JOINTS};

/// A joint that stays within this is called still.
pub const STILL_RAD: f64 = 0.002;
/// After this long.
pub const STILL_S: f64 = 0.2;

/// What was last known of a joint's multi-turn offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    /// Where it stood.
    pub position_rad: f64,
    /// The offset that applied.
    pub offset_rad: f64,
    /// The arm rested when this was noted.
    pub at_rest: bool,
}

/// The last pose of every referenced joint.
pub type LastPoses = [Option<Recorded>; MAX_JOINTS];

/// What a reading means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolved {
    /// What is to be added to it; 0 while it is not known.
    pub offset_rad: f64,
    /// Whether it is known, and its source.
    pub reference_state: ReferenceState,
    /// Where it is not known for being too far: the distance of the nearest possible angle from the last pose.
    pub by_rad: f64,
}

/// How one joint's feedback tells its angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// What the feedback knows after power-up.
    pub feedback: Feedback,
    /// After this it repeats itself.
    pub period_rad: f64,
    /// The joint's range.
    pub range_rad: [f64; 2],
}

impl Rule {
    fn of(servo: &Servo, settings: &Settings) -> Self {
        let joint = settings.slot(servo.joint);
        let range_rad = joint.map_or([0.0; 2], |joint| joint.limits.position_rad);
        Self { feedback: servo.feedback, period_rad: servo.feedback_period_rad(), range_rad }
    }

    /// What a first reading means. `adopted`: the drive was not without power since `recorded` was noted.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn resolve(&self, reading_rad: f64, recorded: Option<Recorded>, adopted: bool) -> Resolved {
        let known = |reference_state, offset_rad| Resolved { offset_rad, reference_state, by_rad: 0.0 };
        match (self.feedback, recorded) {
            (Feedback::MultiTurn, _) => known(ReferenceState::Encoder, 0.0),
            // A record of rest was written while the drive was off: whoever energised it since wrote none.
            (_, Some(recorded)) if adopted && !recorded.at_rest => {
                known(ReferenceState::Adoption, recorded.offset_rad)
            }
            (Feedback::Incremental, _) => known(ReferenceState::Incremental, 0.0),
            (Feedback::Wraps, recorded) => {
                match (revolution::only_offset_rad(reading_rad, self.period_rad, self.range_rad), recorded) {
                    (Ok(offset_rad), _) => known(ReferenceState::Encoder, offset_rad),
                    (Err(Possible::None), None) => known(ReferenceState::OutOfRange, 0.0),
                    (Err(Possible::Several), None) => known(ReferenceState::NoRecord, 0.0),
                    (Err(_), Some(recorded)) => self.by_record(reading_rad, recorded, adopted),
                }
            }
        }
    }

    fn by_record(&self, reading_rad: f64, recorded: Recorded, adopted: bool) -> Resolved {
        let offset_rad = revolution::nearest_offset_rad(reading_rad, self.period_rad, recorded.position_rad);
        let by_rad = (reading_rad + offset_rad - recorded.position_rad).abs();
        if !recorded.at_rest || adopted {
            return Resolved { offset_rad: 0.0, reference_state: ReferenceState::RecordMoving, by_rad };
        }
        // Not-a-number is too far.
        let near = by_rad <= PERIOD_SHARE_MAX * self.period_rad;
        let reference_state = if near { ReferenceState::Record } else { ReferenceState::RecordFar };
        Resolved { offset_rad: if near { offset_rad } else { 0.0 }, reference_state, by_rad }
    }

    /// The offset when the operator sets a joint that reads `reading_rad` to `at_rad`.
    fn stated(&self, joint: usize, reading_rad: f64, at_rad: f64) -> Result<f64, AnswerReason> {
        let [low_rad, high_rad] = self.range_rad;
        if !(low_rad - OUTSIDE_RAD_MAX..=high_rad + OUTSIDE_RAD_MAX).contains(&at_rad) {
            return Err(AnswerReason::ReferenceOutside { joint, at_rad, range_rad: self.range_rad });
        }
        match self.feedback {
            Feedback::MultiTurn => Err(AnswerReason::ReferenceNotNeeded { joint, reading_rad, at_rad }),
            Feedback::Incremental => Ok(at_rad - reading_rad),
            Feedback::Wraps => {
                let offset_rad = revolution::nearest_offset_rad(reading_rad, self.period_rad, at_rad);
                let nearest_rad = reading_rad + offset_rad;
                let limit_rad = PERIOD_SHARE_MAX * self.period_rad;
                if (nearest_rad - at_rad).abs() <= limit_rad {
                    Ok(offset_rad)
                } else {
                    Err(AnswerReason::ReferenceFar { joint, at_rad, nearest_rad, limit_rad })
                }
            }
        }
    }
}

/// The referencing of one joint.
#[derive(Clone, Copy, Debug)]
struct JointReferencing {
    rule: Rule,
    resolved: Resolved,
    recorded: Option<Recorded>,
    present: bool,
    /// Where it was last seen to begin to rest, and when.
    anchor: (f64, Nanos),
}

/// The referencing of all joints.
#[derive(Clone, Debug)]
pub struct Referencing {
    entries: Vec<Option<JointReferencing>>,
}

impl Referencing {
    /// Nothing known yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let mut entries = vec![None; MAX_JOINTS];
        for servo in &settings.servos {
            let resolved =
                Resolved { offset_rad: 0.0, reference_state: ReferenceState::NoFeedback, by_rad: 0.0 };
            let rule = Rule::of(servo, settings);
            if let Some(slot) = entries.get_mut(servo.joint) {
                *slot = Some(JointReferencing {
                    rule,
                    resolved,
                    recorded: None,
                    present: false,
                    anchor: (f64::NAN, Nanos(0)),
                });
            }
        }
        Self { entries }
    }

    /// Takes the last pose that is known.
    pub fn restore_poses(&mut self, last_poses: &LastPoses) {
        for (entry, recorded) in self.entries.iter_mut().zip(last_poses) {
            if let Some(entry) = entry {
                entry.recorded = *recorded;
            }
        }
    }

    /// Converts the feedback of the drives into joint angles; resolves and drops offsets as drives come and go.
    ///
    /// Real time: arithmetic only.
    pub fn read(&mut self, cycle_state: &mut CycleState) {
        for (entry, servo) in self.entries.iter_mut().zip(&mut cycle_state.servos) {
            let Some(entry) = entry else { continue };
            let present = servo.state.reports() && servo.position_rad.is_finite();
            match (entry.present, present) {
                (false, true) => {
                    let adopted = servo.state == DriveState::Adopted;
                    entry.resolved = entry.rule.resolve(servo.position_rad, entry.recorded, adopted);
                }
                // It may come back from a power cut: only a pose recorded at rest resolves its offset then.
                (true, false) => {
                    entry.resolved =
                        Resolved { offset_rad: 0.0, reference_state: ReferenceState::NoFeedback, by_rad: 0.0 }
                }
                (true, true) | (false, false) => {}
            }
            entry.present = present;
            servo.position_rad += entry.resolved.offset_rad;
            servo.hold_position_rad += entry.resolved.offset_rad;
            let off = servo.state == DriveState::Disabled;
            let near = (servo.position_rad - entry.anchor.0).abs() <= STILL_RAD;
            if !off || !near {
                entry.anchor = (servo.position_rad, cycle_state.tick.wake_time);
            }
            if present && entry.resolved.reference_state.is_referenced() {
                entry.recorded = Some(Recorded {
                    position_rad: servo.position_rad,
                    offset_rad: entry.resolved.offset_rad,
                    at_rest: off && cycle_state.tick.wake_time.since_s(entry.anchor.1) >= STILL_S,
                });
            }
        }
    }

    /// Commands as the drives count.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn to_drives(&self, commands: &[JointCommand; MAX_JOINTS]) -> [JointCommand; MAX_JOINTS] {
        let mut drive_commands = *commands;
        for (command, entry) in drive_commands.iter_mut().zip(&self.entries) {
            command.position_rad -= entry.map_or(0.0, |entry| entry.resolved.offset_rad);
        }
        drive_commands
    }

    /// What is known of a joint.
    #[must_use]
    pub fn resolved(&self, joint: usize) -> Resolved {
        let unknown = Resolved { offset_rad: 0.0, reference_state: ReferenceState::NoFeedback, by_rad: 0.0 };
        self.entries.get(joint).copied().flatten().map_or(unknown, |entry| entry.resolved)
    }

    /// Offsets of all joints.
    #[must_use]
    pub fn offsets_rad(&self) -> JointArray {
        std::array::from_fn(|joint| self.resolved(joint).offset_rad)
    }

    /// Where a joint measured at `position_rad` is if the operator's word is right that it stands at `at_rad`, and what is
    /// then added to its reading.
    ///
    /// Real time: arithmetic only.
    ///
    /// # Errors
    /// Why the word cannot be right, or is not needed.
    pub fn check_reference(
        &self,
        joint: usize,
        position_rad: f64,
        at_rad: f64,
    ) -> Result<(f64, f64), AnswerReason> {
        let Some(entry) = self.entries.get(joint).and_then(Option::as_ref) else {
            return Err(AnswerReason::NoSuchJoint { joint });
        };
        let reading_rad = position_rad - entry.resolved.offset_rad;
        let offset_rad = entry.rule.stated(joint, reading_rad, at_rad)?;
        Ok((reading_rad + offset_rad, offset_rad))
    }

    /// The homing of a joint begins: its position means nothing any more. Gives back what was added to its reading.
    ///
    /// Real time: arithmetic only.
    pub fn begin_homing(&mut self, joint: usize) -> f64 {
        self.set_state(joint, ReferenceState::Homing)
    }

    /// The drive of a joint has found its home position, and counts from there.
    ///
    /// Real time: arithmetic only.
    pub fn end_homing(&mut self, joint: usize) {
        if self.resolved(joint).reference_state == ReferenceState::Homing {
            self.set_state(joint, ReferenceState::Homed);
        }
    }

    fn set_state(&mut self, joint: usize, reference_state: ReferenceState) -> f64 {
        let Some(entry) = self.entries.get_mut(joint).and_then(Option::as_mut) else { return 0.0 };
        let offset_rad = entry.resolved.offset_rad;
        entry.resolved = Resolved { offset_rad: 0.0, reference_state, by_rad: 0.0 };
        (entry.recorded, entry.anchor) = (None, (f64::NAN, Nanos(0)));
        offset_rad
    }

    /// Takes the operator's word. Gives back where the joint then is.
    ///
    /// Real time: arithmetic only.
    ///
    /// # Errors
    /// As [`Referencing::check_reference`].
    pub fn set_reference(
        &mut self,
        joint: usize,
        position_rad: f64,
        at_rad: f64,
    ) -> Result<f64, AnswerReason> {
        let (at_rad, offset_rad) = self.check_reference(joint, position_rad, at_rad)?;
        if let Some(entry) = self.entries.get_mut(joint).and_then(Option::as_mut) {
            entry.resolved = Resolved { offset_rad, reference_state: ReferenceState::Operator, by_rad: 0.0 };
            // Where it rested before was measured by another offset.
            (entry.recorded, entry.anchor) = (None, (f64::NAN, Nanos(0)));
        }
        Ok(at_rad)
    }
}
