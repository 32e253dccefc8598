//! The demo file: which arm, where it starts, where it goes.
use crate::angles::Angles;
use crate::failure::Failure;
use serde::Deserialize;
use std::path::Path;
use taustream_arm::{Fault, Faults, Settings, shipped};
use taustream_messages::scene::FAR_M;
use taustream_motion::JointArray;

/// Most goals; a demo that never ends is none.
const GOALS_MAX: usize = 20;

/// Farthest angle of a rotation, rad.
const ANGLE_RAD_MAX: f64 = 7.0;

/// A checked demo file and the settings that it names.
#[derive(Clone, Debug)]
pub(crate) struct DemoFile {
    /// The arm.
    pub(crate) settings: Settings,
    /// Where the simulated servos stand at first.
    pub(crate) start_rad: JointArray,
    /// Where to go, one after the other.
    pub(crate) goals_rad: Vec<JointArray>,
    /// What follows them, if anything.
    pub(crate) changing_scene: Option<ChangingScene>,
}

/// After the goals: the tip to a pose, along a straight line, and to a goal while a ball appears.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ChangingScene {
    /// Where the tip goes.
    pub(crate) tip_m: [f64; 3],
    /// How it is turned there: roll, pitch and yaw about fixed axes.
    pub(crate) tip_rpy_rad: [f64; 3],
    /// Where it goes from there on a straight line.
    pub(crate) line_to_m: [f64; 3],
    /// Where the arm goes then.
    pub(crate) goal_rad: JointArray,
    /// Trajectory time of that motion at which the ball appears.
    pub(crate) after_s: f64,
    /// Its centre.
    pub(crate) center_m: [f64; 3],
    /// Its radius.
    pub(crate) radius_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawChange {
    tip_m: [f64; 3],
    tip_rpy_rad: [f64; 3],
    line_to_m: [f64; 3],
    goal_rad: Vec<f64>,
    after_s: f64,
    center_m: [f64; 3],
    radius_m: f64,
}

impl RawChange {
    /// The first key whose value is out of range, and what is expected.
    fn fault(&self) -> Option<(&'static str, String, &'static str)> {
        let far = |xs: &[f64], most: f64| xs.iter().any(|x| !(-most..=most).contains(x));
        let (place, angles) =
            ("three finite lengths (m), from -100 to 100", "three angles (rad), from -7 to 7");
        let triples = [
            ("tip_m", self.tip_m, FAR_M, place),
            ("tip_rpy_rad", self.tip_rpy_rad, ANGLE_RAD_MAX, angles),
            ("line_to_m", self.line_to_m, FAR_M, place),
            ("center_m", self.center_m, FAR_M, place),
        ];
        if let Some((key, value, _, expected)) = triples.into_iter().find(|(_, xs, most, _)| far(xs, *most)) {
            return Some((key, format!("{value:?}"), expected));
        }
        let (after_s, radius_m) = (self.after_s, self.radius_m);
        if !(0.0..=60.0).contains(&after_s) {
            return Some(("after_s", after_s.to_string(), "seconds, from 0 to 60"));
        }
        let fits = radius_m > 0.0 && radius_m <= FAR_M;
        (!fits).then(|| ("radius_m", radius_m.to_string(), "a length (m) above 0 and up to 100"))
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    settings: String,
    start_rad: Vec<f64>,
    goals_rad: Vec<Vec<f64>>,
    changing_scene: Option<RawChange>,
}

impl DemoFile {
    /// How many moves it makes.
    pub(crate) fn moves(&self) -> usize {
        self.goals_rad.len() + if self.changing_scene.is_some() { 3 } else { 0 }
    }

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
        let change = raw.changing_scene;
        if let Some((key, value, expected)) = change.as_ref().and_then(RawChange::fault) {
            return Err(fault(&format!("changing_scene.{key}"), &value, expected));
        }
        let changing_scene = change
            .map(|raw| -> Result<ChangingScene, Failure> {
                let RawChange { tip_m, tip_rpy_rad, line_to_m, goal_rad, after_s, center_m, radius_m } = raw;
                let goal_rad = pose("changing_scene.goal_rad", &goal_rad)?;
                Ok(ChangingScene { tip_m, tip_rpy_rad, line_to_m, goal_rad, after_s, center_m, radius_m })
            })
            .transpose()?;
        let goals = raw.goals_rad.iter().enumerate();
        Ok(Self {
            changing_scene,
            start_rad: pose("start_rad", &raw.start_rad)?,
            goals_rad: goals
                .map(|(i, goal)| pose(&format!("goals_rad[{i}]"), goal))
                .collect::<Result<_, _>>()?,
            settings,
        })
    }
}
