//! Robots as URDF and SRDF files describe them.
//!
//! `xml` reads elements and notes faults with line, element and value; `model` is what a URDF says; `tree` checks how its links hang
//! together; `arm` is the chain from base to tip with the geometry that hangs on it; `srdf` adds the pairs of links that may touch;
//! `package` finds mesh files, `mesh_part` makes convex bodies of them.
//!
//! Such files are made by many programs, and are read by a strict hand: what would change where the arm is or what it can hit
//! is either understood or refused. What is left out on purpose (mimicry, joints off the chain, links without
//! geometry) becomes a notice, which `check` prints.
//!
//! Source: wiki.ros.org/urdf/XML (link, joint), wiki.ros.org/srdf; `<capsule>` as Drake and Bullet write it (length between
//! the centres of the balls).
mod arm;
mod digest;
mod mesh_part;
mod model;
mod package;
mod srdf;
mod tree;
pub(crate) mod xml;

pub(crate) use arm::{JointInfo, KEYS, UrdfArm};
pub(crate) use model::StatedLimits;
