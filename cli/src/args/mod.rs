//! The command line. Every name has its unit; the help states every default.
mod axis;
mod calibrate;
mod cuts;
mod goal;
mod import;
mod live;
mod mbm;
mod offline;
mod papers;
mod pictures;
mod planners;
mod scene;
mod stream;
mod timing;
mod tip;
mod via;

pub(crate) use axis::{AxisAction, AxisArgs};
pub(crate) use calibrate::{CalibrateArgs, CalibrateWhat, GravityArgs};
pub(crate) use goal::{Goal, constraints_of, group_of, tip_of};
pub(crate) use import::ImportArgs;
pub(crate) use live::{
    CancelArgs, CommandArgs, DemoArgs, HomeArgs, RecoverArgs, ReferenceArgs, ReplanArgs, RunArgs, SpeedArgs,
    StopArgs, WatchArgs,
};
pub(crate) use offline::{
    BenchArgs, BenchName, CheckArgs, CompareArgs, CostArgs, CostBenchArgs, DoctorArgs, ManArgs, PlanArgs,
    PlotArgs, SampleArgs, StopsBenchArgs, VerifyArgs,
};

pub(crate) use cuts::CutsBenchArgs;
pub(crate) use mbm::MbmArgs;
pub(crate) use papers::PapersArgs;
pub(crate) use pictures::PicturesArgs;
pub(crate) use planners::PlannersArgs;
pub(crate) use scene::{AddArgs, MoveArgs, SceneAction, SceneArgs, Triple};
pub(crate) use stream::{Axis, FollowArgs, FollowBenchArgs, JogArgs};
pub(crate) use timing::TimingArgs;

use clap::{Arg, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
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

Units: angles are rad, times s, lengths m; an angle with a unit is taken by it (`90deg`). Robots, scenes, paths and settings are given by path
(with a slash or an ending), or by the name of a shipped file (`ur5`, `pillars`, `vcan6`).";

/// Exit codes for scripts; help, manual pages and `failure.rs` agree.
pub(crate) const EXIT_CODES: &str = "\
Exit codes: 0 done; 1 refused or failed, with the reason on stderr; 2 bad usage or bad file; 130 interrupted.
With --json, errors are JSON on stderr too: {\"error\":{\"kind\":\"..\",\"message\":\"..\"}}.";

/// Printed in the help, in every manual page and by `doctor`.
pub(crate) const SAFETY: &str = "\
taustream is not a safety function: its stops are best effort by software over a bus. A machine needs its own
hard-wired emergency stop and safe torque off.";

fn after_help() -> String {
    let order = taustream_arm::lookup::ORDER;
    format!("{EXAMPLES}\n\n{order}\n\n{EXIT_CODES}\n\n{SAFETY}")
}

/// Commands that talk to no arm: `--settings` means nothing to them, and their help leaves it out.
const WITHOUT_SETTINGS: [&[&str]; 20] = [
    &["plan"],
    &["import"],
    &["sample"],
    &["plot"],
    &["cost"],
    &["verify"],
    &["check"],
    &["demo"],
    &["completions"],
    &["man"],
    &["bench", "compare"],
    &["bench", "cost"],
    &["bench", "cuts"],
    &["bench", "follow"],
    &["bench", "mbm"],
    &["bench", "papers"],
    &["bench", "pictures"],
    &["bench", "planners"],
    &["bench", "stops"],
    &["bench", "timing"],
];

impl Cli {
    /// The definition with help that the terminal wraps, and without options that a command does not use.
    pub(crate) fn definition() -> Command {
        WITHOUT_SETTINGS.into_iter().fold(flowing(Self::command()), without_settings)
    }

    /// Reads the words of a command line.
    ///
    /// # Errors
    /// What clap does not take, and help and version.
    pub(crate) fn from_words(
        words: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    ) -> Result<Self, clap::Error> {
        let mut definition = Self::definition();
        let mut matches = definition.try_get_matches_from_mut(words)?;
        Self::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut definition))
    }
}

/// The command with one of those below it, named by its words, that does not show `--settings`.
fn without_settings(command: Command, words: &[&str]) -> Command {
    let Some((first, rest)) = words.split_first() else {
        // It stands in the place of the global one, which clap then leaves out here.
        let settings = Arg::new("settings").long("settings").value_name("FILE").hide(true);
        return command.arg(settings.value_parser(clap::value_parser!(PathBuf)));
    };
    command.mut_subcommand(first, |below| without_settings(below, rest))
}

/// The command and those below it with help texts whose paragraphs are one line each: clap wraps them to the terminal.
fn flowing(command: Command) -> Command {
    let help = command.get_after_help().map(|help| flow(&help.to_string()));
    let command = match help {
        Some(help) => command.after_help(help),
        None => command,
    };
    let names: Vec<String> = command.get_subcommands().map(|below| below.get_name().to_owned()).collect();
    names.into_iter().fold(command, |command, name| command.mut_subcommand(name, flowing))
}

