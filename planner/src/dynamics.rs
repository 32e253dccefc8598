//! Rigid-body dynamics of an arm, and the mechanical energy that a motion takes.
//!
//! Torques come from the recursive Newton-Euler equations over the chain, in the base's frame: outward what every link
//! does, inward what its joint must carry. Gravity enters as an acceleration of the base. Friction, gears and the
//! motors' own inertia are not known here; what the drives draw is more.
//!
//! Source: Luh, Walker and Paul, "On-line computational scheme for mechanical manipulators", Journal of Dynamic
//! Systems, Measurement, and Control 102, 1980. The energy is what Sengupta et al. (2011) should have minimised: it
//! integrates kinetic plus potential energy over time, whose unit is an action.
use nalgebra::{Matrix3, Vector3};
use taustream_arm::{LinkMass, Robot};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS, Trajectory};
use taustream_optimizers::papers::quadrature::gauss;

/// Everything that moves with one joint, as one body.
#[derive(Clone, Copy, Debug)]
struct Heavy {
    mass_kg: f64,
    /// In the frame behind the joint.
    center_m: Vector3<f64>,
    /// About the centre, along the frame's axes.
    inertia_kg_m2: Matrix3<f64>,
}

/// The dynamics of one arm.
#[derive(Clone, Debug)]
pub struct Dynamics<'a> {
    robot: &'a Robot,
    bodies: Vec<Heavy>,
}

/// A robot file without masses.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "robot `{robot}` states no mass of anything that moves, so the energy of a motion is not known; add link_mass_kg and \
     link_center_m to its joints (or <inertial> to its URDF), or choose by time"
)]
pub struct NoMasses {
    /// The robot's name.
    pub robot: String,
}

/// How a joint stands and turns in the base's frame.
#[derive(Clone, Copy)]
struct Turning {
    axis: Vector3<f64>,
    at_m: Vector3<f64>,
    spin_rad_s: Vector3<f64>,
    /// Force on what the joint carries alone, and moment about the joint.
    force_n: Vector3<f64>,
    moment_nm: Vector3<f64>,
}

/// Longest piece over which power is taken for smooth: its kinks, where a joint's power changes sign, then cost less
/// than a part in ten thousand.
const PIECE_S: f64 = 0.02;
/// Most pieces: a motion of a day is as good as one that is sampled more coarsely.
const PIECES_MAX: f64 = 20_000.0;
/// Instants of a rough look.
const ROUGH_INSTANTS: u32 = 48;

impl<'a> Dynamics<'a> {
    /// Gathers the masses.
    ///
    /// # Errors
    /// When nothing that moves has a mass.
    pub fn new(robot: &'a Robot) -> Result<Self, NoMasses> {
        let with = |joint: usize| robot.masses.iter().filter(move |m| m.frame == joint + 1);
        let bodies: Vec<Heavy> = (0..robot.joints.len()).map(|joint| gather(with(joint))).collect();
        if bodies.iter().all(|body| body.mass_kg <= 0.0) {
            return Err(NoMasses { robot: robot.name.clone() });
        }
        Ok(Self { robot, bodies })
    }

    /// Torques in Nm that a motion needs at one instant; those of unused joints are zero.
    #[must_use]
    pub fn torques_nm(&self, q: &JointArray, v: &JointArray, a: &JointArray) -> JointArray {
        let frames = self.robot.chain.frames(q);
        let turning = self.outward(&frames, v, a);
        let mut torques = [0.0; MAX_JOINTS];
        let (mut force, mut moment, mut behind) = (Vector3::zeros(), Vector3::zeros(), Vector3::zeros());
        for (joint, torque) in turning.iter().zip(&mut torques).rev() {
            moment = joint.moment_nm + moment + (behind - joint.at_m).cross(&force);
            force += joint.force_n;
            behind = joint.at_m;
            *torque = joint.axis.dot(&moment);
        }
        torques
    }

