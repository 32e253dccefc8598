//! Arguments of `taustream calibrate`.
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// `taustream calibrate`
#[derive(Args, Debug)]
pub(crate) struct CalibrateArgs {
    /// What to calibrate.
    #[command(subcommand)]
    pub(crate) what: CalibrateWhat,
}

/// What can be calibrated.
#[derive(Debug, Subcommand)]
pub(crate) enum CalibrateWhat {
    /// Fit the masses of the links, or of the payload, to measured torques. THE ARM MOVES.
    Gravity(GravityArgs),
}

const GRAVITY_HELP: &str = "\
Examples:
  taustream calibrate gravity --payload              what the tip carries: its mass, and where
  taustream calibrate gravity -o held.json           the masses of the links; keep what was measured, too
  taustream calibrate gravity --from held.json       fit again what was measured before; nothing moves

The arm must hold (`taustream enable`). It is led by verified motions to poses that are spread over its range, and to each of
them from two sides, so that dry friction cancels out; there it rests for a second while the torques are read, and at the end
it goes back. `taustream speed 25` before makes it slow. A pose to which the planner finds no motion is left out. Ctrl-C ends
the calibration; the arm ends its motion and holds.

It writes no file of the arm. It prints how far the torques and the model were apart, how far they are with the fitted masses,
also on poses that the fit was not made of, and what to write into the robot file. What torques at rest do not tell stays as the
file has it, and is marked. Drives must report torques: Damiao, RobStride, MyActuator and CubeMars motors do.";

/// `taustream calibrate gravity`
#[derive(Args, Debug)]
#[command(after_help = GRAVITY_HELP)]
pub(crate) struct GravityArgs {
    /// Fit only what the tip carries, and take the links as the robot file has them.
    #[arg(long)]
    pub(crate) payload: bool,
    /// How many poses, 4 to 100.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u8).range(4..=100))]
    pub(crate) poses: u8,
    /// Seed of the choice of poses.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Write the whole answer, with what was measured, into this file (JSON); - writes it to standard output.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Fit what was measured before, from the answer of another calibration (-o or --json); the arm is not asked.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["poses", "seed"])]
    pub(crate) from: Option<PathBuf>,
}

impl CalibrateArgs {
    /// True when files of the caller's are read or written.
    pub(crate) fn touches_a_file(&self) -> bool {
        let CalibrateWhat::Gravity(gravity) = &self.what;
        gravity.output.is_some() || gravity.from.is_some()
    }
}
