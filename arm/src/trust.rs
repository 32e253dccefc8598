//! What a servo can be trusted with: to hold its load without commands, and to know its multi-turn offset after power-up.
//!
//! Both are properties of the drive that no frame tells, and a wrong belief breaks arms: so neither has a default, and
//! what does not fit the joint is refused with the remedies.
use crate::document::shown;
use crate::reader::Table;
use crate::robot::RobotJoint;
use crate::settings::Servo;
use std::f64::consts::TAU;

/// What a drive does when setpoints stop coming: because the streamer died, or the bus did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// It comes to rest by its own ramp and holds there, energised.
    Hold,
    /// It comes to rest by its own ramp, then removes the torque.
    Ramp,
    /// It removes the torque at once.
    Limp,
}

impl Reaction {
    /// Every reaction.
    pub const ALL: [Self; 3] = [Self::Hold, Self::Ramp, Self::Limp];

    /// The word in settings.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Hold => "hold",
            Self::Ramp => "ramp",
            Self::Limp => "limp",
        }
    }
    /// What happens to the joint, for people.
    #[must_use]
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::Hold => "slows down by the drive's own ramp, off the path, and holds, energised",
            Self::Ramp => "slows down by the drive's own ramp, off the path, then loses its torque",
            Self::Limp => "loses its torque at once",
        }
    }
    /// Whether the joint is without torque in the end.
    #[must_use]
    pub const fn ends_limp(self) -> bool {
        matches!(self, Self::Ramp | Self::Limp)
    }
}

/// What the position feedback still knows after the drive was without power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// The angle, wherever it is inside the feedback range.
    MultiTurn,
    /// The angle but for whole feedback ranges: a single-turn encoder, or a position field that repeats.
    Wraps,
    /// Nothing: it counts from where it was switched on.
    Incremental,
}

impl Feedback {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::MultiTurn, Self::Wraps, Self::Incremental];

    /// The word in settings.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::MultiTurn => "multi-turn",
            Self::Wraps => "wraps",
            Self::Incremental => "incremental",
        }
    }
}

impl Servo {
    /// Link angle after which a feedback that wraps repeats itself.
    #[must_use]
    pub fn feedback_period_rad(&self) -> f64 {
        self.feedback_range_rad[1] - self.feedback_range_rad[0]
    }
}

const REACTION_WORDS: &str = "\"hold\", \"ramp\" or \"limp\": what the drive does when setpoints stop coming";
const FEEDBACK_WORDS: &str =
    "\"multi-turn\", \"wraps\" or \"incremental\": what the feedback knows after power-up";

/// Reads `reaction`.
pub(crate) fn read_reaction(table: &mut Table<'_>) -> Option<Reaction> {
    let word = table.text("reaction", REACTION_WORDS)?;
    let found = Reaction::ALL.into_iter().find(|reaction| reaction.word() == word);
    if found.is_none() {
        table.fault("reaction", &shown(&word), REACTION_WORDS);
    }
    found
}

/// Reads `feedback`.
pub(crate) fn read_feedback(table: &mut Table<'_>) -> Option<Feedback> {
    let word = table.text("feedback", FEEDBACK_WORDS)?;
    let found = Feedback::ALL.into_iter().find(|feedback| feedback.word() == word);
    if found.is_none() {
        table.fault("feedback", &shown(&word), FEEDBACK_WORDS);
    }
    found
}

/// Arms fall when torque goes: a reaction that ends without torque is accepted only where the settings allow it.
pub(crate) fn check_reaction(table: &Table<'_>, servo: &Servo, joint: &RobotJoint) {
    let known = servo.protocol.reactions();
    if !known.contains(&servo.reaction) {
        let names: Vec<String> = known.iter().map(|reaction| format!("{:?}", reaction.word())).collect();
        let expected = format!("{}: a {} servo knows no other", names.join(" or "), servo.protocol.name());
        table.fault("reaction", &shown(servo.reaction.word()), &expected);
        return;
    }
    let falls = servo.reaction.ends_limp() && !servo.limp_is_safe;
    let can_hold = known.contains(&Reaction::Hold);
    if servo.limp_risk_acknowledged && (!falls || can_hold) {
        let expected = if falls {
            "false: this servo can hold, so its reaction is to be \"hold\""
        } else {
            "false: a risk is acknowledged only where a joint may fall (limp_is_safe = false) and its servo cannot hold"
        };
        table.fault("limp_risk_acknowledged", "true", expected);
        return;
    }
    if !falls || servo.limp_risk_acknowledged {
        return;
    }
    let hold = if known.contains(&Reaction::Hold) { "\"hold\"" } else { "a servo that can hold" };
    let acknowledge = if can_hold {
        ""
    } else {
        "; or state limp_risk_acknowledged = true: it then may fall, every enable says so and begins at the first speed"
    };
    let expected = format!(
        "{hold}, as joint {} may not lose its torque (limp_is_safe = false) and with this reaction it {}; or fit a \
         brake or a counterweight and state limp_is_safe = true{acknowledge}",
        joint.name,
        servo.reaction.sentence()
    );
    table.fault("reaction", &shown(servo.reaction.word()), &expected);
}

/// A feedback that knows every angle must know every angle of the joint.
pub(crate) fn check_feedback(table: &Table<'_>, servo: &Servo, joint: &RobotJoint) {
    let ([low, high], [joint_low, joint_high]) = (servo.feedback_range_rad, joint.limits.position_rad);
    if servo.feedback != Feedback::MultiTurn || (low <= joint_low && joint_high <= high) {
        return;
    }
    let expected = format!(
        "a range that contains [{joint_low:?}, {joint_high:?}] of joint {}, or feedback = \"wraps\" with the angles that \
         the feedback distinguishes (one revolution of the motor is {:.6} rad of the link)",
        joint.name,
        TAU / servo.protocol.gear_ratio()
    );
    table.fault("feedback_range_rad", &format!("[{low:?}, {high:?}]"), &expected);
}
