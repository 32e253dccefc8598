//! The time scale sigma: pause, resume and speed override as strokes.
//!
//! Trajectory time advances by sigma times real time. sigma is the sum of Tau-J* ramps of ONE duration, so it
//! is the convolution of the requested (stepwise) speed with the kernel phi'. Hence for any sequence of requests in
//! [0, 1]: sigma stays in [0, 1], `|sigma'| <= c_v/D`, and `|sigma''| <= (c_a+ + c_a-)/D^2` where `c_a+` and `c_a-`
//! are the highest positive and negative peaks of phi''. The duration D follows from the two limit sets in closed form:
//!
//! ```text
//! a_m + v_m |sigma'| <= a_s      and      j_m + 3 a_m |sigma'| + v_m |sigma''| <= j_s      for every joint
//! ```
use crate::peaks::peak_constants;
use crate::stroke::{DURATION_S_MIN, Phi};
use crate::{JointLimits, MAX_JOINTS, Setpoint};

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

/// Too many ramps run at once; the request is refused, nothing changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("too many speed changes at once; wait until the running ones have ended")]
pub struct Busy;

/// The shortest ramp duration D that keeps every joint inside its stop limits (s).
///
/// Infinite when a joint's stop limits leave no room above its motion limits, or a limit is no number: such an arm
/// cannot pause, and its description is to be refused. Never below [`DURATION_S_MIN`].
#[must_use]
pub fn ramp_duration_s(limits: &[JointLimits; MAX_JOINTS], joints: usize) -> f64 {
    let peaks = peak_constants(RAMP_N);
    let mut longest_s = DURATION_S_MIN;
    for JointLimits { motion, stop, .. } in limits.iter().take(joints) {
        // a_m + v_m c_v/D <= a_s
        let room = stop.acceleration_rad_s2 - motion.acceleration_rad_s2;
        let acceleration_s = motion.velocity_rad_s * peaks.c_v / room;
        // j_m + 3 a_m c_v/D + v_m (c_a+ + c_a-)/D^2 <= j_s, a quadratic in D
        let jerk_room = stop.jerk_rad_s3 - motion.jerk_rad_s3;
        let linear = 3.0 * motion.acceleration_rad_s2 * peaks.c_v;
        let constant = motion.velocity_rad_s * (peaks.c_a_positive + peaks.c_a_negative);
        let jerk_s = (linear + libm::sqrt(linear * linear + 4.0 * jerk_room * constant)) / (2.0 * jerk_room);
        if !(room > 0.0 && jerk_room > 0.0 && acceleration_s.is_finite() && jerk_s.is_finite()) {
            return f64::INFINITY;
        }
        longest_s = longest_s.max(acceleration_s).max(jerk_s);
    }
    longest_s
}

/// One change of the requested speed.
#[derive(Clone, Copy, Debug, Default)]
struct Ramp {
    start_s: f64,
    /// Speed after it less speed before it.
    rise: f64,
}

/// The requested speed and the ramps that lead there. Time is seconds on any one monotonic axis.
///
/// sigma is stored as the request less what the running ramps still owe, rise * (1 - phi). A ramp that has ended owes
/// exactly nothing: that makes sigma exactly the request when settled, and forgetting the ramp changes no bit.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    ramp_duration_s: f64,
    requested: f64,
    ramps: [Ramp; RAMPS_MAX],
    count: usize,
}

impl TimeScale {
    /// Starts settled at `sigma` (clamped to [0, 1]; NaN is 0) with ramps of the given duration, which is clamped to
    /// [[`DURATION_S_MIN`], [`RAMP_S_MAX`]]: a stop must end, so limits without room for one are refused before.
    #[must_use]
    pub fn settled(sigma: f64, ramp_duration_s: f64) -> Self {
        let ramp_duration_s = if ramp_duration_s.is_nan() {
            RAMP_S_MAX
        } else {
            ramp_duration_s.clamp(DURATION_S_MIN, RAMP_S_MAX)
        };
        Self { ramp_duration_s, requested: unit(sigma), ramps: [Ramp::default(); RAMPS_MAX], count: 0 }
    }

    /// Duration of every ramp.
    #[must_use]
    pub fn ramp_duration_s(&self) -> f64 {
        self.ramp_duration_s
    }

    /// Requests another speed from `now_s` on; clamps to [0, 1], and takes NaN for 0. After it, ask only for times
    /// from `now_s` on: ramps that had ended by then are forgotten.
    ///
    /// Real time: no allocation.
    ///
    /// # Errors
    /// `Busy` when too many ramps overlap.
    pub fn request(&mut self, sigma: f64, now_s: f64) -> Result<(), Busy> {
        self.forget_ended(now_s);
        if self.count >= RAMPS_MAX - 1 && unit(sigma) > 0.0 {
            return Err(Busy);
        }
        self.ramp_to(unit(sigma), now_s);
        Ok(())
    }

    /// Like [`Self::request`] to 0, but never refused: the kept-back slot serves it.
    ///
    /// Real time: no allocation.
    pub fn stop(&mut self, now_s: f64) {
        self.forget_ended(now_s);
        self.ramp_to(0.0, now_s);
    }

