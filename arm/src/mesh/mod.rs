//! Mesh files: STL (binary or ASCII), Wavefront OBJ and COLLADA.
//!
//! A mesh is a set of triangles; colours, normals and materials are left out. STL and OBJ hold single-precision numbers
//! here, which is a ten-thousandth of a millimetre at arm's length. Every triangle of a file counts: what a reader does not
//! understand and could be solid is refused. `cargo xtask test` compares the readers with independent ones, facet by
//! facet (`tests/peers/meshes.py`).
mod dae;
mod obj;
mod stl;

use crate::document::read_file;
use crate::{Faults, digest};
use nalgebra::Point3;
use std::collections::HashMap;
use std::path::Path;

/// Longest mesh file.
pub(crate) const MESH_BYTES_MAX: u64 = 64 << 20;
/// Most triangles: collision queries walk a tree of them, and the tree is built at every start.
pub(crate) const TRIANGLES_MAX: usize = 200_000;
/// Farthest corner from the mesh's origin after scaling; more is a slip of the unit (millimetres).
pub(crate) const REACH_M_MAX: f64 = 100.0;
/// Triangles with a smaller area have no direction that arithmetic can trust.
const AREA_M2_MIN: f64 = 1e-14;

/// Largest and smallest extent of a mesh in metres. A tool of 90 mm whose file counts in millimetres is 90 m long, and one
/// that is scaled twice is as good as none.
const SIZE_M_MAX: f64 = 5.0;
/// The same where a scene states the scale: surroundings may be larger than links.
const STATED_SIZE_M_MAX: f64 = 20.0;
const SIZE_M_MIN: f64 = 1e-3;

/// Triangles, scaled to metres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) vertices_m: Vec<Point3<f64>>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// What is wrong with a mesh: the value and what was expected.
pub(crate) type Refusal = (String, String);

/// How the coordinates of a mesh become metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) factor: f64,
    /// The file that names the mesh states the factor, so that it is no oversight.
    pub(crate) is_stated: bool,
}

/// Reads and checks a mesh file; the name's ending says which format it is.
pub(crate) fn load(file: &Path, scale: Scale) -> Result<Mesh, Refusal> {
    let (ending, bytes) = read(file)?;
    parse(file, &ending, &bytes, scale).map_err(|(value, expected)| refusal(file, &value, &expected))
}

/// The mesh of a link, for its convex bodies.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinkMesh {
    pub(crate) points_m: Vec<Point3<f64>>,
    /// Corner indices, all of which exist. Some triangles may have no area.
    pub(crate) triangles: Vec<[usize; 3]>,
    /// SHA-256 of the file.
    pub(crate) digest: [u8; 32],
    /// What the owner should know about how the file was read.
    pub(crate) remarks: Vec<String>,
}

/// Reads the mesh of a link, each coordinate scaled by its own factor. Triangles without an area, which programs leave behind in
/// many meshes, do no harm here.
pub(crate) fn load_link(file: &Path, scale: [f64; 3]) -> Result<LinkMesh, Refusal> {
    let (ending, bytes) = read(file)?;
    let digest = digest::of_bytes(&bytes);
    let mesh = triangles(file, &ending, &bytes).and_then(|read| {
        check_count(&read.triangles)?;
        let points_m = place(read.corners, scale)?;
        check_size(&points_m, SIZE_M_MAX)?;
        check_indices(&read.triangles, points_m.len())?;
        let up = read.up_axis.map(|up| format!("its up_axis {up} is not applied, as in rviz and MoveIt"));
        let remarks = read.remarks.into_iter().chain(up).collect();
        Ok(LinkMesh { points_m, triangles: read.triangles, digest, remarks })
    });
    mesh.map_err(|(value, expected)| refusal(file, &value, &expected))
}

/// The ending of a mesh file's name in small letters, and its bytes.
fn read(file: &Path) -> Result<(String, Vec<u8>), Refusal> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if !["stl", "obj", "dae"].contains(&ending.as_str()) {
        let expected = "a mesh file named .stl, .obj or .dae; others can be turned into one, for example with \
                        assimp export IN OUT.stl";
        return Err(refusal(file, "is none of .stl, .obj and .dae", expected));
    }
    let bytes = read_file(file, MESH_BYTES_MAX, "a mesh file").map_err(|faults| first_of(file, &faults))?;
    Ok((ending, bytes))
}

/// Reads and checks the bytes of a mesh file with the given ending.
fn parse(file: &Path, ending: &str, bytes: &[u8], scale: Scale) -> Result<Mesh, Refusal> {
    let read = triangles(file, ending, bytes)?;
    if let Some(up) = read.up_axis {
        let expected =
            "up_axis Z_UP: programs disagree on whether to turn such a mesh; export it with z up, or as STL";
        return Err((format!("has up_axis {up}"), expected.to_owned()));
    }
    check(read.corners, read.triangles, scale)
}

fn refusal(file: &Path, value: &str, expected: &str) -> Refusal {
    (format!("{} {value}", file.display()), expected.to_owned())
}

fn first_of(file: &Path, faults: &Faults) -> Refusal {
    match faults.0.first() {
        Some(fault) => refusal(file, &format!("is {}", fault.value), &fault.expected),
        None => refusal(file, "cannot be read", "a mesh file"),
    }
}

fn triangles(file: &Path, ending: &str, bytes: &[u8]) -> Result<Triangles, Refusal> {
    let read = match ending {
        "stl" => stl::read(bytes),
        "obj" => obj::read(bytes),
        _ => dae::read(file, bytes),
    };
    read.map(Triangles::merged)
}

