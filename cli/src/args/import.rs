//! Arguments of `taustream import`.
use super::via::BlendArgs;
use crate::angles::{Angles, Times};
use clap::{ArgGroup, Args};
use std::path::PathBuf;
use taustream_planner::import::{TOLERANCE_RAD_DEFAULT, ViaProfile};

const IMPORT_HELP: &str = "\
Examples:
  taustream import recorded.csv --robot ur5 --scene pillars -o move.json
  taustream sample other.json | taustream import - --robot ur5 --scene open --tolerance-rad 0.002
  taustream import --via \"0,-1.57,1.57,-1.57,-1.57,0\" --via \"0.5,-1.4,1.5,-1.6,-1.5,0.2\" \\
      --profile quintic --durations 1.5 --robot ur5 --scene open -o move.json
  taustream import --via .. --via .. --profile tau-j-star --k 1/8 ...     written as strokes without approximation
  taustream import --via .. --via .. --via .. --blend-rad 0.1 ...         straight lines, corners rounded as by `plan --via`
  taustream import --path eight_points --timed-by isma --seed 1 --robot ur5 --scene open -o move.json

The first line of a table names its columns: t_s, then q1_rad, q2_rad, .. as `sample` writes them; other columns are
ignored and named. Between rows the motion is linear. Profiles tau-j, tau-j-star, quintic and septic stop at every point;
cubic-spline, not-a-knot and b-spline7 pass them.

The motion is smoothed into strokes. The result goes from rest to rest with continuous jerk and a small delay; the summary
states the largest deviation from the original. A motion that is too fast for the limits is slowed down by one factor,
which the summary states. The result is verified (limits, clearance along its whole length) before it is written.";

/// `taustream import`
#[derive(Args, Debug)]
#[command(after_help = IMPORT_HELP)]
#[command(group = ArgGroup::new("what").required(true).args(["table", "via", "path"]))]
pub(crate) struct ImportArgs {
    /// Table of a sampled motion (CSV); `-` is standard input.
    #[arg(value_name = "CSV")]
    pub(crate) table: Option<PathBuf>,
    /// Way point, rad, one value per joint; repeat the option for each point, in order.
    #[arg(long, value_name = "RAD,..", allow_hyphen_values = true)]
    pub(crate) via: Vec<Angles>,
    /// Path file of poses or tip positions (TOML): a path, or the name of a shipped path.
    #[arg(long, value_name = "FILE")]
    pub(crate) path: Option<PathBuf>,
    /// Robot: a path, or the name of a shipped robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) robot: PathBuf,
    /// Scene: a path, or the name of a shipped scene.
    #[arg(long, value_name = "FILE")]
    pub(crate) scene: PathBuf,
    /// How far from the points.
    #[command(flatten)]
    pub(crate) blend: BlendArgs,
    /// Profile through the points; without it that of the path file, or trains of strokes as `plan --via` makes them.
    #[arg(long, value_name = "NAME", conflicts_with = "table", value_parser = clap::builder::PossibleValuesParser::new(ViaProfile::NAMES))]
    pub(crate) profile: Option<String>,
    /// k of tau-j and tau-j-star, below 1/3: a number, or a fraction such as 1/8. Without it 1/10.
    #[arg(long, value_name = "K", conflicts_with = "table", allow_hyphen_values = true, value_parser = fraction)]
    pub(crate) k: Option<f64>,
    /// Duration of each segment between way points, s. Without it: as short as the limits allow.
    #[arg(long, value_name = "S,..", conflicts_with = "table", allow_hyphen_values = true)]
    pub(crate) durations: Option<Times>,
    /// Optimiser that chooses the durations of b-spline7 by time and impact (`isma`, `sma`, `gwo`, ..).
    #[arg(long, value_name = "NAME", conflicts_with_all = ["table", "durations"])]
    pub(crate) timed_by: Option<String>,
    /// Seed of the optimiser.
    #[arg(long, value_name = "N", requires = "timed_by", allow_negative_numbers = true, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Evaluations of the optimiser.
    #[arg(long, value_name = "N", requires = "timed_by", allow_negative_numbers = true, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) evaluations: u32,
    /// Largest deviation of each joint from the original, rad.
    #[arg(long, value_name = "RAD", allow_negative_numbers = true, default_value_t = TOLERANCE_RAD_DEFAULT, value_parser = tolerance)]
    pub(crate) tolerance_rad: f64,
    /// Trajectory file to write; `-` is stdout. Without it only the summary is printed.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// A number, or one over another.
fn fraction(text: &str) -> Result<f64, String> {
    let number = |word: &str| word.trim().parse::<f64>().ok();
    let value = match text.split_once('/') {
        Some((above, below)) => number(above).zip(number(below)).map(|(above, below)| above / below),
        None => number(text),
    };
    value
        .filter(|k| k.is_finite())
        .ok_or_else(|| "expected a number such as 0.1, or a fraction such as 1/8".to_owned())
}

fn tolerance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rad) if (1e-9..=1.0).contains(&rad) => Ok(rad),
        _ => Err("expected radians from 1e-9 to 1".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn k_is_a_number_or_a_fraction() {
        assert_eq!((fraction("0.1"), fraction("1/8")), (Ok(0.1), Ok(0.125)));
        for text in ["", "1/0", "x", "1/", "nan", "1/2/3"] {
            assert!(fraction(text).is_err(), "{text}");
        }
        assert!(tolerance("0").is_err() && tolerance("nan").is_err() && tolerance("0.01").is_ok());
    }
}
