//! Published problems, read from a directory that is not part of the project.
//!
//! The directory holds JSON files of problem sets ([`super::problem_file`]), each with the robot that its problems are for:
//! `ROBOT_spherized.urdf` and `ROBOT.srdf` beside it.
use super::ProblemSet;
use super::problem_file::{self, MARGIN_M, ProblemFile, Question};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use taustream_arm::Robot;
use taustream_planner::budget::Budget;
use taustream_planner::margin_exit::is_clear;
use taustream_planner::tree::Space;
use taustream_planner::world::World;

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
    let file = ProblemFile::load(path).map_err(fail)?;
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
        let problem = file.problem(&set.robot, question, set.problems.len()).map_err(fail)?;
        let world = World::new(&set.robot, &problem.scene).map_err(fail)?;
        let budget = Budget::unbounded();
        let is_valid = |pose| problem_file::is_in_range(&set.robot, pose) && is_clear(&world, pose);
        if !(is_valid(&problem.start_rad) && is_valid(&problem.goal_rad)) {
            unclear += 1;
        } else if Space::new(&world, &budget).is_edge_free(&problem.start_rad, &problem.goal_rad) {
            set.free_lines += 1;
        } else {
            set.problems.push(problem);
        }
    }
    if unclear > 0 {
        set.left_out =
            format!("{unclear} more because start or goal is out of range or not clear by {MARGIN_M} m");
    }
    Ok(set)
}

/// The first of each set, then the second of each, and so on.
fn in_turns(sets: &BTreeMap<String, Vec<Question>>) -> Vec<&Question> {
    let most = sets.values().map(Vec::len).max().unwrap_or(0);
    (0..most).flat_map(|i| sets.values().filter_map(move |set| set.get(i))).collect()
}

/// The robot: geometry from the files beside, limits of acceleration and jerk as the shipped arms have them.
fn robot(path: &Path, file: &ProblemFile) -> Result<Robot, String> {
    let name = &file.robot;
    if !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Err(format!("\"{name}\" is no name of a robot"));
    }
    let urdf = path.with_file_name(format!("{name}_spherized.urdf"));
    let srdf = path.with_file_name(format!("{name}.srdf"));
    problem_file::robot(&urdf, Some(&srdf), (name, &file.joints, "ee_link"))
}
