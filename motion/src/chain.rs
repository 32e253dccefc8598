//! Forward kinematics of a tree of revolute and prismatic joints: a serial arm, or several arms on one base.
//!
//! Frame 0 is the base and frame i stands behind joint i-1 (counted from 0). Each joint stands in the base or in the frame of an
//! earlier joint, so that it moves its own frame and those that hang on it, and no other. In a serial arm joint j moves every frame
//! behind it; whoever asks which joint moves what asks [`Chain::moves`].
//!
//! Sines and cosines come from `libm`, so that every machine computes the same pose.
//!
//! Source: Denavit and Hartenberg 1955 (standard rows); Craig, Introduction to Robotics, 3rd ed., section 3.4
//! (modified rows).
use crate::{JointArray, JointKind, MAX_JOINTS};
use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};

/// A pose: rotation and translation in metres.
pub type Pose = Isometry3<f64>;

/// One joint: frame = parent * pre * motion(axis, q + offset) * post, where the motion is a rotation about the axis or a
/// translation along it. Denavit-Hartenberg rows and the joints of a URDF, fixed ones before and behind them included, are all
/// of this form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainJoint {
    /// Rotation or translation.
    pub kind: JointKind,
    /// From the parent's frame to the joint.
    pub pre: Pose,
    /// Its axis in the joint's frame, of unit length.
    pub axis: Unit<Vector3<f64>>,
    /// Added to the joint's position; rad, or m for a prismatic joint.
    pub offset: f64,
    /// From the joint to the link's frame.
    pub post: Pose,
}

impl ChainJoint {
    /// Standard Denavit-Hartenberg row: Rz(q + theta) Tz(d) Tx(a) Rx(alpha).
    #[must_use]
    pub fn from_dh(a_m: f64, alpha_rad: f64, d_m: f64, theta_offset_rad: f64) -> Self {
        let post =
            Isometry3::from_parts(Translation3::new(a_m, 0.0, d_m), rotation(&Vector3::x_axis(), alpha_rad));
        let (pre, axis) = (Pose::identity(), Vector3::z_axis());
        Self { kind: JointKind::Revolute, pre, axis, offset: theta_offset_rad, post }
    }
    /// Modified (Craig) row: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(q + theta) Tz(d).
    #[must_use]
    pub fn from_mdh(a_m: f64, alpha_rad: f64, d_m: f64, theta_offset_rad: f64) -> Self {
        // Rx and Tx share their axis, so their order does not matter.
        let pre =
            Isometry3::from_parts(Translation3::new(a_m, 0.0, 0.0), rotation(&Vector3::x_axis(), alpha_rad));
        let post = Pose::translation(0.0, 0.0, d_m);
        let axis = Vector3::z_axis();
        Self { kind: JointKind::Revolute, pre, axis, offset: theta_offset_rad, post }
    }
    /// Standard row of a prismatic joint: Rz(theta) Tz(q + d) Tx(a) Rx(alpha).
    #[must_use]
    pub fn prismatic_from_dh(a_m: f64, alpha_rad: f64, d_m: f64, theta_rad: f64) -> Self {
        let pre = Isometry3::from_parts(Translation3::identity(), rotation(&Vector3::z_axis(), theta_rad));
        let post =
            Isometry3::from_parts(Translation3::new(a_m, 0.0, 0.0), rotation(&Vector3::x_axis(), alpha_rad));
        Self { kind: JointKind::Prismatic, pre, axis: Vector3::z_axis(), offset: d_m, post }
    }
    /// Modified row of a prismatic joint: Rx(alpha_{i-1}) Tx(a_{i-1}) Rz(theta) Tz(q + d).
    #[must_use]
    pub fn prismatic_from_mdh(a_m: f64, alpha_rad: f64, d_m: f64, theta_rad: f64) -> Self {
        let before = rotation(&Vector3::x_axis(), alpha_rad) * rotation(&Vector3::z_axis(), theta_rad);
        let pre = Isometry3::from_parts(Translation3::new(a_m, 0.0, 0.0), before);
        let axis = Vector3::z_axis();
        Self { kind: JointKind::Prismatic, pre, axis, offset: d_m, post: Pose::identity() }
    }
}

/// What one rad/s of a joint does to the tip, or one m/s of a prismatic one, in base coordinates: a column of the geometric
/// Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Column {
    /// Velocity of the tip's origin, m/s for each rad/s; the axis, of unit length, for a prismatic joint.
    pub linear_m: Vector3<f64>,
    /// Angular velocity of the tip: the joint's axis, of unit length; zero for a prismatic joint.
    pub angular: Vector3<f64>,
}

