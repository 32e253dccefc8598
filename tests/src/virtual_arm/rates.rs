//! Velocity, acceleration and jerk of a joint's setpoints, by finite differences over steps of several widths.
//!
//! A difference over `m` setpoints is an average of the derivative, so a motion inside its limits cannot exceed them. What
//! it can exceed them by is rounding: each setpoint is off by at most `r`, so that the first, second and third differences are
//! off by 2 r, 4 r and 8 r (the sums of their coefficients), over (m h), (m h)^2 and (m h)^3. Small steps see short events, wide
//! ones see past the rounding.
use std::collections::VecDeque;
use taustream_motion::LimitSet;

/// Widths of the differences, in setpoints.
const WIDTHS: [usize; 5] = [1, 3, 10, 30, 90];
/// Setpoints that the widest third difference needs.
const HISTORY: usize = 3 * 90 + 1;
/// Relative and absolute excess over a limit that is taken for rounding of the computation, as in the guard.
const SLACK: f64 = 1e-3;

/// One setpoint of a row without gaps.
#[derive(Clone, Copy, Debug)]
struct Sample {
    position_rad: f64,
    /// The arm runs at constant speed on its path: the motion limits hold.
    steady: bool,
}

/// The newest setpoints of one joint, as long as none is missing.
#[derive(Clone, Debug)]
pub(crate) struct Rates {
    motion: LimitSet,
    stop: LimitSet,
    rounding_rad: f64,
    step_s: f64,
    newest: VecDeque<Sample>,
}

/// A rate beyond its limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Excess {
    pub(crate) quantity: &'static str,
    pub(crate) value: f64,
    pub(crate) limit: f64,
    /// Time that one step of the difference spans, s.
    pub(crate) step_s: f64,
    pub(crate) of_motion: bool,
}

impl Rates {
    /// Of a joint whose setpoints are `step_s` apart and rounded to `rounding_rad`.
    pub(crate) fn new([motion, stop]: [LimitSet; 2], rounding_rad: f64, step_s: f64) -> Self {
        Self { motion, stop, rounding_rad, step_s, newest: VecDeque::with_capacity(HISTORY) }
    }

    /// Time from one setpoint to the next, s.
    pub(crate) fn step_s(&self) -> f64 {
        self.step_s
    }

    /// A setpoint is missing, or the drive does not follow.
    pub(crate) fn restart(&mut self) {
        self.newest.clear();
    }

    /// Takes the next setpoint; what it exceeds.
    pub(crate) fn push(&mut self, position_rad: f64, steady: bool) -> Option<Excess> {
        if self.newest.len() == HISTORY {
            self.newest.pop_back();
        }
        self.newest.push_front(Sample { position_rad, steady });
        WIDTHS.into_iter().find_map(|width| self.exceeded(width))
    }

    fn exceeded(&self, width: usize) -> Option<Excess> {
        let at = |steps: usize| self.newest.get(steps * width).map(|sample| sample.position_rad);
        #[expect(clippy::cast_precision_loss, reason = "at most 90")]
        let step_s = width as f64 * self.step_s;
        let check = |quantity, order: usize, difference: f64, limits: [f64; 2]| {
            let power = (0..order).fold(1.0, |power, _| power * step_s);
            let off = f64::from(1_u32 << order) * self.rounding_rad;
            let value = difference.abs() / power;
            let tolerance = off / power;
            let span = order * width;
            let steady = self.newest.iter().take(span + 1).all(|sample| sample.steady);
            let [motion, stop] = limits;
            let limit = if steady { motion } else { stop };
            (value > limit * (1.0 + SLACK) + SLACK + tolerance).then_some(Excess {
                quantity,
                value,
                limit,
                step_s,
                of_motion: steady,
            })
        };
        let (q0, q1) = (at(0)?, at(1)?);
        let (m, s) = (&self.motion, &self.stop);
        let velocity = check("velocity", 1, q0 - q1, [m.velocity_rad_s, s.velocity_rad_s]);
        velocity.or_else(|| {
            let q2 = at(2)?;
            let second = q0 - 2.0 * q1 + q2;
            check("acceleration", 2, second, [m.acceleration_rad_s2, s.acceleration_rad_s2]).or_else(|| {
                let third = q0 - 3.0 * q1 + 3.0 * q2 - at(3)?;
                check("jerk", 3, third, [m.jerk_rad_s3, s.jerk_rad_s3])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rates(rounding_rad: f64) -> Rates {
        let motion = LimitSet { velocity_rad_s: 3.0, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
        let stop = LimitSet { velocity_rad_s: 3.0, acceleration_rad_s2: 30.0, jerk_rad_s3: 600.0 };
        Rates::new([motion, stop], rounding_rad, 1e-3)
    }

    fn run(rounding_rad: f64, steady: bool, path: impl Fn(f64) -> f64) -> Option<Excess> {
        let mut rates = rates(rounding_rad);
        let step = 2.0 * rounding_rad;
        (0..2_000_u32).find_map(|k| {
            let exact = path(f64::from(k) * 1e-3);
            let rounded = if step > 0.0 { (exact / step).round() * step } else { exact };
            rates.push(rounded, steady)
        })
    }

    /// Goal: a motion at its limits passes for every rounding, and one that is 5 % beyond any of them does not.
    #[test]
    fn sine_at_a_limit_passes_and_beyond_it_fails_whatever_the_rounding() {
        for rounding_rad in [0.0, 2.4e-7, 1.9e-4] {
            // Amplitude 1/w^k at rate w has a peak of 1 in the k-th derivative.
            for (limit, order, rate) in [(3.0, 1, 2.0), (15.0, 2, 8.0), (150.0, 3, 12.0)] {
                let wave =
                    |share: f64| move |t: f64| share * limit / f64::powi(rate, order) * (rate * t).sin();
                assert_eq!(run(rounding_rad, true, wave(0.999)), None, "order {order}, {rounding_rad}");
                // The widest difference averages over 0.27 s, a fast wave by more than the rounding leaves.
                let beyond = if rounding_rad > 1e-6 { 1.6 } else { 1.05 };
                assert!(run(rounding_rad, true, wave(beyond)).is_some(), "order {order}, {rounding_rad}");
            }
        }
    }

    #[test]
    fn setpoint_beside_the_others_is_an_excess_of_acceleration() {
        let path = |t: f64| if (t - 0.5).abs() < 4e-4 { 1e-4 } else { 0.0 };
        let excess = run(2.4e-7, false, path).unwrap();
        assert_eq!(excess.quantity, "acceleration");
        assert!(!excess.of_motion && (excess.value - 100.0).abs() < 1.0, "{excess:?}");
    }
}
