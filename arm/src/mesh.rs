//! Mesh files: STL (binary or ASCII) and Wavefront OBJ.
//!
//! A mesh is a set of triangles; colours, normals and materials are left out. Both formats hold single-precision
//! numbers here, which is a ten-thousandth of a millimetre at arm's length.
use crate::document::read_file;
use crate::{Faults, digest};
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
    let (ending, bytes) = read(file)?;
    parse(&ending, bytes, scale).map_err(|(value, expected)| refusal(file, &value, &expected))
}

/// The corners of a mesh file, for its hull.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cloud {
    pub(crate) points_m: Vec<Point3<f64>>,
    /// SHA-256 of the file.
    pub(crate) digest: [u8; 32],
}

/// Reads a mesh file for its corners alone, each coordinate scaled by its own factor. Triangles without an area, which
/// programs leave behind in many meshes, do no harm here.
pub(crate) fn load_points(file: &Path, scale: [f64; 3]) -> Result<Cloud, Refusal> {
    let (ending, bytes) = read(file)?;
    let digest = digest::of_bytes(&bytes);
    let triangle_soup = triangle_soup(&ending, bytes);
    let points = triangle_soup.and_then(|(corners, triangles)| {
        check_count(&triangles)?;
        place(corners, scale)
    });
    let points_m = points.map_err(|(value, expected)| refusal(file, &value, &expected))?;
    Ok(Cloud { points_m, digest })
}

/// The ending of a mesh file's name in small letters, and its bytes.
fn read(file: &Path) -> Result<(String, Vec<u8>), Refusal> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    if ending != "stl" && ending != "obj" {
        let expected = "a mesh file named .stl or .obj; others (COLLADA .dae) can be turned into one, \
                        for example with assimp export IN.dae OUT.stl";
        return Err(refusal(file, "is neither .stl nor .obj", expected));
    }
    let bytes = read_file(file, MESH_BYTES_MAX, "a mesh file").map_err(|faults| first_of(file, &faults))?;
    Ok((ending, bytes))
}

/// Reads and checks the bytes of a mesh file with the given ending.
fn parse(ending: &str, bytes: Vec<u8>, scale: f64) -> Result<Mesh, Refusal> {
    let (corners, triangles) = triangle_soup(ending, bytes)?;
    check(corners, triangles, scale)
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

fn triangle_soup(ending: &str, bytes: Vec<u8>) -> Result<TriangleSoup, Refusal> {
    if ending == "stl" { read_stl(bytes) } else { read_obj(&bytes) }
}

type TriangleSoup = (Vec<[f32; 3]>, Vec<[usize; 3]>);

/// A binary file's length follows from its count, and that decides the format: the customary test, whether it begins
/// with `solid`, takes many binary files for text.
fn read_stl(mut bytes: Vec<u8>) -> Result<TriangleSoup, Refusal> {
    // Checked against the length before anything is allocated: the count is any number up to four thousand million.
    let count = bytes.get(80..STL_HEADER_BYTES).and_then(|c| c.try_into().ok()).map_or(0, u32::from_le_bytes);
    let binary_bytes = STL_HEADER_BYTES as u64 + u64::from(count) * STL_TRIANGLE_BYTES as u64;
    if bytes.len() as u64 == binary_bytes {
        // The reader looks for `solid` itself; the header of a binary file means nothing.
        bytes.iter_mut().take(5).for_each(|b| *b = b' ');
    } else if bytes.starts_with(b"solid\n") || bytes.starts_with(b"solid\r\n") {
        // A name may be absent; the reader knows ASCII by the blank before it.
        bytes.insert(5, b' ');
    } else if !bytes.starts_with(b"solid ") {
        let value = format!("is {} bytes long, and its header means {binary_bytes}", bytes.len());
        return Err((
            value,
            "a binary STL file of that length, or an ASCII one that begins with `solid`".to_owned(),
        ));
    }
    let not_stl = |e: std::io::Error| ("is not STL".to_owned(), format!("STL triangles ({e})"));
    let mut cursor = Cursor::new(bytes);
    let mesh = stl_io::create_stl_reader(&mut cursor).and_then(|mut reader| reader.as_indexed_triangles());
    let mesh = mesh.map_err(not_stl)?;
    let corners = mesh.vertices.iter().map(|vertex| vertex.0).collect();
    Ok((corners, mesh.faces.iter().map(|face| face.vertices).collect()))
}

fn read_obj(bytes: &[u8]) -> Result<TriangleSoup, Refusal> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    // Points and lines have no inside. Faces of more corners become fans, which cover at least the face, also a hollow one. Materials are other files;
    // none is opened.
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
    check_count(&triangles)?;
    let vertices_m = place(corners, [scale; 3])?;
    let mut checked = Vec::with_capacity(triangles.len());
    for (i, triangle) in triangles.into_iter().enumerate() {
        checked.push(check_triangle(&vertices_m, triangle).ok_or_else(|| {
            let value = format!("has a degenerate triangle, number {i} from 0");
            (value, format!("triangles with an area of {AREA_M2_MIN:e} m^2 or more and corners that exist"))
        })?);
    }
    Ok(Mesh { vertices_m, triangles: checked })
}

