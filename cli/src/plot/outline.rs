//! What a body looks like from afar: the outline of its projection.
//!
//! All shapes but meshes are convex, and a projection of a convex body is convex: it is the hull of the projected
//! corners, or of points on the rims. A mesh of a scene is drawn as its hull.
use nalgebra::Point3;
use std::f64::consts::TAU;
use taustream_arm::scene::Shape;
use taustream_claims::chart::Point;
use taustream_motion::chain::Pose;

/// Points on a circle: enough to look round at any size on a page.
const ROUND: u32 = 32;

/// From where one looks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum View {
    /// From above: x to the right, y up.
    Top,
    /// Along y: x to the right, z up.
    Front,
    /// Against x: y to the right, z up.
    Side,
}

impl View {
    pub(super) const ALL: [Self; 3] = [Self::Top, Self::Front, Self::Side];

    /// Title, and the names of the axes to the right and up.
    pub(super) fn words(self) -> (&'static str, &'static str, &'static str) {
        match self {
            Self::Top => ("top", "x (m)", "y (m)"),
            Self::Front => ("front", "x (m)", "z (m)"),
            Self::Side => ("side", "y (m)", "z (m)"),
        }
    }

    /// A point as it is seen.
    pub(super) fn of(self, p: &Point3<f64>) -> Point {
        match self {
            Self::Top => (p.x, p.y),
            Self::Front => (p.x, p.z),
            Self::Side => (p.y, p.z),
        }
    }
}

/// Points whose hull is the projection, and the radius of the ball that goes along them.
fn corners(shape: &Shape) -> (Vec<Point3<f64>>, f64) {
    match shape {
        Shape::Sphere { radius_m } => (vec![Point3::origin()], *radius_m),
        Shape::Capsule { radius_m, length_m } => {
            ([-0.5, 0.5].map(|side| Point3::new(0.0, 0.0, side * length_m)).to_vec(), *radius_m)
        }
        Shape::Box { size_m: [x, y, z] } => {
            let half = |bits: u32, axis: u32| if bits >> axis & 1 == 0 { -0.5 } else { 0.5 };
            let corner = |k: u32| Point3::new(half(k, 0) * x, half(k, 1) * y, half(k, 2) * z);
            ((0..8).map(corner).collect(), 0.0)
        }
        Shape::Cylinder { radius_m, length_m } => {
            let rim = |side: f64| circle(*radius_m).map(move |(x, y)| Point3::new(x, y, side * length_m));
            (rim(-0.5).chain(rim(0.5)).collect(), 0.0)
        }
        Shape::Mesh { vertices_m, .. } => (vertices_m.clone(), 0.0),
        Shape::Hull { vertices_m, rounding_m, .. } => (vertices_m.clone(), *rounding_m),
        Shape::Cloud(cloud) => {
            (cloud.tree().points().iter().map(|p| Point3::new(p.x, p.y, p.z)).collect(), cloud.radius_m)
        }
    }
}

/// Most balls of a point cloud that are drawn.
const BALLS_MAX: usize = 1_500;

/// The outlines of a shape in a pose: of a point cloud some of its balls, because a hull would fill the room between them.
pub(super) fn outlines(shape: &Shape, pose: &Pose, view: View) -> Vec<Vec<Point>> {
    let Shape::Cloud(cloud) = shape else { return vec![outline(shape, pose, view)] };
    let ball = Shape::Sphere { radius_m: cloud.radius_m };
    let points = cloud.tree().points();
    let drawn = points.iter().step_by(points.len().div_ceil(BALLS_MAX).max(1));
    drawn.map(|p| outline(&ball, &(pose * Pose::translation(p.x, p.y, p.z)), view)).collect()
}

/// The outline of a shape in a pose, counter-clockwise.
pub(super) fn outline(shape: &Shape, pose: &Pose, view: View) -> Vec<Point> {
    let (corners, radius_m) = corners(shape);
    let seen = corners.iter().map(|corner| view.of(&(pose * corner)));
    if radius_m > 0.0 {
        hull(seen.flat_map(|(x, y)| circle(radius_m).map(move |(dx, dy)| (x + dx, y + dy))).collect())
    } else {
        hull(seen.collect())
    }
}

fn circle(radius_m: f64) -> impl Iterator<Item = Point> {
    (0..ROUND).map(move |k| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(ROUND)).sin_cos();
        (radius_m * cos, radius_m * sin)
    })
}

