//! Wavefront OBJ files: the faces of all objects and groups.
use super::{Refusal, Triangles};
use crate::document::{shown, without_mark};
use std::io::Cursor;
use std::path::Path;

/// Statements that are understood, and those that change nothing about where faces are.
const KNOWN: [&str; 21] = [
    "v",
    "vt",
    "vn",
    "vp",
    "f",
    "l",
    "p",
    "o",
    "g",
    "s",
    "mg",
    "usemtl",
    "mtllib",
    "usemap",
    "maplib",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
];

pub(super) fn read(bytes: &[u8]) -> Result<Triangles, Refusal> {
    let text = String::from_utf8_lossy(bytes);
    // With a mark before it the first statement would be an unknown one, and every index off by one. A backslash at the end of
    // a line continues it.
    let text = without_mark(&text).replace("\\\r\n", " ").replace("\\\n", " ");
    check_statements(&text)?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..tobj::LoadOptions::default()
    };
    // Points and lines have no inside. Faces of more corners become fans, which cover at least the face, also a hollow one.
    // Materials are other files; none is opened.
    let no_materials = |_: &Path| Ok(Default::default());
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(text.as_bytes()), &options, no_materials)
        .map_err(|e| ("is not OBJ".to_owned(), format!("OBJ faces ({e})")))?;
    let mut triangle_soup = Triangles::default();
    for model in &models {
        let first = triangle_soup.corners.len();
        let corners = model.mesh.positions.as_chunks::<3>().0;
        triangle_soup.corners.extend(corners.iter().map(|corner| corner.map(f64::from)));
        for face in model.mesh.indices.as_chunks::<3>().0 {
            triangle_soup.triangles.push(face.map(|corner| first + corner as usize));
        }
    }
    Ok(triangle_soup)
}

/// The parser skips what it does not know; free-form surfaces and faces of a misspelt word would be lost with it.
fn check_statements(text: &str) -> Result<(), Refusal> {
    for (i, line) in text.lines().enumerate() {
        let Some(word) = line.split_ascii_whitespace().next().filter(|word| !word.starts_with('#')) else {
            continue;
        };
        if !KNOWN.contains(&word) {
            let value = format!("line {}: {}", i + 1, shown(line.trim()));
            let expected = format!(
                "an OBJ file of polygons (statements {}); free-form curves and surfaces are not read",
                KNOWN.join(", ")
            );
            return Err((value, expected));
        }
    }
    Ok(())
}