    /// sigma at `now_s`.
    ///
    /// Real time: at most 32 ramps, no allocation.
    #[must_use]
    pub fn sample(&self, now_s: f64) -> Scale {
        let rate = 1.0 / self.ramp_duration_s;
        let mut scale = Scale { sigma: self.requested, ..Scale::default() };
        for ramp in self.ramps() {
            let phi = Phi::at(RAMP_N, self.progress(ramp, now_s));
            scale.sigma -= ramp.rise * (1.0 - phi.value);
            scale.sigma_d1_s += ramp.rise * phi.d1 * rate;
            scale.sigma_d2_s2 += ramp.rise * phi.d2 * rate * rate;
        }
        scale.sigma = unit(scale.sigma); // Rounding may leave -1e-17.
        scale
    }

    /// Integral of sigma from `from_s` to `to_s`: how far trajectory time advances. Exact (to rounding) when settled.
    ///
    /// Never negative: an interval that runs backwards, or is no number, advances nothing.
    ///
    /// Real time: at most 32 ramps, no allocation.
    #[must_use]
    pub fn advance_s(&self, from_s: f64, to_s: f64) -> f64 {
        let span_s = to_s - from_s;
        if !(span_s > 0.0 && span_s.is_finite()) {
            return 0.0;
        }
        let mut advance_s = self.requested * span_s;
        for ramp in self.ramps() {
            // Before its start a ramp owes all of its rise, then the integral of u^n.
            let waiting_s = (ramp.start_s - from_s).clamp(0.0, span_s);
            let running =
                owed_integral(self.progress(ramp, to_s)) - owed_integral(self.progress(ramp, from_s));
            advance_s -= ramp.rise * (waiting_s + self.ramp_duration_s * running);
        }
        advance_s.clamp(0.0, span_s)
    }

    /// True when all ramps have ended.
    #[must_use]
    pub fn is_settled(&self, now_s: f64) -> bool {
        self.ramps().iter().all(|ramp| self.has_ended(ramp, now_s))
    }

    /// The speed that the ramps lead to.
    #[must_use]
    pub fn requested(&self) -> f64 {
        self.requested
    }

    fn ramps(&self) -> &[Ramp] {
        self.ramps.get(..self.count).unwrap_or(&[])
    }

    fn has_ended(&self, ramp: &Ramp, now_s: f64) -> bool {
        now_s >= ramp.start_s + self.ramp_duration_s
    }

    /// How much of a ramp's time has gone, 0 to 1; a time that is no number is before every ramp.
    fn progress(&self, ramp: &Ramp, now_s: f64) -> f64 {
        if self.has_ended(ramp, now_s) {
            return 1.0;
        }
        let s = (now_s - ramp.start_s) / self.ramp_duration_s;
        if s.is_nan() { 0.0 } else { s.clamp(0.0, 1.0) }
    }

    fn forget_ended(&mut self, now_s: f64) {
        let before = *self;
        self.count = 0;
        for ramp in before.ramps().iter().filter(|ramp| !before.has_ended(ramp, now_s)) {
            self.push(*ramp);
        }
    }

    fn ramp_to(&mut self, sigma: f64, now_s: f64) {
        let rise = sigma - self.requested;
        if rise != 0.0 && self.push(Ramp { start_s: now_s, rise }) {
            self.requested = sigma;
        }
    }

    /// False when all slots are taken, which the kept-back one rules out: it is used only on the way to a request of
    /// zero, and from zero there is nothing to stop.
    fn push(&mut self, ramp: Ramp) -> bool {
        let Some(slot) = self.ramps.get_mut(self.count) else { return false };
        *slot = ramp;
        self.count += 1;
        true
    }
}

/// Longest ramp that a time scale accepts (s).
pub const RAMP_S_MAX: f64 = 60.0;

/// Clamps to [0, 1]; NaN becomes 0, the speed that moves nothing.
fn unit(sigma: f64) -> f64 {
    if sigma.is_nan() { 0.0 } else { sigma.clamp(0.0, 1.0) }
}

/// Integral of 1 - phi = (1 - s^4)^5 from 0 to s, term by term of the binomial.
fn owed_integral(s: f64) -> f64 {
    let x = s * s * s * s;
    s * (1.0 + x * (-1.0 + x * (10.0 / 9.0 + x * (-10.0 / 13.0 + x * (5.0 / 17.0 - x / 21.0)))))
}

/// Derivatives by real time of a motion that is run at a scale: v sigma, a sigma^2 + v sigma', and
/// j sigma^3 + 3 a sigma sigma' + v sigma''. Positions stay.
///
/// Real time: no allocation.
#[must_use]
pub fn scaled(setpoint: &Setpoint, scale: Scale) -> Setpoint {
    let Scale { sigma, sigma_d1_s, sigma_d2_s2 } = scale;
    let mut out = *setpoint;
    for joint in 0..MAX_JOINTS {
        let v = setpoint.velocity_rad_s[joint];
        let a = setpoint.acceleration_rad_s2[joint];
        let j = setpoint.jerk_rad_s3[joint];
        out.velocity_rad_s[joint] = v * sigma;
        out.acceleration_rad_s2[joint] = a * sigma * sigma + v * sigma_d1_s;
        out.jerk_rad_s3[joint] = j * sigma * sigma * sigma + 3.0 * a * sigma * sigma_d1_s + v * sigma_d2_s2;
    }
    out
}
