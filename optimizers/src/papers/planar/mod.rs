//! Robots in the plane that feel their way to a goal (Abdi et al. 2020): bacterial foraging steps, virtual obstacles as an
//! escape from traps, and the potential field that it is compared with.
//!
//! A robot knows where it is, where its goal is, and what its sensor sees within its range; it remembers its trace.
//! Lengths are centimetres, as in the paper.
//!
//! Source: Abdi et al. (2020), eq. 1 to 15 and algorithm 1; most of its numbers are not printed, ours are named
//! [`Numbers::OURS`].
mod drive;
mod field;
mod robot;
mod scene;

pub use drive::{Journey, PlanarDrive, drive};
pub use field::{Numbers, force, potential};
pub use robot::{Rule, VirtualObstacle};
pub use scene::{Obstacle, PlanarScene, PlanarShape};

/// A place in the plane, in centimetres.
pub type Place = [f64; 2];

/// Distance of two places.
#[must_use]
pub fn distance_cm(a: Place, b: Place) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}
