//! Least squares over a basis whose strokes overlap only with their neighbours: a banded Cholesky factor.
use super::LANES;
use super::basis::Instants;

/// Relative growth of the diagonal: keeps the factor regular when strokes are hard to tell apart.
const RIDGE: f64 = 1e-7;

/// The factor L of the normal matrix, L L^T.
pub(super) struct Factor {
    count: usize,
    band: usize,
    /// Row i holds the columns i + 1 - band to i.
    rows: Vec<f64>,
}

impl Factor {
    /// For `count` strokes, and the weights of squared velocities, accelerations and jerks. Nothing when the matrix is not
    /// positive definite.
    pub(super) fn new(instants: &Instants, count: usize, weights: [f64; 3]) -> Option<Self> {
        let band = instants.most_running.max(1);
        let mut factor = Self { count, band, rows: vec![0.0; count * band] };
        for instant in 0..instants.times_s.len() {
            let (first, shares) = instants.shares(instant);
            for (i, a) in shares.iter().enumerate() {
                let a = [a[0] * weights[0], a[1] * weights[1], a[2] * weights[2]];
                let end = (first + i + 1) * band;
                let row = &mut factor.rows[end - i - 1..end];
                for (sum, b) in row.iter_mut().zip(shares) {
                    *sum += a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                }
            }
        }
        for i in 0..count {
            factor.rows[(i + 1) * band - 1] *= 1.0 + RIDGE;
        }
        factor.decompose().then_some(factor)
    }

    fn decompose(&mut self) -> bool {
        let band = self.band;
        for i in 0..self.count {
            let low = (i + 1).saturating_sub(band);
            for j in low..=i {
                let from = low.max((j + 1).saturating_sub(band));
                let (row_i, row_j) = (self.position(i, from), self.position(j, from));
                let terms =
                    self.rows[row_i..row_i + j - from].iter().zip(&self.rows[row_j..row_j + j - from]);
                let rest = self.rows[self.position(i, j)] - terms.map(|(a, b)| a * b).sum::<f64>();
                let at = self.position(i, j);
                if i != j {
                    self.rows[at] = rest / self.rows[self.position(j, j)];
                } else if rest > 0.0 && rest.is_finite() {
                    self.rows[at] = rest.sqrt();
                } else {
                    return false;
                }
            }
        }
        true
    }

    /// Where an element of the band stands.
    fn position(&self, row: usize, column: usize) -> usize {
        (row + 1) * self.band - 1 - (row - column)
    }

    /// Solves for several right-hand sides in place.
    #[inline(always)]
    pub(super) fn solve(&self, x: &mut [[f64; LANES]]) {
        let band = self.band;
        for i in 0..self.count {
            let low = (i + 1).saturating_sub(band);
            let row = &self.rows[self.position(i, low)..=self.position(i, i)];
            let (done, rest) = x.split_at_mut(i);
            let mut sum = rest[0];
            for (l, x) in row.iter().zip(&done[low..]) {
                for (sum, x) in sum.iter_mut().zip(x) {
                    *sum -= l * x;
                }
            }
            let scale = 1.0 / row[row.len() - 1];
            rest[0] = sum.map(|sum| sum * scale);
        }
        for i in (0..self.count).rev() {
            let low = (i + 1).saturating_sub(band);
            let row = &self.rows[self.position(i, low)..=self.position(i, i)];
            let (above, rest) = x.split_at_mut(i);
            let scale = 1.0 / row[row.len() - 1];
            let solved = rest[0].map(|value| value * scale);
            rest[0] = solved;
            for (l, x) in row.iter().zip(&mut above[low..]) {
                for (x, solved) in x.iter_mut().zip(&solved) {
                    *x -= l * solved;
                }
            }
        }
    }
}
