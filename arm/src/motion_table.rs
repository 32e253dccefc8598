//! A sampled motion of joints as a table (CSV), as `taustream sample` writes it and as recorders do.
//!
//! The first line names the columns, in any order: `t_s`; the positions `q1_rad` to `qN_rad`, or the joints' names with or without
//! `_rad`; velocities `v1_rad_s` and accelerations `a1_rad_s2`, or names with those units. `_deg`, `_deg_s` and `_deg_s2` are degrees.
//! Other columns are left out and named. Commas, semicolons or tabs separate. A table comes from anywhere and may be of any
//! length, so it is read line by line, and lines, rows and columns are bounded.
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
const VELOCITY_RAD_S: Bounds = Bounds::within(-1e4, 1e4, "rad/s");
const ACCELERATION_RAD_S2: Bounds = Bounds::within(-1e7, 1e7, "rad/s^2");

/// A motion by its positions at rising times, the first of which is 0.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionTable {
    /// How many joints it moves.
    pub joints: usize,
    /// When each row is.
    pub t_s: Vec<f64>,
    /// Where all joints are then; unused ones are zero.
    pub position_rad: Vec<JointArray>,
    /// How fast all joints are then, where the table has a column for each.
    pub velocity_rad_s: Option<Vec<JointArray>>,
    /// How they accelerate, where the table has velocities and a column for each.
    pub acceleration_rad_s2: Option<Vec<JointArray>>,
    /// The time of the first row, which was taken off all of them.
    pub began_s: f64,
    /// Columns that were let go, by name.
    pub ignored: Vec<String>,
}

/// A column that counts: where it is, and what its numbers are to be multiplied with.
#[derive(Clone, Debug)]
struct Column {
    at: usize,
    factor: f64,
    name: String,
}

/// A column a joint, base to tip.
type Group = [Option<Column>; MAX_JOINTS];

/// The columns that count.
struct Columns {
    separator: char,
    time: Column,
    position: Vec<Column>,
    velocity: Vec<Column>,
    acceleration: Vec<Column>,
    count: usize,
    ignored: Vec<String>,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Time,
    /// Of order 0 to 2: position, velocity, acceleration of a zero-based joint.
    Joint(usize, usize),
    /// Of a joint that no arm of this project has.
    TooManyJoints,
}

/// The meaning of a column's name, and the factor of its unit.
fn meaning(name: &str, joints: &[String]) -> Option<(Meaning, f64)> {
    const UNITS: [(&str, usize, f64); 6] = [
        ("_rad_s2", 2, 1.0),
        ("_deg_s2", 2, RAD_PER_DEG),
        ("_rad_s", 1, 1.0),
        ("_deg_s", 1, RAD_PER_DEG),
        ("_rad", 0, 1.0),
        ("_deg", 0, RAD_PER_DEG),
    ];
    match name {
        "t_s" | "time_s" => return Some((Meaning::Time, 1.0)),
        "t_ms" | "time_ms" => return Some((Meaning::Time, 1e-3)),
        _ => {}
    }
    let named = |word: &str| joints.iter().position(|joint| joint == word);
    if let Some(joint) = named(name) {
        return Some((Meaning::Joint(0, joint), 1.0));
    }
    let unit = UNITS
        .iter()
        .find_map(|(unit, order, factor)| name.strip_suffix(unit).map(|word| (word, *order, *factor)));
    let (word, order, factor) = unit?;
    if let Some(joint) = named(word) {
        return Some((Meaning::Joint(order, joint), factor));
    }
    let letter = ["q", "v", "a"].get(order)?;
    match word.strip_prefix(letter)?.parse::<usize>().ok()? {
        number @ 1..=MAX_JOINTS => Some((Meaning::Joint(order, number - 1), factor)),
        0 => None,
        _ => Some((Meaning::TooManyJoints, factor)),
    }
}

const RAD_PER_DEG: f64 = std::f64::consts::PI / 180.0;

