//! Tests of `MyActuator` motors: the codec alone, and the master against simulated motors, frame by frame in memory.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod motor_bench;
mod myactuator_suite;
