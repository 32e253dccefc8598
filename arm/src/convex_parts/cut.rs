//! Where a piece is best cut in two.
//!
//! Seven planes across each axis are tried, and then around the best one in ever smaller steps: the wall of a gap
//! can be anywhere. A volume here is that of the hull of some extreme points, which is near enough to choose by.
use super::extremes::{Directions, Extremes};
use super::piece::{Piece, Plane, crossing};
use parry3d_f64::math::Vector;

/// Cuts whose savings differ by less than this share of the volume around the piece are of equal merit.
const TIE_SHARE: f64 = 1e-3;
/// Planes that are tried first, as shares of the extent: near its eighths, and not at them, where drawings have their faces. Which side a
/// face in the plane falls to would hang on its last bits.
const SHARES: [f64; 7] = [0.127, 0.253, 0.377, 0.503, 0.629, 0.751, 0.873];
/// Steps around the best plane.
const STEPS: [f64; 5] = [0.0617, 0.0311, 0.0157, 0.0079, 0.0041];
/// A piece that is thinner is not cut.
const EXTENT_M_MIN: f64 = 1e-4;

/// A plane, and the volume by which the hulls of its two sides are smaller than one hull.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    pub(super) plane: Plane,
    pub(super) saved_m3: f64,
}

/// The cut that saves most; none when the piece is too thin for any.
pub(super) fn best(piece: &Piece) -> Option<Cut> {
    let search = Search::of(piece)?;
    let mut best: Option<Tried> = None;
    for axis in 0..3 {
        search.try_planes(axis, &SHARES, &mut best);
    }
    for step in STEPS {
        let Tried { axis, share, .. } = best?;
        search.try_planes(axis, &[share - step, share + step], &mut best);
    }
    let Tried { axis, share, saved } = best?;
    let plane = Plane { axis, at_m: search.low[axis] + share * search.extent[axis] };
    Some(Cut { plane, saved_m3: saved * search.extent.element_product() })
}

/// A plane at a share of the extent, and what it saves of the box around the piece.
#[derive(Clone, Copy, Debug)]
struct Tried {
    axis: usize,
    share: f64,
    saved: f64,
}

/// A piece, seen as the unit cube.
struct Search {
    seen: Piece,
    low: Vector,
    extent: Vector,
    directions: Directions,
}

impl Search {
    fn of(piece: &Piece) -> Option<Self> {
        let corners = || piece.triangles.iter().flatten().map(|corner| piece.point(*corner));
        let low = corners().fold(Vector::INFINITY, Vector::min);
        let high = corners().fold(Vector::NEG_INFINITY, Vector::max);
        let extent = high - low;
        if extent.min_element() < EXTENT_M_MIN {
            return None;
        }
        let points = piece.points.iter().map(|p| (*p - low) / extent).collect();
        let seen = Piece { points, triangles: piece.triangles.clone() };
        Some(Self { seen, low, extent, directions: Directions::new() })
    }

    /// Tries planes at rising shares of one axis, and keeps the best of all.
    fn try_planes(&self, axis: usize, shares: &[f64], best: &mut Option<Tried>) {
        let slabs = self.slabs(axis, shares);
        let Some(whole) = Extremes::of_all(&slabs).volume() else { return };
        for (i, share) in shares.iter().enumerate() {
            let Some((below, above)) = slabs.split_at_checked(i + 1) else { continue };
            let sides = Extremes::of_all(below).volume().zip(Extremes::of_all(above).volume());
            let Some((below, above)) = sides else { continue };
            let saved = whole - below - above;
            if best.is_none_or(|best| saved > best.saved + TIE_SHARE) {
                *best = Some(Tried { axis, share: *share, saved });
            }
        }
    }

    /// The extreme points between each two neighbouring planes, with the crossings of edges with these.
    fn slabs(&self, axis: usize, shares: &[f64]) -> Vec<Extremes> {
        let mut slabs = vec![self.directions.extremes(); shares.len() + 1];
        let slab = |p: Vector| shares.iter().filter(|share| **share < p[axis]).count();
        let mut is_seen = vec![false; self.seen.points.len()];
        for triangle in &self.seen.triangles {
            let [a, b, c] = self.seen.corners(*triangle);
            for (corner, (from, to)) in triangle.iter().zip([(a, b), (b, c), (c, a)]) {
                let (first, last) = (slab(from), slab(to));
                if let (Some(is_seen), Some(slab)) = (is_seen.get_mut(*corner), slabs.get_mut(first))
                    && !std::mem::replace(is_seen, true)
                {
                    slab.add(&self.directions, from);
                }
                let crossed = first.min(last)..first.max(last);
                for (i, share) in shares.iter().enumerate().filter(|(i, _)| crossed.contains(i)) {
                    let point = crossing(from, to, Plane { axis, at_m: *share });
                    for slab in slabs.iter_mut().skip(i).take(2) {
                        slab.add(&self.directions, point);
                    }
                }
            }
        }
        slabs
    }
}
