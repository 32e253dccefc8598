//! Arguments of `taustream axis`.
use clap::{Args, Subcommand};

const AXIS_HELP: &str = "\
Examples:
  taustream axis                                   every axis: where it is, what it does
  taustream axis gripper open                      to its open position, and wait until it is there
  taustream axis gripper close --force 12          until it is closed, or presses with 12 N (Nm for an axis in rad)
  taustream axis lift to 0.35 --wait-s 0           to 0.35 m; return when the streamer has accepted it
  taustream axis gripper stop                      to rest, and hold there

An axis is a gripper or a lift: it has a servo of its own and is no joint of the path. It is energised with the arm and may be led
while the arm holds, moves or is paused. What stands in its way is contact: it then holds with its command close to where it is
measured. A new position while it moves: it comes to rest first. `stop` and `pause` stop axes, too; `resume` does not lead them on.
Exit code 0 means: at its position, or in contact on its way there.";

/// `taustream axis`
#[derive(Args, Debug)]
#[command(after_help = AXIS_HELP)]
pub(crate) struct AxisArgs {
    /// The axis, by its name in the settings; without it, all are shown.
    #[arg(value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// What it is to do.
    #[command(subcommand)]
    pub(crate) action: Option<AxisAction>,
}

/// What an axis is to do.
#[derive(Debug, Subcommand)]
pub(crate) enum AxisAction {
    /// Go to the open position.
    Open(AxisMoveArgs),
    /// Go to the closed position.
    Close(AxisMoveArgs),
    /// Go to a position in the axis's own unit, rad or m.
    To {
        /// Position in rad or m, as the settings have it.
        #[arg(value_name = "X", allow_hyphen_values = true, value_parser = finite)]
        position: f64,
        /// How.
        #[command(flatten)]
        how: AxisMoveArgs,
    },
    /// Come to rest and hold there.
    Stop,
}

/// How an axis moves.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct AxisMoveArgs {
    /// Force at which it counts as in contact: N, or Nm for an axis in rad; without it, the settings' own.
    #[arg(long, value_name = "N", allow_hyphen_values = true, value_parser = finite)]
    pub(crate) force: Option<f64>,
    /// Wait up to this long until it is there or in contact, s; 0 returns when the streamer has accepted.
    #[arg(long, value_name = "S", allow_negative_numbers = true, default_value_t = 30.0, value_parser = super::live::waiting_s)]
    pub(crate) wait_s: f64,
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| "expected a finite number".to_owned())
}
