//! `cargo xtask test`: everything that must hold before a change lands, in one command.
use crate::packages::{self, MACHINE, MANUAL, PEERS, SERVICES};
use crate::{install, workspace};
use anyhow::{Context, Result, bail};
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

/// How long one run in the machine may take before it counts as hung, s.
const MACHINE_LIMIT_S: &str = "900";
/// Priority of the machine on the host: its one processor runs everything, so it must not wait for others.
const MACHINE_PRIORITY: &str = "40";

/// What cargo does, with the words that announce it, in this order.
const STEPS: [(&str, &[&str]); 6] = [
    ("format", &["fmt", "--all", "--check"]),
    ("lints", &["clippy", "--locked", "--workspace", "--all-targets", "--", "-D", "warnings"]),
    ("unit, property and command line tests", &["test", "--locked", "--workspace"]),
    ("documentation", &["doc", "--locked", "--workspace", "--no-deps"]),
    ("programs", &["build", "--locked", "--workspace", "--bins"]),
    ("the test machine itself", &["test", "--locked", "--package", "taustream-tests", "--test", "machine"]),
];

/// Runs everything; the first failure ends the run. Nothing is skipped.
pub(crate) fn run() -> Result<ExitCode> {
    let since = Instant::now();
    let root = workspace::root()?;
    packages::ensure(&MACHINE)?;
    packages::ensure(&PEERS)?;
    packages::ensure(&MANUAL)?;
    packages::ensure(&SERVICES)?;
    for (what, words) in STEPS {
        perform(what, cargo(&root).args(words))?;
    }
    let programs = workspace::target(&root).join("debug");
    let problems = published_problems(&root);
    independent_kinematics(&root, &programs, &problems)?;
    links_on_vcan(&root, &programs)?;
    let python = python_with_peers(&root)?;
    independent_master_on_vcan(&root, &programs, &python)?;
    independent_devices_on_vcan(&root, &programs, &python)?;
    independent_damiao_master_on_vcan(&root, &programs, &python)?;
    scenarios_on_vcan(&root, &programs)?;
    damiao_scenarios_on_vcan(&root, &programs)?;
    services_under_systemd(&root, &programs)?;
    figures_on_vcan(&root, &programs)?;
    let skipped = if problems.join("ur5_spherized.urdf").is_file() {
        "nothing was skipped".to_owned()
    } else {
        let place = problems.display();
        format!(
            "SKIPPED ur5_spherized of the published problems (not part of this project; looked in {place}, TAUSTREAM_MBM_DIR names another folder)"
        )
    };
    println!("\nTEST OK: everything passed, {skipped}, {:.0} s", since.elapsed().as_secs_f64());
    Ok(ExitCode::SUCCESS)
}

/// Where the published planning problems are, if they are at hand: their files stay outside of this project.
fn published_problems(root: &Path) -> PathBuf {
    env::var_os("TAUSTREAM_MBM_DIR").map_or_else(|| root.join("../shared/mbm"), PathBuf::from)
}

fn cargo(root: &Path) -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root).env("RUSTDOCFLAGS", "-D warnings");
    command
}

fn perform(what: &str, command: &mut Command) -> Result<()> {
    println!("\n=== {what}");
    let since = Instant::now();
    let status = command.status().with_context(|| format!("{what}: cannot start {command:?}"))?;
    if !status.success() {
        bail!("{what}: {status}");
    }
    println!("=== {what}: passed in {:.0} s", since.elapsed().as_secs_f64());
    Ok(())
}

/// The words that run a program in the machine.
fn machine(programs: &Path, output: &Path) -> Result<Vec<PathBuf>> {
    std::fs::create_dir_all(output).with_context(|| format!("{} cannot be made", output.display()))?;
    let mut words = vec![programs.join("vcan-machine")];
    let options = ["--limit-s", MACHINE_LIMIT_S, "--realtime", MACHINE_PRIORITY, "--writable"];
    words.extend(options.map(PathBuf::from));
    words.extend([output.to_owned(), "--".into()]);
    Ok(words)
}

