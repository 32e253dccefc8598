//! Shortens a path of proven edges: random shortcuts, then corners that are not needed.
use crate::rng::SeededRng;
use crate::tree::Space;
use taustream_motion::JointArray;

/// Tries `tries` random shortcuts, then drops corners that can be dropped. Every edge of the result is proven.
pub fn shorten(space: &Space, path: &mut Vec<JointArray>, tries: usize, rng: &mut SeededRng) {
    for _ in 0..tries {
        if path.len() <= 2 || space.budget.is_over() {
            break;
        }
        let lengths_m: Vec<f64> =
            path.windows(2).map(|p| if let [a, b] = p { space.distance_m(a, b) } else { 0.0 }).collect();
        let total_m: f64 = lengths_m.iter().sum();
        let (a_m, b_m) = (rng.unit() * total_m, rng.unit() * total_m);
        let (from, a) = point_at(path, &lengths_m, a_m.min(b_m));
        let (to, b) = point_at(path, &lengths_m, a_m.max(b_m));
        if from < to && space.is_edge_free(&a, &b) {
            path.splice(from + 1..=to, [a, b]);
        }
    }
    drop_corners(space, path);
}

/// The segment and the pose at a length along the path.
fn point_at(path: &[JointArray], lengths_m: &[f64], at_m: f64) -> (usize, JointArray) {
    let mut left_m = at_m;
    let last = lengths_m.len() - 1;
    for (i, &length_m) in lengths_m.iter().enumerate() {
        if left_m <= length_m || i == last {
            let share = if length_m > 0.0 { (left_m / length_m).clamp(0.0, 1.0) } else { 0.0 };
            return (i, Space::between(&path[i], &path[i + 1], share));
        }
        left_m -= length_m;
    }
    (last, path[last + 1])
}

/// Joins neighbours wherever the straight edge past a corner is proven, until no corner can go.
fn drop_corners(space: &Space, path: &mut Vec<JointArray>) {
    let mut i = 1;
    while i + 1 < path.len() && !space.budget.is_over() {
        if space.is_edge_free(&path[i - 1], &path[i + 1]) {
            path.remove(i);
            // The corner before may have become droppable.
            i = i.saturating_sub(1).max(1);
        } else {
            i += 1;
        }
    }
}
