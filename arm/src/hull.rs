//! The convex hull of a mesh, with few corners.
//!
//! Meshes of robots have tens of thousands of corners, and a distance costs a look at every one of them. So the hull is
//! built over the extreme points of a few hundred directions, and what these leave out is made good by a rounding: the body is the polyhedron
//! widened by the furthest distance of any point of the mesh from it. It always holds the whole mesh.
use nalgebra::Point3;
use parry3d_f64::math::Vector;
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{ConvexPolyhedron, Triangle};
use parry3d_f64::transformation::try_convex_hull;
use std::collections::{BTreeMap, BTreeSet};

/// Directions spread over the sphere, beside those of the axes and diagonals: about 13 degrees from one to the next.
const DIRECTIONS: u32 = 256;
/// Meshes thinner than this have no inside that arithmetic can trust.
const THICKNESS_M_MIN: f64 = 1e-5;
/// Corners nearer to each other than this share of the mesh's size are one; the rounding covers the other.
const MERGED_SHARE: f64 = 1e-4;
/// Points that stand out further than this share of the mesh's size become corners too.
const ROUNDING_SHARE: f64 = 0.01;
/// Most corners that are added so; what needs more gets its box.
const ROUNDS_MAX: usize = 200;
/// Arithmetic's part of the rounding.
const ROUNDING_M_MIN: f64 = 1e-9;

/// A polyhedron, and how far the mesh stands out of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Hull {
    pub(crate) vertices_m: Vec<Point3<f64>>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) rounding_m: f64,
    /// True when the polyhedron is only a box around the mesh, because no tighter one could be built.
    pub(crate) is_box: bool,
}

impl Hull {
    /// Volume of the polyhedron, without the rounding.
    pub(crate) fn volume_m3(&self) -> f64 {
        let corners: Vec<Vector> = self.vertices_m.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        volume(&corners, &self.triangles)
    }
}

/// What a closed polyhedron encloses, its faces counter-clockwise from outside: the cones from its first corner to its faces.
pub(crate) fn volume(corners: &[Vector], faces: &[[u32; 3]]) -> f64 {
    let apex = corners.first().copied().unwrap_or(Vector::ZERO);
    let triangles = faces.iter().filter_map(|face| triangle(corners, face));
    triangles.map(|[a, b, c]| (a - apex).dot((b - apex).cross(c - apex)) / 6.0).sum()
}

/// The hull of finite points; an error says why there is none: how thick they are.
pub(crate) fn of(points_m: &[Point3<f64>]) -> Result<Hull, f64> {
    build(points_m, &[0.0])
}

/// The same for a piece that was cut out of a mesh. Many of its points lie on one line or in one plane up to rounding, which leads to
/// faces without area, or to no hull at all: so its corners are moved a little, which the rounding makes good.
pub(crate) fn of_piece(points_m: &[Point3<f64>]) -> Result<Hull, f64> {
    build(points_m, &[1e-7, SCATTER, 1e-3])
}

/// By how much points of the unit cube are moved to leave common planes.
pub(crate) const SCATTER: f64 = 1e-5;

fn build(points_m: &[Point3<f64>], scatters: &[f64]) -> Result<Hull, f64> {
    let points: Vec<Vector> = points_m.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let cube = Cube::around(&points);
    let thickness_m = 2.0 * cube.half_m.min_element();
    if thickness_m.is_nan() || thickness_m < THICKNESS_M_MIN {
        return Err(thickness_m);
    }
    let extreme = extreme_points(&points.iter().map(|p| cube.inside(*p)).collect::<Vec<_>>());
    let built = scatters.iter().find_map(|by| polyhedron(&points, &cube, scattered(&extreme, *by)));
    Ok(built.unwrap_or_else(|| cube.hull()))
}

/// The polyhedron of the extreme points and, if these leave out too much, some more; none when arithmetic finds none.
fn polyhedron(points: &[Vector], cube: &Cube, mut extreme: Vec<Vector>) -> Option<Hull> {
    let mut outside = points.to_vec();
    for _ in 0..ROUNDS_MAX {
        let (corners, triangles) = convex_mesh(&extreme, f64::INFINITY)?;
        let corners: Vec<Vector> = corners.into_iter().map(|c| cube.outside(c)).collect();
        let furthest = keep_outside(&mut outside, &corners, &triangles);
        let far_m = ROUNDING_SHARE * cube.half_m.max_element();
        match furthest {
            Some((point, distance_m)) if distance_m > far_m => extreme.push(cube.inside(point)),
            _ => {
                // A hull of more points may have lost others by arithmetic: all of them are measured again.
                let furthest = keep_outside(&mut points.to_vec(), &corners, &triangles);
                let rounding_m = furthest.map_or(0.0, |(_, distance_m)| distance_m) + ROUNDING_M_MIN;
                ConvexPolyhedron::from_convex_mesh(corners.clone(), &triangles)
                    .filter(|_| rounding_m <= far_m + ROUNDING_M_MIN)?;
                return Some(Hull { vertices_m: to_points(&corners), triangles, rounding_m, is_box: false });
            }
        }
    }
    None
}

