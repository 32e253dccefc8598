//! The hard real-time streamer: from a checked trajectory to CAN frames, a thousand times a second.
//!
//! The *real-time thread* runs [`cycle::run_cycle`], one straight line, and nothing else. Commands are taken by two threads that
//! wait for nobody: [`commands`] out of shared memory, [`stop_socket`] from a socket that needs none; the latter feeds the
//! watchdog. [`publisher`] takes trajectories, publishes reports and receipts and words the log; [`ports`] watches the names in
//! shared memory; [`pose_store`] keeps the last pose and [`recorder`] the cycle log on disk, each on a thread of its own, as the log's
//! lines are written (`taustream_arm::log`). Threads meet only in bounded queues of plain values and preallocated boxes; those of the
//! real-time thread are wait-free, so it never waits, allocates or frees.
//!
//! This is not a safety function: its stops are best effort by software over a bus.
#![deny(unsafe_code)]

pub mod answer;
pub mod approach;
pub mod arguments;
pub mod axes;
mod axis_commands;
pub mod bench;
pub mod buses;
pub mod check;
pub mod commands;
pub mod cycle;
pub mod cycle_state;
pub mod ending;
pub mod feed_forward;
pub mod guard;
mod health;
mod homing;
pub mod intake;
pub mod last_sent;
pub mod log;
pub mod names;
mod operator;
pub mod phases;
pub mod ports;
pub mod pose_store;
pub mod prepared;
pub mod publisher;
mod record_first;
pub mod recorder;
pub mod referencing;
pub mod report;
pub mod rt;
mod stall;
pub mod stop_socket;
pub mod successor;
pub mod supervise;
pub mod threads;
pub mod tick;
pub mod torque_guard;
pub mod track;
pub mod watch;
pub mod write_ahead;
