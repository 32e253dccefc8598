//! `cargo xtask test`: everything that must hold before a change lands, in one command.
use crate::packages;
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// What the test machine needs from Debian.
const PACKAGES: &[&str] = &["user-mode-linux", "iproute2", "can-utils", "kmod"];
/// How long the scenarios may take inside the machine before they count as hung, s.
const MACHINE_LIMIT_S: &str = "900";
/// Priority of the machine on the host: its one processor runs everything, so it must not wait for builds.
const MACHINE_PRIORITY: &str = "40";

/// One step with the words that announce it.
struct Step {
    what: &'static str,
    program: &'static str,
    args: &'static [&'static str],
    env: &'static [(&'static str, &'static str)],
}

const STEPS: &[Step] = &[
    Step { what: "formatting", program: "cargo", args: &["fmt", "--all", "--check"], env: &[] },
    Step {
        what: "lints",
        program: "cargo",
        args: &["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"],
        env: &[],
    },
    Step {
        what: "unit, property and command line tests",
        program: "cargo",
        args: &["test", "--workspace", "--locked"],
        env: &[],
    },
    Step {
        what: "documentation",
        program: "cargo",
        args: &["doc", "--workspace", "--no-deps", "--locked"],
        env: &[("RUSTDOCFLAGS", "-D warnings")],
    },
    Step {
        what: "programs for the test machine",
        program: "cargo",
        args: &["build", "--workspace", "--bins", "--locked"],
        env: &[],
    },
    Step {
        what: "link tests for the test machine",
        program: "cargo",
        args: &["test", "--package", "taustream-tests", "--test", "on_vcan", "--no-run", "--locked"],
        env: &[],
    },
];

/// Runs everything; the first failure ends the run.
pub(crate) fn run() -> Result<()> {
    let since = Instant::now();
    packages::install_missing(PACKAGES, "the test machine")?;
    for step in STEPS {
        perform(step)?;
    }
    links_on_vcan()?;
    scenarios()?;
    println!("\ncargo xtask test: everything passed in {:.0} s", since.elapsed().as_secs_f64());
    Ok(())
}

fn perform(step: &Step) -> Result<()> {
    announce(step.what);
    let mut command = Command::new(step.program);
    command.args(step.args).envs(step.env.iter().copied());
    finish(command, step.what)
}

fn announce(what: &str) {
    println!("\n=== {what}");
}

fn finish(mut command: Command, what: &str) -> Result<()> {
    let since = Instant::now();
    let status = command.status().with_context(|| format!("{what}: cannot start {command:?}"))?;
    if !status.success() {
        bail!("{what}: failed ({status})");
    }
    println!("=== {what}: passed in {:.0} s", since.elapsed().as_secs_f64());
    Ok(())
}

/// A command in the test machine, with `output` writable through to the host.
fn machine(output: &Path) -> Result<Command> {
    std::fs::create_dir_all(output).with_context(|| format!("cannot make {}", output.display()))?;
    let programs = packages::target_dir()?.join("debug");
    let mut command = Command::new(programs.join("vcan-machine"));
    command.args(["--limit-s", MACHINE_LIMIT_S, "--realtime", MACHINE_PRIORITY, "--writable"]);
    command.arg(output).arg("--");
    Ok(command)
}

fn links_on_vcan() -> Result<()> {
    let what = "links on a real vcan0";
    announce(what);
    let test = packages::test_program("on_vcan")?;
    let mut command = machine(&packages::target_dir()?.join("on-vcan"))?;
    command.arg(test).args(["--test-threads", "1"]);
    finish(command, what)
}

fn scenarios() -> Result<()> {
    let what = "scenarios on a real vcan0";
    announce(what);
    let output = packages::target_dir()?.join("scenarios");
    let mut command = machine(&output)?;
    command.arg(packages::target_dir()?.join("debug/scenarios")).arg("--output").arg(&output);
    finish(command, what)
}
