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
use taustream_motion::stroke::Phi;

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
/// Share of its diagonal that is added to the matrix: it slows rounding errors, and does not move the solution.
const DAMPING: f64 = 1e-7;

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
    pub(super) fn values(&self, deltas: &[f64], phases: usize) -> Vec<f64> {
        self.derivative(deltas, 0, phases)
    }

    fn derivative(&self, deltas: &[f64], order: usize, phases: usize) -> Vec<f64> {
        let taps = (0..phases).map(|phase| taps(self, order, phase as f64 / phases as f64)).collect();
        let mut all = vec![0.0; self.spacings() * phases];
        Row { weight: 1.0, taps }.apply(self, &Values::of(deltas, self.overlap), &mut all);
        all
    }

    /// Largest magnitude of a derivative of what strokes with such deltas do, in spacings.
    #[must_use]
    pub fn peak(&self, deltas: &[f64], order: usize) -> f64 {
        let all = self.derivative(deltas, order, PEAK_SAMPLES.div_ceil(self.overlap));
        all.iter().fold(0.0, |most, value| most.max(value.abs()))
    }
}

/// Where in its spacing a phase is sampled.
fn instant(phase: usize) -> f64 {
    (phase as f64 + 0.5) / PHASES as f64
}

/// What each control value does to one derivative at one phase of a spacing: `taps[k]` for the value `k` spacings ago.
fn taps(grid: &Grid, order: usize, at: f64) -> Vec<f64> {
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

/// Bounds of one derivative at every sample, lowest and highest, in [`Grid::sample_at`]'s order.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// 0 for position to 3 for jerk.
    pub order: usize,
    /// What an excess counts, against those of the other orders; the unit of the order's inverse.
    pub weight: f64,
    /// Lowest allowed value of each sample.
    pub low: Vec<f64>,
    /// Highest allowed value of each sample.
    pub high: Vec<f64>,
}

impl Bounds {
    /// The same bound at every sample, in both directions, weighed by its inverse.
    #[must_use]
    pub fn even(grid: &Grid, order: usize, most: f64) -> Self {
        let samples = grid.samples();
        Self { order, weight: 1.0 / most, low: vec![-most; samples], high: vec![most; samples] }
    }
}

/// One derivative in the fit.
struct Row {
    weight: f64,
    /// Of each phase.
    taps: Vec<Vec<f64>>,
}

/// A factored problem: one grid, and the weights of its bounds.
pub struct Fitter {
    grid: Grid,
    rows: Vec<Row>,
    factor: Factor,
}

impl Fitter {
    /// Factors the problem for orders and their weights; `None` without strokes to move, or when a weight is not a positive
    /// number.
    #[must_use]
    pub fn new(grid: Grid, weights: &[(usize, f64)]) -> Option<Self> {
        let is_usable = weights.iter().all(|(order, w)| *order < ORDERS && w.is_finite() && *w > 0.0);
        if grid.strokes < 2 || grid.overlap < 2 || weights.is_empty() || !is_usable {
            return None;
        }
        let row = |&(order, weight): &(usize, f64)| Row {
            weight,
            taps: (0..PHASES).map(|phase| taps(&grid, order, instant(phase))).collect(),
        };
        let rows: Vec<Row> = weights.iter().map(row).collect();
        let factor = Factor::of(&correlations(&rows, grid.overlap), grid.strokes - 1)?;
        Some(Self { grid, rows, factor })
    }

    /// Changes the deltas of all strokes, whose sum stays as it is, until their motion keeps the bounds better;
    /// `bounds` are of the orders and weights that the fitter was made for.
    pub fn fit(&self, deltas: &mut [f64], bounds: &[Bounds], rounds: usize) {
        if deltas.len() != self.grid.strokes || bounds.len() != self.rows.len() {
            return;
        }
        let mut fit = Fit::new(self, deltas);
        for round in 0..=rounds {
            if round > 0 {
                fit.advance();
            }
            for (part, bound) in fit.parts.iter_mut().zip(bounds) {
                part.clamp(bound);
            }
        }
        fit.write(deltas);
    }
}

/// A fit under way, for callers that bound several joints together.
pub(super) struct Fit<'a> {
    fitter: &'a Fitter,
    values: Values,
    /// One an order.
    pub(super) parts: Vec<Part>,
    step: Vec<f64>,
}

