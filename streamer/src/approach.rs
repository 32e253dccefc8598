//! The way from the pose that is held to the base of a trajectory that begins there, within the base tolerance.
//!
//! A tenth of a milliradian in one period is a jerk of 1e5 rad/s^3. So a difference fades out along a Tau-J* curve in
//! real time, on top of the trajectory, which keeps the sum C3. Its duration follows from the difference: at the start of a
//! motion it uses only what stops leave free for it (`taustream_motion::stopping`), so a stop during it keeps the stop limits;
//! after a stall, while trajectory time stands, it uses the motion limits, and trajectory time waits for its end. Without a
//! difference nothing is added, to the last bit.
use taustream_motion::peaks::peak_constants;
use taustream_motion::stopping::APPROACH_SHARE;
use taustream_motion::stroke::Phi;
use taustream_motion::{JointArray, JointLimits, LimitSet, MAX_JOINTS, Setpoint};

/// n of the curve.
const CURVE_N: u32 = 5;
/// Shortest approach, s.
const APPROACH_S_MIN: f64 = 2e-3;
/// Longest approach, s, whatever the limits.
const APPROACH_S_MAX: f64 = 60.0;

/// What an approach may add to each joint.
#[derive(Clone, Copy, Debug, Default)]
pub struct ApproachLimits {
    moving: [LimitSet; MAX_JOINTS],
    standing: [LimitSet; MAX_JOINTS],
    joints: usize,
}

impl ApproachLimits {
    /// Of an arm.
    #[must_use]
    pub fn new(limits: &[JointLimits; MAX_JOINTS], joints: usize) -> Self {
        Self {
            moving: limits.map(|JointLimits { motion, stop, .. }| LimitSet {
                velocity_rad_s: APPROACH_SHARE * motion.velocity_rad_s,
                acceleration_rad_s2: APPROACH_SHARE * (stop.acceleration_rad_s2 - motion.acceleration_rad_s2),
                jerk_rad_s3: APPROACH_SHARE * (stop.jerk_rad_s3 - motion.jerk_rad_s3),
            }),
            standing: limits.map(|limits| limits.motion),
            joints,
        }
    }

    fn duration_s(&self, offset_rad: &JointArray, limits: &[LimitSet; MAX_JOINTS]) -> f64 {
        let c = peak_constants(CURVE_N);
        let joints = offset_rad.iter().zip(limits).take(self.joints);
        let longest_s = joints.fold(APPROACH_S_MIN, |longest_s, (offset_rad, limits)| {
            let offset_rad = offset_rad.abs();
            longest_s
                .max(c.c_v * offset_rad / limits.velocity_rad_s)
                .max((c.c_a * offset_rad / limits.acceleration_rad_s2).sqrt())
                .max((c.c_j * offset_rad / limits.jerk_rad_s3).cbrt())
        });
        longest_s.min(APPROACH_S_MAX)
    }
}

/// What is left of a difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approach {
    offset_rad: JointArray,
    duration_s: f64,
    any: bool,
}

impl Approach {
    /// From `hold_pose_rad` to `base_rad`, while the motion runs.
    #[must_use]
    pub fn while_moving(hold_pose_rad: &JointArray, base_rad: &JointArray, limits: &ApproachLimits) -> Self {
        let offset_rad = difference(hold_pose_rad, base_rad);
        Self::new(offset_rad, limits.duration_s(&offset_rad, &limits.moving))
    }

    /// From `hold_pose_rad` to `base_rad`, while trajectory time stands.
    #[must_use]
    pub fn while_standing(
        hold_pose_rad: &JointArray,
        base_rad: &JointArray,
        limits: &ApproachLimits,
    ) -> Self {
        let offset_rad = difference(hold_pose_rad, base_rad);
        Self::new(offset_rad, limits.duration_s(&offset_rad, &limits.standing))
    }

