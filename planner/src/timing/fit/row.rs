//! One derivative of a fit as a linear function of the control values.
use super::lane::{Lane, Vectorized};
use super::{DELTAS, Grid, PHASES, Values, instant};
use pulp::{Scalar, Simd};
use taustream_motion::stroke::Phi;

/// What each control value does to one derivative at one phase of a spacing: `taps[k]` for the value `k` spacings ago.
pub(super) fn taps(grid: &Grid, order: usize, at: f64) -> Vec<f64> {
    let width = grid.overlap as f64;
    let of_stroke = |k: usize| {
        let phi = Phi::at(grid.n, ((k as f64 + at) / width).min(1.0));
        let own = if k == 0 { 1.0 } else { 0.0 };
        let value =
            [phi.value, phi.d1 / width, phi.d2 / (width * width), phi.d3 / (width * width * width), own];
        value.get(order).copied().unwrap_or(0.0)
    };
    let ended = if order == 0 { 1.0 } else { 0.0 };
    let mut before = 0.0;
    let difference = |k: usize| {
        let own = if k < grid.overlap { of_stroke(k) } else { ended };
        own - std::mem::replace(&mut before, own)
    };
    // A delta depends on two control values only.
    let reach = if order == DELTAS { 1 } else { grid.overlap };
    (0..=reach).map(difference).collect()
}

/// The derivative at every sample, for control values with what stands in front of them: all of the first phase, then those of the next.
pub(super) struct Derivative<'a, L> {
    pub(super) spacings: usize,
    /// Of each phase.
    pub(super) taps: &'a [Vec<f64>],
    pub(super) values: &'a Values<L>,
    pub(super) result: &'a mut [L],
}

impl<L: Lane> Vectorized for Derivative<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Values { padded, overlap, .. } = self.values;
        for (taps, part) in self.taps.iter().zip(self.result.chunks_exact_mut(self.spacings)) {
            for (i, part) in part.iter_mut().enumerate() {
                // The latest value first.
                let ago = padded[i..=i + overlap].iter().rev();
                let mut sum = L::ZERO;
                for (tap, value) in taps.iter().zip(ago) {
                    sum = sum.plus(simd, value.times(simd, *tap));
                }
                *part = sum;
            }
        }
    }
}

/// One derivative in the fit.
pub(super) struct Row<L> {
    /// Of each phase.
    pub(super) taps: Vec<Vec<f64>>,
    /// The same times the square of the weight.
    weighted: Vec<Vec<L>>,
}

impl<L: Lane> Row<L> {
    pub(super) fn new(grid: &Grid, order: usize, weight: L) -> Self {
        let taps: Vec<Vec<f64>> = (0..PHASES).map(|phase| taps(grid, order, instant(phase))).collect();
        let scalar = Scalar::new();
        let square = weight.by(scalar, weight);
        let weighted =
            taps.iter().map(|taps| taps.iter().map(|tap| square.times(scalar, *tap)).collect()).collect();
        Self { taps, weighted }
    }

    /// Adds the transposed product with a value a sample, weighed.
    #[inline(always)]
    pub(super) fn add_transposed<S: Simd>(&self, simd: S, grid: &Grid, (samples, sums): (&[L], &mut [L])) {
        for (taps, part) in self.weighted.iter().zip(samples.chunks_exact(grid.spacings())) {
            for (i, sum) in sums.iter_mut().enumerate() {
                let mut all = *sum;
                for (tap, value) in taps.iter().zip(&part[i..]) {
                    all = all.plus(simd, tap.by(simd, *value));
                }
                *sum = all;
            }
        }
    }
}

/// The normal matrix by distance from its diagonal: it is the same along each of them.
pub(super) fn correlations<L: Lane>(rows: &[Row<L>], overlap: usize) -> Vec<L> {
    let scalar = Scalar::new();
    let mut by_distance = vec![L::ZERO; overlap + 1];
    for (taps, weighted) in rows.iter().flat_map(|row| row.taps.iter().zip(&row.weighted)) {
        for (distance, sum) in by_distance.iter_mut().enumerate() {
            for (a, b) in weighted.iter().zip(taps.iter().skip(distance)) {
                *sum = sum.plus(scalar, a.times(scalar, *b));
            }
        }
    }
    by_distance
}
