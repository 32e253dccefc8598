//! Masses: what links and payload weigh, and how that is spread.
//!
//! They say how much energy a motion takes; no setpoint and no proof depends on them.
use crate::reader::{Bounds, Table};
use nalgebra::{Matrix3, Point3, Vector3};
use taustream_motion::chain::Pose;

/// The mass of one link, or of the payload, rigid with a frame of the chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkMass {
    /// Index of the link in [`crate::Robot::links`].
    pub link: usize,
    /// Index into the chain's frames.
    pub frame: usize,
    /// The mass.
    pub mass_kg: f64,
    /// Its centre in that frame.
    pub center_m: Point3<f64>,
    /// Moments of inertia about its centre, along the axes of that frame; zero for what is as good as a point.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl LinkMass {
    /// A weight that is stated in a frame which stands at `pose` in frame `frame` of the chain.
    pub(crate) fn placed(weight: &Weight, link: usize, (frame, pose): (usize, Pose)) -> Self {
        let turn = pose.rotation.to_rotation_matrix();
        Self {
            link,
            frame,
            mass_kg: weight.mass_kg,
            center_m: pose * Point3::from(weight.center_m),
            inertia_kg_m2: turn * weight.inertia() * turn.transpose(),
        }
    }
}

/// A mass as a file states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weight {
    pub(crate) mass_kg: f64,
    pub(crate) center_m: [f64; 3],
    /// xx, yy, zz, xy, xz, yz about the centre.
    pub(crate) inertia_kg_m2: [f64; 6],
}

/// Keys of mass, centre and moments.
pub(crate) type Keys = [&'static str; 3];
/// In the table of a joint: of the link behind it.
pub(crate) const LINK: Keys = ["link_mass_kg", "link_center_m", "link_inertia_kg_m2"];
/// In the table of the payload.
pub(crate) const PAYLOAD: Keys = ["mass_kg", "center_m", "inertia_kg_m2"];

pub(crate) const MASS_KG: Bounds = Bounds::within(0.0, 1e5, "kg");
pub(crate) const MOMENT_KG_M2: Bounds = Bounds::within(-1e5, 1e5, "kg m^2");
const CENTER_M: Bounds = Bounds::within(-10.0, 10.0, "m");
/// Where gravity points when the file does not say: the base stands on the floor.
pub(crate) const GRAVITY_M_S2: [f64; 3] = [0.0, 0.0, -9.806_65];
const GRAVITY_BOUNDS_M_S2: Bounds = Bounds::within(-100.0, 100.0, "m/s^2");
/// Moments of thin parts lie on the edge of what is possible, and files round them.
const MOMENT_SLACK: f64 = 0.01;

impl Weight {
    /// Reads a weight, if any of its keys is there; the outer `None` is a fault.
    pub(crate) fn read(table: &mut Table<'_>, [mass, center, inertia]: Keys) -> Option<Option<Self>> {
        if ![mass, center, inertia].into_iter().any(|key| table.has(key)) {
            // Asked for, so that they are listed among the known keys.
            for key in [mass, center, inertia] {
                table.take(key);
            }
            return Some(None);
        }
        let mass_kg = table.number(mass, &MASS_KG);
        let center_m = table.numbers(center, &CENTER_M);
        let moments = table.numbers_or(inertia, [0.0; 6], &MOMENT_KG_M2);
        let weight = Self { mass_kg: mass_kg?, center_m: center_m?, inertia_kg_m2: moments? };
        if weight.is_possible() {
            return Some(Some(weight));
        }
        table.fault(inertia, &format!("{:?}", weight.inertia_kg_m2), POSSIBLE);
        None
    }
    /// Gravity in the base's frame.
    pub(crate) fn read_gravity(top: &mut Table<'_>) -> Option<[f64; 3]> {
        top.numbers_or("gravity_m_s2", GRAVITY_M_S2, &GRAVITY_BOUNDS_M_S2)
    }
    fn inertia(&self) -> Matrix3<f64> {
        let [xx, yy, zz, xy, xz, yz] = self.inertia_kg_m2;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
    /// True when some body has these moments: none is negative, and none above the sum of the two others.
    pub(crate) fn is_possible(&self) -> bool {
        let spread: Vector3<f64> = self.inertia().symmetric_eigenvalues();
        let all = spread.sum();
        let largest = spread.max();
        all.is_finite()
            && spread.min() >= -MOMENT_SLACK * all
            && largest <= (0.5 + MOMENT_SLACK) * all + 1e-12
    }
}

/// What moments must be.
pub(crate) const POSSIBLE: &str =
    "moments [xx, yy, zz, xy, xz, yz] of a body: none negative, none above the sum of the two others";

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Vector3};
    use std::f64::consts::FRAC_PI_2;

    fn weight(inertia_kg_m2: [f64; 6]) -> Weight {
        Weight { mass_kg: 2.0, center_m: [0.1, 0.0, 0.0], inertia_kg_m2 }
    }

    #[test]
    fn moments_of_bodies_are_possible_and_others_are_not() {
        // A point, a rod, a plate, a turned plate, and a rod whose file rounds.
        for moments in [
            [0.0; 6],
            [0.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 2.0, 0.0, 0.0, 0.0],
            [1.5, 1.5, 1.0, 0.5, 0.0, 0.0],
            [0.0, 0.134, 0.133, 0.0, 0.0, 0.0],
        ] {
            assert!(weight(moments).is_possible(), "{moments:?}");
        }
        for moments in [
            [-1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 3.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 2.0, 0.0, 0.0],
            [f64::NAN, 1.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        ] {
            assert!(!weight(moments).is_possible(), "{moments:?}");
        }
    }

    /// Goal: a weight that is stated in a turned frame is where and how that frame has it.
    #[test]
    fn weight_turns_with_the_frame_that_it_is_stated_in() {
        let pose = Isometry3::new(Vector3::new(0.0, 0.0, 1.0), Vector3::z() * FRAC_PI_2);
        let placed = LinkMass::placed(&weight([1.0, 2.0, 2.5, 0.0, 0.3, 0.0]), 3, (2, pose));
        assert!((placed.center_m - Point3::new(0.0, 0.1, 1.0)).norm() < 1e-15);
        // x becomes y, and y becomes -x.
        let turned = Matrix3::new(2.0, 0.0, 0.0, 0.0, 1.0, 0.3, 0.0, 0.3, 2.5);
        assert!((placed.inertia_kg_m2 - turned).norm() < 1e-15, "{}", placed.inertia_kg_m2);
    }
}