/// The links' tests, which cargo starts through the machine as their runner.
fn links_on_vcan(root: &Path, programs: &Path) -> Result<()> {
    let words = machine(programs, &workspace::target(root).join("on-vcan"))?;
    let words: Vec<String> = words.iter().map(|word| format!("{:?}", word.display().to_string())).collect();
    let runner = format!("target.'cfg(all())'.runner = [{}]", words.join(", "));
    let mut command = cargo(root);
    command.args([
        "test",
        "--locked",
        "--package",
        "taustream-tests",
        "--test",
        "on_vcan",
        "--config",
        &runner,
    ]);
    command.args(["--", "--test-threads", "1"]);
    perform("links on a real vcan0", &mut command)
}

/// A Python that has the independent peers, in pinned versions.
fn python_with_peers(root: &Path) -> Result<PathBuf> {
    let venv = workspace::target(root).join("venv");
    perform("a place for independent peers", Command::new("python3").args(["-m", "venv"]).arg(&venv))?;
    let python = venv.join("bin/python");
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"]);
    let list = root.join("tests/peers/requirements.txt");
    perform("independent peers from PyPI", install.arg(list))?;
    Ok(python)
}

/// Somebody else's CANopen devices are brought up and moved by our own programs.
fn independent_devices_on_vcan(root: &Path, programs: &Path, python: &Path) -> Result<()> {
    let (target, peers) = (workspace::target(root), root.join("tests/peers"));
    let words = machine(programs, &target.join("peers"))?;
    let (program, rest) = words.split_first().context("no program to run")?;
    let mut command = Command::new(program);
    command.args(rest).arg(python).arg(peers.join("durand_drives.py")).arg(programs);
    command.arg(peers.join("durand.toml")).current_dir(root);
    perform("independent CANopen devices on a real vcan0", &mut command)
}

/// Somebody else's CANopen master drives the simulated drives.
fn independent_master_on_vcan(root: &Path, programs: &Path, python: &Path) -> Result<()> {
    let (target, peers) = (workspace::target(root), root.join("tests/peers"));
    let words = machine(programs, &target.join("peers"))?;
    let (program, rest) = words.split_first().context("no program to run")?;
    let mut command = Command::new(program);
    command
        .args(rest)
        .arg(python)
        .arg(peers.join("canopen_master.py"))
        .arg(programs.join("taustream-servosim"));
    command.arg(root.join("config/settings/vcan6.toml")).current_dir(root);
    perform("an independent CANopen master on a real vcan0", &mut command)
}

/// Somebody else's forward kinematics, in pinned versions, against ours.
fn independent_kinematics(root: &Path, programs: &Path, problems: &Path) -> Result<()> {
    let (target, peers) = (workspace::target(root), root.join("tests/peers"));
    let venv = target.join("venv-kinematics");
    perform(
        "a place for the independent kinematics",
        Command::new("python3").args(["-m", "venv"]).arg(&venv),
    )?;
    let python = venv.join("bin/python");
    let mut install = Command::new(&python);
    install.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--requirement",
    ]);
    perform("the independent kinematics from PyPI", install.arg(peers.join("kinematics-requirements.txt")))?;
    let mut command = Command::new(python);
    command.arg(peers.join("kinematics.py")).arg(programs.join("frames")).arg(root).arg(problems);
    perform("forward kinematics against an independent library", command.current_dir(root))
}

