//! Scenarios over the real processes on a real vcan0: the machine they run in and the checks of their recordings.
//!
//! [`machine`] boots a kernel with CAN on any Linux host and runs a command there. [`test_bench`] starts the real processes
//! for one of the [`scenarios`], [`bus_scenarios`], [`cut_scenarios`], [`disturbed_scenarios`], [`stream_scenarios`] and [`motor_scenarios`]. [`candump`] reads what the `bus-recorder`
//! saw on the bus, [`cycle_log`] what the streamer claims, and [`setpoints`] compares the two ([`mit_setpoints`]
//! for motors in MIT mode).
//!
//! [`booted`] boots a whole Debian ([`debian`]) with systemd in that machine, and [`services`] tries the installed services
//! there.
//!
//! [`virtual_arm`] needs none of these: it simulates the whole system in virtual time, from a seed.
#![deny(unsafe_code)]

pub mod booted;
pub mod bus_scenarios;
pub mod candump;
mod carried;
pub mod cut_scenarios;
pub mod cycle_log;
pub mod debian;
pub mod demo_file;
pub mod disturbed_scenarios;
pub mod documents;
pub mod homing_scenarios;
pub mod machine;
pub mod mit_setpoints;
pub mod motor_commands;
pub mod motor_scenarios;
mod on_path;
pub mod restart_scenarios;
pub mod retry;
pub mod scenarios;
mod scratch;
pub mod services;
pub mod setpoints;
pub mod slice;
pub mod stream_scenarios;
pub mod test_bench;
pub mod traffic;
pub mod virtual_arm;
