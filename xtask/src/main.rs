//! The project's chores: `cargo xtask demo`, `install`, `uninstall`, `man`, `planted` and `test`.
//!
//! Each task installs what it needs on a fresh Debian machine, says so first, and ends with a result.
mod demo;
mod install;
mod manual;
mod packages;
mod place;
mod planted;
mod test;
mod workspace;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Tasks of the taustream workspace.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", arg_required_else_help = true)]
struct Arguments {
    /// Task.
    #[command(subcommand)]
    task: Task,
}

/// The tasks.
#[derive(Debug, Subcommand)]
enum Task {
    /// Build, then run the demo: a simulated arm moves round obstacles.
    Demo(demo::Arguments),
    /// Write manual pages and shell completions.
    Man(manual::Arguments),
    /// Plant faults in a copy of the last commit; the tests that guard against them must fail.
    Planted(planted::Arguments),
    /// Check everything or a part: format, lints, tests, documentation, and the scenarios on a real vcan0.
    Test(test::Arguments),
    /// Install programs, units, rules and shipped configuration below a root directory, as a package would.
    Install(install::Arguments),
    /// Remove what `install` has installed; settings of this machine in /etc/taustream stay.
    Uninstall(install::RootArguments),
}

fn main() -> ExitCode {
    let (verdict, outcome) = match Arguments::parse().task {
        Task::Demo(arguments) => ("DEMO FAILED", demo::run(&arguments)),
        Task::Man(arguments) => ("MAN FAILED", manual::run(&arguments)),
        Task::Planted(arguments) => ("PLANTED FAILED", planted::run(&arguments)),
        Task::Test(arguments) => ("TEST FAILED", test::run(&arguments)),
        Task::Install(arguments) => ("NOT INSTALLED", install::run(&arguments)),
        Task::Uninstall(arguments) => ("NOT UNINSTALLED", install::undo(&arguments)),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            eprintln!("{verdict}: {error:#}");
            ExitCode::FAILURE
        }
    }
}
