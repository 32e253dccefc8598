//! A path: points that an arm's tip or joints go through, in a file (TOML) of their own.
use crate::document::{self, Node, Value};
use crate::reader::{Bounds, FaultList, Table, numbers_of};
use crate::{Fault, Faults};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};
use taustream_motion::MAX_JOINTS;

/// A checked path.
#[derive(Clone, Debug, PartialEq)]
pub struct PathFile {
    /// The file that it was read from.
    pub file: PathBuf,
    /// The profile that it is meant for, by name, where the file says one.
    pub profile: Option<String>,
    /// A pose (rad, one angle a joint) near which the arm shall reach the first place, where the file gives one.
    pub near_rad: Option<Vec<f64>>,
    /// At least two points.
    pub points: Vec<PathPoint>,
}

/// One point of a path.
#[derive(Clone, Debug, PartialEq)]
pub enum PathPoint {
    /// Angles (rad), one a joint.
    Joints(Vec<f64>),
    /// A place of the tip in the base frame, already mapped by the file's `scale` and `shift_m`; how the tip is turned there
    /// is left free.
    Place(Vector3<f64>),
}

/// Most points.
const POINTS_MAX: usize = 500;
const ANGLE_RAD: Bounds = Bounds::within(-1000.0, 1000.0, "rad");
/// Arms of this project reach a few metres; more is a slip of the unit (millimetres).
const POSITION_M: Bounds = Bounds::within(-10.0, 10.0, "m");
const SCALE: Bounds = Bounds::above(0.0, 1e3, "");

impl PathFile {
    /// Reads and checks a path file (TOML).
    ///
    /// # Errors
    /// Every fault at once.
    pub fn load(file: &Path) -> Result<Self, Faults> {
        Self::from_toml(file, &document::read_text(file, "a path file in TOML")?)
    }

    /// Checks the text of a path file; `file` is what faults call it.
    ///
    /// # Errors
    /// Every fault at once.
    pub fn from_toml(file: &Path, text: &str) -> Result<Self, Faults> {
        let fault_list = FaultList::new(file);
        let path = Self::read(&fault_list, document::parse_toml(file, text)?);
        fault_list.close(path)
    }

    fn read(fault_list: &FaultList, node: Node) -> Option<Self> {
        let mut top = Table::top(fault_list, node)?;
        let profile = top.text_if_there("profile", "the name of a profile");
        let near_rad = top.take("near_rad").and_then(|node| angles(fault_list, "near_rad", &node));
        let scale = top.number_or("scale", 1.0, &SCALE);
        let shift_m = top.numbers_or("shift_m", [0.0; 3], &POSITION_M);
        let tables = top.tables("point");
        if !(2..=POINTS_MAX).contains(&tables.len()) {
            let value = format!("{} tables", tables.len());
            top.fault("point", &value, &format!("2 to {POINTS_MAX} [[point]] tables"));
        }
        top.done();
        let map = (scale?, Vector3::from(shift_m?));
        let read = |(i, table)| read_point(fault_list, &format!("point[{i}]"), table, map);
        let points: Vec<Option<PathPoint>> = tables.into_iter().enumerate().map(read).collect();
        let points = points.into_iter().collect::<Option<Vec<_>>>()?;
        Some(Self { file: fault_list.file().to_owned(), profile, near_rad, points })
    }
}

fn read_point(
    fault_list: &FaultList,
    path: &str,
    mut table: Table<'_>,
    (scale, shift_m): (f64, Vector3<f64>),
) -> Option<PathPoint> {
    const EITHER: &str = "either joints_rad or position_m";
    let joints = table.take("joints_rad");
    if let Some(node) = joints {
        table.done();
        return angles(fault_list, &format!("{path}.joints_rad"), &node).map(PathPoint::Joints);
    }
    if !table.has("position_m") {
        table.fault("", "neither joints_rad nor position_m", EITHER);
        return None;
    }
    let position_m = table.numbers::<3>("position_m", &POSITION_M);
    table.done();
    Some(PathPoint::Place(shift_m + Vector3::from(position_m?) * scale))
}

/// One to eight angles; the file does not know how many joints the arm has.
fn angles(fault_list: &FaultList, key: &str, node: &Node) -> Option<Vec<f64>> {
    let count = if let Value::List(items) = &node.value { items.len() } else { 0 };
    if !(1..=MAX_JOINTS).contains(&count) {
        let fault =
            Fault::new(fault_list.file(), key, &node.to_string(), "a list of one angle (rad) a joint");
        fault_list.merge(Faults(vec![Fault { line: node.line, ..fault }]));
        return None;
    }
    numbers_of(fault_list, key, node, count, &ANGLE_RAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PathFile, Faults> {
        PathFile::from_toml(Path::new("p.toml"), text)
    }

    #[test]
    fn points_are_mapped_into_the_base_frame_and_joints_are_not() {
        let text = "scale = 0.5\nshift_m = [1, 0, -1]\nprofile = \"quintic\"\nnear_rad = [0, 1]\n\
            [[point]]\nposition_m = [2, 4, 6]\n[[point]]\njoints_rad = [0.5, 0.25]\n\
";
        let path = read(text).unwrap();
        let at = Vector3::new(2.0, 2.0, 2.0);
        assert_eq!(path.points[0], PathPoint::Place(at));
        assert_eq!(path.points[1], PathPoint::Joints(vec![0.5, 0.25]));
        assert_eq!((path.profile.as_deref(), path.near_rad), (Some("quintic"), Some(vec![0.0, 1.0])));
    }

    #[test]
    fn path_with_faults_is_refused_under_its_key() {
        let good = "[[point]]\nposition_m = [0, 0, 1]\n";
        let cases = [
            ("".to_owned(), "point = 0 tables"),
            (good.to_owned(), "point = 1 tables"),
            (good.repeat(501), "point = 501 tables"),
            (format!("{good}[[point]]\n"), "point[1] = neither joints_rad nor position_m"),
            (format!("{good}[[point]]\nposition_m = [1, 2]\n"), "point[1].position_m"),
            (format!("{good}[[point]]\nposition_m = [450, 0, 0]\n"), "from -10 to 10 m"),
            (format!("{good}[[point]]\nposition_m = [nan, 0, 0]\n"), "point[1].position_m[0] = NaN"),
            (format!("{good}[[point]]\njoints_rad = []\n"), "point[1].joints_rad = []"),
            (format!("{good}[[point]]\njoints_rad = [0, inf]\n"), "point[1].joints_rad[1] = inf"),
            (format!("{good}[[point]]\njoints_rad = [0]\nposition_m = [0, 0, 0]\n"), "no such key"),
            (format!("scale = 0\n{good}{good}"), "scale = 0"),
            (format!("near_rad = 3\n{good}{good}"), "near_rad = 3"),
            (format!("colour = 3\n{good}{good}"), "colour = 3"),
        ];
        for (text, expected) in cases {
            let said = read(&text).unwrap_err().to_string();
            assert!(said.contains(expected), "{text:?}: {said}");
        }
    }
}
