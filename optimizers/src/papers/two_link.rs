//! The two-link arm of Sengupta et al. (2011): the first link swings in a vertical plane, the second stays horizontal.
//!
//! θ is the first link's angle from the upward axis in the plane at azimuth α; φ is the second link's azimuth. Units are
//! the paper's relative ones for lengths and masses, radians and seconds; g is 9.81 of those lengths a second squared,
//! since the paper gives none.
//!
//! Source: eq. 1 to 3 and 12. Kinetic energy as printed, for any α. Corrected against printed: the first link's part of
//! the potential energy is positive (printed: negative, an arm that hangs from a base with z downward, although θ is
//! measured from "the positive z-axis").
use crate::Reading;

/// Gravity, in lengths of the arm's unit a second squared.
pub const GRAVITY: f64 = 9.81;

/// The arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoLink {
    /// Lengths L1 and L2.
    pub lengths: [f64; 2],
    /// Masses m1 and m2, spread evenly along the links.
    pub masses: [f64; 2],
    /// Azimuth α of the first link's plane, in radians.
    pub azimuth_rad: f64,
    /// Height H of the base above the ground.
    pub height: f64,
    /// Gravity; nothing switches it off.
    pub gravity: f64,
    /// Which reading of the potential energy.
    pub reading: Reading,
}

/// Angles θ and φ and their derivatives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moving {
    /// Angles in radians.
    pub angle_rad: [f64; 2],
    /// Speeds.
    pub speed_rad_s: [f64; 2],
    /// Accelerations.
    pub acceleration_rad_s2: [f64; 2],
}

impl TwoLink {
    /// The paper's arm.
    pub const PAPER_004: Self = Self {
        lengths: [5.0, 5.0],
        masses: [1.0, 1.0],
        azimuth_rad: std::f64::consts::FRAC_PI_2,
        height: 20.0,
        gravity: GRAVITY,
        reading: Reading::Corrected,
    };
    /// Ranges of θ and φ in radians.
    pub const RANGES_RAD: [[f64; 2]; 2] = [[0.0, std::f64::consts::FRAC_PI_2], [0.0, std::f64::consts::PI]];

    /// Elbow and tip, from the base.
    #[must_use]
    pub fn points(&self, [theta, phi]: [f64; 2]) -> [[f64; 3]; 2] {
        let [l1, l2] = self.lengths;
        let (out, up) = (l1 * theta.sin(), l1 * theta.cos());
        let elbow = [out * self.azimuth_rad.cos(), out * self.azimuth_rad.sin(), up];
        [elbow, [elbow[0] + l2 * phi.cos(), elbow[1] + l2 * phi.sin(), up]]
    }

    /// Kinetic and potential energy.
    #[must_use]
    pub fn energy(&self, moving: &Moving) -> [f64; 2] {
        let ([l1, l2], [m1, m2]) = (self.lengths, self.masses);
        let ([theta, phi], [v, w]) = (moving.angle_rad, moving.speed_rad_s);
        let coupling = theta.cos() * (self.azimuth_rad - phi).sin();
        let kinetic = 0.5 * m2 * l1 * l1 * v * v
            + (m1 * l1 * l1 * v * v + m2 * l2 * l2 * w * w) / 6.0
            + 0.5 * m2 * l1 * l2 * coupling * v * w;
        let sign = match self.reading {
            Reading::Corrected => 1.0,
            Reading::Printed => -1.0,
        };
        let potential = self.gravity * (self.height * (m1 + m2) + sign * l1 * (0.5 * m1 + m2) * theta.cos());
        [kinetic, potential]
    }

    /// Torques of both joints, for the work that they do: Lagrange's equations of [`Self::energy`].
    #[must_use]
    pub fn torques(&self, moving: &Moving) -> [f64; 2] {
        let ([l1, l2], [m1, m2]) = (self.lengths, self.masses);
        let ([theta, phi], [v, w], [a, b]) =
            (moving.angle_rad, moving.speed_rad_s, moving.acceleration_rad_s2);
        let (sin, cos) = (self.azimuth_rad - phi).sin_cos();
        let link = 0.5 * m2 * l1 * l2;
        let sign = match self.reading {
            Reading::Corrected => 1.0,
            Reading::Printed => -1.0,
        };
        let weight = sign * (0.5 * m1 + m2) * self.gravity * l1 * theta.sin();
        let first = (m1 / 3.0 + m2) * l1 * l1 * a + link * theta.cos() * (sin * b - cos * w * w) - weight;
        let second = m2 / 3.0 * l2 * l2 * b + link * sin * (theta.cos() * a - theta.sin() * v * v);
        [first, second]
    }
}
