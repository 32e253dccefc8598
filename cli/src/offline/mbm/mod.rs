//! `taustream bench mbm`: published problems with the default planner.
mod table;

use crate::args::MbmArgs;
use crate::arm;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use taustream_claims::planners::mbm::{Published, RobotSource, Row};
use taustream_claims::{Effort, RunContext, Stop};
use taustream_planner::PlanOptions;

/// The measurement, for people and programs.
#[derive(Serialize)]
struct Answer {
    command: String,
    robot: String,
    joints: usize,
    seed: u64,
    deadline_ms: u128,
    notes: Vec<String>,
    sets: Vec<Row>,
}

/// Measures and prints.
pub(super) fn run(form: Form, args: &MbmArgs) -> Result<(), Failure> {
    interrupt::watch()?;
    let mut notes = Vec::new();
    let published = read(args, &mut notes)?;
    published.robot.require_modelled()?;
    let deadline = args.deadline_ms.map(|ms| Duration::from_millis(ms.into()));
    let default = PlanOptions::default();
    let options = PlanOptions { seed: args.seed, deadline: deadline.unwrap_or(default.deadline), ..default };
    let say = |text: &str| form.progress(text);
    let effort = Effort { runs: None, quick: false, seed: args.seed, jobs: 1 };
    let run_context = RunContext::new(effort, &say, &interrupt::has_come);
    let sets = published.measure(&run_context, &options).map_err(|stop| match stop {
        Stop::Interrupted => Failure::Interrupted(stop.to_string()),
        Stop::Refused(_) => Failure::Failed(stop.to_string()),
    })?;
    form.print(&Answer {
        command: command(args),
        robot: published.robot.name.clone(),
        joints: published.robot.joints.len(),
        seed: args.seed,
        deadline_ms: options.deadline.as_millis(),
        notes,
        sets,
    })
}

fn read(args: &MbmArgs, notes: &mut Vec<String>) -> Result<Published, Failure> {
    let is_urdf = args.robot.extension().is_some_and(|e| e.eq_ignore_ascii_case("urdf"));
    let robot;
    let srdf = args.srdf.clone().or_else(|| beside(&args.robot));
    let source = if is_urdf {
        if srdf.is_none() {
            notes.push("no SRDF file: every pair of links must keep apart".to_owned());
        }
        let tip_link = args.tip_link.as_deref();
        RobotSource::Urdf { urdf: &args.robot, srdf: srdf.as_deref(), tip_link }
    } else {
        robot = arm::robot(&args.robot)?;
        RobotSource::Robot(&robot)
    };
    Published::load(&args.problems, source).map_err(Failure::Usage)
}

/// The SRDF file beside a URDF file: of the same name, or of the name without `_spherized`.
fn beside(urdf: &Path) -> Option<PathBuf> {
    let stem = urdf.file_stem()?.to_str()?;
    let names = [stem, stem.strip_suffix("_spherized").unwrap_or(stem)];
    names.iter().map(|name| urdf.with_file_name(format!("{name}.srdf"))).find(|path| path.is_file())
}

/// The command that repeats it.
fn command(args: &MbmArgs) -> String {
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let deadline = args.deadline_ms.map_or_else(String::new, |ms| format!(" --deadline-ms {ms}"));
    let (problems, robot) = (name(&args.problems), name(&args.robot));
    format!("taustream bench mbm --problems {problems} --robot {robot} --seed {}{deadline}", args.seed)
}
