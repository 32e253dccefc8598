//! The way from the pose that is held to the base of a trajectory that begins there, within the base tolerance.
//!
//! A tenth of a milliradian in one period is a jerk of 1e5 rad/s^3. So a difference fades out along a Tau-J* curve in
//! real time, on top of the trajectory, which keeps the sum C3. It takes one ramp of the time scale: a stop that
//! begins later ends later, so at rest is at rest. Without a difference nothing is added, to the last bit.
use taustream_motion::stroke::Phi;
use taustream_motion::time_scale::RAMP_N;
use taustream_motion::{JointArray, Setpoint};

/// What is left of a difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Approach {
    offset_rad: JointArray,
    duration_s: f64,
    any: bool,
}

impl Approach {
    /// From `hold_pose_rad` to `base_rad` in `duration_s`.
    #[must_use]
    pub fn new(hold_pose_rad: &JointArray, base_rad: &JointArray, duration_s: f64) -> Self {
        let mut offset_rad = [0.0; taustream_motion::MAX_JOINTS];
        for (offset, (held, base)) in offset_rad.iter_mut().zip(hold_pose_rad.iter().zip(base_rad)) {
            *offset = held - base;
        }
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

    /// Adds what is left after `t_s` to a setpoint. Returns what it added to the positions, rad.
    ///
    /// Real time: one polynomial, no allocation.
    pub fn add_to(&self, setpoint: &mut Setpoint, t_s: f64) -> JointArray {
        let mut added_rad = [0.0; taustream_motion::MAX_JOINTS];
        if self.has_ended(t_s) {
            return added_rad;
        }
        let rate = 1.0 / self.duration_s;
        let phi = Phi::at(RAMP_N, t_s.max(0.0) * rate);
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
