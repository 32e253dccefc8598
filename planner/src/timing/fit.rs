//! Strokes of one kernel whose summed motion stays inside bounds: a small convex problem, solved by projections.
//!
//! N strokes of one duration T and one n start evenly, a spacing h apart, and T is a whole number of spacings. What one
//! joint does is then linear in the strokes' deltas, and written in the sums of the deltas (the *control values* `c_i`, the
//! position after stroke i) it is local: at every instant position, velocity, acceleration and jerk depend on
//! `overlap + 1` neighbouring control values, and the position is a mean of them. The first control value is 0 and
//! the last is the total, so both ends are at rest whatever the others are.
//!
//! [`Fitter::fit`] looks for control values with which each derivative keeps its bounds at every sample: the alternating
//! direction method of multipliers (Boyd et al. 2011, section 5). One banded matrix that depends on the grid and on the
//! weights only is factored once; a round costs a product with it, a product with its transpose and two triangular
//! solves. Bounds that cannot be kept are missed in the mean square; the caller scales time to what remains.
//!
//! What is fitted may be any joint, or a scalar along a line. Bounds may differ from sample to sample, so they can follow a
//! reference (bounds around it) or leave out what other strokes take (kept strokes at a cut, a state that moves): subtract
//! what those do from the bounds. Times are in spacings, so derivatives are in rad per spacing, its square and its cube.
mod factor;
mod lane;
mod row;

pub use lane::{Lane, PerJoint};

use factor::{Factor, Factoring};
pub(super) use lane::{Vectorized, vectorized};
use pulp::{Scalar, Simd};
use row::{Derivative, Row, correlations, taps};

/// Samples of a spacing in a fit.
const PHASES: usize = 2;
/// Samples of a stroke, at least, where peaks are looked for, the starts of others among them: there the jerk has its kinks.
const PEAK_SAMPLES: usize = 160;
/// Orders that are bounded: position, velocity, acceleration, jerk, and the deltas themselves.
pub const ORDERS: usize = 5;
/// The order of the deltas: bounds of the samples in the first spacings are those of the strokes that start there.
pub const DELTAS: usize = 4;
/// Over-relaxation (Boyd et al. 2011, section 3.4.3).
const RELAXATION: f64 = 1.6;

/// Strokes of one duration and one n that start evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// How many.
    pub strokes: usize,
    /// Their duration in spacings.
    pub overlap: usize,
    /// Their exponent.
    pub n: u32,
}

impl Grid {
    /// From the first start to the last end, in spacings.
    #[must_use]
    pub fn spacings(&self) -> usize {
        self.strokes + self.overlap - 1
    }

    /// Bounds that a fit looks at, for each order.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.spacings() * PHASES
    }

    /// When a sample is taken, in spacings.
    #[must_use]
    pub fn sample_at(&self, sample: usize) -> f64 {
        let (phase, spacing) = (sample / self.spacings(), sample % self.spacings());
        spacing as f64 + instant(phase)
    }

    /// Positions at so many even instants of each spacing: all of the first instant, then those of the next.
    pub(super) fn values<L: Lane>(&self, deltas: &[L], phases: usize) -> Vec<L> {
        self.derivative(deltas, 0, phases)
    }

    fn derivative<L: Lane>(&self, deltas: &[L], order: usize, phases: usize) -> Vec<L> {
        let taps: Vec<Vec<f64>> =
            (0..phases).map(|phase| taps(self, order, phase as f64 / phases as f64)).collect();
        let values = Values::of(deltas, self.overlap);
        let mut all = vec![L::ZERO; self.spacings() * phases];
        vectorized(Derivative { spacings: self.spacings(), taps: &taps, values: &values, result: &mut all });
        all
    }

    /// Largest magnitude of a derivative of what strokes with such deltas do, in spacings.
    #[must_use]
    pub fn peak<L: Lane>(&self, deltas: &[L], order: usize) -> L {
        let all = self.derivative(deltas, order, PEAK_SAMPLES.div_ceil(self.overlap));
        all.iter().fold(L::ZERO, |most, value| most.greater(Scalar::new(), value.map(f64::abs)))
    }
}

/// Where in its spacing a phase is sampled.
fn instant(phase: usize) -> f64 {
    (phase as f64 + 0.5) / PHASES as f64
}

