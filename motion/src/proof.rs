//! The proof behind [`crate::limits::check_motion`]: branch and bound with Taylor models.
//!
//! The proof begins at an instant that its caller chooses: at the start, or at the cut of a replacement, before which the
//! trajectory is not run.
//!
//! Between two neighbouring starts or ends of strokes a trajectory is one polynomial. On an interval of half width H
//! round m, Taylor's theorem bounds each quantity by its exact derivatives at m and a remainder:
//!
//! ```text
//! |q^(k)(t)| <= |q^(k)(m)| + |q^(k+1)(m)| H + .. + |q^(4)(m)| H^(4-k)/(4-k)! + M5 H^(5-k)/(5-k)!
//! ```
//!
//! M5 bounds the fifth derivative: that of one stroke is a sum of four terms c s^a (1 - s^4)^b, each with a closed-form
//! peak. Intervals whose bound is too high are halved. Strokes that cancel each other are no difficulty, because only
//! the remainder adds their magnitudes. What rounding can hide is added to every bound.
//!
//! Most of a motion is proven more quickly: the eighth-order Taylor polynomial of a whole piece, with a bound of what it leaves out, is
//! bounded in Bernstein form, which takes the strokes' values at one instant only. Where that does not suffice, the piece is
//! proven as above, which also finds the evidence of a violation.
//!
//! Strokes in a row begin and end together, up to rounding. Between such edges no piece is proven: a neighbour's bounds grow by the
//! little that can happen there.
//!
//! A joint that begins outside its range may only come in. The profile of a stroke is monotone, so while every stroke
//! that has begun leads inwards, the joint cannot go further outside; no bound is needed. From the first stroke that
//! leads outwards, and at the end, the range holds as for any other joint.
mod pieces;

use crate::limits::{LimitViolation, Peaks, Quantity, TOLERANCE};
use crate::polynomial::RESOLUTION;
use crate::profile_derivatives::{ORDERS, bounds};
use crate::range::PermittedRange;
use crate::stroke::{Phi, power};
use crate::{JointLimits, MAX_JOINTS, MAX_STROKES, Trajectory, USUAL_JOINTS, joint_array};

/// Most evaluations that a proof may take, of one stroke each; an interval counts as [`INTERVAL_BUDGET`] more. The densest
/// messages, at their limits, need about half.
const BUDGET_MAX: usize = 5_000_000;
/// How much of it sharper peaks may take: they are a service, not a part of the proof.
const PEAK_BUDGET: usize = 1_000_000;
/// What it costs to check an interval, in evaluations of one stroke.
const INTERVAL_BUDGET: usize = 8;
/// Most halvings of one piece: 2^-40 of a day is 80 ns.
const DEPTH_MAX: u32 = 40;
/// Reported peaks are at most [`RESOLUTION`] above the true ones, relatively, or this part of the limit.
const PEAK_FLOOR: f64 = 1e-6;
/// Edges that are nearer, relatively, differ by rounding.
const EDGE_ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Relative rounding of a sum of up to 512 terms, each with a relative error of some 4 n epsilon.
const ROUNDING: f64 = 2e-13;
/// Once a violation is known, an earlier one is looked for down to this width (s).
const FIRST_S: f64 = 1e-5;

/// Velocity, acceleration, jerk: the quantities with symmetric limits.
const RATES: [Quantity; 3] = [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk];

pub(crate) fn check(
    trajectory: &Trajectory,
    limits: &[JointLimits; MAX_JOINTS],
    begin_s: f64,
) -> Result<Peaks, LimitViolation> {
    if trajectory.joints() <= USUAL_JOINTS {
        check_in::<USUAL_JOINTS>(trajectory, limits, begin_s)
    } else {
        check_in::<MAX_JOINTS>(trajectory, limits, begin_s)
    }
}

