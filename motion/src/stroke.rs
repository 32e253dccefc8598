//! One Tau-J* stroke: all joints along a straight joint-space line with one scalar profile.
//!
//! phi(s) = 1 - (1 - s^4)^n with integer n = 1/k is a polynomial, so a stroke is exact, fast and
//! bit-reproducible: powers are products in a fixed order, never a library call.
//!
//! Source: Wang et al. (2022) (Tau-J*, its eq. 4.2), written in normalised time.
use crate::{JointArray, MAX_JOINTS};

/// Smallest n on the wire: below 4 the snap at the end of a stroke is not bounded.
pub const N_MIN: u32 = 4;
/// Largest n on the wire.
pub const N_MAX: u32 = 64;
/// Shortest stroke.
pub const DURATION_S_MIN: f64 = 1e-3;
/// Latest instant at which a stroke may end.
pub const END_S_MAX: f64 = 86_400.0;

/// One straight joint-space move of a trajectory. Plain data: `Trajectory` checks it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stroke {
    /// When it starts, in trajectory time.
    pub start_s: f64,
    /// How long it takes.
    pub duration_s: f64,
    /// The exponent n = 1/k, from [`N_MIN`] to [`N_MAX`].
    pub n: u32,
    /// How far each joint goes; unused joints are zero.
    pub delta_rad: JointArray,
}

/// Why a stroke is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum StrokeError {
    /// A number is NaN or infinite.
    #[error("{field} is not finite")]
    NotFinite {
        /// Which one: `start_s`, `duration_s` or `delta_rad`.
        field: &'static str,
    },
    /// The start lies before the start of the trajectory.
    #[error("start_s is {start_s}; a stroke starts at 0 s or later")]
    StartsEarly {
        /// The start that was given.
        start_s: f64,
    },
    /// The duration is too short.
    #[error("duration_s is {duration_s}; a stroke takes at least {DURATION_S_MIN} s")]
    TooShort {
        /// The duration that was given.
        duration_s: f64,
    },
    /// The stroke ends too late.
    #[error("ends at {end_s} s; a trajectory ends by {END_S_MAX} s")]
    EndsLate {
        /// The end that was given.
        end_s: f64,
    },
    /// n is out of range.
    #[error("n is {n}; it must be from {N_MIN} to {N_MAX} (k = 1/n)")]
    Exponent {
        /// The n that was given.
        n: u32,
    },
    /// A joint that the arm does not have moves.
    #[error("joint {joint} moves, but the arm has only {joints} joints")]
    UnusedJoint {
        /// Zero-based index of the joint.
        joint: usize,
        /// How many joints the arm has.
        joints: usize,
    },
}

/// The profile phi of a unit stroke and its first three derivatives by s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Phi {
    /// How much of the stroke is done, 0 to 1.
    pub value: f64,
    /// First derivative by s.
    pub d1: f64,
    /// Second derivative by s.
    pub d2: f64,
    /// Third derivative by s.
    pub d3: f64,
}

impl Phi {
    /// Before the stroke.
    pub const BEFORE: Self = Self { value: 0.0, d1: 0.0, d2: 0.0, d3: 0.0 };
    /// After the stroke.
    pub const AFTER: Self = Self { value: 1.0, d1: 0.0, d2: 0.0, d3: 0.0 };

    /// phi(s) = 1 - (1 - s^4)^n and its derivatives for s in [0, 1] and n of at least [`N_MIN`].
    ///
    /// The value is exactly 0 at s = 0 and exactly 1 at s = 1, and the derivatives are exactly 0 at both, because
    /// n > 3 leaves a factor of s or of u everywhere. A smaller n counts as [`N_MIN`].
    ///
    /// Real time: at most six squarings, no library call.
    #[inline]
    #[must_use]
    pub fn at(n: u32, s: f64) -> Self {
        let n = n.max(N_MIN);
        let m = f64::from(n);
        let (s2, a, b) = (s * s, m - 1.0, m - 2.0);
        let x = s2 * s2;
        let u = 1.0 - x;
        let u2 = u * u;
        let c = 4.0 * m * s;
        // What does not need the power comes first in each product, so that it is ready when the power is.
        let (f1, f2) = (c * s2, c * s * (3.0 * u - 4.0 * a * x));
        let f3 = c * (6.0 * u2 + a * x * (16.0 * b * x - 36.0 * u));
        // One power serves all four.
        let p3 = power(u, n - 3);
        Self { value: 1.0 - p3 * (u2 * u), d1: p3 * u2 * f1, d2: p3 * u * f2, d3: p3 * f3 }
    }
}

