//! The hard real-time streamer: from a checked trajectory to CAN frames, a thousand times a second.
//!
//! Three threads. The *real-time thread* runs [`cycle::run_cycle`], one straight line, and nothing else. The
//! *service thread* owns every shared-memory port: it checks trajectories, answers commands, publishes reports and
//! receipts, logs. The *recorder thread* writes the cycle log. They meet only in bounded queues of plain values
//! and preallocated boxes, so the real-time thread never waits, allocates or frees.
//!
//! This is not a safety function: its stops are best effort by software over a bus.
#![deny(unsafe_code)]

pub mod answer;
pub mod approach;
pub mod arguments;
pub mod bench;
pub mod buses;
pub mod check;
pub mod cycle;
pub mod cycle_state;
pub mod guard;
mod health;
pub mod intake;
pub mod last_sent;
pub mod log;
pub mod names;
mod operator;
pub mod phases;
pub mod pose_store;
pub mod recorder;
pub mod referencing;
pub mod report;
pub mod rt;
pub mod service;
pub mod supervise;
pub mod tick;
pub mod track;
pub mod watch;
