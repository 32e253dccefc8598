//! A robot: its chain, limits and collision shapes.
use crate::{Faults, scene::Shape};
use std::path::{Path, PathBuf};
use taustream_motion::chain::{Chain, Pose};
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
    pub fn load(_file: &Path) -> Result<Self, Faults> {
        todo!("arm")
    }
    /// Limits as the motion crate takes them; unused slots are zero.
    #[must_use]
    pub fn limits(&self) -> [JointLimits; MAX_JOINTS] {
        todo!("arm")
    }
    /// True when the two links may touch.
    #[must_use]
    pub fn may_touch(&self, _a: usize, _b: usize) -> bool {
        todo!("arm")
    }
    /// The digest in hexadecimal, as trajectory files hold it.
    #[must_use]
    pub fn digest_hex(&self) -> String {
        todo!("arm")
    }
}
