//! One collision shape as a core and a radius, and its pose.
use crate::closed_form::{segment_to_box_m, segment_to_segment_m};
use crate::cloud::{Cloud, PointTree};
use crate::scene::Shape;
use parry3d_f64::math::{Pose, Rot3, Vector};
use parry3d_f64::query::details::closest_points_support_map_support_map;
use parry3d_f64::query::{ClosestPoints, distance};
use parry3d_f64::shape::{
    Ball, ConvexPolyhedron, Cuboid, Cylinder, Segment, Shape as ParryShape, SupportMap, TriMesh,
};
use std::sync::Arc;
use taustream_motion::chain;

/// What parry3d's iterative distances to triangle meshes may be off by: taken away, so that they stay lower bounds. Of 1.8
/// million distances between segments and cylinders of up to 0.7 m, by the same iteration, the worst was 19 um above the truth.
const ITERATION_SLACK_M: f64 = 5e-5;
/// A segment shorter than this is a point.
const POINT_M: f64 = 1e-12;

/// The hard inside of a shape, in its own axes.
#[derive(Clone)]
pub enum Core {
    /// From the first to the second point; equal points make a sphere.
    Segment(Vector, Vector),
    /// Half edges around the origin.
    Box(Vector),
    /// Around the origin, along y.
    Cylinder {
        /// Half of its length.
        half_m: f64,
        /// Its radius.
        radius_m: f64,
    },
    /// Anything convex that only parry3d knows.
    Convex,
    /// Triangles; the solid is what they enclose.
    Mesh(Arc<TriMesh>),
    /// Points.
    Cloud(Arc<Cloud>),
}

/// A shape in the frame that it is rigid with.
#[derive(Clone)]
pub struct Body {
    core: Core,
    /// Radius around the core.
    radius_m: f64,
    /// From the frame to the core's own axes.
    local: Pose,
    /// Centre of a ball around the whole shape, in the core's axes.
    centre: Vector,
    /// Radius of that ball.
    bound_m: f64,
    parry: Arc<dyn ParryShape>,
}

/// The pose of a body.
#[derive(Clone, Copy, Debug)]
pub struct Posed {
    /// Of the core's axes.
    pub pose: Pose,
    /// Centre of the ball around the shape.
    pub centre: Vector,
    /// Ends of the segment; the centre twice for other cores.
    ends: [Vector; 2],
}

/// From the motion crate's pose to parry3d's.
#[must_use]
pub fn to_parry(pose: &chain::Pose) -> Pose {
    let (t, r) = (pose.translation.vector, pose.rotation.coords);
    Pose::from_parts(Vector::new(t.x, t.y, t.z), Rot3::from_xyzw(r.x, r.y, r.z, r.w))
}

impl Body {
    /// Makes a body; `None` for a mesh without triangles, or with corners that do not exist.
    #[must_use]
    pub fn new(shape: &Shape, pose: &chain::Pose) -> Option<Self> {
        let local = to_parry(pose);
        Some(match shape {
            Shape::Sphere { radius_m } => Self::capsule(0.0, *radius_m, local),
            Shape::Capsule { radius_m, length_m } => Self::capsule(0.5 * length_m, *radius_m, local),
            Shape::Box { size_m } => {
                let half = 0.5 * Vector::from_array(*size_m);
                let parry = Arc::new(Cuboid::new(half));
                let (core, bound_m) = (Core::Box(half), half.length());
                Self { core, radius_m: 0.0, local, centre: Vector::ZERO, bound_m, parry }
            }
            Shape::Cylinder { radius_m, length_m } => {
                // parry3d's cylinder stands on y, ours on z.
                let local = local * Pose::from_rotation(Rot3::from_rotation_x(std::f64::consts::FRAC_PI_2));
                let parry = Arc::new(Cylinder::new(0.5 * length_m, *radius_m));
                let bound_m = radius_m.hypot(0.5 * length_m);
                let core = Core::Cylinder { half_m: 0.5 * length_m, radius_m: *radius_m };
                Self { core, radius_m: 0.0, local, centre: Vector::ZERO, bound_m, parry }
            }
            Shape::Hull { vertices_m, triangles, rounding_m } => {
                let corners = corners(vertices_m, triangles)?;
                let hull = Arc::new(ConvexPolyhedron::from_convex_mesh(corners, triangles)?);
                // Inside of the hull, which the middle of its bounding box need not be.
                let centre = hull.points().iter().sum::<Vector>() / hull.points().len() as f64;
                let far_m = hull.points().iter().map(|p| (*p - centre).length()).fold(0.0, f64::max);
                let (core, bound_m) = (Core::Convex, far_m + rounding_m);
                Self { core, radius_m: *rounding_m, local, centre, bound_m, parry: hull }
            }
            Shape::Mesh { vertices_m, triangles } => {
                let corners = corners(vertices_m, triangles)?;
                let mesh = Arc::new(TriMesh::new(corners, triangles.clone()).ok()?);
                let aabb = mesh.local_aabb();
                let (centre, bound_m) = (aabb.center(), aabb.half_extents().length());
                Self { core: Core::Mesh(mesh.clone()), radius_m: 0.0, local, centre, bound_m, parry: mesh }
            }
            Shape::Cloud(cloud) => {
                let (centre, half) = cloud.tree().bounds();
                let (radius_m, bound_m) = (cloud.radius_m, half.length() + cloud.radius_m);
                // Never asked: distances to points have a form of their own.
                let parry = Arc::new(Cuboid::new(half));
                Self { core: Core::Cloud(cloud.clone()), radius_m, local, centre, bound_m, parry }
            }
        })
    }

