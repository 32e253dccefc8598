//! The streamer's typed answer to a trajectory.
use crate::{LAYOUT_VERSION, Phase, Text};
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::digits::{Amount, Decimals};

/// A receipt on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct Receipt {
    layout_version: u32,
    code: u32,
    trajectory_id: u64,
    generation: u64,
    tick: u64,
    trajectory_cut: u64,
    joint: u32,
    detail: u32,
    at_s: f64,
    value: f64,
    limit: f64,
    text: Text,
}

/// What became of a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It runs, or runs when the arm is resumed, or when the running one reaches its cut.
    Accepted {
        /// Trajectory time from which it holds.
        from_s: f64,
        /// Cycle number from which it holds; 0 for one that waits for its cut.
        tick: u64,
    },
    /// Nothing changed.
    Rejected(Rejection),
}

/// Why a trajectory was refused: the reason with the offender, as data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// The message is no trajectory; the sentence says which field.
    #[error("malformed: {0}")]
    Malformed(String),
    /// Made for another robot description.
    #[error("wrong robot: its digest differs from the streamer's; plan again with the streamer's robot file")]
    WrongRobot,
    /// Another number of joints.
    #[error("wrong joint count: {got} for an arm of {expected}")]
    JointCount {
        /// The count in the message.
        got: u32,
        /// The arm's count.
        expected: u32,
    },
    /// Not newer than what was accepted before.
    #[error(
        "stale generation {got}: {newest} is the newest one accepted, and {got} is not among the 2^63 numbers after it; read the report and plan again"
    )]
    StaleGeneration {
        /// The generation in the message.
        got: u64,
        /// The newest one accepted.
        newest: u64,
    },
    /// A motion or position limit is exceeded.
    #[error("limit of joint {} exceeded at t = {at_s:.3} s: {} against {} ({what})", joint + 1,
        Decimals::apart(&[*value, *limit], 6).show(*value), Decimals::apart(&[*value, *limit], 6).show(*limit))]
    Limit {
        /// Zero-based index of the joint.
        joint: u32,
        /// Trajectory time.
        at_s: f64,
        /// The value there.
        value: f64,
        /// The limit.
        limit: f64,
        /// Which limit, with its unit.
        what: String,
    },
    /// The arm is not at the trajectory's base.
    #[error("not at base: joint {} is {} rad away; plan from the commanded pose", joint + 1, Amount(*by_rad))]
    NotAtBase {
        /// Zero-based index of the joint.
        joint: u32,
        /// How far.
        by_rad: f64,
    },
    /// The arm is in a phase that takes no trajectory.
    #[error("not ready: the arm is {}", phase.map_or("in an unknown phase", Phase::word))]
    NotReady {
        /// The phase.
        phase: Option<Phase>,
    },
    /// The cut lies behind the last setpoint that was sent.
    #[error(
        "cut at {at_s:.3} s already passed by {by_s:.4} s of trajectory time; plan again with a later cut"
    )]
    CutPassed {
        /// Trajectory time of the cut.
        at_s: f64,
        /// By how much.
        by_s: f64,
    },
    /// The trajectory does not reach the cut, or waits for a later one itself.
    #[error(
        "cut at {at_s:.3} s is outside of what the trajectory runs, {begins_s:.3} s to {ends_s:.3} s; plan again"
    )]
    CutOutside {
        /// Trajectory time of the cut.
        at_s: f64,
        /// From when the trajectory runs.
        begins_s: f64,
        /// When it ends.
        ends_s: f64,
    },
    /// It cuts a trajectory that neither runs nor waits.
    #[error("it cuts trajectory {cut}, but trajectory {running} runs; read the report and plan again")]
    OtherTrajectory {
        /// Id of the trajectory to cut.
        cut: u64,
        /// Id of the one that runs.
        running: u64,
    },
    /// Nothing runs that could be cut.
    #[error("nothing to cut: the arm is {}; plan from the commanded pose once it holds", phase.map_or("in an unknown phase", Phase::word))]
    NothingToCut {
        /// The phase.
        phase: Option<Phase>,
    },
    /// A pause or another change of speed runs, chosen for the motion that is to be replaced.
    #[error(
        "the speed changes: the stop limits would not hold on the replacement; send it again when the speed is settled"
    )]
    SpeedChanges,
    /// It does not repeat the strokes that have begun.
    #[error("kept strokes differ: stroke {} of the trajectory that it cuts is missing, changed, or folded before its end", stroke + 1)]
    KeptStrokesDiffer {
        /// Zero-based index of the stroke.
        stroke: u32,
    },
    /// Its base is not that of the trajectory that it cuts.
    #[error("kept base differs: joint {} by {} rad; repeat the base bit by bit", joint + 1, Amount(*by_rad))]
    KeptBaseDiffers {
        /// Zero-based index of the joint.
        joint: u32,
        /// By how much.
        by_rad: f64,
    },
    /// The streamer came to it after its sender had given up.
    #[error("too late: the streamer came to it {late_s:.3} s after its sender had given up; send it again")]
    TooLate {
        /// By how much.
        late_s: f64,
    },
    /// The streamer had no free slot.
    #[error("busy: another trajectory is being checked; send it again")]
    Busy,
}