/// Bounds of one derivative at every sample, lowest and highest, in [`Grid::sample_at`]'s order.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds<L = f64> {
    /// 0 for position to 3 for jerk.
    pub order: usize,
    /// What an excess counts, against those of the other orders; the unit of the order's inverse.
    pub weight: L,
    /// Lowest allowed value of each sample.
    pub low: Vec<L>,
    /// Highest allowed value of each sample.
    pub high: Vec<L>,
}

impl<L: Lane> Bounds<L> {
    /// The same bound at every sample, in both directions, weighed by its inverse.
    #[must_use]
    pub fn even(grid: &Grid, order: usize, most: L) -> Self {
        let samples = grid.samples();
        let (weight, low) = (most.map(|most| 1.0 / most), most.map(|most| -most));
        Self { order, weight, low: vec![low; samples], high: vec![most; samples] }
    }
}

/// A factored problem: one grid, and the weights of its bounds.
pub struct Fitter<L = f64> {
    grid: Grid,
    rows: Vec<Row<L>>,
    factor: Factor<L>,
}

impl<L: Lane> Fitter<L> {
    /// Factors the problem for orders and their weights; `None` without strokes to move, or when a weight is not a positive
    /// number.
    #[must_use]
    pub fn new(grid: Grid, weights: &[(usize, L)]) -> Option<Self> {
        let is_usable = weights.iter().all(|(order, w)| *order < ORDERS && w.are_positive());
        if grid.strokes < 2 || grid.overlap < 2 || weights.is_empty() || !is_usable {
            return None;
        }
        let rows: Vec<Row<L>> = weights.iter().map(|(order, w)| Row::new(&grid, *order, *w)).collect();
        let by_distance = correlations(&rows, grid.overlap);
        let factor = vectorized(Factoring { by_distance: &by_distance, size: grid.strokes - 1 })?;
        Some(Self { grid, rows, factor })
    }

    /// Changes the deltas of all strokes, whose sum stays as it is, until their motion keeps the bounds better;
    /// `bounds` are of the orders and weights that the fitter was made for.
    pub fn fit(&self, deltas: &mut [L], bounds: &[Bounds<L>], rounds: usize) {
        if deltas.len() != self.grid.strokes || bounds.len() != self.rows.len() {
            return;
        }
        let mut fit = Fit::new(self, deltas);
        vectorized(Rounds { fit: &mut fit, bounds, rounds });
        fit.write(deltas);
    }
}

/// A fit under way, for callers that bound several joints together.
pub(super) struct Fit<'a, L = f64> {
    fitter: &'a Fitter<L>,
    values: Values<L>,
    /// One an order.
    pub(super) parts: Vec<Part<L>>,
    step: Vec<L>,
}

impl<'a, L: Lane> Fit<'a, L> {
    pub(super) fn new(fitter: &'a Fitter<L>, deltas: &[L]) -> Self {
        let values = Values::of(deltas, fitter.grid.overlap);
        let parts = fitter.rows.iter().map(|row| Part::new(row, &fitter.grid, &values)).collect();
        Self { fitter, values, parts, step: vec![L::ZERO; deltas.len().saturating_sub(1)] }
    }

    /// One round: control values that meet the targets best, and what motion they make. The caller then sets new targets.
    #[inline(always)]
    pub(super) fn advance<S: Simd>(&mut self, simd: S) {
        let Self { fitter, values, parts, step } = self;
        let spacings = fitter.grid.spacings();
        step.fill(L::ZERO);
        for (row, part) in fitter.rows.iter().zip(parts.iter_mut()) {
            row.add_transposed(simd, &fitter.grid, (part.missing(simd), step));
        }
        fitter.factor.solve(simd, step);
        values.add(simd, step);
        for (row, part) in fitter.rows.iter().zip(parts) {
            Derivative { spacings, taps: &row.taps, values, result: &mut part.is }.run(simd);
            part.relax(simd);
        }
    }

    pub(super) fn write(&self, deltas: &mut [L]) {
        self.values.write(deltas);
    }
}

/// Several rounds with the same bounds.
struct Rounds<'r, 'a, L> {
    fit: &'r mut Fit<'a, L>,
    bounds: &'r [Bounds<L>],
    rounds: usize,
}

