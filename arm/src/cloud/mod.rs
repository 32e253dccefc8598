//! Point clouds: what a depth camera or a laser scanner saw, as an obstacle.
//!
//! Each point stands for a ball of one radius, which states what lies between the points: a radius of half the distance of neighbours
//! closes a surface. Files are PLY, PCD and plain text of x, y, z. Points that are not finite are places without a measurement, as
//! PCD says, and are left out. All others count: nothing is thinned out.
mod field;
mod pcd;
mod ply;
mod records;
mod tree;

pub use tree::PointTree;

use field::Field;

use crate::document::{read_file, shown, without_mark};
use crate::mesh::{REACH_M_MAX, Refusal};
use parry3d_f64::math::Vector;
use std::path::Path;

/// Longest file.
const BYTES_MAX: u64 = 256 << 20;
/// Most points: a tree over them is built whenever the scene is read, and 40 bytes a point are held.
pub const POINTS_MAX: usize = 1_000_000;

/// Points around which an obstacle is solid.
#[derive(Debug)]
pub struct Cloud {
    tree: PointTree,
    field: Field,
    /// Radius of the ball around each point.
    pub radius_m: f64,
    /// How many points of the file were not finite.
    pub unmeasured: usize,
}

impl Cloud {
    /// Makes a cloud of points; those that are not finite are left out.
    ///
    /// # Errors
    /// What is wrong and what was expected: no point, too many, or one that is farther than 100 m off.
    pub fn new(points_m: Vec<[f64; 3]>, radius_m: f64) -> Result<Self, Refusal> {
        let count = points_m.len();
        let mut measured = points_m;
        measured.retain(|point| point.iter().all(|x| x.is_finite()));
        let unmeasured = count - measured.len();
        if measured.is_empty() {
            let value = format!("has no point that was measured ({count} are not finite)");
            return Err((value, "at least one point with finite coordinates".to_owned()));
        }
        if measured.len() > POINTS_MAX {
            let value = format!("has {} points", measured.len());
            let expected = format!("at most {POINTS_MAX}; thin it out, for example with a voxel grid");
            return Err((value, expected));
        }
        if let Some(far) = measured.iter().find(|point| point.iter().any(|x| x.abs() > REACH_M_MAX)) {
            let value = format!("has a point at {far:?} m");
            return Err((
                value,
                format!("coordinates up to {REACH_M_MAX} m; millimetres want scale = 0.001"),
            ));
        }
        let points = measured.into_iter().map(Vector::from_array).collect();
        let tree = PointTree::new(points);
        Ok(Self { field: Field::around(&tree), tree, radius_m, unmeasured })
    }

    /// No point is nearer to a place than this, m: quick, and at most two cells of a centimetre or so below the truth.
    #[must_use]
    pub fn least_m(&self, at: Vector) -> f64 {
        self.field.least_m(&self.tree, at)
    }

    /// Reads the points of a file (`.ply`, `.pcd` or `.xyz`), each coordinate times `scale`.
    ///
    /// # Errors
    /// What is wrong and what was expected.
    pub fn load(file: &Path, scale: f64, radius_m: f64) -> Result<Self, Refusal> {
        let refusal = |(value, expected): Refusal| (format!("{} {value}", file.display()), expected);
        let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        let read = match ending.as_str() {
            "ply" => ply::read,
            "pcd" => pcd::read,
            "xyz" => text,
            _ => {
                let expected = "a point cloud named .ply, .pcd or .xyz (text: x y z a line)";
                return Err(refusal(("is none of .ply, .pcd and .xyz".to_owned(), expected.to_owned())));
            }
        };
        let bytes = read_file(file, BYTES_MAX, "a point cloud").map_err(|faults| match faults.0.first() {
            Some(fault) => refusal((format!("is {}", fault.value), fault.expected.clone())),
            None => refusal(("cannot be read".to_owned(), "a point cloud".to_owned())),
        })?;
        let mut points = read(&bytes).map_err(refusal)?;
        points.iter_mut().flatten().for_each(|x| *x *= scale);
        Self::new(points, radius_m).map_err(refusal)
    }

    /// The points, by place.
    #[must_use]
    pub fn tree(&self) -> &PointTree {
        &self.tree
    }
}

impl PartialEq for Cloud {
    fn eq(&self, other: &Self) -> bool {
        self.tree == other.tree && self.radius_m.to_bits() == other.radius_m.to_bits()
    }
}

/// Three numbers a line; what follows them (intensity, colour) is left out.
fn text(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Refusal> {
    let text = String::from_utf8_lossy(bytes);
    let lines = without_mark(&text).lines().enumerate();
    let wanted = lines.filter(|(_, line)| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    wanted.map(|(i, line)| numbers(line, [0, 1, 2]).ok_or_else(|| no_numbers(i, line))).collect()
}

/// The numbers in three columns of a line.
fn numbers(line: &str, columns: [usize; 3]) -> Option<[f64; 3]> {
    let separators = |c: char| c.is_ascii_whitespace() || c == ',';
    let words: Vec<&str> = line.split(separators).filter(|word| !word.is_empty()).collect();
    let mut point = [0.0; 3];
    for (x, column) in point.iter_mut().zip(columns) {
        *x = words.get(column)?.parse().ok()?;
    }
    Some(point)
}

fn no_numbers(line: usize, text: &str) -> Refusal {
    (format!("line {}: {}", line + 1, shown(text.trim())), "the numbers x, y and z of a point".to_owned())
}

fn no_fields(found: &str) -> Refusal {
    (
        format!("has the fields {}", shown(found)),
        "x, y and z as floating-point numbers of 4 or 8 bytes".to_owned(),
    )
}

fn no_header(kind: &str) -> Refusal {
    (format!("has no header of {kind}"), format!("a {kind} file"))
}

#[cfg(test)]
mod tests;
