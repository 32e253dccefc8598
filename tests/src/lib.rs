//! Scenarios over the real processes on a real vcan0: the machine they run in and what reads their recordings.
//!
//! [`machine`] boots a kernel with CAN on any Linux host and runs a command there. [`candump`] reads what an independent
//! recorder saw on the bus.
#![forbid(unsafe_code)]

pub mod candump;
pub mod machine;
mod scratch;
