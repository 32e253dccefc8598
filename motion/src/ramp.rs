//! The profile of one change of the time scale: from 0 to 1, its second derivative a sum of four Tau-J* strokes.
//!
//! The shortest change under a limit of the second derivative rises, stays level and falls with constant second derivative.
//! Its corners would be jumps of jerk. Averaged with the kernel phi' of a short stroke, each jump J at t becomes a stroke
//! J phi((u - t)/e): the first and second derivatives keep the bounds of what is averaged, and the sum is five times
//! continuously differentiable. The change takes 1/(1 - e) times as long. u is the part of the duration that has passed.
//!
//! ```text
//! psi''(u) = sum of J_k phi((u - t_k)/e),   phi(s) = 1 - (1 - s^4)^5 for s <= 1, 1 after
//! ```
//!
//! The integrals of phi are polynomials, so psi' and psi are exact.
use crate::stroke::Phi;

/// n of the strokes of the second derivative.
const CORNER_N: u32 = 5;
/// Duration of each of them, as a part of the whole.
const CORNER: f64 = 0.06;
/// The integral of phi over its duration, and the integral of that.
const INTEGRAL: f64 = 1.0 - 10.0 / 9.0 + 10.0 / 13.0 - 5.0 / 17.0 + 1.0 / 21.0;
const DOUBLE_INTEGRAL: f64 = 1.0 / 6.0 - 1.0 / 9.0 + 5.0 / 91.0 - 5.0 / 306.0 + 1.0 / 462.0;

/// How the first derivative rises, stays level, and falls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RampShape {
    /// Highest first derivative.
    pub c_v: f64,
    /// Highest magnitude of the second derivative.
    pub c_a: f64,
    /// The jumps of the second derivative before it is averaged: when, and how far.
    jumps: [(f64, f64); 4],
}

/// A value between 0 and 1 with its first two derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Profile {
    /// The value.
    pub value: f64,
    /// First derivative.
    pub d1: f64,
    /// Second derivative.
    pub d2: f64,
}

/// The shapes that stops choose from: from cruise a level part helps where acceleration binds; while the motion speeds up
/// a longer rise helps.
pub const SHAPES: [RampShape; 6] = [
    RampShape::new(0.5, 0.0),
    RampShape::new(0.4, 0.2),
    RampShape::new(0.3, 0.4),
    RampShape::new(0.6, 0.0),
    RampShape::new(0.48, 0.2),
    RampShape::new(0.36, 0.4),
];

impl RampShape {
    /// Rises for `rise` and is level for `level` of the time that the corners leave; falls for the rest.
    const fn new(rise: f64, level: f64) -> Self {
        let whole = 1.0 - CORNER;
        let (rise, level, fall) = (rise * whole, level * whole, (1.0 - rise - level) * whole);
        // The reference covers 1 from rest to rest.
        let c_v = 1.0 / (0.5 * rise + level + 0.5 * fall);
        let (up, down) = (c_v / rise, c_v / fall);
        Self {
            c_v,
            c_a: if up > down { up } else { down },
            jumps: [(0.0, up), (rise, -up), (rise + level, -down), (whole, down)],
        }
    }

    /// The profile where `u` of the duration has passed: exactly 0 up to the start and exactly 1 from the end on. A `u` that is
    /// no number is before the start.
    ///
    /// Real time: four polynomials.
    #[must_use]
    pub fn at(&self, u: f64) -> Profile {
        if u >= 1.0 {
            return Profile { value: 1.0, d1: 0.0, d2: 0.0 };
        }
        let mut profile = Profile::default();
        for (at, jump) in self.jumps {
            let s = (u - at) / CORNER;
            // A NaN adds nothing.
            if s > 0.0 {
                let [phi, once, twice] = integrals(s);
                profile.d2 += jump * phi;
                profile.d1 += jump * CORNER * once;
                profile.value += jump * CORNER * CORNER * twice;
            }
        }
        // Rounding may leave 1e-16 beyond.
        profile.value = profile.value.clamp(0.0, 1.0);
        profile
    }
}

/// phi, its integral from 0 and the integral of that, at an s above 0.
fn integrals(s: f64) -> [f64; 3] {
    if s >= 1.0 {
        let beyond = s - 1.0;
        return [1.0, INTEGRAL + beyond, DOUBLE_INTEGRAL + beyond * (INTEGRAL + 0.5 * beyond)];
    }
    let x = s * s * s * s;
    let once = x * (1.0 - x * (10.0 / 9.0 - x * (10.0 / 13.0 - x * (5.0 / 17.0 - x / 21.0))));
    let twice = x * (1.0 / 6.0 - x * (1.0 / 9.0 - x * (5.0 / 91.0 - x * (5.0 / 306.0 - x / 462.0))));
    [Phi::at(CORNER_N, s).value, s * once, s * s * twice]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_of_every_shape_goes_from_0_to_1_and_differentiates_to_its_derivatives_inside_its_bounds() {
        for (index, shape) in SHAPES.iter().enumerate() {
            let h = 1e-5;
            let mut before = shape.at(0.0);
            assert_eq!(before, Profile::default());
            let (mut most_d1, mut most_d2) = (0.0_f64, 0.0_f64);
            for step in 1..1000 {
                let u = f64::from(step) / 1000.0;
                let [low, at, high] = [u - h, u, u + h].map(|u| shape.at(u));
                assert!(((high.value - low.value) / (2.0 * h) - at.d1).abs() < 1e-6, "{index} at {u}");
                assert!(((high.d1 - low.d1) / (2.0 * h) - at.d2).abs() < 1e-3, "{index} at {u}");
                assert!(at.value >= before.value && at.d1 >= -1e-12, "{index} at {u}: {at:?}");
                most_d1 = most_d1.max(at.d1);
                most_d2 = most_d2.max(at.d2.abs());
                before = at;
            }
            assert!(most_d1 <= shape.c_v * (1.0 + 1e-12) && most_d1 > 0.9 * shape.c_v, "{index}: {most_d1}");
            assert!(most_d2 <= shape.c_a * (1.0 + 1e-12) && most_d2 > 0.99 * shape.c_a, "{index}: {most_d2}");
            let end = shape.at(1.0 - 1e-9);
            assert!((end.value - 1.0).abs() < 1e-12 && end.d1.abs() < 1e-8 && end.d2.abs() < 1e-6, "{end:?}");
            assert_eq!(shape.at(1.0), Profile { value: 1.0, d1: 0.0, d2: 0.0 });
            assert_eq!(shape.at(f64::NAN), Profile::default());
        }
    }
}
