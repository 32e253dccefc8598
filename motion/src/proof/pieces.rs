//! Whole pieces of a trajectory, proven by one Taylor polynomial a joint.
//!
//! Between two edges a trajectory is one polynomial of high degree. Its derivatives at one instant, up to the eighth, make a polynomial
//! that leaves out at most M9 H^(9-k)/(9-k)! of the k-th derivative, where M9 bounds the ninth. What it does is bounded in Bernstein form,
//! without another look at the strokes. Parts that a limit or a peak needs more sharply are halved.
use super::{
    INTERVAL_BUDGET, PEAK_BUDGET, PEAK_FLOOR, Proof, RATES, ROUNDING, add_magnitude, add_scaled, limit_of,
};
use crate::JointLimits;
use crate::limits::TOLERANCE;
use crate::polynomial::{CONVERSION, Polynomial, RESOLUTION};
use crate::profile_derivatives::{ORDER, ORDERS, derivatives};
use crate::range::PermittedRange;

/// What a Taylor polynomial may leave out, as a part of each limit: where it is tried first ..
const LEFT_OUT: f64 = 0.1;
/// .. and below which halving its part of the piece does not help.
const LEFT_OUT_LEAST: f64 = 1e-4;
/// Most parts of a piece that are tried first, and most halvings of each.
const PARTS_MAX: usize = 256;
const HALVINGS_MAX: usize = 8;
/// Most evaluations of a stroke that the polynomials of a piece may take together.
const PARTS_BUDGET: usize = 8192;

/// What the polynomials say about a part of a piece.
enum PartResult {
    Holds,
    /// They leave out too much.
    Halve,
    Fails,
}