/// Joins the lines of a paragraph; lines that are indented, and what leads to them, stay lines.
fn flow(text: &str) -> String {
    let mut flowed = String::with_capacity(text.len());
    let mut before = "";
    for line in text.lines() {
        let joins =
            !before.is_empty() && !line.is_empty() && ![before, line].iter().any(|l| l.starts_with(' '));
        flowed.push_str(match (flowed.is_empty(), joins) {
            (true, _) => "",
            (false, true) => " ",
            (false, false) => "\n",
        });
        flowed.push_str(line);
        before = line;
    }
    flowed
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
    Plan(Box<PlanArgs>),
    /// Convert a table of positions, or way points and a profile, into a verified trajectory file.
    Import(ImportArgs),
    /// Print a trajectory file as a table of positions, velocities, accelerations and jerks.
    Sample(SampleArgs),
    /// Draw a trajectory as SVG: joint curves with limits, arm, obstacles and path in three views.
    Plot(PlotArgs),
    /// Evaluate a trajectory by the cost function of Wang et al. (2022), in its own model.
    Cost(CostArgs),
    /// Prove that a trajectory keeps limits and clearance, or name the first violation.
    Verify(Box<VerifyArgs>),
    /// Check a configuration: robot, scene, settings or trajectory file; every fault at once.
    Check(CheckArgs),
    /// Request a motion to a new goal from the running planner, and print the receipt.
    Replan(Box<ReplanArgs>),
    /// Follow a stream of targets from standard input, 5 to 500 a second.
    Follow(FollowArgs),
    /// Move one joint, or the tip along an axis, while a key is held.
    Jog(JogArgs),
    /// List and change the running planner's scene: add, move, remove, attach to the tip, detach.
    Scene(SceneArgs),
    /// Bring the running motion to rest, and drop the motions that wait.
    Cancel(CancelArgs),
    /// Lead joints that are outside their position limits back inside.
    Recover(RecoverArgs),
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
    /// Show the axes beside the path, grippers and lifts, or lead one.
    Axis(AxisArgs),
    /// Show or set joint references.
    Reference(ReferenceArgs),
    /// Let the drive of a joint find its zero by itself. THE JOINT MOVES, unchecked for collisions.
    Home(HomeArgs),
    /// Find out by measured torques what the arm weighs. THE ARM MOVES.
    Calibrate(CalibrateArgs),
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

    #[test]
    fn command_line_definition_is_consistent() {
        Cli::command().debug_assert();
        Cli::definition().debug_assert();
    }

    /// The rendered help of a command.
    fn help_of(words: &[&str]) -> String {
        let words = ["taustream"].into_iter().chain(words.iter().copied()).chain(["--help"]);
        Cli::from_words(words).unwrap_err().to_string()
    }

    #[test]
    fn help_shows_settings_only_where_they_mean_something() {
        for words in WITHOUT_SETTINGS {
            assert!(!help_of(words).contains("--settings"), "{words:?}");
        }
        let benches = Cli::command().find_subcommand("bench").unwrap().get_subcommands().count();
        assert_eq!(benches, 1 + WITHOUT_SETTINGS.iter().filter(|words| words[0] == "bench").count());
        for name in ["status", "enable", "doctor", "replan", "cancel", "run", "watch", "reference"] {
            assert!(help_of(&[name]).contains("--settings"), "{name}");
        }
        assert!(help_of(&["bench", "cycle"]).contains("--settings"));
        let cycle = Cli::from_words(["taustream", "bench", "cycle", "--settings", "a"]).unwrap();
        assert_eq!(cycle.settings, Some(PathBuf::from("a")));
        assert!(Cli::from_words(["taustream", "bench", "timing", "--settings", "a"]).is_ok());
        // A habit of scripts that name the arm everywhere stays without effect.
        for words in
            [["taustream", "--settings", "a", "check", "b"], ["taustream", "check", "b", "--settings", "a"]]
        {
            assert!(Cli::from_words(words).is_ok());
        }
        let status = Cli::from_words(["taustream", "status", "--settings", "a"]).unwrap();
        assert_eq!(status.settings, Some(PathBuf::from("a")));
        let status = Cli::from_words(["taustream", "--settings", "a", "status"]).unwrap();
        assert_eq!(status.settings, Some(PathBuf::from("a")));
    }

    #[test]
    fn paragraphs_of_help_are_wrapped_by_the_terminal_and_examples_are_not() {
        assert_eq!(
            flow("Examples:\n  a\n  b\n\none\ntwo\n\nthree"),
            "Examples:\n  a\n  b\n\none two\n\nthree"
        );
        assert!(help_of(&[]).contains("not searched"), "the order of search is said");
    }

    #[test]
    fn trajectory_file_is_taken_with_and_without_its_word() {
        for command in ["sample", "plot", "run"] {
            for words in [&["f.json"][..], &["--trajectory", "f.json"]] {
                let words = ["taustream", command].into_iter().chain(words.iter().copied());
                let read = Cli::from_words(words).unwrap();
                let path = if let Action::Sample(args) = &read.action {
                    args.trajectory.path()
                } else if let Action::Plot(args) = &read.action {
                    args.trajectory.path()
                } else if let Action::Run(args) = &read.action {
                    args.trajectory.path()
                } else {
                    panic!("{command} is read as something else");
                };
                assert_eq!(path, std::path::Path::new("f.json"), "{command}");
            }
            assert!(Cli::from_words(["taustream", command]).is_err());
            assert!(Cli::from_words(["taustream", command, "f", "--trajectory", "g"]).is_err());
        }
        for command in ["verify", "cost"] {
            for words in [&["f.json"][..], &["--trajectory", "f.json", "--robot", "ur5"]] {
                let words =
                    ["taustream", command, "--scene", "open"].into_iter().chain(words.iter().copied());
                assert!(Cli::from_words(words).is_ok(), "{command}");
            }
        }
    }
}
