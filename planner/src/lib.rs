//! World, search, refinement, timing, verification and the replan service.
//!
//! [`plan()`] goes from two poses to a verified motion; [`verify()`] proves any trajectory; the service
//! (`taustream-planner`) answers replan requests and hands motions to the streamer. An ordinary process: it may
//! allocate and use every core, and it never touches a bus.
//!
//! From files to a verified motion:
//!
//! ```
//! use std::path::Path;
//! use taustream_arm::{Robot, Scene};
//! use taustream_motion::MAX_JOINTS;
//! use taustream_planner::{PlanOptions, plan, verify};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config");
//! let robot = Robot::load(&config.join("robots/ur5.toml"))?;
//! let scene = Scene::load(&config.join("scenes/pillars.toml"))?;
//! let (mut start_rad, mut goal_rad) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
//! start_rad[..6].copy_from_slice(&[0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);
//! goal_rad[..6].copy_from_slice(&[1.2, -1.3, 1.4, -1.6, -1.57, 0.0]);
//!
//! let found = plan(&robot, &scene, &start_rad, &goal_rad, &PlanOptions::default())?;
//! let proof = verify(&robot, &scene, &found.trajectory)?;
//! assert!(proof.clearance_m > 0.0);
//! println!("{:.3} s, {:.4} m clear", proof.duration_s, proof.clearance_m);
//! # Ok(())
//! # }
//! ```
#![forbid(unsafe_code)]

pub mod arguments;
pub mod budget;
pub mod collide;
pub mod constraints;
pub mod energy;
pub mod enter;
pub mod explain;
pub mod foraging;
mod foreign;
pub mod goals;
pub mod held;
pub mod import;
pub mod in_motion;
pub mod kept_scene;
pub mod kind;
pub mod lanes;
pub mod live_scene;
pub mod margin_exit;
pub mod neighbours;
pub mod objective;
pub mod pipeline;
pub mod plan;
pub mod refine;
pub mod replacement;
pub mod sampled;
pub mod search;
pub mod send;
pub mod service;
pub mod shortcut;
pub mod stop_ahead;
pub mod stream;
pub mod stream_cut;
pub mod timing;
pub mod torque;
pub mod tree;
pub mod verify;
pub mod world;

pub use taustream_arm::rng;

pub use goals::{Finder, GoalError, Orientation, Reached, Situation, TipTarget, plan_to_any, plan_to_tip};
pub use taustream_messages::way_points::Blend;

pub use constraints::{TipBox, TipConstraints, Upright};
pub use kind::{Improvement, PlannerKind};
pub use objective::Objective;
pub use plan::{Plan, PlanError, PlanOptions, PoseOf, Remedy, StartMargin, check_pose, plan, plan_through};
pub use verify::{Contact, Proof, Violation, verify, verify_keeping};
