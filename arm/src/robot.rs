//! A robot: its chain, limits and collision shapes.
use crate::capsule::{Capsule, segment_shape};
use crate::contact::{ContactRule, Ruled};
use crate::description::{Description, Geometry};
use crate::group::{Group, Tip};
use crate::link_margin::LinkMargins;
use crate::mass::LinkMass;
use crate::named_pose::{self, GroupState, NamedPose};
use crate::reader::FaultList;
use crate::rows::{Row, RowKind};
use crate::{Faults, scene::Shape};
use crate::{digest, document, modelled};
use nalgebra::{Point3, Vector3};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use taustream_motion::chain::{Chain, ChainJoint, Pose};
use taustream_motion::range::POSITION_TOLERANCE_RAD;
use taustream_motion::{JointArray, JointKind, JointLimits, MAX_JOINTS};

/// One joint, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotJoint {
    /// Its name; settings bind servos to it.
    pub name: String,
    /// Whether it turns or slides: with that, what the numbers of it mean (rad, or m).
    pub kind: JointKind,
    /// What it may do.
    pub limits: JointLimits,
    /// Lowest and highest position by the file, which nothing narrows: how far a prismatic joint can extend rests on it.
    pub stroke: [f64; 2],
    /// The greatest torque of its drive at the joint, Nm (N for a prismatic one): `torque_nm_max` or `force_n_max`, or else the
    /// URDF's `effort`; `None` when neither is stated.
    pub torque_nm_max: Option<f64>,
}

/// One collision shape, rigid with a frame of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Index of the link in [`Robot::links`].
    pub link: usize,
    /// Index into [`Chain::frames`]: 0 is the base, which is fixed; frame i moves with joint i.
    pub frame: usize,
    /// Pose of the shape in that frame.
    pub pose: Pose,
    /// The shape.
    pub shape: Shape,
}

/// A checked robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// The file that it was read from.
    pub file: PathBuf,
    /// 1 to [`MAX_JOINTS`] joints, base to tip.
    pub joints: Vec<RobotJoint>,
    /// Kinematics. Frame 0 is the base; with rows the last frame is the flange of the last row, with a URDF each tip has its frame.
    pub chain: Chain,
    /// What is led somewhere: one in a serial arm, in the order of [`Chain::tips`].
    pub tips: Vec<Tip>,
    /// Joints that belong together, as the arms of a robot with two.
    pub groups: Vec<Group>,
    /// Names of the links: "base", "link1", ... with rows, where link i has frame i; those of the URDF otherwise.
    pub links: Vec<String>,
    /// Collision shapes. Their poses: `chain.frames(pose)[shape.frame] * shape.pose`.
    pub shapes: Vec<LinkShape>,
    /// Masses of the links that state one, and of the payload.
    pub masses: Vec<LinkMass>,
    /// The payload, which is among [`Self::masses`], too.
    pub payload: Option<LinkMass>,
    /// Where gravity points, in the base's frame.
    pub gravity_m_s2: Vector3<f64>,
    /// Names of the links without a shape: nothing keeps them from being hit.
    pub bare_links: Vec<String>,
    /// Links that the robot file acknowledges to have no shape: proofs leave them out, and every summary names them.
    pub unmodelled_links: Vec<String>,
    /// Links that move, have no shape, and are not acknowledged: see [`Self::require_modelled`].
    pub unlisted_links: Vec<String>,
    /// The URDF's link whose frame is the base, and the one whose frame is the tip; none for rows.
    pub ends: Option<[String; 2]>,
    /// Poses with a name: of the robot file, then of the SRDF.
    pub poses: Vec<NamedPose>,
    /// What was left out of a URDF or deserves a look, as text.
    pub notices: Vec<String>,
    /// Link pairs (lower index first) that may touch because the robot file says so.
    pub allowed_by_file: Vec<(usize, usize)>,
    /// Link pairs that may touch because the SRDF file says so.
    pub allowed_by_srdf: Vec<(usize, usize)>,
    /// Link pairs that may touch by the contact rule (neighbours, and pairs that touch in every one of 10,000 seeded poses).
    pub allowed_by_rule: Vec<(usize, usize)>,
    /// What links that may not touch keep from each other.
    pub margins: LinkMargins,
    /// Link pairs that are never further apart than their margin, in 10,000 seeded poses: they keep more than 0 m.
    pub close_by_rule: Vec<(usize, usize)>,
    /// Hash over everything that changes what a setpoint means. Trajectory files hold it.
    pub digest: [u8; 32],
    /// The digest that messages hold: [`Self::digest`], or with feed-forward torques that of the torque model, which covers
    /// gravity and moments of inertia too.
    pub message_digest: [u8; 32],
    pub(crate) torque_model_digest: [u8; 32],
}

