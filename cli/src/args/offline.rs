//! Arguments of the commands that need no running process.
use super::goal::GoalArgs;
use super::tip::TipArgs;
use super::via::ViaArgs;
use crate::angles::{Angles, Times};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use taustream_drivers::link::LinkChoice;
use taustream_optimizers::{METHODS, Method, Reading};
use taustream_planner::{Objective, PlannerKind};

const PLAN_HELP: &str = "\
Examples:
  taustream plan --robot ur5 --scene pillars \\
      --start \"0,-1.57,1.57,-1.57,-1.57,0\" --goal \"1.2,-1.3,1.4,-1.6,-1.57,0\" -o move.json
  taustream plan ... --planner ibfoa --seed 7 --deadline-ms 5000 --json
  taustream plan ... --planner bfoa --reading printed
  taustream plan ... --objective energy --deadline-ms 5000
  taustream plan --robot piper --scene open --start 0,0.5,-0.5,0,0,0 --to-position 0.3,0.1,0.25
  taustream plan ... --to-pose 0.4,-0.3,0.35,0,3.1416,0 --tolerance-rad 0.01,0.01,free
  taustream plan ... --to-position 0.4,-0.3,0.35 --linear --tip-speed-m-s 0.1
  taustream plan ... --upright-deg 10 --tool-axis -z --tip-above-m 0.2    a glass of water, above the table
  taustream plan ... --tip-box-m -0.6,-0.6,0.1,0.6,0.6,inf --tip-speed-m-s 0.25
  taustream plan ... --to-named home          a [[pose]] of the robot file, or a group_state of its SRDF
  taustream plan ... --by 0,0,0,0,0,90deg     relative to the start
  taustream plan ... --via 0.3,-1.2,1.2,-1.6,-1.57,0 --via 0.8,-1,1,-1.6,-1.57,0 --blend-rad 0.1
  taustream plan ... -o - | jq .strokes        the file on stdout, the summary on stderr

The motion is verified along its whole length before it is written; what the tip must keep on the way is proven with it, as are
the speed limits of the scene's zones ([[zone]], docs/scene.md). A start or goal that violates a constraint is refused. One seed gives one motion, unless the deadline
aborted the search; the summary then says so.";

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
    /// Start pose, rad, one value per joint: "0,-1.57,1.57,-1.57,-1.57,0".
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true, required_unless_present = "start_deg")]
    start: Option<Angles>,
    /// The same in degrees.
    #[arg(long, value_name = "DEG,..", allow_hyphen_values = true, value_parser = Angles::of_degrees, conflicts_with = "start")]
    start_deg: Option<Angles>,
    /// Where to go.
    #[command(flatten)]
    pub(crate) goal: GoalArgs,
    /// What to pass on the way.
    #[command(flatten)]
    pub(crate) via: ViaArgs,
    /// Search poses for --to-position by a swarm (an optimiser by name) instead of inverse kinematics.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["goal", "goal_deg", "to_named", "by", "by_deg", "to_pose", "linear"], value_parser = method())]
    pub(crate) reach_with: Option<&'static Method>,
    /// Planner.
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = planner_kind())]
    pub(crate) planner: PlannerKind,
    /// Objective by which verified motions are compared.
    #[arg(long, value_name = "WHAT", default_value = "time", value_parser = objective())]
    pub(crate) objective: Objective,
    /// Follow the papers as printed, or with their errors corrected.
    #[arg(long, value_name = "READING", default_value = "corrected", value_parser = reading())]
    pub(crate) reading: Reading,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Deadline of planning, ms, which is spent on shorter motions. Without it the answer comes after a few searches and
    /// shortcuts, mostly within milliseconds, and after 2000 ms at most.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=3_600_000))]
    pub(crate) deadline_ms: Option<u32>,
    /// Say what was tried, stage by stage: how long each took, what came of it, and how long the best motion was then.
    #[arg(long)]
    pub(crate) explain: bool,
    /// Trajectory file to write; `-` is stdout. Without it only the summary is printed.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

impl PlanArgs {
    /// Where to start, and the option that says so. One of the two is there: clap asks for it.
    pub(crate) fn start(&self) -> (&Angles, &'static str) {
        match (&self.start, &self.start_deg) {
            (None, Some(angles)) => (angles, "--start-deg"),
            (Some(angles), _) => (angles, "--start"),
            (None, None) => (Angles::NONE, "--start"),
        }
    }
}

const SAMPLE_HELP: &str = "\
Examples:
  taustream sample move.json > move.csv
  taustream sample move.json --rate-hz 50 | head
  taustream sample move.json --at 0,0.5,1.25 --json

The columns are t_s, then q1_rad.. (position), v1_rad_s.. (velocity), a1_rad_s2.. (acceleration) and
j1_rad_s3.. (jerk). Samples are at k / rate, k = 0, 1, ..; the last sample is the end of the motion.
Numbers have enough digits to read back the same bits.";

