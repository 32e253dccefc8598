//! Lines of a stream of targets: JSON objects, JSON lists, or comma-separated values with an optional header.
use crate::angles::angle_rad;
use serde::Deserialize;
use std::io::BufRead;
use taustream_messages::target::{DUE_S_MAX, TARGETS_MAX, Target};
use taustream_motion::{JointArray, MAX_JOINTS};

/// Longest line, bytes: a chunk of the most targets with every digit of every number takes less.
const LINE_BYTES_MAX: usize = 64 * 1024;

/// Why a line is no target.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum LineError {
    /// Not JSON of a known form.
    #[error(
        "no target: {0}; write {{\"position_rad\":[..],\"due_s\":0.1}}, a list of such objects, or joint angles separated by commas"
    )]
    Json(String),
    /// A word that is no finite number.
    #[error("value {position} is `{word}`, which is no finite angle; write rad, or a unit (90deg)")]
    Word {
        /// One-based place in the line.
        position: usize,
        /// What stands there.
        word: String,
    },
    /// Too few or too many values.
    #[error("{got} {what}, expected {expected}: one for each joint of the arm")]
    Count {
        /// What was counted.
        what: &'static str,
        /// How many there are.
        got: usize,
        /// How many joints the arm has.
        expected: usize,
    },
    /// A header with a column that is not known, or one twice.
    #[error(
        "column {position} is `{name}`; use due_s, q1_rad to q{joints}_rad, and v1_rad_s to v{joints}_rad_s, each once"
    )]
    Column {
        /// One-based place in the header.
        position: usize,
        /// The column's name.
        name: String,
        /// How many joints the arm has.
        joints: usize,
    },
    /// A time that cannot be kept.
    #[error("target {} is due at {due_s} s; times must rise, from 0 to {DUE_S_MAX} s after the line was read", target + 1)]
    Due {
        /// Zero-based index of the target.
        target: usize,
        /// The time.
        due_s: f64,
    },
    /// Longer than any chunk.
    #[error("longer than {LINE_BYTES_MAX} bytes")]
    TooLong,
    /// The input ended within the line.
    #[error(
        "the input ended before the end of the line, so its last number may be cut; end each line with a newline"
    )]
    Cut,
    /// No target, or too many.
    #[error("{got} targets in one line; a chunk has 1 to {TARGETS_MAX}")]
    Targets {
        /// How many there are.
        got: usize,
    },
}

/// One target as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonTarget {
    position_rad: Vec<f64>,
    velocity_rad_s: Option<Vec<f64>>,
    #[serde(default)]
    due_s: f64,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Due,
    Position(usize),
    Velocity(usize),
}

/// Reads lines of one stream: a header, once seen, names the columns of all lines after it.
#[derive(Debug)]
pub(crate) struct LineReader<R> {
    joints: usize,
    columns: Option<Vec<Column>>,
    input: R,
    number: u64,
}

impl<R: BufRead> LineReader<R> {
    /// A reader of targets for an arm with this many joints.
    pub(crate) fn new(joints: usize, input: R) -> Self {
        Self { joints, columns: None, input, number: 0 }
    }

    /// The next line: its number from 1, and its targets; none for an empty line, a comment (`#`) or a header. `None` when the
    /// input has ended.
    pub(crate) fn next_line(&mut self) -> Option<(u64, Result<Vec<Target>, LineError>)> {
        let mut bytes = Vec::new();
        let mut is_too_long = false;
        let is_whole = loop {
            let available = self.input.fill_buf().ok()?;
            if available.is_empty() {
                break false;
            }
            let end = available.iter().position(|byte| *byte == b'\n');
            let line = available.get(..end.unwrap_or(available.len())).unwrap_or(available);
            is_too_long |= bytes.len() + line.len() > LINE_BYTES_MAX;
            if !is_too_long {
                bytes.extend_from_slice(line);
            }
            let taken = line.len() + usize::from(end.is_some());
            self.input.consume(taken);
            if end.is_some() {
                break true;
            }
        };
        if !is_whole && bytes.is_empty() && !is_too_long {
            return None;
        }
        self.number += 1;
        let text = String::from_utf8_lossy(&bytes);
        // What is cut in JSON lacks its end; a cut number is a number.
        let read = if is_too_long {
            Err(LineError::TooLong)
        } else if !is_whole && !text.trim_start().starts_with(['{', '[', '#']) {
            Err(LineError::Cut)
        } else {
            self.read(&text)
        };
        Some((self.number, read))
    }