/// The convex hull of points; none when arithmetic finds none that leaves no point further outside than `outside`.
pub(crate) fn convex_mesh(points: &[Vector], outside: f64) -> Option<(Vec<Vector>, Vec<[u32; 3]>)> {
    let (corners, faces) =
        try_convex_hull(points).ok().filter(|(corners, faces)| is_closed_and_convex(corners, faces))?;
    let planes = faces.iter().filter_map(|face| plane(&corners, face));
    let furthest = planes.flat_map(|plane| points.iter().map(move |p| plane.outside(*p))).fold(0.0, f64::max);
    (furthest <= outside).then_some((corners, faces))
}

/// Points moved by up to half of `by` along each axis, each to somewhere else, the same everywhere.
pub(crate) fn scattered(points: &[Vector], by: f64) -> Vec<Vector> {
    // Multiples of these have parts behind the point that fall everywhere.
    let steps = Vector::new(0.618_033_988_75, 0.414_213_562_37, 0.732_050_807_57);
    let moved = |(i, point): (usize, &Vector)| *point + (steps * i as f64).fract() * by - 0.5 * by;
    points.iter().enumerate().map(moved).collect()
}

/// A box around the points, along their longest diagonal and the widest direction across it. Seen as a cube, even a
/// thin sheet that stands askew is as thick as it is wide, and what is convex stays so.
struct Cube {
    middle: Vector,
    /// Of unit length, across each other, right-handed.
    axes: [Vector; 3],
    half_m: Vector,
}

impl Cube {
    fn around(points: &[Vector]) -> Self {
        let furthest = |measure: &dyn Fn(Vector) -> f64| {
            let points = points.iter().copied();
            points.max_by(|a, b| measure(*a).total_cmp(&measure(*b))).unwrap_or(Vector::ZERO)
        };
        let first = points.first().copied().unwrap_or(Vector::ZERO);
        let a = furthest(&|p| (p - first).length());
        let b = furthest(&|p| (p - a).length());
        let along = (b - a).normalize_or_zero();
        let c = furthest(&|p| (p - a).cross(along).length());
        let normal = along.cross(c - a).normalize_or_zero();
        // Exactly across both, or zero: then the points lie on a line, and the box is flat.
        let axes = [along, normal.cross(along), normal];
        let seen = points.iter().map(|p| Vector::from_array(axes.map(|axis| p.dot(axis))));
        let (low, high) = seen
            .fold((Vector::splat(f64::INFINITY), Vector::splat(f64::NEG_INFINITY)), |(low, high), p| {
                (low.min(p), high.max(p))
            });
        let [x, y, z] = axes;
        let centre = 0.5 * (low + high);
        Self { middle: x * centre.x + y * centre.y + z * centre.z, axes, half_m: 0.5 * (high - low) }
    }
    /// A point in metres as the cube from -1 to 1 sees it.
    fn inside(&self, point: Vector) -> Vector {
        Vector::from_array(self.axes.map(|axis| (point - self.middle).dot(axis))) / self.half_m
    }
    /// And back.
    fn outside(&self, inside: Vector) -> Vector {
        let [x, y, z] = self.axes;
        let m = inside * self.half_m;
        self.middle + x * m.x + y * m.y + z * m.z
    }
    /// The box itself.
    fn hull(&self) -> Hull {
        let corner = |i: u32| {
            let side = |bit: u32| if i & (1 << bit) == 0 { -1.0 } else { 1.0 };
            self.outside(Vector::new(side(0), side(1), side(2)))
        };
        let corners: Vec<Vector> = (0..8).map(corner).collect();
        let (vertices_m, triangles) = (to_points(&corners), BOX_FACES.to_vec());
        Hull { vertices_m, triangles, rounding_m: ROUNDING_M_MIN, is_box: true }
    }
}

fn to_points(corners: &[Vector]) -> Vec<Point3<f64>> {
    corners.iter().map(|c| Point3::new(c.x, c.y, c.z)).collect()
}