impl<'a> Fit<'a> {
    pub(super) fn new(fitter: &'a Fitter, deltas: &[f64]) -> Self {
        let values = Values::of(deltas, fitter.grid.overlap);
        let parts = fitter.rows.iter().map(|row| Part::new(row, &fitter.grid, &values)).collect();
        Self { fitter, values, parts, step: vec![0.0; deltas.len().saturating_sub(1)] }
    }

    /// One round: control values that meet the targets best, and what motion they make. The caller then sets new targets.
    pub(super) fn advance(&mut self) {
        let Self { fitter, values, parts, step } = self;
        step.fill(0.0);
        for (row, part) in fitter.rows.iter().zip(parts.iter_mut()) {
            row.add_transposed(&fitter.grid, part.missing(), step);
        }
        fitter.factor.solve(step);
        values.add(step);
        for (row, part) in fitter.rows.iter().zip(parts) {
            row.apply(&fitter.grid, values, &mut part.is);
            part.relax();
        }
    }

    pub(super) fn write(&self, deltas: &mut [f64]) {
        self.values.write(deltas);
    }
}

/// One order of a fit: what the motion is, what it should be, and what has added up between the two.
pub(super) struct Part {
    is: Vec<f64>,
    pub(super) target: Vec<f64>,
    /// After a round what the target would be without bounds; then what the bounds have taken from it.
    pub(super) excess: Vec<f64>,
    missing: Vec<f64>,
}

impl Part {
    fn new(row: &Row, grid: &Grid, values: &Values) -> Self {
        let mut is = vec![0.0; grid.samples()];
        row.apply(grid, values, &mut is);
        Self { target: is.clone(), excess: is.clone(), missing: vec![0.0; is.len()], is }
    }

    fn missing(&mut self) -> &[f64] {
        let all = self.is.iter().zip(&self.target).zip(&self.excess);
        for (missing, ((is, target), excess)) in self.missing.iter_mut().zip(all) {
            *missing = target - excess - is;
        }
        &self.missing
    }

    fn relax(&mut self) {
        for (excess, (is, target)) in self.excess.iter_mut().zip(self.is.iter().zip(&self.target)) {
            *excess += RELAXATION * is + (1.0 - RELAXATION) * target;
        }
    }

    /// By how much the motion exceeds its bounds at most, in inverse weights; negative when it keeps them.
    pub(super) fn beyond(&self, bounds: &Bounds) -> f64 {
        let limits = bounds.low.iter().zip(&bounds.high);
        let most = self.is.iter().zip(limits).map(|(is, (low, high))| (is - high).max(low - is));
        most.fold(f64::NEG_INFINITY, f64::max) * bounds.weight
    }

    /// Targets within bounds.
    pub(super) fn clamp(&mut self, bounds: &Bounds) {
        let bounds = bounds.low.iter().zip(&bounds.high);
        for ((target, excess), (low, high)) in self.target.iter_mut().zip(&mut self.excess).zip(bounds) {
            *target = excess.clamp_to(*low, *high);
            *excess -= *target;
        }
    }
}

/// A clamp that takes bounds in any order: where others take more than there is, the nearer one is missed least.
trait ClampTo {
    fn clamp_to(self, low: f64, high: f64) -> Self;
}

impl ClampTo for f64 {
    fn clamp_to(self, low: f64, high: f64) -> Self {
        self.min(high).max(low)
    }
}

/// Control values with what stands in front of the first and behind the last.
struct Values {
    padded: Vec<f64>,
    overlap: usize,
    inner: usize,
}

impl Values {
    fn of(deltas: &[f64], overlap: usize) -> Self {
        let mut padded = vec![0.0; overlap];
        let mut sum = 0.0;
        padded.extend(deltas.iter().map(|delta| {
            sum += delta;
            sum
        }));
        padded.extend(std::iter::repeat_n(sum, overlap));
        Self { padded, overlap, inner: deltas.len() - 1 }
    }

    fn add(&mut self, step: &[f64]) {
        for (value, step) in self.padded[self.overlap..self.overlap + self.inner].iter_mut().zip(step) {
            *value += step;
        }
    }