    fn capsule(half_m: f64, radius_m: f64, local: Pose) -> Self {
        let (a, b) = (Vector::new(0.0, 0.0, -half_m), Vector::new(0.0, 0.0, half_m));
        let parry: Arc<dyn ParryShape> =
            if half_m > POINT_M { Arc::new(Segment::new(a, b)) } else { Arc::new(Ball::new(0.0)) };
        let bound_m = half_m + radius_m;
        Self { core: Core::Segment(a, b), radius_m, local, centre: Vector::ZERO, bound_m, parry }
    }

    /// The pose of the body for a pose of its frame.
    #[must_use]
    pub fn placed(&self, frame: &Pose) -> Posed {
        let pose = *frame * self.local;
        let centre = pose.transform_point(self.centre);
        let ends = match self.core {
            Core::Segment(a, b) => [pose.transform_point(a), pose.transform_point(b)],
            Core::Box(_) | Core::Cylinder { .. } | Core::Convex | Core::Mesh(_) | Core::Cloud(_) => {
                [centre; 2]
            }
        };
        Posed { pose, centre, ends }
    }

    /// Radius of the ball around the shape.
    #[must_use]
    pub fn bound_m(&self) -> f64 {
        self.bound_m
    }

    /// Radius around the core.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The shape without the radius around it, in its own axes.
    #[must_use]
    pub fn core(&self) -> &Core {
        &self.core
    }

    /// From the frame to the core's axes.
    #[must_use]
    pub fn local(&self) -> &Pose {
        &self.local
    }

    /// Centre and half edges of a box around the core, along its axes.
    #[must_use]
    pub fn core_bounds(&self) -> (Vector, Vector) {
        match self.core {
            Core::Segment(a, b) => (0.5 * (a + b), (0.5 * (b - a)).abs()),
            Core::Box(half) => (Vector::ZERO, half),
            Core::Cylinder { half_m, radius_m } => (Vector::ZERO, Vector::new(radius_m, half_m, radius_m)),
            Core::Cloud(ref cloud) => cloud.tree().bounds(),
            Core::Convex | Core::Mesh(_) => {
                let around = self.parry.compute_local_aabb();
                (around.center(), around.half_extents())
            }
        }
    }

    /// How deep a point, in the core's axes, lies in it: at most the least distance to its surface; negative outside.
    #[must_use]
    pub fn core_depth_m(&self, point: Vector) -> f64 {
        match self.core {
            Core::Box(half) => {
                let inside = half - point.abs();
                if inside.min_element() >= 0.0 {
                    inside.min_element()
                } else {
                    -(-inside).max(Vector::ZERO).length()
                }
            }
            Core::Cylinder { half_m, radius_m } => {
                let (beside, above) = (point.x.hypot(point.z) - radius_m, point.y.abs() - half_m);
                if beside <= 0.0 && above <= 0.0 {
                    -beside.max(above)
                } else {
                    -point_to_cylinder_m(point, half_m, radius_m)
                }
            }
            Core::Segment(..) | Core::Convex | Core::Mesh(_) => {
                -self.parry.distance_to_local_point(point, false)
            }
            Core::Cloud(_) => -self.to_point_m(point),
        }
    }

