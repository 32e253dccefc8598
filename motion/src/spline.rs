//! A cubic spline through knots: the interpolator that Wang et al. (2022) compares with.
//!
//! Velocity and acceleration are continuous, the jerk jumps at knots. Clamped, the velocity is zero at both ends and the
//! acceleration is not; not-a-knot, the two pieces at each end are one cubic, and neither is zero. The paper does not say
//! which it means. A spline is here for comparison and for import; as it is it never goes to an arm.
//!
//! Source: de Boor, A Practical Guide to Splines, chapter IV (both end conditions).
use crate::peaks::PeakConstants;
use crate::profile::Profile;
use crate::stroke::Phi;

/// Most knots of a spline.
pub const KNOTS_MAX: usize = 64;

/// What holds at the ends of a spline, where its knots leave two conditions open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ends {
    /// Zero velocity.
    Clamped,
    /// No jump of the third derivative at the first and last inner knot. Three knots make one parabola, two a line.
    NotAKnot,
}

/// A cubic spline: values at increasing times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CubicSpline {
    time_s: [f64; KNOTS_MAX],
    value: [f64; KNOTS_MAX],
    /// Second derivative by time at each knot.
    bend: [f64; KNOTS_MAX],
    count: usize,
    ends: Ends,
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

impl CubicSpline {
    /// Lays the spline through knots (time in s, value in any unit).
    ///
    /// # Errors
    /// The first fault of the knots.
    pub fn new(knots: &[(f64, f64)], ends: Ends) -> Result<Self, SplineError> {
        if !(2..=KNOTS_MAX).contains(&knots.len()) {
            return Err(SplineError::KnotCount { knots: knots.len() });
        }
        let mut spline = Self {
            time_s: [0.0; KNOTS_MAX],
            value: [0.0; KNOTS_MAX],
            bend: [0.0; KNOTS_MAX],
            count: knots.len(),
            ends,
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
        spline.bend = match ends {
            Ends::Clamped => spline.solve_clamped(),
            Ends::NotAKnot => spline.solve_not_a_knot(),
        };
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

    /// Highest |second derivative| by time: it is linear between knots, so one of theirs.
    #[must_use]
    pub fn bend_max(&self) -> f64 {
        self.bend.iter().take(self.count).fold(0.0, |most: f64, bend| most.max(bend.abs()))
    }

    /// Second derivatives at the knots: one tridiagonal system, diagonally dominant, so elimination needs no pivot.
    fn solve_clamped(&self) -> [f64; KNOTS_MAX] {
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

    /// The same for the inner knots alone: the conditions at the ends give the outer second derivatives by those of their
    /// two neighbours, m0 = m1 + (m1 - m2) h0/h1, and so change the first and the last row. The diagonal still dominates.
    fn solve_not_a_knot(&self) -> [f64; KNOTS_MAX] {
        let last = self.count - 1;
        let (mut upper, mut bend) = ([0.0; KNOTS_MAX], [0.0; KNOTS_MAX]);
        for knot in 1..last {
            let ((h0, slope0), (h1, slope1)) = (self.chord(knot), self.chord(knot + 1));
            let (mut below, mut pivot, mut above) = (h0, 2.0 * (h0 + h1), h1);
            if last == 2 {
                (below, pivot, above) = (0.0, 3.0 * (h0 + h1), 0.0); // A parabola: all three are equal.
            } else if knot == 1 {
                (below, pivot, above) = (0.0, pivot + h0 * (1.0 + h0 / h1), h1 - h0 * h0 / h1);
            } else if knot == last - 1 {
                (below, pivot, above) = (h0 - h1 * h1 / h0, pivot + h1 * (1.0 + h1 / h0), 0.0);
            }
            let pivot = pivot - below * upper[knot - 1];
            upper[knot] = above / pivot;
            bend[knot] = (6.0 * (slope1 - slope0) - below * bend[knot - 1]) / pivot;
        }
        for knot in (1..last).rev().skip(1) {
            bend[knot] -= upper[knot] * bend[knot + 1];
        }
        if last == 2 {
            (bend[0], bend[2]) = (bend[1], bend[1]);
        } else if last > 2 {
            let [h0, h1] = [self.chord(1).0, self.chord(2).0];
            bend[0] = bend[1] + (bend[1] - bend[2]) * h0 / h1;
            let [h0, h1] = [self.chord(last).0, self.chord(last - 1).0];
            bend[last] = bend[last - 1] + (bend[last - 1] - bend[last - 2]) * h0 / h1;
        }
        bend
    }
}

impl Profile for CubicSpline {
    /// The spline over its own span: derivatives are by s = (t - first)/(last - first), values are the knots'.
    fn at(&self, s: f64) -> Phi {
        let [first_s, last_s] = self.span_s();
        let span_s = last_s - first_s;
        let s = s.clamp(0.0, 1.0);
        let phi = self.sample(if s < 1.0 { first_s + s * span_s } else { last_s });
        // The end is met exactly, so that clamped means clamped.
        let at_rest = self.ends == Ends::Clamped && !(s > 0.0 && s < 1.0);
        Phi {
            value: phi.value,
            d1: if at_rest { 0.0 } else { phi.d1 * span_s },
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

    /// The knots of figure 1 of Wang et al. (2022).
    const FIGURE_1: [(f64, f64); 5] =
        [(0.0, 0.0), (100.0, 300.0), (200.0, 200.0), (300.0, -300.0), (400.0, -700.0)];

    #[test]
    fn spline_through_figure_1_ends_with_the_published_accelerations() {
        let spline = CubicSpline::new(&FIGURE_1, Ends::Clamped).unwrap();
        // Five digits, as our digest of the paper has them.
        assert!((spline.sample(0.0).d2 - 0.131_79).abs() < 5e-6, "{:?}", spline.sample(0.0));
        assert!((spline.sample(400.0).d2 - 0.123_21).abs() < 5e-6, "{:?}", spline.sample(400.0));
    }

    type Knots = &'static [(f64, f64)];
    type Samples = &'static [(f64, f64, f64, f64, f64)];
    /// scipy's spline through knots: time, value, three derivatives. Printed by tests/splines.py.
    #[rustfmt::skip]
    const NOT_A_KNOT: [(Knots, Samples); 5] = [
        (&[(0.0, 0.3), (0.8, -0.4)], &[
            (0.0, 0.3, -0.875, 0.0, 0.0),
            (0.136, 0.181, -0.875, 0.0, 0.0),
            (0.36000000000000004, -0.015, -0.875, 0.0, 0.0),
            (0.664, -0.281, -0.875, 0.0, 0.0),
            (0.792, -0.393, -0.875, 0.0, 0.0),
        ]),
        (&[(0.0, 0.0), (0.4, 0.7), (1.0, 1.0)], &[
            (0.0, 0.0, 2.25, -2.5, 0.0),
            (0.17, 0.346375, 1.825, -2.5, 0.0),
            (0.45, 0.759375, 1.125, -2.5, 0.0),
            (0.83, 1.006375, 0.175, -2.5, 0.0),
            (0.99, 1.002375, -0.225, -2.5, 0.0),
        ]),
        (&[(0.0, 1.0), (0.5, -1.0), (1.7, 2.0), (2.0, 0.0)], &[
            (0.0, 1.0, -10.1339869281046, 29.5032679738562, -29.8039215686275),
            (0.34, -0.935502222222222, -1.82554248366013, 19.3699346405229, -29.8039215686275),
            (0.9, 0.207058823529412, 4.3483660130719, 2.6797385620915, -29.8039215686275),
            (1.66, 2.10519111111111, -2.22240522875817, -19.9712418300654, -29.8039215686275),
            (1.98, 0.208724705882353, -10.1391633986928, -29.5084967320261, -29.8039215686273),
        ]),
        (&[(0.0, 0.0), (100.0, 300.0), (200.0, 200.0), (300.0, -300.0), (400.0, -700.0)], &[
            (0.0, 0.0, 4.58333333333333, -0.0275, -0.000125),
            (68.0, 241.536, 2.42433333333333, -0.036, -0.000125),
            (180.0, 258.0, -2.39166666666667, -0.05, -0.000125),
            (332.0, -468.8, -4.90166666666667, 0.03, 0.000625),
            (396.0, -693.76, -1.70166666666667, 0.07, 0.000625),
        ]),
        (&[(-1.0, 0.3), (-0.1, -1.2), (1.6, 0.8), (2.0, 0.75), (4.2, 2.1), (5.3, -0.4)], &[
            (-1.0, 0.3, -4.16314985389032, 6.71106371704953, -3.87774433665655),
            (0.07099999999999995, -1.10375669086925, 0.800433516238294, 2.55799953249037, -3.87774433665654),
            (1.835, 0.778985376292876, -0.229850788989252, -0.107147518581527, 13.8890384667062),
            (4.228999999999999, 2.08601527524102, -0.519606604082772, -2.59830875498903, -2.1457391581041),
            (5.237, -0.124047171494905, -4.22880598508166, -4.76121382635796, -2.1457391581041),
        ]),
    ];

    #[test]
    fn spline_without_knots_at_its_ends_agrees_with_scipy() {
        let figure = CubicSpline::new(&FIGURE_1, Ends::NotAKnot).unwrap();
        assert!(
            (figure.sample(0.0).d2 + 0.0275).abs() < 1e-12
                && (figure.sample(400.0).d2 - 0.0725).abs() < 1e-12
        );
        for (knots, theirs) in NOT_A_KNOT {
            let spline = CubicSpline::new(knots, Ends::NotAKnot).unwrap();
            for (t_s, value, d1, d2, d3) in theirs {
                let ours = spline.sample(*t_s);
                for (ours, theirs) in
                    [ours.value, ours.d1, ours.d2, ours.d3].into_iter().zip([value, d1, d2, d3])
                {
                    assert!((ours - theirs).abs() < 1e-9, "at {t_s} s: {ours} against {theirs}");
                }
            }
        }
    }

    #[test]
    fn spline_without_knots_at_its_ends_does_not_rest_there() {
        let spline = CubicSpline::new(&FIGURE_1, Ends::NotAKnot).unwrap();
        assert_eq!(
            (spline.rest_order(), CubicSpline::new(&FIGURE_1, Ends::Clamped).unwrap().rest_order()),
            (0, 1)
        );
        assert!((spline.at(1.0).d1 / 400.0 - spline.sample(400.0).d1).abs() < 1e-12);
    }

    #[test]
    fn spline_at_its_knots_meets_values_and_joins_twice_smoothly() {
        let spline = CubicSpline::new(&FIGURE_1, Ends::Clamped).unwrap();
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
        let spline = CubicSpline::new(&FIGURE_1, Ends::Clamped).unwrap();
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
        let spline = CubicSpline::new(&[(0.0, 0.0), (1.0, 1.0)], Ends::Clamped).unwrap();
        for step in 0..=100 {
            let s = f64::from(step) / 100.0;
            assert!((spline.at(s).value - s * s * (3.0 - 2.0 * s)).abs() < 1e-14);
        }
    }

    #[test]
    fn spline_of_bad_knots_is_refused_with_the_knot() {
        let many = [(0.0, 0.0); KNOTS_MAX + 1];
        let new = |knots: &[(f64, f64)]| CubicSpline::new(knots, Ends::NotAKnot);
        assert_eq!(new(&many), Err(SplineError::KnotCount { knots: KNOTS_MAX + 1 }));
        assert_eq!(new(&[(0.0, 0.0)]), Err(SplineError::KnotCount { knots: 1 }));
        let nan = [(0.0, 0.0), (1.0, f64::NAN)];
        assert_eq!(new(&nan), Err(SplineError::NotFinite { knot: 1 }));
        let back = [(0.0, 0.0), (1.0, 1.0), (1.0, 2.0)];
        assert_eq!(new(&back), Err(SplineError::NotIncreasing { knot: 2 }));
    }
}
