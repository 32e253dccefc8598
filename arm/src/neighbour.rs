//! Other arms in the same room: each has settings of its own, and its own planner and streamer.
//!
//! Both files name each other, and the two poses of the bases are each other's inverse: a planner that knows nothing of the other arm
//! would move through it. The neighbours of a neighbour are not followed.
use crate::document;
use crate::reader::{Bounds, FaultList, Table};
use crate::scene;
use crate::settings::Settings;
use crate::{Faults, Robot};
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use taustream_motion::chain::Pose;

/// Most neighbours of an arm: each of their planners reads the others' trajectories.
pub const NEIGHBOURS_MAX: usize = 3;
/// By how much two stated poses may differ from each other's inverse.
const POSITION_M_OFF_MAX: f64 = 5e-4;
const ROTATION_RAD_OFF_MAX: f64 = 5e-4;

const POSITION_M: Bounds = Bounds::within(-100.0, 100.0, "m");
const RPY_RAD: Bounds = Bounds::within(-TAU, TAU, "rad");
const MARGIN_M: Bounds = Bounds::above(0.0, 1.0, "m");

/// One `[[neighbour]]` as it stands in a settings file.
#[derive(Clone, Debug, PartialEq)]
pub struct NeighbourEntry {
    /// The settings of the other arm.
    pub file: PathBuf,
    /// The pose of its base in the frame of this arm's base.
    pub base: Pose,
    /// Least distance that plans keep from it.
    pub margin_m: f64,
}

/// Another arm in the same room.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbour {
    /// Its name, which stands in the names of its services.
    pub name: String,
    /// Its settings.
    pub file: PathBuf,
    /// Its robot.
    pub robot: Robot,
    /// The pose of its base in the frame of this arm's base.
    pub base: Pose,
    /// Least distance that plans of either arm keep: the larger of what the two files state.
    pub margin_m: f64,
    /// The largest tracking error at which it goes on moving, rad.
    pub tracking_error_rad_max: f64,
    /// Reports a second.
    pub report_rate_hz: f64,
}

/// Reads the tables; the files that they name are not opened.
pub(crate) fn read(top: &mut Table<'_>) -> Vec<NeighbourEntry> {
    let tables = top.tables("neighbour");
    if tables.len() > NEIGHBOURS_MAX {
        let value = format!("{} tables", tables.len());
        top.fault_list().add(None, "neighbour", &value, &format!("at most {NEIGHBOURS_MAX}"));
    }
    tables.into_iter().filter_map(read_entry).collect()
}

fn read_entry(mut table: Table<'_>) -> Option<NeighbourEntry> {
    let named = table.text("settings", "the path of the other arm's settings file, relative to this file");
    let position_m = table.numbers::<3>("position_m", &POSITION_M);
    let rpy_rad = table.numbers_or::<3>("rpy_rad", [0.0; 3], &RPY_RAD);
    let margin_m = table.number("margin_m", &MARGIN_M);
    let file = named.map(|named| document::beside(table.fault_list().file(), &named));
    table.done();
    Some(NeighbourEntry { file: file?, base: scene::pose(position_m?, rpy_rad?), margin_m: margin_m? })
}

/// Opens the files that the tables name. `name` is that of this arm.
pub(crate) fn load(fault_list: &FaultList, name: &str, entries: &[NeighbourEntry]) -> Vec<Neighbour> {
    let mut names = BTreeSet::new();
    let mut neighbours = Vec::new();
    for (at, entry) in entries.iter().enumerate() {
        let key = format!("neighbour[{at}].settings");
        let shown = document::shown(&entry.file.display().to_string());
        if is_same(&entry.file, fault_list.file()) {
            fault_list.add(None, &key, &shown, "the settings of another arm; this is the file itself");
            continue;
        }
        let other = match Settings::load_alone(&entry.file) {
            Ok(other) => other,
            Err(faults) => {
                fault_list.merge(explained(faults, fault_list.file()));
                continue;
            }
        };
        if other.name == name || !names.insert(other.name.clone()) {
            let expected =
                format!("an arm of another name than this one and each other; {:?} is taken", other.name);
            fault_list.add(None, &key, &shown, &expected);
            continue;
        }
        let back = other.neighbour_entries.iter().find(|back| is_same(&back.file, fault_list.file()));
        match back {
            Some(back) if are_inverse(&back.base, &entry.base) => neighbours.push(Neighbour {
                margin_m: entry.margin_m.max(back.margin_m),
                tracking_error_rad_max: other.supervision.tracking_error_rad_max,
                report_rate_hz: other.cycle.report_rate_hz,
                name: other.name,
                file: entry.file.clone(),
                robot: other.robot,
                base: entry.base,
            }),
            Some(back) => {
                let expected = format!(
                    "poses that are each other's inverse: {} puts this arm's base at {}, and the inverse of the pose here is {}",
                    entry.file.display(),
                    words(&back.base),
                    words(&entry.base.inverse())
                );
                fault_list.add(None, &format!("neighbour[{at}].position_m"), &words(&entry.base), &expected);
            }
            None => {
                let expected = format!(
                    "settings that name this arm as well, or {} would be moved through it; add to {}: [[neighbour]], settings = \
                     (this file), {}, margin_m = {}",
                    other.name,
                    entry.file.display(),
                    words(&entry.base.inverse()),
                    entry.margin_m
                );
                fault_list.add(None, &key, &shown, &expected);
            }
        }
    }
    neighbours
}

