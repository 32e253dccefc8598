//! Tests of `ODrive` drives: the codec alone, and the master against the simulated drives, frame by frame in memory.
#![expect(
    clippy::panic,
    clippy::unwrap_used,
    clippy::needless_range_loop,
    reason = "a test ends by panicking"
)]
mod odrive_suite;
mod shipped_bench;
