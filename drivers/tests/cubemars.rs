//! Tests of `CubeMars` motors: the codec alone, the simulated motor, and the master against simulated motors, frame by frame in memory.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod cubemars_suite;
#[expect(dead_code, reason = "each suite uses a part")]
mod motor_bench;