/// What finds out which links may touch; an error is the index of a shape that cannot be built.
type Touching = fn(&ContactRule<'_>, &Chain, &[LinkShape], &[JointLimits]) -> Result<Ruled, usize>;

impl Robot {
    /// Reads and checks a robot file (TOML, with DH or modified DH rows, or the name of a URDF).
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_toml(file, &document::read_text(file, "a robot file in TOML")?)
    }
    /// As [`Self::load`], but without trying which links touch in every pose, which takes longer than everything else: for a
    /// process that plans and proves nothing. Only neighbours are in [`Self::allowed_by_rule`] then.
    ///
    /// # Errors
    /// Every other fault at once.
    pub fn load_untried(file: &Path) -> Result<Self, Faults> {
        let text = document::read_text(file, "a robot file in TOML")?;
        Self::read(file, &text, untried)
    }
    /// Checks the text of a robot file; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml(file: &Path, text: &str) -> Result<Self, Faults> {
        Self::read(file, text, tried)
    }
    fn read(file: &Path, text: &str, touching: Touching) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        if text.trim_start().starts_with('<') {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let expected = format!(
                "a robot file in TOML, which names it: urdf = {name:?}, tip_link = \"..\", and one [[joint]] a joint with its \
                 limits, which most URDF files state in part only"
            );
            fault_list.add(Some(1), "", "an XML file", &expected);
            return fault_list.close(None);
        }
        let description = Description::read(&fault_list, document::parse_toml(file, text)?);
        let robot = description.and_then(|description| Self::build(&fault_list, &description, touching));
        fault_list.close(robot)
    }
    /// Makes the robot of a description without faults.
    fn build(fault_list: &FaultList, description: &Description, touching: Touching) -> Option<Self> {
        let parts = Parts::of(description);
        let (chain_joints, parents): (Vec<ChainJoint>, Vec<usize>) = parts.chain.iter().copied().unzip();
        let frames: Vec<usize> = parts.tips.iter().map(|tip| tip.frame).collect();
        let Some(chain) = Chain::tree(&chain_joints, &parents, &frames) else {
            fault_list.add(
                None,
                "joint",
                &format!("{} tables", parts.chain.len()),
                &format!("1 to {MAX_JOINTS} joints"),
            );
            return None;
        };
        let limits: Vec<JointLimits> = description.joints.iter().map(|joint| joint.limits).collect();
        let known = [description.allowed_contacts.as_slice(), &parts.allowed].concat();
        let mut margins = description.margins.clone();
        let rule = ContactRule { neighbours: &parts.neighbours, allowed: &known, margins: &margins };
        let ruled = touching(&rule, &chain, &parts.shapes, &limits);
        let ruled = ruled.map_err(|shape| {
            let link = parts.shapes.get(shape).and_then(|shape| parts.links.get(shape.link));
            fault_list.add(None, "", &format!("the shape of link {link:?}"), "a shape that can be built");
        });
        let ruled = ruled.ok()?;
        for pair in &ruled.close {
            margins.set(*pair, 0.0);
        }
        let tip = (chain.tip_frame(), Pose::identity());
        let outside = modelled::masses_outside(&parts.links, &parts.shapes, &parts.masses);
        let listed = |name: &String| description.unmodelled_links.contains(name);
        let unlisted_links = parts.moving_bare.iter().filter(|name| !listed(name)).cloned().collect();
        let payload = description.payload.map(|weight| LinkMass::placed(&weight, parts.tip_link, tip));
        let (states, mut notices) = (&parts.states, Vec::new());
        let of = (description.joints.as_slice(), description.groups.as_slice());
        let poses = named_pose::of_states(states, of, &description.poses, &mut notices);
        let joints = description.joints.iter();
        let digest = digest::of(description);
        Some(Self {
            name: description.name.clone(),
            file: fault_list.file().to_owned(),
            joints: joints
                .map(|j| RobotJoint {
                    name: j.name.clone(),
                    kind: j.kind,
                    limits: j.limits,
                    stroke: j.limits.position_rad,
                    torque_nm_max: j.torque_nm_max,
                })
                .collect(),
            tips: parts.tips,
            groups: description.groups.clone(),
            links: parts.links,
            shapes: parts.shapes,
            masses: parts.masses.into_iter().chain(payload).collect(),
            payload,
            gravity_m_s2: Vector3::from(description.gravity_m_s2),
            bare_links: parts.bare_links,
            unmodelled_links: description.unmodelled_links.clone(),
            unlisted_links,
            ends: parts.ends,
            poses,
            notices: [parts.notices, description.notices.clone(), outside, notices].concat(),
            allowed_by_file: description.allowed_contacts.clone(),
            allowed_by_srdf: parts.allowed,
            allowed_by_rule: ruled.allowed,
            close_by_rule: ruled.close,
            margins,
            digest,
            message_digest: digest,
            torque_model_digest: digest::of_torque_model(description, &digest),
            chain,
        })
    }
    /// The pose of a name, of all joints.
    #[must_use]
    pub fn pose(&self, name: &str) -> Option<JointArray> {
        self.poses.iter().find(|pose| pose.name == name && pose.group.is_none()).map(|pose| pose.position_rad)
    }
    /// The group of a name.
    #[must_use]
    pub fn group(&self, name: &str) -> Option<&Group> {
        self.groups.iter().find(|group| group.name == name)
    }
    /// The same robot with some joints held where they stand: their ranges are these angles alone, so that nothing that is planned for
    /// it moves them. A bit a joint. Digests and everything else stay.
    #[must_use]
    pub fn holding(&self, held_joints: u32, at_rad: &JointArray) -> Self {
        let mut holding = self.clone();
        for (index, (joint, at_rad)) in holding.joints.iter_mut().zip(at_rad).enumerate() {
            if held_joints & (1 << index) != 0 {
                joint.limits.position_rad = [*at_rad; 2];
            }
        }
        holding
    }
    /// How far a prismatic joint can shift what hangs on it from where it stands, anywhere in its stroke (m), with the tolerance of
    /// poses that count as inside; 0 for a revolute one.
    #[must_use]
    pub fn extension_m(&self, joint: usize) -> f64 {
        let (Some(described), Some(of)) = (self.joints.get(joint), self.chain.joint(joint)) else {
            return 0.0;
        };
        match of.kind {
            JointKind::Revolute => 0.0,
            JointKind::Prismatic => {
                let [low, high] = described.stroke.map(|end| (end + of.offset).abs());
                low.max(high) + POSITION_TOLERANCE_RAD
            }
        }
    }
    /// Limits as the motion crate takes them; unused slots are zero.
    #[must_use]
    pub fn limits(&self) -> [JointLimits; MAX_JOINTS] {
        let mut limits = [JointLimits::default(); MAX_JOINTS];
        for (slot, joint) in limits.iter_mut().zip(&self.joints) {
            *slot = joint.limits;
        }
        limits
    }
    /// The kind of a joint; revolute for one that is not there.
    #[must_use]
    pub fn kind(&self, joint: usize) -> JointKind {
        self.joints.get(joint).map_or(JointKind::Revolute, |joint| joint.kind)
    }
    /// The kinds of all joints; revolute for unused slots.
    #[must_use]
    pub fn kinds(&self) -> [JointKind; MAX_JOINTS] {
        let mut kinds = [JointKind::Revolute; MAX_JOINTS];
        kinds.iter_mut().zip(&self.joints).for_each(|(slot, joint)| *slot = joint.kind);
        kinds
    }
    /// The unit of lengths over all joints, in which a metre of a prismatic joint counts as a radian.
    #[must_use]
    pub fn travel_unit(&self) -> &'static str {
        if self.has_prismatic() { "rad and m" } else { "rad" }
    }
    /// True when some joint is prismatic.
    #[must_use]
    pub fn has_prismatic(&self) -> bool {
        self.joints.iter().any(|joint| joint.kind.is_prismatic())
    }
    /// True when the two links may touch: a link with itself, by the robot file, by the SRDF, or by the contact rule.
    #[must_use]
    pub fn may_touch(&self, a: usize, b: usize) -> bool {
        let pair = (a.min(b), a.max(b));
        let lists = [&self.allowed_by_file, &self.allowed_by_srdf, &self.allowed_by_rule];
        a == b || lists.iter().any(|list| list.contains(&pair))
    }
    /// The digest in hexadecimal, as trajectory files hold it.
    #[must_use]
    pub fn digest_hex(&self) -> String {
        let mut hex = String::with_capacity(2 * self.digest.len());
        for byte in self.digest {
            // Writing to a string cannot fail.
            let _ = write!(hex, "{byte:02x}");
        }
        hex
    }
}

