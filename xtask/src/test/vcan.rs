//! What needs a kernel with CAN: everything here runs in the test machine.
use super::{Outcome, Part, Step};
use crate::packages::{MACHINE, MACHINE_AND_PEERS};
use crate::place::{Place, perform};
use anyhow::Result;

const fn step(name: &'static str, run: fn(&Place) -> Result<Outcome>) -> Step {
    Step { name, part: Part::Vcan, packages: &MACHINE, programs: true, run }
}

const fn with_python(name: &'static str, run: fn(&Place) -> Result<Outcome>) -> Step {
    Step { packages: &MACHINE_AND_PEERS, ..step(name, run) }
}

pub(super) const STEPS: &[Step] = &[
    step("test machine", machine),
    step("links", links),
    with_python("CANopen master", canopen_master),
    with_python("CANopen devices", canopen_devices),
    with_python("Damiao master", damiao_master),
    step("scenarios", |place| scenarios(place, "scenarios", &[])),
    // Ways to carry setpoints: over two buses with modelled bit rates, and packed, staggered and rarer over one.
    step("scenarios with dual-bus", |place| three_goals(place, "dual-bus")),
    step("scenarios with one-bus", |place| three_goals(place, "one-bus")),
    step("scenarios of Damiao motors", |place| scenarios(place, "motor-scenarios", &[])),
    step("scenarios of Damiao motors over CAN FD", |place| {
        scenarios(place, "motor-scenarios", &["--fd", "--only", "goals"])
    }),
    step("scenarios of MyActuator motors", |place| motor_goals(place, "rmd6")),
    step("scenarios of RobStride motors", |place| motor_goals(place, "robstride6")),
    step("scenarios of CubeMars motors", |place| motor_goals(place, "ak6")),
    step("scenarios of ODrive drives", |place| motor_goals(place, "odrive6")),
    step("scenarios of a gripper beside the path", gripper),
    step("scenarios of two arms as one", two_arms),
    step("figures", figures),
];

/// The machine keeps its promises. Cargo starts it.
fn machine(place: &Place) -> Result<Outcome> {
    let mut command = place.cargo();
    command.args(["test", "--locked", "--workspace", "--test", "machine"]);
    perform("the test machine itself", &mut command)?;
    Ok(Outcome::Passed)
}

/// The links' tests, which cargo starts through the machine as their runner.
fn links(place: &Place) -> Result<Outcome> {
    let words = place.machine("on-vcan")?;
    let words: Vec<String> = words.iter().map(|word| format!("{:?}", word.display().to_string())).collect();
    let runner = format!("target.'cfg(all())'.runner = [{}]", words.join(", "));
    let mut command = place.cargo();
    command.args(["test", "--locked", "--workspace", "--test", "on_vcan"]);
    command.args(["--config", &runner, "--", "--test-threads", "1"]);
    perform("links on a real vcan0", &mut command)?;
    Ok(Outcome::Passed)
}

/// An independent CANopen master drives the simulated drives.
fn canopen_master(place: &Place) -> Result<Outcome> {
    let python = place.python("venv", "requirements.txt", &[])?;
    let mut command = place.in_machine("peers", &python)?;
    command.arg(place.peers().join("canopen_master.py")).arg(place.programs.join("taustream-servosim"));
    command.arg("config/settings/vcan6.toml");
    perform("an independent CANopen master on a real vcan0", &mut command)?;
    Ok(Outcome::Passed)
}

/// Independent CANopen devices are brought up and moved by our own programs.
fn canopen_devices(place: &Place) -> Result<Outcome> {
    let python = place.python("venv", "requirements.txt", &[])?;
    let mut command = place.in_machine("peers", &python)?;
    command.arg(place.peers().join("durand_drives.py")).arg(&place.programs);
    command.arg(place.peers().join("durand.toml"));
    perform("independent CANopen devices on a real vcan0", &mut command)?;
    Ok(Outcome::Passed)
}

/// An independent master of Damiao motors drives the simulated ones.
fn damiao_master(place: &Place) -> Result<Outcome> {
    let python = place.python("venv", "requirements.txt", &[])?;
    let mut command = place.in_machine("peers", &python)?;
    command.arg(place.peers().join("damiao_master.py")).arg(place.programs.join("taustream-servosim"));
    command.arg("config/settings/damiao6.toml");
    perform("an independent Damiao master on a real vcan0", &mut command)?;
    Ok(Outcome::Passed)
}

fn three_goals(place: &Place, settings: &str) -> Result<Outcome> {
    let file = format!("config/settings/{settings}.toml");
    scenarios(place, "scenarios", &["--settings", &file, "--only", "three_goals"])
}

/// Three goals with a pause; the other scenarios of a protocol by the command of docs/testing.md.
fn motor_goals(place: &Place, settings: &str) -> Result<Outcome> {
    let file = format!("config/settings/{settings}.toml");
    scenarios(place, "motor-scenarios", &["--settings", &file, "--only", "goals"])
}

/// A gripper opens, grips, moves beside the path, and is named when it is silent.
fn gripper(place: &Place) -> Result<Outcome> {
    let file = "config/settings/damiao6-gripper.toml";
    scenarios(place, "motor-scenarios", &["--settings", file, "--only", "gripper"])
}

/// Fourteen joints and two grippers on two buses of CAN FD: goals, a replan in motion, a silent and a faulted motor, a killed streamer.
fn two_arms(place: &Place) -> Result<Outcome> {
    let (file, demo) = ("config/settings/openarm.toml", "config/demo-openarm.toml");
    scenarios(place, "motor-scenarios", &["--settings", file, "--demo", demo])
}

fn scenarios(place: &Place, program: &str, further: &[&str]) -> Result<Outcome> {
    let mut command = place.in_machine(program, &place.programs.join(program))?;
    command.arg("--output").arg(place.target.join(program)).args(further);
    perform(&format!("{program} {} on a real vcan0", further.join(" ")), &mut command)?;
    Ok(Outcome::Passed)
}

/// The cycle beside bare loops, for the record: figures of a shared machine are printed, not checked.
fn figures(place: &Place) -> Result<Outcome> {
    let figures: [(&str, &[&str]); 2] = [
        ("values of the cycle on a real vcan0 (not checked)", &["cycle", "--seconds", "8"]),
        (
            "values of two buses beside one on a real vcan (not checked)",
            &["compare", "vcan6", "dual-bus", "one-bus", "--seconds", "6"],
        ),
    ];
    for (what, words) in figures {
        let mut command = place.in_machine("figures", &place.programs.join("taustream"))?;
        perform(what, command.arg("bench").args(words).args(["--link", "socketcan"]))?;
    }
    Ok(Outcome::Passed)
}
