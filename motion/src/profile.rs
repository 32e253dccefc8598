//! The scalar profiles of the papers behind one trait.
//!
//! A profile moves a unit gap: 0 at s = 0, 1 at s = 1, in normalised time. On the wire there is only Tau-J* with an
//! integer n ([`crate::stroke`]); the others are here to compare with it and to import motions made elsewhere. They
//! call `libm` for real powers, so they are bit-reproducible too, but not meant for the 1 kHz cycle.
//!
//! | profile | velocity | acceleration | jerk at the start | jerk at the end |
//! |---|---|---|---|---|
//! | Tau-J, k < 1/3 | 0 | 0 | 6/k | 0 |
//! | Tau-J*, k < 1/3 | 0 | 0 | 0 | 0 |
//! | quintic | 0 | 0 | 60 | 60 |
//! | septic | 0 | 0 | 0 | 0 |
//! | clamped cubic spline | 0 | not 0 | not 0 | not 0 |
//! | not-a-knot cubic spline | not 0 | not 0 | not 0 | not 0 |
//!
//! The snap of both tau profiles diverges at s = 1 for k > 1/4, which is why the wire holds n = 1/k >= 4.
//!
//! Source: Wang et al. (2022), section 4 (tau profiles, quintic, cubic spline); the septic is the lowest polynomial with
//! zero jerk at both ends.
use crate::peaks::{PeakConstants, family};
use crate::stroke::Phi;

/// A scalar profile in normalised time.
pub trait Profile {
    /// Value and first three derivatives by s; `s` is clamped to [0, 1], and the derivatives at the ends are those
    /// from inside. NaN gives NaN.
    fn at(&self, s: f64) -> Phi;

    /// Highest magnitudes of the derivatives over [0, 1], in closed form.
    fn peaks(&self) -> PeakConstants;

    /// Values and derivatives at s = 0 and s = 1.
    fn ends(&self) -> [Phi; 2] {
        [self.at(0.0), self.at(1.0)]
    }

    /// How many of velocity, acceleration and jerk, in this order, are zero at both ends: 3 means that motions made
    /// of such profiles, joined end to end, are C3.
    fn rest_order(&self) -> u32 {
        let [start, end] = self.ends();
        let pairs = [(start.d1, end.d1), (start.d2, end.d2), (start.d3, end.d3)];
        let mut order = 0;
        for (start, end) in pairs {
            if start != 0.0 || end != 0.0 {
                break;
            }
            order += 1;
        }
        order
    }
}

/// Why a k is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "k is {k}; it must be at least {K_MIN} and below 1/3, where the jerk at the end stops being zero (0.25 or less bounds the snap too)"
)]
pub struct KError {
    /// The k that was given.
    pub k: f64,
}

/// Smallest k: below it the whole move happens within some hundredths of its time.
pub const K_MIN: f64 = 1e-6;

/// Tau-J: phi = 1 - (1 - s^3)^(1/k). It starts with a jerk of 6/k.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TauJ {
    n: f64,
}

/// Tau-J*: phi = 1 - (1 - s^4)^(1/k), with any real k below 1/3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TauJStar {
    n: f64,
}

/// 10 s^3 - 15 s^4 + 6 s^5: velocity and acceleration are zero at the ends, the jerk is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quintic;

/// 35 s^4 - 84 s^5 + 70 s^6 - 20 s^7: velocity, acceleration and jerk are zero at the ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Septic;

impl TauJ {
    /// Makes the profile of one k.
    ///
    /// # Errors
    /// A k outside of [[`K_MIN`], 1/3).
    pub fn new(k: f64) -> Result<Self, KError> {
        Ok(Self { n: exponent(k)? })
    }
}

impl TauJStar {
    /// Makes the profile of one k.
    ///
    /// # Errors
    /// A k outside of [[`K_MIN`], 1/3).
    pub fn new(k: f64) -> Result<Self, KError> {
        Ok(Self { n: exponent(k)? })
    }
}

impl Profile for TauJ {
    fn at(&self, s: f64) -> Phi {
        let s = s.clamp(0.0, 1.0);
        // 1 - s^3, factored so that it keeps its digits near the end, where real powers would magnify the loss.
        let u = (1.0 - s) * (1.0 + s * (1.0 + s));
        tau(self.n, s * s * s, u, [-3.0 * s * s, -6.0 * s, -6.0])
    }

    fn peaks(&self) -> PeakConstants {
        family(3, self.n)
    }
}

impl Profile for TauJStar {
    fn at(&self, s: f64) -> Phi {
        let s = s.clamp(0.0, 1.0);
        let s2 = s * s;
        let u = (1.0 - s) * (1.0 + s) * (1.0 + s2);
        tau(self.n, s2 * s2, u, [-4.0 * s2 * s, -12.0 * s2, -24.0 * s])
    }

    fn peaks(&self) -> PeakConstants {
        family(4, self.n)
    }
}

impl Profile for Quintic {
    fn at(&self, s: f64) -> Phi {
        let s = s.clamp(0.0, 1.0);
        let s2 = s * s;
        Phi {
            value: s2 * s * (10.0 + s * (6.0 * s - 15.0)),
            d1: 30.0 * s2 * (1.0 - s) * (1.0 - s),
            d2: 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
            d3: 60.0 * (1.0 + s * (6.0 * s - 6.0)),
        }
    }