    fn new(offset_rad: JointArray, duration_s: f64) -> Self {
        Self { offset_rad, duration_s, any: offset_rad.iter().any(|o| o.abs() > 0.0) }
    }

    /// The difference at the beginning.
    #[must_use]
    pub fn offset_rad(&self) -> &JointArray {
        &self.offset_rad
    }

    /// True when nothing of it is left after `t_s`.
    #[must_use]
    pub fn has_ended(&self, t_s: f64) -> bool {
        !self.any || t_s >= self.duration_s
    }

    /// How much of its time is left after `t_s`.
    #[must_use]
    pub fn rest_s(&self, t_s: f64) -> f64 {
        if self.has_ended(t_s) { 0.0 } else { self.duration_s - t_s }
    }

    /// Adds what is left after `t_s` to a setpoint. Returns what it added to the positions, rad.
    ///
    /// Real time: one polynomial, no allocation.
    pub fn add_to(&self, setpoint: &mut Setpoint, t_s: f64) -> JointArray {
        let mut added_rad = [0.0; MAX_JOINTS];
        if self.has_ended(t_s) {
            return added_rad;
        }
        let rate = 1.0 / self.duration_s;
        let phi = Phi::at(CURVE_N, t_s.max(0.0) * rate);
        for (joint, offset) in self.offset_rad.iter().enumerate() {
            added_rad[joint] = offset * (1.0 - phi.value);
            setpoint.position_rad[joint] += added_rad[joint];
            setpoint.velocity_rad_s[joint] -= offset * phi.d1 * rate;
            setpoint.acceleration_rad_s2[joint] -= offset * phi.d2 * rate * rate;
            setpoint.jerk_rad_s3[joint] -= offset * phi.d3 * rate * rate * rate;
        }
        added_rad
    }
}

fn difference(from_rad: &JointArray, to_rad: &JointArray) -> JointArray {
    let mut offset_rad = [0.0; MAX_JOINTS];
    for (offset, (from, to)) in offset_rad.iter_mut().zip(from_rad.iter().zip(to_rad)) {
        *offset = from - to;
    }
    offset_rad
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The peaks that an approach adds keep the limits that it was given, and use one of them up.
    #[test]
    fn approach_of_any_size_keeps_the_limits_that_it_is_given() {
        let motion = LimitSet { velocity_rad_s: 3.0, acceleration_rad_s2: 15.0, jerk_rad_s3: 150.0 };
        let stop = LimitSet { velocity_rad_s: 3.0, acceleration_rad_s2: 30.0, jerk_rad_s3: 600.0 };
        let limits =
            ApproachLimits::new(&[JointLimits { position_rad: [-3.0, 3.0], motion, stop }; MAX_JOINTS], 6);
        for offset_rad in [1e-6, 1e-4, 1e-2, 0.3] {
            let (from, to) = ([offset_rad; MAX_JOINTS], [0.0; MAX_JOINTS]);
            for (approach, limits) in [
                (Approach::while_moving(&from, &to, &limits), limits.moving[0]),
                (Approach::while_standing(&from, &to, &limits), limits.standing[0]),
            ] {
                let mut most = 0.0_f64;
                for step in 0..1000 {
                    let mut setpoint = Setpoint::default();
                    approach.add_to(&mut setpoint, approach.duration_s * f64::from(step) / 1000.0);
                    most = most
                        .max(setpoint.velocity_rad_s[0].abs() / limits.velocity_rad_s)
                        .max(setpoint.acceleration_rad_s2[0].abs() / limits.acceleration_rad_s2)
                        .max(setpoint.jerk_rad_s3[0].abs() / limits.jerk_rad_s3);
                }
                assert!(most <= 1.0 + 1e-9 && most > 0.98 || approach.duration_s <= APPROACH_S_MIN, "{most}");
                assert!(approach.rest_s(0.0) > 0.0 && approach.rest_s(100.0).abs() < 1e-12);
            }
        }
    }
}
