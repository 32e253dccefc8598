//! The arguments of `taustream-planner`, in the library because the manual page is made from them.
use clap::Parser;
use std::path::PathBuf;

/// Plan motions for one arm: serve `taustream replan` and send verified motions to the streamer.
///
/// It never touches a bus. When it ends, or is killed, a motion that the streamer has accepted continues to its end.
#[derive(Debug, Parser)]
#[command(
    name = "taustream-planner",
    version,
    after_help = "Example: taustream-planner --settings config/settings/vcan6.toml\n\n\
    SIGTERM or SIGINT end it. Log lines go to the journal under systemd, else to stderr; RUST_LOG=debug shows more.\n\n\
    Exit status: 0 ended by SIGINT or SIGTERM, 1 not started or failed, 2 bad usage or bad file."
)]
pub struct Arguments {
    /// Settings of the arm's controller: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub settings: String,
    /// Scene instead of that in the settings: a file, or the name of a shipped one.
    #[arg(long, value_name = "FILE")]
    pub scene: Option<String>,
    /// Keep the scene in this file, and begin with what it holds: changes by `taustream scene` outlast this process then.
    #[arg(long, value_name = "FILE")]
    pub keep_scene: Option<PathBuf>,
}
