//! What crosses shared memory between planner, streamer and command line.
//!
//! Every message is plain `repr(C)` data of fixed size that begins with [`LAYOUT_VERSION`]. It is untrusted
//! until checked: copy it out, then convert it. Nothing outside this crate reads the raw fields of a
//! [`TrajectoryMessage`]; the one door is [`CheckedTrajectory`].
#![deny(unsafe_code)]

pub mod axis;
pub mod bus;
pub mod clock;
pub mod cloud;
pub mod command;
pub mod event;
pub mod fault;
pub mod files;
pub mod operator;
pub mod pause;
pub mod phase;
pub mod plan;
pub mod plan_detail;
pub mod receipt;
pub mod reference_state;
pub mod report;
pub mod scene;
pub mod scene_reply;
pub mod service;
pub mod target;
pub mod text;
pub mod tip_constraints;
pub mod tip_goal;
pub mod trajectory;
pub mod way_points;

pub use axis::{AxisGoal, AxisReport, AxisState};
pub use bus::{BUSES_MAX, BusReport};
pub use command::{Command, CommandReply, CommandRequest};
pub use fault::{BusFault, Cause, Evidence, FaultReason};
pub use pause::{Pause, PauseReason};
pub use phase::Phase;
pub use plan::{PlanReply, PlanRequest};
pub use receipt::{Outcome, Receipt, Rejection};
pub use reference_state::ReferenceState;
pub use report::Report;
pub use scene::{CheckedSceneRequest, SceneRequest};
pub use scene_reply::SceneReply;
pub use target::{CheckedTargets, TargetReply, TargetRequest};
pub use text::Text;
pub use trajectory::{CheckedTrajectory, Replaces, RobotDigest, TrajectoryMessage};

/// Version of every layout in this crate; a change of any message raises it.
pub const LAYOUT_VERSION: u32 = 9;
