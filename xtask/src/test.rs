//! `cargo xtask test`: everything that must hold before a change lands, in one command.
use crate::install;
use crate::packages::{self, MACHINE, MANUAL, PEERS, SERVICES};
use crate::place::{MACHINE_PRIORITY, Place, perform};
use anyhow::Result;
use std::env;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

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
    let place = Place::find()?;
    for list in [&MACHINE[..], &PEERS, &MANUAL, &SERVICES] {
        packages::ensure(list)?;
    }
    for (what, words) in STEPS {
        perform(what, place.cargo().args(words))?;
    }
    let problems = published_problems(&place.root);
    independent_kinematics(&place, &problems)?;
    independent_optimisers(&place)?;
    links_on_vcan(&place)?;
    let python = place.python("venv", "requirements.txt", &[])?;
    independent_master_on_vcan(&place, &python)?;
    independent_devices_on_vcan(&place, &python)?;
    independent_damiao_master_on_vcan(&place, &python)?;
    scenarios_on_vcan(&place)?;
    damiao_scenarios_on_vcan(&place)?;
    services_under_systemd(&place)?;
    figures_on_vcan(&place)?;
    let skipped = if problems.join("ur5_spherized.urdf").is_file() {
        "nothing was skipped".to_owned()
    } else {
        let looked = problems.display();
        format!(
            "SKIPPED ur5_spherized of the published problems (not part of this project; looked in {looked}, TAUSTREAM_MBM_DIR names another folder)"
        )
    };
    println!("\nTEST OK: everything passed, {skipped}, {:.0} s", since.elapsed().as_secs_f64());
    Ok(ExitCode::SUCCESS)
}

/// Where the published planning problems are, if they are at hand: their files stay outside of this project.
fn published_problems(root: &Path) -> PathBuf {
    env::var_os("TAUSTREAM_MBM_DIR").map_or_else(|| root.join("../shared/mbm"), PathBuf::from)
}

/// Somebody else's forward kinematics, in pinned versions, against ours.
fn independent_kinematics(place: &Place, problems: &Path) -> Result<()> {
    let python = place.python("venv-kinematics", "kinematics-requirements.txt", &["--no-deps"])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("kinematics.py")).arg(place.programs.join("frames"));
    command.arg(&place.root).arg(problems).current_dir(&place.root);
    perform("forward kinematics against an independent library", &mut command)
}

/// The optimisers against the programs that walk them from their papers, and against somebody else's library.
fn independent_optimisers(place: &Place) -> Result<()> {
    let mut walks = Command::new("python3");
    walks.arg(place.root.join("planner/tests/oracles/walks.py")).arg("--check");
    perform("walks of the optimisers by programs written from the papers", &mut walks)?;
    let python = place.python("venv-optimisers", "mealpy-requirements.txt", &[])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("optimisers_mealpy.py"));
    command.arg(place.programs.join("examples/benchmarks"));
    perform("optimisers against an independent library", &mut command)
}

/// The links' tests, which cargo starts through the machine as their runner.
fn links_on_vcan(place: &Place) -> Result<()> {
    let words = place.machine("on-vcan")?;
    let words: Vec<String> = words.iter().map(|word| format!("{:?}", word.display().to_string())).collect();
    let runner = format!("target.'cfg(all())'.runner = [{}]", words.join(", "));
    let mut command = place.cargo();
    command.args(["test", "--locked", "--package", "taustream-tests", "--test", "on_vcan"]);
    command.args(["--config", &runner, "--", "--test-threads", "1"]);
    perform("links on a real vcan0", &mut command)
}

/// Somebody else's CANopen master drives the simulated drives.
fn independent_master_on_vcan(place: &Place, python: &Path) -> Result<()> {
    let mut command = place.in_machine("peers", python)?;
    command.arg(place.peers().join("canopen_master.py")).arg(place.programs.join("taustream-servosim"));
    command.arg("config/settings/vcan6.toml");
    perform("an independent CANopen master on a real vcan0", &mut command)
}

