//! The demo file: which arm, where it starts, where it goes.
use crate::angles::Angles;
use crate::failure::Failure;
use serde::Deserialize;
use std::path::Path;
use taustream_arm::{Fault, Faults, Settings, shipped};
use taustream_motion::JointArray;

/// Most goals; a demo that never ends is none.
const GOALS_MAX: usize = 20;

/// A checked demo file and the settings that it names.
#[derive(Clone, Debug)]
pub(crate) struct DemoFile {
    /// The arm.
    pub(crate) settings: Settings,
    /// Where the simulated servos stand at first.
    pub(crate) start_rad: JointArray,
    /// Where to go, one after the other.
    pub(crate) goals_rad: Vec<JointArray>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    settings: String,
    start_rad: Vec<f64>,
    goals_rad: Vec<Vec<f64>>,
}

impl DemoFile {
    /// Reads and checks a demo file.
    pub(crate) fn load(path: &Path) -> Result<Self, Failure> {
        let fault = |key: &str, value: &str, expected: &str| {
            Failure::File(Faults(vec![Fault::new(path, key, value, expected)]))
        };
        let text = shipped::read_text(path).map_err(Failure::File)?;
        let raw: Raw = toml::from_str(&text).map_err(|e| {
            fault("", e.message(), "settings = \"..\", start_rad = [..] and goals_rad = [[..], ..]")
        })?;
        if raw.goals_rad.is_empty() || raw.goals_rad.len() > GOALS_MAX {
            return Err(fault("goals_rad", &format!("{} goals", raw.goals_rad.len()), "1 to 20 goals"));
        }
        // A path is relative to the demo file, as settings do it for the files that they name.
        let beside = path.parent().unwrap_or(Path::new("")).join(&raw.settings);
        let settings = if shipped::is_file(&beside) {
            beside
        } else {
            crate::arm::settings_path(Some(Path::new(&raw.settings)))?
        };
        let settings = Settings::load(&settings)?;

        let pose = |key: &str, values: &[f64]| {
            let finite = values.iter().all(|v| v.is_finite());
            let pose = Angles::from(values.to_vec()).pose_of(&settings.robot, key);
            match pose {
                Ok(pose) if finite => Ok(pose),
                _ => Err(fault(key, &format!("{values:?}"), "one finite angle (rad) for each joint")),
            }
        };
        let goals = raw.goals_rad.iter().enumerate();
        Ok(Self {
            start_rad: pose("start_rad", &raw.start_rad)?,
            goals_rad: goals
                .map(|(i, goal)| pose(&format!("goals_rad[{i}]"), goal))
                .collect::<Result<_, _>>()?,
            settings,
        })
    }
}
