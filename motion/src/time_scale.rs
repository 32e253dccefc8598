//! The time scale sigma: pause, resume and speed override as strokes.
//!
//! Trajectory time advances by sigma times real time. sigma is the sum of Tau-J* ramps of ONE duration, so it
//! is the convolution of the wished (stepwise) speed with the kernel phi'. Hence for any sequence of wishes in
//! [0, 1]: sigma stays in [0, 1], |sigma'| <= c_v/D, and |sigma''| <= (c_a+ + c_a-)/D^2 where c_a+ and c_a- are
//! the highest positive and negative peaks of phi''. The duration D follows from the two limit sets in closed form:
//!
//!     a_m + v_m |sigma'| <= a_s      and      j_m + 3 a_m |sigma'| + v_m |sigma''| <= j_s      for every joint
use crate::{JointLimits, MAX_JOINTS};

/// n of every sigma ramp.
pub const RAMP_N: u32 = 5;
/// Most ramps that may overlap. One is kept back for a stop.
pub const RAMPS_MAX: usize = 32;

/// sigma and its derivatives by real time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scale {
    /// Seconds of trajectory a second.
    pub sigma: f64,
    /// First derivative, 1/s.
    pub sigma_d1_s: f64,
    /// Second derivative, 1/s^2.
    pub sigma_d2_s2: f64,
}

/// Too many ramps run at once; the wish is refused, nothing changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("too many speed changes at once; wait until the running ones have ended")]
pub struct Busy;

/// The shortest ramp duration D that keeps every joint inside its stop limits (s).
#[must_use]
pub fn ramp_duration_s(_limits: &[JointLimits; MAX_JOINTS], _joints: usize) -> f64 {
    todo!("motion")
}

/// The wished speed and the ramps that lead there. Time is seconds on any one monotonic axis.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    ramp_duration_s: f64,
}

impl TimeScale {
    /// Starts settled at `sigma` with ramps of the given duration.
    #[must_use]
    pub fn settled(_sigma: f64, ramp_duration_s: f64) -> Self {
        Self { ramp_duration_s }
    }
    /// Duration of every ramp.
    #[must_use]
    pub fn ramp_duration_s(&self) -> f64 {
        self.ramp_duration_s
    }
    /// Wishes another speed from `now_s` on; clamps to [0, 1].
    ///
    /// Real time: no allocation.
    ///
    /// # Errors
    /// `Busy` when too many ramps overlap.
    pub fn wish(&mut self, _sigma: f64, _now_s: f64) -> Result<(), Busy> {
        todo!("motion")
    }
    /// Like [`Self::wish`] to 0, but never refused: the kept-back slot serves it.
    pub fn stop(&mut self, _now_s: f64) {
        todo!("motion")
    }
    /// sigma at `now_s`.
    #[must_use]
    pub fn sample(&self, _now_s: f64) -> Scale {
        todo!("motion")
    }
    /// Integral of sigma from `from_s` to `to_s`: how far trajectory time advances. Exact (to rounding) when settled.
    #[must_use]
    pub fn advance_s(&self, _from_s: f64, _to_s: f64) -> f64 {
        todo!("motion")
    }
    /// True when all ramps have ended.
    #[must_use]
    pub fn is_settled(&self, _now_s: f64) -> bool {
        todo!("motion")
    }
    /// The speed that the ramps lead to.
    #[must_use]
    pub fn wished(&self) -> f64 {
        todo!("motion")
    }
}

/// Derivatives by real time of a motion that is run at a scale: v sigma, a sigma^2 + v sigma', and
/// j sigma^3 + 3 a sigma sigma' + v sigma''. Positions stay.
///
/// Real time: no allocation.
#[must_use]
pub fn scaled(_setpoint: &crate::Setpoint, _scale: Scale) -> crate::Setpoint {
    todo!("motion")
}