    /// What every joint carries alone, base to tip.
    fn outward(&self, frames: &[Pose], v: &JointArray, a: &JointArray) -> Vec<Turning> {
        let (mut spin, mut spin_up) = (Vector3::zeros(), Vector3::zeros());
        // An arm at rest on the ground is one that is accelerated upward in free space.
        let (mut at_m, mut push) = (Vector3::zeros(), -self.robot.gravity_m_s2);
        let mut turning = Vec::with_capacity(self.bodies.len());
        for (i, body) in self.bodies.iter().enumerate() {
            let (Some(joint), [Some(parent), Some(frame)]) =
                (self.robot.chain.joint(i), [frames.get(i), frames.get(i + 1)])
            else {
                break;
            };
            let before = parent * joint.pre;
            let axis = before.rotation * joint.axis.into_inner();
            let step = before.translation.vector - at_m;
            push += spin_up.cross(&step) + spin.cross(&spin.cross(&step));
            at_m = before.translation.vector;
            spin_up += axis * a[i] + spin.cross(&axis) * v[i];
            spin += axis * v[i];
            let lever = frame.rotation * body.center_m + frame.translation.vector - at_m;
            let force_n = body.mass_kg * (push + spin_up.cross(&lever) + spin.cross(&spin.cross(&lever)));
            let inertia = turned(frame, &body.inertia_kg_m2);
            let moment_nm = inertia * spin_up + spin.cross(&(inertia * spin)) + lever.cross(&force_n);
            turning.push(Turning { axis, at_m, spin_rad_s: spin, force_n, moment_nm });
        }
        turning
    }

    /// Kinetic and potential energy in J; the potential one is 0 with every centre in the base's origin.
    #[must_use]
    pub fn energy_j(&self, q: &JointArray, v: &JointArray) -> [f64; 2] {
        let frames = self.robot.chain.frames(q);
        let turning = self.outward(&frames, v, &[0.0; MAX_JOINTS]);
        let (mut kinetic, mut potential) = (0.0, 0.0);
        for (i, (body, frame)) in self.bodies.iter().zip(frames.iter().skip(1)).enumerate() {
            let center = frame.rotation * body.center_m + frame.translation.vector;
            let before = turning.iter().zip(v).take(i + 1);
            let velocity: Vector3<f64> =
                before.map(|(joint, v)| joint.axis.cross(&(center - joint.at_m)) * *v).sum();
            let spin = turning.get(i).map_or_else(Vector3::zeros, |joint| joint.spin_rad_s);
            kinetic += 0.5 * body.mass_kg * velocity.norm_squared();
            kinetic += 0.5 * spin.dot(&(turned(frame, &body.inertia_kg_m2) * spin));
            potential -= body.mass_kg * self.robot.gravity_m_s2.dot(&center);
        }
        [kinetic, potential]
    }

    /// Work of the joints along a motion in J, the integral of the sum of |torque x speed|: what drives that recover
    /// nothing give and brake away.
    #[must_use]
    pub fn spent_j(&self, motion: &Trajectory) -> f64 {
        let pieces = (motion.duration_s() / PIECE_S).ceil().clamp(1.0, PIECES_MAX);
        let piece_s = motion.duration_s() / pieces;
        let power_w = |t_s: f64| {
            let at = motion.sample(t_s);
            self.power_w(&at.position_rad, &at.velocity_rad_s, &at.acceleration_rad_s2)
        };
        let (mut piece, mut spent_j) = (0.0, 0.0);
        while piece < pieces {
            spent_j += gauss(piece * piece_s, (piece + 1.0) * piece_s, power_w);
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
        let torques = self.torques_nm(q, v, a);
        torques.iter().zip(v).map(|(torque, speed)| (torque * speed).abs()).sum()
    }
}

/// Several masses as one: their common centre, and Steiner's terms about it.
fn gather<'m>(masses: impl Iterator<Item = &'m LinkMass> + Clone) -> Heavy {
    let mass_kg: f64 = masses.clone().map(|m| m.mass_kg).sum();
    let moments: Vector3<f64> = masses.clone().map(|m| m.center_m.coords * m.mass_kg).sum();
    let center_m = if mass_kg > 0.0 { moments / mass_kg } else { Vector3::zeros() };
    let about = |m: &LinkMass| {
        let off = m.center_m.coords - center_m;
        m.inertia_kg_m2 + (Matrix3::identity() * off.norm_squared() - off * off.transpose()) * m.mass_kg
    };
    Heavy { mass_kg, center_m, inertia_kg_m2: masses.map(about).sum() }
}

fn turned(frame: &Pose, inertia_kg_m2: &Matrix3<f64>) -> Matrix3<f64> {
    let turn = frame.rotation.to_rotation_matrix();
    turn * inertia_kg_m2 * turn.transpose()
}
