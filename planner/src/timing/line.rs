//! A straight move from rest to rest: its limits along the line, and its jerk-limited time optimum.
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS};

/// Limits along a straight joint-space line, in lengths of the line: the tightest joint decides each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLimits {
    /// 1/s.
    pub velocity: f64,
    /// 1/s^2.
    pub acceleration: f64,
    /// 1/s^3.
    pub jerk: f64,
}

impl LineLimits {
    /// Limits between two poses; `None` when no joint moves, or when one that moves may not.
    #[must_use]
    pub fn between(
        from_rad: &JointArray,
        to_rad: &JointArray,
        (joints, limits): (usize, &[JointLimits; MAX_JOINTS]),
    ) -> Option<Self> {
        let mut line = Self { velocity: f64::INFINITY, acceleration: f64::INFINITY, jerk: f64::INFINITY };
        for ((from, to), limits) in from_rad.iter().zip(to_rad).zip(limits).take(joints) {
            let (distance_rad, motion) = ((to - from).abs(), limits.motion);
            if distance_rad > 0.0 {
                line.velocity = line.velocity.min(motion.velocity_rad_s / distance_rad);
                line.acceleration = line.acceleration.min(motion.acceleration_rad_s2 / distance_rad);
                line.jerk = line.jerk.min(motion.jerk_rad_s3 / distance_rad);
            }
        }
        let all = [line.velocity, line.acceleration, line.jerk];
        all.iter().all(|limit| *limit > 0.0 && limit.is_finite()).then_some(line)
    }

    /// The fastest move along the whole line, whose jerk may jump.
    #[must_use]
    pub fn optimum(&self) -> Optimum {
        let Self { velocity: v, acceleration: a, jerk: j } = *self;
        let jerk_s = (a / j).min((v / j).sqrt()).min((0.5 / j).cbrt());
        let mut optimum = Optimum { jerk_s, acceleration_s: 0.0, cruise_s: 0.0, jerk: j };
        if jerk_s >= a / j {
            // a (jerk_s + t) (2 jerk_s + t) = 1 without a cruise.
            let longest_s = 0.5 * ((jerk_s * jerk_s + 4.0 / a).sqrt() - 3.0 * jerk_s);
            optimum.acceleration_s = longest_s.min(v / a - jerk_s).max(0.0);
        }
        let peak = optimum.peaks()[0];
        optimum.cruise_s = (1.0 / peak - 2.0 * jerk_s - optimum.acceleration_s).max(0.0);
        optimum
    }
}

/// The jerk-limited optimum of a straight move: jerk, constant acceleration, jerk back; cruise; the same in reverse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum {
    /// Each of the four phases of full jerk.
    pub jerk_s: f64,
    /// Each of the two phases of constant acceleration.
    pub acceleration_s: f64,
    /// The phase of constant velocity.
    pub cruise_s: f64,
    /// The jerk (1/s^3).
    pub jerk: f64,
}

impl Optimum {
    /// From rest to rest.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        4.0 * self.jerk_s + 2.0 * self.acceleration_s + self.cruise_s
    }

    /// Time from rest to full speed.
    #[must_use]
    pub fn ramp_s(&self) -> f64 {
        2.0 * self.jerk_s + self.acceleration_s
    }

    /// Highest velocity, acceleration and jerk.
    #[must_use]
    pub fn peaks(&self) -> [f64; 3] {
        let acceleration = self.jerk * self.jerk_s;
        [acceleration * (self.jerk_s + self.acceleration_s), acceleration, self.jerk]
    }

    /// How much of the line is behind after a time.
    #[must_use]
    pub fn position(&self, t_s: f64) -> f64 {
        self.state(t_s).first().copied().unwrap_or_default()
    }

    /// The share of the line that is behind after a time, and its first three derivatives (1/s, 1/s^2, 1/s^3).
    #[must_use]
    pub fn state(&self, t_s: f64) -> [f64; 4] {
        let half_s = 0.5 * self.duration_s();
        if t_s > half_s {
            let [position, velocity, acceleration, jerk] = self.before_half(2.0 * half_s - t_s);
            return [1.0 - position, velocity, -acceleration, jerk];
        }
        self.before_half(t_s)
    }

    fn before_half(&self, t_s: f64) -> [f64; 4] {
        let [fastest, steepest, jerk] = self.peaks();
        let phase_s = |begin_s: f64, length_s: f64| (t_s - begin_s).clamp(0.0, length_s);
        let level_from_s = self.jerk_s + self.acceleration_s;
        let first_s = phase_s(0.0, self.jerk_s);
        let second_s = phase_s(self.jerk_s, self.acceleration_s);
        let third_s = phase_s(level_from_s, self.jerk_s);
        let mut position = jerk * first_s * first_s * first_s / 6.0;
        position += second_s * (0.5 * steepest * self.jerk_s + 0.5 * steepest * second_s);
        let reached = fastest - 0.5 * steepest * self.jerk_s;
        position += third_s * (reached + 0.5 * steepest * third_s - jerk * third_s * third_s / 6.0);
        position += fastest * (t_s - self.ramp_s()).max(0.0);
        let velocity =
            0.5 * jerk * first_s * first_s + steepest * (second_s + third_s) - 0.5 * jerk * third_s * third_s;
        let now = [(self.jerk_s, jerk), (level_from_s, 0.0), (self.ramp_s(), -jerk)];
        let jerk_now = now.into_iter().find(|(until_s, _)| t_s < *until_s).map_or(0.0, |(_, jerk)| jerk);
        [position, velocity, jerk * (first_s - third_s), jerk_now]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_optimum_covers_the_line_within_its_limits() {
        for seed in 0..2_000_u32 {
            let power = |k: u32| 10_f64.powf(6.0 * (f64::from(seed) * f64::from(k) * 0.618).fract() - 3.0);
            let line = LineLimits { velocity: power(1), acceleration: power(3), jerk: power(7) };
            let optimum = line.optimum();
            let [v, a, j] = optimum.peaks();
            let fits = v <= line.velocity * (1.0 + 1e-9)
                && a <= line.acceleration * (1.0 + 1e-9)
                && j <= line.jerk * (1.0 + 1e-9);
            assert!(fits, "seed {seed}: {optimum:?} exceeds {line:?}");
            let half = optimum.position(0.5 * optimum.duration_s());
            assert!((half - 0.5).abs() < 1e-9, "seed {seed}: {half} of the line after half the time");
        }
    }

    #[test]
    fn the_derivatives_are_those_of_the_position() {
        for line in [[1.0, 3.0, 30.0], [0.2, 9.0, 30.0], [5.0, 0.5, 30.0]] {
            let [velocity, acceleration, jerk] = line;
            let optimum = LineLimits { velocity, acceleration, jerk }.optimum();
            let (duration_s, dt_s) = (optimum.duration_s(), 1e-5);
            for k in 1..997 {
                let t_s = duration_s * f64::from(k) / 997.0;
                let [before, now, after] = [-dt_s, 0.0, dt_s].map(|by_s| optimum.state(t_s + by_s));
                for order in 0..3 {
                    let rate = (after[order] - before[order]) / (2.0 * dt_s);
                    // Across a switch of the jerk a difference lies between its two values.
                    let switches = order == 2 && before[3].to_bits() != after[3].to_bits();
                    let close = (rate - now[order + 1]).abs() < 1e-3 * jerk;
                    assert!(close || switches, "order {order} at {t_s} s: {rate}, {}", now[order + 1]);
                }
            }
        }
    }
}