fn tried(
    rule: &ContactRule<'_>,
    chain: &Chain,
    shapes: &[LinkShape],
    limits: &[JointLimits],
) -> Result<Ruled, usize> {
    rule.apply(chain, shapes, limits)
}

/// Without a look at any pose: only what meets at a joint may touch.
fn untried(rule: &ContactRule<'_>, _: &Chain, _: &[LinkShape], _: &[JointLimits]) -> Result<Ruled, usize> {
    Ok(Ruled { allowed: rule.neighbours.to_vec(), close: Vec::new() })
}

/// Name of a link by index: "base", "link1", ...
pub(crate) fn link_name(link: usize) -> String {
    if link == 0 { "base".to_owned() } else { format!("link{link}") }
}

/// What rows and URDF files both come down to.
struct Parts {
    /// Joints, each with the frame that it stands in.
    chain: Vec<(ChainJoint, usize)>,
    tips: Vec<Tip>,
    links: Vec<String>,
    shapes: Vec<LinkShape>,
    masses: Vec<LinkMass>,
    /// The link that carries the payload.
    tip_link: usize,
    bare_links: Vec<String>,
    /// Those of them that move and are more than frames.
    moving_bare: Vec<String>,
    ends: Option<[String; 2]>,
    neighbours: Vec<(usize, usize)>,
    allowed: Vec<(usize, usize)>,
    states: Vec<GroupState>,
    notices: Vec<String>,
}