fn check_in<const WIDTH: usize>(
    trajectory: &Trajectory,
    limits: &[JointLimits; MAX_JOINTS],
    begin_s: f64,
) -> Result<Peaks, LimitViolation> {
    let mut proof = Proof::<WIDTH>::new(trajectory, limits, begin_s);
    proof.check_ends(begin_s)?;
    let mut edges = [f64::INFINITY; 2 * MAX_STROKES];
    for (pair, stroke) in edges.chunks_exact_mut(2).zip(trajectory.strokes()) {
        pair.copy_from_slice(&[stroke.start_s, stroke.end_s()]);
    }
    edges.sort_unstable_by(f64::total_cmp);
    let pieces = edges.windows(2).map(|w| (w[0].max(begin_s), w[1])).filter(|(_, to_s)| to_s.is_finite());
    for (from_s, to_s) in pieces {
        if to_s - from_s <= EDGE_ROUNDING * to_s {
            continue;
        }
        proof.enter(from_s, to_s);
        if !proof.holds_by_polynomials(from_s, to_s) {
            proof.prove(from_s, to_s)?;
        }
    }
    Ok(proof.peaks())
}

/// q and its first four derivatives by time at one instant, all joints.
type Jet<const WIDTH: usize> = [[f64; WIDTH]; 5];

pub(crate) struct Proof<'a, const WIDTH: usize> {
    trajectory: &'a Trajectory,
    limits: &'a [JointLimits; MAX_JOINTS],
    /// Of each stroke `c_k/T^k`, the bounds of its derivatives.
    scales: [[f64; ORDERS + 1]; MAX_STROKES],
    /// Sums of them over the strokes that run in the current piece, times `|delta|`.
    size: [[f64; WIDTH]; ORDERS + 1],
    /// What can happen to position, velocity, acceleration and jerk between edges that differ by rounding.
    beside: [[f64; WIDTH]; 4],
    /// Indices of the strokes that run in the current piece.
    running: [u16; MAX_STROKES],
    running_count: usize,
    /// Strokes before this one have ended before it; the pose after them, and the sum of their |delta|.
    first: usize,
    ended_rad: [f64; WIDTH],
    ended_size_rad: [f64; WIDTH],
    /// The same with those that have ended behind one that runs.
    reached_rad: [f64; WIDTH],
    travelled_rad: [f64; WIDTH],
    /// Until when each joint comes in from outside its range, and the side; 0 for a joint that begins inside.
    entries: [Entry; WIDTH],
    /// Highest values met so far, and highest bounds proven: velocity, acceleration, jerk.
    met: [[f64; WIDTH]; 3],
    bound: [[f64; WIDTH]; 3],
    budget: usize,
}

/// How a joint that begins outside its range comes in.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// Start of the first stroke that leads outwards; nothing for a joint that begins inside.
    until_s: Option<f64>,
    /// True for a joint above its range.
    above: bool,
}

impl Entry {
    fn new(joint: usize, limits: &JointLimits, (trajectory, begin_s): (&Trajectory, f64)) -> Self {
        let begins_rad = trajectory.sample(begin_s).position_rad[joint];
        if limits.is_inside(begins_rad) {
            return Self::default();
        }
        let above = limits.outside_rad(begins_rad) > 0.0;
        let outwards = |delta_rad: f64| {
            if above { delta_rad > 0.0 } else { delta_rad < 0.0 }
        };
        let mut left = trajectory.strokes().iter().filter(|stroke| !stroke.has_ended(begin_s));
        let first = left.find(|stroke| outwards(stroke.delta_rad[joint]));
        Self { until_s: Some(first.map_or(f64::INFINITY, |stroke| stroke.start_s)), above }
    }

    /// What an interval that begins at `from_s` has to keep.
    fn permitted_rad(self, limits: &JointLimits, from_s: f64) -> [f64; 2] {
        let [low_rad, high_rad] = PermittedRange::new(limits).ends_rad();
        match (self.until_s, self.above) {
            (Some(until_s), true) if from_s < until_s => [low_rad, f64::INFINITY],
            (Some(until_s), false) if from_s < until_s => [f64::NEG_INFINITY, high_rad],
            (Some(_) | None, _) => [low_rad, high_rad],
        }
    }
}

