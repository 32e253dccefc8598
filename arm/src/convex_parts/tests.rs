use super::piece::Plane;
use super::*;
use crate::rng::SeededRng;
use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::Triangle;
use parry3d_f64::transformation::try_convex_hull;

/// What a point may stand out of the bodies by arithmetic.
const SLACK_M: f64 = 1e-12;
/// How far beyond the plane of a face a point still counts as behind it.
const PLANE_M: f64 = 1e-9;

/// Least and largest distance of the lines of a grid.
const WIDTHS_M: [f64; 2] = [0.03, 0.1];

/// A closed mesh, and points of what it encloses.
struct Solid {
    points: Vec<Point3<f64>>,
    triangles: Vec<[usize; 3]>,
    inside: Vec<Point3<f64>>,
}

impl Solid {
    /// The boundary of some cells of a grid whose lines lie at random distances: closed, and without walls inside.
    fn of_cells(cells: &[[i32; 3]], widths_m: [f64; 2], rng: &mut SeededRng) -> Self {
        let lines: [Vec<f64>; 3] = std::array::from_fn(|_| {
            let mut at = 0.0;
            let step = |_| {
                at += rng.within(widths_m[0], widths_m[1]);
                at
            };
            (0..12).map(step).collect()
        });
        let place = |[x, y, z]: [i32; 3]| {
            let at = |axis: usize, i: i32| lines[axis][usize::try_from(i).unwrap()];
            Point3::new(at(0, x), at(1, y), at(2, z))
        };
        let mut solid = Self { points: Vec::new(), triangles: Vec::new(), inside: Vec::new() };
        for cell in cells {
            for (axis, up) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
                let mut beyond = *cell;
                beyond[axis] += 2 * up - 1;
                if cells.contains(&beyond) {
                    continue;
                }
                let corner = |u: i32, v: i32| {
                    let mut corner = *cell;
                    corner[axis] += up;
                    corner[(axis + 1) % 3] += u;
                    corner[(axis + 2) % 3] += v;
                    place(corner)
                };
                let mut face = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                if up == 0 {
                    face.reverse();
                }
                let first = solid.points.len();
                solid.points.extend(face);
                solid.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
            let (low, high) = (place(*cell), place(cell.map(|i| i + 1)));
            let mut between = |axis: usize| rng.within(low[axis], high[axis]);
            solid.inside.extend((0..60).map(|_| Point3::new(between(0), between(1), between(2))));
        }
        solid
    }

    fn turned(mut self, by: &UnitQuaternion<f64>) -> Self {
        self.points.iter_mut().chain(&mut self.inside).for_each(|p| *p = by * *p);
        self
    }

    /// Points all over the triangles.
    fn surface(&self) -> Vec<Point3<f64>> {
        let mut found = Vec::new();
        for [a, b, c] in self.triangles.iter().map(|triangle| triangle.map(|i| self.points[i])) {
            for i in 0..=8 {
                let steps = (0..=8 - i).map(|j| (f64::from(i) / 8.0, f64::from(j) / 8.0));
                found.extend(steps.map(|(u, v)| a + (b - a) * u + (c - a) * v));
            }
        }
        found
    }

    fn parts(&self) -> ConvexParts {
        of(&self.points, &self.triangles).expect("not flat")
    }
}

/// How far a point is outside of the nearest body; 0 inside.
fn outside_m(hulls: &[Hull], point: &Point3<f64>) -> f64 {
    let vector = |p: &Point3<f64>| Vector::new(p.x, p.y, p.z);
    let point = vector(point);
    let mut least_m = f64::INFINITY;
    for hull in hulls {
        let corner = |i: u32| vector(&hull.vertices_m[usize::try_from(i).unwrap()]);
        let (mut is_inside, mut nearest_m) = (true, f64::INFINITY);
        for [a, b, c] in hull.triangles.iter().map(|face| face.map(corner)) {
            // The plane of a sliver is as good as arithmetic makes it.
            is_inside &= (point - a).dot((b - a).cross(c - a).normalize_or_zero()) <= PLANE_M;
            nearest_m = nearest_m.min(Triangle::new(a, b, c).distance_to_local_point(point, true));
        }
        least_m = least_m.min(if is_inside { 0.0 } else { (nearest_m - hull.rounding_m).max(0.0) });
    }
    least_m
}

fn assert_contained(hulls: &[Hull], points: &[Point3<f64>], what: &str) {
    for point in points {
        let out_m = outside_m(hulls, point);
        assert!(out_m <= SLACK_M, "{what}: {point} stands {out_m:e} m out of {} parts", hulls.len());
    }
}

/// Cells of a picture of one layer, `#` for a cell, `layers` layers deep.
fn layers(picture: &[&str], layers: i32) -> Vec<[i32; 3]> {
    let mut cells = Vec::new();
    for (y, line) in (0..).zip(picture) {
        for (x, _) in (0..).zip(line.chars()).filter(|(_, c)| *c == '#') {
            cells.extend((0..layers).map(|z| [x, y, z]));
        }
    }
    cells
}

