//! Shortens a path of free edges: random shortcuts, then corners that are not needed.
use crate::rng::SeededRng;
use crate::tree::{Field, Space};
use taustream_motion::JointArray;

/// How far a corner is pulled towards the line between its neighbours, tried in this order.
const PULLS: [f64; 3] = [0.5, 0.25, 0.1];
/// Rounds of pulling all corners.
const PULL_ROUNDS: usize = 3;

/// How much is tried.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Random shortcuts.
    pub tries: usize,
    /// Tries in a row without success after which no more are made.
    pub stalled: usize,
}

/// Tries random shortcuts, then drops corners that can be dropped. Every edge of the result is free.
pub fn shorten(field: &impl Field, path: &mut Vec<JointArray>, tries: usize, rng: &mut SeededRng) {
    random_shortcuts(field, path, Effort { tries, stalled: tries }, rng);
    drop_corners(field, path);
}

/// The same until it stalls, corners first; what is left of them is pulled inwards.
pub fn shorten_until_stalled(
    field: &impl Field,
    path: &mut Vec<JointArray>,
    effort: Effort,
    rng: &mut SeededRng,
) {
    drop_corners(field, path);
    random_shortcuts(field, path, effort, rng);
    drop_corners(field, path);
    for _ in 0..PULL_ROUNDS {
        if !pull_corners(field, path) {
            break;
        }
    }
    drop_corners(field, path);
}

fn random_shortcuts(field: &impl Field, path: &mut Vec<JointArray>, effort: Effort, rng: &mut SeededRng) {
    let mut failed = 0;
    for _ in 0..effort.tries {
        if path.len() <= 2 || failed >= effort.stalled || field.is_over() {
            break;
        }
        let lengths: Vec<f64> =
            path.windows(2).map(|p| if let [a, b] = p { field.distance(a, b) } else { 0.0 }).collect();
        let total: f64 = lengths.iter().sum();
        let (a_at, b_at) = (rng.unit() * total, rng.unit() * total);
        let (from, a) = point_at(path, &lengths, a_at.min(b_at));
        let (to, b) = point_at(path, &lengths, a_at.max(b_at));
        failed += 1;
        if from < to && field.is_edge_free(&a, &b) {
            path.splice(from + 1..=to, [a, b]);
            failed = 0;
        }
    }
}

/// The segment and the pose at a length along the path.
fn point_at(path: &[JointArray], lengths: &[f64], at: f64) -> (usize, JointArray) {
    let mut left = at;
    let last = lengths.len() - 1;
    for (i, &length) in lengths.iter().enumerate() {
        if left <= length || i == last {
            let share = if length > 0.0 { (left / length).clamp(0.0, 1.0) } else { 0.0 };
            return (i, Space::between(&path[i], &path[i + 1], share));
        }
        left -= length;
    }
    (last, path[last + 1])
}

/// Joins neighbours wherever the straight edge past a corner is free, until no corner can go.
fn drop_corners(field: &impl Field, path: &mut Vec<JointArray>) {
    let mut i = 1;
    while i + 1 < path.len() && !field.is_over() {
        if field.is_edge_free(&path[i - 1], &path[i + 1]) {
            path.remove(i);
            // The corner before may have become droppable.
            i = i.saturating_sub(1).max(1);
        } else {
            i += 1;
        }
    }
}

/// Moves each corner towards the line between its neighbours as far as both edges stay free; true when one has moved.
fn pull_corners(field: &impl Field, path: &mut [JointArray]) -> bool {
    let mut has_moved = false;
    for i in 1..path.len().saturating_sub(1) {
        let (before, corner, after) = (path[i - 1], path[i], path[i + 1]);
        let (to, from) = (field.distance(&before, &corner), field.distance(&corner, &after));
        if to + from <= 0.0 {
            continue;
        }
        let foot = Space::between(&before, &after, to / (to + from));
        let pulled = PULLS.iter().map(|pull| Space::between(&corner, &foot, *pull)).find(|pose| {
            !field.is_over() && field.is_edge_free(&before, pose) && field.is_edge_free(&after, pose)
        });
        if let Some(pose) = pulled {
            path[i] = pose;
            has_moved = true;
        }
    }
    has_moved
}
