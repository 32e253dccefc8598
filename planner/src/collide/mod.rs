//! Distances between shapes, and the proof that a whole motion keeps them.
//!
//! A shape is a *core* and a radius around it: a sphere is a point, a capsule a segment. Distances are taken
//! between cores and the radii subtracted, so that overlapping capsules still tell how deep they overlap. Cores of
//! links are almost always segments: their distances to segments and boxes have closed forms (`closed_form`),
//! everything else is asked of parry3d. The shapes themselves are [`taustream_arm::body`]'s.
mod course;
mod parts;
pub mod sweep;

pub use taustream_arm::body::{Body, Posed};

pub use course::Course;
pub use parts::sweep_in_parts;
pub use sweep::{Blocked, Clearance, Motion, StraightEdge, SweepRules, sweep, sweep_knowing};
