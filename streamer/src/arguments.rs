//! The arguments of `taustream-streamer`, in the library because the manual page is made from them.
use clap::Parser;
use std::path::PathBuf;
use taustream_drivers::link::LinkChoice;

/// Stream one arm: take trajectories from shared memory and send a setpoint to every joint 1000 times a second.
///
/// This is not a safety function. A machine needs its own hard-wired emergency stop and safe torque off.
#[derive(Debug, Parser)]
#[command(
    name = "taustream-streamer",
    version,
    after_help = "Example: taustream-streamer --settings config/settings/vcan6.toml\n\n\
    SIGTERM or SIGINT: stop on the path, hold, de-energise, end. A second one: torque off and end.\n\
    Log lines go to the journal under systemd, else to stderr; RUST_LOG=debug shows more.\n\n\
    Exit status: 0 ended with all drives de-energised, 1 not started, failed, or ended before the drives were seen \
    to be de-energised, 2 bad usage or bad file."
)]
pub struct Arguments {
    /// Settings of the arm's controller: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub settings: String,
    /// CAN link.
    #[arg(long, value_enum, default_value_t)]
    pub link: LinkChoice,
    /// Start without real-time rights, for trials: setpoints will be late.
    #[arg(long)]
    pub allow_non_realtime: bool,
    /// Write every cycle to this file, one JSON object per line.
    #[arg(long, value_name = "FILE")]
    pub cycle_log: Option<PathBuf>,
    /// Directory of the last pose; default: `$STATE_DIRECTORY`, `$XDG_STATE_HOME/taustream`, `~/.local/state/taustream`.
    ///
    /// Only this user may write to it. Use one directory for one arm: a joint is not referenced by an older record elsewhere.
    #[arg(long, value_name = "DIR")]
    pub state_dir: Option<PathBuf>,
}