    fn peaks(&self) -> PeakConstants {
        let c_a = 10.0 / libm::sqrt(3.0);
        PeakConstants {
            c_v: 15.0 / 8.0,
            c_a,
            c_j: 60.0,
            c_a_positive: c_a,
            c_a_negative: c_a,
            s_v: 0.5,
            s_a: (3.0 - libm::sqrt(3.0)) / 6.0,
            s_j: 0.0,
        }
    }
}

impl Profile for Septic {
    fn at(&self, s: f64) -> Phi {
        let s = s.clamp(0.0, 1.0);
        let (s2, r) = (s * s, s * (1.0 - s));
        Phi {
            value: s2 * s2 * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s))),
            d1: 140.0 * r * r * r,
            d2: 420.0 * r * r * (1.0 - 2.0 * s),
            d3: 840.0 * r * (1.0 - 5.0 * r),
        }
    }

    fn peaks(&self) -> PeakConstants {
        let c_a = 84.0 / (5.0 * libm::sqrt(5.0));
        PeakConstants {
            c_v: 35.0 / 16.0,
            c_a,
            c_j: 52.5,
            c_a_positive: c_a,
            c_a_negative: c_a,
            s_v: 0.5,
            s_a: (5.0 - libm::sqrt(5.0)) / 10.0,
            s_j: 0.5,
        }
    }
}

/// n = 1/k of a k that is allowed.
fn exponent(k: f64) -> Result<f64, KError> {
    // A NaN is in no range.
    if (K_MIN..1.0 / 3.0).contains(&k) { Ok(1.0 / k) } else { Err(KError { k }) }
}

/// phi = 1 - u^n with u = 1 - x and the derivatives of u by s, by the chain rule.
fn tau(n: f64, x: f64, u: f64, [u1, u2, u3]: [f64; 3]) -> Phi {
    if u <= 0.0 {
        return Phi::AFTER; // All powers left are positive, but a real power of zero is not worth asking for.
    }
    let (a, b) = (n - 1.0, n - 2.0);
    let p3 = libm::pow(u, n - 3.0);
    let p2 = p3 * u;
    let p1 = p2 * u;
    Phi {
        // The same as 1 - u^n, without losing the first digits of a slow start.
        value: -libm::expm1(n * libm::log1p(-x)),
        d1: -n * p1 * u1,
        d2: -n * (a * p2 * u1 * u1 + p1 * u2),
        d3: -n * (a * b * p3 * u1 * u1 * u1 + 3.0 * a * p2 * u1 * u2 + p1 * u3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::{CubicSpline, Ends};

    #[test]
    fn profiles_at_their_ends_rest_as_deep_as_the_table_says() {
        let tau_j = TauJ::new(0.1).unwrap();
        let [start, end] = tau_j.ends();
        assert_eq!((start.d1, start.d2, end), (0.0, 0.0, Phi::AFTER));
        assert!((start.d3 - 60.0).abs() < 1e-12);
        let spline = CubicSpline::new(&[(0.0, 0.0), (0.4, 0.7), (1.0, 1.0)], Ends::Clamped).unwrap();
        let orders = [
            tau_j.rest_order(),
            TauJStar::new(0.1).unwrap().rest_order(),
            TauJStar::new(0.3333).unwrap().rest_order(),
            Quintic.rest_order(),
            Septic.rest_order(),
            spline.rest_order(),
        ];
        assert_eq!(orders, [2, 3, 3, 2, 3, 1]);
    }

    #[test]
    fn profiles_with_integer_n_agree_with_the_stroke_on_the_wire() {
        for n in crate::stroke::N_MIN..=crate::stroke::N_MAX {
            let real = TauJStar::new(1.0 / f64::from(n)).unwrap();
            for step in 0..=1000 {
                let s = f64::from(step) / 1000.0;
                let (a, b) = (real.at(s), Phi::at(n, s));
                // Relative to the peaks, which are below 600.
                let gap = (a.value - b.value).abs()
                    + (a.d1 - b.d1).abs()
                    + (a.d2 - b.d2).abs()
                    + (a.d3 - b.d3).abs();
                assert!(gap < 1e-10, "n {n}, s {s}: {gap:e}");
            }
        }
    }

    #[test]
    fn k_outside_of_its_range_is_refused_with_the_value() {
        for k in [0.0, -0.1, 1.0 / 3.0, 0.5, 1e-7, f64::NAN, f64::INFINITY] {
            assert!(TauJ::new(k).is_err() && TauJStar::new(k).is_err(), "k {k}");
        }
        let sentence = std::format!("{}", TauJ::new(0.4).unwrap_err());
        assert!(sentence.contains("0.4") && sentence.contains("below 1/3"), "{sentence}");
    }

    #[test]
    fn profile_asked_outside_of_its_time_stays_at_its_ends() {
        for s in [-1.0, -f64::INFINITY, 2.0, f64::INFINITY] {
            let value = if s < 0.0 { 0.0 } else { 1.0 };
            let star = TauJStar::new(0.2).unwrap();
            let values = [Quintic.at(s).value, Septic.at(s).value, star.at(s).value];
            assert_eq!(values.map(f64::to_bits), [f64::to_bits(value); 3], "s {s}");
        }
        assert!(Septic.at(f64::NAN).value.is_nan());
    }
}
