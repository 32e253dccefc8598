//! A clamped cubic spline through knots: the interpolator that seed paper 000 compares with.
//!
//! Velocity and acceleration are continuous, the velocity is zero at both ends; the acceleration is not, and the
//! jerk jumps at every knot. It is here for comparison, and never goes to an arm.
//!
//! Source: de Boor, A Practical Guide to Splines, chapter IV (clamped end conditions).
use crate::peaks::PeakConstants;
use crate::profile::Profile;
use crate::stroke::Phi;

/// Most knots of a spline.
pub const KNOTS_MAX: usize = 64;

/// A clamped cubic spline: values at increasing times, at rest at both ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClampedSpline {
    time_s: [f64; KNOTS_MAX],
    value: [f64; KNOTS_MAX],
    /// Second derivative by time at each knot.
    bend: [f64; KNOTS_MAX],
    count: usize,
}

/// Why knots do not make a spline.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    /// Too few or too many.
    #[error("{knots} knots; a spline takes 2 to {KNOTS_MAX}")]
    KnotCount {
        /// The count that was given.
        knots: usize,
    },
    /// A number is NaN or infinite.
    #[error("knot {knot} is not finite")]
    NotFinite {
        /// Zero-based index of the knot.
        knot: usize,
    },
    /// Times do not increase.
    #[error("knot {knot} is not later than the one in front of it")]
    NotIncreasing {
        /// Zero-based index of the later knot.
        knot: usize,
    },
}

impl ClampedSpline {
    /// Lays the spline through knots (time in s, value in any unit).
    ///
    /// # Errors
    /// The first fault of the knots.
    pub fn new(knots: &[(f64, f64)]) -> Result<Self, SplineError> {
        if !(2..=KNOTS_MAX).contains(&knots.len()) {
            return Err(SplineError::KnotCount { knots: knots.len() });
        }
        let mut spline = Self {
            time_s: [0.0; KNOTS_MAX],
            value: [0.0; KNOTS_MAX],
            bend: [0.0; KNOTS_MAX],
            count: knots.len(),
        };
        let mut last_s = f64::NEG_INFINITY;
        for (knot, &(time_s, value)) in knots.iter().enumerate() {
            if !(time_s.is_finite() && value.is_finite()) {
                return Err(SplineError::NotFinite { knot });
            }
            if time_s <= last_s {
                return Err(SplineError::NotIncreasing { knot });
            }
            last_s = time_s;
            spline.time_s[knot] = time_s;
            spline.value[knot] = value;
        }
        spline.bend = spline.solve_bend();
        Ok(spline)
    }

    /// When the first and the last knot are (s).
    #[must_use]
    pub fn span_s(&self) -> [f64; 2] {
        [self.time_s[0], self.time_s[self.count - 1]]
    }

    /// Value and derivatives by time; `t_s` is clamped to the span.
    #[must_use]
    pub fn sample(&self, t_s: f64) -> Phi {
        let [first_s, last_s] = self.span_s();
        let t_s = t_s.clamp(first_s, last_s);
        let after = self.time_s[..self.count].partition_point(|knot_s| *knot_s <= t_s);
        self.piece(after.clamp(1, self.count - 1), t_s)
    }

    /// The piece that ends at a knot, at a time inside it.
    fn piece(&self, knot: usize, t_s: f64) -> Phi {
        let (h, slope) = self.chord(knot);
        let (m0, m1) = (self.bend[knot - 1], self.bend[knot]);
        let t = t_s - self.time_s[knot - 1];
        let d3 = (m1 - m0) / h;
        let v0 = slope - h * (2.0 * m0 + m1) / 6.0;
        Phi {
            value: self.value[knot - 1] + t * (v0 + t * (0.5 * m0 + t * d3 / 6.0)),
            d1: v0 + t * (m0 + t * 0.5 * d3),
            d2: m0 + t * d3,
            d3,
        }
    }

    /// Length and slope of the chord that ends at a knot.
    fn chord(&self, knot: usize) -> (f64, f64) {
        let h = self.time_s[knot] - self.time_s[knot - 1];
        (h, (self.value[knot] - self.value[knot - 1]) / h)
    }

    /// Second derivatives at the knots: one tridiagonal system, diagonally dominant, so elimination needs no pivot.
    fn solve_bend(&self) -> [f64; KNOTS_MAX] {
        let last = self.count - 1;
        let (mut upper, mut bend) = ([0.0; KNOTS_MAX], [0.0; KNOTS_MAX]);
        for knot in 0..self.count {
            // Zero velocity beyond both ends takes the place of the missing chord.
            let (h0, slope0) = if knot > 0 { self.chord(knot) } else { (0.0, 0.0) };
            let (h1, slope1) = if knot < last { self.chord(knot + 1) } else { (0.0, 0.0) };
            let (above, before) = if knot > 0 { (upper[knot - 1], bend[knot - 1]) } else { (0.0, 0.0) };
            let pivot = 2.0 * (h0 + h1) - h0 * above;
            upper[knot] = h1 / pivot;
            bend[knot] = (6.0 * (slope1 - slope0) - h0 * before) / pivot;
        }
        for knot in (0..last).rev() {
            bend[knot] -= upper[knot] * bend[knot + 1];
        }
        bend
    }
}

