//! Whether a joint turns or slides, and with that the units of everything that is said about it.

/// How a joint moves what hangs on it.
///
/// The value decides what the numbers of a joint mean: arrays of joints hold radians for one that turns and metres for one that
/// slides, whatever the ending `_rad` of their names says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// It turns about its axis: positions in rad, forces in Nm.
    #[default]
    Revolute,
    /// It slides along its axis: positions in m, forces in N.
    Prismatic,
}

impl JointKind {
    /// The word of URDF and of robot files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
        }
    }
    /// The unit of its position.
    #[must_use]
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Revolute => "rad",
            Self::Prismatic => "m",
        }
    }
    /// The unit of the n-th derivative of its position by time, up to the third.
    #[must_use]
    pub const fn rate_unit(self, order: usize) -> &'static str {
        match (self, order) {
            (Self::Revolute, 0) => "rad",
            (Self::Revolute, 1) => "rad/s",
            (Self::Revolute, 2) => "rad/s^2",
            (Self::Revolute, _) => "rad/s^3",
            (Self::Prismatic, 0) => "m",
            (Self::Prismatic, 1) => "m/s",
            (Self::Prismatic, 2) => "m/s^2",
            (Self::Prismatic, _) => "m/s^3",
        }
    }
    /// The keys of its velocity, acceleration and jerk in files and reports.
    #[must_use]
    pub const fn rate_keys(self) -> [&'static str; 3] {
        match self {
            Self::Revolute => ["velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"],
            Self::Prismatic => ["velocity_m_s", "acceleration_m_s2", "jerk_m_s3"],
        }
    }
    /// The unit of what its drive gives.
    #[must_use]
    pub const fn force_unit(self) -> &'static str {
        match self {
            Self::Revolute => "Nm",
            Self::Prismatic => "N",
        }
    }
    /// The key of the greatest torque or force in files.
    #[must_use]
    pub const fn force_key(self) -> &'static str {
        match self {
            Self::Revolute => "torque_nm_max",
            Self::Prismatic => "force_n_max",
        }
    }
    /// True for a joint that slides.
    #[must_use]
    pub const fn is_prismatic(self) -> bool {
        matches!(self, Self::Prismatic)
    }
}
