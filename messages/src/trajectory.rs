//! The trajectory message and the one door through which it becomes a checked trajectory.
use crate::{LAYOUT_VERSION, clock};
use iceoryx2::prelude::ZeroCopySend;
use std::time::Duration;
use taustream_motion::{JointArray, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory, TrajectoryError};

/// Hash over everything that changes what a setpoint means (SHA-256, arm/src/digest.rs).
pub type RobotDigest = [u8; 32];

/// One stroke on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct StrokeMessage {
    start_s: f64,
    duration_s: f64,
    n: u32,
    reserved: u32,
    delta_rad: [f64; MAX_JOINTS],
}

/// A trajectory on the wire. Fields stay private: build it with [`TrajectoryMessage::new`], read it with
/// [`CheckedTrajectory::try_from`].
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct TrajectoryMessage {
    layout_version: u32,
    joint_count: u32,
    trajectory_id: u64,
    generation: u64,
    robot_digest: [u8; 32],
    replaces: u32,
    stroke_count: u32,
    cut_trajectory_id: u64,
    cut_s: f64,
    valid_until_ns: u64,
    base_rad: [f64; MAX_JOINTS],
    strokes: [StrokeMessage; MAX_STROKES],
}

/// Whether a generation is newer than another. Numbers wrap round: the 2^63 numbers after one are newer than it, so that
/// no number is the last, and none locks out those that follow.
#[must_use]
pub fn is_newer(generation: u64, than: u64) -> bool {
    (1..1 << 63).contains(&generation.wrapping_sub(than))
}

/// What a trajectory replaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Replaces {
    /// Nothing: the arm rests at the base pose.
    Rest,
    /// The trajectory of this id is cut at its trajectory time.
    Cut {
        /// Id of the trajectory to cut.
        trajectory_id: u64,
        /// Trajectory time of the cut.
        at_s: f64,
    },
}

/// A message whose every field was checked.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedTrajectory {
    /// Names the trajectory.
    pub trajectory_id: u64,
    /// Rises with every trajectory of an arm; see [`crate::Report::generation`].
    pub generation: u64,
    /// The robot it was made for.
    pub robot_digest: RobotDigest,
    /// What it replaces.
    pub replaces: Replaces,
    /// The motion.
    pub trajectory: Trajectory,
}

/// Why a message is not a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MessageError {
    /// Written by another version.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use planner and streamer of one release")]
    Layout {
        /// The version in the message.
        got: u32,
    },
    /// The trajectory id is zero.
    #[error("trajectory id 0; ids start at 1")]
    NoId,
    /// Neither rest nor cut.
    #[error("replaces code {got}; 0 (rest) or 1 (cut)")]
    Replaces {
        /// The code in the message.
        got: u32,
    },
    /// The cut time is not a finite time at or after the start.
    #[error("cut at {at_s} s; expected a finite time at or after 0 s")]
    CutTime {
        /// The time in the message.
        at_s: f64,
    },
    /// A count is larger than its array.
    #[error("{what} is {got}; at most {most}")]
    Count {
        /// `joint_count` or `stroke_count`.
        what: &'static str,
        /// The count in the message.
        got: u32,
        /// The largest that fits.
        most: usize,
    },
    /// The motion itself is at fault.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

const REST: u32 = 0;
const CUT: u32 = 1;

impl TrajectoryMessage {
    /// Writes a checked trajectory down.
    #[must_use]
    pub fn new(checked: &CheckedTrajectory) -> Box<Self> {
        let (replaces, cut_trajectory_id, cut_s) = match checked.replaces {
            Replaces::Rest => (REST, 0, 0.0),
            Replaces::Cut { trajectory_id, at_s } => (CUT, trajectory_id, at_s),
        };
        let mut strokes = [StrokeMessage::EMPTY; MAX_STROKES];
        for (slot, stroke) in strokes.iter_mut().zip(checked.trajectory.strokes()) {
            *slot = StrokeMessage::from(stroke);
        }
        let count = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        Box::new(Self {
            layout_version: LAYOUT_VERSION,
            joint_count: count(checked.trajectory.joints()),
            trajectory_id: checked.trajectory_id,
            generation: checked.generation,
            robot_digest: checked.robot_digest,
            replaces,
            stroke_count: count(checked.trajectory.strokes().len()),
            cut_trajectory_id,
            cut_s,
            valid_until_ns: u64::MAX,
            base_rad: *checked.trajectory.base_rad(),
            strokes,
        })
    }

