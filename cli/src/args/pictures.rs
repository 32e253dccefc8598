//! Arguments of `taustream bench pictures`.
use clap::Args;
use std::path::PathBuf;

const PICTURES_HELP: &str = "\
Examples:
  taustream bench pictures -o docs                       via.svg and replan.svg, as the README shows them
  taustream bench pictures --robot my-arm.toml           under an arm's own limits

via.svg: one move through three points, by one stroke from point to point as in Wang et al. (2022), by Ruckig from
point to point,
and as `plan --via` times it. replan.svg: a move that is replaced halfway by one to another goal. No arm is needed.";

/// `taustream bench pictures`
#[derive(Args, Debug)]
#[command(after_help = PICTURES_HELP)]
pub(crate) struct PicturesArgs {
    /// Robot whose limits are used: a path, or the name of a shipped robot. It needs six joints.
    #[arg(long, value_name = "FILE", default_value = "ur5")]
    pub(crate) robot: PathBuf,
    /// Directory that the pictures are written into.
    #[arg(short, long, value_name = "DIR", default_value = ".")]
    pub(crate) output: PathBuf,
}