/// base^exponent by repeated squaring, always in the same order, so that every machine gets the same bits.
///
/// Real time: as many steps as the exponent has bits.
#[inline]
#[must_use]
pub fn power(base: f64, exponent: u32) -> f64 {
    let (mut result, mut square, mut left) = (1.0, base, exponent);
    while left > 0 {
        if left & 1 == 1 {
            result *= square;
        }
        square *= square;
        left >>= 1;
    }
    result
}

impl Stroke {
    /// When it ends, in trajectory time.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    /// True when nothing of it is left at `t_s`: its profile is exactly 1 from then on.
    ///
    /// Real time: two operations.
    #[must_use]
    pub fn has_ended(&self, t_s: f64) -> bool {
        t_s >= self.end_s()
    }

    /// The profile at trajectory time `t_s`, by normalised time; NaN for a `t_s` that is NaN.
    ///
    /// Real time: no allocation, no library call.
    #[must_use]
    pub fn phi(&self, t_s: f64) -> Phi {
        if self.has_ended(t_s) {
            return Phi::AFTER;
        }
        if t_s <= self.start_s {
            return Phi::BEFORE;
        }
        self.running_phi(t_s, 1.0 / self.duration_s)
    }

    /// What the stroke adds to position, velocity, acceleration and jerk for each radian of delta, while it runs: only
    /// between its start and its end.
    #[inline]
    pub(crate) fn shares(&self, t_s: f64) -> [f64; 4] {
        let rate = 1.0 / self.duration_s;
        let phi = self.running_phi(t_s, rate);
        let rate2 = rate * rate;
        [phi.value, phi.d1 * rate, phi.d2 * rate2, phi.d3 * (rate2 * rate)]
    }

    #[inline]
    pub(crate) fn running_phi(&self, t_s: f64, rate: f64) -> Phi {
        let s = (t_s - self.start_s) * rate;
        // Rounding may lift it just above 1; written so that a NaN is handed on, which `min` would not do.
        Phi::at(self.n, if s > 1.0 { 1.0 } else { s })
    }

    /// Checks one stroke of an arm with `joints` joints.
    ///
    /// # Errors
    /// The first fault, as evidence.
    pub fn check(&self, joints: usize) -> Result<(), StrokeError> {
        if !self.start_s.is_finite() {
            return Err(StrokeError::NotFinite { field: "start_s" });
        }
        if !self.duration_s.is_finite() {
            return Err(StrokeError::NotFinite { field: "duration_s" });
        }
        if !self.delta_rad.iter().all(|d| d.is_finite()) {
            return Err(StrokeError::NotFinite { field: "delta_rad" });
        }
        if self.start_s < 0.0 {
            return Err(StrokeError::StartsEarly { start_s: self.start_s });
        }
        if self.duration_s < DURATION_S_MIN {
            return Err(StrokeError::TooShort { duration_s: self.duration_s });
        }
        if self.end_s() > END_S_MAX {
            return Err(StrokeError::EndsLate { end_s: self.end_s() });
        }
        if !(N_MIN..=N_MAX).contains(&self.n) {
            return Err(StrokeError::Exponent { n: self.n });
        }
        for (joint, delta) in self.delta_rad.iter().enumerate().take(MAX_JOINTS).skip(joints) {
            if *delta != 0.0 {
                return Err(StrokeError::UnusedJoint { joint, joints });
            }
        }
        Ok(())
    }
}