/// `taustream sample`
#[derive(Args, Debug)]
#[command(after_help = SAMPLE_HELP)]
pub(crate) struct SampleArgs {
    /// What to sample.
    #[command(flatten)]
    pub(crate) trajectory: TrajectoryArg,
    /// Sample rate, Hz.
    #[arg(
        long,
        value_name = "HZ",
        allow_negative_numbers = true,
        default_value_t = 1000.0,
        conflicts_with = "at"
    )]
    pub(crate) rate_hz: f64,
    /// Sample at these times instead, s. Before the start and after the end the arm is at rest.
    #[arg(long, value_name = "S,..", allow_hyphen_values = true)]
    pub(crate) at: Option<Times>,
}

const PLOT_HELP: &str = "\
Examples:
  taustream plot move.json                                          joint curves, written to move.svg
  taustream plot move.json --robot ur5 --scene pillars -o move.svg  with limits, arm and obstacles
  taustream plot move.json --robot ur5 -o - | display svg:-

The arm is drawn at nine times from light (start) to dark (end), with its collision shapes. All views have one scale.
Meshes of scenes are drawn as their hulls.";

/// `taustream plot`
#[derive(Args, Debug)]
#[command(after_help = PLOT_HELP)]
pub(crate) struct PlotArgs {
    /// What to draw.
    #[command(flatten)]
    pub(crate) trajectory: TrajectoryArg,
    /// Robot, for limits and views: a path, or the name of a shipped robot. Without it the one that the file names.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: Option<PathBuf>,
    /// Scene, for the obstacles in the views: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: Option<PathBuf>,
    /// Picture to write; `-` is stdout. Without it: beside the trajectory file, with the extension svg.
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
energy_J, the mechanical work of the joints, is added for robots whose file has masses; it is not part of the cost.";

/// `taustream cost`
#[derive(Args, Debug)]
#[command(after_help = COST_HELP)]
pub(crate) struct CostArgs {
    /// The motion to evaluate.
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
    /// Equal time steps per stroke.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 120, value_parser = waypoints)]
    pub(crate) waypoints_per_segment: usize,
    /// Expansion of the obstacles in the paper's model, m.
    #[arg(long, value_name = "M", default_value_t = 0.1, allow_hyphen_values = true)]
    pub(crate) expansion_m: f64,
    /// Weights of path length, joint travel and penalty.
    #[arg(long, value_name = "W1,W2,W3", default_value = "7,300,1.2e7", allow_hyphen_values = true)]
    pub(crate) weights: Weights,
}

const VERIFY_HELP: &str = "\
Examples:
  taustream verify --robot ur5 --scene pillars --trajectory move.json
  taustream verify move.json --scene pillars --upright-deg 10 --tool-axis -z --tip-speed-m-s 0.25

Limits, distances, and the speed limits of the scene's zones are proven along the whole motion, between samples too;
so is what the tip shall keep, where options ask for it.";

/// `taustream verify`
#[derive(Args, Debug)]
#[command(after_help = VERIFY_HELP)]
pub(crate) struct VerifyArgs {
    /// The motion.
    #[command(flatten)]
    pub(crate) motion: MotionArgs,
    /// What the tip must keep.
    #[command(flatten)]
    pub(crate) tip: TipArgs,
    /// Group whose tip is meant, for a robot with several tips.
    #[arg(long, value_name = "NAME")]
    pub(crate) group: Option<String>,
}

/// Robot, scene and trajectory.
#[derive(Args, Debug)]
pub(crate) struct MotionArgs {
    /// Robot: a path, or the name of a shipped robot. Without it the one that the file names.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: Option<PathBuf>,
    /// Scene: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// Trajectory.
    #[command(flatten)]
    pub(crate) trajectory: TrajectoryArg,
}

/// A trajectory file, with or without the word `--trajectory`.
#[derive(Args, Debug)]
pub(crate) struct TrajectoryArg {
    /// Trajectory file.
    #[arg(
        value_name = "FILE",
        required_unless_present = "named_trajectory",
        conflicts_with = "named_trajectory"
    )]
    trajectory: Option<PathBuf>,
    /// The same, by its name.
    #[arg(id = "named_trajectory", long = "trajectory", value_name = "FILE")]
    named: Option<PathBuf>,
}

impl TrajectoryArg {
    /// The file.
    pub(crate) fn path(&self) -> &Path {
        // One of the two is there: clap asks for it.
        self.trajectory.as_deref().or(self.named.as_deref()).unwrap_or(Path::new(""))
    }
}

/// `taustream check`
#[derive(Args, Debug)]
#[command(after_help = "Examples:\n  taustream check vcan6\n  taustream check ./my-arm.toml --json")]
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

