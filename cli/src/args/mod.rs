//! The command line. Every name has its unit; the help states every default.
mod import;
mod live;
mod offline;
mod papers;
mod planners;

pub(crate) use import::ImportArgs;
pub(crate) use live::{
    CommandArgs, DemoArgs, ReferenceArgs, ReplanArgs, RunArgs, SpeedArgs, StopArgs, WatchArgs,
};
pub(crate) use offline::{
    BenchArgs, BenchName, CheckArgs, CompareArgs, CostArgs, CostBenchArgs, DoctorArgs, ManArgs, MotionArgs,
    PlanArgs, PlotArgs, SampleArgs,
};

pub(crate) use papers::PapersArgs;
pub(crate) use planners::PlannersArgs;

use clap::{Parser, Subcommand};
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  taustream check vcan6                                   check the configuration
  taustream plan --robot ur5 --scene pillars \\
      --start \"0,-1.57,1.57,-1.57,-1.57,0\" --goal \"1.2,-1.3,1.4,-1.6,-1.57,0\" -o move.json
  taustream verify --robot ur5 --scene pillars --trajectory move.json
  taustream sample move.json --rate-hz 1000 > move.csv
  taustream plot move.json --robot ur5 --scene pillars    joint curves and three views, to move.svg
  taustream doctor                                        check whether this computer can drive an arm
  taustream enable && taustream run move.json --wait      with streamer and planner running
  taustream replan --goal \"0,-1.57,1.57,-1.57,-1.57,0\" --wait
  taustream watch                                         live view, until you end it
  taustream status --json | jq .phase

Units: angles are rad, times s, lengths m. Robots, scenes and settings are given by path, or by the name of a
shipped file (`ur5`, `pillars`, `vcan6`).";

/// Exit codes for scripts; help, manual pages and `failure.rs` agree.
pub(crate) const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 refused or failed, with the reason on stderr; 2 bad usage or bad file; 130 interrupted.
With --json, errors are JSON on stderr too: {\"error\":{\"kind\":\"..\",\"message\":\"..\"}}.";

/// Printed in the help, in every manual page and by `doctor`.
pub(crate) const SAFETY: &str = "\
taustream is not a safety function: its stops are best effort by software over a bus. A machine needs its own
hard-wired emergency stop and safe torque off.";

fn after_help() -> String {
    format!("{EXAMPLES}\n\n{EXIT_CODES}\n\n{SAFETY}")
}

/// Plan, run and watch the motion of CAN-connected robot arms.
#[derive(Debug, Parser)]
#[command(name = "taustream", version, after_help = after_help(), arg_required_else_help = true)]
#[command(max_term_width = 110)]
pub(crate) struct Cli {
    /// Print one JSON object on stdout, and errors as JSON on stderr.
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Settings of the arm to talk to: a path, or the name of shipped settings.
    ///
    /// Without it: `$TAUSTREAM_SETTINGS`, else /etc/taustream/settings.toml if that exists, else the only file in
    /// /etc/taustream/settings, else the shipped `vcan6`. `plan`, `sample`, `plot`, `cost`, `verify` and `check` do not
    /// use it.
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) settings: Option<PathBuf>,

    /// Command.
    #[command(subcommand)]
    pub(crate) action: Action,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Action {
    /// Plan a collision-free motion offline and write it to a file.
    Plan(PlanArgs),
    /// Convert a table of positions, or way points and a profile, into a verified trajectory file.
    Import(ImportArgs),
    /// Print a trajectory file as a table of positions, velocities, accelerations and jerks.
    Sample(SampleArgs),
    /// Draw a trajectory as SVG: joint curves with limits, arm, obstacles and path in three views.
    Plot(PlotArgs),
    /// Evaluate a trajectory by the cost function of Wang et al. (2022), in its own model.
    Cost(CostArgs),
    /// Prove that a trajectory keeps limits and clearance, or name the first violation.
    Verify(MotionArgs),
    /// Check a configuration: robot, scene, settings or trajectory file; every fault at once.
    Check(CheckArgs),
    /// Request a motion to a new goal from the running planner, and print the receipt.
    Replan(ReplanArgs),
    /// Execute a saved trajectory from its base pose, after verification.
    Run(RunArgs),
    /// Energise the drives and hold the pose.
    Enable(CommandArgs),
    /// De-energise the drives; only at rest.
    Disable(CommandArgs),
    /// Slow down to rest on the path and keep the motion.
    Pause(CommandArgs),
    /// Resume a paused motion.
    Resume(CommandArgs),
    /// Set the speed override, 0 to 100 percent.
    Speed(SpeedArgs),
    /// Slow down to rest on the path, drop the motion and hold.
    Stop(StopArgs),
    /// De-energise the drives at once. THE ARM MAY FALL.
    TorqueOff(CommandArgs),
    /// Clear a fault after its cause is fixed; then `enable`.
    ClearFault(CommandArgs),
    /// Show or set joint references.
    Reference(ReferenceArgs),
    /// Show the state of the arm: phase, joints, timing, buses.
    Status,
    /// Show the state of the arm, live; this does not affect the arm.
    Watch(WatchArgs),
    /// Check this computer: kernel, rights, CPUs, CAN interfaces, memory; measure its wake-up latency.
    Doctor(DoctorArgs),
    /// Run a measurement that the documentation quotes.
    Bench(BenchArgs),
    /// Start simulated servos, streamer and planner, and run a few moves.
    Demo(DemoArgs),
    /// Print a completion script for a shell: `taustream completions bash > /etc/bash_completion.d/taustream`.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write the manual pages of all programs into a directory, or print that of taustream.
    Man(ManArgs),
    /// Started by sudo as the services' user: execute the command from standard input.
    #[command(hide = true)]
    HandedOver,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn command_line_definition_is_consistent() {
        Cli::command().debug_assert();
    }
}