/// Somebody else's master of Damiao motors, installed with the one above: its frames, then its motors.
fn independent_damiao_master_on_vcan(root: &Path, programs: &Path, python: &Path) -> Result<()> {
    let (target, peers) = (workspace::target(root), root.join("tests/peers"));
    let mut frames = Command::new(python);
    frames.arg(peers.join("damiao_frames.py")).arg("--check");
    frames.arg(root.join("drivers/tests/damiao_suite/frames.csv"));
    perform("frames of Damiao motors by an independent library", &mut frames)?;
    let words = machine(programs, &target.join("peers"))?;
    let (program, rest) = words.split_first().context("no program to run")?;
    let mut command = Command::new(program);
    command
        .args(rest)
        .arg(python)
        .arg(peers.join("damiao_master.py"))
        .arg(programs.join("taustream-servosim"));
    command.arg(root.join("config/settings/damiao6.toml")).current_dir(root);
    perform("an independent Damiao master on a real vcan0", &mut command)
}

fn scenarios_on_vcan(root: &Path, programs: &Path) -> Result<()> {
    scenarios(root, programs, "scenarios on a real vcan0", &[])?;
    // Ways to carry setpoints: over two buses with modelled bit rates, and packed, staggered and rarer over one.
    for settings in ["dual-bus", "one-bus"] {
        let file = format!("config/settings/{settings}.toml");
        let words = ["--settings", file.as_str(), "--only", "three_goals"];
        scenarios(root, programs, &format!("three goals with {settings} on a real vcan"), &words)?;
    }
    Ok(())
}

fn scenarios(root: &Path, programs: &Path, what: &str, further: &[&str]) -> Result<()> {
    let output = workspace::target(root).join("scenarios");
    let words = machine(programs, &output)?;
    let (program, rest) = words.split_first().context("no program to run")?;
    let mut command = Command::new(program);
    command.args(rest).arg(programs.join("scenarios")).arg("--output").arg(&output).args(further);
    perform(what, command.current_dir(root))
}

fn damiao_scenarios_on_vcan(root: &Path, programs: &Path) -> Result<()> {
    let output = workspace::target(root).join("damiao-scenarios");
    let words = machine(programs, &output)?;
    let (program, rest) = words.split_first().context("no program to run")?;
    for (what, further) in [
        ("scenarios of Damiao motors on a real vcan0", &[][..]),
        ("Damiao motors over CAN FD on a real vcan0", &["--fd", "--only", "goals"]),
    ] {
        let mut command = Command::new(program);
        command.args(rest).arg(programs.join("damiao-scenarios")).arg("--output").arg(&output).args(further);
        perform(what, command.current_dir(root))?;
    }
    Ok(())
}

/// What `cargo xtask install` installs, booted with a Debian whose process 1 is systemd, and tried there.
fn services_under_systemd(root: &Path, programs: &Path) -> Result<()> {
    let place = workspace::target(root).join("services");
    let stage = place.join("stage");
    // Made anew: a file that is installed no more must not be found.
    let _not_there = std::fs::remove_dir_all(&stage);
    install::stage(root, programs, &stage)?;
    let mut command = Command::new(programs.join("services"));
    command.arg("boot").arg("--stage").arg(&stage).arg("--cache").arg(place.join("cache"));
    command.arg("--output").arg(place.join("output")).args(["--realtime", MACHINE_PRIORITY]);
    perform("services under a real systemd", &mut command)
}

/// The cycle beside bare loops, for the record: figures of a shared machine are printed, not judged.
fn figures_on_vcan(root: &Path, programs: &Path) -> Result<()> {
    let words = machine(programs, &workspace::target(root).join("figures"))?;
    let (program, rest) = words.split_first().context("no program to run")?;
    let mut command = Command::new(program);
    command.args(rest).arg(programs.join("taustream")).current_dir(root);
    command.args(["bench", "cycle", "--seconds", "8", "--link", "socketcan"]);
    perform("figures of the cycle on a real vcan0 (not judged)", &mut command)?;
    let mut command = Command::new(program);
    command.args(rest).arg(programs.join("taustream")).current_dir(root);
    command.args([
        "bench",
        "compare",
        "vcan6",
        "dual-bus",
        "one-bus",
        "--seconds",
        "6",
        "--link",
        "socketcan",
    ]);
    perform("figures of two buses beside one on a real vcan (not judged)", &mut command)
}
