//! A mesh as a few convex parts, which together contain the whole of it.
//!
//! The convex hull of a bent or forked link fills its bends and gaps, and then collides with links that the real one
//! never touches. So a mesh is cut in two by a plane across one of its axes, where that makes the hulls of both sides
//! together smallest; then one of the sides is cut, and so on, as long as a cut saves a share of the whole hull's volume that is
//! worth one more body. A mesh that no cut makes smaller stays one hull. A ring stays one too: either side of any one
//! cut is a horseshoe, whose hull is as full as the ring's.
//!
//! # Why the parts contain the mesh and what it encloses
//!
//! Let T be all points of all triangles, and S any bounded solid whose boundary lies in T: what a closed mesh encloses by
//! any rule, nothing for an open one. The cuts divide space into cells, open boxes C. The body of a cell is the hull of
//!
//! 1. the corners of T clipped to C (triangles that lie in a cutting plane are given to the cell below it), and
//! 2. those corners of the cell, where three cutting planes meet, from which no ray leaves T.
//!
//! Clipped triangles are convex polygons, so 1 contains the closure of T within C; together the cells contain T. The
//! hull of the closure of S within C is the hull of its extreme points. Let e be one of them that is not in the closure of T within C. A
//! small ball around e then contains no point of T within C; its part within C is convex, hence connected, and touches S, so it is
//! wholly in S. If e lay in C, on one of its faces or on one of its edges, a short line through e would be in the closure too, and e would be no
//! extreme point. So e is a corner of the cell. If a ray led from there to infinity without meeting T, a ball around e would
//! be outside of S, because only T separates inside from outside and S is bounded. So e is among 2, and the body
//! contains S within C. An inside point of S on a cutting plane is in the closure of both sides.
//!
//! Nothing is assumed of the mesh: it may be open, self-intersecting, or have triangles that face the wrong way.
//! Crossings are rounded to the last bit, far below the rounding of each body.
//!
//! # The same everywhere
//!
//! Volumes are compared with a tolerance, so that among cuts of equal merit the first one is taken on every machine.
mod cut;
mod escape;
mod extremes;
mod piece;

use crate::hull::{self, Hull};
use cut::Cut;
use nalgebra::Point3;
use parry3d_f64::math::Vector;
use piece::{Cell, Piece};

/// Most parts of a mesh: the distances that a plan asks for grow with their number.
const PARTS_MAX: usize = 8;
/// A cut has to save this share of the volume of the mesh's own hull.
const SAVED_SHARE_MIN: f64 = 0.08;

/// The volumes that cuts are chosen by are near enough; of the bodies themselves this share of the saving must be left.
const KEPT_SHARE: f64 = 0.75;
/// Savings that differ by less than this share of the least one are equal.
const TIE_SHARE: f64 = 0.01;

/// The convex bodies of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ConvexParts {
    /// One or more.
    pub(crate) hulls: Vec<Hull>,
    /// Volume of the parts, by that of the one hull of the mesh.
    pub(crate) volume_share: f64,
}

/// A part while it may still be cut.
struct Part {
    piece: Piece,
    cell: Cell,
    hull: Hull,
    /// The best cut; none when the part is not to be cut.
    cut: Option<Cut>,
}

/// The convex parts of a mesh with finite corners; an error says why there are none: how thick the mesh is.
///
/// A mesh that is not worth a cut has the hull of all its points as its only part.
pub(crate) fn of(points_m: &[Point3<f64>], triangles: &[[usize; 3]]) -> Result<ConvexParts, f64> {
    let whole = hull::of(points_m)?;
    let volume_m3 = whole.volume_m3();
    let points = points_m.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let mesh = Piece { points, triangles: triangles.to_vec() };
    let parts = cut_up(&mesh, SAVED_SHARE_MIN * volume_m3);
    if parts.len() < 2 {
        return Ok(ConvexParts { hulls: vec![whole], volume_share: 1.0 });
    }
    let hulls: Vec<Hull> = parts.into_iter().map(|part| part.hull).collect();
    let volume_share = hulls.iter().map(Hull::volume_m3).sum::<f64>() / volume_m3;
    Ok(ConvexParts { hulls, volume_share })
}

/// The mesh in pieces, each cut saving `least_m3` or more; nothing when the mesh itself is too thin.
fn cut_up(mesh: &Piece, least_m3: f64) -> Vec<Part> {
    let mut parts: Vec<Part> = Part::of(mesh, mesh.clone(), Cell::EVERYWHERE).into_iter().collect();
    while parts.len() < PARTS_MAX {
        let Some((index, cut)) = most_saving(&parts, least_m3) else { break };
        let Some(part) = parts.get_mut(index) else { break };
        match part.divide(mesh, cut).filter(|sides| part.saved_m3(sides) >= KEPT_SHARE * least_m3) {
            Some((below, above)) => {
                *part = below;
                parts.push(above);
            }
            None => part.cut = None,
        }
    }
    parts
}

/// The part whose cut saves most, when that is `least_m3` or more.
fn most_saving(parts: &[Part], least_m3: f64) -> Option<(usize, Cut)> {
    let mut best: Option<(usize, Cut)> = None;
    for (index, part) in parts.iter().enumerate() {
        let Some(cut) = part.cut.filter(|cut| cut.saved_m3 >= least_m3) else { continue };
        if best.is_none_or(|(_, other)| cut.saved_m3 > other.saved_m3 + TIE_SHARE * least_m3) {
            best = Some((index, cut));
        }
    }
    best
}

impl Part {
    /// None when the piece is too thin to be a body of its own.
    fn of(mesh: &Piece, piece: Piece, cell: Cell) -> Option<Self> {
        let inside = cell.corners().into_iter().filter(|corner| !escape::is_outside(mesh, *corner));
        let points: Vec<Point3<f64>> =
            piece.points.iter().copied().chain(inside).map(|p| Point3::new(p.x, p.y, p.z)).collect();
        let hull = hull::of_piece(&points).ok()?;
        let cut = cut::best(&piece);
        Some(Self { piece, cell, hull, cut })
    }

    /// By how much two parts are smaller than this one.
    fn saved_m3(&self, (below, above): &(Self, Self)) -> f64 {
        self.hull.volume_m3() - below.hull.volume_m3() - above.hull.volume_m3()
    }

    /// Both sides of a cut; none when one of them is too thin.
    fn divide(&self, mesh: &Piece, cut: Cut) -> Option<(Self, Self)> {
        let (below, above) = self.cell.divide(cut.plane);
        let part = |piece: Piece, cell: Cell| Self::of(mesh, piece, cell);
        Some((part(self.piece.below(cut.plane), below)?, part(self.piece.above(cut.plane), above)?))
    }
}

#[cfg(test)]
mod tests;