/// The furthest points in each direction, those that lie next to another left out.
fn extreme_points(points: &[Vector]) -> Vec<Vector> {
    let mut chosen: BTreeSet<usize> = BTreeSet::new();
    for direction in directions() {
        let reach = |p: &Vector| p.dot(direction);
        let furthest = points.iter().enumerate().max_by(|(_, a), (_, b)| reach(a).total_cmp(&reach(b)));
        chosen.extend(furthest.map(|(i, _)| i));
    }
    let mut kept: Vec<Vector> = Vec::new();
    for point in chosen.into_iter().filter_map(|i| points.get(i)) {
        if kept.iter().all(|other| (*other - *point).length() > MERGED_SHARE) {
            kept.push(*point);
        }
    }
    kept
}

/// The axes and diagonals of a cube, where machined parts have their corners, and a spiral over the sphere.
fn directions() -> Vec<Vector> {
    let step = |i: u32| f64::from(i % 3) - 1.0;
    let cube = (0..27).map(|i| Vector::new(step(i), step(i / 3), step(i / 9)));
    let golden_rad = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let spiral = (0..DIRECTIONS).map(|i| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(DIRECTIONS);
        let (sin, cos) = (golden_rad * f64::from(i)).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Vector::new(across * cos, across * sin, z)
    });
    cube.chain(spiral).filter(|d| d.length() > 0.0).collect()
}

