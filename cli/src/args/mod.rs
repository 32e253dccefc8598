//! The words of the command line. Units stand in every name; every default stands in the help.
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
  taustream check vcan6                                   is the configuration sound?
  taustream plan --robot ur5 --scene pillars \\
      --start \"0,-1.57,1.57,-1.57,-1.57,0\" --goal \"1.2,-1.3,1.4,-1.6,-1.57,0\" -o move.json
  taustream verify --robot ur5 --scene pillars --trajectory move.json
  taustream sample move.json --rate-hz 1000 > move.csv
  taustream plot move.json --robot ur5 --scene pillars    joint curves and three views, to move.svg
  taustream doctor                                        is this computer fit to drive an arm?
  taustream enable && taustream run move.json --wait      with streamer and planner running
  taustream replan --goal \"0,-1.57,1.57,-1.57,-1.57,0\" --wait
  taustream watch                                         live, until you leave it
  taustream status --json | jq .phase

Units: angles are rad, times s, lengths m. Robots, scenes and settings are given by path, or by the name of a
shipped file (`ur5`, `pillars`, `vcan6`).";

/// What a program's end tells scripts; help, manual pages and `failure.rs` agree.
pub(crate) const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 refused or failed, with the reason on stderr; 2 bad usage or bad file; 130 interrupted.
With --json, errors are JSON on stderr too: {\"error\":{\"kind\":\"..\",\"message\":\"..\"}}.";

/// Stands in the help, in every manual page and in what `doctor` says.
pub(crate) const SAFETY: &str = "\
taustream is not a safety function: its stops are best effort by software over a bus. A machine needs its own
hard-wired emergency stop and safe torque off.";

fn after_help() -> String {
    format!("{EXAMPLES}\n\n{EXIT_CODES}\n\n{SAFETY}")
}

/// Plans, runs and watches the motion of CAN-connected robot arms.
#[derive(Debug, Parser)]
#[command(name = "taustream", version, after_help = after_help(), arg_required_else_help = true)]
#[command(max_term_width = 110)]
pub(crate) struct Cli {
    /// Answer with one JSON object on stdout, and with errors as JSON on stderr.
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Settings of the arm to talk to: a path, or the name of shipped settings.
    ///
    /// Without it: `$TAUSTREAM_SETTINGS`, else /etc/taustream/settings.toml if that exists, else the only file in
    /// /etc/taustream/settings, else the shipped `vcan6`. `plan`, `sample`, `plot`, `cost`, `verify` and `check` do not
    /// use it.
    #[arg(long, global = true, value_name = "FILE")]
    pub(crate) settings: Option<PathBuf>,

    /// What to do.
    #[command(subcommand)]
    pub(crate) action: Action,
}

/// What the user wants.
#[derive(Debug, Subcommand)]
pub(crate) enum Action {
    /// Plan a collision-free motion offline and write it down.
    Plan(PlanArgs),
    /// Make a verified trajectory file of a motion from elsewhere: a table of positions, or way points and a profile.
    Import(ImportArgs),
    /// Print a trajectory file as a table of positions, velocities, accelerations and jerks.
    Sample(SampleArgs),
    /// Draw a trajectory as SVG: joint curves with limits, arm, obstacles and path in three views.
    Plot(PlotArgs),
    /// Rate a trajectory by the cost of the IBFOA paper, in its own model.
    Cost(CostArgs),
    /// Prove that a trajectory keeps limits and clearance, or name the first violation.
    Verify(MotionArgs),
    /// Check a configuration: robot, scene, settings or trajectory file; every fault at once.
    Check(CheckArgs),
    /// Ask the running planner for a motion to a new goal; prints the streamer's receipt.
    Replan(ReplanArgs),
    /// Execute a saved trajectory from its base pose, after verification.
    Run(RunArgs),
    /// Energise the drives and hold the pose.
    Enable(CommandArgs),
    /// De-energise the drives; only at rest.
    Disable(CommandArgs),
    /// Slow down to rest on the path and keep the motion.
    Pause(CommandArgs),
    /// Go on with a paused motion.
    Resume(CommandArgs),
    /// Set the speed override, 0 to 100 percent.
    Speed(SpeedArgs),
    /// Slow down to rest on the path, drop the motion and hold.
    Stop(StopArgs),
    /// De-energise the drives at once. THE ARM MAY FALL.
    TorqueOff(CommandArgs),
    /// Forget a fault whose cause is gone; `enable` makes the arm ready again.
    ClearFault(CommandArgs),
    /// Show which joints' turns are known, or say where a joint stands.
    Reference(ReferenceArgs),
    /// Show what the streamer does: phase, joints, timing, bus.
    Status,
    /// Show what the streamer does, live, until you leave it; the arm does not notice.
    Watch(WatchArgs),
    /// Examine this computer: kernel, rights, CPUs, CAN interfaces, memory; measures how late it wakes the cycle up.
    Doctor(DoctorArgs),
    /// Run a measurement that the documentation quotes.
    Bench(BenchArgs),
    /// Start simulated servos, streamer and planner, and go through a few moves.
    Demo(DemoArgs),
    /// Print a completion script for a shell: `taustream completions bash > /etc/bash_completion.d/taustream`.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write the manual pages of all programs into a directory, or print that of taustream.
    Man(ManArgs),
    /// What sudo starts as the services' user: carries out the command that stands on its standard input.
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
