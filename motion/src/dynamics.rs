//! Inverse dynamics and energy of a tree of rigid bodies.
//!
//! Torques, forces of prismatic joints, come from the recursive Newton-Euler equations over the tree, in the base's frame: outward the motion of every
//! body, inward the torque at its joint, which bears whatever hangs on it. Gravity enters as an acceleration of the base. Friction, gears and the
//! motors' own inertia are not part of it.
//!
//! Everything is held in arrays of [`MAX_JOINTS`] and owned, so that a real-time thread can keep it.
//!
//! Source: Luh, Walker and Paul, "On-line computational scheme for mechanical manipulators", Journal of Dynamic
//! Systems, Measurement, and Control 102, 1980.
use crate::chain::{Chain, Pose};
use crate::{JointArray, JointKind, MAX_JOINTS};
use nalgebra::{Matrix3, Vector3};

/// Everything that moves with one joint, as one rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Its mass.
    pub mass_kg: f64,
    /// Its centre of mass in the frame behind the joint.
    pub center_m: Vector3<f64>,
    /// Moments of inertia about the centre, along the axes of that frame.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl Body {
    /// A joint that carries nothing of its own.
    pub const NONE: Self = Self {
        mass_kg: 0.0,
        center_m: Vector3::new(0.0, 0.0, 0.0),
        inertia_kg_m2: Matrix3::from_array_storage(ZERO),
    };
}

const ZERO: nalgebra::ArrayStorage<f64, 3, 3> = nalgebra::ArrayStorage([[0.0; 3]; 3]);

/// The dynamics of one arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Dynamics {
    chain: Chain,
    bodies: [Body; MAX_JOINTS],
    gravity_m_s2: Vector3<f64>,
}

/// One joint and its body in the base's frame.
#[derive(Clone, Copy)]
struct Moving {
    kind: JointKind,
    axis: Vector3<f64>,
    /// Where the joint stands; a prismatic one with its body.
    at_m: Vector3<f64>,
    spin_rad_s: Vector3<f64>,
    /// Force on the joint's own body, and its moment about the joint.
    force_n: Vector3<f64>,
    moment_nm: Vector3<f64>,
}

impl Moving {
    const REST: Self = Self {
        kind: JointKind::Revolute,
        axis: Vector3::new(0.0, 0.0, 0.0),
        at_m: Vector3::new(0.0, 0.0, 0.0),
        spin_rad_s: Vector3::new(0.0, 0.0, 0.0),
        force_n: Vector3::new(0.0, 0.0, 0.0),
        moment_nm: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// How a frame moves, seen where its joint stands.
#[derive(Clone, Copy)]
struct Carried {
    spin: Vector3<f64>,
    spin_up: Vector3<f64>,
    at_m: Vector3<f64>,
    push: Vector3<f64>,
}

impl Carried {
    const REST: Self = Self {
        spin: Vector3::new(0.0, 0.0, 0.0),
        spin_up: Vector3::new(0.0, 0.0, 0.0),
        at_m: Vector3::new(0.0, 0.0, 0.0),
        push: Vector3::new(0.0, 0.0, 0.0),
    };
}

impl Dynamics {
    /// The dynamics of a chain with one body a joint, base first, and gravity in the base's frame. Bodies beyond the last
    /// joint do not count.
    #[must_use]
    pub fn new(chain: Chain, bodies: [Body; MAX_JOINTS], gravity_m_s2: Vector3<f64>) -> Self {
        Self { chain, bodies, gravity_m_s2 }
    }

    /// Torques in Nm that a motion needs at one instant, forces in N of prismatic joints; those of unused joints are zero.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn torques_nm(&self, q: &JointArray, v: &JointArray, a: &JointArray) -> JointArray {
        let mut moving = self.outward((&self.chain.frames(q), q), v, a);
        let mut torques = [0.0; MAX_JOINTS];
        for index in (0..self.chain.joints()).rev() {
            let (Some(joint), Some(torque)) = (moving.get(index).copied(), torques.get_mut(index)) else {
                continue;
            };
            *torque = match joint.kind {
                JointKind::Revolute => joint.axis.dot(&joint.moment_nm),
                JointKind::Prismatic => joint.axis.dot(&joint.force_n),
            };
            // A joint comes after the one that bears it.
            let before = self.chain.parent_frame(index).checked_sub(1);
            if let Some(before) = before.and_then(|before| moving.get_mut(before)) {
                let arm_m = joint.at_m - before.at_m;
                before.moment_nm = before.moment_nm + joint.moment_nm + arm_m.cross(&joint.force_n);
                before.force_n += joint.force_n;
            }
        }
        torques
    }

    /// Torques in Nm, forces in N of prismatic joints, that hold the arm at rest in a pose.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn holding_nm(&self, q: &JointArray) -> JointArray {
        let rest = [0.0; MAX_JOINTS];
        self.torques_nm(q, &rest, &rest)
    }

