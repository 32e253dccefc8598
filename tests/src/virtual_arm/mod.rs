//! The whole system in virtual time, from a seed: the shipped cycle, the shipped protocol drivers, simulated drives, and the
//! buses between them, on one thread and without a clock.
//!
//! [`world`] lets time pass and runs the cycle. [`plan`] decides from the seed what goes wrong and when: stalls of the loop, faults of
//! buses ([`bus`]) and of drives. [`operator`] enables, moves and stops the arm at random times, and recovers it as a person
//! would. [`checker`] reads the setpoints that reached the drives ([`setpoint_reader`]) with decoders that share nothing with the
//! product, and reports everything that no arm may do. A seed reproduces all of it bit by bit.
pub mod arms;
pub mod bus;
pub mod checker;
pub mod link;
pub mod motion;
pub mod operator;
mod path;
pub mod phase_rules;
pub mod plan;
pub mod planted;
pub mod random;
mod rates;
pub mod run;
pub mod setpoint_reader;
pub mod streaming;
pub mod world;
