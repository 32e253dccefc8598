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
    /// It runs, or runs when the arm is resumed.
    Accepted {
        /// Trajectory time from which it holds.
        from_s: f64,
        /// Cycle number from which it holds.
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
    /// It cuts a motion; this version accepts trajectories at rest only.
    #[error(
        "cut at {at_s:.3} s refused: this version accepts a trajectory only at rest; use --after-current or stop first"
    )]
    CutUnsupported {
        /// Trajectory time of the cut.
        at_s: f64,
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
    pub(super) const CUT: u32 = 9;
    pub(super) const BUSY: u32 = 10;
    pub(super) const TOO_LATE: u32 = 11;
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
            Rejection::CutUnsupported { at_s } => (self.code, self.at_s) = (code::CUT, *at_s),
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
            code::CUT => Rejection::CutUnsupported { at_s: self.at_s },
            code::TOO_LATE => Rejection::TooLate { late_s: self.value },
            code::BUSY => Rejection::Busy,
            _ => return None,
        };
        Some(Outcome::Rejected(rejection))
    }
}

const _: () = assert!(size_of::<Receipt>() == 312);
