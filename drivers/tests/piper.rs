//! Tests of the `AgileX` Piper: the codec alone, and the master against the simulated arm, frame by frame in memory.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
mod piper_suite;
mod shipped_bench;