impl Column {
    /// Of a joint that is not there, or does nothing.
    pub const ZERO: Self =
        Self { linear_m: Vector3::new(0.0, 0.0, 0.0), angular: Vector3::new(0.0, 0.0, 0.0) };
}

/// Each joint is a bit of what moves a frame.
const _: () = assert!(MAX_JOINTS <= u32::BITS as usize);

/// A tree of up to [`MAX_JOINTS`] joints with one or more tips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chain {
    joints: [ChainJoint; MAX_JOINTS],
    count: usize,
    /// The frame that each joint stands in.
    parents: [usize; MAX_JOINTS],
    /// The joints that move each frame, a bit each.
    movers: [u32; MAX_JOINTS + 1],
    tips: [usize; MAX_JOINTS],
    tip_count: usize,
}

impl Chain {
    /// Makes a serial chain of 1 to [`MAX_JOINTS`] joints, whose tip is the last frame; `None` otherwise.
    #[must_use]
    pub fn new(joints: &[ChainJoint]) -> Option<Self> {
        let mut parents = [0; MAX_JOINTS];
        parents.iter_mut().enumerate().for_each(|(joint, parent)| *parent = joint);
        Self::tree(joints, parents.get(..joints.len())?, &[joints.len()])
    }
    /// Makes a tree: for each joint the frame that it stands in, and the frames that are tips, the first of which is the one that is
    /// meant where none is named.
    ///
    /// `None` for no joint or too many, for a joint that stands in the frame of itself or of a later one, and for tips that are
    /// none, twice, the base, or no frame.
    #[must_use]
    pub fn tree(joints: &[ChainJoint], parents: &[usize], tips: &[usize]) -> Option<Self> {
        let count = joints.len();
        let is_tree = parents.len() == count && parents.iter().enumerate().all(|(joint, p)| *p <= joint);
        let is_tip = |(i, tip): (usize, &usize)| {
            (1..=count).contains(tip) && tips.iter().take(i).all(|other| other != tip)
        };
        let has_tips = !tips.is_empty() && tips.iter().enumerate().all(is_tip);
        if !(1..=MAX_JOINTS).contains(&count) || !is_tree || !has_tips {
            return None;
        }
        let mut made = Self {
            joints: [ChainJoint::from_dh(0.0, 0.0, 0.0, 0.0); MAX_JOINTS],
            count,
            parents: [0; MAX_JOINTS],
            movers: [0; MAX_JOINTS + 1],
            tips: [0; MAX_JOINTS],
            tip_count: tips.len(),
        };
        made.joints.iter_mut().zip(joints).for_each(|(slot, joint)| *slot = *joint);
        made.parents.iter_mut().zip(parents).for_each(|(slot, parent)| *slot = *parent);
        made.tips.iter_mut().zip(tips).for_each(|(slot, tip)| *slot = *tip);
        for (joint, parent) in parents.iter().enumerate() {
            let before = made.movers.get(*parent).copied()?;
            *made.movers.get_mut(joint + 1)? = before | (1 << joint);
        }
        Some(made)
    }
    /// How many joints.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.count
    }
    /// A joint by its index, base first; `None` beyond the last.
    #[must_use]
    pub fn joint(&self, index: usize) -> Option<&ChainJoint> {
        self.joints.get(index).filter(|_| index < self.count)
    }
    /// The frame that a joint stands in: 0 for the base, and for a joint that is not there.
    ///
    /// Real time: a look-up.
    #[must_use]
    pub fn parent_frame(&self, joint: usize) -> usize {
        self.parents.get(joint).copied().unwrap_or(0)
    }
    /// True when a joint moves a frame: the frame is its own, or hangs on it.
    ///
    /// Real time: a look-up.
    #[must_use]
    pub fn moves(&self, joint: usize, frame: usize) -> bool {
        joint < self.count && self.movers.get(frame).is_some_and(|movers| movers & (1 << joint) != 0)
    }
    /// The joints that move a frame, base first.
    #[must_use]
    pub fn movers(&self, frame: usize) -> impl DoubleEndedIterator<Item = usize> + '_ {
        (0..self.count).filter(move |joint| self.moves(*joint, frame))
    }
    /// The last frame that carries both of two frames: what moves it moves both alike, and every other joint moves one of them or
    /// none.
    ///
    /// Real time: arithmetic only.
    #[must_use]
    pub fn common_frame(&self, a: usize, b: usize) -> usize {
        let movers = |frame: usize| self.movers.get(frame).copied().unwrap_or(0);
        // Joints come after those that carry them, so that the highest one that is shared is the last.
        let shared = movers(a) & movers(b);
        (u32::BITS - shared.leading_zeros()) as usize
    }
    /// How a joint moves; revolute for one that is not there.
    ///
    /// Real time: a look-up.
    #[must_use]
    pub fn kind(&self, joint: usize) -> JointKind {
        self.joint(joint).map_or(JointKind::Revolute, |joint| joint.kind)
    }
    /// True when some joint is prismatic.
    #[must_use]
    pub fn has_prismatic(&self) -> bool {
        self.joints.iter().take(self.count).any(|joint| joint.kind.is_prismatic())
    }
    /// The frames that are tips.
    #[must_use]
    pub fn tips(&self) -> &[usize] {
        self.tips.get(..self.tip_count).unwrap_or_default()
    }
    /// The first tip: the only one of a serial arm.
    #[must_use]
    pub fn tip_frame(&self) -> usize {
        self.tips.first().copied().unwrap_or(self.count)
    }
    /// True when every joint but the first stands in the frame of the one before it, and the last frame is the only tip.
    #[must_use]
    pub fn is_serial(&self) -> bool {
        let parents = self.parents.iter().take(self.count).enumerate();
        self.tips() == [self.count] && parents.into_iter().all(|(joint, parent)| *parent == joint)
    }
    /// The base frame (index 0, identity) and the frame behind each joint; unused ones repeat the last.
    ///
    /// Positions are in rad, those of prismatic joints in m.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn frames(&self, position_rad: &JointArray) -> [Pose; MAX_JOINTS + 1] {
        let mut frames = [Pose::identity(); MAX_JOINTS + 1];
        let mut last = Pose::identity();
        let moves = self.joints.iter().zip(&self.parents).zip(position_rad).take(self.count).enumerate();
        for (i, ((joint, parent), position)) in moves {
            if *parent != i {
                last = frames.get(*parent).copied().unwrap_or(last);
            }
            let by = position + joint.offset;
            // A rotation alone is cheaper than a pose, and keeps the bits that arms without prismatic joints always had.
            last = match joint.kind {
                JointKind::Revolute => last * joint.pre * rotation(&joint.axis, by) * joint.post,
                JointKind::Prismatic => {
                    last * joint.pre * Translation3::from(joint.axis.into_inner() * by) * joint.post
                }
            };
            if let Some(slot) = frames.get_mut(i + 1) {
                *slot = last;
            }
        }
        frames.iter_mut().skip(self.count + 1).for_each(|slot| *slot = last);
        frames
    }
    /// The pose of one frame, that of the base for one that is not there.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn frame(&self, frame: usize, position_rad: &JointArray) -> Pose {
        self.frames(position_rad).get(frame).copied().unwrap_or_default()
    }
    /// The pose of a frame, as a rule a tip, and how each joint moves it: the geometric Jacobian in base coordinates, a column a
    /// joint; those of joints that do not move it are zero.
    ///
    /// Real time: no allocation.
    ///
    /// Source: Siciliano et al., Robotics: Modelling, Planning and Control, section 3.1.3.
    #[must_use]
    pub fn jacobian(&self, frame: usize, position_rad: &JointArray) -> (Pose, [Column; MAX_JOINTS]) {
        let frames = self.frames(position_rad);
        let tip = frames.get(frame).copied().unwrap_or_default();
        let mut columns = [Column::ZERO; MAX_JOINTS];
        let joints = self.joints.iter().zip(&self.parents).take(self.count);
        for (index, (column, (joint, parent))) in columns.iter_mut().zip(joints).enumerate() {
            let Some(parent) = frames.get(*parent).filter(|_| self.moves(index, frame)) else { continue };
            // Neither motion moves the joint's own axis, so its own position does not matter.
            let before = parent * joint.pre;
            let axis = before.rotation * joint.axis.into_inner();
            let arm_m = tip.translation.vector - before.translation.vector;
            *column = match joint.kind {
                JointKind::Revolute => Column { linear_m: axis.cross(&arm_m), angular: axis },
                JointKind::Prismatic => Column { linear_m: axis, angular: Vector3::zeros() },
            };
        }
        (tip, columns)
    }
}

/// Rotation about an axis of unit length.
fn rotation(axis: &Unit<Vector3<f64>>, angle_rad: f64) -> UnitQuaternion<f64> {
    let (sin, cos) = libm::sincos(0.5 * angle_rad);
    Unit::new_unchecked(Quaternion::from_parts(cos, axis.into_inner() * sin))
}