/// The convex hull, counter-clockwise (Andrew, Information Processing Letters 9, 1979).
pub(super) fn hull(mut points: Vec<Point>) -> Vec<Point> {
    points.retain(|(x, y)| x.is_finite() && y.is_finite());
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = &Point>| {
        let mut kept: Vec<Point> = Vec::new();
        for p in points {
            while let [.., a, b] = kept[..] {
                let turns_left = (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0) > 0.0;
                if turns_left {
                    break;
                }
                kept.pop();
            }
            kept.push(*p);
        }
        // The last point is the first of the other half.
        kept.pop();
        kept
    };
    let mut outline = chain(&mut points.iter());
    outline.extend(chain(&mut points.iter().rev()));
    outline
}

/// What of a convex outline lies within a rectangle (Sutherland and Hodgman, Communications of the ACM 17, 1974).
pub(super) fn clipped(outline: Vec<Point>, low: Point, high: Point) -> Vec<Point> {
    /// How far a point is inside one edge of the rectangle.
    type Edge = fn(Point, Point, Point) -> f64;
    let edges: [Edge; 4] = [
        |p, low, _| p.0 - low.0,
        |p, _, high| high.0 - p.0,
        |p, low, _| p.1 - low.1,
        |p, _, high| high.1 - p.1,
    ];
    let mut inside = outline;
    for edge in edges {
        let before = inside.iter().copied().cycle().skip(inside.len().saturating_sub(1));
        let mut kept = Vec::with_capacity(inside.len() + 2);
        for (a, b) in before.zip(inside.iter().copied()) {
            let (from, to) = (edge(a, low, high), edge(b, low, high));
            if (from < 0.0) != (to < 0.0) {
                let share = from / (from - to);
                kept.push((a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1)));
            }
            if to >= 0.0 {
                kept.push(b);
            }
        }
        inside = kept;
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(outline: &[Point]) -> f64 {
        let next = outline.iter().cycle().skip(1);
        0.5 * outline.iter().zip(next).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f64>()
    }

    /// Goal: a shape looks as large as it is. Method: areas of projections that are known in closed form.
    #[test]
    fn outline_has_the_area_of_the_projection() {
        let at = Pose::translation(0.3, -0.2, 0.5);
        let round = area(&circle(1.0).collect::<Vec<_>>());
        let cases = [
            (Shape::Sphere { radius_m: 0.2 }, [0.04 * round; 3]),
            (Shape::Box { size_m: [0.2, 0.3, 0.4] }, [0.06, 0.08, 0.12]),
            (Shape::Cylinder { radius_m: 0.1, length_m: 0.5 }, [0.01 * round, 0.1, 0.1]),
            (
                Shape::Capsule { radius_m: 0.1, length_m: 0.5 },
                [0.01 * round, 0.1 + 0.01 * round, 0.1 + 0.01 * round],
            ),
        ];
        for (shape, areas) in cases {
            for (view, expected) in View::ALL.into_iter().zip(areas) {
                let got = area(&outline(&shape, &at, view));
                assert!((got - expected).abs() < 1e-9, "{shape:?} {view:?}: {got} against {expected}");
            }
        }
    }

    #[test]
    fn hull_of_anything_is_convex_or_small() {
        assert!(hull(Vec::new()).is_empty());
        assert_eq!(hull(vec![(1.0, 1.0); 5]), [(1.0, 1.0)]);
        assert_eq!(hull(vec![(f64::NAN, 0.0), (0.0, 1.0)]), [(0.0, 1.0)]);
        let square = hull(vec![(0.0, 0.0), (1.0, 0.0), (0.5, 0.5), (1.0, 1.0), (0.0, 1.0), (0.5, 0.0)]);
        assert_eq!(square, [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
    }

    #[test]
    fn outline_is_cut_at_the_edge_of_the_view() {
        let square = vec![(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];
        assert!((area(&clipped(square.clone(), (-1.0, -1.0), (1.0, 1.0))) - 1.0).abs() < 1e-12);
        assert!(clipped(square.clone(), (3.0, 3.0), (4.0, 4.0)).is_empty());
        assert_eq!(clipped(square.clone(), (-1.0, -1.0), (3.0, 3.0)).len(), 4);
        assert!(clipped(Vec::new(), (0.0, 0.0), (1.0, 1.0)).is_empty());
    }
}
