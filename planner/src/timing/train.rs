//! A straight move as a train of strokes: one kernel, evenly started, fitted to the limits.
//!
//! A move of any length under any limits has, but for its scale, two numbers: the share of its time that the optimum ramps,
//! and the share of a ramp in which the jerk acts. The kernel's width follows from them; [`Fitter`] finds the deltas.
//! docs/planner.md has the durations that come out, against the optimum.
use super::SLACK;
use super::fit::{Bounds, DELTAS, Fitter, Grid};
use super::line::{LineLimits, Optimum};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, MAX_JOINTS, Stroke};

/// Strokes of a straight move at most.
pub const TRAIN_STROKES: usize = 64;
/// Exponent of the strokes: 6 to 8 differ by a percent.
const EXPONENT: u32 = 7;
/// Duration that a fit aims at, in optima; less is missed by more.
const AIM: f64 = 1.08;
/// Rounds of a fit: later ones win less than half a percent.
const ROUNDS: usize = 30;
/// Both with more strokes than [`TRAIN_STROKES`].
const OF_MANY: (f64, usize) = (1.065, 60);
/// Widest kernel of up to so many strokes, in spacings.
const OVERLAP_MAX: f64 = 16.0;
/// Largest delta, in means: larger ones do not make a move shorter, and round badly.
const DELTA_MAX: f64 = 4.0;

/// A straight move of length 1: strokes of one kernel, `spacing_s` apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Train {
    /// The strokes' number, duration in spacings, and exponent.
    pub grid: Grid,
    /// From one start to the next.
    pub spacing_s: f64,
    /// The share of the line that each stroke covers; never negative, and 1 in all.
    pub shares: Vec<f64>,
}

impl Train {
    /// The train of at most so many strokes, and at most [`TRAIN_STROKES`], that takes least time.
    #[must_use]
    pub fn new(limits: &LineLimits, strokes_max: usize) -> Option<Self> {
        Self::of_at_most(limits, strokes_max.min(TRAIN_STROKES))
    }

    /// The train of at most so many strokes that takes least time.
    #[must_use]
    pub fn of_at_most(limits: &LineLimits, strokes_max: usize) -> Option<Self> {
        let mut strokes = strokes_max;
        let mut best: Option<Self> = None;
        // A stroke has a least duration: what is too short for many strokes is shorter with fewer.
        while strokes > 0 {
            let train = Self::of(limits, strokes)?;
            let is_narrow = train.kernel_s() <= DURATION_S_MIN * (1.0 + 1e-9);
            if best.as_ref().is_none_or(|b| train.duration_s() < b.duration_s()) {
                best = Some(train);
            }
            if !is_narrow {
                break;
            }
            strokes /= 2;
        }
        best
    }

    fn of(limits: &LineLimits, strokes: usize) -> Option<Self> {
        let optimum = limits.optimum();
        let overlap = if strokes > 1 { overlap(&optimum, strokes) } else { 1 };
        let grid = Grid { strokes, overlap, n: EXPONENT };
        let (aim, rounds) = if strokes > TRAIN_STROKES { OF_MANY } else { (AIM, ROUNDS) };
        let spacing_s = aim * optimum.duration_s() / grid.spacings() as f64;
        let shares = fitted(&grid, &optimum, (spacing_s, rounds))?;
        let bounds = [limits.velocity, limits.acceleration, limits.jerk];
        let mut scale: f64 = 0.0;
        let mut unit = 1.0;
        for (order, bound) in (1..).zip(bounds) {
            unit *= spacing_s;
            let used = grid.peak(&shares, order) / (bound * unit);
            scale = scale.max(used.powf(1.0 / order as f64));
        }
        let spacing_s = (spacing_s * scale * (1.0 + SLACK)).max(DURATION_S_MIN / overlap as f64);
        spacing_s.is_finite().then_some(Self { grid, spacing_s, shares })
    }

    /// From rest to rest.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.spacing_s * self.grid.spacings() as f64
    }

    /// Duration of a stroke, at least the shortest that there is.
    #[must_use]
    pub fn kernel_s(&self) -> f64 {
        (self.spacing_s * self.grid.overlap as f64).max(DURATION_S_MIN)
    }

    /// Adds the strokes of a move between two poses, beginning at `start_s`.
    pub fn append(&self, strokes: &mut Vec<Stroke>, start_s: f64, [from, to]: [&JointArray; 2]) {
        let duration_s = self.kernel_s();
        let mut left_rad: [f64; MAX_JOINTS] = std::array::from_fn(|joint| to[joint] - from[joint]);
        let last = self.shares.len().saturating_sub(1);
        for (i, share) in self.shares.iter().enumerate() {
            let delta_rad = std::array::from_fn(|joint| {
                // The last one takes what rounding has left.
                if i == last { left_rad[joint] } else { share * (to[joint] - from[joint]) }
            });
            left_rad.iter_mut().zip(&delta_rad).for_each(|(left, delta)| *left -= delta);
            let start_s = start_s + self.spacing_s * i as f64;
            strokes.push(Stroke { start_s, duration_s, n: self.grid.n, delta_rad });
        }
    }
}

/// Duration of a kernel in spacings: about a ramp wide where moves are short, narrower in long ones; ramps of constant
/// acceleration take narrower ones than ramps of jerk.
fn overlap(optimum: &Optimum, strokes: usize) -> usize {
    let ramps = 2.0 * optimum.ramp_s() / optimum.duration_s();
    let jerky = 2.0 * optimum.jerk_s / optimum.ramp_s();
    let fewer = (strokes as f64 / TRAIN_STROKES as f64).powf(0.6);
    let overlap = fewer * (4.0 + 12.0 * ramps.powf(0.6) * jerky.max(0.02).powf(0.18));
    let most = OVERLAP_MAX * fewer.max(1.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 2 to some dozens")]
    let overlap = overlap.clamp(2.0, most).round() as usize;
    overlap
}

/// Shares of the line, from the optimum on, fitted to its peaks.
fn fitted(grid: &Grid, optimum: &Optimum, (spacing_s, rounds): (f64, usize)) -> Option<Vec<f64>> {
    let strokes = grid.strokes as f64;
    let at = |i: usize| optimum.position(i as f64 / strokes * optimum.duration_s());
    let mut shares: Vec<f64> = (0..grid.strokes).map(|i| at(i + 1) - at(i)).collect();
    if grid.strokes > 1 {
        let [v, a, j] = optimum.peaks();
        let mut deltas = Bounds::even(grid, DELTAS, DELTA_MAX / strokes);
        deltas.low.fill(0.0);
        deltas.weight = strokes;
        let bounds = [
            Bounds::even(grid, 1, v * spacing_s),
            Bounds::even(grid, 2, a * spacing_s * spacing_s),
            Bounds::even(grid, 3, j * spacing_s * spacing_s * spacing_s),
            deltas,
        ];
        let weights = bounds.each_ref().map(|b| (b.order, b.weight));
        Fitter::new(*grid, &weights)?.fit(&mut shares, &bounds, rounds);
    }
    shares.iter_mut().for_each(|share| *share = share.max(0.0));
    let sum: f64 = shares.iter().sum();
    shares.iter_mut().for_each(|share| *share /= sum);
    shares.iter().all(|share| share.is_finite()).then_some(shares)
}
