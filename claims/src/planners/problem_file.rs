//! One file of published problems, and the robot that they are for.
//!
//! ```json
//! {"robot": "ur5", "joints": ["base to tip", "..."], "sets": {"box": [{"id": 1, "start": [0.0], "goal": [0.0],
//!   "obstacles": [{"name": "can", "type": "cylinder", "p": [0, 0, 0], "q": [0, 0, 0, 1], "length": 1, "radius": 1},
//!                 {"name": "ball", "type": "sphere", "p": [0, 0, 0], "radius": 1},
//!                 {"name": "wall", "type": "box", "p": [0, 0, 0], "q": [0, 0, 0, 1], "size": [1, 1, 1]}]}]}}
//! ```
//!
//! Metres and radians; `p` is the centre, `q` the rotation as x, y, z, w; a cylinder's axis is z.
use super::Problem;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Margin that plans keep, m: the problems are published without one, and some goals leave little.
pub(super) const MARGIN_M: f64 = 0.002;
/// Largest file that is read.
const BYTES_MAX: u64 = 64 * 1024 * 1024;

/// Problems by the names of their sets.
#[derive(Deserialize)]
pub(super) struct ProblemFile {
    /// The robot's name.
    pub(super) robot: String,
    /// The joints in the order of start and goal.
    pub(super) joints: Vec<String>,
    /// The problems of each set.
    pub(super) sets: BTreeMap<String, Vec<Question>>,
}

/// One problem as it is written.
#[derive(Deserialize)]
pub(super) struct Question {
    /// Its number in its set.
    pub(super) id: usize,
    start: Vec<f64>,
    goal: Vec<f64>,
    obstacles: Vec<Thing>,
}

#[derive(Deserialize)]
struct Thing {
    name: String,
    #[serde(flatten)]
    form: Form,
    p: [f64; 3],
    #[serde(default = "unrotated")]
    q: [f64; 4],
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Form {
    Box { size: [f64; 3] },
    Cylinder { length: f64, radius: f64 },
    Sphere { radius: f64 },
}

fn unrotated() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

impl ProblemFile {
    /// Reads a file.
    ///
    /// # Errors
    /// Why it is no file of problems.
    pub(super) fn load(path: &Path) -> Result<Self, String> {
        let size = fs::metadata(path).map_err(|e| e.to_string())?.len();
        if size > BYTES_MAX {
            return Err(format!("{size} bytes; at most {BYTES_MAX} are read"));
        }
        let text = fs::read_to_string(path).map_err(|e| e.to_string())?;
        serde_json::from_str(&text).map_err(|e| e.to_string())
    }

    /// A problem for a robot, whose joints may stand in another order.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(super) fn problem(&self, robot: &Robot, question: &Question, id: usize) -> Result<Problem, String> {
        let fail = |why: String| format!("problem {}: {why}", question.id);
        let obstacles = question.obstacles.iter().enumerate();
        let obstacles =
            obstacles.map(|(i, thing)| obstacle(i, thing)).collect::<Result<Vec<_>, _>>().map_err(fail)?;
        let scene = Scene { file: PathBuf::new(), margin_m: MARGIN_M, obstacles, zones: Vec::new() };
        let pose = |values: &[f64]| self.pose(robot, values).map_err(fail);
        Ok(Problem { id, scene, start_rad: pose(&question.start)?, goal_rad: pose(&question.goal)? })
    }

    fn pose(&self, robot: &Robot, values: &[f64]) -> Result<JointArray, String> {
        let joints = robot.joints.len();
        if values.len() != joints || self.joints.len() != joints {
            return Err(format!("{} joint values, {} has {joints} joints", values.len(), robot.name));
        }
        let mut pose = [0.0; MAX_JOINTS];
        for (q, joint) in pose.iter_mut().zip(&robot.joints) {
            let index = self.joints.iter().position(|name| *name == joint.name);
            let Some(value) = index.and_then(|i| values.get(i)) else {
                return Err(format!("robot {} has a joint {}, the file has not", robot.name, joint.name));
            };
            let [low, high] = joint.limits.position_rad;
            if !value.is_finite() {
                return Err(format!("{} at {value} rad", joint.name));
            }
            // Rounded in the file, a value may lie beyond the range by its last digit.
            let near = value.clamp(low, high);
            *q = if (near - value).abs() <= 1e-6 { near } else { *value };
        }
        Ok(pose)
    }
}

/// True when every joint is within its range.
pub(super) fn is_in_range(robot: &Robot, pose: &JointArray) -> bool {
    let ranges = robot.joints.iter().map(|joint| joint.limits.position_rad);
    pose.iter().zip(ranges).all(|(q, [low, high])| (low..=high).contains(q))
}

