//! Weights with which kept and new strokes together follow a reference inside the limits.
//!
//! The first round is a least-squares fit of velocity, acceleration and jerk to the reference. The next ones are the
//! alternating direction method of multipliers: rates are projected into the limits, and weights are fitted to what the
//! projection gave, less what was projected away before. Only the right-hand side changes, so one factor serves all rounds.
//!
//! Source: Boyd et al., "Distributed Optimization and Statistical Learning via the Alternating Direction Method of
//! Multipliers", 2011, sections 3.4.3 and 5.
use super::LANES;
use super::basis::Instants;
use super::factor::Factor;
use pulp::{Arch, Simd, WithSimd};

/// Velocity, acceleration and jerk of some joints at one instant.
pub(super) type Rates = [[f64; LANES]; 3];

/// Over-relaxation; 1 is none.
const RELAXATION: f64 = 1.6;
/// Excess over the bounds at which the rounds end: the ceiling is further above.
const EXCESS: f64 = 1.001;
/// How much further the bounds go down than a peak between the instants is too high.
const TIGHTEN: f64 = 0.999;
/// A parabola through values below this share of the ceiling has its peak below it.
const NEAR: f64 = 0.97;
/// After how many rounds a fit is given up whose largest share of a bound is above what is stated.
const HOPELESS: [(u32, f64); 4] = [(8, 1.08), (14, 1.035), (20, 1.02), (26, 1.012)];
/// Most rounds of a fit.
const ROUNDS: u32 = 32;

/// What all joints share.
pub(super) struct System {
    pub instants: Instants,
    pub factor: Factor,
    /// Weights of squared velocities, accelerations and jerks.
    pub weights: [f64; 3],
    /// How many strokes there are.
    pub count: usize,
}

/// What differs from joint to joint.
pub(super) struct Problem {
    /// What the kept strokes do at the fitted instants.
    pub kept: Vec<Rates>,
    /// What the sum should do at the fitted instants.
    pub reference: Vec<Rates>,
    /// What it may do at most at the fitted instants, less a margin.
    pub bounds: Vec<Rates>,
    /// What all new strokes together must move; nothing when the end is free.
    pub sum_rad: Option<[f64; LANES]>,
}

/// What is looked at once a fit keeps its bounds: most fits that fail never do, and it costs as much as the fit.
pub(super) struct Fine<'a> {
    /// Closely spaced instants.
    pub instants: &'a Instants,
    /// What the kept strokes do there.
    pub kept: Vec<Rates>,
    /// What the sum may do there at most.
    pub ceilings: Vec<Rates>,
}

/// A fit, compiled for each width of vectors.
struct Rounds<'a> {
    system: &'a System,
    problem: &'a mut Problem,
    fine: &'a dyn Fn() -> Fine<'a>,
}

impl WithSimd for Rounds<'_> {
    type Output = Option<Vec<[f64; LANES]>>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        self.system.rounds(self.problem, self.fine)
    }
}

