//! The time scale sigma: pause, resume, speed override and stops as a chain of smooth changes.
//!
//! Trajectory time advances by sigma times real time. A change to a target r blends what sigma would have been without it
//! with r, by a profile psi that goes from 0 to 1 (`ramp`):
//!
//! ```text
//! sigma = before + (r - before) psi
//! ```
//!
//! So sigma is continuous with its first three derivatives, stays in [0, 1] for any sequence of changes of any durations, and
//! is exactly r when the newest change has ended; what came before it is then forgotten without changing a bit. Which
//! duration a change needs is chosen by `stopping`.
use crate::Setpoint;
use crate::ramp::RampShape;
use crate::stroke::DURATION_S_MIN;

/// Most changes that may overlap.
pub const RAMPS_MAX: usize = 8;
/// Of these, kept back for stops: a pause, a stop and a fast stop, one on top of the other.
const STOP_SLOTS: usize = 3;
/// Longest change that a time scale accepts (s).
pub const RAMP_S_MAX: f64 = 60.0;
/// Trajectory time is integrated in steps of at most this, s ..
const STEP_S: f64 = 2.5e-4;
/// .. and in at most so many steps.
const STEPS_MAX: u32 = 64;

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

/// How a change of sigma passes: its profile over its duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ramp {
    /// When it begins, on the time axis of its scale.
    pub start_s: f64,
    /// How long it takes.
    pub duration_s: f64,
    /// Its profile.
    pub shape: &'static RampShape,
}

impl Ramp {
    /// When it ends.
    #[must_use]
    pub fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    /// With a duration from [`DURATION_S_MIN`] to [`RAMP_S_MAX`] and a start that is a number: a change must end.
    fn bounded(self) -> Self {
        let duration_s = self.duration_s.clamp(DURATION_S_MIN, RAMP_S_MAX);
        Self {
            start_s: if self.start_s.is_finite() { self.start_s } else { 0.0 },
            duration_s: if duration_s.is_nan() { RAMP_S_MAX } else { duration_s },
            ..self
        }
    }

    /// Blends a scale with a settled one of `target`.
    #[must_use]
    pub fn blend(&self, before: Scale, target: f64, now_s: f64) -> Scale {
        // Compared, not divided: nothing is left from the end on, to the last bit.
        if now_s >= self.end_s() {
            return Scale { sigma: target, ..Scale::default() };
        }
        let rate = 1.0 / self.duration_s;
        let psi = self.shape.at((now_s - self.start_s) * rate);
        let (d1, d2) = (psi.d1 * rate, psi.d2 * rate * rate);
        let (rise, rest) = (target - before.sigma, 1.0 - psi.value);
        Scale {
            sigma: (before.sigma + rise * psi.value).clamp(0.0, 1.0), // Rounding may leave 1e-16 beyond.
            sigma_d1_s: before.sigma_d1_s * rest + rise * d1,
            sigma_d2_s2: before.sigma_d2_s2 * rest - 2.0 * before.sigma_d1_s * d1 + rise * d2,
        }
    }
}

/// One change.
#[derive(Clone, Copy, Debug)]
struct Change {
    target: f64,
    ramp: Ramp,
}

/// The requested speed and the changes that lead there. Time is seconds on any one monotonic axis.
#[derive(Clone, Copy, Debug)]
pub struct TimeScale {
    /// sigma before the oldest change.
    settled: f64,
    changes: [Option<Change>; RAMPS_MAX],
    count: usize,
}

impl TimeScale {
    /// Starts settled at `sigma` (clamped to [0, 1]; NaN is 0).
    #[must_use]
    pub fn settled(sigma: f64) -> Self {
        Self { settled: unit(sigma), changes: [None; RAMPS_MAX], count: 0 }
    }

    /// Changes to another speed; clamps to [0, 1], and takes NaN for 0. After it, ask only for times from `now_s` on: what
    /// has no weight from then on is forgotten. False when too many changes overlap: nothing is changed then.
    ///
    /// Real time: no allocation.
    pub fn change(&mut self, target: f64, ramp: Ramp, now_s: f64) -> bool {
        self.forget_ended(now_s);
        let change = Change { target: unit(target), ramp: ramp.bounded() };
        match self.changes.get_mut(self.count) {
            Some(slot) => {
                *slot = Some(change);
                self.count += 1;
                true
            }
            None => false,
        }
    }

