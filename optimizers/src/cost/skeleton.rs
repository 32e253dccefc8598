//! The chain in the form that the kernel likes: every joint turns about z, and what lies between two of them is a
//! shift and a tilt about x.
//!
//! Any rotation is Rz(a) Rx(alpha) Rz(b), and the two turns about z go into the angles of the joints beside it. So a
//! chain of any kind of rows, or of a URDF, becomes angles q + offset, shifts and tilts. A tilt of nothing means that
//! the next joint is parallel: positions then need the sum of the angles only, and no rotation between (a UR5 has
//! three such joints). That is found from the constants.
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use taustream_motion::chain::{Chain, ChainJoint, Pose};

/// Shorter than this, in metres or as a sine, is nothing; the bound on the error has room for it.
pub(super) const NOTHING: f64 = 1e-12;

/// One joint.
#[derive(Clone, Debug)]
pub(super) struct LinkSegment {
    /// Added to the joint's position.
    pub(super) offset_rad: f64,
    /// The origin of the frame behind the joint, seen from the joint when it has turned.
    pub(super) origin_m: Vector3<f64>,
    /// The next joint, seen likewise; the last joint's is its origin.
    pub(super) next_m: Vector3<f64>,
    /// Cosine and sine of the tilt to the next joint's axis; `None` when that axis is parallel or there is none.
    pub(super) tilt: Option<[f64; 2]>,
}

impl LinkSegment {
    /// The longer one of its shifts.
    pub(super) fn length_m(&self) -> f64 {
        self.next_m.norm().max(self.origin_m.norm())
    }
}

/// A chain.
#[derive(Clone, Debug)]
pub(super) struct Skeleton {
    /// The first joint, seen from the base.
    pub(super) root: Pose,
    /// The joints, base to tip.
    pub(super) link_segments: Vec<LinkSegment>,
}

impl Skeleton {
    /// The skeleton of a chain of revolute joints.
    pub(super) fn new(chain: &Chain) -> Self {
        let joints: Vec<&ChainJoint> = (0..chain.joints()).filter_map(|j| chain.joint(j)).collect();
        let upright = |j: &ChainJoint| {
            let turn = UnitQuaternion::rotation_between(&Vector3::z_axis(), &j.axis);
            // Exactly opposite: any half turn about a perpendicular.
            let turn = turn
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            Pose::from_parts(nalgebra::Translation3::identity(), turn)
        };
        let root = joints.first().map_or_else(Pose::identity, |j| j.pre * upright(j));
        let mut carried_rad = 0.0;
        let mut link_segments = Vec::with_capacity(joints.len());
        for (i, joint) in joints.iter().enumerate() {
            let own = upright(joint).inverse() * joint.post;
            let between = joints.get(i + 1).map(|next| own * next.pre * upright(next));
            let [before_rad, tilt_rad, behind_rad] = between.map_or([0.0; 3], |b| zxz(&b.rotation));
            let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -before_rad);
            let seen = |shift: Vector3<f64>| (back * shift).map(|x| if x.abs() < NOTHING { 0.0 } else { x });
            let origin_m = seen(own.translation.vector);
            let next_m = between.map_or(origin_m, |b| seen(b.translation.vector));
            let tilt = [tilt_rad.cos(), tilt_rad.sin()].map(|x| if x.abs() < NOTHING { 0.0 } else { x });
            let tilt = (tilt[1] != 0.0 || tilt[0] < 0.0).then_some(tilt);
            link_segments.push(LinkSegment {
                offset_rad: joint.offset + carried_rad + before_rad,
                origin_m,
                next_m,
                tilt,
            });
            carried_rad = behind_rad;
        }
        Self { root, link_segments }
    }

    /// The base frame's origin, seen from the first joint.
    pub(super) fn base_m(&self) -> Vector3<f64> {
        let base = self.root.inverse_transform_point(&Point3::origin());
        base.coords.map(|x| if x.abs() < NOTHING { 0.0 } else { x })
    }

    /// Furthest that anything of the arm can be from the first joint, or the base frame.
    pub(super) fn reach_m(&self) -> f64 {
        self.link_segments.iter().map(LinkSegment::length_m).sum::<f64>() + self.base_m().norm()
    }
}

/// The angles a, alpha, b of a rotation Rz(a) Rx(alpha) Rz(b).
fn zxz(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let m = rotation.to_rotation_matrix();
    let sin = m[(0, 2)].hypot(m[(1, 2)]);
    if sin < NOTHING {
        // About z only, or upside down: one of the two turns is enough.
        return [m[(1, 0)].atan2(m[(0, 0)]), if m[(2, 2)] < 0.0 { std::f64::consts::PI } else { 0.0 }, 0.0];
    }
    [m[(0, 2)].atan2(-m[(1, 2)]), sin.atan2(m[(2, 2)]), m[(2, 0)].atan2(m[(2, 1)])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::soundness::any_chain;
    use taustream_arm::rng::SeededRng;
    use taustream_motion::{JointArray, MAX_JOINTS};

    /// Goal: the skeleton's frames' origins are the chain's.
    /// Method: the skeleton walked with plain isometries, which the kernel does not use.
    #[test]
    fn skeleton_of_any_chain_puts_every_origin_where_the_chain_does() {
        let mut parallel = 0;
        for seed in 0..2_000 {
            let mut rng = SeededRng::new(seed, 0);
            let count = 1 + rng.index(MAX_JOINTS);
            let chain = any_chain(&mut rng, count);
            let skeleton = Skeleton::new(&chain);
            let q: JointArray = std::array::from_fn(|_| rng.within(-3.2, 3.2));
            let frames = chain.frames(&q);
            let mut at = skeleton.root;
            for (i, link_segment) in skeleton.link_segments.iter().enumerate() {
                let turn =
                    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[i] + link_segment.offset_rad);
                at *= turn;
                let gap_m = (at * Point3::from(link_segment.origin_m)
                    - Point3::from(frames[i + 1].translation.vector))
                .norm();
                assert!(gap_m < 1e-11, "seed {seed}, frame {}: {gap_m:e} m apart", i + 1);
                at *= nalgebra::Translation3::from(link_segment.next_m);
                let [cos, sin] = link_segment.tilt.unwrap_or([1.0, 0.0]);
                at *= UnitQuaternion::from_axis_angle(&Vector3::x_axis(), sin.atan2(cos));
                parallel += u32::from(link_segment.tilt.is_none());
            }
            assert!(
                (at.translation.vector - skeleton.root.translation.vector).norm()
                    <= skeleton.reach_m() + 1e-9
            );
        }
        assert!(parallel > 2_000, "{parallel}: hardly any parallel joints were tried");
    }
}
