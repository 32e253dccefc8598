//! Trajectory files (JSON): reading, checking, writing.
//!
//! A file is one object: `version` (1), `robot`, `digest` (may be absent), `joints`, `base_rad`, `strokes`, and each
//! stroke has `start_s`, `duration_s`, `n` (1/k of the papers) and `delta_rad`. Numbers are written with as many
//! digits as it takes to read the same bits back, and read without loss.
use crate::Faults;
use crate::document::{self, Node, Value};
use crate::reader::{Bounds, FaultList, Table, numbers_of};
use crate::text::counted;
use std::fmt::Write as _;
use std::path::Path;
use taustream_motion::stroke::{DURATION_S_MIN, END_S_MAX, N_MAX, N_MIN};
use taustream_motion::{
    JointArray, JointKind, MAX_JOINTS, MAX_STROKES, Stroke, StrokeError, Trajectory, TrajectoryError,
};

/// A checked trajectory file.
#[derive(Clone, Debug, PartialEq)]
pub struct TrajectoryFile {
    /// Name of the robot it was made for.
    pub robot: String,
    /// Digest of that robot in hexadecimal; may be absent offline.
    pub digest: Option<String>,
    /// Which joints slide: their numbers are in m. Revolute for unused slots.
    pub kinds: [JointKind; MAX_JOINTS],
    /// The motion.
    pub trajectory: Trajectory,
}

/// The only version there is.
const VERSION: i64 = 1;
const DIGEST_CHARS: usize = 64;

/// Angles beyond these are slips of the unit; the limits of the robot are checked by `verify`, not here.
const ANGLE_RAD: Bounds = Bounds::within(-1000.0, 1000.0, "rad");
const START_S: Bounds = Bounds::within(0.0, END_S_MAX, "s");
const DURATION_S: Bounds = Bounds::within(DURATION_S_MIN, END_S_MAX, "s");

impl TrajectoryFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_json(file, &document::read_text(file, "a trajectory file in JSON")?)
    }
    /// Checks the text of a trajectory file; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_json(file: &Path, text: &str) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let read = Self::read(&fault_list, document::parse_json(file, text)?);
        fault_list.close(read)
    }
    fn read(fault_list: &FaultList, node: Node) -> Option<Self> {
        let mut top = Table::top(fault_list, node)?;
        top.integer("version", VERSION, VERSION);
        let robot = top.name("robot");
        let digest = top.text_if_there("digest", "the robot's digest, 64 hexadecimal digits");
        if let Some(text) = &digest
            && !(text.len() == DIGEST_CHARS
                && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b)))
        {
            top.fault("digest", &document::shown(text), "64 hexadecimal digits in lower case");
        }
        let joints =
            top.integer("joints", 1, MAX_JOINTS as i64).and_then(|joints| usize::try_from(joints).ok());
        let kinds = read_units(&mut top, joints);
        let base_rad = read_angles(&mut top, "base_rad", joints);
        let strokes = read_strokes(&mut top, joints);
        top.done();
        if !fault_list.is_clean() {
            return None;
        }
        let trajectory =
            Trajectory::new(joints?, base_rad?, &strokes?).map_err(|e| note(fault_list, &e)).ok()?;
        Some(Self { robot: robot?, digest, kinds: kinds?, trajectory })
    }
    /// The file's text. Numbers are written so that reading gives the same bits.
    #[must_use]
    pub fn to_json(&self) -> String {
        let joints = self.trajectory.joints();
        // Writing to a string cannot fail, so the results are dropped.
        let mut out =
            format!("{{\"version\":{VERSION},\"robot\":{}", serde_json::Value::from(self.robot.as_str()));
        if let Some(digest) = &self.digest {
            let _ = write!(out, ",\"digest\":{}", serde_json::Value::from(digest.as_str()));
        }
        let _ = write!(out, ",\"joints\":{joints}");
        if self.kinds.iter().any(|kind| kind.is_prismatic()) {
            let units: Vec<&str> = self.kinds.iter().take(joints).map(|kind| kind.unit()).collect();
            let _ = write!(out, ",\"units\":{}", serde_json::Value::from(units));
        }
        let _ = write!(out, ",\"base_rad\":{}", numbers(self.trajectory.base_rad(), joints));
        out.push_str(",\"strokes\":[");
        for (i, stroke) in self.trajectory.strokes().iter().enumerate() {
            out.push_str(if i == 0 { "\n" } else { ",\n" });
            let (start_s, duration_s, n) = (stroke.start_s, stroke.duration_s, stroke.n);
            let delta_rad = numbers(&stroke.delta_rad, joints);
            let _ = write!(
                out,
                "{{\"start_s\":{start_s:?},\"duration_s\":{duration_s:?},\"n\":{n},\"delta_rad\":{delta_rad}}}"
            );
        }
        out.push_str("\n]}\n");
        out
    }
}

