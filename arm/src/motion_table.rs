//! A sampled motion of joints as a table (CSV), as `taustream sample` writes it and as recorders do.
//!
//! The first line names the columns: `t_s`, then `q1_rad` to `qN_rad` in any order; others are ignored and named. A table comes
//! from anywhere and may be of any length, so it is read line by line, and lines, rows and columns are bounded.
use crate::document::shown;
use crate::reader::{Bounds, FaultList};
use crate::{Fault, Faults};
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use taustream_motion::stroke::END_S_MAX;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Most rows: ten minutes at 1 kHz.
pub const ROWS_MAX: usize = 600_000;
/// Longest line.
const LINE_BYTES_MAX: usize = 4096;
/// Ignored columns that are named; the others are counted.
const IGNORED_MAX: usize = 32;

/// Clocks that count from 1970 stay inside.
const TIME_S: Bounds = Bounds::within(-1e10, 1e10, "s");
/// As in trajectory files: angles beyond are slips of the unit.
const ANGLE_RAD: Bounds = Bounds::within(-1000.0, 1000.0, "rad");

/// A motion by its positions at rising times, the first of which is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionTable {
    /// How many joints it moves.
    pub joints: usize,
    /// When each row is.
    pub t_s: Vec<f64>,
    /// Where all joints are then; unused ones are zero.
    pub position_rad: Vec<JointArray>,
    /// The time of the first row, which was taken off all of them.
    pub began_s: f64,
    /// Ignored columns, by name.
    pub ignored: Vec<String>,
}

/// Where the columns stand that count.
struct Columns {
    time: usize,
    joints: Vec<usize>,
    count: usize,
    ignored: Vec<String>,
}

impl MotionTable {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// Every fault at once, up to a hundred.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        let refused = |value: &str| Faults(vec![Fault::new(file, "", value, WANTED)]);
        // A device or a pipe could block, so it is turned away before it is opened.
        match std::fs::metadata(file) {
            Ok(metadata) if metadata.is_file() => {}
            Ok(_) => return Err(refused("not a regular file")),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Err(refused("no such file")),
            Err(e) => return Err(refused(&format!("cannot be read ({e})"))),
        }
        let source = std::fs::File::open(file).map_err(|e| refused(&format!("cannot be read ({e})")))?;
        Self::read(file, BufReader::new(source))
    }

    /// Reads and checks a table from anywhere; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once, up to a hundred.
    pub fn read(file: &Path, mut source: impl BufRead) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let table = read_table(&fault_list, &mut source);
        fault_list.close(table)
    }
}

const WANTED: &str = "a table (CSV) whose first line names t_s, q1_rad, q2_rad, ..";

fn read_table(fault_list: &FaultList, source: &mut impl BufRead) -> Option<MotionTable> {
    let mut line = Vec::new();
    let mut number = 1;
    let Some(header) = next_line(fault_list, source, &mut line, number)? else {
        fault_list.add(None, "", "empty", WANTED);
        return None;
    };
    let columns = read_header(fault_list, header.trim_start_matches('\u{feff}'))?;
    let mut table = MotionTable {
        joints: columns.joints.len(),
        t_s: Vec::new(),
        position_rad: Vec::new(),
        began_s: 0.0,
        ignored: columns.ignored.clone(),
    };
    loop {
        number += 1;
        let Some(text) = next_line(fault_list, source, &mut line, number)? else { break };
        if text.trim().is_empty() {
            continue;
        }
        if table.t_s.len() == ROWS_MAX {
            let expected = format!("at most {ROWS_MAX} rows; sample at a lower rate, or cut the motion");
            fault_list.add(Some(number), "", "one row more", &expected);
            return None;
        }
        read_row(fault_list, &columns, (number, text), &mut table);
    }
    if fault_list.is_clean() && table.t_s.len() < 2 {
        let value = format!("{} row(s)", table.t_s.len());
        fault_list.add(None, "", &value, "at least two rows: one pose is no motion");
    }
    finish(fault_list, table)
}

/// Takes the first time off all of them.
fn finish(fault_list: &FaultList, mut table: MotionTable) -> Option<MotionTable> {
    table.began_s = table.t_s.first().copied().unwrap_or(0.0);
    for t_s in &mut table.t_s {
        *t_s -= table.began_s;
    }
    let span_s = table.t_s.last().copied().unwrap_or(0.0);
    if span_s > END_S_MAX {
        fault_list.add(None, "t_s", &format!("a motion of {span_s} s"), &format!("at most {END_S_MAX} s"));
    }
    fault_list.is_clean().then_some(table)
}