impl Parts {
    fn of(description: &Description) -> Self {
        match &description.geometry {
            Geometry::Rows(rows) => Self::of_rows(rows, &description.base_capsules),
            Geometry::Urdf(arm) => Self {
                chain: arm.chain(),
                tips: tips(arm.tips()),
                links: arm.links(),
                shapes: arm.shapes(),
                masses: arm.masses(),
                tip_link: arm.tips.first().copied().unwrap_or_default(),
                bare_links: arm.bare_links(),
                moving_bare: arm.moving_bare_links(),
                ends: arm.ends(),
                neighbours: arm.neighbours(),
                allowed: arm.allowed.clone(),
                states: arm.states.clone(),
                notices: arm.notices.clone(),
            },
        }
    }
    fn of_rows(rows: &[Row], base: &[Capsule]) -> Self {
        let numbered = || rows.iter().enumerate().map(|(i, row)| (i + 1, row));
        let shapes: Vec<LinkShape> = base
            .iter()
            .map(|capsule| capsule.shape(0))
            .chain(numbered().filter_map(|(i, row)| link_shape(i, row)))
            .chain(numbered().flat_map(|(i, row)| row.capsules.iter().map(move |capsule| capsule.shape(i))))
            .chain(numbered().next_back().and_then(|(i, row)| end_ball(i, row)))
            .collect();
        let links: Vec<String> = (0..=rows.len()).map(link_name).collect();
        let is_bare = |link: &usize| shapes.iter().all(|shape| shape.link != *link);
        Self {
            chain: rows.iter().map(chain_joint).zip(0..).collect(),
            tips: vec![Tip { name: link_name(rows.len()), frame: rows.len() }],
            bare_links: (0..links.len()).filter(is_bare).map(link_name).collect(),
            moving_bare: (1..links.len()).filter(is_bare).map(link_name).collect(),
            links,
            shapes,
            masses: rows.iter().enumerate().filter_map(|(i, row)| link_mass(i + 1, row)).collect(),
            tip_link: rows.len(),
            ends: None,
            neighbours: (0..rows.len()).map(|link| (link, link + 1)).collect(),
            allowed: Vec::new(),
            states: Vec::new(),
            notices: Vec::new(),
        }
    }
}

