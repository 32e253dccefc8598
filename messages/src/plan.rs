//! Replan requests to the planner and its answers (request-response).
use crate::plan_detail::{PlanDetail, WireDetail};
use crate::tip_constraints::{TipConstraints, TipConstraintsWire};
use crate::tip_goal::{TipGoal, TipGoalWire};
use crate::way_points::{Blend, WAY_POINTS_MAX, WayPointsWire};
use crate::{LAYOUT_VERSION, Receipt, Text};
use iceoryx2::prelude::ZeroCopySend;
use taustream_motion::{JointArray, MAX_JOINTS};

/// When a new plan replaces a running motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// Cut the running motion. From rest: at once.
    AtOnce,
    /// Plan from the end of the running motion, and start when it has ended. Replaces what waits for that.
    AfterCurrent,
    /// Go on from the end of everything that was accepted: round the corner there while that is possible, else start when it
    /// has ended.
    Queue,
    /// Bring the running motion to rest as soon as its limits allow, and drop what waits. The goal means nothing.
    Cancel,
}

/// A replan request on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct PlanRequest {
    layout_version: u32,
    joint_count: u32,
    when: u32,
    deadline_ms: u32,
    seed: u64,
    goal_rad: [f64; MAX_JOINTS],
    planner: Text,
    sender_pid: u32,
    held_joints: u32,
    tip: TipGoalWire,
    way_points: WayPointsWire,
    constraints: TipConstraintsWire,
}

impl PlanRequest {
    /// The process that asks, as it says itself: whether it lives is looked up, and nothing else hangs on it.
    #[must_use]
    pub fn sender_pid(&self) -> u32 {
        self.sender_pid
    }
}

/// What a checked request asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedPlanRequest {
    /// How many joints the goal has.
    pub joints: usize,
    /// Where to go, unless the tip has a goal.
    pub goal_rad: JointArray,
    /// Poses to pass before it, in their order; at most [`WAY_POINTS_MAX`].
    pub via_rad: Vec<JointArray>,
    /// How far from corners the motion may pass.
    pub blend: Blend,
    /// Joints that the request says nothing of, a bit each: they hold, or go on to where they were led before. Their values count
    /// nothing.
    pub held_joints: u32,
    /// Where the tip shall end, instead.
    pub tip: Option<TipGoal>,
    /// What the tip must keep on the way.
    pub constraints: TipConstraints,
    /// When to replace it.
    pub when: When,
    /// How long planning may take; the planner spends it on shorter motions. With 0 it answers as soon as it can.
    pub deadline_ms: u32,
    /// Seed of every random choice.
    pub seed: u64,
    /// Name of a planner; empty for the default.
    pub planner: String,
}

impl CheckedPlanRequest {
    /// A request for a pose of the joints: at once, within the planner's own time, by its default.
    #[must_use]
    pub fn to_pose(joints: usize, goal_rad: JointArray) -> Self {
        let (via_rad, blend, tip, when) = (Vec::new(), Blend::default(), None, When::AtOnce);
        let (deadline_ms, seed, planner) = (0, 1, String::new());
        let (held_joints, constraints) = (0, TipConstraints::default());
        Self {
            joints,
            goal_rad,
            via_rad,
            blend,
            held_joints,
            tip,
            constraints,
            when,
            deadline_ms,
            seed,
            planner,
        }
    }

    /// The same with the joints that it says nothing of where they are in another pose.
    #[must_use]
    pub fn holding_at(&self, pose_rad: &JointArray) -> Self {
        let mut filled = self.clone();
        for point in filled.via_rad.iter_mut().chain(std::iter::once(&mut filled.goal_rad)) {
            for (joint, (q, held)) in point.iter_mut().zip(pose_rad).enumerate() {
                if self.held_joints & (1 << joint) != 0 {
                    *q = *held;
                }
            }
        }
        filled
    }

    /// The way points, and the goal behind them.
    #[must_use]
    pub fn points_rad(&self) -> Vec<JointArray> {
        self.via_rad.iter().chain(std::iter::once(&self.goal_rad)).copied().collect()
    }
}