/// The next line without its end; the inner `None` is the end of the table, the outer one a fault.
fn next_line<'l>(
    fault_list: &FaultList,
    source: &mut impl BufRead,
    line: &'l mut Vec<u8>,
    number: usize,
) -> Option<Option<&'l str>> {
    line.clear();
    let at = Some(number);
    let mut bounded = source.take(LINE_BYTES_MAX as u64 + 1);
    match bounded.read_until(b'\n', line) {
        Ok(0) => return Some(None),
        Ok(bytes) if bytes > LINE_BYTES_MAX => {
            fault_list.add(at, "", "a longer line", &format!("lines of at most {LINE_BYTES_MAX} bytes"));
            return None;
        }
        Ok(_) => {}
        Err(e) => {
            fault_list.add(at, "", &format!("cannot be read ({e})"), WANTED);
            return None;
        }
    }
    let text =
        std::str::from_utf8(line).map_err(|_| fault_list.add(at, "", "not UTF-8 text", WANTED)).ok()?;
    Some(Some(text.trim_end_matches(['\n', '\r'])))
}

fn read_header(fault_list: &FaultList, text: &str) -> Option<Columns> {
    let mut time = None;
    let mut joints: [Option<usize>; MAX_JOINTS] = [None; MAX_JOINTS];
    let (mut ignored, mut count) = (Vec::new(), 0);
    for (at, word) in text.split(',').enumerate() {
        count += 1;
        let name = word.trim().trim_matches('"');
        let joint = name.strip_prefix('q').and_then(|rest| rest.strip_suffix("_rad")?.parse::<usize>().ok());
        let slot = match joint {
            None if name == "t_s" => &mut time,
            Some(joint @ 1..=MAX_JOINTS) => &mut joints[joint - 1],
            Some(_) => {
                fault_list.add(
                    Some(1),
                    &shown(name),
                    "too many joints",
                    &format!("q1_rad to q{MAX_JOINTS}_rad"),
                );
                continue;
            }
            None => {
                if ignored.len() < IGNORED_MAX {
                    ignored.push(shown(name).trim_matches('"').to_owned());
                }
                continue;
            }
        };
        if slot.replace(at).is_some() {
            fault_list.add(Some(1), name, "appears twice", "each column once");
        }
    }
    let moved = joints.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    if time.is_none() {
        fault_list.add(Some(1), "t_s", "missing", WANTED);
    }
    for (joint, column) in joints.iter().enumerate().take(moved.max(1)) {
        if column.is_none() {
            fault_list.add(Some(1), &format!("q{}_rad", joint + 1), "missing", WANTED);
        }
    }
    if !fault_list.is_clean() {
        return None;
    }
    Some(Columns { time: time?, joints: joints.into_iter().flatten().collect(), count, ignored })
}

