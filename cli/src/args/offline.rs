//! Words of the commands that need no running process.
use crate::angles::{Angles, Position, Times};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::str::FromStr;
use taustream_drivers::link::LinkChoice;
use taustream_planner::optimize::{METHODS, Method, Reading};
use taustream_planner::{Objective, PlannerKind};

const PLAN_HELP: &str = "\
Examples:
  taustream plan --robot ur5 --scene pillars \\
      --start \"0,-1.57,1.57,-1.57,-1.57,0\" --goal \"1.2,-1.3,1.4,-1.6,-1.57,0\" -o move.json
  taustream plan ... --planner ibfoa --seed 7 --deadline-ms 5000 --json
  taustream plan ... --planner bfoa --reading printed
  taustream plan ... --objective energy --deadline-ms 5000
  taustream plan --robot piper --scene open --start 0,0.5,-0.5,0,0,0 --to-position 0.3,0.1,0.25
  taustream plan ... -o - | jq .strokes        the file on stdout, the summary on stderr

The motion is verified along its whole length before it is written. One seed gives one motion, unless the deadline
cut the search short; the summary says so then.";

/// `taustream plan`
#[derive(Args, Debug)]
#[command(after_help = PLAN_HELP)]
pub(crate) struct PlanArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: PathBuf,
    /// Scene: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Pose to start from, rad, one value a joint: "0,-1.57,1.57,-1.57,-1.57,0".
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true)]
    pub(crate) start: Angles,
    /// Pose to go to, rad, one value a joint.
    #[arg(
        long,
        value_name = "RAD,..",
        allow_hyphen_values = true,
        required_unless_present = "to_position",
        conflicts_with = "to_position"
    )]
    pub(crate) goal: Option<Angles>,
    /// Position to bring the tip to, m, in the base's frame, instead of a pose: "0.4,-0.2,0.3".
    ///
    /// Swarms look for poses whose tip is there, clear of everything; the best verified motion to one of them wins. How
    /// the tip is turned there is left free.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    pub(crate) to_position: Option<Position>,
    /// Which optimiser looks for poses at the position; without it those that measured best take turns.
    #[arg(long, value_name = "NAME", conflicts_with = "goal", value_parser = method())]
    pub(crate) reach_with: Option<&'static Method>,
    /// Which planner.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = planner_kind())]
    pub(crate) planner: PlannerKind,
    /// What makes one verified motion better than another.
    #[arg(long, value_name = "WHAT", default_value = "time", value_parser = objective())]
    pub(crate) objective: Objective,
    /// Where a paper cannot be meant as printed: which reading the optimisers follow.
    #[arg(long, value_name = "READING", default_value = "corrected", value_parser = reading())]
    pub(crate) reading: Reading,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// How long planning may take, ms.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=3_600_000))]
    pub(crate) deadline_ms: u32,
    /// Trajectory file to write; `-` is stdout. Without it only the summary is printed.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

const SAMPLE_HELP: &str = "\
Examples:
  taustream sample move.json > move.csv
  taustream sample move.json --rate-hz 50 | head
  taustream sample move.json --at 0,0.5,1.25 --json

The table begins with t_s, then q1_rad.. (position), v1_rad_s.. (velocity), a1_rad_s2.. (acceleration) and
j1_rad_s3.. (jerk). Samples lie on the grid k / rate from 0 on; the end of the motion is always the last one.
Numbers are written so that reading them gives the same bits.";

/// `taustream sample`
#[derive(Args, Debug)]
#[command(after_help = SAMPLE_HELP)]
pub(crate) struct SampleArgs {
    /// Trajectory file.
    #[arg(value_name = "FILE")]
    pub(crate) trajectory: PathBuf,
    /// Samples a second, Hz.
    #[arg(
        long,
        value_name = "HZ",
        allow_negative_numbers = true,
        default_value_t = 1000.0,
        conflicts_with = "at"
    )]
    pub(crate) rate_hz: f64,
    /// Sample at these times instead, s. Before the start and after the end the arm rests.
    #[arg(long, value_name = "S,..", allow_hyphen_values = true)]
    pub(crate) at: Option<Times>,
}

const PLOT_HELP: &str = "\
Examples:
  taustream plot move.json                                          joint curves, written to move.svg
  taustream plot move.json --robot ur5 --scene pillars -o move.svg  limits, and the arm among its obstacles, too
  taustream plot move.json --robot ur5 -o - | display svg:-

The arm is drawn at nine times from light (start) to dark (end), with its collision shapes; metres are the same in all
views and directions. Meshes of scenes are drawn as their hulls.";