/// What a reader hands on: unchecked corners and the triangles between them.
#[derive(Debug, Default)]
struct Triangles {
    corners: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
    /// How the file was read, in words.
    remarks: Vec<String>,
    /// The axis that the file calls up, when it is not z; it was not applied.
    up_axis: Option<String>,
}

impl Triangles {
    /// Adds a triangle with corners of its own.
    fn push(&mut self, corners: [[f64; 3]; 3]) {
        let first = self.corners.len();
        self.corners.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// The same triangles with each corner once, bit by bit, in the order of their first use.
    fn merged(self) -> Self {
        let mut index_of: HashMap<[u64; 3], usize> = HashMap::with_capacity(self.corners.len());
        let mut corners = Vec::new();
        let new_index: Vec<usize> = self
            .corners
            .iter()
            .map(|corner| {
                *index_of.entry(corner.map(f64::to_bits)).or_insert_with(|| {
                    corners.push(*corner);
                    corners.len() - 1
                })
            })
            .collect();
        // An index beyond the corners stays beyond them, for the check to refuse.
        let renumbered = |corner: usize| new_index.get(corner).copied().unwrap_or(usize::MAX);
        let triangles = self.triangles.iter().map(|t| t.map(renumbered)).collect();
        Self { corners, triangles, ..self }
    }
}

fn check(corners: Vec<[f64; 3]>, triangles: Vec<[usize; 3]>, scale: Scale) -> Result<Mesh, Refusal> {
    check_count(&triangles)?;
    let vertices_m = place(corners, [scale.factor; 3])?;
    check_size(&vertices_m, if scale.is_stated { STATED_SIZE_M_MAX } else { SIZE_M_MAX })?;
    let mut checked = Vec::with_capacity(triangles.len());
    for (i, triangle) in triangles.into_iter().enumerate() {
        checked.push(check_triangle(&vertices_m, triangle).ok_or_else(|| {
            let value = format!("has a degenerate triangle, number {i} from 0");
            (value, format!("triangles with an area of {AREA_M2_MIN:e} m^2 or more and corners that exist"))
        })?);
    }
    Ok(Mesh { vertices_m, triangles: checked })
}

/// An obstacle without triangles would be no obstacle at all, and nobody would notice.
fn check_count(triangles: &[[usize; 3]]) -> Result<(), Refusal> {
    if triangles.is_empty() {
        return Err(("has no triangles".to_owned(), "a mesh of at least one triangle".to_owned()));
    }
    if triangles.len() > TRIANGLES_MAX {
        let value = format!("has {} triangles", triangles.len());
        return Err((value, format!("at most {TRIANGLES_MAX}; simplify the mesh")));
    }
    Ok(())
}

fn check_indices(triangles: &[[usize; 3]], corners: usize) -> Result<(), Refusal> {
    match triangles.iter().position(|triangle| triangle.iter().any(|corner| *corner >= corners)) {
        None => Ok(()),
        Some(i) => Err((
            format!("has triangle {i} (from 0) with a corner that does not exist"),
            format!("corners below {corners}"),
        )),
    }
}

/// The corners in metres, each of them finite and near.
fn place(corners: Vec<[f64; 3]>, scale: [f64; 3]) -> Result<Vec<Point3<f64>>, Refusal> {
    let [x, y, z] = scale;
    let scaled = |[a, b, c]: [f64; 3]| Point3::new(a * x, b * y, c * z);
    let vertices_m: Vec<Point3<f64>> = corners.into_iter().map(scaled).collect();
    for (i, vertex) in vertices_m.iter().enumerate() {
        // A comparison that NaN fails too.
        if !vertex.iter().all(|c| c.abs() <= REACH_M_MAX) {
            let value = format!("has corner {i} at {vertex} m after scaling by {scale:?}");
            let expected =
                format!("finite coordinates up to {REACH_M_MAX} m; millimetres want scale = 0.001");
            return Err((value, expected));
        }
    }
    Ok(vertices_m)
}

/// A mesh in the wrong unit is found by its size: no part of an arm or of its surroundings is that large or that small.
fn check_size(vertices_m: &[Point3<f64>], size_m_max: f64) -> Result<(), Refusal> {
    let first = vertices_m.first().copied().unwrap_or_default();
    let (low, high) = vertices_m.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
    let size_m = high - low;
    let largest_m = size_m.max();
    let value = format!("is {:.4} x {:.4} x {:.4} m large", size_m.x, size_m.y, size_m.z);
    if largest_m > size_m_max {
        let expected = format!(
            "a mesh of at most {size_m_max} m: this one is probably in millimetres, which want scale = 0.001 (in a URDF \
             scale=\"0.001 0.001 0.001\"); split one that is really so large"
        );
        return Err((value, expected));
    }
    if largest_m > 0.0 && largest_m < SIZE_M_MIN {
        let expected =
            format!("a mesh of at least {SIZE_M_MIN} m: this one is probably scaled twice; try scale = 1");
        return Err((value, expected));
    }
    Ok(())
}

/// The triangle with small indices; `None` when a corner does not exist or the area is next to nothing.
fn check_triangle(vertices_m: &[Point3<f64>], triangle: [usize; 3]) -> Option<[u32; 3]> {
    let [a, b, c] = triangle;
    let (pa, pb, pc) = (vertices_m.get(a)?, vertices_m.get(b)?, vertices_m.get(c)?);
    let area_m2 = 0.5 * (pb - pa).cross(&(pc - pa)).norm();
    let index = |corner: usize| u32::try_from(corner).ok();
    if area_m2 >= AREA_M2_MIN { Some([index(a)?, index(b)?, index(c)?]) } else { None }
}

#[cfg(test)]
mod tests;
