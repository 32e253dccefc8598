//! Which links may touch by default.
//!
//! Neighbouring links meet at their joint, and capsules round short wrist links overlap in every pose; neither is a
//! collision. As set-up assistants do it, a pair that touches in every one of many random poses may touch. The draw
//! is seeded and of our own making, so that an arm has the same list on every machine and in every version.
use crate::robot::LinkShape;
use nalgebra::Point3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use taustream_motion::chain::Chain;
use taustream_motion::{JointLimits, MAX_JOINTS};

/// Poses that a pair must touch in. A pair that parts in one pose of ten thousand has a chance of about a third
/// (1/e) to be taken for one that never does; `check` lists every allowed pair, for a person to look at.
pub(crate) const POSES: usize = 10_000;

const SEED: u64 = 0x7461_7573_7472_6561;

/// Neighbours, and pairs that touch in every one of [`POSES`] poses drawn uniformly inside the joint limits.
/// Lower index first, sorted.
pub(crate) fn allowed_by_rule(
    chain: &Chain,
    shapes: &[LinkShape],
    limits: &[JointLimits],
) -> Vec<(usize, usize)> {
    let neighbours = (0..chain.joints()).map(|link| (link, link + 1));
    let mut allowed: Vec<(usize, usize)> = neighbours.collect();
    allowed.extend(always_touching(chain, shapes, limits));
    allowed.sort_unstable();
    allowed
}

fn always_touching(chain: &Chain, shapes: &[LinkShape], limits: &[JointLimits]) -> Vec<(usize, usize)> {
    let solid: Vec<(&LinkShape, Segment)> = shapes.iter().filter_map(|s| Some((s, segment(s)?))).collect();
    // Shapes of one link are rigid with each other, and neighbours are allowed already.
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (i, (a, _)) in solid.iter().enumerate() {
        let partners = solid.iter().enumerate().skip(i + 1);
        pairs.extend(partners.filter(|(_, (b, _))| a.link.abs_diff(b.link) > 1).map(|(j, _)| (i, j)));
    }
    let mut draw = ChaCha8Rng::seed_from_u64(SEED);
    for _ in 0..POSES {
        // Every pose takes its numbers, so that the list does not depend on when a pair drops out.
        let position_rad = uniform_pose(&mut draw, limits);
        if pairs.is_empty() {
            break;
        }
        let frames = chain.frames(&position_rad);
        let placed: Vec<Segment> = solid
            .iter()
            .map(|(shape, segment)| match frames.get(shape.frame) {
                Some(frame) => Segment { ends: segment.ends.map(|end| frame * end), ..*segment },
                None => *segment,
            })
            .collect();
        // Pairs that have parted once are out; most are out after a few poses, so the rest costs little.
        pairs.retain(|(i, j)| match (placed.get(*i), placed.get(*j)) {
            (Some(a), Some(b)) => distance_m(&a.ends, &b.ends) <= a.radius_m + b.radius_m,
            _ => false,
        });
    }
    let link = |at: usize| solid.get(at).map(|(shape, _)| shape.link);
    pairs
        .into_iter()
        .filter_map(|(i, j)| Some((link(i)?, link(j)?)))
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect()
}

/// The axis and radius of a capsule or ball.
#[derive(Clone, Copy)]
struct Segment {
    ends: [Point3<f64>; 2],
    radius_m: f64,
}

fn segment(shape: &LinkShape) -> Option<Segment> {
    shape.segment().map(|(ends, radius_m)| Segment { ends, radius_m })
}

fn uniform_pose(draw: &mut ChaCha8Rng, limits: &[JointLimits]) -> [f64; MAX_JOINTS] {
    let mut position_rad = [0.0; MAX_JOINTS];
    for (slot, joint) in position_rad.iter_mut().zip(limits) {
        let [low, high] = joint.position_rad;
        // 53 random bits make a number in [0, 1); spelt out, because a library's own may change with its version.
        let share = (draw.next_u64() >> 11) as f64 * (0.5_f64).powi(53);
        *slot = low + share * (high - low);
    }
    position_rad
}

/// Least distance of two segments, either of which may be a point.
///
/// Source: Ericson, Real-Time Collision Detection, section 5.1.9.
pub(crate) fn distance_m(first: &[Point3<f64>; 2], second: &[Point3<f64>; 2]) -> f64 {
    let [p1, q1] = first;
    let [p2, q2] = second;
    let (d1, d2, r) = (q1 - p1, q2 - p2, p1 - p2);
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    let (s, t) = if a <= f64::EPSILON && e <= f64::EPSILON {
        (0.0, 0.0)
    } else if a <= f64::EPSILON {
        (0.0, (f / e).clamp(0.0, 1.0))
    } else {
        let c = d1.dot(&r);
        if e <= f64::EPSILON {
            ((-c / a).clamp(0.0, 1.0), 0.0)
        } else {
            let b = d1.dot(&d2);
            let denominator = a * e - b * b;
            // Parallel segments: any point of the first will do to start from.
            let s = if denominator > 0.0 { ((b * f - c * e) / denominator).clamp(0.0, 1.0) } else { 0.0 };
            let t = (b * s + f) / e;
            // The nearest point of the second line lies beyond an end: take the end, and go back to the first.
            if t < 0.0 {
                ((-c / a).clamp(0.0, 1.0), 0.0)
            } else if t > 1.0 {
                (((b - c) / a).clamp(0.0, 1.0), 1.0)
            } else {
                (s, t)
            }
        }
    };
    ((p1 + d1 * s) - (p2 + d2 * t)).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: no pair of segments, parallel or crossing or of no length, may get a distance that is wrong.
    /// Method: the distance to many points of one segment has its own closed form for the other; the least of them
    /// bounds the answer from above, and that less half a spacing from below.
    #[test]
    fn segment_distance_of_random_pairs_agrees_with_dense_points() {
        const POINTS: u32 = 2000;
        for seed in 0..2000 {
            let mut draw = ChaCha8Rng::seed_from_u64(seed);
            let mut number = |scale: f64| ((draw.next_u64() >> 11) as f64 * (0.5_f64).powi(53) - 0.5) * scale;
            let mut point = |scale: f64| Point3::new(number(scale), number(scale), number(scale));
            let mut first = [point(2.0), point(2.0)];
            let mut second = [point(2.0), point(2.0)];
            match seed % 5 {
                0 => second[1] = second[0] + (first[1] - first[0]) * 0.7, // Parallel.
                1 => first[1] = first[0],                                 // A point.
                2 => (first[1], second[1]) = (first[0], second[0]),       // Two points.
                3 => second[0] = nalgebra::center(&first[0], &first[1]),  // Touching.
                _ => {}
            }
            let length_m = (first[1] - first[0]).norm();
            let to_second = |point: Point3<f64>| {
                let along = second[1] - second[0];
                let share = if along.norm() > 0.0 {
                    (point - second[0]).dot(&along) / along.norm_squared()
                } else {
                    0.0
                };
                (point - (second[0] + along * share.clamp(0.0, 1.0))).norm()
            };
            let points =
                (0..=POINTS).map(|i| first[0] + (first[1] - first[0]) * (f64::from(i) / f64::from(POINTS)));
            let dense_m = points.map(to_second).fold(f64::INFINITY, f64::min);
            let exact_m = distance_m(&first, &second);
            let slack_m = 0.5 * length_m / f64::from(POINTS) + 1e-12;
            assert!(
                exact_m <= dense_m + 1e-12 && exact_m >= dense_m - slack_m,
                "seed {seed}: {exact_m} m against {dense_m} m"
            );
        }
    }
}
