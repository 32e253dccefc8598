//! Published problems, read from a directory that is not part of the project.
//!
//! The directory holds JSON files of problem sets, each with the robot that its problems are for: `ROBOT_spherized.urdf`
//! and `ROBOT.srdf` beside it. One file:
//!
//! ```json
//! {"robot": "ur5", "joints": ["base to tip", "..."], "sets": {"box": [{"id": 1, "start": [0.0], "goal": [0.0],
//!   "obstacles": [{"name": "can", "type": "cylinder", "p": [0, 0, 0], "q": [0, 0, 0, 1], "length": 1, "radius": 1},
//!                 {"name": "wall", "type": "box", "p": [0, 0, 0], "q": [0, 0, 0, 1], "size": [1, 1, 1]}]}]}}
//! ```
//!
//! Metres and radians; `p` is the centre, `q` the turn as x, y, z, w; a cylinder's axis is z.
use super::{Problem, ProblemSet};
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::{Obstacle, Robot, Scene, Shape};
use taustream_motion::chain::Pose;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_planner::budget::Budget;
use taustream_planner::margin_exit::is_clear;
use taustream_planner::tree::Space;
use taustream_planner::world::World;

/// Margin that plans keep, m: the problems are published without one, and some goals leave little.
const MARGIN_M: f64 = 0.002;
/// Largest file that is read.
const BYTES_MAX: u64 = 64 * 1024 * 1024;

#[derive(Deserialize)]
struct File {
    robot: String,
    joints: Vec<String>,
    sets: BTreeMap<String, Vec<Question>>,
}

#[derive(Deserialize)]
struct Question {
    id: usize,
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
    q: [f64; 4],
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Form {
    Box { size: [f64; 3] },
    Cylinder { length: f64, radius: f64 },
}

/// Reads every file of a directory; from each at most `count` problems, taken alternately from its sets.
///
/// # Errors
/// Which file is at fault, and why.
pub fn published(directory: &Path, count: usize) -> Result<Vec<ProblemSet>, String> {
    let fail = |e: std::io::Error| format!("{}: {e}", directory.display());
    let entries = fs::read_dir(directory).map_err(fail)?.map(|entry| entry.map(|e| e.path()));
    let mut files = entries.collect::<Result<Vec<PathBuf>, _>>().map_err(fail)?;
    files.retain(|path| path.extension().is_some_and(|e| e == "json"));
    files.sort_unstable();
    if files.is_empty() {
        return Err(format!("{} has no .json file with problems", directory.display()));
    }
    files.iter().map(|path| read(path, count)).collect()
}

fn read(path: &Path, count: usize) -> Result<ProblemSet, String> {
    let fail = |why: String| format!("{}: {why}", path.display());
    let size = fs::metadata(path).map_err(|e| fail(e.to_string()))?.len();
    if size > BYTES_MAX {
        return Err(fail(format!("{size} bytes; at most {BYTES_MAX} are read")));
    }
    let text = fs::read_to_string(path).map_err(|e| fail(e.to_string()))?;
    let file: File = serde_json::from_str(&text).map_err(|e| fail(e.to_string()))?;
    let robot = robot(path, &file).map_err(fail)?;
    let mut set = ProblemSet {
        name: path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default(),
        robot,
        problems: Vec::new(),
        free_lines: 0,
        left_out: String::new(),
    };
    let mut unclear = 0;
    for question in in_turns(&file.sets) {
        if set.problems.len() == count {
            break;
        }
        let problem = problem(&set.robot, question, set.problems.len()).map_err(fail)?;
        let world = World::new(&set.robot, &problem.scene).map_err(fail)?;
        let budget = Budget::unbounded();
        if !(is_clear(&world, &problem.start_rad) && is_clear(&world, &problem.goal_rad)) {
            unclear += 1;
        } else if Space::new(&world, &budget).is_edge_free(&problem.start_rad, &problem.goal_rad) {
            set.free_lines += 1;
        } else {
            set.problems.push(problem);
        }
    }
    if unclear > 0 {
        set.left_out = format!("{unclear} more because start or goal is not clear by {MARGIN_M} m");
    }
    Ok(set)
}

/// The first of each set, then the second of each, and so on.
fn in_turns(sets: &BTreeMap<String, Vec<Question>>) -> Vec<&Question> {
    let most = sets.values().map(Vec::len).max().unwrap_or(0);
    (0..most).flat_map(|i| sets.values().filter_map(move |set| set.get(i))).collect()
}

/// The robot: geometry from the files beside, limits of acceleration and jerk as the shipped arms have them.
fn robot(path: &Path, file: &File) -> Result<Robot, String> {
    let name = &file.robot;
    if !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Err(format!("\"{name}\" is no name of a robot"));
    }
    let mut text = format!(
        "name = \"{name}\"\nurdf = \"{name}_spherized.urdf\"\nsrdf = \"{name}.srdf\"\ntip_link = \"ee_link\"\n"
    );
    for joint in &file.joints {
        let joint = toml_string(joint);
        text += &format!(
            "[[joint]]\nname = {joint}\nmotion = {{ velocity_rad_s = 3.14, acceleration_rad_s2 = 15.0, jerk_rad_s3 = 150.0 }}\n\
             stop = {{ acceleration_rad_s2 = 30.0, jerk_rad_s3 = 600.0 }}\n"
        );
    }
    Robot::from_toml(&path.with_file_name(format!("{name}.toml")), &text).map_err(|faults| faults.to_string())
}

