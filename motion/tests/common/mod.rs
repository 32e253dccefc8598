//! What the tests share: numbered random draws, and numerical differentiation that knows nothing of the crate.
#![expect(dead_code, reason = "each test binary uses a part")]
#![expect(clippy::unwrap_used, reason = "a case that cannot be made fails its test")]
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Stroke, Trajectory};

/// A small reproducible source of numbers (splitmix64), so that a failing seed can be run again anywhere.
pub(crate) struct SeededRng(u64);

impl SeededRng {
    /// The same seed gives the same numbers.
    pub(crate) fn from_seed(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d).wrapping_add(0x1234_5678))
    }

    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [low, high).
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit")]
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in low..=high.
    pub(crate) fn whole(&mut self, low: u32, high: u32) -> u32 {
        low + u32::try_from(self.bits() % u64::from(high - low + 1)).unwrap()
    }

    /// One value a joint, zero beyond `joints`.
    pub(crate) fn joints(&mut self, joints: usize, span: f64) -> JointArray {
        let mut values = [0.0; MAX_JOINTS];
        for value in values.iter_mut().take(joints) {
            *value = self.within(-span, span);
        }
        values
    }

    /// Overlapping strokes of random durations and exponents, starting within `window_s`.
    pub(crate) fn trajectory(&mut self, joints: usize, count: u32, window_s: f64) -> Trajectory {
        let mut strokes: Vec<Stroke> = (0..count)
            .map(|_| Stroke {
                start_s: self.within(0.0, window_s),
                duration_s: self.within(0.2, 2.0),
                n: self.whole(4, 64),
                delta_rad: self.joints(joints, 1.0),
            })
            .collect();
        strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        Trajectory::new(joints, self.joints(joints, 3.0), &strokes).unwrap()
    }
}

/// First derivative by Richardson extrapolation of central differences (error O(h^6)).
pub(crate) fn slope(f: impl Fn(f64) -> f64, t: f64, h: f64) -> f64 {
    let central = |h: f64| (f(t + h) - f(t - h)) / (2.0 * h);
    let (d1, d2, d4) = (central(h), central(h / 2.0), central(h / 4.0));
    let (r1, r2) = ((4.0 * d2 - d1) / 3.0, (4.0 * d4 - d2) / 3.0);
    (16.0 * r2 - r1) / 15.0
}

/// Limits of the shipped UR5: 3.14 rad/s, 15 rad/s^2, 150 rad/s^3, stops at twice and four times that.
#[expect(clippy::approx_constant, reason = "3.14 is what the robot file says")]
pub(crate) fn ur5_limits() -> [JointLimits; MAX_JOINTS] {
    let motion = LimitSet { velocity_rad_s: 3.14, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
    let stop = LimitSet { velocity_rad_s: 3.14, acceleration_rad_s2: 30.0, jerk_rad_s3: 600.0 };
    [JointLimits { position_rad: [-20.0, 20.0], motion, stop }; MAX_JOINTS]
}

/// Limits that differ from joint to joint and from seed to seed; those of an arm's second eight joints are those of the first.
pub(crate) fn random_limits(rng: &mut SeededRng) -> [JointLimits; MAX_JOINTS] {
    let eight = [(); MAX_JOINTS / 2].map(|()| {
        let motion = LimitSet {
            velocity_rad_s: rng.within(0.5, 3.5),
            acceleration_rad_s2: rng.within(1.0, 20.0),
            jerk_rad_s3: rng.within(5.0, 300.0),
        };
        let stop = LimitSet {
            velocity_rad_s: motion.velocity_rad_s,
            acceleration_rad_s2: motion.acceleration_rad_s2 * rng.within(1.2, 3.0),
            jerk_rad_s3: motion.jerk_rad_s3 * rng.within(1.5, 6.0),
        };
        JointLimits { position_rad: [-20.0, 20.0], motion, stop }
    });
    std::array::from_fn(|joint| eight[joint % eight.len()])
}
