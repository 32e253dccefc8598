//! Polynomials on an interval, and proven bounds of them.
//!
//! In Bernstein form a polynomial lies between its least and its greatest control value, and its first and last control
//! values are reached. Halving the interval brings the control values as near to the polynomial as is needed.
use crate::profile_derivatives::{ORDER, ORDERS};

/// Most halvings.
const DEPTH_MAX: usize = 20;
/// Rounding of a conversion and of halvings, relative to the sum of the coefficients: binomials up to 3^8 times some ten roundings.
pub(crate) const CONVERSION: f64 = 1e-10;
/// Bounds of magnitudes are at most this much above a value that is reached, relatively.
pub(crate) const RESOLUTION: f64 = 1e-3;

/// A polynomial in Bernstein form.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Polynomial {
    control: [f64; ORDERS],
    degree: usize,
}

/// What is known of |p| on the interval.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Magnitude {
    /// The highest that was met.
    pub(crate) met: f64,
    /// None is above it.
    pub(crate) bound: f64,
}

impl Polynomial {
    /// From the coefficients of x^i on [-1, 1]; those above `degree` are 0.
    pub(crate) fn new(mut taylor: [f64; ORDERS], degree: usize) -> Self {
        let degree = degree.min(ORDER);
        // p(2 y - 1) on [0, 1]: shifted by one, then stretched by two.
        for round in 0..degree {
            for i in (round..degree).rev() {
                taylor[i] -= taylor[i + 1];
            }
        }
        // c_i / C(degree, i), whose sums along Pascal's triangle are the control values.
        let (mut stretch, mut binomial) = (1.0, 1.0);
        for (i, coefficient) in taylor.iter_mut().enumerate().take(degree + 1) {
            *coefficient *= stretch / binomial;
            stretch *= 2.0;
            binomial *= count(degree - i) / count(i + 1);
        }
        for round in 0..degree {
            for i in (round + 1..=degree).rev() {
                taylor[i] += taylor[i - 1];
            }
        }
        Self { control: taylor, degree }
    }

    fn control(&self) -> &[f64] {
        self.control.get(..=self.degree).unwrap_or(&[])
    }

    /// No value is outside.
    fn hull(&self) -> [f64; 2] {
        let low_high = |[low, high]: [f64; 2], value: &f64| [low.min(*value), high.max(*value)];
        self.control().iter().fold([f64::INFINITY, f64::NEG_INFINITY], low_high)
    }

    /// The values at both ends.
    fn ends(&self) -> [f64; 2] {
        [self.control[0], self.control.get(self.degree).copied().unwrap_or(f64::NAN)]
    }

    /// The same on each half of the interval (de Casteljau).
    fn halves(mut self) -> [Self; 2] {
        let mut left = self;
        for round in 1..=self.degree {
            for i in 0..=self.degree - round {
                self.control[i] = 0.5 * (self.control[i] + self.control[i + 1]);
            }
            left.control[round] = self.control[0];
        }
        [left, self]
    }

    /// Proves that every value is inside a range, and bounds the magnitude: sharply where it is above both what was met and
    /// `floor`. `None` when a value is outside, or cannot be proven to be inside. `budget` grows with the work.
    pub(crate) fn proven(
        self,
        [low, high]: [f64; 2],
        (met, floor): (f64, f64),
        budget: &mut usize,
    ) -> Option<Magnitude> {
        let mut found = Magnitude { met, bound: 0.0 };
        let mut stack = [(Self::default(), 0); DEPTH_MAX + 2];
        stack[0] = (self, 0);
        let mut left = 1_usize;
        while let Some((piece, depth)) = left.checked_sub(1).and_then(|top| stack.get(top).copied()) {
            left -= 1;
            *budget += 1;
            let [least, greatest] = piece.hull();
            let ends = piece.ends();
            // Written so that what is no number is outside.
            let inside = |value: f64| low <= value && value <= high;
            if !ends.into_iter().all(inside) {
                return None;
            }
            found.met = ends.into_iter().fold(found.met, |met, end| met.max(end.abs()));
            let most = least.abs().max(greatest.abs());
            let is_sharp = most <= (found.met * (1.0 + RESOLUTION)).max(floor);
            let holds = inside(least) && inside(greatest);
            if holds && (is_sharp || depth == DEPTH_MAX) {
                found.bound = found.bound.max(most);
                continue;
            }
            if depth == DEPTH_MAX {
                return None;
            }
            for half in piece.halves() {
                *stack.get_mut(left)? = (half, depth + 1);
                left += 1;
            }
        }
        Some(found)
    }
}

#[expect(clippy::cast_precision_loss, reason = "at most 9")]
fn count(n: usize) -> f64 {
    n as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(taylor: &[f64; ORDERS], x: f64) -> f64 {
        taylor.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
    }

    /// Pseudo-random coefficients of a degree, some of them large.
    fn taylor(seed: u32, degree: usize) -> [f64; ORDERS] {
        core::array::from_fn(|i| {
            let part =
                (f64::from(seed) * 0.618_034 + f64::from(u32::try_from(i).unwrap()) * 0.414_214).fract();
            if i <= degree { (part - 0.5) * f64::from(1 + seed % 7) } else { 0.0 }
        })
    }

    /// Goal: bounds hold everywhere and are sharp; a range that some value leaves is never proven. Method: random polynomials of every degree
    /// against a dense scan.
    #[test]
    fn bounds_hold_against_a_dense_scan_and_are_sharp() {
        for seed in 0..4_000 {
            let degree = 1 + seed as usize % ORDER;
            let taylor = taylor(seed, degree);
            let polynomial = Polynomial::new(taylor, degree);
            let scan = (0..=2_000).map(|i| value(&taylor, f64::from(i) / 1_000.0 - 1.0));
            let most = scan.map(f64::abs).fold(0.0, f64::max);
            let mut budget = 0;
            let wide = [-2.0 * most - 1.0, 2.0 * most + 1.0];
            let found = polynomial.proven(wide, (0.0, 0.0), &mut budget).unwrap();
            assert!(found.bound >= most * (1.0 - 1e-12), "seed {seed}: {found:?} below {most}");
            assert!(found.bound <= most * (1.0 + 2.0 * RESOLUTION), "seed {seed}: {found:?} above {most}");
            assert!(found.met <= most * (1.0 + 1e-6), "seed {seed}: {found:?} was never met, {most}");
            let tight = most * (1.0 + 1e-4);
            assert!(
                polynomial.proven([-tight, tight], (0.0, most), &mut budget).is_some(),
                "seed {seed}: {most}"
            );
            let broken = most * (1.0 - 1e-4);
            assert!(
                polynomial.proven([-broken, broken], (0.0, most), &mut budget).is_none(),
                "seed {seed}: {most}"
            );
        }
    }

    #[test]
    fn what_is_no_number_is_never_proven() {
        for bad in [f64::NAN, f64::INFINITY] {
            let mut taylor = [0.0; ORDERS];
            taylor[2] = bad;
            let proven = Polynomial::new(taylor, 4).proven([-1.0, 1.0], (0.0, 0.0), &mut 0);
            assert_eq!(proven, None);
        }
    }
}
