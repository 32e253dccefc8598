//! Foraging: a greedy search in joint space that escapes from traps by virtual obstacles.
//!
//! The method of Abdi et al. (2020) for a robot in the plane ([`taustream_optimizers::papers::planar`]), taken to arms of any number of
//! joints. A place is a pose; places are as far apart as [`Space::distance_m`] says, so that lengths are metres that a
//! point of the arm can move; what the sensor sees are the pairs of bodies that come near each other. Every step is an
//! edge that is proven like those of the trees, so that the trace is a path. A search, unlike a robot, need not walk
//! back: a retreat cuts the trace.
//!
//! It is greedy and has no map: it is fast in free space and slow in narrow passages. Without virtual
//! obstacles ([`Numbers::PLAIN`]) it is plain bacterial foraging, which a trap holds.
//!
//! Source: Abdi et al. (2020), eq. 10 to 15 and algorithm 1, read as in [`taustream_optimizers::papers::planar`].
mod forager;
mod numbers;

pub use forager::{Foraged, forage};
pub use numbers::Numbers;

#[cfg(doc)]
use crate::tree::Space;