/// Why a request is refused before planning.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PlanRequestError {
    /// Written by another version.
    #[error("layout version {got}, expected {LAYOUT_VERSION}; use command line and planner of one release")]
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
    /// The goal is not finite.
    #[error("goal of joint {} is {value_rad}; it must be finite (rad)", joint + 1)]
    Goal {
        /// Zero-based index of the joint.
        joint: usize,
        /// The value in the message.
        value_rad: f64,
    },
    /// More than fit into a message.
    #[error("{got} way points; a request takes at most {WAY_POINTS_MAX}, send the others with --queue")]
    WayPoints {
        /// The count in the message.
        got: u32,
    },
    /// A way point is not finite.
    #[error("way point {}: joint {} is {value_rad}; it must be finite (rad)", point + 1, joint + 1)]
    WayPoint {
        /// Zero-based index of the way point.
        point: usize,
        /// Zero-based index of the joint.
        joint: usize,
        /// The value in the message.
        value_rad: f64,
    },
    /// The blend is no distance.
    #[error("the blend is {value}; it must be finite, and 0 or more")]
    Blend {
        /// The value in the message.
        value: f64,
    },
    /// No kind of blend.
    #[error("unknown kind of blend {got}; the sender is of another release, or no sender of this project")]
    BlendKind {
        /// The code in the message.
        got: u32,
    },
    /// Joints that are not there, or all of them.
    #[error(
        "the request holds the joints {got:#b} of {joints} (a bit each); it must leave at least one of them to move"
    )]
    Held {
        /// The bits in the message.
        got: u32,
        /// How many joints there are.
        joints: usize,
    },
    /// A number of the tip's goal.
    #[error("the tip's {what} is {value}, which makes no sense")]
    Tip {
        /// Which one.
        what: &'static str,
        /// The value in the message.
        value: f64,
    },
    /// A number of the tip's constraints.
    #[error("the constraint of the tip: {what} is {value}, which makes no sense")]
    Constraint {
        /// Which one.
        what: &'static str,
        /// The value in the message.
        value: f64,
    },
    /// No kind of constraint.
    #[error(
        "unknown kind of constraint {got}; the sender is of another release, or no sender of this project"
    )]
    ConstraintKind {
        /// The bits in the message.
        got: u32,
    },
    /// No kind of goal.
    #[error("unknown kind of goal {got}; the sender is of another release, or no sender of this project")]
    GoalKind {
        /// The bits in the message.
        got: u32,
    },
    /// None of those that exist.
    #[error("unknown start code {got}; 0 (at once), 1 (after current), 2 (queue) or 3 (cancel)")]
    When {
        /// The code in the message.
        got: u32,
    },
}

impl From<&CheckedPlanRequest> for PlanRequest {
    fn from(r: &CheckedPlanRequest) -> Self {
        Self {
            layout_version: LAYOUT_VERSION,
            joint_count: u32::try_from(r.joints).unwrap_or(u32::MAX),
            when: match r.when {
                When::AtOnce => 0,
                When::AfterCurrent => 1,
                When::Queue => 2,
                When::Cancel => 3,
            },
            deadline_ms: r.deadline_ms,
            seed: r.seed,
            goal_rad: r.goal_rad,
            planner: Text::new(&r.planner),
            sender_pid: std::process::id(),
            held_joints: r.held_joints,
            tip: TipGoalWire::from(r.tip.as_ref()),
            way_points: WayPointsWire::new(&r.via_rad, r.blend),
            constraints: TipConstraintsWire::from(&r.constraints),
        }
    }
}

impl TryFrom<&PlanRequest> for CheckedPlanRequest {
    type Error = PlanRequestError;

    fn try_from(r: &PlanRequest) -> Result<Self, PlanRequestError> {
        if r.layout_version != LAYOUT_VERSION {
            return Err(PlanRequestError::Layout { got: r.layout_version });
        }
        let joints = usize::try_from(r.joint_count)
            .ok()
            .filter(|n| (1..=MAX_JOINTS).contains(n))
            .ok_or(PlanRequestError::Joints { got: r.joint_count })?;
        let when = match r.when {
            0 => When::AtOnce,
            1 => When::AfterCurrent,
            2 => When::Queue,
            3 => When::Cancel,
            got => return Err(PlanRequestError::When { got }),
        };
        for (joint, &value_rad) in r.goal_rad.iter().enumerate() {
            if !value_rad.is_finite() || (joint >= joints && value_rad != 0.0) {
                return Err(PlanRequestError::Goal { joint, value_rad });
            }
        }
        let all = u32::try_from((1_u64 << joints) - 1).unwrap_or(u32::MAX);
        if r.held_joints & !all != 0 || r.held_joints == all {
            return Err(PlanRequestError::Held { got: r.held_joints, joints });
        }
        let (via_rad, blend) = r.way_points.read(joints)?;
        Ok(Self {
            joints,
            goal_rad: r.goal_rad,
            via_rad,
            blend,
            held_joints: r.held_joints,
            tip: r.tip.read()?,
            constraints: r.constraints.read()?,
            when,
            deadline_ms: r.deadline_ms,
            seed: r.seed,
            planner: r.planner.read(),
        })
    }
}

/// When the planner did what, by `CLOCK_MONOTONIC`, ns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[repr(C)]
pub struct PlanStages {
    /// It took the request.
    pub received_ns: u64,
    /// It had a motion.
    pub planned_ns: u64,
    /// The motion was proven. A motion from rest is proven while it is planned.
    pub proven_ns: u64,
    /// The trajectory was sent.
    pub sent_ns: u64,
    /// The streamer's receipt had come.
    pub receipt_ns: u64,
}

