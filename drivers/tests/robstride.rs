//! Tests of `RobStride` motors: the codec alone, the simulated motor, and the master against simulated motors, frame by frame in memory.
#![expect(
    clippy::panic,
    clippy::unwrap_used,
    clippy::needless_range_loop,
    reason = "a test ends by panicking"
)]
mod motor_bench;
mod robstride_suite;
