//! Wang et al. (2022): IBFOA over control points, Tau-J* strokes between them.
pub(crate) mod cases;
mod contenders;
pub(crate) mod count;
mod course;
pub(crate) mod errata;
mod meeting;
mod paper_field;
mod path;
mod pictures;
pub(crate) mod planners;
pub(crate) mod profiles;
pub(crate) mod sweep;
mod trees;
mod verdicts;

use crate::run_context::{RunContext, Stop};
use std::fmt::Display;
use std::path::Path;
use taustream_arm::Robot;
use taustream_optimizers::Reading;
use taustream_optimizers::cost::CostModel;
use taustream_optimizers::papers::control_points::{CONTROL_POINTS, Case, Centres};

/// The arm of the comparisons: the paper's six joints have no name.
const UR5: &str = include_str!("../../../config/robots/ur5.toml");
/// 1/k of every stroke of the paper.
const K: f64 = 0.1;
/// Time of a segment.
const SEGMENT_S: f64 = 6.0;

fn ur5() -> Result<Robot, Stop> {
    Robot::from_toml(Path::new("ur5.toml"), UR5).map_err(|faults| Stop::Refused(faults.to_string()))
}

/// The scene of a run, which is the same for all methods and readings.
fn case(run_context: &RunContext, robot: &Robot, run: usize) -> Result<Case, Stop> {
    case_within(run_context, robot, &Case::CENTRES_M, run)
}

/// The same with the spheres' centres in another box.
fn case_within(
    run_context: &RunContext,
    robot: &Robot,
    centres_m: &Centres,
    run: usize,
) -> Result<Case, Stop> {
    let case = Case::random_within(robot, &CostModel::default(), centres_m, run_context.seed(run));
    case.ok_or_else(|| Stop::Refused(format!("{} has no room among the paper's spheres", robot.name)))
}

fn refused(error: impl Display) -> Stop {
    Stop::Refused(error.to_string())
}

/// The unit in which the path of the tip counts: the paper prints none.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unit {
    Metres,
    Millimetres,
}

impl Unit {
    const BOTH: [Self; 2] = [Self::Metres, Self::Millimetres];

    fn name(self) -> &'static str {
        match self {
            Self::Metres => "L in m",
            Self::Millimetres => "L in mm",
        }
    }

    fn model(self, reading: Reading) -> CostModel {
        let paper = CostModel::default();
        let [length, travel, penalty] = paper.weights;
        let per_m = match self {
            Self::Metres => 1.0,
            Self::Millimetres => 1000.0,
        };
        CostModel { weights: [length * per_m, travel, penalty], reading, ..paper }
    }
}

/// What the paper leaves open, for the report.
fn ours() -> Vec<String> {
    vec![
        "the arm is a UR5; start and goal uniform in ±π, spheres' centres uniform in x, y ±0.8 m, z 0 to 0.9 m, drawn \
         again until both ends are free"
            .to_owned(),
        format!("{CONTROL_POINTS} control points, 481 poses; points are clamped to ±π; no dispersal after the last \
         reproduction; round(S_r δ) survivors; all methods begin with the same population"),
    ]
}
