//! On which turn each joint stands: what is added to a drive's angle to get the joint's.
//!
//! A drive whose feedback repeats itself, or counts from where it was switched on, tells an angle but for an offset.
//! The offset is found when the drive is first heard, stays while it is heard, and is forgotten with it. It is added to
//! what the drives answer and taken off what they are told, so nothing between knows of it. A joint whose offset is
//! not known has none, and is not energised.
use crate::facts::Facts;
use crate::words::Why;
use taustream_arm::turn::{self, TURN_PART_MAX, Turns as Possible};
use taustream_arm::{Feedback, Servo, Settings};
use taustream_drivers::{DriveState, JointCommand};
use taustream_messages::Standing;
use taustream_motion::{JointArray, MAX_JOINTS};

/// What was last known of a joint's turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    /// Where it stood.
    pub position_rad: f64,
    /// The offset that applied.
    pub offset_rad: f64,
    /// The arm rested when this was noted.
    pub at_rest: bool,
}

/// The last pose of every joint whose turn was known.
pub type Memory = [Option<Recorded>; MAX_JOINTS];

/// What a reading means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolved {
    /// What is to be added to it; 0 while it is not known.
    pub offset_rad: f64,
    /// Whether it is known, and whence.
    pub standing: Standing,
    /// Where it is not known for being too far: by how much the nearest turn misses the last pose.
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
        let joint = settings.robot.joints.get(servo.joint);
        let range_rad = joint.map_or([0.0; 2], |joint| joint.limits.position_rad);
        Self { feedback: servo.feedback, period_rad: servo.feedback_period_rad(), range_rad }
    }

    /// What a first reading means. `adopted`: the drive was not without power since `recorded` was noted.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn resolve(&self, reading_rad: f64, recorded: Option<Recorded>, adopted: bool) -> Resolved {
        let known = |standing, offset_rad| Resolved { offset_rad, standing, by_rad: 0.0 };
        match (self.feedback, recorded) {
            (Feedback::MultiTurn, _) => known(Standing::Encoder, 0.0),
            (_, Some(recorded)) if adopted => known(Standing::Adoption, recorded.offset_rad),
            (Feedback::Incremental, _) => known(Standing::Incremental, 0.0),
            (Feedback::Wraps, recorded) => {
                match (turn::only_turn_rad(reading_rad, self.period_rad, self.range_rad), recorded) {
                    (Ok(offset_rad), _) => known(Standing::Encoder, offset_rad),
                    (Err(Possible::None), _) => known(Standing::OutOfRange, 0.0),
                    (Err(Possible::Several), None) => known(Standing::NoRecord, 0.0),
                    (Err(Possible::Several), Some(recorded)) => self.by_record(reading_rad, recorded),
                }
            }
        }
    }

    fn by_record(&self, reading_rad: f64, recorded: Recorded) -> Resolved {
        let offset_rad = turn::nearest_turn_rad(reading_rad, self.period_rad, recorded.position_rad);
        let by_rad = (reading_rad + offset_rad - recorded.position_rad).abs();
        if !recorded.at_rest {
            return Resolved { offset_rad: 0.0, standing: Standing::RecordMoving, by_rad };
        }
        // Not-a-number is too far.
        let near = by_rad <= TURN_PART_MAX * self.period_rad;
        let standing = if near { Standing::Record } else { Standing::RecordFar };
        Resolved { offset_rad: if near { offset_rad } else { 0.0 }, standing, by_rad }
    }

    /// The offset when somebody says that a joint which reads `reading_rad` stands at `at_rad`.
    fn stated(&self, joint: usize, reading_rad: f64, at_rad: f64) -> Result<f64, Why> {
        if !(self.range_rad[0]..=self.range_rad[1]).contains(&at_rad) {
            return Err(Why::ReferenceOutside { joint, at_rad, range_rad: self.range_rad });
        }
        match self.feedback {
            Feedback::MultiTurn => Err(Why::ReferenceNotNeeded { joint, reading_rad, at_rad }),
            Feedback::Incremental => Ok(at_rad - reading_rad),
            Feedback::Wraps => {
                let offset_rad = turn::nearest_turn_rad(reading_rad, self.period_rad, at_rad);
                let nearest_rad = reading_rad + offset_rad;
                let limit_rad = TURN_PART_MAX * self.period_rad;
                if (nearest_rad - at_rad).abs() <= limit_rad {
                    Ok(offset_rad)
                } else {
                    Err(Why::ReferenceFar { joint, at_rad, nearest_rad, limit_rad })
                }
            }
        }
    }
}

