//! Spheres that cover a body: larger ones that together hold it, smaller ones that lie within it.
use parry3d_f64::math::Vector;
use taustream_arm::body::{Body, Core};

/// How much larger than a capsule the spheres around it may be: the larger of a length (m) and a share of its radius.
const LARGER_M: f64 = 0.002;
const LARGER: f64 = 0.03;
/// Most spheres of one body.
const SPHERES_MAX: usize = 64;
/// Smallest cell of a body that is covered by cells (m).
const CELL_M: f64 = 0.02;
/// What the exact model's distances may be below the truth where it iterates (m): that much more is left to it.
pub(super) const ITERATED_M: f64 = 3e-4;
/// What a depth that was found by iteration may be too large by (m).
const DEPTH_SLACK_M: f64 = 1e-4;

/// A sphere of a cover, in the axes of its body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub(super) centre: Vector,
    /// Around every point of the body that is nearest to this centre.
    pub(super) outer_m: f64,
    /// Within the body; negative where there is no such sphere.
    pub(super) inner_m: f64,
}

/// The spheres of a body, in its own axes.
pub(super) fn balls(body: &Body) -> Vec<Ball> {
    match body.core() {
        Core::Segment(a, b) => along(*a, *b, body.radius_m()),
        Core::Box(half) => cells(body, Vector::ZERO, *half),
        Core::Cylinder { half_m, radius_m } => {
            cells(body, Vector::ZERO, Vector::new(*radius_m, *half_m, *radius_m))
        }
        Core::Convex => {
            let (centre, half) = body.core_bounds();
            cells(body, centre, half)
        }
        Core::Mesh(_) | Core::Cloud(_) => {
            let (centre, half) = body.core_bounds();
            vec![Ball { centre, outer_m: half.length() + body.radius_m() + ITERATED_M, inner_m: -1.0 }]
        }
    }
}

fn along(a: Vector, b: Vector, radius_m: f64) -> Vec<Ball> {
    let length_m = (b - a).length();
    let larger_m = radius_m + LARGER_M.max(LARGER * radius_m);
    let half_m = (larger_m * larger_m - radius_m * radius_m).sqrt();
    if length_m <= 0.0 {
        return vec![Ball { centre: a, outer_m: radius_m, inner_m: radius_m }];
    }
    let count = whole((length_m / (2.0 * half_m)).ceil(), SPHERES_MAX);
    let outer_m = radius_m.hypot(0.5 * length_m / count as f64);
    // Both ends have one, or their caps would stick out.
    let at = |i: usize| a + (b - a) * (i as f64 / count as f64);
    (0..=count).map(|i| Ball { centre: at(i), outer_m, inner_m: radius_m }).collect()
}

/// A sphere around each cell of a box that holds the body, where the body is.
fn cells(body: &Body, centre: Vector, half: Vector) -> Vec<Ball> {
    let mut cell_m = CELL_M;
    let counts = loop {
        let counts = half.to_array().map(|h| whole((2.0 * h / cell_m).ceil(), SPHERES_MAX));
        if counts.iter().product::<usize>() <= SPHERES_MAX {
            break counts;
        }
        cell_m *= 1.25;
    };
    let size = Vector::from_array(std::array::from_fn(|k| 2.0 * half.to_array()[k] / counts[k] as f64));
    let around_m = 0.5 * size.length();
    let mut balls = Vec::new();
    for i in 0..counts[0] {
        for j in 0..counts[1] {
            for k in 0..counts[2] {
                let share = Vector::new(i as f64 + 0.5, j as f64 + 0.5, k as f64 + 0.5);
                let at = centre - half + size * share;
                let depth_m = body.core_depth_m(at);
                if depth_m > -around_m - DEPTH_SLACK_M {
                    let outer_m = around_m + body.radius_m() + ITERATED_M;
                    let inner_m = depth_m + body.radius_m() - DEPTH_SLACK_M;
                    balls.push(Ball { centre: at, outer_m, inner_m });
                }
            }
        }
    }
    balls
}

/// A count from 1 to `most`.
fn whole(count: f64, most: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let count = count.clamp(1.0, most as f64) as usize;
    count
}
