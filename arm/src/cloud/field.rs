//! How far places are from the points of a cloud at least: grids whose cells are worked out when somebody asks first.
use super::PointTree;
use parry3d_f64::math::Vector;
use std::sync::atomic::{AtomicU32, Ordering};

/// How far around the points there are cells.
const AROUND_M: f64 = 0.3;
/// Smallest cell.
const CELL_M_MIN: f64 = 0.01;
/// About as many cells there are at most; 4 bytes each.
const CELLS_MAX: f64 = 2e6;
/// A cell of the first grid has an edge as long as so many of the second.
const COARSER: f64 = 8.0;
/// Places that are farther off than this by the first grid need not be known better.
const FAR_M: f64 = 0.12;

/// A coarse grid, of which few cells are worked out, and a fine one for places near points.
#[derive(Debug)]
pub(super) struct Field {
    coarse: Grid,
    fine: Grid,
}

impl Field {
    pub(super) fn around(tree: &PointTree) -> Self {
        let (_, half) = tree.bounds();
        let edges = 2.0 * (half + Vector::splat(AROUND_M));
        let cell_m = (edges.x * edges.y * edges.z / CELLS_MAX).cbrt().max(CELL_M_MIN);
        Self { coarse: Grid::around(tree, COARSER * cell_m), fine: Grid::around(tree, cell_m) }
    }

    /// No point is nearer to a place than this (m); 0 where it may be at one.
    pub(super) fn least_m(&self, tree: &PointTree, at: Vector) -> f64 {
        let coarse_m = self.coarse.least_m(tree, at);
        if coarse_m > FAR_M { coarse_m } else { self.fine.least_m(tree, at) }
    }
}

#[derive(Debug)]
struct Grid {
    low: Vector,
    cell_m: f64,
    per_m: f64,
    size: [usize; 3],
    /// Half of a cell's diagonal.
    half_m: f64,
    /// Bits of a lower bound (f32, m) for every place in the cell; all ones where nobody has asked.
    cells: Box<[AtomicU32]>,
}

const UNKNOWN: u32 = u32::MAX;

impl Grid {
    fn around(tree: &PointTree, cell_m: f64) -> Self {
        let (middle, half) = tree.bounds();
        let half = half + Vector::splat(AROUND_M);
        let size = (2.0 * half / cell_m).to_array().map(|cells| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "some thousand at most"
            )]
            let cells = cells.ceil() as usize;
            cells.max(1)
        });
        let cells = (0..size.iter().product()).map(|_| AtomicU32::new(UNKNOWN)).collect();
        Self {
            low: middle - half,
            cell_m,
            per_m: 1.0 / cell_m,
            size,
            half_m: 0.5 * cell_m * 3.0_f64.sqrt(),
            cells,
        }
    }

    fn least_m(&self, tree: &PointTree, at: Vector) -> f64 {
        let Some((index, centre)) = self.cell(at) else {
            let (middle, half) = tree.bounds();
            return ((at - middle).abs() - half).max(Vector::ZERO).length();
        };
        let Some(cell) = self.cells.get(index) else { return 0.0 };
        let known = cell.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return f64::from(f32::from_bits(known));
        }
        let nearest = tree.nearest(f64::INFINITY, |p| (p - centre).length());
        let least_m = (nearest.map_or(0.0, |(distance_m, _)| distance_m) - self.half_m).max(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "rounded down below")]
        let least = (least_m as f32).next_down().max(0.0);
        // Whoever else works it out finds the same.
        cell.store(least.to_bits(), Ordering::Relaxed);
        f64::from(least)
    }

    /// The cell of a place, and its middle; `None` outside of the grid.
    fn cell(&self, at: Vector) -> Option<(usize, Vector)> {
        let place = ((at - self.low) * self.per_m).to_array();
        let mut index = 0;
        let mut centre = [0.0; 3];
        for (axis, (x, size)) in place.into_iter().zip(self.size).enumerate().rev() {
            // False for what is no number, too.
            if !(x >= 0.0 && x < size as f64) {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked above")]
            let cell = x as usize;
            index = index * size + cell;
            centre[axis] = cell as f64 + 0.5;
        }
        Some((index, self.low + Vector::from_array(centre) * self.cell_m))
    }
}