impl<L: Lane> Vectorized for Rounds<'_, '_, L> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for round in 0..=self.rounds {
            if round > 0 {
                self.fit.advance(simd);
            }
            for (part, bounds) in self.fit.parts.iter_mut().zip(self.bounds) {
                part.clamp(simd, bounds);
            }
        }
    }
}

/// One order of a fit: what the motion is, what it should be, and what has added up between the two.
pub(super) struct Part<L> {
    is: Vec<L>,
    pub(super) target: Vec<L>,
    /// After a round what the target would be without bounds; then what the bounds have taken from it.
    pub(super) excess: Vec<L>,
    missing: Vec<L>,
}

impl<L: Lane> Part<L> {
    fn new(row: &Row<L>, grid: &Grid, values: &Values<L>) -> Self {
        let mut is = vec![L::ZERO; grid.samples()];
        Derivative { spacings: grid.spacings(), taps: &row.taps, values, result: &mut is }.run(Scalar::new());
        Self { target: is.clone(), excess: is.clone(), missing: vec![L::ZERO; is.len()], is }
    }

    #[inline(always)]
    fn missing<S: Simd>(&mut self, simd: S) -> &[L] {
        let all = self.is.iter().zip(&self.target).zip(&self.excess);
        for (missing, ((is, target), excess)) in self.missing.iter_mut().zip(all) {
            *missing = target.minus(simd, *excess).minus(simd, *is);
        }
        &self.missing
    }

    #[inline(always)]
    fn relax<S: Simd>(&mut self, simd: S) {
        for (excess, (is, target)) in self.excess.iter_mut().zip(self.is.iter().zip(&self.target)) {
            let relaxed = is.times(simd, RELAXATION).plus(simd, target.times(simd, 1.0 - RELAXATION));
            *excess = excess.plus(simd, relaxed);
        }
    }

    /// By how much the motion exceeds its bounds at most, in inverse weights; negative when it keeps them.
    #[inline(always)]
    pub(super) fn beyond<S: Simd>(&self, simd: S, bounds: &Bounds<L>) -> f64 {
        let limits = bounds.low.iter().zip(&bounds.high);
        let mut most = bounds.weight.map(|_| f64::NEG_INFINITY);
        for (is, (low, high)) in self.is.iter().zip(limits) {
            let beyond = is.minus(simd, *high).greater(simd, low.minus(simd, *is));
            most = most.greater(simd, beyond.by(simd, bounds.weight));
        }
        most.greatest()
    }

    /// Targets within bounds. Where others take more than there is, the nearer of the two is missed least.
    #[inline(always)]
    pub(super) fn clamp<S: Simd>(&mut self, simd: S, bounds: &Bounds<L>) {
        let bounds = bounds.low.iter().zip(&bounds.high);
        for ((target, excess), (low, high)) in self.target.iter_mut().zip(&mut self.excess).zip(bounds) {
            *target = excess.lesser(simd, *high).greater(simd, *low);
            *excess = excess.minus(simd, *target);
        }
    }
}

/// Control values with what stands in front of the first and behind the last.
struct Values<L> {
    padded: Vec<L>,
    overlap: usize,
    inner: usize,
}

impl<L: Lane> Values<L> {
    fn of(deltas: &[L], overlap: usize) -> Self {
        let mut padded = vec![L::ZERO; overlap];
        let mut sum = L::ZERO;
        padded.extend(deltas.iter().map(|delta| {
            sum = sum.plus(Scalar::new(), *delta);
            sum
        }));
        padded.extend(std::iter::repeat_n(sum, overlap));
        Self { padded, overlap, inner: deltas.len() - 1 }
    }

    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, step: &[L]) {
        for (value, step) in self.padded[self.overlap..self.overlap + self.inner].iter_mut().zip(step) {
            *value = value.plus(simd, *step);
        }
    }

    fn write(&self, deltas: &mut [L]) {
        let steps = self.padded[self.overlap - 1..].windows(2);
        for (delta, pair) in deltas.iter_mut().zip(steps) {
            if let [from, to] = pair {
                *delta = to.minus(Scalar::new(), *from);
            }
        }
    }
}