/// Rust's debug form of a finite f64 is its shortest text that reads back to the same bits, and is JSON.
fn numbers(values: &JointArray, joints: usize) -> String {
    let texts: Vec<String> = values.iter().take(joints).map(|value| format!("{value:?}")).collect();
    format!("[{}]", texts.join(","))
}

/// The units of the joints, written where some slide; all in rad without.
fn read_units(table: &mut Table<'_>, joints: Option<usize>) -> Option<[JointKind; MAX_JOINTS]> {
    const EXPECTED: &str = "a list of \"rad\" or \"m\", one a joint";
    let mut kinds = [JointKind::Revolute; MAX_JOINTS];
    let Some(node) = table.take("units") else { return Some(kinds) };
    let units = if let Value::List(items) = &node.value { items.as_slice() } else { &[] };
    if Some(units.len()) != joints {
        table.fault("units", &node.to_string(), EXPECTED);
        return None;
    }
    for (slot, unit) in kinds.iter_mut().zip(units) {
        let word = if let Value::Text(word) = &unit.value { word.as_str() } else { "" };
        let kind = [JointKind::Revolute, JointKind::Prismatic].into_iter().find(|kind| kind.unit() == word);
        let Some(kind) = kind else {
            table.fault("units", &unit.to_string(), EXPECTED);
            return None;
        };
        *slot = kind;
    }
    Some(kinds)
}

/// One number a joint; unused slots are zero. Without a good joint count there is nothing to hold the list against.
fn read_angles(table: &mut Table<'_>, key: &'static str, joints: Option<usize>) -> Option<JointArray> {
    let node = table.need(key, "a list of one number a joint")?;
    let values = numbers_of(table.fault_list(), &table.path_of(key), &node, joints?, &ANGLE_RAD)?;
    let mut angles = [0.0; MAX_JOINTS];
    for (slot, value) in angles.iter_mut().zip(values) {
        *slot = value;
    }
    Some(angles)
}

fn read_strokes(top: &mut Table<'_>, joints: Option<usize>) -> Option<Vec<Stroke>> {
    if !top.has("strokes") {
        top.fault("strokes", "missing", "a list of strokes");
    }
    let tables = top.tables("strokes");
    if tables.len() > MAX_STROKES {
        let value = format!("{} strokes", tables.len());
        top.fault("strokes", &value, &format!("at most {MAX_STROKES} strokes"));
        return None;
    }
    let strokes: Vec<Option<Stroke>> = tables.into_iter().map(|table| read_stroke(table, joints)).collect();
    strokes.into_iter().collect()
}

fn read_stroke(mut table: Table<'_>, joints: Option<usize>) -> Option<Stroke> {
    let start_s = table.number("start_s", &START_S);
    let duration_s = table.number("duration_s", &DURATION_S);
    let n = table.integer("n", i64::from(N_MIN), i64::from(N_MAX));
    let delta_rad = read_angles(&mut table, "delta_rad", joints);
    table.done();
    let n = u32::try_from(n?).ok()?;
    Some(Stroke { start_s: start_s?, duration_s: duration_s?, n, delta_rad: delta_rad? })
}

/// Faults that only the whole trajectory shows, under the key that they concern.
fn note(fault_list: &FaultList, error: &TrajectoryError) {
    let (key, value) = match error {
        TrajectoryError::JointCount { joints } => ("joints".to_owned(), joints.to_string()),
        TrajectoryError::StrokeCount { strokes } => ("strokes".to_owned(), counted(*strokes, "stroke")),
        TrajectoryError::Base { joint, value_rad } => {
            (format!("base_rad[{joint}]"), format!("{value_rad:?}"))
        }
        TrajectoryError::NotSorted { stroke } => {
            (format!("strokes[{stroke}].start_s"), "too early".to_owned())
        }
        TrajectoryError::Stroke { stroke, error } => match error {
            StrokeError::EndsLate { end_s } => {
                (format!("strokes[{stroke}].duration_s"), format!("end at {end_s} s"))
            }
            StrokeError::NotFinite { .. }
            | StrokeError::StartsEarly { .. }
            | StrokeError::TooShort { .. }
            | StrokeError::Exponent { .. }
            | StrokeError::UnusedJoint { .. } => (format!("strokes[{stroke}]"), "refused".to_owned()),
        },
    };
    fault_list.add(None, &key, &value, &format!("a sound trajectory ({error})"));
}
