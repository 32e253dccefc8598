//! Whether a point is certainly outside of whatever a mesh encloses: a ray leads from it to infinity and meets no triangle.
//!
//! In doubt a ray meets a triangle: a point that is outside and not recognised makes a body larger, not wrong.
use super::piece::Piece;
use parry3d_f64::math::Vector;

/// How far beyond its edges a triangle is met, as a share of them.
const EDGE_SHARE: f64 = 1e-9;
/// A ray in the plane of a triangle meets it; planes nearer than this are the same, as a share of the triangle's size.
const PLANE_SHARE: f64 = 1e-9;

/// True when one of 26 rays meets no triangle of the mesh.
pub(super) fn is_outside(mesh: &Piece, point: Vector) -> bool {
    let step = |i: u32| f64::from(i % 3) - 1.0;
    let directions = (0..27).map(|i| Vector::new(step(i), step(i / 3), step(i / 9)));
    directions.filter(|direction| *direction != Vector::ZERO).any(|direction| {
        mesh.triangles.iter().all(|triangle| !meets(point, direction, mesh.corners(*triangle)))
    })
}

/// Whether a ray meets a triangle (Möller and Trumbore, 1997).
fn meets(from: Vector, direction: Vector, [a, b, c]: [Vector; 3]) -> bool {
    let (ab, ac, ap) = (b - a, c - a, from - a);
    let normal = ab.cross(ac);
    let size = ab.length().max(ac.length());
    let across = direction.dot(normal);
    let height = ap.dot(normal);
    if across.abs() <= PLANE_SHARE * normal.length() * direction.length() {
        return height.abs() <= PLANE_SHARE * normal.length() * size;
    }
    let along = -height / across;
    if along * direction.length() < -PLANE_SHARE * size {
        return false;
    }
    let turned = direction.cross(ap) / across;
    let (u, v) = (ac.dot(turned), -ab.dot(turned));
    u >= -EDGE_SHARE && v >= -EDGE_SHARE && u + v <= 1.0 + EDGE_SHARE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: a ray meets exactly the triangles that it goes through.
    /// Method: a point of the triangle's plane is chosen by its two coordinates there, and the ray aimed at it from a random place.
    #[test]
    fn ray_meets_a_triangle_exactly_where_it_goes_through_it() {
        let mut rng = crate::rng::SeededRng::new(1, 0);
        let mut met = 0;
        for i in 0..20_000 {
            let mut point =
                || Vector::new(rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-1.0, 1.0));
            let (a, b, c, from) = (point(), point(), point(), point());
            let (u, v) = (rng.within(-0.5, 1.5), rng.within(-0.5, 1.5));
            let target = a + (b - a) * u + (c - a) * v;
            let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
            assert_eq!(meets(from, target - from, [a, b, c]), is_inside, "{i}: {u}, {v}");
            assert!(!meets(from, from - target, [a, b, c]), "{i}: behind the ray");
            met += u32::from(is_inside);
        }
        assert!((1_000..19_000).contains(&met), "{met}");
    }
}
