//! Bring-up: from a silent node to a configured, and at wish energised, drive.
//!
//! State machines without I/O, advanced once a cycle by their protocol's driver.
pub(crate) mod adopt;
pub mod cia402;
pub mod damiao;
pub mod damiao_plan;
pub mod damiao_trouble;
mod look;
pub mod pace;
pub mod plan;
pub mod power;
pub mod trouble;

pub use cia402::Node;
pub use trouble::{Trouble, explain, explain_refusal};