/// Each tip has the frame of the last joint that moves it.
fn tips(named: Vec<(String, Vec<usize>)>) -> Vec<Tip> {
    let tip = |(name, movers): (String, Vec<usize>)| Tip {
        name,
        frame: movers.last().map_or(0, |joint| joint + 1),
    };
    named.into_iter().map(tip).collect()
}

/// The mass of the link behind a joint; its frame moves with the joint in both conventions.
fn link_mass(joint: usize, row: &Row) -> Option<LinkMass> {
    row.weight.map(|weight| LinkMass::placed(&weight, joint, (joint, Pose::identity())))
}

fn chain_joint(row: &Row) -> ChainJoint {
    let (a_m, alpha_rad, d_m, theta_rad) = (row.a_m, row.alpha_rad, row.d_m, row.theta_offset_rad);
    let make = match (row.kind, row.joint_kind) {
        (RowKind::Standard, JointKind::Revolute) => ChainJoint::from_dh,
        (RowKind::Standard, JointKind::Prismatic) => ChainJoint::prismatic_from_dh,
        (RowKind::Modified, JointKind::Revolute) => ChainJoint::from_mdh,
        (RowKind::Modified, JointKind::Prismatic) => ChainJoint::prismatic_from_mdh,
    };
    make(a_m, alpha_rad, d_m, theta_rad)
}

/// The capsule between the origins of frames i-1 and i.
///
/// Standard rows turn about the *last* frame's z, so the segment is rigid with frame i; modified rows turn about
/// *this* frame's z, so it is rigid with frame i-1, and moves with joint i-1. A shape belongs to the link that it
/// moves with: that is what decides which pairs can approach each other.
fn link_shape(joint: usize, row: &Row) -> Option<LinkShape> {
    if row.link_radius_m <= 0.0 {
        return None;
    }
    let (sin, cos) = row.alpha_rad.sin_cos();
    let (frame, other_end) = match row.kind {
        // Frame i-1 as frame i sees it: the inverse of Tz(d) Tx(a) Rx(alpha), applied to the origin.
        RowKind::Standard => (joint, Vector3::new(-row.a_m, -row.d_m * sin, -row.d_m * cos)),
        // Frame i as frame i-1 sees it: Rx(alpha) Tx(a) Tz(d), applied to the origin.
        RowKind::Modified => (joint - 1, Vector3::new(row.a_m, -row.d_m * sin, row.d_m * cos)),
    };
    Some(segment_shape(frame, (Vector3::zeros(), other_end), row.link_radius_m))
}

/// The last link of modified rows, behind all of their capsules: the end of the last capsule, which lies before its joint.
fn end_ball(joint: usize, row: &Row) -> Option<LinkShape> {
    let is_bare = row.kind == RowKind::Modified && row.link_radius_m > 0.0;
    is_bare.then(|| segment_shape(joint, (Vector3::zeros(), Vector3::zeros()), row.link_radius_m))
}

