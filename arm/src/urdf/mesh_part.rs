//! A mesh file as the convex bodies of a link.
use crate::convex_parts::{self, ConvexParts};
use crate::hull::Hull;
use crate::mesh::{self, LinkMesh};
use crate::scene::Shape;
use std::path::Path;

/// A mesh that is read.
#[derive(Clone)]
pub(super) struct MeshPart {
    pub(super) shapes: Vec<Shape>,
    /// SHA-256 of the file.
    pub(super) digest: [u8; 32],
    /// What became of the mesh, as text.
    pub(super) words: String,
}

impl MeshPart {
    pub(super) fn load(file: &Path, scale: [f64; 3]) -> Result<Self, mesh::Refusal> {
        let mesh = mesh::load_link(file, scale)?;
        let parts = convex_parts::of(&mesh.points_m, &mesh.triangles).map_err(|thickness_m| {
            let corners = mesh.points_m.len();
            let value = format!("{} has {corners} corners and is {thickness_m:.1e} m thick", file.display());
            (value, "a mesh with an inside: at least 4 corners that do not lie in one plane".to_owned())
        })?;
        let remarks: String = mesh.remarks.iter().map(|remark| format!("; {remark}")).collect();
        let words = format!("mesh {} counts as {}{remarks}", file.display(), words(&mesh, &parts));
        let shape = |Hull { vertices_m, triangles, rounding_m, .. }| Shape::Hull {
            vertices_m,
            triangles,
            rounding_m,
        };
        Ok(Self { shapes: parts.hulls.into_iter().map(shape).collect(), digest: mesh.digest, words })
    }
}

fn words(mesh: &LinkMesh, parts: &ConvexParts) -> String {
    let of = mesh.points_m.len();
    let corners: Vec<String> = parts.hulls.iter().map(|hull| hull.vertices_m.len().to_string()).collect();
    let rounding_mm = 1e3 * parts.hulls.iter().map(|hull| hull.rounding_m).fold(0.0, f64::max);
    let boxes = parts.hulls.iter().filter(|hull| hull.is_box).count();
    match corners.as_slice() {
        [corners] => {
            let what = if boxes > 0 { "the box around it" } else { "its convex hull" };
            format!("{what} ({corners} of {of} corners, widened by {rounding_mm:.2} mm)")
        }
        corners => {
            let boxes = if boxes > 0 { format!(", {boxes} of them boxes") } else { String::new() };
            format!(
                "{} convex parts, together {:.0} % smaller than its convex hull ({} corners for {of}, widened by up to {rounding_mm:.2} \
                 mm{boxes})",
                corners.len(),
                100.0 * (1.0 - parts.volume_share),
                corners.join(" + ")
            )
        }
    }
}
