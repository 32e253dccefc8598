//! Arguments of the commands that send streams of targets, and of their measurement.
use super::live::rate_hz;
use clap::{ArgGroup, Args, ValueEnum};
use std::path::PathBuf;

const FOLLOW_HELP: &str = "\
Examples:
  my-policy | taustream follow
  taustream follow --rate-hz 30 < recorded.csv
  echo '[0.1,-1.5,1.4,-1.6,-1.57,0]' | taustream follow

One line is one target, the newest wins, and the planner leads the arm on from its motion without a jump, inside the limits
and clear of obstacles. Forms of a line:
  0.1,-1.5,1.4,-1.6,-1.57,0                   joint angles in rad, or with a unit (90deg); a header may name the columns:
                                              due_s,q1_rad,..,v1_rad_s,..
  {\"position_rad\":[..],\"due_s\":0.1}         due_s: when the arm is wanted there, s after the line was read
  [{\"due_s\":0.03,\"position_rad\":[..]},..]   a chunk: its targets replace those of the last one that are not reached
What is committed always ends at rest: when the stream ends, the arm goes to its last target and holds. A target in the way
of an obstacle is approached as far as it can be. A line that is no target is named with its number and skipped. Exit code 1:
no target was taken.";

/// `taustream follow`
#[derive(Args, Debug)]
#[command(after_help = FOLLOW_HELP)]
pub(crate) struct FollowArgs {
    /// Read this many lines a second, for files; without it, as they come.
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, value_parser = rate_hz)]
    pub(crate) rate_hz: Option<f64>,
}

const JOG_HELP: &str = "\
Examples:
  taustream jog --joint elbow                  hold Right or + to move it forwards, Left or - to move it back
  taustream jog --axis z --speed-m-s 0.02      the tip, along the z axis of the base
  taustream jog --axis x --tool                the tip, along its own x axis
  my-pendant | taustream jog --joint 3         standard input: a + or - at least every 200 ms while the arm is to move

The arm moves only while the key, or standard input, keeps refreshing. After the dead man's time it stops, also when this command
or its terminal dies: what was sent ends at rest. Terminals repeat a key only some 300 ms after it was pressed, so the arm takes
a first small step. Space stops, q or Esc ends.";

/// `taustream jog`
#[derive(Args, Debug)]
#[command(after_help = JOG_HELP, group = ArgGroup::new("what").required(true).args(["joint", "axis"]))]
pub(crate) struct JogArgs {
    /// Joint to move: its name, or its number from 1.
    #[arg(long, value_name = "NAME")]
    pub(crate) joint: Option<String>,
    /// Axis to move the tip along; its rotation is held.
    #[arg(long, value_name = "AXIS")]
    pub(crate) axis: Option<Axis>,
    /// Group whose tip is moved, of a robot with several tips.
    #[arg(long, value_name = "NAME", requires = "axis")]
    pub(crate) group: Option<String>,
    /// The axis is that of the tip, as it is when the key is pressed; without it, that of the base.
    #[arg(long, requires = "axis")]
    pub(crate) tool: bool,
    /// Speed of a joint, rad/s.
    #[arg(long, value_name = "RAD_S", default_value_t = 0.1, allow_negative_numbers = true, value_parser = speed)]
    pub(crate) speed_rad_s: f64,
    /// Speed of the tip, m/s.
    #[arg(long, value_name = "M_S", default_value_t = 0.02, allow_negative_numbers = true, value_parser = speed)]
    pub(crate) speed_m_s: f64,
    /// Dead man's time: without a refresh for this long the arm stops, ms.
    #[arg(long, value_name = "MS", default_value_t = 200, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(50..=200))]
    pub(crate) dead_man_ms: u32,
}

/// An axis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Axis {
    /// Forwards along x.
    X,
    /// Forwards along y.
    Y,
    /// Forwards along z.
    Z,
}

fn speed(text: &str) -> Result<f64, String> {
    let value = text.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "expected a number above 0".to_owned())
}

const FOLLOW_BENCH_HELP: &str = "\
Examples:
  taustream bench follow
  taustream bench follow --robot piper --json

One joint with the limits of the robot's first joint follows targets of a swing (0.5 rad at 0.5 Hz) and of a motion like a tracked
hand's. Beside it: Ruckig called anew for every target, without any latency, and linear and cubic interpolation over one period. Chunks
of 16 targets at 30 Hz are replaced after every 8, each 20 to 70 mrad off the one before. No arm is needed.";

/// `taustream bench follow`
#[derive(Args, Debug)]
#[command(after_help = FOLLOW_BENCH_HELP)]
pub(crate) struct FollowBenchArgs {
    /// Robot whose limits are used: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// How long each stream lasts, s.
    #[arg(long, value_name = "S", default_value_t = 20, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(5..=600))]
    pub(crate) seconds: u32,
    /// From a target's arrival to the first setpoint that it changes, ms; the comparison has none.
    #[arg(long, value_name = "MS", default_value_t = 8, allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub(crate) latency_ms: u32,
}
