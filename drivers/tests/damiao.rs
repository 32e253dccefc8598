//! Tests of Damiao motors: the codec alone, and the master against the simulated motors, frame by frame in memory.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod damiao_suite;
