//! CAN links, servo protocols and simulated servos.
//!
//! A link moves frames and knows no protocol. A servo driver turns joint commands into frames and frames into
//! joint feedback, and does no I/O. Simulated servos sit behind the same links and decode real frames.
#![deny(unsafe_code)]

pub mod bring_up;
pub mod codec;
pub mod frame;
pub mod link;
pub mod motors;
pub mod protocols;
pub mod servo;
pub mod sim;
pub mod words;

pub use frame::{CanFrame, CanId, FrameBatch, JointSet};
pub use link::{CanLink, ErrorFrame, LinkFault};
pub use servo::{
    DriveState, DriveTarget, FixedPdos, HomingState, JointCommand, Nanos, ServoDriver, ServoStatus,
    ZeroRefused,
};
