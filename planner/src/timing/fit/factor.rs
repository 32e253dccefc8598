//! Cholesky factor of a banded matrix that is the same along each diagonal.
use super::lane::{Lane, Vectorized};
use pulp::Simd;

/// Share of its diagonal that is added to the matrix: it slows rounding errors, and does not move the solution.
const DAMPING: f64 = 1e-7;

/// The factor, by rows and by columns so that both solves add whole vectors.
pub(super) struct Factor<L> {
    band: usize,
    /// Each row's entries left of the diagonal, nearest last; zero in front of the first column.
    rows: Vec<L>,
    /// Each column's entries below the diagonal, nearest first; zero behind the last row.
    columns: Vec<L>,
    /// The diagonal's inverse.
    inverse: Vec<L>,
}

/// Factors a matrix; `None` when it is not positive definite.
pub(super) struct Factoring<'a, L> {
    /// By distance from the diagonal.
    pub(super) by_distance: &'a [L],
    pub(super) size: usize,
}

impl<L: Lane> Vectorized for Factoring<'_, L> {
    type Output = Option<Factor<L>>;

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Factor<L>> {
        let Self { by_distance, size } = self;
        let band = by_distance.len() - 1;
        let (mut rows, mut columns) = (vec![L::ZERO; size * band], vec![L::ZERO; size * band]);
        let mut inverse = vec![L::ZERO; size];
        let diagonal = by_distance[0].times(simd, 1.0 + DAMPING);
        for i in 0..size {
            let first = i.saturating_sub(band);
            for j in first..=i {
                let (row_i, row_j) = (&rows[i * band..(i + 1) * band], &rows[j * band..(j + 1) * band]);
                let (a, b) = (&row_i[first + band - i..j + band - i], &row_j[first + band - j..]);
                let mut known = L::ZERO;
                for (a, b) in a.iter().zip(b) {
                    known = known.plus(simd, a.by(simd, *b));
                }
                if i == j {
                    let square = diagonal.minus(simd, known);
                    // Also refuses a NaN.
                    if !square.are_positive() {
                        return None;
                    }
                    inverse[i] = square.map(|square| 1.0 / square.sqrt());
                } else {
                    let entry = by_distance[i - j].minus(simd, known).by(simd, inverse[j]);
                    rows[i * band + j + band - i] = entry;
                    columns[j * band + i - j - 1] = entry;
                }
            }
        }
        Some(Factor { band, rows, columns, inverse })
    }
}

impl<L: Lane> Factor<L> {
    /// Solves in place.
    #[inline(always)]
    pub(super) fn solve<S: Simd>(&self, simd: S, right: &mut [L]) {
        let (band, size) = (self.band, right.len());
        for i in 0..size {
            let y = right[i].by(simd, self.inverse[i]);
            right[i] = y;
            let column = &self.columns[i * band..(i + 1) * band];
            for (left, l) in right[i + 1..].iter_mut().zip(column) {
                *left = left.minus(simd, l.by(simd, y));
            }
        }
        for i in (0..size).rev() {
            let x = right[i].by(simd, self.inverse[i]);
            right[i] = x;
            let reach = i.min(band);
            let row = &self.rows[(i + 1) * band - reach..(i + 1) * band];
            for (left, l) in right[i - reach..i].iter_mut().zip(row) {
                *left = left.minus(simd, l.by(simd, x));
            }
        }
    }
}