/// JSON strings without control characters are TOML strings.
fn toml_string(text: &str) -> String {
    let plain: String = text.chars().filter(|c| !c.is_control()).collect();
    serde_json::Value::String(plain).to_string()
}

fn problem(robot: &Robot, question: &Question, id: usize) -> Result<Problem, String> {
    let fail = |why: String| format!("problem {}: {why}", question.id);
    let obstacles = question.obstacles.iter().enumerate();
    let obstacles =
        obstacles.map(|(i, thing)| obstacle(i, thing)).collect::<Result<Vec<_>, _>>().map_err(fail)?;
    let scene = Scene { file: PathBuf::new(), margin_m: MARGIN_M, obstacles };
    let [start_rad, goal_rad] = [pose(robot, &question.start), pose(robot, &question.goal)];
    Ok(Problem { id, scene, start_rad: start_rad.map_err(fail)?, goal_rad: goal_rad.map_err(fail)? })
}

fn pose(robot: &Robot, values: &[f64]) -> Result<JointArray, String> {
    let joints = robot.joints.len();
    if values.len() != joints {
        return Err(format!("{} joint values, {} has {joints} joints", values.len(), robot.name));
    }
    let mut pose = [0.0; MAX_JOINTS];
    for ((q, value), joint) in pose.iter_mut().zip(values).zip(&robot.joints) {
        let [low, high] = joint.limits.position_rad;
        // Rounded in the file, a value may lie beyond the range by its last digit.
        if !(*value >= low - 1e-6 && *value <= high + 1e-6) {
            return Err(format!("{} at {value} rad, its range is {low} to {high}", joint.name));
        }
        *q = value.clamp(low, high);
    }
    Ok(pose)
}

fn obstacle(index: usize, thing: &Thing) -> Result<Obstacle, String> {
    let [x, y, z, w] = thing.q;
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-6)
        .filter(|turn| turn.coords.iter().chain(&thing.p).all(|v| v.is_finite()))
        .ok_or_else(|| format!("obstacle {}: its pose is none", thing.name))?;
    let shape = match thing.form {
        Form::Box { size } => Shape::Box { size_m: size },
        Form::Cylinder { length, radius } => Shape::Cylinder { radius_m: radius, length_m: length },
    };
    let sides = match thing.form {
        Form::Box { size } => size,
        Form::Cylinder { length, radius } => [length, radius, radius],
    };
    if !sides.iter().all(|side| *side > 0.0 && side.is_finite()) {
        return Err(format!("obstacle {}: its size is {sides:?} m", thing.name));
    }
    let name = format!("{} ({index})", thing.name);
    Ok(Obstacle { name, pose: Pose::from_parts(Translation3::from(thing.p), turn), shape })
}
