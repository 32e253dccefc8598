//! What the seed papers optimise: their benchmark functions, arms, objectives and scenes.
//!
//! The methods are in [`crate::optimize`]; here are the problems they are tried on.
pub mod benchmarks;

pub use benchmarks::{Benchmark, Function};