    /// Upper bound of the distance of the core's points to the axis through `point` along the unit `direction`. The radius around
    /// the core does not count: how near two bodies come is a matter of their cores.
    #[must_use]
    pub fn lever_m(&self, at: &Posed, point: Vector, direction: Vector) -> f64 {
        let distance_m = |p: Vector| (p - point).cross(direction).length();
        match self.core {
            // The distance to a line is convex: the ends of a segment are the furthest.
            Core::Segment(..) => distance_m(at.ends[0]).max(distance_m(at.ends[1])),
            Core::Box(_) | Core::Cylinder { .. } | Core::Convex | Core::Mesh(_) | Core::Cloud(_) => {
                distance_m(at.centre) + (self.bound_m - self.radius_m)
            }
        }
    }

    /// Lower bound of the distance between the surfaces by the balls around them, and by a cloud's grid; cheap.
    #[must_use]
    pub fn distance_bound_m(&self, at: &Posed, other: &Self, other_at: &Posed) -> f64 {
        if let Core::Cloud(cloud) = &other.core {
            let middle = other_at.pose.inverse_transform_point(at.centre);
            return cloud.least_m(middle) - self.bound_m - other.radius_m;
        }
        (at.centre - other_at.centre).length() - self.bound_m - other.bound_m
    }

    /// Distance between the surfaces: exact when positive, negative when capsules or spheres overlap by less than
    /// their radii, and at most 0 when they touch. A body *wholly* inside a mesh is outside of its triangles and
    /// not seen here: ask [`Self::is_inside`] once a motion, nothing gets in without crossing them.
    #[must_use]
    pub fn distance_m(&self, at: &Posed, other: &Self, other_at: &Posed) -> f64 {
        self.core_distance_m(at, other, other_at) - self.radius_m - other.radius_m
    }

    /// Distance between the cores; 0 when they touch.
    #[must_use]
    pub fn core_distance_m(&self, at: &Posed, other: &Self, other_at: &Posed) -> f64 {
        let into = |pose: &Pose, ends: &[Vector; 2]| ends.map(|p| pose.inverse_transform_point(p));
        match (&self.core, &other.core) {
            (Core::Segment(..), Core::Segment(..)) => {
                segment_to_segment_m(at.ends[0], at.ends[1], other_at.ends[0], other_at.ends[1])
            }
            (Core::Segment(..), Core::Box(half)) => {
                let [a, b] = into(&other_at.pose, &at.ends);
                segment_to_box_m(a, b, *half)
            }
            (Core::Box(half), Core::Segment(..)) => {
                let [a, b] = into(&at.pose, &other_at.ends);
                segment_to_box_m(a, b, *half)
            }
            (Core::Segment(a, b), Core::Cylinder { half_m, radius_m }) if a == b => {
                point_to_cylinder_m(other_at.pose.inverse_transform_point(at.centre), *half_m, *radius_m)
            }
            (Core::Cylinder { half_m, radius_m }, Core::Segment(a, b)) if a == b => {
                point_to_cylinder_m(at.pose.inverse_transform_point(other_at.centre), *half_m, *radius_m)
            }
            (_, Core::Cloud(cloud)) => self.to_points_m(at, cloud.tree(), other_at),
            (Core::Cloud(cloud), _) => other.to_points_m(other_at, cloud.tree(), at),
            _ => self.iterated_distance_m(&at.pose, other, &other_at.pose),
        }
    }

    /// The least distance of the core to points.
    fn to_points_m(&self, at: &Posed, points: &PointTree, points_at: &Posed) -> f64 {
        let found = if let Core::Segment(..) = self.core {
            let [a, b] = at.ends.map(|end| points_at.pose.inverse_transform_point(end));
            points.nearest(f64::INFINITY, |p| point_to_segment_m(p, a, b))
        } else {
            let into = at.pose.inv_mul(&points_at.pose);
            points.nearest(f64::INFINITY, |p| self.to_point_m(into.transform_point(p)))
        };
        found.map_or(f64::INFINITY, |(distance_m, _)| distance_m)
    }

    /// Lower bound of the distance of the core to a point in its axes.
    fn to_point_m(&self, point: Vector) -> f64 {
        match &self.core {
            Core::Segment(a, b) => point_to_segment_m(point, *a, *b),
            Core::Box(half) => (point.abs() - *half).max(Vector::ZERO).length(),
            Core::Cylinder { half_m, radius_m } => point_to_cylinder_m(point, *half_m, *radius_m),
            Core::Convex | Core::Mesh(_) => {
                (self.parry.distance_to_local_point(point, true) - ITERATION_SLACK_M).max(0.0)
            }
            Core::Cloud(cloud) => {
                let found = cloud.tree().nearest(f64::INFINITY, |p| (p - point).length());
                found.map_or(f64::INFINITY, |(distance_m, _)| distance_m)
            }
        }
    }