const REFUSED: u32 = 0;
const PLANNED: u32 = 1;
const REFUSED_FOR_NOW: u32 = 2;

/// The planner's answer on the wire.
#[derive(Clone, Copy, Debug, PartialEq, ZeroCopySend)]
#[repr(C)]
pub struct PlanReply {
    layout_version: u32,
    planned: u32,
    trajectory_id: u64,
    planning_s: f64,
    duration_s: f64,
    clearance_m: f64,
    stroke_count: u32,
    received: u32,
    stages: PlanStages,
    receipt: Receipt,
    text: Text,
    detail: WireDetail,
}

/// The answer, read.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanOutcome {
    /// No motion was found, or the request is refused; nothing was sent to the streamer.
    Failed {
        /// Why, and what to do.
        reason: String,
    },
    /// A verified motion was sent to the streamer.
    Planned {
        /// Names the trajectory.
        trajectory_id: u64,
        /// How long planning took.
        planning_s: f64,
        /// How long the motion takes at full speed.
        duration_s: f64,
        /// Least distance to any obstacle or between links.
        clearance_m: f64,
        /// How many strokes.
        strokes: u32,
        /// What planned it: "straight line", "RRT-Connect", ...
        how: String,
        /// The streamer's receipt; `None` when it did not answer in time.
        receipt: Option<Box<Receipt>>,
        /// When it did what.
        stages: PlanStages,
    },
}

impl PlanReply {
    /// Writes an outcome down.
    #[must_use]
    pub fn new(outcome: &PlanOutcome, detail: &PlanDetail) -> Self {
        let nothing = Receipt::new(0, 0, &crate::Outcome::Rejected(crate::Rejection::Busy));
        let mut reply = Self {
            layout_version: LAYOUT_VERSION,
            planned: REFUSED,
            trajectory_id: 0,
            planning_s: 0.0,
            duration_s: 0.0,
            clearance_m: 0.0,
            stroke_count: 0,
            received: 0,
            stages: PlanStages::default(),
            receipt: nothing,
            text: Text::default(),
            detail: WireDetail::new(detail),
        };
        match outcome {
            PlanOutcome::Failed { reason } => reply.text = Text::new(reason),
            PlanOutcome::Planned {
                trajectory_id,
                planning_s,
                duration_s,
                clearance_m,
                strokes,
                how,
                receipt,
                stages,
            } => {
                (reply.planned, reply.stages) = (PLANNED, *stages);
                reply.trajectory_id = *trajectory_id;
                (reply.planning_s, reply.duration_s) = (*planning_s, *duration_s);
                (reply.clearance_m, reply.stroke_count) = (*clearance_m, *strokes);
                reply.text = Text::new(how);
                if let Some(receipt) = receipt {
                    (reply.received, reply.receipt) = (1, **receipt);
                }
            }
        }
        reply
    }

    /// The same refusal, when a neighbour moves and the answer may be another one once it rests.
    #[must_use]
    pub fn for_now(mut self) -> Self {
        if self.planned == REFUSED {
            self.planned = REFUSED_FOR_NOW;
        }
        self
    }

    /// True for a refusal that may not last: a neighbour moves.
    #[must_use]
    pub fn is_for_now(&self) -> bool {
        self.layout_version == LAYOUT_VERSION && self.planned == REFUSED_FOR_NOW
    }

    /// What the planner says beside it.
    #[must_use]
    pub fn detail(&self) -> PlanDetail {
        if self.layout_version == LAYOUT_VERSION { self.detail.read() } else { PlanDetail::default() }
    }

    /// The typed answer.
    #[must_use]
    pub fn outcome(&self) -> PlanOutcome {
        if self.layout_version != LAYOUT_VERSION {
            let got = self.layout_version;
            let reason = format!("the planner answers in layout version {got}, expected {LAYOUT_VERSION}");
            return PlanOutcome::Failed { reason };
        }
        if self.planned != PLANNED {
            return PlanOutcome::Failed { reason: self.text.read() };
        }
        PlanOutcome::Planned {
            trajectory_id: self.trajectory_id,
            planning_s: self.planning_s,
            duration_s: self.duration_s,
            clearance_m: self.clearance_m,
            strokes: self.stroke_count,
            how: self.text.read(),
            receipt: (self.received == 1).then(|| Box::new(self.receipt)),
            stages: self.stages,
        }
    }
}

const _: () = assert!(size_of::<PlanRequest>() == 528 + 16 + 2048 + 120);
const _: () = assert!(size_of::<PlanReply>() == 48 + 40 + 320 + 248 + size_of::<WireDetail>());
