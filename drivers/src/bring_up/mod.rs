//! Bring-up: from an unknown node to a configured and, on request, energised drive.
//!
//! State machines without I/O, advanced once a cycle by their protocol's driver.
pub(crate) mod adopt;
pub mod brake;
pub mod cia402;
mod configure;
pub mod fault;
mod homing;
pub mod homing_plan;
mod inputs;
mod observe;
pub mod plan;
pub mod power;
pub mod profile_limits;
mod receive;
pub mod scale;
mod steps;
pub mod timing;

pub use cia402::Node;
pub use fault::{BringUpFault, Refusal};