/// `taustream plot`
#[derive(Args, Debug)]
#[command(after_help = PLOT_HELP)]
pub(crate) struct PlotArgs {
    /// Trajectory file.
    #[arg(value_name = "FILE")]
    pub(crate) trajectory: PathBuf,
    /// Robot, for limits and views: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: Option<PathBuf>,
    /// Scene, for the obstacles in the views: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE", requires = "robot")]
    pub(crate) scene: Option<PathBuf>,
    /// Picture to write; `-` is stdout. Without it: beside the trajectory file, with the ending svg.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

const COST_HELP: &str = "\
Examples:
  taustream cost --robot ur5 --scene spheres.toml --trajectory move.json
  taustream cost ... --weights 7,300,1.2e7 --expansion-m 0.1 --json

The paper's model: links are bare segments between frame origins, obstacles are spheres only, each stroke is
sampled at equal time steps plus the end, strokes must not overlap.
cost = w1 path_length_m + w2 joint_travel_rad + w3 penalty (the penalty counts only in collision).
energy_J, the mechanical work of the joints, is added for robots whose file states masses; it is no part of the cost.";

/// `taustream cost`
#[derive(Args, Debug)]
#[command(after_help = COST_HELP)]
pub(crate) struct CostArgs {
    /// What to rate.
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
    /// Equal time steps a stroke.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 120, value_parser = waypoints)]
    pub(crate) waypoints_per_segment: usize,
    /// How much the paper's obstacles grow, m.
    #[arg(long, value_name = "M", default_value_t = 0.1, allow_hyphen_values = true)]
    pub(crate) expansion_m: f64,
    /// Weights of path length, joint travel and penalty.
    #[arg(long, value_name = "W1,W2,W3", default_value = "7,300,1.2e7", allow_hyphen_values = true)]
    pub(crate) weights: Weights,
}

/// Robot, scene and trajectory; `taustream verify`
#[derive(Args, Debug)]
pub(crate) struct MotionArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: PathBuf,
    /// Scene: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Trajectory file.
    #[arg(long, value_name = "FILE")]
    pub(crate) trajectory: PathBuf,
}

/// `taustream check`
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  taustream check vcan6\n  taustream check config/robots/ur5.toml --json")]
pub(crate) struct CheckArgs {
    /// Settings, robot, scene or trajectory file: a path, or the name of a shipped file.
    #[arg(value_name = "CONFIG")]
    pub(crate) config: PathBuf,
}

const DOCTOR_HELP: &str = "\
Examples:
  taustream doctor                                    this computer, and the interfaces of the usual settings
  taustream doctor --settings my-arm.toml --seconds 600
  taustream doctor --json | jq '.findings[] | select(.grade == \"problem\")'

Every finding is ok, unknown (this computer does not say), a WARNING or a PROBLEM, with its cure. Nothing is changed.
Exit code 1 means: at least one problem.

It looks at a computer, not at an arm: a clean bill is no promise that the arm is safe.";

/// `taustream doctor`
#[derive(Args, Debug)]
#[command(after_help = DOCTOR_HELP)]
pub(crate) struct DoctorArgs {
    /// How long to measure wake-ups, s; 0 leaves the measurement out.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 5.0, value_parser = measuring_s)]
    pub(crate) seconds: f64,
    /// Priority to measure at; without it that of the settings.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(crate) priority: Option<u8>,
}

/// `taustream man`
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  taustream man | man -l -\n  taustream man /usr/local/share/man/man1 && man taustream-plan"
)]
pub(crate) struct ManArgs {
    /// Directory to write one page a program and command into; made when it is missing.
    #[arg(value_name = "DIR")]
    pub(crate) directory: Option<PathBuf>,
}

/// `taustream bench`
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Which measurement.
    #[command(subcommand)]
    pub(crate) name: BenchName,
}

/// The measurements.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchName {
    /// Wake-up lateness and time of the streamer's cycle, beside bare loops in alternating slices of one run.
    ///
    /// No servos are needed: the frames go out, and the arm swings in memory only. Real servos on the bus would get
    /// setpoints, so run it on a virtual bus.
    Cycle {
        /// How long to measure, s.
        #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 20.0)]
        seconds: f64,
        /// Slices, bare and streamer in turns.
        #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 20)]
        slices: u32,
        /// What carries the frames; without it they are dropped, without system calls.
        #[arg(long, value_name = "LINK")]
        link: Option<LinkChoice>,
        /// Measure without real-time rights too; such figures say little.
        #[arg(long)]
        allow_non_realtime: bool,
    },
    /// Time of the streamer's cycle with several settings files, in turns in one run: two buses against one, say.
    ///
    /// As with `cycle`, no servos are needed, and real ones on the bus would get setpoints.
    Compare(CompareArgs),
    /// The paper's cost function in vector lanes beside plain f64, in turns in one run, and whole runs of its IBFOA.
    Cost(CostBenchArgs),
    /// Check the claims of the five papers: their tables beside ours, claim by claim.
    Papers(super::PapersArgs),
    /// Compare the planners by name: what they find, how fast, and how good the motions are.
    Planners(super::PlannersArgs),
}