mod code {
    pub(super) const ACCEPTED: u32 = 1;
    pub(super) const MALFORMED: u32 = 2;
    pub(super) const WRONG_ROBOT: u32 = 3;
    pub(super) const JOINT_COUNT: u32 = 4;
    pub(super) const STALE: u32 = 5;
    pub(super) const LIMIT: u32 = 6;
    pub(super) const NOT_AT_BASE: u32 = 7;
    pub(super) const NOT_READY: u32 = 8;
    // 9 was the refusal of every cut, up to layout version 3.
    pub(super) const BUSY: u32 = 10;
    pub(super) const TOO_LATE: u32 = 11;
    pub(super) const CUT_PASSED: u32 = 12;
    pub(super) const CUT_OUTSIDE: u32 = 13;
    pub(super) const OTHER_TRAJECTORY: u32 = 14;
    pub(super) const NOTHING_TO_CUT: u32 = 15;
    pub(super) const KEPT_STROKES: u32 = 16;
    pub(super) const KEPT_BASE: u32 = 17;
    pub(super) const SPEED_CHANGES: u32 = 18;
}

impl Receipt {
    /// Writes an outcome down.
    #[must_use]
    pub fn new(trajectory_id: u64, generation: u64, outcome: &Outcome) -> Self {
        let mut r = Self {
            layout_version: LAYOUT_VERSION,
            code: code::BUSY,
            trajectory_id,
            generation,
            tick: 0,
            trajectory_cut: 0,
            joint: 0,
            detail: 0,
            at_s: 0.0,
            value: 0.0,
            limit: 0.0,
            text: Text::default(),
        };
        match outcome {
            Outcome::Accepted { from_s, tick } => {
                (r.code, r.at_s, r.tick) = (code::ACCEPTED, *from_s, *tick);
            }
            Outcome::Rejected(rejection) => r.put(rejection),
        }
        r
    }

