//! `cargo xtask demo`: build everything, then hand over to `taustream demo`, here or in the vcan machine.
use crate::packages::{self, MACHINE};
use crate::workspace;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::ffi::OsString;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// What the machine takes to boot and to end, beyond the demo itself.
const MACHINE_S: u32 = 60;

const HELP: &str = "\
Examples:
  cargo xtask demo             on vcan0 where the kernel has it, else on the local link
  cargo xtask demo --vm        on a real vcan0 inside the test machine (user-mode Linux)

Ctrl-C stops the arm first. Plots and logs are in target/demo.";

/// The words of `cargo xtask demo`.
#[derive(Args, Debug)]
#[command(after_help = HELP)]
pub(crate) struct Arguments {
    /// Run on a real vcan0 inside the test machine; installs its Debian packages if they are missing.
    #[arg(long)]
    vm: bool,
    /// Directory for plots and logs.
    #[arg(long, value_name = "DIR", default_value = "target/demo")]
    output: PathBuf,
    /// Give up after this long, s, the build not counted.
    #[arg(long, value_name = "S", default_value_t = 110, value_parser = clap::value_parser!(u32).range(10..=3600))]
    seconds: u32,
}

/// Builds and hands over; returns only when something went wrong before.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode> {
    let root = workspace::root()?;
    if arguments.vm {
        packages::ensure(&MACHINE)?;
    }
    let machine = arguments.vm.then_some("taustream-tests");
    let programs = workspace::build_release(&root, machine)?;
    let output = root.join(&arguments.output);
    fs::create_dir_all(&output).with_context(|| format!("{} cannot be made", output.display()))?;

    let mut words: Vec<OsString> = Vec::new();
    if arguments.vm {
        words.push(programs.join("vcan-machine").into());
        words.extend(["--limit-s".into(), (arguments.seconds + MACHINE_S).to_string().into()]);
        words.extend(["--writable".into(), output.clone().into(), "--".into()]);
    }
    words.push(programs.join("taustream").into());
    words.extend(["demo".into(), "--config".into(), root.join("config/demo.toml").into()]);
    words.extend([
        "--output".into(),
        output.into(),
        "--limit-s".into(),
        arguments.seconds.to_string().into(),
    ]);
    hand_over(&root, &words)
}

/// Replaces this process, so that Ctrl-C and the exit code are the demo's own.
fn hand_over(root: &Path, words: &[OsString]) -> Result<ExitCode> {
    let Some((program, rest)) = words.split_first() else { bail!("no program to run") };
    let error = Command::new(program).args(rest).current_dir(root).exec();
    Err(error).with_context(|| format!("{} cannot be started", program.display()))
}