const L: [&str; 4] = ["#...", "#...", "#...", "####"];
const U: [&str; 4] = ["#..#", "#..#", "#..#", "####"];
const RING: [&str; 4] = ["####", "#..#", "#..#", "####"];

/// Goal: the parts of a concave link contain its surface and its inside, and leave its gap free.
/// Method: closed meshes of an L, a U and a ring with walls of random widths, straight and turned; points of the surface and of the
/// inside, and the middle of the gap.
#[test]
fn parts_of_bent_links_contain_them_and_leave_their_gaps() {
    let mut rng = SeededRng::new(5, 0);
    for (name, picture, least) in [("L", L, 2), ("U", U, 3), ("ring", RING, 1)] {
        for seed in 0..40 {
            let cells = layers(&picture, 1 + seed % 3);
            let straight = Solid::of_cells(&cells, WIDTHS_M, &mut rng);
            let middle =
                straight.points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / straight.points.len() as f64;
            let mut angle = || if seed % 2 == 0 { 0.0 } else { rng.within(-0.1, 0.1) };
            let by = UnitQuaternion::from_euler_angles(angle(), angle(), angle());
            let solid = straight.turned(&by);
            let what = format!("{name} {seed}");
            let parts = solid.parts();
            // Also by cuts that are worth nothing, into thin pieces with many points in one plane.
            let points = solid.points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
            let cut_up = cut_up(&Piece { points, triangles: solid.triangles.clone() }, -1.0);
            let cut_up: Vec<Hull> = cut_up.into_iter().map(|part| part.hull).collect();
            assert_eq!(cut_up.len(), PARTS_MAX, "{what}");
            for hulls in [&parts.hulls, &cut_up] {
                assert_contained(hulls, &solid.surface(), &format!("{what}, surface"));
                assert_contained(hulls, &solid.inside, &format!("{what}, inside"));
            }
            assert!(
                parts.hulls.len() >= least && parts.hulls.len() <= PARTS_MAX,
                "{what}: {}",
                parts.hulls.len()
            );
            if name == "U" {
                let gap_m = outside_m(&parts.hulls, &(by * Point3::from(middle)));
                let one = hull::of(&solid.points).expect("not flat");
                assert!(outside_m(&[one], &(by * Point3::from(middle))) == 0.0, "{what}: no gap at {middle}");
                assert!(
                    gap_m > 0.005 && parts.volume_share < 0.85,
                    "{what}: {gap_m} m, {}",
                    parts.volume_share
                );
            }
        }
    }
}

/// Goal: no cut, however chosen, loses a point of a mesh or of what it encloses.
/// Method: random cells of a grid, cut by random planes across all axes, often along faces or through the middle of thick places, where corners of
/// the cells lie inside. Some triangles are turned over, and some missing, which takes nothing from the surface.
#[test]
fn any_cuts_of_random_solids_leave_parts_that_contain_them() {
    let mut largest = 0;
    for seed in 0..300 {
        let mut rng = SeededRng::new(seed, 1);
        let size = 1 + i32::try_from(rng.index(4)).unwrap();
        let share = if seed % 3 == 0 { 1.0 } else { 0.7 };
        let mut cells: Vec<[i32; 3]> =
            (0..size * size * size).map(|i| [i % size, i / size % size, i / size / size]).collect();
        cells.retain(|_| rng.unit() < share);
        cells.push([size, 0, 0]);
        let mut solid = Solid::of_cells(&cells, WIDTHS_M, &mut rng);
        solid.triangles.iter_mut().filter(|_| seed % 4 == 1 && rng.unit() < 0.5).for_each(|t| t.reverse());
        let is_open = seed % 4 == 2;
        solid.triangles.retain(|_| !is_open || rng.unit() < 0.8);
        let points = solid.points.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let mesh = Piece { points, triangles: solid.triangles.clone() };
        let Some(first) = Part::of(&mesh, mesh.clone(), Cell::EVERYWHERE) else { continue };
        let mut parts = vec![first];
        for _ in 0..rng.index(9) {
            let (index, axis) = (rng.index(parts.len()), rng.index(3));
            let corner = solid.points[rng.index(solid.points.len())];
            let at_m = if rng.unit() < 0.4 { corner[axis] } else { rng.within(0.0, 0.4) };
            let cut = Cut { plane: Plane { axis, at_m }, saved_m3: 0.0 };
            if let Some((below, above)) = parts[index].divide(&mesh, cut) {
                parts[index] = below;
                parts.push(above);
            }
        }
        let hulls: Vec<Hull> = parts.into_iter().map(|part| part.hull).collect();
        largest = largest.max(hulls.len());
        assert_contained(&hulls, &solid.surface(), &format!("seed {seed}, surface"));
        if !is_open {
            assert_contained(&hulls, &solid.inside, &format!("seed {seed}, inside"));
        }
    }
    assert!(largest >= 6, "{largest} parts at most");
}