    /// True when another change of speed leaves the slots free that stops need.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn can_change(&self, now_s: f64) -> bool {
        let mut trial = *self;
        trial.forget_ended(now_s);
        trial.count + STOP_SLOTS < RAMPS_MAX
    }

    /// Forgets changes that have not begun at `now_s`: nothing of them has been seen.
    ///
    /// Real time: at most eight changes.
    pub fn drop_pending(&mut self, now_s: f64) {
        while let Some(last) = self.last()
            && last.ramp.start_s > now_s
        {
            self.count -= 1;
        }
    }

    /// sigma at `now_s`.
    ///
    /// Real time: at most eight changes, no allocation.
    #[must_use]
    pub fn sample(&self, now_s: f64) -> Scale {
        let mut scale = Scale { sigma: self.settled, ..Scale::default() };
        for Change { target, ramp } in self.changes() {
            scale = ramp.blend(scale, *target, now_s);
        }
        scale
    }

    /// Integral of sigma from `from_s` to `to_s`: how far trajectory time advances. Exact (to rounding) when settled; else by
    /// Gauss's rule of three points in steps of a quarter of a millisecond, for any time a bounded number of them.
    ///
    /// Never negative: an interval that runs backwards, or is no number, advances nothing.
    ///
    /// Real time: at most 64 steps, four in a cycle of 1 ms that was not late; no allocation.
    #[must_use]
    pub fn advance_s(&self, from_s: f64, to_s: f64) -> f64 {
        /// Half of the root of 3/5.
        const OFF_MIDDLE: f64 = 0.387_298_334_620_741_7;
        let span_s = to_s - from_s;
        if !(span_s > 0.0 && span_s.is_finite()) {
            return 0.0;
        }
        if self.is_settled(from_s) {
            return self.requested() * span_s;
        }
        let steps = (1..STEPS_MAX).find(|steps| span_s <= f64::from(*steps) * STEP_S * (1.0 + 1e-9));
        let steps = steps.unwrap_or(STEPS_MAX);
        let step_s = span_s / f64::from(steps);
        let mut sum = 0.0;
        for step in 0..steps {
            let middle_s = from_s + (f64::from(step) + 0.5) * step_s;
            let [low, middle, high] =
                [-OFF_MIDDLE, 0.0, OFF_MIDDLE].map(|part| self.sample(middle_s + part * step_s).sigma);
            sum += (5.0 * (low + high) + 8.0 * middle) / 18.0;
        }
        (sum * step_s).clamp(0.0, span_s)
    }

    /// True when no change has any effect left to come.
    #[must_use]
    pub fn is_settled(&self, now_s: f64) -> bool {
        now_s >= self.settles_s()
    }

    /// When the newest change has ended.
    #[must_use]
    pub fn settles_s(&self) -> f64 {
        self.last().map_or(f64::NEG_INFINITY, |last| last.ramp.end_s())
    }

    /// The speed that the changes lead to.
    #[must_use]
    pub fn requested(&self) -> f64 {
        self.last().map_or(self.settled, |last| last.target)
    }

    fn changes(&self) -> impl Iterator<Item = &Change> {
        self.changes.iter().take(self.count).flatten()
    }

    fn last(&self) -> Option<&Change> {
        self.changes.get(self.count.checked_sub(1)?)?.as_ref()
    }

    /// From the end of a change on, all before it have no weight.
    fn forget_ended(&mut self, now_s: f64) {
        let before = *self;
        let ended = before.changes().enumerate().filter(|(_, change)| now_s >= change.ramp.end_s()).last();
        let Some((index, Change { target, .. })) = ended else { return };
        *self = Self::settled(*target);
        for (slot, change) in self.changes.iter_mut().zip(before.changes().skip(index + 1)) {
            *slot = Some(*change);
            self.count += 1;
        }
    }
}

/// Clamps to [0, 1]; NaN becomes 0, the speed that moves nothing.
fn unit(sigma: f64) -> f64 {
    if sigma.is_nan() { 0.0 } else { sigma.clamp(0.0, 1.0) }
}

/// Derivatives by real time of a motion that is run at a scale: v sigma, a sigma^2 + v sigma', and
/// j sigma^3 + 3 a sigma sigma' + v sigma''. Positions stay.
///
/// Real time: no allocation; one pass over so many joints.
#[must_use]
pub fn scaled(mut setpoint: Setpoint, scale: Scale, joints: usize) -> Setpoint {
    let Scale { sigma, sigma_d1_s, sigma_d2_s2 } = scale;
    let rates = setpoint.velocity_rad_s.iter_mut().zip(&mut setpoint.acceleration_rad_s2);
    for ((velocity, acceleration), jerk) in rates.zip(&mut setpoint.jerk_rad_s3).take(joints) {
        let (v, a, j) = (*velocity, *acceleration, *jerk);
        *velocity = v * sigma;
        *acceleration = a * sigma * sigma + v * sigma_d1_s;
        *jerk = j * sigma * sigma * sigma + 3.0 * a * sigma * sigma_d1_s + v * sigma_d2_s2;
    }
    setpoint
}
