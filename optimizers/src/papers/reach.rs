//! Reaching a position without inverse kinematics, by reward and punishment (Lv et al. 2019).
//!
//! The cost of joint angles is the time of the joint that has farthest to go, max |θ|/ω, plus a punishment of how far
//! the tip is off (K exp(-5 (λ + 1)²), at least 67 and at most K), or, within ε, a reward that grows to 24 at the
//! target. The cost jumps by 67 at ε: a swarm does not mind, a gradient would.
//!
//! Source: eq. 9 to 17, tables 3 and 4. Corrected against printed: the two rewards meet at s (printed: at λ = 0.99,
//! that is at 0.01 ε, where the inner one is still +1176); the angles count by magnitude, in both readings, since the
//! paper's own table 5 cannot be meant otherwise. The largest error `e_max` is not given: twice the arm's reach, and
//! errors beyond it count as it. Table 1's fuzzy rules occur in no equation. Everything is in metres, radians and
//! seconds; the paper has millimetres, and its 0.02 is 4 ε.
use crate::{Problem, Reading, Refusal};

/// Reward and punishment of an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reward {
    /// Where punishment ends, ε.
    pub threshold_m: f64,
    /// Where the inner reward begins, s.
    pub inner_m: f64,
    /// The largest error that is distinguished from larger ones, `e_max`.
    pub error_max_m: f64,
    /// Highest punishment, K.
    pub punishment: f64,
    /// Factor of the reward, j.
    pub factor: f64,
    /// Which reading.
    pub reading: Reading,
}

impl Reward {
    /// The paper's numbers; its arm reaches 0.337 m.
    pub const PAPER_003: Self = Self {
        threshold_m: 5e-6,
        inner_m: 0.5e-9,
        error_max_m: 0.674,
        punishment: 10_000.0,
        factor: 3.0,
        reading: Reading::Corrected,
    };

    /// What an error adds to the cost: positive is a punishment, negative a reward.
    #[must_use]
    pub fn of(&self, error_m: f64) -> f64 {
        let (e, eps, s) = (error_m, self.threshold_m, self.inner_m);
        let inner_from = match self.reading {
            Reading::Corrected => s,
            Reading::Printed => 0.01 * eps,
        };
        if e > eps {
            let lambda = (-(e - eps) / (self.error_max_m - eps)).max(-1.0);
            self.punishment * (-5.0 * (lambda + 1.0).powi(2)).exp()
        } else if e > inner_from {
            -self.factor * 4.0 * (eps - e) / (eps - s)
        } else {
            -self.factor * (8.0 - 4.0 * e / s)
        }
    }
}

/// Where the tip is for joint angles in radians, in metres.
pub type PositionOf<'a> = &'a (dyn Fn(&[f64]) -> [f64; 3] + Sync);

/// The problem: joint angles whose tip is at the target and whose farthest joint is near. Any arm will do.
#[derive(Clone, Copy)]
pub struct Reach<'a> {
    /// The arm.
    pub position_m: PositionOf<'a>,
    /// Its joint ranges.
    pub bounds_rad: &'a [[f64; 2]],
    /// Where it starts.
    pub start_rad: &'a [f64],
    /// Where the tip has to go.
    pub target_m: [f64; 3],
    /// Speed of each joint, ω.
    pub speeds_rad_s: &'a [f64],
    /// Reward and punishment.
    pub reward: Reward,
}