/// One joint's turn.
#[derive(Clone, Copy, Debug)]
struct Turn {
    rule: Rule,
    resolved: Resolved,
    recorded: Option<Recorded>,
    present: bool,
}

/// The turns of all joints.
#[derive(Clone, Debug)]
pub struct Turns {
    turns: Vec<Option<Turn>>,
}

impl Turns {
    /// Nothing known yet.
    #[must_use]
    pub fn new(settings: &Settings) -> Self {
        let mut turns = vec![None; MAX_JOINTS];
        for servo in &settings.servos {
            let resolved = Resolved { offset_rad: 0.0, standing: Standing::Unheard, by_rad: 0.0 };
            let rule = Rule::of(servo, settings);
            if let Some(slot) = turns.get_mut(servo.joint) {
                *slot = Some(Turn { rule, resolved, recorded: None, present: false });
            }
        }
        Self { turns }
    }

    /// Takes the last pose that is known.
    pub fn recall(&mut self, memory: &Memory) {
        for (turn, recorded) in self.turns.iter_mut().zip(memory) {
            if let Some(turn) = turn {
                turn.recorded = *recorded;
            }
        }
    }

    /// Turns what the drives answered into joint angles; finds and forgets turns as drives come and go.
    ///
    /// Real time: arithmetic only.
    pub fn read(&mut self, facts: &mut Facts) {
        for (turn, servo) in self.turns.iter_mut().zip(&mut facts.servos) {
            let Some(turn) = turn else { continue };
            let present = servo.state.reports() && servo.position_rad.is_finite();
            match (turn.present, present) {
                (false, true) => {
                    let adopted = servo.state == DriveState::Adopted;
                    turn.resolved = turn.rule.resolve(servo.position_rad, turn.recorded, adopted);
                }
                // It may come back from a power cut: only what was seen at rest tells its turn then.
                (true, false) => {
                    turn.resolved = Resolved { offset_rad: 0.0, standing: Standing::Unheard, by_rad: 0.0 }
                }
                (true, true) | (false, false) => {}
            }
            turn.present = present;
            servo.position_rad += turn.resolved.offset_rad;
            servo.held_rad += turn.resolved.offset_rad;
            if present && turn.resolved.standing.is_referenced() {
                turn.recorded = Some(Recorded {
                    position_rad: servo.position_rad,
                    offset_rad: turn.resolved.offset_rad,
                    at_rest: servo.state == DriveState::Disabled,
                });
            }
        }
    }

    /// Commands as the drives count.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn tell(&self, commands: &[JointCommand; MAX_JOINTS]) -> [JointCommand; MAX_JOINTS] {
        let mut told = *commands;
        for (command, turn) in told.iter_mut().zip(&self.turns) {
            command.position_rad -= turn.map_or(0.0, |turn| turn.resolved.offset_rad);
        }
        told
    }

    /// What is known of a joint.
    #[must_use]
    pub fn resolved(&self, joint: usize) -> Resolved {
        let unknown = Resolved { offset_rad: 0.0, standing: Standing::Unheard, by_rad: 0.0 };
        self.turns.get(joint).copied().flatten().map_or(unknown, |turn| turn.resolved)
    }

    /// Offsets of all joints.
    #[must_use]
    pub fn offsets_rad(&self) -> JointArray {
        std::array::from_fn(|joint| self.resolved(joint).offset_rad)
    }

    /// Takes the operator's word that a joint measured at `position_rad` stands at `at_rad`. Gives back where it then is.
    ///
    /// Real time: arithmetic only.
    ///
    /// # Errors
    /// Why the word cannot be right, or is not needed.
    pub fn refer(&mut self, joint: usize, position_rad: f64, at_rad: f64) -> Result<f64, Why> {
        let Some(turn) = self.turns.get_mut(joint).and_then(Option::as_mut) else {
            return Err(Why::NoSuchJoint { joint });
        };
        let reading_rad = position_rad - turn.resolved.offset_rad;
        let offset_rad = turn.rule.stated(joint, reading_rad, at_rad)?;
        turn.resolved = Resolved { offset_rad, standing: Standing::Operator, by_rad: 0.0 };
        Ok(reading_rad + offset_rad)
    }
}
