//! A scene: obstacles around the arm.
use crate::Faults;
use nalgebra::Point3;
use std::path::{Path, PathBuf};
use taustream_motion::chain::Pose;

/// A collision shape in its own frame; axes of cylinders and capsules are local z, centred.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A ball.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// A box.
    Box {
        /// Full edge lengths.
        size_m: [f64; 3],
    },
    /// A cylinder.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Full length.
        length_m: f64,
    },
    /// A cylinder with half balls at its ends.
    Capsule {
        /// Radius.
        radius_m: f64,
        /// Length between the centres of the balls.
        length_m: f64,
    },
    /// Triangles, already scaled.
    Mesh {
        /// Corners.
        vertices_m: Vec<Point3<f64>>,
        /// Corner indices of each triangle.
        triangles: Vec<[u32; 3]>,
    },
}

/// One obstacle.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Its name, for messages.
    pub name: String,
    /// Where it stands in the base frame.
    pub pose: Pose,
    /// Its shape.
    pub shape: Shape,
}

/// A checked scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The file that it was read from.
    pub file: PathBuf,
    /// Least distance that plans keep from every obstacle.
    pub margin_m: f64,
    /// The obstacles.
    pub obstacles: Vec<Obstacle>,
}

impl Scene {
    /// Reads and checks a scene file (TOML); mesh files are read too.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(_file: &Path) -> Result<Self, Faults> {
        todo!("arm")
    }
}