impl MotionTable {
    /// Reads and checks a file; `joints` are the names of the arm's joints, base to tip.
    ///
    /// # Errors
    /// Every fault at once, up to a hundred.
    pub fn load(file: &Path, joints: &[String]) -> Result<Self, Faults> {
        let refused = |value: &str| Faults(vec![Fault::new(file, "", value, WANTED)]);
        // A device or a pipe could block, so it is turned away before it is opened.
        match std::fs::metadata(file) {
            Ok(metadata) if metadata.is_file() => {}
            Ok(_) => return Err(refused("not a regular file")),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Err(refused("no such file")),
            Err(e) => return Err(refused(&format!("cannot be read ({e})"))),
        }
        let source = std::fs::File::open(file).map_err(|e| refused(&format!("cannot be read ({e})")))?;
        Self::read(file, BufReader::new(source), joints)
    }

    /// Reads and checks a table from anywhere; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once, up to a hundred.
    pub fn read(file: &Path, mut source: impl BufRead, joints: &[String]) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let table = read_table(&fault_list, &mut source, joints);
        fault_list.close(table)
    }
}

const WANTED: &str = "a table (CSV; commas, semicolons or tabs) whose first line names t_s and q1_rad, q2_rad, .. (or the joints' names)";

fn read_table(fault_list: &FaultList, source: &mut impl BufRead, joints: &[String]) -> Option<MotionTable> {
    let mut line = Vec::new();
    let mut number = 1;
    let Some(header) = next_line(fault_list, source, &mut line, number)? else {
        fault_list.add(None, "", "empty", WANTED);
        return None;
    };
    let columns = read_header(fault_list, header.trim_start_matches('\u{feff}'), joints)?;
    let has = |group: &[Column]| (!group.is_empty()).then(Vec::new);
    let mut table = MotionTable {
        joints: columns.position.len(),
        t_s: Vec::new(),
        position_rad: Vec::new(),
        velocity_rad_s: has(&columns.velocity),
        acceleration_rad_s2: has(&columns.acceleration),
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
    if number == 1 && (line.starts_with(b"\xff\xfe") || line.starts_with(b"\xfe\xff")) {
        let expected = format!("{WANTED} in UTF-8; save it in that encoding");
        fault_list.add(None, "", "UTF-16 text by its byte order mark", &expected);
        return None;
    }
    let text =
        std::str::from_utf8(line).map_err(|_| fault_list.add(at, "", "not UTF-8 text", WANTED)).ok()?;
    Some(Some(text.trim_end_matches(['\n', '\r'])))
}

fn read_header(fault_list: &FaultList, text: &str, names: &[String]) -> Option<Columns> {
    let separator = ['\t', ';'].into_iter().find(|sign| text.contains(*sign)).unwrap_or(',');
    let mut time = None;
    let mut groups: [Group; 3] = Default::default();
    let (mut ignored, mut count) = (Vec::new(), 0);
    for (at, word) in text.split(separator).enumerate() {
        count += 1;
        let name = word.trim().trim_matches('"').trim();
        let (slot, factor) = match meaning(name, names) {
            Some((Meaning::Time, factor)) => (&mut time, factor),
            Some((Meaning::Joint(order, joint), factor)) => (groups.get_mut(order)?.get_mut(joint)?, factor),
            Some((Meaning::TooManyJoints, _)) => {
                fault_list.add(
                    Some(1),
                    &shown(name),
                    "too many joints",
                    &format!("q1_rad to q{MAX_JOINTS}_rad"),
                );
                continue;
            }
            None => {
                ignored.push(shown(name).trim_matches('"').to_owned());
                continue;
            }
        };
        if let Some(Column { name: first, .. }) = slot.replace(Column { at, factor, name: name.to_owned() }) {
            let value = if first == name { "stands there twice" } else { "is there under two names" };
            fault_list.add(Some(1), name, value, "each column once");
        }
    }
    let [position, velocity, acceleration] = groups;
    let moved = position.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
    if time.is_none() {
        fault_list.add(Some(1), "t_s", "missing", WANTED);
    }
    for (joint, column) in position.iter().enumerate().take(moved.max(1)) {
        if column.is_none() {
            let name = names.get(joint).map_or(String::new(), |name| format!(" or {name}"));
            fault_list.add(Some(1), &format!("q{}_rad", joint + 1), "missing", &format!("{WANTED}{name}"));
        }
    }
    if !fault_list.is_clean() {
        return None;
    }
    let velocity = whole(&velocity, moved, &mut ignored);
    let acceleration = if velocity.is_empty() {
        whole(&acceleration, usize::MAX, &mut ignored)
    } else {
        whole(&acceleration, moved, &mut ignored)
    };
    let more = ignored.len().saturating_sub(IGNORED_MAX);
    ignored.truncate(IGNORED_MAX);
    if more > 0 {
        ignored.push(format!("{more} more"));
    }
    let position = position.into_iter().flatten().collect();
    Some(Columns { separator, time: time?, position, velocity, acceleration, count, ignored })
}

/// A column for each of the joints, or none: what is there in part is left out, and named.
fn whole(group: &Group, joints: usize, ignored: &mut Vec<String>) -> Vec<Column> {
    let columns: Vec<Column> = group.iter().flatten().cloned().collect();
    let complete = group.iter().take(joints).all(Option::is_some) && columns.len() == joints;
    if complete {
        return columns;
    }
    ignored.extend(columns.into_iter().map(|column| column.name));
    Vec::new()
}

fn read_row(
    fault_list: &FaultList,
    columns: &Columns,
    (number, text): (usize, &str),
    table: &mut MotionTable,
) {
    let words: Vec<&str> = text.split(columns.separator).collect();
    if words.len() != columns.count {
        let (value, expected) =
            (format!("{} values", words.len()), format!("{} as in line 1", columns.count));
        fault_list.add(Some(number), "", &value, &expected);
        return;
    }
    let value = |column: &Column, bounds: &Bounds| -> Option<f64> {
        let word = words.get(column.at).map_or("", |word| word.trim());
        // Where a comma separates nothing, it is the decimal one.
        let decimal = (columns.separator != ',' && !word.contains('.')).then(|| word.replacen(',', ".", 1));
        let parsed = decimal.as_deref().unwrap_or(word).parse::<f64>().ok();
        let parsed = parsed.map(|value| value * column.factor).filter(|value| bounds.hold(*value));
        if parsed.is_none() {
            fault_list.add(Some(number), &column.name, &shown(word), &bounds.words());
        }
        parsed
    };
    let t_s = value(&columns.time, &TIME_S);
    let all = |group: &[Column], bounds: &Bounds| {
        let mut values = [0.0; MAX_JOINTS];
        for (slot, column) in values.iter_mut().zip(group) {
            *slot = value(column, bounds).unwrap_or(f64::NAN);
        }
        values
    };
    let position_rad = all(&columns.position, &ANGLE_RAD);
    let velocity_rad_s = all(&columns.velocity, &VELOCITY_RAD_S);
    let acceleration_rad_s2 = all(&columns.acceleration, &ACCELERATION_RAD_S2);
    let Some(t_s) = t_s else { return };
    if let Some(before_s) = table.t_s.last().filter(|before_s| t_s <= **before_s) {
        fault_list.add(
            Some(number),
            &columns.time.name,
            &format!("{t_s}"),
            &format!("a time after that of the row before, {before_s} s"),
        );
        return;
    }
    // Rows with faults are kept out of no sum: the book is not clean, so the table is never handed out.
    table.t_s.push(t_s);
    table.position_rad.push(position_rad);
    if let Some(velocity) = &mut table.velocity_rad_s {
        velocity.push(velocity_rad_s);
    }
    if let Some(acceleration) = &mut table.acceleration_rad_s2 {
        acceleration.push(acceleration_rad_s2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A source that makes its bytes as they are asked for.
    struct Endless<I>(I);

    impl<I: Iterator<Item = u8>> Read for Endless<I> {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            Ok(into.iter_mut().zip(&mut self.0).map(|(slot, byte)| *slot = byte).count())
        }
    }

    fn read(text: &str) -> Result<MotionTable, Faults> {
        let joints = ["pan", "lift"].map(str::to_owned);
        MotionTable::read(Path::new("m.csv"), text.as_bytes(), &joints)
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

    /// The same motion in every form that recorders write.
    #[test]
    fn table_is_read_with_any_separator_unit_and_order_of_names() {
        let expected = read("t_s,q1_rad,q2_rad\n0,0.5,-1\n0.5,1.5,-0.25\n").unwrap();
        for text in [
            "t_s;q1_rad;q2_rad\n0;0.5;-1\n0.5;1.5;-0.25\n",
            "t_s;q1_rad;q2_rad\n0;0,5;-1\n0,5;1,5;-0,25\n",
            "t_s\tlift\tpan\n0\t-1\t0.5\n0.5\t-0.25\t1.5\n",
            "time_ms,lift_rad,pan_rad\n0,-1,0.5\n500,-0.25,1.5\n",
        ] {
            assert_eq!(read(text).unwrap(), expected, "{text}");
        }
        let degrees = read("t_s,pan_deg,lift_deg\n0,90,0\n1,180,-45\n").unwrap();
        assert!((degrees.position_rad[0][0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        assert!((degrees.position_rad[1][1] + std::f64::consts::FRAC_PI_4).abs() < 1e-15);
        let said = read("t_s,pan,q1_rad,lift\n0,1,1,1\n").unwrap_err().to_string();
        assert!(said.contains("under two names"), "{said}");
        assert!(read("t_s,q1_rad\n0,0\n1,0,5\n").unwrap_err().to_string().contains("3 values"));
    }

    #[test]
    fn velocities_and_accelerations_are_taken_for_all_joints_or_none() {
        let all = "a2_rad_s2,t_s,q1_rad,pan_deg_s,q2_rad,v2_rad_s,a1_rad_s2,j1_rad_s3\n7,0,0,180,1,2,3,9\n7,1,0,180,1,2,3,9\n";
        let table = read(all).unwrap();
        assert_eq!(table.velocity_rad_s.unwrap()[1][..2], [std::f64::consts::PI, 2.0]);
        assert_eq!(table.acceleration_rad_s2.unwrap()[0][..2], [3.0, 7.0]);
        assert_eq!(table.ignored, ["j1_rad_s3"]);
        let part =
            read("t_s,q1_rad,q2_rad,v1_rad_s,a1_rad_s2,a2_rad_s2\n0,0,0,1,1,1\n1,0,0,1,1,1\n").unwrap();
        assert_eq!((part.velocity_rad_s, part.acceleration_rad_s2), (None, None));
        assert_eq!(part.ignored, ["v1_rad_s", "a1_rad_s2", "a2_rad_s2"]);
        assert!(
            read("t_s,q1_rad,v1_rad_s\n0,0,inf\n").unwrap_err().to_string().contains("v1_rad_s = \"inf\"")
        );
    }

    #[test]
    fn table_with_faults_is_refused_with_line_column_and_value() {
        let cases = [
            ("", "empty"),
            ("0,1,2\n", "m.csv:1: t_s = missing"),
            ("t_s\n0\n1\n", "q1_rad = missing"),
            ("t_s,q2_rad\n0,0\n1,1\n", "q1_rad = missing"),
            ("t_s,q1_rad,t_s\n", "t_s = stands there twice"),
            ("t_s,q1_rad,q17_rad\n", "\"q17_rad\" = too many joints: expected q1_rad to q16_rad"),
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
        let said = MotionTable::read(Path::new("m.csv"), long_line, &[]).unwrap_err().to_string();
        assert!(said.contains("a longer line"), "{said}");
        let faults = BufReader::new(Endless(b"t_s,q1_rad\n".iter().copied().chain(row)).take(5_000_000));
        let said = MotionTable::read(Path::new("m.csv"), faults, &[]).unwrap_err();
        assert!(said.0.len() <= 101, "{}", said.0.len());
        let mut clock = 0_u64;
        let rows = std::iter::once("t_s,q1_rad\n".to_owned()).chain(std::iter::repeat_with(move || {
            clock += 1;
            format!("{clock},0\n")
        }));
        let source = BufReader::new(Endless(rows.flat_map(String::into_bytes)));
        let said = MotionTable::read(Path::new("m.csv"), source, &[]);
        assert!(said.unwrap_err().to_string().contains("at most 600000 rows"));
    }
}
