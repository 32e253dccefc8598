//! Reads the streamer's cycle log (JSON lines). Strict: a line that is not understood is an error.
use serde::Deserialize;
use std::path::Path;

/// One cycle that sent setpoints.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct LoggedCycle {
    /// Cycle number.
    pub tick: u64,
    /// CLOCK_MONOTONIC of the cycle.
    pub time_ns: u64,
    /// SYNCs handed to each bus so far, this one included.
    pub sync: Vec<u64>,
    /// Frames handed to each bus so far, this cycle's included.
    #[serde(default)]
    pub frames: Vec<u64>,
    /// The phase's word.
    pub phase: String,
    /// The trajectory that runs; 0 for none.
    pub trajectory_id: u64,
    /// Trajectory time.
    pub s: f64,
    /// Time scale.
    pub sigma: f64,
    /// Setpoints that were encoded, rad.
    pub position_rad: Vec<f64>,
    /// How far each of them is from the trajectory, on the way back to it after a stall, rad.
    pub off_path_rad: Vec<f64>,
    /// Whether the setpoint of each joint was handed to its bus in this cycle.
    pub joint_sent: Vec<bool>,
    /// Frames handed to each bus.
    pub sent: Vec<u64>,
    /// Frames refused by each bus.
    pub lost: Vec<u64>,
    /// The axes beside the path.
    #[serde(default)]
    pub axes: Vec<LoggedAxis>,
}

impl LoggedCycle {
    /// The setpoint of a slot, a joint or an axis behind the joints, and whether it was handed to its bus.
    #[must_use]
    pub fn slot(&self, slot: usize) -> Option<(f64, bool)> {
        let Some(axis) = slot.checked_sub(self.position_rad.len()) else {
            return Some((*self.position_rad.get(slot)?, *self.joint_sent.get(slot)?));
        };
        self.axes.get(axis).map(|axis| (axis.output_rad, axis.sent))
    }
}

/// One axis beside the path, in its own unit.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct LoggedAxis {
    /// Its name.
    pub name: String,
    /// The word of its state.
    pub state: String,
    /// "rad" or "m".
    pub unit: String,
    /// Setpoint that was encoded: angle of its servo's output, rad.
    pub output_rad: f64,
    /// Commanded position.
    pub command: f64,
    /// Where it goes.
    pub target: f64,
    /// Measured position; nothing before the first feedback.
    pub measured: Option<f64>,
    /// Measured force; nothing where its servo does not say.
    pub force: Option<f64>,
    /// Its setpoint was handed to its bus in this cycle.
    pub sent: bool,
}

/// The cut of a trajectory that replaces another one in motion.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
pub struct LoggedCut {
    /// The trajectory that is cut.
    pub trajectory_id: u64,
    /// Trajectory time of the cut.
    pub at_s: f64,
    /// Trajectory time from which the replacement makes the setpoints.
    pub from_s: f64,
}

/// One line of the log.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(tag = "event", rename_all = "lowercase")]
pub enum Event {
    /// First line.
    Start {
        /// Version of the format.
        format: u32,
        /// The robot's name.
        robot: String,
        /// Its digest.
        digest: String,
        /// How many joints.
        joints: usize,
        /// Period of the cycle.
        period_us: u32,
    },
    /// A trajectory was accepted.
    Trajectory {
        /// Cycle number.
        tick: u64,
        /// Names the trajectory.
        trajectory_id: u64,
        /// Its generation.
        generation: u64,
        /// A trajectory file's object.
        file: serde_json::Value,
        /// The held pose less the trajectory's base, rad.
        #[serde(default)]
        start_offset_rad: Vec<f64>,
        /// What it cuts; nothing for one that begins at rest.
        #[serde(default)]
        cut: Option<LoggedCut>,
    },
    /// Setpoints were sent.
    Cycle(LoggedCycle),
    /// The phase changed.
    Phase {
        /// Cycle number.
        tick: u64,
        /// The phase before.
        from: String,
        /// The phase after.
        to: String,
        /// Why.
        reason: String,
        /// Zero-based joint, where one is to blame.
        joint: Option<usize>,
        /// Index of the bus, where one is to blame.
        #[serde(default)]
        bus: Option<usize>,
        /// The number that belongs to the reason.
        value: Option<f64>,
    },
    /// The log's writer could not keep up.
    Lost {
        /// How many records are missing.
        records: u64,
    },
}

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// The file cannot be read.
    #[error("{file}: {error}")]
    File {
        /// The file.
        file: String,
        /// Why.
        error: std::io::Error,
    },
    /// A line is not understood.
    #[error("line {line}: {error}: {text}")]
    Line {
        /// One-based number.
        line: usize,
        /// Why.
        error: serde_json::Error,
        /// The line's beginning.
        text: String,
    },
}

/// Reads a whole log.
///
/// # Errors
/// When the file cannot be read or a line is not understood.
pub fn read(file: &Path) -> Result<Vec<Event>, LogError> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| LogError::File { file: file.display().to_string(), error })?;
    parse(&text)
}

/// Reads a whole log from text.
///
/// # Errors
/// When a line is not understood.
pub fn parse(text: &str) -> Result<Vec<Event>, LogError> {
    let parse_line = |(at, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|error| LogError::Line {
            line: at + 1,
            error,
            text: line.chars().take(120).collect(),
        })
    };
    text.lines().enumerate().map(parse_line).collect()
}
