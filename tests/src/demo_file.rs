//! The demo's start pose and goals, which the scenarios share.
use crate::scenarios::Goals;
use anyhow::{Context, Result, ensure};
use std::path::{Path, PathBuf};

/// What the scenarios take from a demo file.
#[derive(Debug)]
pub struct DemoFile {
    /// The settings file that it names.
    pub settings: PathBuf,
    /// Pose of the simulated servos at start, "q1,..".
    pub start_rad: String,
    /// At least three.
    pub goals: Goals,
}

impl DemoFile {
    /// Reads a demo file.
    ///
    /// # Errors
    /// When a key is missing or there are fewer than three goals.
    pub fn read(file: &Path) -> Result<Self> {
        let text =
            std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
        let demo: toml::Table = text.parse().with_context(|| format!("{} is no TOML", file.display()))?;
        let numbers = |value: &toml::Value| -> Option<Vec<f64>> {
            value.as_array()?.iter().map(toml::Value::as_float).collect()
        };
        let start = demo.get("start_rad").and_then(numbers).context("start_rad is missing")?;
        let goals = demo.get("goals_rad").and_then(|v| v.as_array()).context("goals_rad is missing")?;
        let goals: Option<Vec<Vec<f64>>> = goals.iter().map(numbers).collect();
        let goals = goals.context("goals_rad holds something that is no number")?;
        ensure!(goals.len() >= 3, "{} goals; the scenarios need three", goals.len());
        let settings = demo.get("settings").and_then(|v| v.as_str()).context("settings is missing")?;
        let folder = file.parent().context("the demo file has no folder")?;
        Ok(Self {
            settings: folder.join(settings),
            start_rad: start.iter().map(ToString::to_string).collect::<Vec<_>>().join(","),
            goals: Goals(goals),
        })
    }
}

/// Folder of the programs that were built with this one.
///
/// # Errors
/// When this program has no path.
pub fn programs_beside() -> Result<PathBuf> {
    Ok(std::env::current_exe()?.parent().context("no folder of programs")?.to_owned())
}