    /// The motion of every joint's body and what it needs, base to tip.
    fn outward(
        &self,
        (frames, q): (&[Pose], &JointArray),
        v: &JointArray,
        a: &JointArray,
    ) -> [Moving; MAX_JOINTS] {
        // An arm at rest on the ground is one that is accelerated upward in free space.
        let base = Carried { push: -self.gravity_m_s2, ..Carried::REST };
        let mut carried = [base; MAX_JOINTS + 1];
        let mut before_joint = base;
        let mut moving = [Moving::REST; MAX_JOINTS];
        for (i, (slot, body)) in moving.iter_mut().zip(&self.bodies).enumerate() {
            let parent_frame = self.chain.parent_frame(i);
            let (Some(joint), [Some(parent), Some(frame)]) =
                (self.chain.joint(i), [frames.get(parent_frame), frames.get(i + 1)])
            else {
                break;
            };
            if parent_frame != i {
                before_joint = carried.get(parent_frame).copied().unwrap_or(base);
            }
            let Carried { mut spin, mut spin_up, mut at_m, mut push } = before_joint;
            let before = parent * joint.pre;
            let axis = before.rotation * joint.axis.into_inner();
            let step = before.translation.vector - at_m;
            push += spin_up.cross(&step) + spin.cross(&spin.cross(&step));
            at_m = before.translation.vector;
            match joint.kind {
                JointKind::Revolute => {
                    spin_up += axis * a[i] + spin.cross(&axis) * v[i];
                    spin += axis * v[i];
                }
                JointKind::Prismatic => {
                    let slid = axis * (q[i] + joint.offset);
                    push += spin_up.cross(&slid) + spin.cross(&spin.cross(&slid));
                    // Coriolis, and the joint's own acceleration.
                    push += spin.cross(&axis) * (2.0 * v[i]) + axis * a[i];
                    at_m += slid;
                }
            }
            let lever = frame.rotation * body.center_m + frame.translation.vector - at_m;
            let force_n = body.mass_kg * (push + spin_up.cross(&lever) + spin.cross(&spin.cross(&lever)));
            let inertia = turned(frame, &body.inertia_kg_m2);
            let moment_nm = inertia * spin_up + spin.cross(&(inertia * spin)) + lever.cross(&force_n);
            *slot = Moving { kind: joint.kind, axis, at_m, spin_rad_s: spin, force_n, moment_nm };
            before_joint = Carried { spin, spin_up, at_m, push };
            if let Some(slot) = carried.get_mut(i + 1) {
                *slot = before_joint;
            }
        }
        moving
    }

    /// Kinetic and potential energy in J; the potential one is 0 with every centre in the base's origin.
    #[must_use]
    pub fn energy_j(&self, q: &JointArray, v: &JointArray) -> [f64; 2] {
        let frames = self.chain.frames(q);
        let moving = self.outward((&frames, q), v, &[0.0; MAX_JOINTS]);
        let (mut kinetic, mut potential) = (0.0, 0.0);
        let bodies = self.bodies.iter().zip(frames.iter().skip(1)).zip(&moving).take(self.chain.joints());
        for (i, ((body, frame), joint)) in bodies.enumerate() {
            let center = frame.rotation * body.center_m + frame.translation.vector;
            let before = moving.iter().zip(v).enumerate().filter(|(j, _)| self.chain.moves(*j, i + 1));
            let of_one = |joint: &Moving| match joint.kind {
                JointKind::Revolute => joint.axis.cross(&(center - joint.at_m)),
                JointKind::Prismatic => joint.axis,
            };
            let velocity: Vector3<f64> = before.map(|(_, (joint, v))| of_one(joint) * *v).sum();
            let spin = joint.spin_rad_s;
            kinetic += 0.5 * body.mass_kg * velocity.norm_squared();
            kinetic += 0.5 * spin.dot(&(turned(frame, &body.inertia_kg_m2) * spin));
            potential -= body.mass_kg * self.gravity_m_s2.dot(&center);
        }
        [kinetic, potential]
    }
}