impl Profile for ClampedSpline {
    /// The spline over its own span: derivatives are by s = (t - first)/(last - first), values are the knots'.
    fn at(&self, s: f64) -> Phi {
        let [first_s, last_s] = self.span_s();
        let span_s = last_s - first_s;
        let s = s.clamp(0.0, 1.0);
        // The end is met exactly, so that clamped means clamped.
        let phi = self.sample(if s < 1.0 { first_s + s * span_s } else { last_s });
        let rest = if s > 0.0 && s < 1.0 { phi.d1 * span_s } else { 0.0 };
        Phi {
            value: phi.value,
            d1: rest,
            d2: phi.d2 * span_s * span_s,
            d3: phi.d3 * span_s * span_s * span_s,
        }
    }

    /// Exact: the jerk is constant on a piece, the acceleration linear, and the velocity peaks at a knot or where
    /// the acceleration is zero.
    fn peaks(&self) -> PeakConstants {
        let [first_s, last_s] = self.span_s();
        let span_s = last_s - first_s;
        let mut peaks = PeakConstants::default();
        for knot in 1..self.count {
            let (from_s, to_s) = (self.time_s[knot - 1], self.time_s[knot]);
            let start = self.piece(knot, from_s);
            let turn_s = from_s - start.d2 / start.d3;
            // A turn that does not exist is NaN or outside; the start of the piece then counts twice.
            let turn_s = if turn_s > from_s && turn_s < to_s { turn_s } else { from_s };
            for t_s in [from_s, turn_s, to_s] {
                let (phi, s) = (self.piece(knot, t_s), (t_s - first_s) / span_s);
                let (v, a, j) = (
                    phi.d1.abs() * span_s,
                    phi.d2 * span_s * span_s,
                    phi.d3.abs() * span_s * span_s * span_s,
                );
                if v > peaks.c_v {
                    (peaks.c_v, peaks.s_v) = (v, s);
                }
                if a.abs() > peaks.c_a {
                    (peaks.c_a, peaks.s_a) = (a.abs(), s);
                }
                if j > peaks.c_j {
                    (peaks.c_j, peaks.s_j) = (j, s);
                }
                peaks.c_a_positive = peaks.c_a_positive.max(a);
                peaks.c_a_negative = peaks.c_a_negative.max(-a);
            }
        }
        peaks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The knots of figure 1 of seed paper 000.
    const FIGURE_1: [(f64, f64); 5] =
        [(0.0, 0.0), (100.0, 300.0), (200.0, 200.0), (300.0, -300.0), (400.0, -700.0)];

    #[test]
    fn spline_through_figure_1_ends_with_the_published_accelerations() {
        let spline = ClampedSpline::new(&FIGURE_1).unwrap();
        // Five digits, as our digest of the paper has them.
        assert!((spline.sample(0.0).d2 - 0.131_79).abs() < 5e-6, "{:?}", spline.sample(0.0));
        assert!((spline.sample(400.0).d2 - 0.123_21).abs() < 5e-6, "{:?}", spline.sample(400.0));
    }

    #[test]
    fn spline_at_its_knots_meets_values_and_joins_twice_smoothly() {
        let spline = ClampedSpline::new(&FIGURE_1).unwrap();
        for (knot, &(time_s, value)) in FIGURE_1.iter().enumerate() {
            assert!((spline.sample(time_s).value - value).abs() < 1e-10);
            if (1..FIGURE_1.len() - 1).contains(&knot) {
                let (left, right) = (spline.piece(knot, time_s), spline.piece(knot + 1, time_s));
                assert!((left.d1 - right.d1).abs() < 1e-12 && (left.d2 - right.d2).abs() < 1e-12);
                assert!((left.d3 - right.d3).abs() > 1e-6, "a spline of this kind has jumping jerk");
            }
        }
        assert!(spline.sample(0.0).d1.abs() < 1e-12 && spline.sample(400.0).d1.abs() < 1e-12);
    }

    #[test]
    fn spline_peaks_are_those_of_a_dense_scan() {
        let spline = ClampedSpline::new(&FIGURE_1).unwrap();
        let peaks = spline.peaks();
        let mut seen = PeakConstants::default();
        for step in 0..=100_000 {
            let phi = spline.at(f64::from(step) / 100_000.0);
            seen.c_v = seen.c_v.max(phi.d1.abs());
            seen.c_a = seen.c_a.max(phi.d2.abs());
            seen.c_j = seen.c_j.max(phi.d3.abs());
        }
        for (peak, seen) in [(peaks.c_v, seen.c_v), (peaks.c_a, seen.c_a), (peaks.c_j, seen.c_j)] {
            assert!(seen <= peak * (1.0 + 1e-12) && seen > peak * (1.0 - 1e-6), "{seen} against {peak}");
        }
    }

    #[test]
    fn spline_of_two_knots_is_the_clamped_cubic() {
        let spline = ClampedSpline::new(&[(0.0, 0.0), (1.0, 1.0)]).unwrap();
        for step in 0..=100 {
            let s = f64::from(step) / 100.0;
            assert!((spline.at(s).value - s * s * (3.0 - 2.0 * s)).abs() < 1e-14);
        }
    }

    #[test]
    fn spline_of_bad_knots_is_refused_with_the_knot() {
        let many = [(0.0, 0.0); KNOTS_MAX + 1];
        assert_eq!(ClampedSpline::new(&many), Err(SplineError::KnotCount { knots: KNOTS_MAX + 1 }));
        assert_eq!(ClampedSpline::new(&[(0.0, 0.0)]), Err(SplineError::KnotCount { knots: 1 }));
        let nan = [(0.0, 0.0), (1.0, f64::NAN)];
        assert_eq!(ClampedSpline::new(&nan), Err(SplineError::NotFinite { knot: 1 }));
        let back = [(0.0, 0.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(ClampedSpline::new(&back), Err(SplineError::NotIncreasing { knot: 2 }));
    }
}