    /// The same, for a sender that gives up after `valid_for`: it is not accepted later than that.
    #[must_use]
    pub fn valid_for(mut self: Box<Self>, valid_for: Duration) -> Box<Self> {
        self.valid_until_ns = clock::ns_after(valid_for);
        self
    }

    /// `CLOCK_MONOTONIC` until which the sender waits, ns; `u64::MAX` when it has not said so.
    #[must_use]
    pub fn claimed_valid_until_ns(&self) -> u64 {
        self.valid_until_ns
    }

    /// The id that the sender claims, for the receipt of a message that is not accepted.
    #[must_use]
    pub fn claimed_id(&self) -> u64 {
        self.trajectory_id
    }

    /// The generation that the sender claims, for the receipt.
    #[must_use]
    pub fn claimed_generation(&self) -> u64 {
        self.generation
    }

    /// The raw bits of the message's numbers, for tests that send hostile ones.
    #[doc(hidden)]
    #[must_use]
    pub fn corrupted(mut self: Box<Self>, how: Corrupted) -> Box<Self> {
        match how {
            Corrupted::Layout(v) => self.layout_version = v,
            Corrupted::Joints(v) => self.joint_count = v,
            Corrupted::StrokeCount(v) => self.stroke_count = v,
            Corrupted::Exponent(v) => self.strokes[0].n = v,
            Corrupted::Delta(v) => self.strokes[0].delta_rad[0] = v,
            Corrupted::Duration(v) => self.strokes[0].duration_s = v,
            Corrupted::Start(v) => self.strokes[0].start_s = v,
            Corrupted::Base(v) => self.base_rad[0] = v,
            Corrupted::Replaces(v) => self.replaces = v,
            Corrupted::Digest(v) => self.robot_digest[0] ^= v,
        }
        self
    }
}

/// How a test spoils a message.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub enum Corrupted {
    Layout(u32),
    Joints(u32),
    StrokeCount(u32),
    Exponent(u32),
    Delta(f64),
    Duration(f64),
    Start(f64),
    Base(f64),
    Replaces(u32),
    Digest(u8),
}

impl StrokeMessage {
    const EMPTY: Self =
        Self { start_s: 0.0, duration_s: 0.0, n: 0, reserved: 0, delta_rad: [0.0; MAX_JOINTS] };
}

impl From<&Stroke> for StrokeMessage {
    fn from(s: &Stroke) -> Self {
        Self { start_s: s.start_s, duration_s: s.duration_s, n: s.n, reserved: 0, delta_rad: s.delta_rad }
    }
}

impl TryFrom<&TrajectoryMessage> for CheckedTrajectory {
    type Error = MessageError;

    /// Checks every field of a message that was copied out of shared memory.
    fn try_from(m: &TrajectoryMessage) -> Result<Self, MessageError> {
        if m.layout_version != LAYOUT_VERSION {
            return Err(MessageError::Layout { got: m.layout_version });
        }
        if m.trajectory_id == 0 {
            return Err(MessageError::NoId);
        }
        let replaces = match m.replaces {
            REST => Replaces::Rest,
            CUT if m.cut_s.is_finite() && m.cut_s >= 0.0 => {
                Replaces::Cut { trajectory_id: m.cut_trajectory_id, at_s: m.cut_s }
            }
            CUT => return Err(MessageError::CutTime { at_s: m.cut_s }),
            got => return Err(MessageError::Replaces { got }),
        };
        let joints = count("joint_count", m.joint_count, MAX_JOINTS)?;
        let stroke_count = count("stroke_count", m.stroke_count, MAX_STROKES)?;
        let strokes: Vec<Stroke> = m
            .strokes
            .iter()
            .take(stroke_count)
            .map(|s| Stroke { start_s: s.start_s, duration_s: s.duration_s, n: s.n, delta_rad: s.delta_rad })
            .collect();
        let base: JointArray = m.base_rad;
        Ok(Self {
            trajectory_id: m.trajectory_id,
            generation: m.generation,
            robot_digest: m.robot_digest,
            replaces,
            trajectory: Trajectory::new(joints, base, &strokes)?,
        })
    }
}

fn count(what: &'static str, got: u32, most: usize) -> Result<usize, MessageError> {
    usize::try_from(got).ok().filter(|n| *n <= most).ok_or(MessageError::Count { what, got, most })
}

const _: () = assert!(size_of::<StrokeMessage>() == 152);
const _: () = assert!(size_of::<TrajectoryMessage>() == 216 + 152 * MAX_STROKES);