/// An obstacle without triangles would be no obstacle at all, without any sign of it.
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

/// The corners in metres, each of them finite and near.
fn place(corners: Vec<[f32; 3]>, scale: [f64; 3]) -> Result<Vec<Point3<f64>>, Refusal> {
    let [x, y, z] = scale;
    let scaled = |corner: [f32; 3]| {
        Point3::from([f64::from(corner[0]) * x, f64::from(corner[1]) * y, f64::from(corner[2]) * z])
    };
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

/// The triangle with small indices; `None` when a corner does not exist or the area is next to nothing.
fn check_triangle(vertices_m: &[Point3<f64>], triangle: [usize; 3]) -> Option<[u32; 3]> {
    let [a, b, c] = triangle;
    let (pa, pb, pc) = (vertices_m.get(a)?, vertices_m.get(b)?, vertices_m.get(c)?);
    let area_m2 = 0.5 * (pb - pa).cross(&(pc - pa)).norm();
    let index = |corner: usize| u32::try_from(corner).ok();
    if area_m2 >= AREA_M2_MIN { Some([index(a)?, index(b)?, index(c)?]) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::{any, prop, proptest};

    const OBJ: &str = "o roof\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\n\
                       f 1 2 3 4\nl 1 2\nf 1/1/1 2 5\nf -3 -2 -1\n";
    const STL: &str = "solid roof\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\n\
                       endfacet\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\n\
                       endfacet\nendsolid roof\n";

    /// Two triangles of the unit square. The header begins with `solid`, as some programs write it.
    fn binary_stl() -> Vec<u8> {
        let mut bytes = b"solid made by a program".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2_u32.to_le_bytes());
        for corners in [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]],
            [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
        ] {
            bytes.extend([0; 12]);
            bytes.extend(corners.as_flattened().iter().flat_map(|c: &f32| c.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn area_m2(mesh: &Mesh) -> f64 {
        let corner = |i: u32| mesh.vertices_m[usize::try_from(i).unwrap()];
        let area =
            |[a, b, c]: &[u32; 3]| 0.5 * (corner(*b) - corner(*a)).cross(&(corner(*c) - corner(*a))).norm();
        mesh.triangles.iter().map(area).sum()
    }

    #[test]
    fn mesh_of_each_format_has_its_triangles_and_scale() {
        let nameless = STL.replacen("solid roof", "solid", 1);
        let windows = nameless.replace('\n', "\r\n");
        let files = [binary_stl(), STL.into(), nameless.into(), windows.into()].map(|bytes| ("stl", bytes));
        for (ending, bytes) in files.into_iter().chain([("obj", OBJ.into())]) {
            let mesh = parse(ending, bytes, 0.5).unwrap();
            let expected = if ending == "obj" { (5, 4) } else { (4, 2) };
            assert_eq!((mesh.vertices_m.len(), mesh.triangles.len()), expected);
            let square_m2 = if ending == "obj" { 0.25 + 2.0 * 0.25 * 0.5 * 1.25_f64.sqrt() } else { 0.25 };
            assert!((area_m2(&mesh) - square_m2).abs() < 1e-12, "{}", area_m2(&mesh));
        }
    }

    #[test]
    fn bad_mesh_is_refused_with_words_that_help() {
        let binary = binary_stl();
        let mut cut = binary.clone();
        cut.truncate(120);
        let mut infinite = binary.clone();
        infinite[96..100].copy_from_slice(&f32::INFINITY.to_le_bytes());
        let mut huge = binary.clone();
        huge[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut empty = binary[..84].to_vec();
        empty[80..84].fill(0);
        let cases: [(&str, Vec<u8>, f64, &str); 14] = [
            ("stl", Vec::new(), 1.0, "is 0 bytes long"),
            ("stl", cut, 1.0, "is not STL"),
            ("stl", huge, 1.0, "is not STL"),
            ("stl", infinite, 1.0, "finite coordinates"),
            ("stl", empty, 1.0, "has no triangles"),
            ("stl", binary, 1000.0, "millimetres want scale"),
            ("stl", STL.replace("vertex 1 0 0", "vertex 1 1 0").into(), 1.0, "degenerate triangle, number 0"),
            ("stl", STL.replace("vertex 1 0 0", "vertex 1 nan 0").into(), 1.0, "is not STL"),
            ("stl", "solid x\nendsolid x\n".into(), 1.0, "has no triangles"),
            ("obj", Vec::new(), 1.0, "has no triangles"),
            ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 9").into(), 1.0, "is not OBJ"),
            ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 0").into(), 1.0, "is not OBJ"),
            ("obj", OBJ.replace("v 1 0 0", "v nan 0 0").into(), 1.0, "finite coordinates"),
            ("obj", OBJ.replace("f 1 2 3 4", "f 1 2 2").into(), 1.0, "degenerate triangle"),
        ];
        for (i, (ending, bytes, scale, words)) in cases.into_iter().enumerate() {
            let (value, expected) = parse(ending, bytes, scale).expect_err("a bad mesh");
            assert!(
                format!("{value}: expected {expected}").contains(words),
                "case {i}: {value}: expected {expected}"
            );
        }
    }

    proptest! {
        #![proptest_config(proptest::test_runner::Config { cases: 2000, failure_persistence: None, ..Default::default() })]

        #[test]
        fn mutated_mesh_never_panics_and_never_passes_unsound(
            which in 0..3_usize,
            edits in prop::collection::vec((any::<usize>(), 0..12_usize, prop::collection::vec(any::<u8>(), 0..12)), 1..5),
        ) {
            let (ending, mut bytes) = [("stl", binary_stl()), ("stl", STL.into()), ("obj", OBJ.into())][which].clone();
            for (at, cut, put) in edits {
                // A character of the format's own alphabet reaches deeper than a random byte.
                let put = put.into_iter().map(|b| if b % 2 == 0 { b"0123456789-/ \nvfe.solx"[usize::from(b) % 22] } else { b });
                let at = at % (bytes.len() + 1);
                let end = (at + cut).min(bytes.len());
                bytes.splice(at..end, put);
            }
            if let Ok(mesh) = parse(ending, bytes, 1.0) {
                let corners = u32::try_from(mesh.vertices_m.len()).unwrap();
                assert!(!mesh.triangles.is_empty() && mesh.triangles.iter().flatten().all(|corner| *corner < corners));
                assert!(mesh.vertices_m.iter().flat_map(|v| v.iter()).all(|c| c.abs() <= REACH_M_MAX));
            }
        }
    }
}