/// What `taustream bench cost` takes.
#[derive(Args, Debug)]
pub(crate) struct CostBenchArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// How long to measure single evaluations, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 10.0, value_parser = measuring_s)]
    pub(crate) seconds: f64,
    /// Whole runs of the paper's case 1, each of a random case of its own.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 9, value_parser = runs())]
    pub(crate) case_1_runs: usize,
    /// Whole runs of case 2, some seconds each.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1, value_parser = runs())]
    pub(crate) case_2_runs: usize,
}

/// What `taustream bench compare` takes.
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// Settings files, or names of some; the first one is what the others are measured by.
    #[arg(required = true, num_args = 2.., value_name = "SETTINGS")]
    pub(crate) arms: Vec<PathBuf>,
    /// How long to measure each arm, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 10.0)]
    pub(crate) seconds: f64,
    /// Rounds in which each arm has its turn.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 10)]
    pub(crate) slices: u32,
    /// What carries the frames; without it they are dropped, without system calls.
    #[arg(long, value_name = "LINK")]
    pub(crate) link: Option<LinkChoice>,
    /// Measure without real-time rights too; such figures say little.
    #[arg(long)]
    pub(crate) allow_non_realtime: bool,
}

/// The planners by name; clap lists them in the help and suggests the nearest.
pub(super) fn planner_kind() -> impl TypedValueParser<Value = PlannerKind> {
    PossibleValuesParser::new(
        PlannerKind::all().map(|kind| PossibleValue::new(kind.name()).help(kind.about())),
    )
    .map(|name| PlannerKind::from_name(&name).unwrap_or_default())
}

/// The optimisers by name.
fn method() -> impl TypedValueParser<Value = &'static Method> {
    PossibleValuesParser::new(METHODS.iter().map(|m| PossibleValue::new(m.name).help(m.about)))
        .try_map(|name| METHODS.iter().find(|m| m.name == name).ok_or("no such optimiser"))
}

/// The objectives by name.
fn objective() -> impl TypedValueParser<Value = Objective> {
    PossibleValuesParser::new(Objective::ALL.map(|o| PossibleValue::new(o.name()).help(o.about())))
        .map(|name| Objective::from_name(&name).unwrap_or_default())
}

/// The readings of the papers by name.
fn reading() -> impl TypedValueParser<Value = Reading> {
    PossibleValuesParser::new(Reading::ALL.map(|r| PossibleValue::new(r.name()).help(r.about())))
        .map(|name| Reading::from_name(&name).unwrap_or_default())
}

/// How often something is run.
fn runs() -> impl TypedValueParser<Value = usize> {
    clap::value_parser!(u16).range(0..=1000).map(usize::from)
}

/// A time to measure: nothing, or at least what gives a few samples.
fn measuring_s(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(s) if s == 0.0 || (0.1..=3_600.0).contains(&s) => Ok(s),
        _ => Err("expected 0, or seconds from 0.1 to 3600".to_owned()),
    }
}

fn waypoints(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(steps) if (1..=100_000).contains(&steps) => Ok(steps),
        _ => Err("expected a whole number from 1 to 100000".to_owned()),
    }
}

/// The three weights of the cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Weights(pub(crate) [f64; 3]);

impl FromStr for Weights {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = |word: &str| match word.trim().parse::<f64>() {
            Ok(weight) if weight.is_finite() && weight >= 0.0 => Ok(weight),
            _ => Err(format!("`{}` is no weight; expected a finite number of 0 or more", word.trim())),
        };
        let weights = text.split(',').map(parse).collect::<Result<Vec<f64>, _>>()?;
        let count = weights.len();
        let three =
            weights.try_into().map_err(|_| format!("{count} weights; expected 3: \"7,300,1.2e7\""))?;
        Ok(Self(three))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_three_finite_numbers() {
        assert_eq!("7,300,1.2e7".parse::<Weights>(), Ok(Weights([7.0, 300.0, 1.2e7])));
        for text in ["", "1,2", "1,2,3,4", "1,2,nan", "1,-2,3", "a,b,c"] {
            assert!(text.parse::<Weights>().is_err(), "{text}");
        }
    }
}