Every finding is ok, unknown (not readable on this computer), a WARNING or a PROBLEM, with its remedy. Nothing is changed.
Exit code 1 means: at least one problem.

It checks a computer, not an arm. A result without problems does not mean that the arm is safe.";

/// `taustream doctor`
#[derive(Args, Debug)]
#[command(after_help = DOCTOR_HELP)]
pub(crate) struct DoctorArgs {
    /// Duration of the wake-up measurement, s; 0 skips it.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 5.0, value_parser = measuring_s)]
    pub(crate) seconds: f64,
    /// Priority of the measurement; without it that of the settings.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = clap::value_parser!(u8).range(1..=99))]
    pub(crate) priority: Option<u8>,
}

/// `taustream man`
#[derive(Args, Debug)]
#[command(
    after_help = "Examples:\n  taustream man | man -l -\n  taustream man /usr/local/share/man/man1 && man taustream-plan"
)]
pub(crate) struct ManArgs {
    /// Directory to write one page per program and command into; created if missing.
    #[arg(value_name = "DIR")]
    pub(crate) directory: Option<PathBuf>,
}

/// `taustream bench`
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Measurement.
    #[command(subcommand)]
    pub(crate) name: BenchName,
}

/// The measurements.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchName {
    /// Measure wake-up latency and duration of the cycle against bare loops, in alternating slices of one run.
    ///
    /// No servos are needed. Real servos on the bus would get setpoints, so use a virtual bus.
    Cycle {
        /// Duration, s.
        #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 20.0)]
        seconds: f64,
        /// Slices, bare and streamer alternately.
        #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 20)]
        slices: u32,
        /// CAN link; without it frames are dropped, without system calls.
        #[arg(long, value_name = "LINK")]
        link: Option<LinkChoice>,
        /// Measure without real-time rights too; such values say little.
        #[arg(long)]
        allow_non_realtime: bool,
    },
    /// Compare the duration of the cycle with several settings files, alternately in one run.
    ///
    /// No servos are needed. Real servos on the bus would get setpoints, so use a virtual bus.
    Compare(CompareArgs),
    /// Measure the vectorised cost function of Wang et al. (2022) against plain f64, and whole runs of IBFOA.
    Cost(CostBenchArgs),
    /// Check the claims of the five papers, and print their tables beside ours.
    Papers(super::PapersArgs),
    /// Plan published problems (MotionBenchMaker): problems solved, planning time, motions, with and without deadlines.
    Mbm(super::MbmArgs),
    /// Compare the planners by name: problems solved, planning time, quality of the motions.
    Planners(super::PlannersArgs),
    /// Measure lag and error behind a stream of targets, beside Ruckig and interpolation.
    Follow(super::FollowBenchArgs),
    /// Compare the durations of straight moves and rounded paths with jerk-limited optima.
    Timing(super::TimingArgs),
    /// Measure how long stops take and how far they go, by speed, by phase and by move, against the optimum along the path.
    Stops(StopsBenchArgs),
    /// Draw one move through three points and one replacement in motion, as others make them and as ours.
    Pictures(super::PicturesArgs),
    /// Measure how long replacements of running motions take, against the optimum from the state at the cut.
    Cuts(super::CutsBenchArgs),
}

/// What `taustream bench stops` takes.
#[derive(Args, Debug)]
pub(crate) struct StopsBenchArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// Instants of each move at which a stop begins.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 100, value_parser = clap::value_parser!(u32).range(5..=10_000))]
    pub(crate) instants: u32,
}

/// What `taustream bench cost` takes.
#[derive(Args, Debug)]
pub(crate) struct CostBenchArgs {
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// Duration of the measurement of single evaluations, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 10.0, value_parser = measuring_s)]
    pub(crate) seconds: f64,
    /// Whole runs of case 1 of the paper, each of a different random case.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 9, value_parser = runs())]
    pub(crate) case_1_runs: usize,
    /// Whole runs of case 2, some seconds each.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1, value_parser = runs())]
    pub(crate) case_2_runs: usize,
}

/// What `taustream bench compare` takes.
#[derive(Args, Debug)]
pub(crate) struct CompareArgs {
    /// Settings files or names; the first one is the reference.
    #[arg(required = true, num_args = 2.., value_name = "SETTINGS")]
    pub(crate) arms: Vec<PathBuf>,
    /// Duration per arm, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 10.0)]
    pub(crate) seconds: f64,
    /// Rounds; each round measures every arm once.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 10)]
    pub(crate) slices: u32,
    /// CAN link; without it frames are dropped, without system calls.
    #[arg(long, value_name = "LINK")]
    pub(crate) link: Option<LinkChoice>,
    /// Measure without real-time rights too; such values say little.
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
            _ => Err(format!("`{}` is not a weight; expected a finite number of 0 or more", word.trim())),
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
