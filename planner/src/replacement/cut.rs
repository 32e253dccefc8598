//! A running motion at the instant from which on it is replaced.
use super::LANES;
use super::fit::Rates;
use crate::replacement::reference::Task;
use taustream_motion::limits::TOLERANCE;
use taustream_motion::peaks::peak_constants;
use taustream_motion::range::PermittedRange;
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Setpoint, Stroke, Trajectory};

/// A stroke whose jerk stays below this share of the limit needs no narrow strokes that cancel it.
const NEGLIGIBLE: f64 = 0.05;
/// A stroke with less than this share of its duration left is over.
const OVER: f64 = 0.05;
/// Instants at which position ranges are looked at.
const RANGE_SAMPLES: u32 = 48;
/// How much more than at an instant a peak beside it may be ..
const PEAK: f64 = 2e-4;
/// .. up to this share of the limits.
const CEILING_EARLY: f64 = 0.9999;

/// Rates of all joints at one instant: velocity, acceleration, jerk.
pub(super) type AllRates = [JointArray; 3];

/// The cut.
pub(super) struct Cut<'a> {
    pub running: &'a Trajectory,
    pub at_s: f64,
    pub limits: &'a [JointLimits; MAX_JOINTS],
    /// The strokes that have begun.
    pub kept: &'a [Stroke],
    /// Those that have not.
    pub dropped: &'a [Stroke],
    /// Pose after the kept ones.
    pub kept_end_rad: JointArray,
    /// When the last of them ends, after the cut (s); 0 when all have.
    pub kept_end_s: f64,
    /// Width of the narrowest of them that still matters (s); infinite when none does.
    pub kernel_s: f64,
}

impl<'a> Cut<'a> {
    /// Nothing when a number makes no sense.
    pub(super) fn new(
        running: &'a Trajectory,
        at_s: f64,
        limits: &'a [JointLimits; MAX_JOINTS],
    ) -> Option<Self> {
        let usable = limits.iter().take(running.joints()).all(|limits| {
            let LimitSet { velocity_rad_s: v, acceleration_rad_s2: a, jerk_rad_s3: j } = limits.motion;
            [v, a, j].iter().all(|limit| limit.is_finite() && *limit > 0.0)
        });
        if !(usable && at_s.is_finite() && at_s >= 0.0) {
            return None;
        }
        let begun = running.strokes().partition_point(|stroke| stroke.start_s < at_s);
        let (kept, dropped) = running.strokes().split_at(begun);
        let mut cut = Self {
            running,
            at_s,
            limits,
            kept,
            dropped,
            kept_end_rad: *running.base_rad(),
            kept_end_s: 0.0,
            kernel_s: f64::INFINITY,
        };
        for stroke in kept {
            for (end, delta) in cut.kept_end_rad.iter_mut().zip(&stroke.delta_rad) {
                *end += delta;
            }
            let left_s = stroke.end_s() - at_s;
            cut.kept_end_s = cut.kept_end_s.max(left_s);
            if left_s > OVER * stroke.duration_s && cut.matters(stroke) {
                cut.kernel_s = cut.kernel_s.min(stroke.duration_s);
            }
        }
        Some(cut)
    }

    pub(super) fn joints(&self) -> usize {
        self.running.joints()
    }

    fn matters(&self, stroke: &Stroke) -> bool {
        let rate = 1.0 / stroke.duration_s;
        let peak = peak_constants(stroke.n).c_j * rate * rate * rate;
        let mut joints = stroke.delta_rad.iter().zip(self.limits).take(self.joints());
        joints.any(|(delta, limits)| peak * delta.abs() > NEGLIGIBLE * limits.motion.jerk_rad_s3)
    }

    /// What a joint has to do from some time after the cut on, if the motion goes on as it is until then.
    pub(super) fn task(&self, from: &Setpoint, joint: usize, goal_rad: Option<&JointArray>) -> Task {
        Task {
            position_rad: from.position_rad[joint],
            velocity_rad_s: from.velocity_rad_s[joint],
            acceleration_rad_s2: from.acceleration_rad_s2[joint],
            goal_rad: goal_rad.map(|goal_rad| goal_rad[joint]),
        }
    }

    /// What the kept strokes do at instants after the cut.
    pub(super) fn kept_rates(&self, times_s: &[f64]) -> Vec<AllRates> {
        let mut sums = vec![[[0.0; MAX_JOINTS]; 3]; times_s.len()];
        for stroke in self.kept {
            let rate = 1.0 / stroke.duration_s;
            for (sum, after_s) in sums.iter_mut().zip(times_s) {
                let t_s = self.at_s + after_s;
                if stroke.has_ended(t_s) {
                    break;
                }
                let phi = stroke.phi(t_s);
                let shares = [phi.d1 * rate, phi.d2 * rate * rate, phi.d3 * rate * rate * rate];
                for (sum, share) in sum.iter_mut().zip(shares) {
                    for (sum, delta) in sum.iter_mut().zip(&stroke.delta_rad) {
                        *sum += delta * share;
                    }
                }
            }
        }
        sums
    }

    /// True when a motion stays in the position ranges after the cut, or comes in from where it is at the cut. At sampled instants:
    /// the proof follows later.
    pub(super) fn holds_range(&self, motion: &Trajectory, duration_s: f64) -> bool {
        let start_rad = self.running.sample(self.at_s).position_rad;
        let ranges: [PermittedRange; MAX_JOINTS] =
            std::array::from_fn(|joint| PermittedRange::around(&self.limits[joint], start_rad[joint]));
        (1..=RANGE_SAMPLES).all(|part| {
            let t_s = self.at_s + duration_s * f64::from(part) / f64::from(RANGE_SAMPLES);
            let position_rad = motion.sample(t_s).position_rad;
            ranges
                .iter()
                .zip(&position_rad)
                .take(self.joints())
                .all(|(range, position)| range.contains(*position))
        })
    }

    /// A share of the limits of some joints at instants after the cut. Up to `early_s` the motion may use what it uses as it
    /// is, up to the limits: nothing that is new acts so soon.
    pub(super) fn bounds(&self, joints: &[usize], times_s: &[f64], early_s: f64, share: f64) -> Vec<Rates> {
        let limits = |share: f64| {
            let mut rates = [[f64::INFINITY; LANES]; 3];
            for (lane, joint) in joints.iter().enumerate() {
                let motion = self.limits[*joint].motion;
                rates[0][lane] = share * motion.velocity_rad_s;
                rates[1][lane] = share * motion.acceleration_rad_s2;
                rates[2][lane] = share * motion.jerk_rad_s3;
            }
            rates
        };
        let (most, exact) = (limits(CEILING_EARLY), limits(1.0 + 0.5 * TOLERANCE));
        let mut bounds = vec![limits(share); times_s.len()];
        let early = times_s.partition_point(|after_s| *after_s < early_s);
        for (bounds, after_s) in bounds.iter_mut().zip(times_s).take(early) {
            let now = self.running.sample(self.at_s + after_s);
            let now = [now.velocity_rad_s, now.acceleration_rad_s2, now.jerk_rad_s3];
            for (quantity, bounds) in bounds.iter_mut().enumerate() {
                for (lane, joint) in joints.iter().enumerate() {
                    let now = now[quantity][*joint].abs();
                    let near = (now * (1.0 + PEAK)).min(most[quantity][lane]);
                    let same = (now * (1.0 + 1e-9)).min(exact[quantity][lane]);
                    bounds[lane] = bounds[lane].max(near).max(same);
                }
            }
        }
        bounds
    }
}