/// The faults of a neighbour's file, which say who asked for it where the file is not there.
fn explained(mut faults: Faults, named_by: &Path) -> Faults {
    for fault in &mut faults.0 {
        fault.expected = format!("{} (a neighbour in {})", fault.expected, named_by.display());
    }
    faults
}

/// One file under two paths.
fn is_same(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        // Files that the program carries have no place on the disk.
        _ => plain(a) == plain(b),
    }
}

/// The path without steps back.
fn plain(path: &Path) -> PathBuf {
    use std::path::Component;
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => {
                plain.pop();
            }
            Component::ParentDir | Component::Normal(_) | Component::RootDir | Component::Prefix(_) => {
                plain.push(part);
            }
        }
    }
    plain
}

fn are_inverse(a: &Pose, b: &Pose) -> bool {
    let off = a * b;
    off.translation.vector.norm() <= POSITION_M_OFF_MAX && off.rotation.angle() <= ROTATION_RAD_OFF_MAX
}

/// A pose as a settings file states it.
#[must_use]
pub fn words(pose: &Pose) -> String {
    // Minus zero would only puzzle.
    let rounded = |value: f64| (value * 1e6).round() / 1e6 + 0.0;
    let [x, y, z] = [pose.translation.x, pose.translation.y, pose.translation.z].map(rounded);
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(rounded);
    format!("position_m = [{x}, {y}, {z}], rpy_rad = [{roll}, {pitch}, {yaw}]")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(name: &str, rest: &str) -> String {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
        let directory = shipped.parent().unwrap().display().to_string();
        let text = std::fs::read_to_string(&shipped).unwrap();
        let own = text.lines().find(|line| line.starts_with("name = ")).unwrap().to_owned();
        let text = text
            .replacen(&own, &format!("name = {name:?}"), 1)
            .replace("\"../", &format!("\"{directory}/../"));
        format!("{text}\n{rest}")
    }

    /// Writes two files, and reads the first.
    fn pair(test: &str, left: &str, right: Option<&str>) -> Result<Settings, String> {
        let directory =
            std::env::temp_dir().join(format!("taustream-neighbour-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&directory).unwrap();
        std::fs::write(directory.join("left.toml"), settings("left", left)).unwrap();
        if let Some(right) = right {
            std::fs::write(directory.join("right.toml"), settings("right", right)).unwrap();
        }
        let read = Settings::load(&directory.join("left.toml"));
        std::fs::remove_dir_all(&directory).unwrap();
        read.map_err(|faults| faults.to_string())
    }

    fn neighbour(file: &str, pose: &str, margin_m: f64) -> String {
        format!("[[neighbour]]\nsettings = \"{file}\"\n{pose}\nmargin_m = {margin_m}\n")
    }

    const RIGHT_OF_LEFT: &str = "position_m = [0.9, 0.1, 0.0]\nrpy_rad = [0.0, 0.0, 1.5707963]";
    const LEFT_OF_RIGHT: &str = "position_m = [-0.1, 0.9, 0.0]\nrpy_rad = [0.0, 0.0, -1.5707963]";

    #[test]
    fn neighbours_that_name_each_other_are_read_with_the_larger_margin() {
        let right = neighbour("right.toml", RIGHT_OF_LEFT, 0.03);
        let left = neighbour("left.toml", LEFT_OF_RIGHT, 0.05);
        let read = pair("good", &right, Some(&left)).unwrap();
        let [one] = read.neighbours.as_slice() else { panic!("{:?}", read.neighbours.len()) };
        assert_eq!((one.name.as_str(), one.margin_m.to_bits()), ("right", 0.05_f64.to_bits()));
        assert!((one.base.translation.x - 0.9).abs() < 1e-12 && one.robot.joints.len() == 6);
        assert_eq!(one.robot.message_digest, read.robot.message_digest, "what its reports hold");
    }

    #[test]
    fn neighbour_is_refused_with_reason_and_remedy() {
        let right = neighbour("right.toml", RIGHT_OF_LEFT, 0.03);
        let left = neighbour("left.toml", LEFT_OF_RIGHT, 0.03);
        let wrong = neighbour("left.toml", RIGHT_OF_LEFT, 0.03);
        let nan = neighbour("right.toml", "position_m = [nan, 0.0, 0.0]", 0.03);
        let cases = [
            ("missing", right.clone(), None, "right.toml"),
            (
                "itself",
                neighbour("left.toml", LEFT_OF_RIGHT, 0.03),
                Some(left.clone()),
                "this is the file itself",
            ),
            (
                "silent",
                right.clone(),
                Some(String::new()),
                "position_m = [-0.1, 0.9, 0], rpy_rad = [0, 0, -1.570796], margin_m = 0.03",
            ),
            ("wrong", right.clone(), Some(wrong), "each other's inverse"),
            ("nan", nan, Some(left.clone()), "neighbour[0].position_m"),
            ("twice", format!("{right}{right}"), Some(left.clone()), "\"right\" is taken"),
            (
                "margin",
                neighbour("right.toml", RIGHT_OF_LEFT, 0.0),
                Some(left.clone()),
                "neighbour[0].margin_m",
            ),
            ("many", right.repeat(4), Some(left), "at most 3"),
        ];
        for (test, own, other, words) in cases {
            let said = pair(test, &own, other.as_deref()).unwrap_err();
            assert!(said.contains(words), "{test}: {said}");
        }
    }
}
