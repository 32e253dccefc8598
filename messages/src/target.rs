//! Streams of targets to the planner and its answers (request-response).
//!
//! One request is one target, or a chunk of targets with times. The newest request counts: the planner answers those
//! that it did not come to as superseded.
use crate::{LAYOUT_VERSION, Text};
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Most targets in a chunk.
pub const TARGETS_MAX: usize = 64;
/// Farthest that a target may lie in the future, s.
pub const DUE_S_MAX: f64 = 60.0;

/// One target on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
struct WireTarget {
    due_s: f64,
    position_rad: [f64; MAX_JOINTS],
    velocity_rad_s: [f64; MAX_JOINTS],
}

/// A request on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct TargetRequest {
    layout_version: u32,
    joint_count: u32,
    target_count: u32,
    sender_pid: u32,
    sequence: u64,
    sent_ns: u64,
    valid_s: f64,
    targets: [WireTarget; TARGETS_MAX],
}

/// Where the arm is wanted, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// When, s after the request was sent; 0 in a request of one target: as soon as the limits allow.
    pub due_s: f64,
    /// Position of each joint, rad.
    pub position_rad: JointArray,
    /// Velocity of each joint there, rad/s; `None` where the sender states none.
    pub velocity_rad_s: Option<JointArray>,
}

/// A checked request: 1 to [`TARGETS_MAX`] targets in the order of their times.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedTargets {
    /// How many joints each target has.
    pub joints: usize,
    /// The sender's number of this request.
    pub sequence: u64,
    /// CLOCK_MONOTONIC of the sending, ns.
    pub sent_ns: u64,
    /// For how long after the sending it may move the arm, s: the dead man's time of a jog, [`DUE_S_MAX`] where nobody minds.
    pub valid_s: f64,
    /// The targets.
    pub targets: Vec<Target>,
}

/// Why a request is refused before it is looked at further.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// Written by another version.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use sender and planner of one release")]
    Layout {
        /// The version in the message.
        got: u32,
    },
    /// Not 1 to [`MAX_JOINTS`] joints.
    #[error("{got} joint values; an arm has 1 to {MAX_JOINTS}")]
    Joints {
        /// The count in the message.
        got: u32,
    },
    /// No target, or too many.
    #[error("{got} targets; a request has 1 to {TARGETS_MAX}")]
    Count {
        /// The count in the message.
        got: u32,
    },
    /// A number that is not finite, or a value of a joint that the arm does not have.
    #[error("target {}, joint {}: {value} is not a finite number of this arm", target + 1, joint + 1)]
    Value {
        /// Zero-based index of the target.
        target: usize,
        /// Zero-based index of the joint.
        joint: usize,
        /// The value in the message.
        value: f64,
    },
    /// No time for which it is valid, or too long a one.
    #[error("valid for {valid_s} s; more than 0 and at most {DUE_S_MAX} s are possible")]
    Valid {
        /// The time in the message.
        valid_s: f64,
    },
    /// A time before the one of the target before it, or too far ahead.
    #[error(
        "target {} is due at {due_s} s; times must rise, from 0 to {DUE_S_MAX} s after the sending", target + 1
    )]
    Due {
        /// Zero-based index of the target.
        target: usize,
        /// The time in the message.
        due_s: f64,
    },
}

impl TargetRequest {
    /// Writes targets down; those beyond [`TARGETS_MAX`] are counted and not carried, so that the reader refuses them.
    #[must_use]
    pub fn new(targets: &CheckedTargets) -> Self {
        let nothing =
            WireTarget { due_s: 0.0, position_rad: [0.0; MAX_JOINTS], velocity_rad_s: [0.0; MAX_JOINTS] };
        let mut request = Self {
            layout_version: LAYOUT_VERSION,
            joint_count: u32::try_from(targets.joints).unwrap_or(u32::MAX),
            target_count: u32::try_from(targets.targets.len()).unwrap_or(u32::MAX),
            sender_pid: std::process::id(),
            sequence: targets.sequence,
            sent_ns: targets.sent_ns,
            valid_s: targets.valid_s,
            targets: [nothing; TARGETS_MAX],
        };
        for (slot, target) in request.targets.iter_mut().zip(&targets.targets) {
            *slot = WireTarget {
                due_s: target.due_s,
                position_rad: target.position_rad,
                velocity_rad_s: target.velocity_rad_s.unwrap_or([f64::NAN; MAX_JOINTS]),
            };
        }
        request
    }

    /// The sender's number of this request, as it stands in the message.
    #[must_use]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// The process that sends, as it says itself.
    #[must_use]
    pub fn sender_pid(&self) -> u32 {
        self.sender_pid
    }
}

impl TryFrom<&TargetRequest> for CheckedTargets {
    type Error = TargetError;