    fn iterated_distance_m(&self, at: &Pose, other: &Self, other_at: &Pose) -> f64 {
        if let (Some(a), Some(b)) = (self.parry.as_support_map(), other.parry.as_support_map()) {
            return convex_distance_m(a, b, &at.inv_mul(other_at));
        }
        let found = distance(at, &*self.parry, other_at, &*other.parry);
        // A pair that parry3d does not know counts as touching: refused, never let through.
        found.map_or(0.0, |d| (d.distance - ITERATION_SLACK_M).max(0.0))
    }

    /// True when a point of `other` lies inside this body's mesh, or the other way round.
    #[must_use]
    pub fn is_inside(&self, at: &Posed, other: &Self, other_at: &Posed) -> bool {
        let one = |mesh: &Body, mesh_at: &Posed, body: &Body, body_at: &Posed| {
            let Core::Mesh(triangles) = &mesh.core else { return false };
            let point = match &body.core {
                Core::Mesh(m) => m.vertices().first().map(|v| body_at.pose.transform_point(*v)),
                Core::Cloud(cloud) => cloud.tree().points().first().map(|p| body_at.pose.transform_point(*p)),
                Core::Segment(..) | Core::Box(_) | Core::Cylinder { .. } | Core::Convex => {
                    Some(body_at.ends[0])
                }
            };
            point.is_some_and(|p| encloses(triangles, mesh_at.pose.inverse_transform_point(p)))
        };
        one(self, at, other, other_at) || one(other, other_at, self, at)
    }
}

/// The corners, when they are finite and the triangles have no others.
fn corners(vertices_m: &[nalgebra::Point3<f64>], triangles: &[[u32; 3]]) -> Option<Vec<Vector>> {
    let corners: Vec<Vector> = vertices_m.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let known = |t: &[u32; 3]| t.iter().all(|i| usize::try_from(*i).is_ok_and(|i| i < corners.len()));
    (corners.iter().all(|c| c.is_finite()) && triangles.iter().all(known)).then_some(corners)
}

/// Lower bound of the distance of two convex shapes, `b` standing at `at` as `a` sees it; 0 when they touch.
///
/// The iteration finds two points that are nearest up to its tolerance. They only give the direction: the gap between the
/// two planes across it that support the shapes is a lower bound whatever the direction, and the distance itself for
/// the right one. So the error of the iteration cannot make a distance too large.
fn convex_distance_m(a: &dyn SupportMap, b: &dyn SupportMap, at: &Pose) -> f64 {
    let ClosestPoints::WithinMargin(on_a, on_b) = closest_points_support_map_support_map(at, a, b, f64::MAX)
    else {
        return 0.0;
    };
    let towards_b = (at.transform_point(on_b) - on_a).normalize_or_zero();
    let end_of_a_m = a.local_support_point(towards_b).dot(towards_b);
    let back = at.rotation.inverse() * -towards_b;
    let begin_of_b_m = at.transform_point(b.local_support_point(back)).dot(towards_b);
    (begin_of_b_m - end_of_a_m).max(0.0)
}