/// Goal: meshes of several solids that overlap, as drawing programs leave them, are contained.
/// Method: unions of random prisms, in any pose; points all over the facets.
#[test]
fn parts_of_overlapping_prisms_contain_all_facets() {
    let mut divided = 0;
    for seed in 0..150 {
        let mut rng = SeededRng::new(seed, 2);
        let mut all = Solid { points: Vec::new(), triangles: Vec::new(), inside: Vec::new() };
        for _ in 0..2 + rng.index(3) {
            let sides = 3 + rng.index(5);
            let (radius_m, height_m) = (rng.within(0.02, 0.2), rng.within(0.02, 0.4));
            let turn = UnitQuaternion::from_euler_angles(rng.within(0.0, 6.0), rng.within(0.0, 6.0), 0.0);
            let at = Vector3::new(rng.within(-0.2, 0.2), rng.within(-0.2, 0.2), rng.within(-0.2, 0.2));
            let first = all.points.len();
            for z in [0.0, height_m] {
                let corner = |i: usize| {
                    let angle_rad = std::f64::consts::TAU * i as f64 / sides as f64;
                    turn * Point3::new(radius_m * angle_rad.cos(), radius_m * angle_rad.sin(), z) + at
                };
                all.points.extend((0..sides).map(corner));
            }
            for i in 0..sides {
                let j = (i + 1) % sides;
                let (a, b, c, d) = (first + i, first + j, first + sides + i, first + sides + j);
                all.triangles.extend([[a, b, d], [a, d, c], [first, b, a], [first + sides, c, d]]);
            }
        }
        let parts = all.parts();
        divided += u32::from(parts.hulls.len() > 1);
        assert_contained(&parts.hulls, &all.surface(), &format!("seed {seed}"));
    }
    assert!(divided > 100, "{divided} were cut at all");
}

/// Goal: a convex mesh is modelled by its one hull, bit by bit the one that it had before there were parts.
/// Method: hulls of random points of many kinds: round, edged, long, thin, askew.
#[test]
fn convex_mesh_stays_the_one_hull_of_its_points() {
    for seed in 0..150 {
        let mut rng = SeededRng::new(seed, 3);
        let mut size = || rng.within(0.01, 0.5);
        let size = Vector::new(size(), size(), size());
        let (count, kind) = (8 + rng.index(300), rng.index(3));
        let turn = UnitQuaternion::from_euler_angles(rng.within(0.0, 6.0), rng.within(0.0, 6.0), 0.0);
        let mut random = || Vector::new(rng.within(-1.0, 1.0), rng.within(-1.0, 1.0), rng.within(-1.0, 1.0));
        let point = |_| {
            let p = random();
            let p = match kind {
                0 => p.normalize_or_zero(),
                1 => Vector::new(p.x, p.y, 0.0).normalize_or_zero().with_z(p.z.signum()),
                _ => p,
            };
            let p = p * size;
            turn * Point3::new(p.x, p.y, p.z)
        };
        let cloud: Vec<Vector> = (0..count).map(point).map(|p| Vector::new(p.x, p.y, p.z)).collect();
        let Ok((corners, faces)) = try_convex_hull(&cloud) else { continue };
        let points: Vec<Point3<f64>> = corners.iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
        let triangles: Vec<[usize; 3]> =
            faces.iter().map(|face| face.map(|i| usize::try_from(i).unwrap())).collect();
        let one = hull::of(&points).expect("not flat");
        let parts = of(&points, &triangles).expect("not flat");
        assert_eq!(parts, ConvexParts { hulls: vec![one], volume_share: 1.0 }, "seed {seed}");
    }
}

/// Goal: where several cuts are of equal merit, noise of the last bits does not choose among them, because another machine may
/// have other ones.
/// Method: symmetric solids whose corners are moved by much less than the tolerance.
#[test]
fn cuts_of_symmetric_links_do_not_hang_on_the_last_bits() {
    /// Which of the points that a face shares a hull is built from may change; another cut would change more.
    const HULL_SHARE: f64 = 0.02;
    let cross = [".#.", "###", ".#."];
    for picture in [U.as_slice(), &cross] {
        let regular = |noise_m: f64, seed: u64| {
            let mut rng = SeededRng::new(seed, 5);
            let mut solid = Solid::of_cells(&layers(picture, 1), [0.05, 0.05], &mut rng);
            solid
                .points
                .iter_mut()
                .flat_map(|p| p.iter_mut())
                .for_each(|c| *c += rng.within(-noise_m, noise_m));
            solid.parts()
        };
        let first = regular(0.0, 0);
        for seed in 1..30 {
            let other = regular(1e-14, seed);
            assert_eq!(first.hulls.len(), other.hulls.len(), "seed {seed}");
            for (a, b) in first.hulls.iter().zip(&other.hulls) {
                assert!((a.volume_m3() - b.volume_m3()).abs() < HULL_SHARE * a.volume_m3(), "seed {seed}");
            }
        }
    }
}