impl<const WIDTH: usize> Proof<'_, WIDTH> {
    /// Proves one piece by Taylor polynomials; false when they do not suffice.
    pub(super) fn holds_by_polynomials(&mut self, from_s: f64, to_s: f64) -> bool {
        if self.entries.iter().any(|entry| entry.until_s.is_some()) {
            return false;
        }
        let Some(parts) = self.parts(0.5 * (to_s - from_s)) else {
            return false;
        };
        let most = self.budget + PARTS_BUDGET;
        let mut begin_s = from_s;
        for part in 1..=parts {
            #[expect(clippy::cast_precision_loss, reason = "at most 256")]
            let share = part as f64 / parts as f64;
            let end_s = if part == parts { to_s } else { from_s + share * (to_s - from_s) };
            if !self.holds_by_halves([begin_s, end_s], most) {
                return false;
            }
            begin_s = end_s;
        }
        true
    }

    /// Proves a part of a piece, or its halves.
    fn holds_by_halves(&mut self, part: [f64; 2], budget_max: usize) -> bool {
        let mut stack = [([0.0; 2], 0); HALVINGS_MAX + 2];
        stack[0] = (part, 0);
        let mut left = 1_usize;
        while let Some((part, depth)) = left.checked_sub(1).and_then(|top| stack.get(top).copied()) {
            left -= 1;
            match self.part_holds(part) {
                PartResult::Holds => {}
                PartResult::Fails => return false,
                PartResult::Halve if depth == HALVINGS_MAX || self.budget > budget_max => {
                    return false;
                }
                PartResult::Halve => {
                    let middle_s = 0.5 * (part[0] + part[1]);
                    for half in [[middle_s, part[1]], [part[0], middle_s]] {
                        let Some(slot) = stack.get_mut(left) else {
                            return false;
                        };
                        (*slot, left) = ((half, depth + 1), left + 1);
                    }
                }
            }
        }
        true
    }

    /// Into how many parts a piece is cut so that a Taylor polynomial leaves out little of each.
    fn parts(&self, half_s: f64) -> Option<usize> {
        let most = PARTS_MAX.min(PARTS_BUDGET / self.running_count.max(1));
        let mut parts = 1;
        while parts <= most {
            #[expect(clippy::cast_precision_loss, reason = "at most 256")]
            let powers = powers(half_s / parts as f64);
            let fits = self.joint_limits().all(|(joint, limits)| {
                RATES.into_iter().zip(powers.iter().rev().skip(1)).all(|(quantity, power)| {
                    self.size[ORDERS][joint] * power <= LEFT_OUT * limit_of(limits, quantity)
                })
            });
            if fits {
                return Some(parts);
            }
            parts *= 2;
        }
        None
    }

    /// Bounds everything on one part of a piece, from its derivatives in the middle.
    fn part_holds(&mut self, [from_s, to_s]: [f64; 2]) -> PartResult {
        let middle_s = 0.5 * (from_s + to_s);
        let half_s = (to_s - middle_s).max(middle_s - from_s);
        let powers = powers(half_s);
        let jets = self.high_jets(middle_s);
        let mut bounds = [[0.0; WIDTH]; 3];
        for order in (0..4).rev() {
            let mut taylor = [[0.0; WIDTH]; ORDERS];
            let mut beyond = self.beside[order];
            if order == 0 {
                add_magnitude(&mut beyond, &jets[0], ROUNDING);
                add_scaled(&mut beyond, &self.travelled_rad, ROUNDING);
            }
            let derivatives = jets.iter().zip(&self.size).skip(order);
            for ((coefficients, (jet, size)), power) in taylor.iter_mut().zip(derivatives).zip(powers) {
                add_scaled(coefficients, jet, power);
                add_scaled(&mut beyond, size, ROUNDING * power);
                add_magnitude(&mut beyond, coefficients, CONVERSION);
            }
            for (joint, limits) in self.joint_limits() {
                let taylor = taylor.map(|coefficients| coefficients[joint]);
                let left_out = self.size[ORDERS][joint] * powers[ORDERS - order];
                let beyond = beyond[joint] + left_out;
                let Some(rate) = order.checked_sub(1) else {
                    if Self::position_holds(limits, taylor, beyond, &mut self.budget) {
                        continue;
                    }
                    return PartResult::Fails;
                };
                match self.rate_bound((joint, limits), rate, taylor, (beyond, left_out)) {
                    Ok(bound) => bounds[rate][joint] = bound,
                    Err(result) => return result,
                }
            }
        }
        for (bound, new) in self.bound.iter_mut().flatten().zip(bounds.iter().flatten()) {
            *bound = bound.max(*new);
        }
        PartResult::Holds
    }

    fn position_holds(limits: &JointLimits, taylor: [f64; ORDERS], beyond: f64, budget: &mut usize) -> bool {
        let [low_rad, high_rad] = PermittedRange::new(limits).ends_rad();
        let range_rad = [low_rad + beyond, high_rad - beyond];
        let reach_rad: f64 = taylor.iter().skip(1).map(|coefficient| coefficient.abs()).sum();
        let inside = range_rad[0] <= taylor[0] - reach_rad && taylor[0] + reach_rad <= range_rad[1];
        inside || Polynomial::new(taylor, ORDER).proven(range_rad, (0.0, f64::INFINITY), budget).is_some()
    }

    /// A bound of one joint's velocity, acceleration or jerk, or what to do without one.
    fn rate_bound(
        &mut self,
        (joint, limits): (usize, &JointLimits),
        rate: usize,
        taylor: [f64; ORDERS],
        (beyond, left_out): (f64, f64),
    ) -> Result<f64, PartResult> {
        let Some(quantity) = RATES.get(rate) else {
            return Err(PartResult::Fails);
        };
        let limit = limit_of(limits, *quantity);
        let most = limit * (1.0 + TOLERANCE) - beyond;
        let (met, floor) = (self.met[rate][joint], limit * PEAK_FLOOR);
        let sum: f64 = taylor.iter().map(|coefficient| coefficient.abs()).sum();
        if sum <= most && sum + beyond <= met.max(floor) {
            return Ok(sum + beyond);
        }
        let polynomial = Polynomial::new(taylor, ORDER - 1 - rate);
        let is_fine = left_out <= LEFT_OUT_LEAST * limit;
        let Some(found) = polynomial.proven([-most, most], (met, floor), &mut self.budget) else {
            return Err(if is_fine { PartResult::Fails } else { PartResult::Halve });
        };
        self.met[rate][joint] = found.met;
        let bound = found.bound + beyond;
        let is_sharp = bound <= (found.met * (1.0 + 2.0 * RESOLUTION)).max(floor);
        if is_sharp || is_fine || self.budget > PEAK_BUDGET { Ok(bound) } else { Err(PartResult::Halve) }
    }

    /// q and its derivatives up to the eighth at an instant of the current piece.
    fn high_jets(&mut self, t_s: f64) -> [[f64; WIDTH]; ORDERS] {
        let mut jets = [[0.0; WIDTH]; ORDERS];
        jets[0] = self.reached_rad;
        for index in self.running.iter().take(self.running_count) {
            let Some(stroke) = self.trajectory.strokes().get(usize::from(*index)) else {
                continue;
            };
            let s = ((t_s - stroke.start_s) / stroke.duration_s).clamp(0.0, 1.0);
            let (rate, mut rate_k) = (1.0 / stroke.duration_s, 1.0);
            for (sum, phi) in jets.iter_mut().zip(derivatives(stroke.n, s)) {
                add_scaled(sum, &stroke.delta_rad, phi * rate_k);
                rate_k *= rate;
            }
        }
        self.budget += 2 * self.running_count + INTERVAL_BUDGET;
        jets
    }
}

/// H^i / i! for i from 0.
fn powers(half_s: f64) -> [f64; ORDERS + 1] {
    let (mut power, mut order) = (1.0, 0.0);
    [(); ORDERS + 1].map(|()| {
        let now = power;
        order += 1.0;
        power *= half_s / order;
        now
    })
}