/// The robot of a URDF file, and of an SRDF file where there is one; limits of acceleration and jerk as the shipped UR5 has them.
///
/// # Errors
/// What is wrong with the files, or with the joints' names.
pub(super) fn robot(
    urdf: &Path,
    srdf: Option<&Path>,
    (name, joints, tip_link): (&str, &[String], &str),
) -> Result<Robot, String> {
    let file = |path: &Path| toml_string(&path.display().to_string());
    let mut text = format!("name = {}\nurdf = {}\n", toml_string(name), file(urdf));
    if let Some(srdf) = srdf {
        text += &format!("srdf = {}\n", file(srdf));
    }
    text += &format!("tip_link = {}\n", toml_string(tip_link));
    for joint in joints {
        let joint = toml_string(joint);
        text += &format!(
            "[[joint]]\nname = {joint}\nmotion = {{ velocity_rad_s = 3.14, acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }}\n\
             stop = {{ acceleration_rad_s2 = 30.0, jerk_rad_s3 = 600.0 }}\n"
        );
    }
    let absolute = std::path::absolute(urdf).map_err(|e| e.to_string())?;
    Robot::from_toml(&absolute.with_extension("toml"), &text).map_err(|faults| faults.to_string())
}

/// The link behind the last of the joints on the way from base to tip, as a URDF file says it; their order in the list is the
/// problems' own.
///
/// # Errors
/// When the file cannot be read, or has no such joint.
pub(super) fn link_behind_last(urdf: &Path, joints: &[String]) -> Result<String, String> {
    let fail = |why: String| format!("{}: {why}", urdf.display());
    let text = fs::read_to_string(urdf).map_err(|e| fail(e.to_string()))?;
    let document = roxmltree::Document::parse(&text).map_err(|e| fail(e.to_string()))?;
    let elements = document.root_element().children().filter(|e| e.has_tag_name("joint"));
    let link = |joint: &roxmltree::Node, tag: &str| -> Option<String> {
        let end = joint.children().find(|e| e.has_tag_name(tag))?;
        end.attribute("link").map(str::to_owned)
    };
    // Parent and child link of every joint, fixed ones included.
    let ends: Vec<(&str, String, String)> = elements
        .filter_map(|joint| Some((joint.attribute("name")?, link(&joint, "parent")?, link(&joint, "child")?)))
        .collect();
    let child_of = |name: &str| ends.iter().find(|(joint, ..)| *joint == name).map(|(.., child)| child);
    let joints_before = |link: &str| {
        let (mut at, mut count) = (link, 0);
        // No longer than there are joints: a file may have a ring.
        for _ in 0..ends.len() {
            let Some((joint, parent, _)) = ends.iter().find(|(.., child)| child == at) else { break };
            count += usize::from(joints.iter().any(|name| name == joint));
            at = parent;
        }
        count
    };
    let mut last = None;
    for name in joints {
        let child =
            child_of(name).ok_or_else(|| fail(format!("it has no joint {name} with a child link")))?;
        let before = joints_before(child);
        if last.is_none_or(|(most, _)| before > most) {
            last = Some((before, child));
        }
    }
    last.map(|(_, child)| child.clone()).ok_or_else(|| fail("the problems name no joints".to_owned()))
}

/// JSON strings without control characters are TOML strings.
fn toml_string(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_control()).collect();
    serde_json::Value::String(plain).to_string()
}

fn obstacle(index: usize, thing: &Thing) -> Result<Obstacle, String> {
    let [x, y, z, w] = thing.q;
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)
        .filter(|turn| turn.coords.iter().chain(&thing.p).all(|v| v.is_finite()))
        .ok_or_else(|| {
            format!(
                "obstacle {}: its pose is none: three finite numbers of m and a quaternion are needed",
                thing.name
            )
        })?;
    let shape = match thing.form {
        Form::Box { size } => Shape::Box { size_m: size },
        Form::Cylinder { length, radius } => Shape::Cylinder { radius_m: radius, length_m: length },
        Form::Sphere { radius } => Shape::Sphere { radius_m: radius },
    };
    let sides = match thing.form {
        Form::Box { size } => size,
        Form::Cylinder { length, radius } => [length, radius, radius],
        Form::Sphere { radius } => [radius; 3],
    };
    if !sides.iter().all(|side| *side > 0.0 && side.is_finite()) {
        return Err(format!("obstacle {}: its size is {sides:?} m", thing.name));
    }
    let name = format!("{} ({index})", thing.name);
    Ok(Obstacle { name, pose: Pose::from_parts(Translation3::from(thing.p), turn), shape })
}