impl System {
    /// Weights of the strokes, or nothing when none were found inside the ceilings. Uses the widest vectors of the processor.
    pub(super) fn solve<'a>(
        &'a self,
        problem: &'a mut Problem,
        fine: &'a dyn Fn() -> Fine<'a>,
    ) -> Option<Vec<[f64; LANES]>> {
        Arch::new().dispatch(Rounds { system: self, problem, fine })
    }

    #[inline(always)]
    fn rounds<'a>(&self, problem: &mut Problem, fine: &'a dyn Fn() -> Fine<'a>) -> Option<Vec<[f64; LANES]>> {
        let mut looked: Option<Fine<'a>> = None;
        let mut along = vec![[1.0; LANES]; self.count];
        self.factor.solve(&mut along);
        let mut dual = vec![[[0.0; LANES]; 3]; problem.reference.len()];
        let mut weights = vec![[0.0; LANES]; self.count];
        for round in 0..ROUNDS {
            self.least_squares(problem, &along, &mut weights);
            let used = self.project(problem, &weights, &mut dual, round == 0);
            if used <= EXCESS && tighten(problem, looked.get_or_insert_with(fine), &weights) {
                return Some(weights);
            }
            if HOPELESS.iter().any(|(rounds, most)| round + 1 == *rounds && used > *most) {
                break;
            }
        }
        None
    }

    /// Weights nearest to the reference, with their sum fixed.
    #[inline(always)]
    fn least_squares(&self, problem: &Problem, along: &[[f64; LANES]], weights: &mut [[f64; LANES]]) {
        weights.fill([0.0; LANES]);
        for (instant, (target, kept)) in problem.reference.iter().zip(&problem.kept).enumerate() {
            let mut gap = *target;
            for ((gap, kept), weight) in gap.iter_mut().zip(kept).zip(self.weights) {
                for (gap, kept) in gap.iter_mut().zip(kept) {
                    *gap = (*gap - kept) * weight;
                }
            }
            let (first, shares) = self.instants.shares(instant);
            for (share, sum) in shares.iter().zip(&mut weights[first..]) {
                for (lane, sum) in sum.iter_mut().enumerate() {
                    *sum += share[0] * gap[0][lane] + share[1] * gap[1][lane] + share[2] * gap[2][lane];
                }
            }
        }
        self.factor.solve(weights);
        let Some(mut off_rad) = problem.sum_rad else { return };
        let mut along_sum = 0.0;
        for (weight, along) in weights.iter().zip(along) {
            along_sum += along[0];
            for (off, weight) in off_rad.iter_mut().zip(weight) {
                *off -= weight;
            }
        }
        for (weight, along) in weights.iter_mut().zip(along) {
            for (weight, off) in weight.iter_mut().zip(&off_rad) {
                *weight += off * along[0] / along_sum;
            }
        }
    }

    /// Projects into the bounds, sets the next reference, and returns the largest share of a bound.
    #[inline(always)]
    fn project(
        &self,
        problem: &mut Problem,
        weights: &[[f64; LANES]],
        dual: &mut [Rates],
        first: bool,
    ) -> f64 {
        let mut used = [0.0; LANES];
        let relaxation = if first { 1.0 } else { RELAXATION };
        for (instant, dual) in dual.iter_mut().enumerate() {
            let now = self.instants.sum(instant, weights, &problem.kept[instant]);
            let (target, bounds) = (&mut problem.reference[instant], &problem.bounds[instant]);
            for quantity in 0..3 {
                // Local copies, so that lanes become vectors.
                let (now, bound) = (now[quantity], bounds[quantity]);
                let (mut aim, mut off) = (target[quantity], dual[quantity]);
                for lane in 0..LANES {
                    used[lane] = larger(now[lane].abs() / bound[lane], used[lane]);
                    let relaxed = relaxation * now[lane] + (1.0 - relaxation) * (aim[lane] + off[lane]);
                    let wanted = relaxed + off[lane];
                    let raised = larger(-bound[lane], wanted);
                    let inside = if bound[lane] < raised { bound[lane] } else { raised };
                    off[lane] = wanted - inside;
                    aim[lane] = inside - off[lane];
                }
                (target[quantity], dual[quantity]) = (aim, off);
            }
        }
        used.into_iter().fold(0.0, f64::max)
    }
}

/// True when nothing is above its ceiling. Otherwise lowers the bounds next to what is.
#[inline(always)]
fn tighten(problem: &mut Problem, fine: &Fine, weights: &[[f64; LANES]]) -> bool {
    let mut holds = true;
    let mut last: Option<[Rates; 2]> = None;
    for instant in 0..fine.instants.times_s.len() {
        let now = fine.instants.sum(instant, weights, &fine.kept[instant]);
        // The ceiling of the instant before, at which a peak may be.
        let middle = instant.saturating_sub(1);
        let [before, at] = last.unwrap_or([now, now]);
        for quantity in 0..3 {
            let (values, ceilings) = (at[quantity], fine.ceilings[middle][quantity]);
            let mut highest = 0.0;
            for lane in 0..LANES {
                highest = larger(values[lane].abs() / ceilings[lane], highest);
            }
            if highest <= NEAR {
                continue;
            }
            for lane in 0..LANES {
                let peak = peak([before, at, now].map(|rates| rates[quantity][lane]));
                if peak <= ceilings[lane] {
                    continue;
                }
                holds = false;
                let near = fine.instants.nearest[middle];
                for bounds in problem.bounds.iter_mut().skip(near).take(2) {
                    bounds[quantity][lane] *= TIGHTEN * ceilings[lane] / peak;
                }
            }
        }
        last = Some([at, now]);
    }
    holds
}

/// One instruction, which [`f64::max`] is not. Where one is no number it is the second.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Highest magnitude near the middle one of three neighbouring values: of the parabola through them.
#[inline(always)]
fn peak([before, middle, after]: [f64; 3]) -> f64 {
    let (top, bend) = (middle.abs(), before - 2.0 * middle + after);
    let is_top = middle * bend < 0.0 && top >= before.abs().max(after.abs());
    if is_top { top + (before - after) * (before - after) / (8.0 * bend.abs()) } else { top }
}

impl Instants {
    /// What weighted strokes and the kept ones do together at an instant.
    #[inline(always)]
    fn sum(&self, instant: usize, weights: &[[f64; LANES]], kept: &Rates) -> Rates {
        let mut sum = *kept;
        let (first, shares) = self.shares(instant);
        for (share, weight) in shares.iter().zip(&weights[first..]) {
            for (sum, share) in sum.iter_mut().zip(share) {
                for (sum, weight) in sum.iter_mut().zip(weight) {
                    *sum += share * weight;
                }
            }
        }
        sum
    }
}
