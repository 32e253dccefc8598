//! Mesh files: STL (binary or ASCII) and Wavefront OBJ.
//!
//! A mesh is a set of triangles; colours, normals and materials are left out. Both formats hold single-precision
//! numbers here, which is a ten-thousandth of a millimetre at arm's length.
use crate::Faults;
use crate::document::read_file;
use nalgebra::Point3;
use std::io::Cursor;
use std::path::Path;

/// Longest mesh file.
pub(crate) const MESH_BYTES_MAX: u64 = 64 << 20;
/// Most triangles: collision queries walk a tree of them, and the tree is built at every start.
pub(crate) const TRIANGLES_MAX: usize = 200_000;
/// Farthest corner from the mesh's origin after scaling; more is a slip of the unit (millimetres).
pub(crate) const REACH_M_MAX: f64 = 100.0;
/// Triangles with a smaller area have no direction that arithmetic can trust.
const AREA_M2_MIN: f64 = 1e-14;

const STL_HEADER_BYTES: usize = 84;
const STL_TRIANGLE_BYTES: usize = 50;

/// Triangles, scaled to metres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mesh {
    pub(crate) vertices_m: Vec<Point3<f64>>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// What is wrong with a mesh: the value and what was expected.
pub(crate) type Refusal = (String, String);

/// Reads and checks a mesh file; the name's ending says which format it is.
pub(crate) fn load(file: &Path, scale: f64) -> Result<Mesh, Refusal> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if ending != "stl" && ending != "obj" {
        return Err(refusal(file, "is neither .stl nor .obj", "a mesh file named .stl or .obj"));
    }
    let bytes = read_file(file, MESH_BYTES_MAX, "a mesh file").map_err(|faults| first_of(file, &faults))?;
    let (corners, triangles) = if ending == "stl" { read_stl(bytes) } else { read_obj(&bytes) }
        .map_err(|(value, expected)| refusal(file, &value, &expected))?;
    check(corners, triangles, scale).map_err(|(value, expected)| refusal(file, &value, &expected))
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

type Soup = (Vec<[f32; 3]>, Vec<[usize; 3]>);

/// A binary file's length follows from its count, and that decides the format: the customary test, whether it begins
/// with `solid`, takes many binary files for text.
fn read_stl(mut bytes: Vec<u8>) -> Result<Soup, Refusal> {
    let count = bytes.get(80..STL_HEADER_BYTES).and_then(|c| c.try_into().ok()).map_or(0, u32::from_le_bytes);
    let binary_bytes = STL_HEADER_BYTES as u64 + u64::from(count) * STL_TRIANGLE_BYTES as u64;
    if bytes.len() as u64 == binary_bytes {
        bytes.iter_mut().take(5).for_each(|b| *b = b' ');
    } else if !bytes.starts_with(b"solid ") {
        let value = format!("is {} bytes long, and its header means {binary_bytes}", bytes.len());
        return Err((
            value,
            "a binary STL file of that length, or an ASCII one that begins with `solid NAME`".to_owned(),
        ));
    }
    let not_stl = |e: std::io::Error| ("is not STL".to_owned(), format!("STL triangles ({e})"));
    let mut cursor = Cursor::new(bytes);
    let mesh = stl_io::create_stl_reader(&mut cursor).and_then(|mut reader| reader.as_indexed_triangles());
    let mesh = mesh.map_err(not_stl)?;
    let corners = mesh.vertices.iter().map(|vertex| vertex.0).collect();
    Ok((corners, mesh.faces.iter().map(|face| face.vertices).collect()))
}

fn read_obj(bytes: &[u8]) -> Result<Soup, Refusal> {
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    // Materials are other files; none is opened.
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, no_materials)
        .map_err(|e| ("is not OBJ".to_owned(), format!("OBJ faces ({e})")))?;
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for model in &models {
        let first = corners.len();
        corners.extend(model.mesh.positions.as_chunks::<3>().0);
        for face in model.mesh.indices.as_chunks::<3>().0 {
            triangles.push(face.map(|corner| first + corner as usize));
        }
    }
    Ok((corners, triangles))
}

fn check(corners: Vec<[f32; 3]>, triangles: Vec<[usize; 3]>, scale: f64) -> Result<Mesh, Refusal> {
    if triangles.is_empty() {
        return Err(("has no triangles".to_owned(), "a mesh of at least one triangle".to_owned()));
    }
    if triangles.len() > TRIANGLES_MAX {
        let value = format!("has {} triangles", triangles.len());
        return Err((value, format!("at most {TRIANGLES_MAX}; simplify the mesh")));
    }
    let vertices_m: Vec<Point3<f64>> =
        corners.into_iter().map(|corner| Point3::from(corner.map(f64::from)) * scale).collect();
    for (i, vertex) in vertices_m.iter().enumerate() {
        // A comparison that NaN fails too.
        if !vertex.iter().all(|c| c.abs() <= REACH_M_MAX) {
            let value = format!("has corner {i} at {vertex} m after scaling by {scale}");
            let expected =
                format!("finite coordinates up to {REACH_M_MAX} m; millimetres want scale = 0.001");
            return Err((value, expected));
        }
    }
    let mut checked = Vec::with_capacity(triangles.len());
    for (i, triangle) in triangles.into_iter().enumerate() {
        checked.push(check_triangle(&vertices_m, triangle).ok_or_else(|| {
            let value = format!("has a degenerate triangle, number {i} from 0");
            (value, format!("triangles with an area of {AREA_M2_MIN:e} m^2 or more and corners that exist"))
        })?);
    }
    Ok(Mesh { vertices_m, triangles: checked })
}

fn check_triangle(vertices_m: &[Point3<f64>], triangle: [usize; 3]) -> Option<[u32; 3]> {
    let [a, b, c] = triangle;
    let (pa, pb, pc) = (vertices_m.get(a)?, vertices_m.get(b)?, vertices_m.get(c)?);
    let area_m2 = 0.5 * (pb - pa).cross(&(pc - pa)).norm();
    let index = |corner: usize| u32::try_from(corner).ok();
    if area_m2 >= AREA_M2_MIN { Some([index(a)?, index(b)?, index(c)?]) } else { None }
}