    fn read(&mut self, line: &str) -> Result<Vec<Target>, LineError> {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            return Ok(Vec::new());
        }
        let targets = if line.starts_with(['{', '[']) {
            self.json(line)?
        } else {
            let words: Vec<&str> = line.split(',').map(str::trim).collect();
            if words.first().is_some_and(|word| word.starts_with(char::is_alphabetic)) {
                self.columns = Some(self.header(&words)?);
                return Ok(Vec::new());
            }
            vec![self.values(&words)?]
        };
        self.checked(targets)
    }

    fn json(&self, line: &str) -> Result<Vec<Target>, LineError> {
        let wrong = |e: serde_json::Error| LineError::Json(e.to_string());
        if line.starts_with('{') {
            return Ok(vec![self.target(&serde_json::from_str(line).map_err(wrong)?)?]);
        }
        if let Ok(position_rad) = serde_json::from_str::<Vec<f64>>(line) {
            let one = JsonTarget { position_rad, velocity_rad_s: None, due_s: 0.0 };
            return Ok(vec![self.target(&one)?]);
        }
        let chunk: Vec<JsonTarget> = serde_json::from_str(line).map_err(wrong)?;
        chunk.iter().map(|target| self.target(target)).collect()
    }

    fn target(&self, json: &JsonTarget) -> Result<Target, LineError> {
        let velocity_rad_s = json.velocity_rad_s.as_deref();
        Ok(Target {
            due_s: json.due_s,
            position_rad: self.array("positions", &json.position_rad)?,
            velocity_rad_s: velocity_rad_s.map(|values| self.array("velocities", values)).transpose()?,
        })
    }

    fn array(&self, what: &'static str, values: &[f64]) -> Result<JointArray, LineError> {
        if values.len() != self.joints {
            return Err(LineError::Count { what, got: values.len(), expected: self.joints });
        }
        let mut all = [0.0; MAX_JOINTS];
        all.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
        Ok(all)
    }

    fn header(&self, names: &[&str]) -> Result<Vec<Column>, LineError> {
        let mut columns = Vec::with_capacity(names.len());
        for (index, name) in names.iter().enumerate() {
            let column = self.column(name).filter(|column| !columns.contains(column));
            columns.push(column.ok_or_else(|| LineError::Column {
                position: index + 1,
                name: (*name).to_owned(),
                joints: self.joints,
            })?);
        }
        let count = |wanted: fn(&Column) -> bool| columns.iter().filter(|column| wanted(column)).count();
        let positions = count(|column| matches!(column, Column::Position(_)));
        let velocities = count(|column| matches!(column, Column::Velocity(_)));
        let expected = self.joints;
        if positions != expected {
            return Err(LineError::Count { what: "columns of positions", got: positions, expected });
        }
        if velocities != 0 && velocities != expected {
            return Err(LineError::Count { what: "columns of velocities", got: velocities, expected });
        }
        Ok(columns)
    }

    fn column(&self, name: &str) -> Option<Column> {
        if name == "due_s" {
            return Some(Column::Due);
        }
        let joint = |number: &str| {
            let number: usize = number.parse().ok()?;
            (1..=self.joints).contains(&number).then(|| number - 1)
        };
        if let Some(number) = name.strip_prefix('q').and_then(|rest| rest.strip_suffix("_rad")) {
            return joint(number).map(Column::Position);
        }
        name.strip_prefix('v')
            .and_then(|rest| rest.strip_suffix("_rad_s"))
            .and_then(joint)
            .map(Column::Velocity)
    }

    fn values(&self, words: &[&str]) -> Result<Target, LineError> {
        let plain: Vec<Column> = (0..self.joints).map(Column::Position).collect();
        let columns = self.columns.as_deref().unwrap_or(&plain);
        if words.len() != columns.len() {
            return Err(LineError::Count { what: "values", got: words.len(), expected: columns.len() });
        }
        let mut target = Target { due_s: 0.0, position_rad: [0.0; MAX_JOINTS], velocity_rad_s: None };
        for (index, (word, column)) in words.iter().zip(columns).enumerate() {
            let wrong = || LineError::Word { position: index + 1, word: (*word).to_owned() };
            let plain = || word.parse::<f64>().ok();
            match column {
                Column::Due => target.due_s = plain().ok_or_else(wrong)?,
                Column::Position(joint) => {
                    target.position_rad[*joint] = angle_rad(word, 1.0).ok_or_else(wrong)?;
                }
                Column::Velocity(joint) => {
                    let all = target.velocity_rad_s.get_or_insert([0.0; MAX_JOINTS]);
                    all[*joint] = plain().ok_or_else(wrong)?;
                }
            }
        }
        Ok(target)
    }

    /// Finite numbers, and times that rise.
    fn checked(&self, targets: Vec<Target>) -> Result<Vec<Target>, LineError> {
        if !(1..=TARGETS_MAX).contains(&targets.len()) {
            return Err(LineError::Targets { got: targets.len() });
        }
        let mut earliest_s = 0.0;
        for (index, target) in targets.iter().enumerate() {
            if !(target.due_s >= earliest_s && target.due_s <= DUE_S_MAX) {
                return Err(LineError::Due { target: index, due_s: target.due_s });
            }
            earliest_s = target.due_s;
            let positions = target.position_rad.iter().take(self.joints);
            let velocities = target.velocity_rad_s.iter().flatten().take(self.joints);
            if let Some((at, value)) = positions.chain(velocities).enumerate().find(|(_, v)| !v.is_finite()) {
                return Err(LineError::Word { position: at + 1, word: value.to_string() });
            }
        }
        Ok(targets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(lines: &[&str]) -> Result<Vec<Target>, LineError> {
        let text: String = lines.iter().map(|line| format!("{line}\n")).collect();
        let mut reader = LineReader::new(2, text.as_bytes());
        let mut last = Ok(Vec::new());
        while let Some((_, read)) = reader.next_line() {
            last = read;
        }
        last
    }

    /// Every line of a text.
    fn all(text: &[u8]) -> Vec<(u64, Result<Vec<Target>, LineError>)> {
        let mut reader = LineReader::new(2, text);
        std::iter::from_fn(|| reader.next_line()).collect()
    }

    #[test]
    fn line_that_is_too_long_is_skipped_to_its_end_and_counts_once() {
        let mut text = vec![b'1'; 2 * LINE_BYTES_MAX];
        text.extend_from_slice(b",2,3\n\xff\xfe\n0.5,-1\n");
        let lines = all(&text);
        assert_eq!(lines.len(), 3);
        assert_eq!(lines[0], (1, Err(LineError::TooLong)));
        assert!(matches!(lines[1], (2, Err(LineError::Count { .. }))), "{:?}", lines[1]);
        assert_eq!(lines[2], (3, Ok(vec![target(0.0, [0.5, -1.0], None)])));
    }

    #[test]
    fn line_that_the_end_of_input_cuts_is_no_target_unless_json_says_where_it_ends() {
        assert_eq!(
            all(b"0.5,-1\n0.5,-1"),
            [(1, Ok(vec![target(0.0, [0.5, -1.0], None)])), (2, Err(LineError::Cut))]
        );
        assert!(matches!(all(b"[0.5,-1")[0].1, Err(LineError::Json(_))));
        assert_eq!(all(b"[0.5,-1]"), [(1, Ok(vec![target(0.0, [0.5, -1.0], None)]))]);
    }

    fn target(due_s: f64, q: [f64; 2], v: Option<[f64; 2]>) -> Target {
        let array = |values: [f64; 2]| {
            let mut all = [0.0; MAX_JOINTS];
            all[..2].copy_from_slice(&values);
            all
        };
        Target { due_s, position_rad: array(q), velocity_rad_s: v.map(array) }
    }

    #[test]
    fn every_form_gives_the_same_target() {
        let plain = Ok(vec![target(0.0, [0.5, -1.0], None)]);
        assert_eq!(read(&["0.5, -1.0"]), plain);
        assert_eq!(read(&["[0.5, -1]"]), plain);
        assert_eq!(read(&[r#"{"position_rad":[0.5,-1]}"#]), plain);
        assert_eq!(read(&["q2_rad,q1_rad", "-1,0.5"]), plain);
        let whole = Ok(vec![target(0.1, [0.5, -1.0], Some([0.2, 0.3]))]);
        assert_eq!(read(&[r#"{"due_s":0.1,"position_rad":[0.5,-1],"velocity_rad_s":[0.2,0.3]}"#]), whole);
        assert_eq!(read(&["due_s,q1_rad,q2_rad,v1_rad_s,v2_rad_s", "0.1,0.5,-1,0.2,0.3"]), whole);
    }

    #[test]
    fn chunk_is_a_list_of_objects() {
        let line = r#"[{"due_s":0.1,"position_rad":[0,0]},{"due_s":0.2,"position_rad":[0.5,-1]}]"#;
        assert_eq!(read(&[line]), Ok(vec![target(0.1, [0.0; 2], None), target(0.2, [0.5, -1.0], None)]));
    }

    #[test]
    fn empty_lines_and_comments_are_no_targets() {
        assert_eq!(read(&["", "  ", "# a comment"]), Ok(Vec::new()));
    }

    #[test]
    fn degrees_are_taken_by_their_unit() {
        let targets = read(&["90deg,0"]).expect("degrees");
        assert!((targets[0].position_rad[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_target_is_refused_with_its_place() {
        assert!(matches!(read(&["1,x"]), Err(LineError::Word { position: 2, .. })));
        assert!(matches!(read(&["1,NaN"]), Err(LineError::Word { position: 2, .. })));
        assert!(matches!(read(&["1,inf"]), Err(LineError::Word { position: 2, .. })));
        assert!(matches!(read(&["1"]), Err(LineError::Count { got: 1, expected: 2, .. })));
        assert!(matches!(read(&["[1,2,3]"]), Err(LineError::Count { got: 3, expected: 2, .. })));
        assert!(matches!(read(&["[]"]), Err(LineError::Count { got: 0, .. })));
        assert!(matches!(read(&["{\"position\":[1,2]}"]), Err(LineError::Json(_))));
        assert!(matches!(read(&["{\"position_rad\":[1,2]"]), Err(LineError::Json(_))));
        assert!(matches!(read(&["q1_rad,q3_rad"]), Err(LineError::Column { position: 2, .. })));
        assert!(matches!(read(&["q1_rad,q1_rad"]), Err(LineError::Column { position: 2, .. })));
        assert!(matches!(read(&["q1_rad"]), Err(LineError::Count { got: 1, .. })));
        assert!(matches!(read(&["q1_rad,q2_rad,v1_rad_s"]), Err(LineError::Count { got: 1, .. })));
        assert!(matches!(
            read(&[r#"[{"due_s":0.2,"position_rad":[0,0]},{"due_s":0.1,"position_rad":[0,0]}]"#]),
            Err(LineError::Due { target: 1, .. })
        ));
        assert!(matches!(read(&["due_s,q1_rad,q2_rad", "-1,0,0"]), Err(LineError::Due { target: 0, .. })));
    }
}
