//! A robot: its chain, limits and collision shapes.
use crate::contact;
use crate::description::{Description, JointRow, RowKind};
use crate::digest;
use crate::document;
use crate::reader::Book;
use crate::{Faults, scene::Shape};
use nalgebra::{Point3, Translation3, UnitQuaternion, Vector3};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use taustream_motion::chain::{Chain, ChainJoint, Pose};
use taustream_motion::{JointLimits, MAX_JOINTS};

/// One joint, base to tip.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotJoint {
    /// Its name; settings bind servos to it.
    pub name: String,
    /// What it may do.
    pub limits: JointLimits,
}

/// One collision shape, rigid with a frame of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkShape {
    /// Index of the link in [`Robot::links`]; link 0 is the base, link i moves with joint i.
    pub link: usize,
    /// Index into [`Chain::frames`]: 0 is the base.
    pub frame: usize,
    /// Where the shape stands in that frame.
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
    /// 1 to 8 joints, base to tip.
    pub joints: Vec<RobotJoint>,
    /// Kinematics.
    pub chain: Chain,
    /// Names of the links: "base", "link1", ...
    pub links: Vec<String>,
    /// Collision shapes.
    pub shapes: Vec<LinkShape>,
    /// Link pairs (lower index first) that may touch because the file says so.
    pub allowed_by_file: Vec<(usize, usize)>,
    /// Link pairs that may touch by the contact rule (neighbours, and pairs that touch in every one of 10,000 seeded poses).
    pub allowed_by_rule: Vec<(usize, usize)>,
    /// Hash over everything that changes what a setpoint means.
    pub digest: [u8; 32],
}

impl Robot {
    /// Reads and checks a robot file (TOML, design: DH or modified DH rows).
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_toml(file, &document::read_text(file, "a robot file in TOML")?)
    }
    /// Checks the text of a robot file; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml(file: &Path, text: &str) -> Result<Self, Faults> {
        let book = Book::new(file);
        let description = Description::read(&book, document::parse_toml(file, text)?);
        let robot = description.and_then(|description| Self::build(&book, &description));
        book.close(robot)
    }
    /// Makes the robot of a description without faults.
    fn build(book: &Book, description: &Description) -> Option<Self> {
        let rows = &description.joints;
        let joints: Vec<ChainJoint> = rows.iter().map(chain_joint).collect();
        let Some(chain) = Chain::new(&joints) else {
            book.add(None, "joint", &format!("{} tables", rows.len()), "1 to 8 joints");
            return None;
        };
        let shapes: Vec<LinkShape> =
            rows.iter().enumerate().filter_map(|(i, row)| link_shape(i + 1, row)).collect();
        let limits: Vec<JointLimits> = rows.iter().map(|row| row.limits).collect();
        let joint = |row: &JointRow| RobotJoint { name: row.name.clone(), limits: row.limits };
        Some(Self {
            name: description.name.clone(),
            file: book.file().to_owned(),
            joints: rows.iter().map(joint).collect(),
            links: (0..=rows.len()).map(link_name).collect(),
            allowed_by_file: description.allowed_contacts.clone(),
            allowed_by_rule: contact::allowed_by_rule(&chain, &shapes, &limits),
            digest: digest::of(description),
            chain,
            shapes,
        })
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
    /// True when the two links may touch: a link with itself, by the file, or by the contact rule.
    #[must_use]
    pub fn may_touch(&self, a: usize, b: usize) -> bool {
        let pair = (a.min(b), a.max(b));
        a == b || self.allowed_by_file.contains(&pair) || self.allowed_by_rule.contains(&pair)
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

/// Name of a link by index: "base", "link1", ...
pub(crate) fn link_name(link: usize) -> String {
    if link == 0 { "base".to_owned() } else { format!("link{link}") }
}

fn chain_joint(row: &JointRow) -> ChainJoint {
    let (a_m, alpha_rad, d_m, theta_rad) = (row.a_m, row.alpha_rad, row.d_m, row.theta_offset_rad);
    match row.kind {
        RowKind::Standard => ChainJoint::from_dh(a_m, alpha_rad, d_m, theta_rad),
        RowKind::Modified => ChainJoint::from_mdh(a_m, alpha_rad, d_m, theta_rad),
    }
}

/// The capsule between the origins of frames i-1 and i.
///
/// Standard rows turn about the *last* frame's z, so the segment is rigid with frame i; modified rows turn about
/// *this* frame's z, so it is rigid with frame i-1, and moves with joint i-1. A shape belongs to the link that it
/// moves with: that is what decides which pairs can approach each other.
fn link_shape(joint: usize, row: &JointRow) -> Option<LinkShape> {
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
    let length_m = other_end.norm();
    let radius_m = row.link_radius_m;
    let shape =
        if length_m > 0.0 { Shape::Capsule { radius_m, length_m } } else { Shape::Sphere { radius_m } };
    let pose = Pose::from_parts(Translation3::from(other_end * 0.5), turn_z_to(&other_end));
    Some(LinkShape { link: frame, frame, pose, shape })
}

/// A rotation that takes local z to a direction; none is needed for a zero vector.
fn turn_z_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    // There is no unique axis when the direction is opposite to z; any half turn about x or y will do.
    UnitQuaternion::rotation_between(&Vector3::z(), direction)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI))
}

impl LinkShape {
    /// Ends of the axis of a capsule, or the centre of a sphere twice, in the shape's frame; `None` for other shapes.
    #[must_use]
    pub fn segment(&self) -> Option<([Point3<f64>; 2], f64)> {
        let (half_m, radius_m) = match self.shape {
            Shape::Capsule { radius_m, length_m } => (0.5 * length_m, radius_m),
            Shape::Sphere { radius_m } => (0.0, radius_m),
            Shape::Box { .. } | Shape::Cylinder { .. } | Shape::Mesh { .. } => return None,
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
                for (i, shape) in robot.shapes.iter().enumerate() {
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
        let text = format!("allowed_contacts = [[\"link6\", \"link3\"]]\n{}", text.unwrap());
        let robot = Robot::from_toml(Path::new("r.toml"), &text).unwrap();
        assert_eq!(robot.allowed_by_file, [(3, 6)]);
        assert!(
            robot.may_touch(3, 6) && robot.may_touch(6, 3) && !robot.may_touch(2, 6) && robot.may_touch(4, 4)
        );
        assert_eq!(robot.digest_hex().len(), 64);
    }
}
