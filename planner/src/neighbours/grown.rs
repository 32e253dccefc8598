//! Shapes with everything around them that is nearer than a distance.
use nalgebra::{Point3, Translation3, UnitQuaternion};
use taustream_arm::Shape;
use taustream_motion::chain::Pose;

/// A shape that covers every point within `by_m` of another one, and its pose in the frame of that one. A box and a cylinder keep their
/// edges, and a mesh becomes the box around it: more than what is covered, never less.
pub(crate) fn grown(shape: &Shape, by_m: f64) -> (Pose, Shape) {
    let grown = match shape {
        Shape::Sphere { radius_m } => Shape::Sphere { radius_m: radius_m + by_m },
        Shape::Capsule { radius_m, length_m } => {
            Shape::Capsule { radius_m: radius_m + by_m, length_m: *length_m }
        }
        Shape::Cylinder { radius_m, length_m } => {
            Shape::Cylinder { radius_m: radius_m + by_m, length_m: length_m + 2.0 * by_m }
        }
        Shape::Box { size_m } => Shape::Box { size_m: size_m.map(|edge_m| edge_m + 2.0 * by_m) },
        Shape::Hull { vertices_m, triangles, rounding_m } => Shape::Hull {
            vertices_m: vertices_m.clone(),
            triangles: triangles.clone(),
            rounding_m: rounding_m + by_m,
        },
        Shape::Mesh { vertices_m, .. } => return around(vertices_m, by_m),
        Shape::Cloud(cloud) => {
            let points: Vec<Point3<f64>> =
                cloud.tree().points().iter().map(|p| Point3::new(p.x, p.y, p.z)).collect();
            return around(&points, by_m + cloud.radius_m);
        }
    };
    (Pose::identity(), grown)
}

fn around(points_m: &[Point3<f64>], by_m: f64) -> (Pose, Shape) {
    let mut low = Point3::from([f64::INFINITY; 3]);
    let mut high = Point3::from([f64::NEG_INFINITY; 3]);
    for point in points_m {
        (low, high) = (low.inf(point), high.sup(point));
    }
    let centre = nalgebra::center(&low, &high);
    let pose = Pose::from_parts(Translation3::from(centre.coords), UnitQuaternion::identity());
    (pose, Shape::Box { size_m: (high - low).map(|edge_m| edge_m + 2.0 * by_m).into() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;
    use taustream_arm::body::{Body, to_parry};

    /// Goal: nothing that was near enough stays outside. Method: balls of the distance at random places touch the shape only where they
    /// touch the grown one with their centres.
    #[test]
    fn grown_shapes_cover_what_is_near() {
        let corners = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.05, 0.05, 0.4]];
        let vertices_m: Vec<Point3<f64>> = corners.map(Point3::from).to_vec();
        let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let shapes = [
            Shape::Sphere { radius_m: 0.1 },
            Shape::Capsule { radius_m: 0.05, length_m: 0.3 },
            Shape::Cylinder { radius_m: 0.1, length_m: 0.2 },
            Shape::Box { size_m: [0.1, 0.2, 0.3] },
            Shape::Hull { vertices_m: vertices_m.clone(), triangles: triangles.clone(), rounding_m: 0.01 },
            Shape::Mesh { vertices_m, triangles },
        ];
        let (by_m, mut rng) = (0.03, SeededRng::new(11, 0));
        for shape in shapes {
            let body = Body::new(&shape, &Pose::identity()).unwrap();
            let (local, larger) = grown(&shape, by_m);
            let larger = Body::new(&larger, &local).unwrap();
            let point = Body::new(&Shape::Sphere { radius_m: 1e-9 }, &Pose::identity()).unwrap();
            let origin = to_parry(&Pose::identity());
            let mut near = 0;
            for _ in 0..20_000 {
                let at: [f64; 3] = std::array::from_fn(|_| rng.within(-0.5, 0.5));
                let at = point.placed(&to_parry(&Pose::translation(at[0], at[1], at[2])));
                let distance_m = body.distance_m(&body.placed(&origin), &point, &at);
                if distance_m < by_m - 1e-4 {
                    near += 1;
                    let of_larger_m = larger.distance_m(&larger.placed(&origin), &point, &at);
                    assert!(
                        of_larger_m <= 1e-6,
                        "{shape:?}: {distance_m} m away, and {of_larger_m} m outside"
                    );
                }
            }
            assert!(near > 100, "{shape:?}: {near} points only");
        }
    }
}