impl Reach<'_> {
    /// The same, once its numbers are found to make sense together.
    ///
    /// # Errors
    /// Names the first number that does not: a start or speeds of another length than the box, a target that is no
    /// place, a speed of nothing, thresholds that are not in order.
    pub fn checked(self) -> Result<Self, Refusal> {
        let (within, who) = (Refusal::check_number, "reaching a position");
        let (joints, given) = (self.bounds_rad.len() as f64, self.start_rad.len() as f64);
        within(who, "the start's number of joints", given, [joints, joints], "one for each range is needed")?;
        Refusal::check_finite(who, "the target", &self.target_m)?;
        Refusal::check_finite(who, "the start", self.start_rad)?;
        let speeds = self.speeds_rad_s.len() as f64;
        within(who, "the number of speeds", speeds, [joints, joints], "one for each range is needed")?;
        for speed_rad_s in self.speeds_rad_s {
            within(who, "a speed", *speed_rad_s, [1e-9, 1e9], "a speed above 0 rad/s is needed")?;
        }
        let Reward { threshold_m, inner_m, error_max_m, punishment, factor, .. } = self.reward;
        within(who, "s", inner_m, [1e-15, threshold_m], "above 0 m and at most the threshold is possible")?;
        within(who, "the threshold", threshold_m, [inner_m, 0.999 * error_max_m], "below e_max is possible")?;
        Refusal::check_finite(who, "e_max, K or j", &[error_max_m, punishment, factor])?;
        Ok(self)
    }

    /// Distance of the tip to the target.
    #[must_use]
    pub fn error_m(&self, angles_rad: &[f64]) -> f64 {
        let tip = (self.position_m)(angles_rad);
        tip.iter().zip(self.target_m).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }

    /// Time of the joint that has farthest to go.
    #[must_use]
    pub fn time_s(&self, angles_rad: &[f64]) -> f64 {
        let distances = angles_rad.iter().zip(self.start_rad).zip(self.speeds_rad_s);
        distances.map(|((angle, start), speed)| (angle - start).abs() / speed).fold(0.0, f64::max)
    }
}

impl Problem for Reach<'_> {
    fn bounds(&self) -> &[[f64; 2]] {
        self.bounds_rad
    }

    fn cost(&self, x: &[f64]) -> f64 {
        self.time_s(x) + self.reward.of(self.error_m(x))
    }
}

/// The paper's arm: its table 3 and the ranges of its table 4; the fifth joint does not move the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FiveJointArm;

impl FiveJointArm {
    /// Ranges of the first four joints, from the upright pose.
    pub const BOUNDS_RAD: [[f64; 2]; 4] = {
        const DEGREE: f64 = std::f64::consts::PI / 180.0;
        [
            [-135.0 * DEGREE, 135.0 * DEGREE],
            [-90.0 * DEGREE, 90.0 * DEGREE],
            [-135.0 * DEGREE, 135.0 * DEGREE],
            [-135.0 * DEGREE, 90.0 * DEGREE],
        ]
    };
    /// The paper's target.
    pub const TARGET_M: [f64; 3] = [0.151_171, 0.191_62, 0.172_124];
    /// The paper's joint speed; its unit is not printed.
    pub const SPEED_RAD_S: f64 = 0.2;
    const SPEEDS_RAD_S: [f64; 4] = [Self::SPEED_RAD_S; 4];
    /// Links a1 to a4 and the hand d5.
    const LINKS_M: [f64; 5] = [0.010, 0.104, 0.096, 0.027, 0.137];

    /// The tip for the first four joint angles, measured from the upright pose; missing angles count as 0. In Denavit
    /// and Hartenberg's variables the second is a quarter turn less and the fourth a quarter turn more. The paper's
    /// eq. 2 has a wrong `p_y` and no `p_z`.
    #[must_use]
    pub fn position_m(angles_rad: &[f64]) -> [f64; 3] {
        let angle = |i: usize| angles_rad.get(i).copied().unwrap_or(0.0);
        let [a1, a2, a3, a4, d5] = Self::LINKS_M;
        let quarter = std::f64::consts::FRAC_PI_2;
        let phi2 = angle(1) - quarter;
        let phi3 = phi2 + angle(2);
        let phi4 = phi3 + angle(3) + quarter;
        let out = a1 + a2 * phi2.cos() + a3 * phi3.cos() + a4 * phi4.cos() + d5 * phi4.sin();
        let up = -a2 * phi2.sin() - a3 * phi3.sin() - a4 * phi4.sin() + d5 * phi4.cos();
        [out * angle(0).cos(), out * angle(0).sin(), up]
    }

    /// The paper's task.
    #[must_use]
    pub fn task(reading: Reading) -> Reach<'static> {
        Reach {
            position_m: &Self::position_m,
            bounds_rad: &Self::BOUNDS_RAD,
            start_rad: &[0.0; 4],
            target_m: Self::TARGET_M,
            speeds_rad_s: &Self::SPEEDS_RAD_S,
            reward: Reward { reading, ..Reward::PAPER_003 },
        }
    }
}
