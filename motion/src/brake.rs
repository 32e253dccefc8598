//! The closed-form jerk-limited brake of one joint: from any velocity and acceleration to rest, off the path.

/// How one joint moves at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointState {
    /// Link angle.
    pub position_rad: f64,
    /// Its first derivative.
    pub velocity_rad_s: f64,
    /// Its second derivative.
    pub acceleration_rad_s2: f64,
}

/// At most four pieces of constant jerk that bring a joint to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Brake {
    start: JointState,
    jerk_rad_s3: [f64; 4],
    duration_s: [f64; 4],
}

impl Brake {
    /// The time-optimal brake inside `acceleration_rad_s2` and `jerk_rad_s3`; a start acceleration beyond the limit is
    /// first brought back inside it. Values that are not finite or limits that are not positive give a brake of zero length.
    ///
    /// Real time: closed form, no loop, no allocation.
    #[must_use]
    pub fn from_state(_start: JointState, _acceleration_rad_s2: f64, _jerk_rad_s3: f64) -> Self {
        todo!("motion")
    }
    /// How long it takes.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        todo!("motion")
    }
    /// State and jerk (rad/s^3) after `t_s`; at rest after the end.
    #[must_use]
    pub fn sample(&self, _t_s: f64) -> (JointState, f64) {
        todo!("motion")
    }
    /// Where the joint comes to rest.
    #[must_use]
    pub fn rest_rad(&self) -> f64 {
        todo!("motion")
    }
    /// Lowest and highest angle on the way.
    #[must_use]
    pub fn sweep_rad(&self) -> [f64; 2] {
        todo!("motion")
    }
}