fn read_row(
    fault_list: &FaultList,
    columns: &Columns,
    (number, text): (usize, &str),
    table: &mut MotionTable,
) {
    let words: Vec<&str> = text.split(',').collect();
    if words.len() != columns.count {
        let (value, expected) =
            (format!("{} values", words.len()), format!("{} as in line 1", columns.count));
        fault_list.add(Some(number), "", &value, &expected);
        return;
    }
    let value = |key: &dyn Fn() -> String, at: usize, bounds: &Bounds| -> Option<f64> {
        let word = words.get(at).map_or("", |word| word.trim());
        let parsed = word.parse::<f64>().ok().filter(|value| bounds.hold(*value));
        if parsed.is_none() {
            fault_list.add(Some(number), &key(), &shown(word), &bounds.words());
        }
        parsed
    };
    let t_s = value(&|| "t_s".to_owned(), columns.time, &TIME_S);
    let mut position_rad = [0.0; MAX_JOINTS];
    for (joint, (slot, at)) in position_rad.iter_mut().zip(&columns.joints).enumerate() {
        *slot = value(&|| format!("q{}_rad", joint + 1), *at, &ANGLE_RAD).unwrap_or(f64::NAN);
    }
    let Some(t_s) = t_s else { return };
    if let Some(before_s) = table.t_s.last().filter(|before_s| t_s <= **before_s) {
        fault_list.add(
            Some(number),
            "t_s",
            &format!("{t_s}"),
            &format!("a time after that of the row before, {before_s} s"),
        );
        return;
    }
    // Rows with faults are kept out of no sum: the book is not clean, so the table is never handed out.
    table.t_s.push(t_s);
    table.position_rad.push(position_rad);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source that makes its bytes as they are requested.
    struct Endless<I>(I);

    impl<I: Iterator<Item = u8>> Read for Endless<I> {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            Ok(into.iter_mut().zip(&mut self.0).map(|(slot, byte)| *slot = byte).count())
        }
    }

    fn read(text: &str) -> Result<MotionTable, Faults> {
        MotionTable::read(Path::new("m.csv"), text.as_bytes())
    }

    #[test]
    fn table_is_read_whatever_the_order_of_its_columns_and_starts_at_zero() {
        let text =
            "\u{feff}\"q2_rad\",t_s,i1_a,q1_rad\r\n-2,1700000000.5,9,1\r\n\n-2.5, 1700000001,9,1.25\r\n";
        let table = read(text).unwrap();
        assert_eq!((table.joints, &table.t_s[..], table.began_s), (2, &[0.0, 0.5][..], 1_700_000_000.5));
        assert_eq!(
            (table.position_rad[1][..3].to_vec(), table.ignored),
            (vec![1.25, -2.5, 0.0], vec!["i1_a".to_owned()])
        );
    }

    #[test]
    fn table_with_faults_is_refused_with_line_column_and_value() {
        let cases = [
            ("", "empty"),
            ("0,1,2\n", "m.csv:1: t_s = missing"),
            ("t_s\n0\n1\n", "q1_rad = missing"),
            ("t_s,q2_rad\n0,0\n1,1\n", "q1_rad = missing"),
            ("t_s,q1_rad,t_s\n", "t_s = appears twice"),
            ("t_s,q1_rad,q9_rad\n", "\"q9_rad\" = too many joints: expected q1_rad to q8_rad"),
            ("t_s,q1_rad\n0,0\n", "1 row(s): expected at least two rows"),
            ("t_s,q1_rad\n0,0\n1,nan\n", "m.csv:3: q1_rad = \"nan\": expected a finite number"),
            ("t_s,q1_rad\n0,0\n1,1e999\n", "q1_rad = \"1e999\""),
            ("t_s,q1_rad\n0,0\n1,x\n", "q1_rad = \"x\""),
            ("t_s,q1_rad\n0,0\ninf,0\n", "t_s = \"inf\""),
            ("t_s,q1_rad\n0,0\n1,4000\n", "from -1000 to 1000 rad"),
            ("t_s,q1_rad\n0,0\n0,1\n", "m.csv:3: t_s = 0: expected a time after that of the row before, 0 s"),
            ("t_s,q1_rad\n0,0\n1,1,1\n", "3 values: expected 2 as in line 1"),
            ("t_s,q1_rad\n0,0\n90000,1\n", "a motion of 90000 s"),
        ];
        for (text, expected) in cases {
            let said = read(text).unwrap_err().to_string();
            assert!(said.contains(expected), "{text:?}: {said}");
        }
        let both = read("t_s,q1_rad\nx,y\n").unwrap_err();
        assert_eq!(both.0.len(), 2, "every fault at once: {both}");
    }

    #[test]
    fn table_that_never_ends_is_refused_in_bounded_memory() {
        let row = b"0123456789,\n".iter().copied().cycle();
        let long_line = BufReader::new(Endless(std::iter::repeat(b'q')));
        let said = MotionTable::read(Path::new("m.csv"), long_line).unwrap_err().to_string();
        assert!(said.contains("a longer line"), "{said}");
        let faults = BufReader::new(Endless(b"t_s,q1_rad\n".iter().copied().chain(row)).take(5_000_000));
        let said = MotionTable::read(Path::new("m.csv"), faults).unwrap_err();
        assert!(said.0.len() <= 101, "{}", said.0.len());
        let mut clock = 0_u64;
        let rows = std::iter::once("t_s,q1_rad\n".to_owned()).chain(std::iter::repeat_with(move || {
            clock += 1;
            format!("{clock},0\n")
        }));
        let said =
            MotionTable::read(Path::new("m.csv"), BufReader::new(Endless(rows.flat_map(String::into_bytes))));
        assert!(said.unwrap_err().to_string().contains("at most 600000 rows"));
    }
}