fn point_to_segment_m(point: Vector, a: Vector, b: Vector) -> f64 {
    let (from, along) = (point - a, b - a);
    let share = (from.dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (from - along * share).length()
}

/// Distance of a point to a solid cylinder around the origin, along y.
fn point_to_cylinder_m(point: Vector, half_m: f64, radius_m: f64) -> f64 {
    let (beside, above) = (point.x.hypot(point.z) - radius_m, point.y.abs() - half_m);
    beside.max(0.0).hypot(above.max(0.0))
}

/// True when the triangles go round the point: the solid angle that they fill is more than half of the sphere.
/// Orientation of the whole mesh and small holes do not matter.
///
/// Source: van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30 (1983); Jacobson et al., SIGGRAPH 2013.
fn encloses(mesh: &TriMesh, point: Vector) -> bool {
    if !mesh.local_aabb().contains_local_point(point) {
        return false;
    }
    let angle: f64 = mesh
        .triangles()
        .map(|t| {
            let (a, b, c) = (t.a - point, t.b - point, t.c - point);
            let (la, lb, lc) = (a.length(), b.length(), c.length());
            let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * a.dot(b.cross(c)).atan2(below)
        })
        .sum();
    angle.abs() > 2.0 * std::f64::consts::PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;

    /// Goal: distances that are iterated are lower bounds, and next to the truth.
    /// Method: capsules about pillars and discs; the distance of a point to a cylinder is convex along a segment, so
    /// that ternary search finds its least.
    #[test]
    fn distance_to_a_cylinder_is_a_tight_lower_bound() {
        const RADIUS_M: f64 = 0.01;
        for seed in 0..60_000 {
            let mut rng = SeededRng::new(seed, 4);
            let (half_m, radius_m) = (rng.within(0.02, 0.4), rng.within(0.02, 0.3));
            let id = chain::Pose::identity();
            let shape = Shape::Cylinder { radius_m, length_m: 2.0 * half_m };
            let cylinder = Body::new(&shape, &id).expect("a shape");
            let mut end = || Vector::new(rng.within(-0.5, 0.5), rng.within(-0.5, 0.5), rng.within(-0.6, 0.6));
            let (a, b) = (end(), end());
            let (middle, along) = (0.5 * (a + b), b - a);
            let turn = Rot3::from_rotation_arc(Vector::Z, along.normalize());
            let local = Pose::from_parts(middle, turn);
            let capsule = Body::capsule(0.5 * along.length(), RADIUS_M, local);

            let outside_m = |t: f64| {
                let p = a + along * t;
                (p.x.hypot(p.y) - radius_m).max(0.0).hypot((p.z.abs() - half_m).max(0.0))
            };
            let (mut low, mut high) = (0.0, 1.0);
            for _ in 0..90 {
                let (x, y) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if outside_m(x) < outside_m(y) { high = y } else { low = x }
            }
            let truth_m = outside_m(0.5 * (low + high)) - RADIUS_M;
            let here = Pose::identity();
            let found_m = capsule.distance_m(&capsule.placed(&here), &cylinder, &cylinder.placed(&here));
            assert!(found_m <= truth_m + 1e-9, "seed {seed}: {found_m} above {truth_m}");
            assert!(
                found_m >= truth_m - 2.0 * ITERATION_SLACK_M,
                "seed {seed}: {found_m} far below {truth_m}"
            );
        }
    }

    /// A hull of random corners, as meshes of robots become.
    fn hull(rng: &mut SeededRng) -> Shape {
        let mut point =
            || nalgebra::Point3::new(rng.within(-0.2, 0.2), rng.within(-0.3, 0.3), rng.within(-0.1, 0.1));
        let points: Vec<_> = (0..30).map(|_| point()).collect();
        let hull = crate::hull::of(&points).expect("not flat");
        Shape::Hull { vertices_m: hull.vertices_m, triangles: hull.triangles, rounding_m: hull.rounding_m }
    }

    /// Least distance of a point from the polyhedron of a hull, by its faces one by one; 0 inside.
    fn to_hull_m(shape: &Shape, point: Vector) -> f64 {
        let Shape::Hull { vertices_m, triangles, .. } = shape else { panic!("a hull") };
        let corner = |i: u32| {
            let p = vertices_m[usize::try_from(i).unwrap()];
            Vector::new(p.x, p.y, p.z)
        };
        let faces: Vec<[Vector; 3]> = triangles.iter().map(|t| t.map(corner)).collect();
        if faces.iter().all(|[a, b, c]| (point - *a).dot((*b - *a).cross(*c - *a)) <= 0.0) {
            return 0.0;
        }
        let distance_m = |[a, b, c]: &[Vector; 3]| {
            use parry3d_f64::query::PointQuery;
            parry3d_f64::shape::Triangle::new(*a, *b, *c).distance_to_local_point(point, true)
        };
        faces.iter().map(distance_m).fold(f64::INFINITY, f64::min)
    }

    fn random_pose(rng: &mut SeededRng) -> Pose {
        let mut v = || Vector::new(rng.within(-0.6, 0.6), rng.within(-0.6, 0.6), rng.within(-0.6, 0.6));
        Pose::from_parts(v(), Rot3::from_scaled_axis(v() * 5.0))
    }

    /// Goal: the distance of a hull to anything is a lower bound, and next to the truth.
    /// Method: face by face, without the iteration: along a capsule's axis by ternary search, which the distance's
    /// convexity allows; to another hull by dense points of its edges and faces, which are never nearer than the truth.
    #[test]
    fn distance_of_a_hull_is_a_tight_lower_bound() {
        let id = chain::Pose::identity();
        let (mut apart, mut worst_m) = (0, 0.0_f64);
        for seed in 0..1_500 {
            let mut rng = SeededRng::new(seed, 22);
            let (one, two) = (hull(&mut rng), hull(&mut rng));
            let (a, b) = (Body::new(&one, &id).unwrap(), Body::new(&two, &id).unwrap());
            let at = random_pose(&mut rng);
            let here = a.placed(&Pose::identity());

            let half_m = rng.within(0.0, 0.3);
            let capsule = Body::capsule(half_m, 0.02, Pose::identity());
            let along = |t: f64| at.transform_point(Vector::new(0.0, 0.0, half_m * t));
            let (mut low, mut high) = (-1.0, 1.0);
            for _ in 0..90 {
                let (x, y) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
                if to_hull_m(&one, along(x)) < to_hull_m(&one, along(y)) { high = y } else { low = x }
            }
            let truth_m = to_hull_m(&one, along(0.5 * (low + high))) - 0.02 - a.radius_m();
            let found_m = capsule.distance_m(&capsule.placed(&at), &a, &here);
            assert!(found_m <= truth_m + 1e-9, "seed {seed}: capsule {found_m} above {truth_m}");
            if truth_m > 0.0 {
                worst_m = worst_m.max(truth_m - found_m);
                apart += 1;
            }

            let found_m = a.distance_m(&here, &b, &b.placed(&at));
            let Shape::Hull { vertices_m, triangles, .. } = &two else { panic!("a hull") };
            let corner = |i: u32| {
                let p = vertices_m[usize::try_from(i).unwrap()];
                at.transform_point(Vector::new(p.x, p.y, p.z))
            };
            for [p, q, r] in triangles.iter().map(|t| t.map(corner)) {
                for (u, v) in
                    (0..=6).flat_map(|u| (0..=6 - u).map(move |v| (f64::from(u) / 6.0, f64::from(v) / 6.0)))
                {
                    let sampled_m =
                        to_hull_m(&one, p + (q - p) * u + (r - p) * v) - a.radius_m() - b.radius_m();
                    assert!(found_m <= sampled_m + 1e-9, "seed {seed}: hulls {found_m} above {sampled_m}");
                }
            }
        }
        assert!(apart > 500 && worst_m < 1e-6, "{apart} apart, at worst {worst_m:e} m too low");
    }

    /// Goal: a cloud is as far as the nearest of its balls, whatever comes near it.
    #[test]
    fn distance_to_a_cloud_is_that_to_its_nearest_ball() {
        const RADIUS_M: f64 = 0.01;
        let id = chain::Pose::identity();
        for seed in 0..400 {
            let mut rng = SeededRng::new(seed, 23);
            let mut point = || [rng.within(-0.3, 0.3), rng.within(-0.3, 0.3), rng.within(-0.05, 0.05)];
            let points_m: Vec<[f64; 3]> = (0..100).map(|_| point()).collect();
            let cloud = Cloud::new(points_m.clone(), RADIUS_M).unwrap();
            let cloud = Body::new(&Shape::Cloud(Arc::new(cloud)), &id).unwrap();
            let others = [
                Shape::Capsule { radius_m: 0.03, length_m: 0.2 },
                Shape::Box { size_m: [0.1, 0.2, 0.05] },
                Shape::Cylinder { radius_m: 0.04, length_m: 0.2 },
                hull(&mut rng),
            ];
            let cloud_at = cloud.placed(&random_pose(&mut rng));
            for shape in others {
                let body = Body::new(&shape, &id).unwrap();
                let at = body.placed(&random_pose(&mut rng));
                let to_ball_m = |p: &[f64; 3]| {
                    let ball = Body::capsule(0.0, RADIUS_M, Pose::from_translation(Vector::from_array(*p)));
                    body.distance_m(&at, &ball, &ball.placed(&cloud_at.pose))
                };
                let truth_m = points_m.iter().map(to_ball_m).fold(f64::INFINITY, f64::min);
                for found_m in
                    [body.distance_m(&at, &cloud, &cloud_at), cloud.distance_m(&cloud_at, &body, &at)]
                {
                    let near = found_m <= truth_m + 1e-9 && found_m >= truth_m - 2.0 * ITERATION_SLACK_M;
                    assert!(near, "seed {seed}, {shape:?}: {found_m} for {truth_m}");
                }
            }
        }
    }
}