    fn write(&self, deltas: &mut [f64]) {
        let steps = self.padded[self.overlap - 1..].windows(2);
        for (delta, pair) in deltas.iter_mut().zip(steps) {
            if let [from, to] = pair {
                *delta = to - from;
            }
        }
    }
}

impl Row {
    /// The derivative at every sample.
    fn apply(&self, grid: &Grid, values: &Values, result: &mut [f64]) {
        let (spacings, overlap) = (grid.spacings(), grid.overlap);
        result.fill(0.0);
        for (taps, part) in self.taps.iter().zip(result.chunks_exact_mut(spacings)) {
            for (k, tap) in taps.iter().enumerate() {
                let ago = &values.padded[overlap - k..overlap - k + spacings];
                part.iter_mut().zip(ago).for_each(|(sum, value)| *sum += tap * value);
            }
        }
    }

    /// Adds the transposed product with a value a sample, weighed.
    fn add_transposed(&self, grid: &Grid, samples: &[f64], sums: &mut [f64]) {
        let (spacings, scale) = (grid.spacings(), self.weight * self.weight);
        for (taps, part) in self.taps.iter().zip(samples.chunks_exact(spacings)) {
            for (k, tap) in taps.iter().enumerate() {
                let ahead = part[k..].iter();
                sums.iter_mut().zip(ahead).for_each(|(sum, value)| *sum += scale * tap * value);
            }
        }
    }
}

/// The normal matrix by distance from its diagonal: it is the same along each of them.
fn correlations(rows: &[Row], overlap: usize) -> Vec<f64> {
    let mut by_distance = vec![0.0; overlap + 1];
    for row in rows {
        for taps in &row.taps {
            for (distance, sum) in by_distance.iter_mut().enumerate() {
                let pairs = taps.iter().zip(taps.iter().skip(distance));
                *sum += row.weight * row.weight * pairs.map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
    by_distance
}

/// Cholesky factor of a banded matrix, by rows and by columns so that both solves add whole vectors.
struct Factor {
    band: usize,
    /// Each row's entries left of the diagonal, nearest last; zero in front of the first column.
    rows: Vec<f64>,
    /// Each column's entries below the diagonal, nearest first; zero behind the last row.
    columns: Vec<f64>,
    /// The diagonal's inverse.
    inverse: Vec<f64>,
}

impl Factor {
    /// `None` when the matrix is not positive definite.
    fn of(by_distance: &[f64], size: usize) -> Option<Self> {
        let band = by_distance.len() - 1;
        let (mut rows, mut columns) = (vec![0.0; size * band], vec![0.0; size * band]);
        let mut inverse = vec![0.0; size];
        for i in 0..size {
            let first = i.saturating_sub(band);
            for j in first..=i {
                let (row_i, row_j) = (&rows[i * band..(i + 1) * band], &rows[j * band..(j + 1) * band]);
                let (a, b) = (&row_i[first + band - i..j + band - i], &row_j[first + band - j..]);
                let known: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                if i == j {
                    let square = by_distance[0] * (1.0 + DAMPING) - known;
                    // Also refuses a NaN.
                    if !(square > 0.0 && square.is_finite()) {
                        return None;
                    }
                    inverse[i] = 1.0 / square.sqrt();
                } else {
                    let entry = (by_distance[i - j] - known) * inverse[j];
                    rows[i * band + j + band - i] = entry;
                    columns[j * band + i - j - 1] = entry;
                }
            }
        }
        Some(Self { band, rows, columns, inverse })
    }

    /// Solves in place.
    fn solve(&self, right: &mut [f64]) {
        let (band, size) = (self.band, right.len());
        for i in 0..size {
            let y = right[i] * self.inverse[i];
            right[i] = y;
            let column = &self.columns[i * band..(i + 1) * band];
            right[i + 1..].iter_mut().zip(column).for_each(|(left, l)| *left -= l * y);
        }
        for i in (0..size).rev() {
            let x = right[i] * self.inverse[i];
            right[i] = x;
            let reach = i.min(band);
            let row = &self.rows[(i + 1) * band - reach..(i + 1) * band];
            right[i - reach..i].iter_mut().zip(row).for_each(|(left, l)| *left -= l * x);
        }
    }
}