    fn put(&mut self, rejection: &Rejection) {
        match rejection {
            Rejection::Malformed(text) => {
                self.code = code::MALFORMED;
                self.text = Text::new(text);
            }
            Rejection::WrongRobot => self.code = code::WRONG_ROBOT,
            Rejection::JointCount { got, expected } => {
                (self.code, self.joint, self.detail) = (code::JOINT_COUNT, *got, *expected);
            }
            Rejection::StaleGeneration { got, newest } => {
                (self.code, self.generation, self.tick) = (code::STALE, *got, *newest);
            }
            Rejection::Limit { joint, at_s, value, limit, what } => {
                (self.code, self.joint, self.at_s) = (code::LIMIT, *joint, *at_s);
                (self.value, self.limit, self.text) = (*value, *limit, Text::new(what));
            }
            Rejection::NotAtBase { joint, by_rad } => {
                (self.code, self.joint, self.value) = (code::NOT_AT_BASE, *joint, *by_rad);
            }
            Rejection::NotReady { phase } => {
                (self.code, self.detail) = (code::NOT_READY, phase.map_or(0, Phase::code));
            }
            Rejection::CutPassed { at_s, by_s } => {
                (self.code, self.at_s, self.value) = (code::CUT_PASSED, *at_s, *by_s);
            }
            Rejection::CutOutside { at_s, begins_s, ends_s } => {
                (self.code, self.at_s) = (code::CUT_OUTSIDE, *at_s);
                (self.value, self.limit) = (*begins_s, *ends_s);
            }
            Rejection::OtherTrajectory { cut, running } => {
                (self.code, self.trajectory_cut, self.tick) = (code::OTHER_TRAJECTORY, *cut, *running);
            }
            Rejection::NothingToCut { phase } => {
                (self.code, self.detail) = (code::NOTHING_TO_CUT, phase.map_or(0, Phase::code));
            }
            Rejection::SpeedChanges => self.code = code::SPEED_CHANGES,
            Rejection::KeptStrokesDiffer { stroke } => {
                (self.code, self.detail) = (code::KEPT_STROKES, *stroke);
            }
            Rejection::KeptBaseDiffers { joint, by_rad } => {
                (self.code, self.joint, self.value) = (code::KEPT_BASE, *joint, *by_rad);
            }
            Rejection::TooLate { late_s } => (self.code, self.value) = (code::TOO_LATE, *late_s),
            Rejection::Busy => self.code = code::BUSY,
        }
    }

    /// Which trajectory it answers.
    #[must_use]
    pub fn trajectory_id(&self) -> u64 {
        self.trajectory_id
    }

    /// Which generation it answers.
    #[must_use]
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The typed outcome; `None` for another layout or an unknown code.
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        if self.layout_version != LAYOUT_VERSION {
            return None;
        }
        let rejection = match self.code {
            code::ACCEPTED => return Some(Outcome::Accepted { from_s: self.at_s, tick: self.tick }),
            code::MALFORMED => Rejection::Malformed(self.text.read()),
            code::WRONG_ROBOT => Rejection::WrongRobot,
            code::JOINT_COUNT => Rejection::JointCount { got: self.joint, expected: self.detail },
            code::STALE => Rejection::StaleGeneration { got: self.generation, newest: self.tick },
            code::LIMIT => Rejection::Limit {
                joint: self.joint,
                at_s: self.at_s,
                value: self.value,
                limit: self.limit,
                what: self.text.read(),
            },
            code::NOT_AT_BASE => Rejection::NotAtBase { joint: self.joint, by_rad: self.value },
            code::NOT_READY => Rejection::NotReady { phase: Phase::from_code(self.detail) },
            code::CUT_PASSED => Rejection::CutPassed { at_s: self.at_s, by_s: self.value },
            code::CUT_OUTSIDE => {
                Rejection::CutOutside { at_s: self.at_s, begins_s: self.value, ends_s: self.limit }
            }
            code::OTHER_TRAJECTORY => {
                Rejection::OtherTrajectory { cut: self.trajectory_cut, running: self.tick }
            }
            code::NOTHING_TO_CUT => Rejection::NothingToCut { phase: Phase::from_code(self.detail) },
            code::SPEED_CHANGES => Rejection::SpeedChanges,
            code::KEPT_STROKES => Rejection::KeptStrokesDiffer { stroke: self.detail },
            code::KEPT_BASE => Rejection::KeptBaseDiffers { joint: self.joint, by_rad: self.value },
            code::TOO_LATE => Rejection::TooLate { late_s: self.value },
            code::BUSY => Rejection::Busy,
            _ => return None,
        };
        Some(Outcome::Rejected(rejection))
    }
}

const _: () = assert!(size_of::<Receipt>() == 320);
