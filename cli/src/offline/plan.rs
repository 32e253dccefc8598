//! `taustream plan`: from two poses to a verified trajectory file.
use super::verify::{PeakTable, PeakUse, clearance_words, peak_use};
use crate::args::PlanArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;
use taustream_arm::{Robot, TrajectoryFile};
use taustream_planner::{Plan, PlanError, PlanOptions, plan};

/// The summary of a plan.
#[derive(Debug, Serialize)]
struct Summary {
    robot: String,
    digest: String,
    file: Option<String>,
    planner: String,
    seed: u64,
    planning_s: f64,
    duration_s: f64,
    strokes: usize,
    clearance_m: f64,
    clearance_at_s: f64,
    clearance_between: [String; 2],
    peak_use: Vec<PeakUse>,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "planned by    {} in {:.3} s (seed {})", self.planner, self.planning_s, self.seed)?;
        writeln!(f, "duration      {:.3} s, {} strokes", self.duration_s, self.strokes)?;
        let [a, b] = &self.clearance_between;
        writeln!(f, "clearance     {}", clearance_words(self.clearance_m, self.clearance_at_s, (a, b)))?;
        write!(f, "{}", PeakTable(&self.peak_use))?;
        match &self.file {
            Some(file) => write!(f, "written to    {file}"),
            None => write!(f, "not saved; -o FILE writes the trajectory file"),
        }
    }
}

/// Plans, and writes file and summary.
pub(crate) fn run(form: Form, args: &PlanArgs) -> Result<(), Failure> {
    let robot = arm::robot(&args.robot)?;
    let scene = arm::scene(&args.scene)?;
    let start_rad = args.start.pose_of(&robot, "--start")?;
    let goal_rad = args.goal.pose_of(&robot, "--goal")?;
    let options = PlanOptions {
        seed: args.seed,
        deadline: Duration::from_millis(args.deadline_ms.into()),
        planner: args.planner,
        reading: args.reading,
        ..PlanOptions::default()
    };
    let found = plan(&robot, &scene, &start_rad, &goal_rad, &options)
        .map_err(|error| explain(&error, args, &robot))?;
    let json = TrajectoryFile {
        robot: robot.name.clone(),
        digest: Some(robot.digest_hex()),
        trajectory: found.trajectory.clone(),
    }
    .to_json();

    let summary = summarise(&robot, found, args);
    match args.output.as_deref() {
        None => form.print(&summary),
        Some(path) if path == Path::new("-") => {
            let mut out = io::stdout().lock();
            writeln!(out, "{}", json.trim_end())
                .and_then(|()| out.flush())
                .map_err(|e| Failure::writing("standard output", e))?;
            form.progress(&summary);
            Ok(())
        }
        Some(path) => {
            write_whole(path, &json)?;
            form.print(&summary)
        }
    }
}

fn explain(error: &PlanError, args: &PlanArgs, robot: &Robot) -> Failure {
    let hint = args.start.degrees_hint(robot).or_else(|| args.goal.degrees_hint(robot));
    Failure::Refused(match hint {
        Some(hint) => format!("no plan: {error} ({hint})"),
        None => format!("no plan: {error}"),
    })
}

fn summarise(robot: &Robot, found: Plan, args: &PlanArgs) -> Summary {
    let (a, b) = found.proof.clearance_between;
    Summary {
        robot: robot.name.clone(),
        digest: robot.digest_hex(),
        file: args.output.as_ref().map(|p| p.display().to_string()),
        planner: found.how,
        seed: args.seed,
        planning_s: found.planning_s,
        duration_s: found.proof.duration_s,
        strokes: found.trajectory.strokes().len(),
        clearance_m: found.proof.clearance_m,
        clearance_at_s: found.proof.clearance_at_s,
        clearance_between: [a, b],
        peak_use: peak_use(robot, &found.proof.peaks),
    }
}
