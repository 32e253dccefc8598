//! Trajectory files (JSON): reading, checking, writing.
use crate::Faults;
use std::path::Path;
use taustream_motion::Trajectory;

/// A checked trajectory file.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryFile {
    /// Name of the robot it was made for.
    pub robot: String,
    /// Digest of that robot in hexadecimal; may be absent offline.
    pub digest: Option<String>,
    /// The motion.
    pub trajectory: Trajectory,
}

impl TrajectoryFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(_file: &Path) -> Result<Self, Faults> {
        todo!("arm")
    }
    /// The file's text. Numbers are written so that reading gives the same bits.
    #[must_use]
    pub fn to_json(&self) -> String {
        todo!("arm")
    }
}
