//! Simulated drives as a master meets them: by frames alone.
#![expect(clippy::panic, clippy::unwrap_used, clippy::expect_used, reason = "a test ends by panicking")]
#![expect(clippy::needless_range_loop, reason = "joints are counted across several arrays at once")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "registers of known width"
)]
mod servosim_suite;
