//! The part of a mesh on one side of some planes.
use parry3d_f64::math::Vector;
use std::collections::HashMap;

/// A plane across an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    /// 0, 1 or 2.
    pub(super) axis: usize,
    pub(super) at_m: f64,
}

/// Triangles, and the corners that they have; a whole mesh may have more corners.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub(super) points: Vec<Vector>,
    pub(super) triangles: Vec<[usize; 3]>,
}

impl Piece {
    /// What lies below the plane, and the triangles in it.
    pub(super) fn below(&self, plane: Plane) -> Self {
        self.clipped(plane, |p| plane.at_m - p[plane.axis], true)
    }

    /// What lies above the plane.
    pub(super) fn above(&self, plane: Plane) -> Self {
        self.clipped(plane, |p| p[plane.axis] - plane.at_m, false)
    }

    /// The triangles where the depth is positive, clipped there (Sutherland and Hodgman, 1974). A triangle that only touches the
    /// plane has no part on the other side of it.
    fn clipped(&self, plane: Plane, depth_m: impl Fn(Vector) -> f64, with_flat: bool) -> Self {
        let mut side =
            Clipped { whole: self, plane, points: Vec::new(), kept: HashMap::new(), cut: HashMap::new() };
        let mut triangles = Vec::new();
        for triangle in &self.triangles {
            let corners = triangle.map(|corner| self.point(corner));
            let depths = corners.map(&depth_m);
            let is_flat = depths.iter().all(|depth| *depth == 0.0);
            if !(depths.iter().any(|depth| *depth > 0.0) || is_flat && with_flat) {
                continue;
            }
            let polygon = side.polygon(*triangle, depths);
            let fan = |i: usize| Some([*polygon.first()?, *polygon.get(i)?, *polygon.get(i + 1)?]);
            triangles.extend((1..polygon.len().saturating_sub(1)).filter_map(fan));
        }
        Self { points: side.points, triangles }
    }

    pub(super) fn point(&self, index: usize) -> Vector {
        self.points.get(index).copied().unwrap_or(Vector::ZERO)
    }

    pub(super) fn corners(&self, triangle: [usize; 3]) -> [Vector; 3] {
        triangle.map(|corner| self.point(corner))
    }
}

/// A clipped piece that is being made.
struct Clipped<'a> {
    whole: &'a Piece,
    plane: Plane,
    points: Vec<Vector>,
    /// From corners of the whole to corners here.
    kept: HashMap<usize, usize>,
    /// From edges of the whole to where they cross the plane.
    cut: HashMap<(usize, usize), usize>,
}

impl Clipped<'_> {
    fn polygon(&mut self, triangle: [usize; 3], depths: [f64; 3]) -> Vec<usize> {
        let mut polygon = Vec::with_capacity(4);
        let corners = triangle.into_iter().zip(depths);
        let next = corners.clone().cycle().skip(1);
        for ((a, depth_a), (b, depth_b)) in corners.zip(next) {
            if depth_a >= 0.0 {
                polygon.push(self.corner(a));
            }
            if depth_a * depth_b < 0.0 {
                polygon.push(self.crossing(a, b));
            }
        }
        polygon
    }

    fn corner(&mut self, index: usize) -> usize {
        let Self { whole, points, kept, .. } = self;
        *kept.entry(index).or_insert_with(|| {
            points.push(whole.point(index));
            points.len() - 1
        })
    }

    fn crossing(&mut self, a: usize, b: usize) -> usize {
        let Self { whole, plane, points, cut, .. } = self;
        // In one direction, so that both triangles of the edge have the same point.
        let edge = (a.min(b), a.max(b));
        *cut.entry(edge).or_insert_with(|| {
            points.push(crossing(whole.point(edge.0), whole.point(edge.1), *plane));
            points.len() - 1
        })
    }
}

/// Where the line between two points on different sides of a plane meets it.
pub(super) fn crossing(from: Vector, to: Vector, plane: Plane) -> Vector {
    let Plane { axis, at_m } = plane;
    let share = (at_m - from[axis]) / (to[axis] - from[axis]);
    let mut point = from + (to - from) * share;
    point[axis] = at_m;
    point
}

/// An open box, which may reach to infinity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    low: Vector,
    high: Vector,
}

impl Cell {
    pub(super) const EVERYWHERE: Self =
        Self { low: Vector::splat(f64::NEG_INFINITY), high: Vector::splat(f64::INFINITY) };

    /// The cells below and above a plane.
    pub(super) fn divide(self, Plane { axis, at_m }: Plane) -> (Self, Self) {
        let (mut below, mut above) = (self, self);
        below.high[axis] = at_m;
        above.low[axis] = at_m;
        (below, above)
    }

    /// The corners that are not at infinity.
    pub(super) fn corners(self) -> Vec<Vector> {
        let end = |i: u32, bit: u32| if i & (1 << bit) == 0 { self.low } else { self.high };
        let corner = |i: u32| Vector::new(end(i, 0).x, end(i, 1).y, end(i, 2).z);
        (0..8).map(corner).filter(|corner| corner.is_finite()).collect()
    }
}
