//! `taustream plot`: a picture of a trajectory.
use crate::args::PlotArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, write_whole};
use crate::plot::motion;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use taustream_arm::text::counted;
use taustream_arm::{Robot, Scene, TrajectoryFile};

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
    let path = args.trajectory.path();
    let file = TrajectoryFile::load(path)?;
    let robot = drawn_robot(form, args, &file)?;
    let scene = args
        .scene
        .as_deref()
        .map(arm::scene)
        .transpose()?
        .unwrap_or_else(|| Scene { file: PathBuf::new(), ..Scene::default() });
    let svg = motion::svg(path, &file, robot.as_ref().map(|robot| (robot, &scene)))?;
    let picture = args.output.clone().unwrap_or_else(|| path.with_extension("svg"));
    if picture == Path::new("-") {
        return Form::Text.print_line(svg.trim_end());
    }
    write_whole(&picture, &svg)?;
    form.print(&Answer {
        trajectory: path.display().to_string(),
        picture: picture.display().to_string(),
        obstacles: scene.obstacles.len(),
        robot: robot.map(|robot| robot.name),
        duration_s: file.trajectory.duration_s(),
        strokes: file.trajectory.strokes().len(),
    })
}

/// The robot that is asked for, else the one that the file names; without a robot that fits, only curves are drawn.
fn drawn_robot(form: Form, args: &PlotArgs, file: &TrajectoryFile) -> Result<Option<Robot>, Failure> {
    let path = args.trajectory.path();
    if let Some(given) = &args.robot {
        let robot = arm::robot(given)?;
        return arm::fitting(path, file, &robot).map(|()| Some(robot));
    }
    let named =
        arm::robot_of(None, path, file).and_then(|robot| arm::fitting(path, file, &robot).map(|()| robot));
    match named {
        Ok(robot) => Ok(Some(robot)),
        Err(why) if args.scene.is_some() => Err(why),
        Err(_) => {
            form.progress(format_args!(
                "the robot {:?} that the file names is not found, or is another one now: only curves are drawn; --robot names it",
                file.robot
            ));
            Ok(None)
        }
    }
}
