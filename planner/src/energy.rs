//! The mechanical energy that a motion takes.
//!
//! Friction, gears and the motors' own inertia are not known here; what the drives draw is more. The energy is what
//! Sengupta et al. (2011) should have minimised: the paper integrates kinetic plus potential energy over time, whose unit is
//! an action.
use taustream_arm::{NoMasses, Robot};
use taustream_motion::dynamics::Dynamics;
use taustream_motion::trajectory::Cursor;
use taustream_motion::{JointArray, Trajectory};
use taustream_optimizers::papers::quadrature::gauss;

/// Energies of the motions of one arm.
#[derive(Clone, Debug)]
pub struct Energy {
    dynamics: Dynamics,
}

/// Longest piece over which power is taken for smooth: its kinks, where a joint's power changes sign, then cost less
/// than a part in ten thousand.
const PIECE_S: f64 = 0.02;
/// Most pieces: a motion of a day is as good as one that is sampled more coarsely.
const PIECES_MAX: f64 = 20_000.0;
/// Instants of a rough look.
const ROUGH_INSTANTS: u32 = 48;

impl Energy {
    /// By the masses of a robot.
    ///
    /// # Errors
    /// When nothing that moves has a mass.
    pub fn of(robot: &Robot) -> Result<Self, NoMasses> {
        Ok(Self { dynamics: robot.dynamics()? })
    }

    /// Work of the joints along a motion in J, the integral of the sum of |torque x speed|: what drives that recover
    /// nothing give and brake away.
    #[must_use]
    pub fn spent_j(&self, motion: &Trajectory) -> f64 {
        let pieces = (motion.duration_s() / PIECE_S).ceil().clamp(1.0, PIECES_MAX);
        let piece_s = motion.duration_s() / pieces;
        let mut cursor = Cursor::at_start(motion);
        let mut power_w = |t_s: f64| {
            let at = cursor.sample(motion, t_s);
            self.power_w(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2)
        };
        let (mut piece, mut spent_j) = (0.0, 0.0);
        while piece < pieces {
            spent_j += gauss(piece * piece_s, (piece + 1.0) * piece_s, &mut power_w);
            piece += 1.0;
        }
        spent_j
    }

    /// The same from few instants: rough, quick, and smooth enough for an optimiser.
    #[must_use]
    pub fn spent_roughly_j(&self, motion: &Trajectory) -> f64 {
        let step_s = motion.duration_s() / f64::from(ROUGH_INSTANTS);
        let power_w = |i: u32| {
            let at = motion.sample((f64::from(i) + 0.5) * step_s);
            self.power_w(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2)
        };
        (0..ROUGH_INSTANTS).map(power_w).sum::<f64>() * step_s
    }

    /// Sum of |torque x speed| over the joints, W.
    #[must_use]
    pub fn power_w(&self, q: &JointArray, v: &JointArray, a: &JointArray) -> f64 {
        let torques = self.dynamics.torques_nm(q, v, a);
        torques.iter().zip(v).map(|(torque, speed)| (torque * speed).abs()).sum()
    }
}
