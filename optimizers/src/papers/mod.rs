//! What the five papers (docs/papers.md) optimise: their benchmark functions, arms, objectives and scenes.
//!
//! The methods are at the root of this crate; here are the problems they are tried on, and the papers' own ways of using
//! them. Nothing here moves an arm: motions for a real arm come from the planner.
pub mod benchmarks;
pub mod control_point_count;
pub mod control_points;
mod linear;
pub mod planar;
pub mod quadrature;
pub mod reach;
pub mod spline;
pub mod spline_time;
pub mod two_link;
pub mod two_link_energy;
pub mod two_link_via;

pub use benchmarks::{Benchmark, Function};
