//! Robot, scene, settings, path, table and trajectory files: reading, checking, and the robot digest.
//!
//! Every file is hostile until checked. A reader collects every fault and reports them all at once, each with file,
//! key, value and what was expected; unknown keys are faults.
#![forbid(unsafe_code)]

pub mod axis;
mod binding;
pub mod body;
pub mod brake;
pub mod bus_load;
mod capsule;
pub mod closed_form;
pub mod cloud;
mod consistency;
mod contact;
mod convex_parts;
pub mod daemon;
mod description;
pub mod digest;
mod document;
pub mod drive_epochs;
pub mod drive_features;
pub mod drive_scale;
mod dynamics;
pub mod fault;
pub mod feed_forward;
pub mod group;
pub mod homing;
mod hull;
pub mod journal;
pub mod last_pose;
mod limit_notices;
pub mod link_margin;
pub mod log;
pub mod lookup;
pub mod mass;
mod mass_doubt;
mod mesh;
mod modelled;
pub mod motion_table;
pub mod named_pose;
pub mod path_file;
pub mod printable;
pub mod profile_limits;
pub mod protocol;
mod reader;
pub mod revolution;
pub mod rng;
pub mod robot;
mod rows;
pub mod runtime;
pub mod scene;
mod sealed;
pub mod settings;
pub mod shipped;
pub mod stall;
pub mod state_dir;
pub mod stopping;
pub mod text;
pub mod trajectory_file;
pub mod trust;
mod urdf;
pub mod velocity_unit;

pub use axis::{AXES_MAX, Axis, AxisContact, AxisUnit, OnFault};
pub use brake::BrakeSettings;
pub use bus_load::BusLoad;
pub use drive_features::{
    AbsentObjects, DriveFeatures, MasterSupervision, OptionalObject, PositionMode, WrittenLimits,
};
pub use drive_scale::{Overruled, ScaleObject};
pub use dynamics::NoMasses;
pub use fault::{Fault, Faults};
pub use feed_forward::{FeedForward, JointTorque};
pub use group::{Group, Tip};
pub use homing::HomingSettings;
pub use lookup::{Kind, find};
pub use mass::LinkMass;
pub use motion_table::MotionTable;
pub use named_pose::NamedPose;
pub use path_file::{PathFile, PathPoint};
pub use profile_limits::{LimitUse, ProfileLimits};
pub use protocol::Protocol;
pub use protocol::cia402::Cia402;
pub use protocol::cubemars::CubeMars;
pub use protocol::damiao::{Damiao, DamiaoMode};
pub use protocol::motors::{MitGains, WireRanges};
pub use protocol::myactuator::{MyActuator, MyActuatorMode};
pub use protocol::robstride::RobStride;
pub use robot::{LinkShape, Robot, RobotJoint};
pub use runtime::RuntimeError;
pub use scene::{Obstacle, Scene, Shape};
pub use settings::{Bus, BusKind, Servo, Settings, Traffic};
pub use stall::AfterStall;
pub use trajectory_file::TrajectoryFile;
pub use trust::{Feedback, Reaction};
pub use velocity_unit::VelocityUnit;
