//! Tests of Damiao motors: the codec alone, and the master against the simulated motors, frame by frame in memory.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod damiao_suite;
#[expect(dead_code, reason = "other suites use the rest")]
mod motor_bench;