impl LinkShape {
    /// Ends of the axis of a capsule, or the centre of a sphere twice, in the shape's frame; `None` for other shapes.
    #[must_use]
    pub fn segment(&self) -> Option<([Point3<f64>; 2], f64)> {
        let (half_m, radius_m) = match self.shape {
            Shape::Capsule { radius_m, length_m } => (0.5 * length_m, radius_m),
            Shape::Sphere { radius_m } => (0.0, radius_m),
            Shape::Box { .. }
            | Shape::Cylinder { .. }
            | Shape::Mesh { .. }
            | Shape::Hull { .. }
            | Shape::Cloud(_) => {
                return None;
            }
        };
        let end = |z| self.pose * Point3::new(0.0, 0.0, z);
        Some(([end(-half_m), end(half_m)], radius_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_motion::JointArray;

    fn robot(kind: &str, seed: u32) -> Robot {
        let mut text = String::from("name = \"r\"\n");
        for i in 0..6 {
            let (x, y) =
                (f64::from((seed + 7 * i) % 11) * 0.05 - 0.25, f64::from((seed * 3 + i) % 7) * 0.06 - 0.18);
            let alpha_rad = f64::from((seed + i) % 9) * 0.7 - 2.8;
            let _ = write!(
                text,
                "[[joint]]\nname = \"j{i}\"\nlink_radius_m = 0.05\nposition_rad = [-3, 3]\n\
                 {kind} = {{ a_m = {x}, alpha_rad = {alpha_rad}, d_m = {y}, theta_offset_rad = 0.3 }}\n\
                 motion = {{ velocity_rad_s = 1, acceleration_rad_s2 = 2, jerk_rad_s3 = 3 }}\n"
            );
        }
        Robot::from_toml(Path::new("r.toml"), &text).unwrap_or_else(|faults| panic!("{faults}"))
    }

    /// Goal: a capsule must lie where the arm is, in every pose and both conventions: its ends are the origins of
    /// two neighbouring frames, and it is fixed in the frame of the link that it is counted to.
    #[test]
    fn link_capsule_in_any_pose_spans_the_origins_of_neighbouring_frames() {
        for seed in 0..40 {
            for kind in ["dh", "mdh"] {
                let robot = robot(kind, seed);
                let mut pose: JointArray = [0.0; MAX_JOINTS];
                (0..6).for_each(|i| pose[i] = (f64::from(seed) * 1.3 + i as f64).sin() * 3.0);
                let frames = robot.chain.frames(&pose);
                assert!(robot.shapes.len() >= 4, "seed {seed}: nearly every row has a length");
                // The last link of modified rows is a ball.
                let capsules = robot.shapes.iter().filter(|shape| kind == "dh" || shape.link < 6);
                for (i, shape) in capsules.enumerate() {
                    let row = if kind == "dh" { shape.link } else { shape.link + 1 };
                    let (ends, _) = shape.segment().unwrap();
                    let ends = ends.map(|end| frames[shape.frame] * end);
                    let mut wanted =
                        [row, row - 1].map(|frame| Point3::from(frames[frame].translation.vector));
                    if (ends[0] - wanted[0]).norm() > (ends[0] - wanted[1]).norm() {
                        wanted.reverse();
                    }
                    let gap_m = (ends[0] - wanted[0]).norm().max((ends[1] - wanted[1]).norm());
                    assert!(gap_m < 1e-12, "seed {seed}, {kind}, shape {i}: {gap_m:e} m off");
                    assert_eq!(shape.frame, shape.link);
                }
            }
        }
    }

    #[test]
    fn stop_limits_when_absent_are_twice_and_four_times_the_motion_limits() {
        let limits = robot("dh", 1).limits();
        assert_eq!(limits[5].stop.acceleration_rad_s2.to_bits(), 4.0_f64.to_bits());
        assert_eq!(limits[5].stop.jerk_rad_s3.to_bits(), 12.0_f64.to_bits());
        assert_eq!(limits[5].stop.velocity_rad_s.to_bits(), 1.0_f64.to_bits());
        assert_eq!(limits[6], JointLimits::default(), "unused slots are zero");
    }

    #[test]
    fn row_without_length_becomes_a_ball_and_without_radius_nothing() {
        let text = "name = \"r\"\n[[joint]]\nname = \"a\"\nlink_radius_m = 0.1\nposition_rad = [-1, 1]\n\
                    dh = { a_m = 0, alpha_rad = 1, d_m = 0, theta_offset_rad = 0 }\n\
                    motion = { velocity_rad_s = 1, acceleration_rad_s2 = 2, jerk_rad_s3 = 3 }\n";
        let file = Path::new("r.toml");
        let ball = Robot::from_toml(file, text).unwrap();
        assert_eq!(ball.shapes[0].shape, Shape::Sphere { radius_m: 0.1 });
        let bare = Robot::from_toml(file, &text.replace("0.1", "0.0")).unwrap();
        assert!(bare.shapes.is_empty() && bare.allowed_by_rule == [(0, 1)]);
    }

    #[test]
    fn allowed_contacts_of_the_file_hold_in_both_orders() {
        let text =
            std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml"));
        let text = text.unwrap().replacen(
            "[[\"link3\", \"link5\"], [\"link4\", \"link6\"]]",
            "[[\"link6\", \"link3\"]]",
            1,
        );
        let robot = Robot::from_toml(Path::new("r.toml"), &text).unwrap();
        assert_eq!(robot.allowed_by_file, [(3, 6)]);
        assert!(
            robot.may_touch(3, 6) && robot.may_touch(6, 3) && !robot.may_touch(2, 6) && robot.may_touch(4, 4)
        );
        assert_eq!(robot.digest_hex().len(), 64);
    }
}