/// Somebody else's CANopen devices are brought up and moved by our own programs.
fn independent_devices_on_vcan(place: &Place, python: &Path) -> Result<()> {
    let mut command = place.in_machine("peers", python)?;
    command.arg(place.peers().join("durand_drives.py")).arg(&place.programs);
    command.arg(place.peers().join("durand.toml"));
    perform("independent CANopen devices on a real vcan0", &mut command)
}

/// Somebody else's master of Damiao motors: its frames, then its motors.
fn independent_damiao_master_on_vcan(place: &Place, python: &Path) -> Result<()> {
    let mut frames = Command::new(python);
    frames.arg(place.peers().join("damiao_frames.py")).arg("--check");
    frames.arg(place.root.join("drivers/tests/damiao_suite/frames.csv"));
    perform("frames of Damiao motors by an independent library", &mut frames)?;
    let mut command = place.in_machine("peers", python)?;
    command.arg(place.peers().join("damiao_master.py")).arg(place.programs.join("taustream-servosim"));
    command.arg("config/settings/damiao6.toml");
    perform("an independent Damiao master on a real vcan0", &mut command)
}

fn scenarios_on_vcan(place: &Place) -> Result<()> {
    let program = "scenarios";
    scenarios(place, program, "scenarios on a real vcan0", &[])?;
    // Ways to carry setpoints: over two buses with modelled bit rates, and packed, staggered and rarer over one.
    for settings in ["dual-bus", "one-bus"] {
        let file = format!("config/settings/{settings}.toml");
        let words = ["--settings", file.as_str(), "--only", "three_goals"];
        scenarios(place, program, &format!("three goals with {settings} on a real vcan"), &words)?;
    }
    Ok(())
}

fn damiao_scenarios_on_vcan(place: &Place) -> Result<()> {
    let program = "damiao-scenarios";
    scenarios(place, program, "scenarios of Damiao motors on a real vcan0", &[])?;
    scenarios(place, program, "Damiao motors over CAN FD on a real vcan0", &["--fd", "--only", "goals"])
}

fn scenarios(place: &Place, program: &str, what: &str, further: &[&str]) -> Result<()> {
    let mut command = place.in_machine(program, &place.programs.join(program))?;
    command.arg("--output").arg(place.target.join(program)).args(further);
    perform(what, &mut command)
}

/// What `cargo xtask install` installs, booted with a Debian whose process 1 is systemd, and tried there.
fn services_under_systemd(place: &Place) -> Result<()> {
    let folder = place.target.join("services");
    let stage = folder.join("stage");
    // Made anew: a file that is installed no more must not be found.
    let _not_there = std::fs::remove_dir_all(&stage);
    install::stage(&place.root, &place.programs, &stage)?;
    let mut command = Command::new(place.programs.join("services"));
    command.arg("boot").arg("--stage").arg(&stage).arg("--cache").arg(folder.join("cache"));
    command.arg("--output").arg(folder.join("output")).args(["--realtime", MACHINE_PRIORITY]);
    perform("services under a real systemd", &mut command)
}

/// The cycle beside bare loops, for the record: figures of a shared machine are printed, not judged.
fn figures_on_vcan(place: &Place) -> Result<()> {
    let figures: [(&str, &[&str]); 2] = [
        ("figures of the cycle on a real vcan0 (not judged)", &["cycle", "--seconds", "8"]),
        (
            "figures of two buses beside one on a real vcan (not judged)",
            &["compare", "vcan6", "dual-bus", "one-bus", "--seconds", "6"],
        ),
    ];
    for (what, words) in figures {
        let mut command = place.in_machine("figures", &place.programs.join("taustream"))?;
        perform(what, command.arg("bench").args(words).args(["--link", "socketcan"]))?;
    }
    Ok(())
}