/// An interval that is still to be proven.
#[derive(Clone, Copy, Default)]
struct Interval {
    from_s: f64,
    to_s: f64,
    depth: u32,
}

/// What a bound says about an interval.
enum IntervalResult {
    Holds,
    Halve,
    /// Not below the limit; the evidence says whether the limit is truly exceeded at the middle.
    Fails(LimitViolation),
}

impl<'a, const WIDTH: usize> Proof<'a, WIDTH> {
    pub(crate) fn new(
        trajectory: &'a Trajectory,
        limits: &'a [JointLimits; MAX_JOINTS],
        begin_s: f64,
    ) -> Self {
        let zero = [0.0; WIDTH];
        let mut base_rad = zero;
        add_scaled(&mut base_rad, trajectory.base_rad(), 1.0);
        let scales = scales(trajectory);
        Self {
            trajectory,
            limits,
            beside: beside(trajectory, &scales),
            scales,
            size: [zero; ORDERS + 1],
            running: [0; MAX_STROKES],
            running_count: 0,
            first: 0,
            ended_rad: base_rad,
            ended_size_rad: zero,
            reached_rad: base_rad,
            travelled_rad: zero,
            entries: core::array::from_fn(|joint| {
                let entry = |limits| Entry::new(joint, limits, (trajectory, begin_s));
                let limits = limits.get(joint).filter(|_| joint < trajectory.joints());
                limits.map_or_else(Entry::default, entry)
            }),
            met: [zero; 3],
            bound: [zero; 3],
            budget: 0,
        }
    }

