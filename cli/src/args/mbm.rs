//! Arguments of `taustream bench mbm`.
use clap::Args;
use std::path::PathBuf;

const MBM_HELP: &str = "\
Examples:
  taustream bench mbm --problems ur5-sample.json --robot ur5_spherized.urdf
  taustream bench mbm --problems panda.json --robot my-panda.toml --json

Problems are a JSON file of problem sets, start and goal in rad, obstacles in m (docs/planner.md states the format). The robot is
a robot file, or a URDF file; its SRDF file is looked for beside it. Limits of acceleration and jerk, which a URDF
file does not have, are then the shipped UR5's. Plans keep a margin of 2 mm.

Each problem is planned as by `taustream plan` without options, and with deadlines of 10 and 50 ms that the clock keeps. `first` is
processor time until the first verified motion, `plan` until the last, `request` elapsed time of the same call. `length` is that of the
path in joint space.";

/// `taustream bench mbm`
#[derive(Args, Debug)]
#[command(after_help = MBM_HELP)]
pub(crate) struct MbmArgs {
    /// File of problems.
    #[arg(long, value_name = "FILE")]
    pub(crate) problems: PathBuf,
    /// Robot: a URDF file, a robot file, or the name of a shipped robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: PathBuf,
    /// SRDF file of a URDF file; without it, that beside the URDF file, if there is one.
    #[arg(long, value_name = "FILE")]
    pub(crate) srdf: Option<PathBuf>,
    /// Tip link of a URDF file; without it, the link behind the last joint.
    #[arg(long, value_name = "LINK")]
    pub(crate) tip_link: Option<String>,
    /// Deadline of the plans without a deadline that the clock keeps, ms; without it, the default of `taustream plan`.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = clap::value_parser!(u32).range(1..=60_000))]
    pub(crate) deadline_ms: Option<u32>,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
}