    fn try_from(r: &TargetRequest) -> Result<Self, TargetError> {
        if r.layout_version != LAYOUT_VERSION {
            return Err(TargetError::Layout { got: r.layout_version });
        }
        let in_range = |got: u32, most: usize| usize::try_from(got).ok().filter(|n| (1..=most).contains(n));
        let joints = in_range(r.joint_count, MAX_JOINTS).ok_or(TargetError::Joints { got: r.joint_count })?;
        let count =
            in_range(r.target_count, TARGETS_MAX).ok_or(TargetError::Count { got: r.target_count })?;
        let valid_s = r.valid_s;
        if !(valid_s > 0.0 && valid_s <= DUE_S_MAX) {
            return Err(TargetError::Valid { valid_s });
        }
        let mut targets: Vec<Target> = Vec::with_capacity(count);
        for (index, wire) in r.targets.iter().take(count).enumerate() {
            let earliest_s = targets.last().map_or(0.0, |before| before.due_s);
            if !(wire.due_s >= earliest_s && wire.due_s <= DUE_S_MAX) {
                return Err(TargetError::Due { target: index, due_s: wire.due_s });
            }
            targets.push(Target {
                due_s: wire.due_s,
                position_rad: values(index, joints, &wire.position_rad)?,
                velocity_rad_s: velocities(index, joints, &wire.velocity_rad_s)?,
            });
        }
        Ok(Self { joints, sequence: r.sequence, sent_ns: r.sent_ns, valid_s, targets })
    }
}

/// All finite, and zero beyond the arm's joints.
fn values(target: usize, joints: usize, all: &JointArray) -> Result<JointArray, TargetError> {
    let wrong = all.iter().enumerate().find(|(joint, v)| !v.is_finite() || (*joint >= joints && **v != 0.0));
    match wrong {
        Some((joint, &value)) => Err(TargetError::Value { target, joint, value }),
        None => Ok(*all),
    }
}

/// Either all or none of the arm's joints have a velocity; NaN stands for none.
fn velocities(target: usize, joints: usize, all: &JointArray) -> Result<Option<JointArray>, TargetError> {
    if all.iter().all(|v| v.is_nan()) {
        return Ok(None);
    }
    values(target, joints, all).map(Some)
}

/// The answer on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct TargetReply {
    layout_version: u32,
    kind: u32,
    sequence: u64,
    trajectory_id: u64,
    cut_s: f64,
    rest_in_s: f64,
    planning_s: f64,
    text: Text,
}

/// What became of a request.
#[derive(Clone, Debug, PartialEq)]
pub enum TargetOutcome {
    /// The arm moves towards it.
    Taken {
        /// The trajectory that carries it.
        trajectory_id: u64,
        /// Trajectory time from which it differs from the motion before.
        cut_s: f64,
        /// When the committed motion ends at rest, s after the cut at full speed.
        rest_in_s: f64,
        /// How long planning took, s.
        planning_s: f64,
        /// What differs from what was asked, such as a target moved inside the limits; empty if nothing.
        note: String,
    },
    /// A newer request came before this one was looked at.
    Superseded,
    /// The motion before goes on, to its end at rest.
    Refused {
        /// Why, and what to do.
        reason: String,
    },
}

const TAKEN: u32 = 0;
const SUPERSEDED: u32 = 1;
const REFUSED: u32 = 2;

impl TargetReply {
    /// Writes the answer to a request down.
    #[must_use]
    pub fn new(sequence: u64, outcome: &TargetOutcome) -> Self {
        let mut reply = Self {
            layout_version: LAYOUT_VERSION,
            kind: SUPERSEDED,
            sequence,
            trajectory_id: 0,
            cut_s: 0.0,
            rest_in_s: 0.0,
            planning_s: 0.0,
            text: Text::default(),
        };
        match outcome {
            TargetOutcome::Taken { trajectory_id, cut_s, rest_in_s, planning_s, note } => {
                (reply.kind, reply.trajectory_id) = (TAKEN, *trajectory_id);
                (reply.cut_s, reply.rest_in_s, reply.planning_s) = (*cut_s, *rest_in_s, *planning_s);
                reply.text = Text::new(note);
            }
            TargetOutcome::Superseded => {}
            TargetOutcome::Refused { reason } => {
                (reply.kind, reply.text) = (REFUSED, Text::new(reason));
            }
        }
        reply
    }

    /// The number of the request that is answered.
    #[must_use]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// The typed answer.
    #[must_use]
    pub fn outcome(&self) -> TargetOutcome {
        let got = self.layout_version;
        match self.kind {
            _ if got != LAYOUT_VERSION => TargetOutcome::Refused {
                reason: format!("the planner answers in layout version {got}, expected {LAYOUT_VERSION}"),
            },
            TAKEN => TargetOutcome::Taken {
                trajectory_id: self.trajectory_id,
                cut_s: self.cut_s,
                rest_in_s: self.rest_in_s,
                planning_s: self.planning_s,
                note: self.text.read(),
            },
            SUPERSEDED => TargetOutcome::Superseded,
            REFUSED => TargetOutcome::Refused { reason: self.text.read() },
            kind => {
                TargetOutcome::Refused { reason: format!("the planner answers with unknown code {kind}") }
            }
        }
    }
}