/// What the distance's iteration relies on: every edge between two faces, no corner in front of a face.
fn is_closed_and_convex(corners: &[Vector], faces: &[[u32; 3]]) -> bool {
    const SLACK: f64 = 1e-9;
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for [a, b, c] in faces {
        for edge in [(*a, *b), (*b, *c), (*c, *a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    let closed = edges.iter().all(|((a, b), count)| *count == 1 && edges.contains_key(&(*b, *a)));
    let planes: Option<Vec<Plane>> = faces.iter().map(|face| plane(corners, face)).collect();
    let behind = |plane: &Plane| corners.iter().all(|c| plane.outside(*c) <= SLACK);
    faces.len() >= 4 && closed && planes.is_some_and(|planes| planes.iter().all(behind))
}

/// The plane of a face, its normal outwards.
struct Plane {
    point: Vector,
    normal: Vector,
}

impl Plane {
    fn outside(&self, point: Vector) -> f64 {
        (point - self.point).dot(self.normal)
    }
}

fn plane(corners: &[Vector], face: &[u32; 3]) -> Option<Plane> {
    let [a, b, c] = triangle(corners, face)?;
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(Plane { point: a, normal })
}

fn triangle(corners: &[Vector], face: &[u32; 3]) -> Option<[Vector; 3]> {
    let corner = |i: u32| corners.get(usize::try_from(i).ok()?).copied();
    let [a, b, c] = *face;
    Some([corner(a)?, corner(b)?, corner(c)?])
}

/// Faces of a box whose corner i lies at the high end of axis k where bit k of i is set.
#[rustfmt::skip]
const BOX_FACES: [[u32; 3]; 12] = [
    [0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
    [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5],
];

/// Leaves the points outside of the polyhedron, which only grows, and returns the furthest of them and its distance.
fn keep_outside(points: &mut Vec<Vector>, corners: &[Vector], faces: &[[u32; 3]]) -> Option<(Vector, f64)> {
    let face = |face| {
        let [a, b, c] = triangle(corners, face)?;
        Some((plane(corners, face)?, Triangle::new(a, b, c)))
    };
    let faces: Vec<(Plane, Triangle)> = faces.iter().filter_map(face).collect();
    points.retain(|p| faces.iter().any(|(plane, _)| plane.outside(*p) > 0.0));
    let to_face_m = |face: &Triangle, p: Vector| face.distance_to_local_point(p, true);
    let mut furthest: Option<(Vector, f64)> = None;
    for p in points.iter().copied() {
        let seen = faces.iter().map(|(plane, face)| (plane.outside(p), face));
        let Some((_, most)) = seen.max_by(|(a, _), (b, _)| a.total_cmp(b)) else { continue };
        // The nearest face is no further than this one: most points need no look at all faces.
        if furthest.is_some_and(|(_, far_m)| to_face_m(most, p) < far_m) {
            continue;
        }
        let distance_m = faces.iter().map(|(_, face)| to_face_m(face, p)).fold(f64::INFINITY, f64::min);
        if furthest.is_none_or(|(_, far_m)| distance_m >= far_m) {
            furthest = Some((p, distance_m));
        }
    }
    furthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;

    /// Points of one of many kinds: dense and sparse, round and edged, doubled, nearly flat, on a grid.
    fn points(seed: u64) -> Vec<Point3<f64>> {
        let mut rng = SeededRng::new(seed, 20);
        let count = if seed.is_multiple_of(7) { 3 + rng.index(6) } else { 20 + rng.index(400) };
        let size = Point3::new(rng.within(0.01, 0.5), rng.within(0.01, 0.5), rng.within(0.01, 0.5));
        let flat = if seed % 5 == 1 { rng.within(0.0, 1e-3) } else { 1.0 };
        let kind = rng.index(5);
        let mut made: Vec<Point3<f64>> = (0..count)
            .map(|_| {
                let mut p = Vector::new(rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-1.0, 1.0));
                match kind {
                    0 => p = p.normalize_or_zero(),   // A ball's surface.
                    1 => p = (p * 2.0).round() / 2.0, // A grid: many in one plane.
                    2 => p = Vector::new(p.x.signum(), p.y.signum(), p.z.signum()), // Corners, many times.
                    3 => p = Vector::new(p.x.signum(), p.y, p.z) + 1e-12 * p, // Two faces, noisy.
                    _ => {}
                }
                Point3::new(p.x * size.x, p.y * size.y, p.z * size.z * flat)
            })
            .collect();
        let askew =
            nalgebra::UnitQuaternion::from_euler_angles(rng.within(0.0, 3.0), rng.within(0.0, 3.0), 0.0);
        if seed.is_multiple_of(2) {
            made = made.iter().map(|p| askew * p).collect();
        }
        if seed.is_multiple_of(3) {
            made.extend(made.clone());
        }
        made
    }

    /// Goal: the body holds every point of the mesh, and is not much larger than it must be.
    /// Method: support planes: no point is further out than the polyhedron and its rounding, in any of many directions, and the
    /// polyhedron's corners are points of the mesh, so that it cannot be larger than the true hull.
    #[test]
    fn hull_of_random_points_holds_them_all_and_nothing_much_else() {
        let (mut boxes, mut flat) = (0, 0);
        for seed in 0..600 {
            let points = points(seed);
            let hull = match of(&points) {
                Ok(hull) => hull,
                Err(thickness_m) => {
                    assert!(thickness_m < THICKNESS_M_MIN, "seed {seed}: {thickness_m}");
                    flat += 1;
                    continue;
                }
            };
            boxes += u32::from(hull.is_box);
            let mut rng = SeededRng::new(seed, 21);
            for _ in 0..200 {
                let d = nalgebra::Vector3::new(
                    rng.within(-1.0, 1.0),
                    rng.within(-1.0, 1.0),
                    rng.within(-1.0, 1.0),
                );
                let d = d.normalize();
                let reach =
                    |set: &[Point3<f64>]| set.iter().map(|p| p.coords.dot(&d)).fold(f64::MIN, f64::max);
                let (mesh_m, hull_m) = (reach(&points), reach(&hull.vertices_m));
                assert!(mesh_m <= hull_m + hull.rounding_m, "seed {seed}: {mesh_m} beyond {hull_m}");
                assert!(hull.is_box || hull_m <= mesh_m + 1e-12, "seed {seed}: a corner from nowhere");
            }
            if !hull.is_box {
                let size_m = points.iter().map(|p| p.coords.norm()).fold(0.0, f64::max);
                assert!(hull.rounding_m <= 0.011 * size_m, "seed {seed}: widened by {}", hull.rounding_m);
            }
        }

        assert!(flat > 20 && boxes < 6, "{flat} were flat, {boxes} became boxes");
    }

    #[test]
    fn hull_of_no_point_one_point_a_line_or_a_plane_is_refused() {
        let p = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let line: Vec<_> = (0..9).map(|i| p(f64::from(i), 2.0 * f64::from(i), 1.0)).collect();
        let plane: Vec<_> =
            (0..25).map(|i| p(f64::from(i % 5), f64::from(i / 5), 0.5 * f64::from(i % 5))).collect();
        for set in [
            vec![],
            vec![p(1.0, 2.0, 3.0)],
            vec![p(1.0, 2.0, 3.0); 50],
            line,
            plane,
            vec![p(f64::NAN, 0.0, 0.0); 9],
        ] {
            assert!(of(&set).is_err(), "{set:?}");
        }
    }

    #[test]
    fn box_that_stands_in_for_a_hull_is_closed_and_convex() {
        let side = |i: usize, bit: usize| if i & (1 << bit) == 0 { -1.0 } else { 1.5 };
        let corners: Vec<Vector> = (0..8).map(|i| Vector::new(side(i, 0), side(i, 1), side(i, 2))).collect();
        assert!(is_closed_and_convex(&corners, &BOX_FACES));
        let mut turned = BOX_FACES;
        turned[3].reverse();
        assert!(!is_closed_and_convex(&corners, &turned) && !is_closed_and_convex(&corners, &BOX_FACES[1..]));
    }
}
