//! Arguments of `taustream bench timing`.
use clap::Args;
use std::path::PathBuf;

const TIMING_HELP: &str = "\
Examples:
  taustream bench timing                                  the shipped arms, and limits like other arms'
  taustream bench timing --robot my-arm.toml --json       one arm's own limits
  taustream bench timing --paths 60 -o paths.json         the paths too, for planner/benches/path_optimum.py

Straight moves are compared with the jerk-limited optimum along the same line (Ruckig's, in closed form). Paths of five
random points are compared with the sum of those optima, which stops at every point. The optimum along the same rounded
path needs an independent solver: planner/benches/path_optimum.py reads what -o writes. No arm is needed.";

/// `taustream bench timing`
#[derive(Args, Debug)]
#[command(after_help = TIMING_HELP)]
pub(crate) struct TimingArgs {
    /// Robots whose limits are used: paths, or names of shipped robots.
    #[arg(long, value_name = "FILE", num_args = 1.., default_values = ["ur5", "piper"])]
    pub(crate) robot: Vec<PathBuf>,
    /// Straight moves for each length.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) moves: u32,
    /// Random paths of five points for each robot, 0.3 to 12 rad long.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) paths: u32,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// File to write the rounded paths into, sampled, for an independent solver.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
