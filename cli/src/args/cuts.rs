//! Arguments of `taustream bench cuts`.
use clap::Args;
use std::path::PathBuf;

const CUTS_HELP: &str = "\
Examples:
  taustream bench cuts                                  the shipped arms, and limits like other arms'
  taustream bench cuts --robot my-arm.toml --json       one arm's own limits

Straight moves, and replacements of them, are cut at random moments and led to random goals, in free space. No arm is needed.";

/// `taustream bench cuts`
#[derive(Args, Debug)]
#[command(after_help = CUTS_HELP)]
pub(crate) struct CutsBenchArgs {
    /// Robots whose limits are used: paths, or names of shipped robots.
    #[arg(long, value_name = "FILE", num_args = 1.., default_values = ["ur5", "piper"])]
    pub(crate) robot: Vec<PathBuf>,
    /// Cuts for each set of limits.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) cuts: u32,
    /// Seed of every random choice.
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
}