    fn joint_limits(&self) -> impl Iterator<Item = (usize, &'a JointLimits)> + use<'a, WIDTH> {
        self.limits.iter().enumerate().take(self.trajectory.joints())
    }

    /// A trajectory without strokes still stands somewhere, a stroke may lead outwards from the start, and one that only
    /// leads inwards may not come far enough.
    fn check_ends(&self, begin_s: f64) -> Result<(), LimitViolation> {
        let begins_rad = self.trajectory.sample(begin_s).position_rad;
        let (end_s, end_rad) = (self.trajectory.duration_s(), self.trajectory.end_rad());
        for (joint, limits) in self.joint_limits() {
            let begin = self.position_fault(joint, limits, begins_rad[joint], [begin_s; 2]);
            let end = || self.position_fault(joint, limits, end_rad[joint], [f64::INFINITY, end_s]);
            if let Some(violation) = begin.or_else(end) {
                return Err(violation);
            }
        }
        Ok(())
    }

    fn position_fault(
        &self,
        joint: usize,
        limits: &JointLimits,
        value: f64,
        [from_s, at_s]: [f64; 2],
    ) -> Option<LimitViolation> {
        let permitted_rad = self.entries.get(joint)?.permitted_rad(limits, from_s);
        reach_fault(joint, limits, permitted_rad, (value, 0.0), at_s)
            .map(|violation| LimitViolation { proven: true, ..violation })
    }

    /// Collects what runs between two neighbouring edges; pieces come from left to right.
    pub(crate) fn enter(&mut self, from_s: f64, to_s: f64) {
        while let Some(stroke) = self.trajectory.strokes().get(self.first).filter(|s| s.has_ended(from_s)) {
            add_scaled(&mut self.ended_rad, &stroke.delta_rad, 1.0);
            add_magnitude(&mut self.ended_size_rad, &stroke.delta_rad, 1.0);
            self.first += 1;
        }
        (self.reached_rad, self.travelled_rad) = (self.ended_rad, self.ended_size_rad);
        self.size = [[0.0; WIDTH]; ORDERS + 1];
        self.running_count = 0;
        for (index, stroke) in self.trajectory.strokes().iter().enumerate().skip(self.first) {
            if stroke.start_s >= to_s {
                break;
            }
            if stroke.has_ended(from_s) {
                add_scaled(&mut self.reached_rad, &stroke.delta_rad, 1.0);
                add_magnitude(&mut self.travelled_rad, &stroke.delta_rad, 1.0);
                continue;
            }
            let Some(scales) = self.scales.get(index) else {
                continue;
            };
            for (size, scale) in self.size.iter_mut().zip(scales) {
                add_magnitude(size, &stroke.delta_rad, *scale);
            }
            if let (Some(slot), Ok(index)) = (self.running.get_mut(self.running_count), u16::try_from(index))
            {
                *slot = index;
                self.running_count += 1;
            }
        }
    }

    /// Exact derivatives at an instant of the current piece.
    fn jet(&mut self, t_s: f64) -> Jet<WIDTH> {
        let mut jet = [[0.0; WIDTH]; 5];
        jet[0] = self.reached_rad;
        for index in self.running.iter().take(self.running_count) {
            let Some(stroke) = self.trajectory.strokes().get(usize::from(*index)) else {
                continue;
            };
            let s = ((t_s - stroke.start_s) / stroke.duration_s).clamp(0.0, 1.0);
            let phi = Phi::at(stroke.n, s);
            let (rate, mut rate_k) = (1.0 / stroke.duration_s, 1.0);
            for (sum, phi) in jet.iter_mut().zip([phi.value, phi.d1, phi.d2, phi.d3, fourth(stroke.n, s)]) {
                add_scaled(sum, &stroke.delta_rad, phi * rate_k);
                rate_k *= rate;
            }
        }
        self.budget += self.running_count + INTERVAL_BUDGET;
        jet
    }

    /// Notes what is reached at one instant.
    fn note(&mut self, jet: &Jet<WIDTH>) {
        for (met, values) in self.met.iter_mut().zip(jet.iter().skip(1)) {
            for (met, value) in met.iter_mut().zip(values) {
                *met = met.max(value.abs());
            }
        }
    }

    /// Proves one piece from left to right, or finds its first violation.
    fn prove(&mut self, from_s: f64, to_s: f64) -> Result<(), LimitViolation> {
        let mut stack = [Interval::default(); DEPTH_MAX as usize + 2];
        stack[0] = Interval { from_s, to_s, depth: 0 };
        let mut count = 1_usize;
        let mut found: Option<LimitViolation> = None;
        while let Some(interval) = count.checked_sub(1).and_then(|top| stack.get(top).copied()) {
            count -= 1;
            let Interval { from_s, to_s, depth } = interval;
            let middle_s = 0.5 * (from_s + to_s);
            let may_halve =
                depth < DEPTH_MAX && self.budget < BUDGET_MAX && from_s < middle_s && middle_s < to_s;
            match self.check_interval(interval, may_halve) {
                IntervalResult::Holds => continue,
                IntervalResult::Fails(violation) if violation.proven => {
                    // What lies to the right is later; only the left half can hold an earlier one.
                    count = 0;
                    found = Some(violation);
                    if to_s - from_s < FIRST_S {
                        break;
                    }
                }
                IntervalResult::Fails(violation) if !may_halve => {
                    return Err(found.unwrap_or(violation));
                }
                IntervalResult::Fails(_) | IntervalResult::Halve => {
                    if found.is_some() && to_s - from_s < FIRST_S {
                        continue;
                    }
                    if let Some(slot) = stack.get_mut(count) {
                        *slot = Interval { from_s: middle_s, to_s, depth: depth + 1 };
                        count += 1;
                    }
                }
            }
            if let (true, Some(slot)) = (may_halve, stack.get_mut(count)) {
                *slot = Interval { from_s, to_s: middle_s, depth: depth + 1 };
                count += 1;
            }
        }
        found.map_or(Ok(()), |violation| Err(self.worst_near(violation)))
    }

    /// Bounds everything on one interval and compares it with the limits.
    fn check_interval(&mut self, interval: Interval, may_halve: bool) -> IntervalResult {
        let middle_s = 0.5 * (interval.from_s + interval.to_s);
        let half_s = (interval.to_s - middle_s).max(middle_s - interval.from_s);
        let jet = self.jet(middle_s);
        self.note(&jet);
        let mut fails = None;
        let mut coarse = false;
        let mut bounds = [[0.0; WIDTH]; 3];
        for (joint, limits) in self.joint_limits() {
            let position_rad = jet[0][joint];
            let rounding = ROUNDING * (position_rad.abs() + self.travelled_rad[joint] + self.size[0][joint]);
            let reach_rad = self.beyond(&jet, 0, joint, half_s) + rounding + self.beside[0][joint];
            let instants_s = [interval.from_s, middle_s];
            if let Some(violation) = self.position_fault(joint, limits, position_rad, instants_s) {
                return IntervalResult::Fails(violation);
            }
            let permitted_rad = self.entries[joint].permitted_rad(limits, interval.from_s);
            fails = fails.or(reach_fault(joint, limits, permitted_rad, (position_rad, reach_rad), middle_s));
            for (rate, quantity) in RATES.into_iter().enumerate() {
                let value = jet[rate + 1][joint].abs();
                let bound = value
                    + self.beyond(&jet, rate + 1, joint, half_s)
                    + ROUNDING * self.size[rate + 1][joint]
                    + self.beside[rate + 1][joint];
                let limit = limit_of(limits, quantity);
                let evidence =
                    |value, proven| LimitViolation { joint, quantity, at_s: middle_s, value, limit, proven };
                if !within(value, limit * (1.0 + TOLERANCE)) {
                    return IntervalResult::Fails(evidence(value, true));
                }
                if !within(bound, limit * (1.0 + TOLERANCE)) {
                    fails = fails.or(Some(evidence(bound, false)));
                }
                let met = self.met[rate][joint];
                coarse |= bound > (met * (1.0 + RESOLUTION)).max(limit * PEAK_FLOOR);
                bounds[rate][joint] = bound;
            }
        }
        if let Some(violation) = fails {
            return IntervalResult::Fails(violation);
        }
        if coarse && may_halve && self.budget < PEAK_BUDGET {
            return IntervalResult::Halve;
        }
        for (bound, new) in self.bound.iter_mut().zip(&bounds) {
            for (bound, new) in bound.iter_mut().zip(new) {
                *bound = bound.max(*new);
            }
        }
        IntervalResult::Holds
    }

    /// How far the k-th derivative can go from its value at the middle, without rounding.
    fn beyond(&self, jet: &Jet<WIDTH>, k: usize, joint: usize, half_s: f64) -> f64 {
        let (mut sum, mut factor, mut order) = (0.0, 1.0, 1.0);
        for derivative in jet.iter().skip(k + 1) {
            factor *= half_s / order;
            order += 1.0;
            sum += derivative[joint].abs() * factor;
        }
        sum + self.size[5][joint] * factor * half_s / order
    }

    /// How many joints the arm has.
    pub(crate) fn joints(&self) -> usize {
        self.trajectory.joints()
    }

    /// Proven lowest and highest velocity, acceleration and jerk of each joint within `half_s` of an instant, inside the
    /// current piece; zero for those that the arm does not have.
    pub(crate) fn ranges(&mut self, middle_s: f64, half_s: f64) -> [[[f64; 2]; 3]; WIDTH] {
        let jet = self.jet(middle_s);
        let mut ranges = [[[0.0; 2]; 3]; WIDTH];
        for (joint, ranges) in ranges.iter_mut().enumerate().take(self.joints()) {
            for (rate, range) in ranges.iter_mut().enumerate() {
                let value = jet[rate + 1][joint];
                let reach =
                    self.beyond(&jet, rate + 1, joint, half_s) + ROUNDING * self.size[rate + 1][joint];
                *range = [value - reach, value + reach];
            }
        }
        ranges
    }

    /// Walks uphill from the beginning of a violation to its worst instant, so that the evidence shows how bad it is.
    fn worst_near(&self, first: LimitViolation) -> LimitViolation {
        let mut worst = first;
        let mut step_s = FIRST_S;
        let side = libm::copysign(1.0, first.value - first.limit);
        for _ in 0..64 {
            let at_s = worst.at_s + step_s;
            let setpoint = self.trajectory.sample(at_s);
            let value = match first.quantity {
                Quantity::Position => setpoint.position_rad,
                Quantity::Velocity => setpoint.velocity_rad_s,
                Quantity::Acceleration => setpoint.acceleration_rad_s2,
                Quantity::Jerk => setpoint.jerk_rad_s3,
            }[first.joint];
            let value = if first.quantity == Quantity::Position { value } else { value.abs() };
            // Before the first violation lies what is permitted: the way in of a joint that began outside.
            if at_s >= first.at_s && side * (value - worst.value) > 0.0 && value.is_finite() {
                worst = LimitViolation { at_s, value, ..worst };
                step_s *= 2.0;
            } else {
                step_s *= -0.5; // A long step may have gone over the top: look back.
            }
        }
        worst
    }

    fn peaks(&self) -> Peaks {
        let [velocity_rad_s, acceleration_rad_s2, jerk_rad_s3] = self.bound.map(joint_array);
        Peaks { velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 }
    }
}

/// False for a NaN on either side, so that what is no number never passes.
fn within(value: f64, limit: f64) -> bool {
    value <= limit
}

fn scales(trajectory: &Trajectory) -> [[f64; ORDERS + 1]; MAX_STROKES] {
    let mut scales = [[0.0; ORDERS + 1]; MAX_STROKES];
    let mut known = (0, [0.0; ORDERS + 1]);
    for (scales, stroke) in scales.iter_mut().zip(trajectory.strokes()) {
        if known.0 != stroke.n {
            known = (stroke.n, bounds(stroke.n));
        }
        let (rate, mut rate_k) = (1.0 / stroke.duration_s, 1.0);
        for (scale, bound) in scales.iter_mut().zip(known.1) {
            *scale = rate_k * bound;
            rate_k *= rate;
        }
    }
    scales
}

/// What can happen to position, velocity, acceleration and jerk between two edges that differ by rounding.
fn beside<const WIDTH: usize>(
    trajectory: &Trajectory,
    scales: &[[f64; ORDERS + 1]; MAX_STROKES],
) -> [[f64; WIDTH]; 4] {
    let width_s = EDGE_ROUNDING * trajectory.duration_s();
    let mut beside = [[0.0; WIDTH]; 4];
    for (stroke, scales) in trajectory.strokes().iter().zip(scales) {
        for (beside, scale) in beside.iter_mut().zip(scales.iter().skip(1)) {
            add_magnitude(beside, &stroke.delta_rad, width_s * scale);
        }
    }
    beside
}

fn limit_of(limits: &JointLimits, quantity: Quantity) -> f64 {
    match quantity {
        Quantity::Position => limits.position_rad[1],
        Quantity::Velocity => limits.motion.velocity_rad_s,
        Quantity::Acceleration => limits.motion.acceleration_rad_s2,
        Quantity::Jerk => limits.motion.jerk_rad_s3,
    }
}

/// The position limit that an angle with a reach to both sides may break.
fn reach_fault(
    joint: usize,
    limits: &JointLimits,
    permitted_rad: [f64; 2],
    (middle_rad, reach_rad): (f64, f64),
    at_s: f64,
) -> Option<LimitViolation> {
    let [low_rad, high_rad] = limits.position_rad;
    let fault = |value, limit| {
        Some(LimitViolation { joint, quantity: Quantity::Position, at_s, value, limit, proven: false })
    };
    if !within(middle_rad + reach_rad, permitted_rad[1]) {
        return fault(middle_rad + reach_rad, high_rad);
    }
    if !within(permitted_rad[0], middle_rad - reach_rad) {
        return fault(middle_rad - reach_rad, low_rad);
    }
    None
}

/// phi''''(s) = n u^(n-4) (24 u^3 - 816 (n-1) x u^2 + 1152 (n-1)(n-2) x^2 u - 256 (n-1)(n-2)(n-3) x^3), x = s^4.
fn fourth(n: u32, s: f64) -> f64 {
    let m = f64::from(n);
    let x = s * s * s * s;
    let u = 1.0 - x;
    let (a, b, c) = (m - 1.0, m - 2.0, m - 3.0);
    let inner = 24.0 * u * u * u - a * x * (816.0 * u * u - b * x * (1152.0 * u - 256.0 * c * x));
    m * power(u, n.saturating_sub(4)) * inner
}

/// Joints of the arm that both arrays have slots for.
#[inline(always)]
fn add_scaled<const WIDTH: usize, const SLOTS: usize>(
    sum: &mut [f64; WIDTH],
    value: &[f64; SLOTS],
    factor: f64,
) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += value * factor;
    }
}