/// Moments of inertia of a body whose frame stands at `frame`, along the base's axes.
fn turned(frame: &Pose, inertia_kg_m2: &Matrix3<f64>) -> Matrix3<f64> {
    let turn = frame.rotation.to_rotation_matrix();
    turn * inertia_kg_m2 * turn.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chain::ChainJoint;
    use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion};
    use std::f64::consts::PI;

    /// Numbers from -1 to 1 that every run has in the same order.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f64::from(u32::try_from(self.0 >> 32).unwrap()) / f64::from(u32::MAX) * 2.0 - 1.0
        }
        fn vector(&mut self) -> Vector3<f64> {
            Vector3::new(self.next(), self.next(), self.next())
        }
        fn pose(&mut self) -> Pose {
            let turn = UnitQuaternion::from_scaled_axis(self.vector() * PI);
            Isometry3::from_parts(Translation3::from(self.vector() * 0.4), turn)
        }
        fn joints(&mut self, count: usize) -> JointArray {
            let mut all = [0.0; MAX_JOINTS];
            all.iter_mut().take(count).for_each(|slot| *slot = 2.0 * self.next());
            all
        }
    }

    fn arm(random: &mut Random, count: usize) -> Dynamics {
        let joint = |random: &mut Random| ChainJoint {
            kind: if random.next() > 0.3 { JointKind::Prismatic } else { JointKind::Revolute },
            pre: random.pose(),
            axis: Unit::new_normalize(random.vector()),
            offset: random.next(),
            post: random.pose(),
        };
        let joints: std::vec::Vec<ChainJoint> = (0..count).map(|_| joint(random)).collect();
        let mut bodies = [Body::NONE; MAX_JOINTS];
        for body in bodies.iter_mut().take(count) {
            let root = Matrix3::from_columns(&[random.vector(), random.vector(), random.vector()]) * 0.2;
            let (mass_kg, center_m) = (3.0 + 2.0 * random.next(), random.vector() * 0.2);
            *body = Body { mass_kg, center_m, inertia_kg_m2: root * root.transpose() };
        }
        // Every other one is a tree.
        let mut parent = |joint: usize| {
            if count.is_multiple_of(2) || random.next() > 0.0 { joint } else { joint / 2 }
        };
        let parents: std::vec::Vec<usize> = (0..count).map(&mut parent).collect();
        let chain = Chain::tree(&joints, &parents, &[count]).unwrap();
        Dynamics::new(chain, bodies, random.vector() * 9.8)
    }

    /// Goal: the torques are those of the Lagrangian, whose energies come from another function: work in is energy gained.
    #[test]
    fn power_of_the_joints_is_the_rate_of_energy_for_any_arm() {
        for seed in 0..200_u64 {
            let mut random = Random(seed * 977 + 5);
            let count = 1 + usize::try_from(seed).unwrap() % MAX_JOINTS;
            let arm = arm(&mut random, count);
            let (q, v, a) = (random.joints(count), random.joints(count), random.joints(count));
            let power: f64 = arm.torques_nm(&q, &v, &a).iter().zip(&v).map(|(t, v)| t * v).sum();
            let energy = |t: f64| -> f64 {
                let q: JointArray = std::array::from_fn(|i| q[i] + v[i] * t + 0.5 * a[i] * t * t);
                let v: JointArray = std::array::from_fn(|i| v[i] + a[i] * t);
                arm.energy_j(&q, &v).iter().sum()
            };
            // Two central differences, Richardson's combination: the error is of fourth order.
            let slope = |h: f64| (energy(h) - energy(-h)) / (2.0 * h);
            let rate = (4.0 * slope(1e-3) - slope(2e-3)) / 3.0;
            assert!(
                (power - rate).abs() < 1e-6 * (1.0 + power.abs()),
                "seed {seed}: {power} W against {rate} W"
            );
        }
    }

    #[test]
    fn bodies_beyond_the_last_joint_and_unused_joints_change_nothing() {
        let mut random = Random(3);
        let mut arm = arm(&mut random, 4);
        let (q, v, a) = (random.joints(MAX_JOINTS), random.joints(MAX_JOINTS), random.joints(MAX_JOINTS));
        let torques = arm.torques_nm(&q, &v, &a);
        arm.bodies[5] = Body { mass_kg: 10.0, ..arm.bodies[1] };
        assert_eq!(arm.torques_nm(&q, &v, &a).map(f64::to_bits), torques.map(f64::to_bits));
        assert!(torques.iter().skip(4).all(|torque| *torque == 0.0));
        assert!(torques.iter().take(4).all(|torque| torque.abs() > 1e-3), "{torques:?}");
    }

    #[test]
    fn holding_torque_of_a_level_rod_is_its_weight_at_half_its_length() {
        let rod =
            Body { mass_kg: 2.0, center_m: Vector3::new(-0.5, 0.0, 0.0), inertia_kg_m2: Matrix3::zeros() };
        let mut bodies = [Body::NONE; MAX_JOINTS];
        bodies[0] = rod;
        let chain = Chain::new(&[ChainJoint::from_dh(1.0, 0.0, 0.0, 0.0)]).unwrap();
        let arm = Dynamics::new(chain, bodies, Vector3::new(0.0, -9.8, 0.0));
        let at = |angle_rad: f64| {
            let mut pose = [0.0; MAX_JOINTS];
            pose[0] = angle_rad;
            arm.holding_nm(&pose)[0]
        };
        assert!((at(0.0) - 9.8).abs() < 1e-12 && at(0.5 * PI).abs() < 1e-12 && (at(PI) + 9.8).abs() < 1e-12);
    }
}
