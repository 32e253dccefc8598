//! `taustream plot`: a picture of a trajectory.
use crate::args::PlotArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use crate::plot::motion;
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use taustream_arm::text::counted;
use taustream_arm::{Scene, TrajectoryFile};

/// What was drawn.
#[derive(Debug, Serialize)]
struct Answer {
    trajectory: String,
    picture: String,
    robot: Option<String>,
    obstacles: usize,
    duration_s: f64,
    strokes: usize,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (duration_s, strokes) = (self.duration_s, self.strokes);
        write!(f, "{}: {duration_s:.3} s, {}", self.picture, counted(strokes, "stroke"))?;
        match &self.robot {
            Some(robot) => write!(f, ", {robot} among {}", counted(self.obstacles, "obstacle")),
            None => write!(f, "; --robot and --scene add limits and the arm in three views"),
        }
    }
}

/// Draws, and says what.
pub(crate) fn run(form: Form, args: &PlotArgs) -> Result<(), Failure> {
    let robot = args.robot.as_deref().map(arm::robot).transpose()?;
    let scene = args
        .scene
        .as_deref()
        .map(arm::scene)
        .transpose()?
        .unwrap_or_else(|| Scene { file: PathBuf::new(), ..Scene::default() });
    let file = match &robot {
        Some(robot) => arm::trajectory_for(&args.trajectory, robot)?,
        None => TrajectoryFile::load(&args.trajectory)?,
    };
    let svg = motion::svg(&args.trajectory, &file, robot.as_ref().map(|robot| (robot, &scene)))?;
    let picture = args.output.clone().unwrap_or_else(|| args.trajectory.with_extension("svg"));
    if picture == Path::new("-") {
        let mut out = io::stdout().lock();
        return out
            .write_all(svg.as_bytes())
            .and_then(|()| out.flush())
            .map_err(|e| Failure::writing("standard output", e));
    }
    write_whole(&picture, &svg)?;
    form.print(&Answer {
        trajectory: args.trajectory.display().to_string(),
        picture: picture.display().to_string(),
        obstacles: scene.obstacles.len(),
        robot: robot.map(|robot| robot.name),
        duration_s: file.trajectory.duration_s(),
        strokes: file.trajectory.strokes().len(),
    })
}
