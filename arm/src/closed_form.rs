//! Closed-form distances of a segment to a segment and to a box.
use parry3d_f64::math::Vector;

/// Distance between the segments a0-a1 and b0-b1, either of which may be a point.
///
/// Source: Ericson, Real-Time Collision Detection (2005), section 5.1.9.
#[must_use]
pub fn segment_to_segment_m(a0: Vector, a1: Vector, b0: Vector, b1: Vector) -> f64 {
    let (d1, d2, r) = (a1 - a0, b1 - b0, a0 - b0);
    let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
    let (c, b) = (d1.dot(r), d1.dot(d2));
    let quotient = |numerator: f64, denominator: f64| {
        if denominator > 0.0 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    // Nearest point of line a to line b; for parallel lines any will do, the ends decide below.
    let s = quotient(b * f - c * e, a * e - b * b);
    let t = if e > 0.0 { (b * s + f) / e } else { 0.0 };
    let (s, t) = if t < 0.0 {
        (quotient(-c, a), 0.0)
    } else if t > 1.0 {
        (quotient(b - c, a), 1.0)
    } else if e > 0.0 {
        (s, t)
    } else {
        (quotient(-c, a), 0.0)
    };
    let inner = (a0 + d1 * s - (b0 + d2 * t)).length();
    // Nearly parallel lines lose digits in a e - b b: the four ends bound what may have been lost.
    if a * e - b * b > 1e-9 * a * e { inner } else { inner.min(ends_m(a0, a1, b0, b1)) }
}

fn ends_m(a0: Vector, a1: Vector, b0: Vector, b1: Vector) -> f64 {
    let a = point_to_segment_m(a0, b0, b1).min(point_to_segment_m(a1, b0, b1));
    a.min(point_to_segment_m(b0, a0, a1)).min(point_to_segment_m(b1, a0, a1))
}

/// Distance of a point to the segment a-b.
#[must_use]
pub fn point_to_segment_m(point: Vector, a: Vector, b: Vector) -> f64 {
    let along = b - a;
    let length2 = along.length_squared();
    let share = if length2 > 0.0 { ((point - a).dot(along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (a + along * share - point).length()
}

/// Distance of the segment a-b to the solid box of the given half edges around the origin.
///
/// The squared distance of a point of the segment to the box is a sum of three terms `max(|x_k| - h_k, 0)^2`, each
/// a quadratic in the segment's parameter between the parameters where `x_k = +-h_k`. So on each of at most seven
/// pieces the minimum has a closed form.
#[must_use]
pub fn segment_to_box_m(a: Vector, b: Vector, half: Vector) -> f64 {
    let (p, d, h) = (a.to_array(), (b - a).to_array(), half.to_array());
    let mut cuts = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let mut count = 1;
    for k in 0..3 {
        for face in [-h[k], h[k]] {
            let t = (face - p[k]) / d[k];
            if t > 0.0 && t < 1.0 {
                cuts[count] = t;
                count += 1;
            }
        }
    }
    cuts[..count].sort_unstable_by(f64::total_cmp);
    let mut least2 = f64::INFINITY;
    for piece in 0..count {
        least2 = least2.min(least_on_piece(&p, &d, &h, [cuts[piece], cuts[piece + 1]]));
    }
    least2.max(0.0).sqrt()
}

/// Least squared distance for parameters within [from, to], where no term changes its form.
fn least_on_piece(p: &[f64; 3], d: &[f64; 3], h: &[f64; 3], [from, to]: [f64; 2]) -> f64 {
    let middle = 0.5 * (from + to);
    // Sum of the active terms: (offset + slope t)^2.
    let (mut slope2, mut mixed) = (0.0, 0.0);
    for k in 0..3 {
        let x = p[k] + d[k] * middle;
        if x.abs() > h[k] {
            let offset = p[k] - h[k].copysign(x);
            slope2 += d[k] * d[k];
            mixed += offset * d[k];
        }
    }
    let t = if slope2 > 0.0 { (-mixed / slope2).clamp(from, to) } else { middle };
    (0..3).map(|k| ((p[k] + d[k] * t).abs() - h[k]).max(0.0)).map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::SeededRng;
    use parry3d_f64::math::Pose;
    use parry3d_f64::query::distance;
    use parry3d_f64::shape::{Cuboid, Segment};

    fn point(rng: &mut SeededRng) -> Vector {
        // A coarse grid half of the time, so that parallel and degenerate cases really come up.
        let coarse = rng.unit() < 0.5;
        let mut next = || {
            let x = rng.within(-1.0, 1.0);
            if coarse { (x * 2.0).round() / 2.0 } else { x }
        };
        Vector::new(next(), next(), next())
    }

    /// Independent of both: dense points of one segment against the exact point distance.
    fn sampled(a0: Vector, a1: Vector, exact: impl Fn(Vector) -> f64) -> f64 {
        (0..=2_000).map(|i| exact(a0 + (a1 - a0) * (f64::from(i) / 2_000.0))).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn segments_random_and_degenerate_agree_with_sampling_and_parry() {
        for seed in 0..3_000 {
            let mut rng = SeededRng::new(seed, 0);
            let [a0, a1, b0, b1] = std::array::from_fn(|_| point(&mut rng));
            let ours = segment_to_segment_m(a0, a1, b0, b1);
            let dense = sampled(a0, a1, |p| point_to_segment_m(p, b0, b1));
            // A sampling is never below the truth, and above it by at most half a step.
            assert!(ours <= dense + 1e-12, "seed {seed}: {ours} above the sampled {dense}");
            assert!(dense - ours <= (a1 - a0).length() / 2_000.0, "seed {seed}: {ours} below {dense}");
            if (a1 - a0).length() > 0.01 && (b1 - b0).length() > 0.01 {
                let id = Pose::identity();
                let theirs = distance(&id, &Segment::new(a0, a1), &id, &Segment::new(b0, b1));
                let theirs = theirs.expect("supported").distance;
                assert!((ours - theirs).abs() < 1e-7, "seed {seed}: {ours} against parry's {theirs}");
            }
        }
    }

    #[test]
    fn box_random_and_degenerate_agree_with_sampling_and_parry() {
        for seed in 0..3_000 {
            let mut rng = SeededRng::new(seed, 1);
            let [a, b] = std::array::from_fn(|_| point(&mut rng) * 1.5);
            let half = Vector::new(rng.within(0.1, 0.8), rng.within(0.1, 0.8), rng.within(0.1, 0.8));
            let ours = segment_to_box_m(a, b, half);
            let dense = sampled(a, b, |p| (p.abs() - half).max(Vector::ZERO).length());
            assert!(ours <= dense + 1e-12, "seed {seed}: {ours} above the sampled {dense}");
            assert!(dense - ours <= (b - a).length() / 2_000.0, "seed {seed}: {ours} below {dense}");
            if (b - a).length() > 0.01 {
                let id = Pose::identity();
                let theirs = distance(&id, &Segment::new(a, b), &id, &Cuboid::new(half));
                let theirs = theirs.expect("supported").distance;
                assert!((ours - theirs).abs() < 1e-6, "seed {seed}: {ours} against parry's {theirs}");
            }
        }
    }
}
