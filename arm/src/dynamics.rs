//! The rigid-body dynamics of a robot: the masses that its files state, gathered joint by joint.
use crate::Robot;
use crate::mass::LinkMass;
use nalgebra::{Matrix3, Vector3};
use taustream_motion::MAX_JOINTS;
use taustream_motion::dynamics::{Body, Dynamics};

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

impl Robot {
    /// Its dynamics by the masses of its links and of its payload.
    ///
    /// # Errors
    /// When nothing that moves has a mass.
    pub fn dynamics(&self) -> Result<Dynamics, NoMasses> {
        let bodies = self.bodies();
        if bodies.iter().all(|body| body.mass_kg <= 0.0) {
            return Err(NoMasses { robot: self.name.clone() });
        }
        Ok(Dynamics::new(self.chain, bodies, self.gravity_m_s2))
    }

    /// What moves with each joint, as one body.
    pub(crate) fn bodies(&self) -> [Body; MAX_JOINTS] {
        let mut bodies = [Body::NONE; MAX_JOINTS];
        for (joint, body) in bodies.iter_mut().enumerate().take(self.joints.len()) {
            *body = gather(self.masses.iter().filter(|m| m.frame == joint + 1));
        }
        bodies
    }
}

/// Several masses as one: their common centre, and Steiner's terms about it.
fn gather<'m>(masses: impl Iterator<Item = &'m LinkMass> + Clone) -> Body {
    let mass_kg: f64 = masses.clone().map(|m| m.mass_kg).sum();
    let moments: Vector3<f64> = masses.clone().map(|m| m.center_m.coords * m.mass_kg).sum();
    let center_m = if mass_kg > 0.0 { moments / mass_kg } else { Vector3::zeros() };
    let about = |m: &LinkMass| {
        let off = m.center_m.coords - center_m;
        m.inertia_kg_m2 + (Matrix3::identity() * off.norm_squared() - off * off.transpose()) * m.mass_kg
    };
    Body { mass_kg, center_m, inertia_kg_m2: masses.map(about).sum() }
}
