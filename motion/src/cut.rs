//! What a cut keeps of a trajectory, and how a replacement is compared with it.
//!
//! A cut at trajectory time c keeps the strokes that begin before c. A replacement repeats them and adds strokes that begin
//! at c or later, on the same time axis. Strokes that have ended would pile up under a stream of targets, so a replacement
//! may fold leading ones into its base. The sampler adds leading ended strokes to the base in their order, and folding adds
//! them in that order, too: from the end of the folded strokes on, both give the same bits. A stroke that has ended behind
//! one that still runs is not folded, because its sum would be rounded in another order.
use crate::{JointArray, MAX_JOINTS, Stroke, Trajectory};

/// The part of a trajectory that a replacement repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept<'a> {
    /// The base with the folded strokes added to it.
    pub base_rad: JointArray,
    /// The strokes that begin before the cut, without the folded ones.
    pub strokes: &'a [Stroke],
}

/// Where a replacement does not repeat what it cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeptDifference {
    /// This stroke of the trajectory that is cut is missing, changed, or folded before it has ended.
    Stroke(usize),
    /// The base is another one.
    Base {
        /// Zero-based joint.
        joint: usize,
        /// How far it is off.
        by_rad: f64,
    },
}

/// What a cut at `cut_s` keeps, with the leading strokes folded that have ended at `folded_s`: the instant from which the
/// replacement is sampled, which is the cut itself unless the trajectory waits for a cut of its own.
#[must_use]
pub fn kept(trajectory: &Trajectory, cut_s: f64, folded_s: f64) -> Kept<'_> {
    let begun = begun(trajectory, cut_s);
    let ended = begun.iter().position(|stroke| !stroke.has_ended(folded_s)).unwrap_or(begun.len());
    let (folded, strokes) = begun.split_at(ended);
    Kept { base_rad: fold(trajectory.base_rad(), folded), strokes }
}

/// Compares a replacement with what it has to repeat, bit by bit; `None` when it does. However many leading strokes it
/// folds, they must have ended at `folded_s`.
///
/// Real time: no allocation; looks at every stroke that begins before the cut, once.
#[must_use]
pub fn difference(
    trajectory: &Trajectory,
    replacement: &Trajectory,
    (cut_s, folded_s): (f64, f64),
) -> Option<KeptDifference> {
    let (begun, repeated) = (begun(trajectory, cut_s), begun(replacement, cut_s));
    let Some(folded) = begun.len().checked_sub(repeated.len()) else {
        return Some(KeptDifference::Stroke(begun.len()));
    };
    let (folded, kept) = begun.split_at(folded);
    if let Some(stroke) = folded.iter().position(|stroke| !stroke.has_ended(folded_s)) {
        return Some(KeptDifference::Stroke(stroke));
    }
    if let Some(at) = kept.iter().zip(repeated).position(|(a, b)| !same_bits(a, b)) {
        return Some(KeptDifference::Stroke(folded.len() + at));
    }
    let base_rad = fold(trajectory.base_rad(), folded);
    let joints = base_rad.iter().zip(replacement.base_rad()).enumerate();
    joints
        .take(MAX_JOINTS)
        .find(|(_, (a, b))| a.to_bits() != b.to_bits())
        .map(|(joint, (a, b))| KeptDifference::Base { joint, by_rad: (a - b).abs() })
}

/// The strokes that begin before `cut_s`. They are sorted by start.
fn begun(trajectory: &Trajectory, cut_s: f64) -> &[Stroke] {
    let strokes = trajectory.strokes();
    strokes.get(..strokes.partition_point(|stroke| stroke.start_s < cut_s)).unwrap_or(&[])
}

/// Adds ended strokes to a pose in the order in which the sampler adds them.
fn fold(base_rad: &JointArray, ended: &[Stroke]) -> JointArray {
    let mut sum_rad = *base_rad;
    for stroke in ended {
        for (sum_rad, delta_rad) in sum_rad.iter_mut().zip(&stroke.delta_rad) {
            *sum_rad += delta_rad;
        }
    }
    sum_rad
}

fn same_bits(a: &Stroke, b: &Stroke) -> bool {
    let times =
        a.start_s.to_bits() == b.start_s.to_bits() && a.duration_s.to_bits() == b.duration_s.to_bits();
    let mut deltas = a.delta_rad.iter().zip(&b.delta_rad);
    times && a.n == b.n && deltas.all(|(a, b)| a.to_bits() == b.to_bits())
}
