//! What the tests of this crate share: the shipped files and edits of them.
#![expect(clippy::expect_used, clippy::panic, reason = "a helper of tests fails by panicking")]
use std::path::{Path, PathBuf};
use taustream_arm::{Faults, Robot, Scene, Settings, TrajectoryFile};

/// Which reader a text goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reader {
    Robot,
    Scene,
    Settings,
    /// Settings of Damiao motors.
    Damiao,
    /// Settings of Damiao motors with a gripper.
    Gripper,
    /// Settings of `RobStride` motors.
    RobStride,
    /// Settings of `CubeMars` motors.
    CubeMars,
    Trajectory,
}

pub(crate) const TRAJECTORY: &str = r#"{"version":1,"robot":"ur5","digest":"00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff","joints":6,
"base_rad":[0.0,-1.57,1.57,-1.57,-1.57,0.0],"strokes":[
{"start_s":0,"duration_s":2.5,"n":10,"delta_rad":[0.5,0.25,0.0,0.0,0.0,0.125]},
{"start_s":1.5,"duration_s":2.5,"n":4,"delta_rad":[-0.5,0.25,0.0,0.0,0.0,0.125]}]}"#;

pub(crate) fn config() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
}

impl Reader {
    /// The file whose text is edited; a trajectory's is made up.
    pub(crate) fn file(self) -> PathBuf {
        match self {
            Self::Robot => config().join("robots/ur5.toml"),
            Self::Scene => config().join("scenes/shelf.toml"),
            Self::Settings => config().join("settings/vcan6.toml"),
            Self::Damiao => config().join("settings/damiao6.toml"),
            Self::Gripper => config().join("settings/damiao6-gripper.toml"),
            Self::RobStride => config().join("settings/robstride6.toml"),
            Self::CubeMars => config().join("settings/ak6.toml"),
            Self::Trajectory => config().join("trajectory.json"),
        }
    }
    /// A text without faults.
    pub(crate) fn good_text(self) -> String {
        match self {
            Self::Trajectory => TRAJECTORY.to_owned(),
            Self::Robot
            | Self::Scene
            | Self::Settings
            | Self::Damiao
            | Self::Gripper
            | Self::RobStride
            | Self::CubeMars => std::fs::read_to_string(self.file()).expect("shipped files are readable"),
        }
    }
    /// Reads a text as if it stood where the shipped file stands.
    pub(crate) fn read(self, text: &str) -> Result<(), Faults> {
        let file = self.file();
        match self {
            Self::Robot => Robot::from_toml(&file, text).map(drop),
            Self::Scene => Scene::from_toml(&file, text).map(drop),
            Self::Settings | Self::Damiao | Self::Gripper | Self::RobStride | Self::CubeMars => {
                Settings::from_toml(&file, text).map(drop)
            }
            Self::Trajectory => TrajectoryFile::from_json(&file, text).map(drop),
        }
    }
}

/// The text with the first `from` replaced; panics when there is none, so that no edit can miss.
pub(crate) fn edited(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the text to edit has no {from:?}");
    text.replacen(from, to, 1)
}

/// The faults of a text that must have some.
pub(crate) fn faults_of(reader: Reader, text: &str) -> Faults {
    match reader.read(text) {
        Err(faults) => faults,
        Ok(()) => panic!("{reader:?} reader took a bad file:\n{text}"),
    }
}