/// The same with magnitudes.
#[inline(always)]
fn add_magnitude<const WIDTH: usize, const SLOTS: usize>(
    sum: &mut [f64; WIDTH],
    value: &[f64; SLOTS],
    factor: f64,
) {
    for (sum, value) in sum.iter_mut().zip(value) {
        *sum += value.abs() * factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Quantity;
    use crate::stroke::{N_MAX, N_MIN};
    use crate::{LimitSet, Stroke};

    /// Goal: the bound of an interval holds for every instant of it, for every quantity, and is no wider than needed.
    /// Method: single strokes of every n, intervals of every width and place; a dense scan against the bound. Where the
    /// lower derivatives vanish the remainder decides alone: it must be needed there to a good part.
    #[test]
    fn interval_bounds_hold_against_a_dense_scan_and_need_their_remainder() {
        let limits = [JointLimits {
            position_rad: [-9.0, 9.0],
            motion: LimitSet::default(),
            ..JointLimits::default()
        }; MAX_JOINTS];
        let mut remainder_needed: f64 = 0.0;
        for n in (N_MIN..=N_MAX).step_by(5) {
            let mut delta_rad = [0.0; MAX_JOINTS];
            delta_rad[0] = 1.0;
            let stroke = Stroke { start_s: 0.0, duration_s: 1.0, n, delta_rad };
            let trajectory = Trajectory::new(1, [0.0; MAX_JOINTS], &[stroke]).unwrap();
            let mut proof = Proof::<USUAL_JOINTS>::new(&trajectory, &limits, 0.0);
            proof.enter(0.0, 1.0);
            for place in 1..200 {
                let middle_s = f64::from(place) / 200.0;
                let jet = proof.jet(middle_s);
                for half_s in [0.4, 0.1, 0.03, 0.01, 0.003] {
                    if middle_s - half_s < 0.0 || middle_s + half_s > 1.0 {
                        continue;
                    }
                    for k in 0..4 {
                        let bound = proof.beyond(&jet, k, 0, half_s);
                        let mut most: f64 = 0.0;
                        for step in 0..=40 {
                            let t_s = middle_s + half_s * (f64::from(step) / 20.0 - 1.0);
                            most = most.max((proof.jet(t_s)[k][0] - jet[k][0]).abs());
                        }
                        assert!(
                            most <= bound * (1.0 + 1e-9) + 1e-9,
                            "n {n}, derivative {k} at {middle_s} +- {half_s}: {most} above {bound}"
                        );
                        let lower: f64 = (k + 1..5)
                            .fold((0.0, 1.0, 1.0), |(sum, factor, order), next| {
                                let factor = factor * half_s / order;
                                (sum + jet[next][0].abs() * factor, factor, order + 1.0)
                            })
                            .0;
                        remainder_needed = remainder_needed.max((most - lower) / (bound - lower).max(1e-12));
                    }
                }
            }
        }
        assert!(remainder_needed > 0.2, "a fifth of the remainder would do: {remainder_needed}");
        assert_eq!(limit_of(&limits[0], Quantity::Position).to_bits(), 9.0_f64.to_bits());
    }
}
