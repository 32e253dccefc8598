//! Our numbers against those of other people's libraries, and of programs written from the papers.
use super::{Outcome, Part, Step};
use crate::packages::PEERS;
use crate::place::{Place, perform};
use anyhow::Result;
use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

const fn step(name: &'static str, run: fn(&Place) -> Result<Outcome>) -> Step {
    Step { name, part: Part::Peers, packages: &PEERS, programs: true, run }
}

pub(super) const STEPS: &[Step] = &[
    step("forward kinematics", kinematics),
    step("torques of motions", torques),
    step("clearances of planned motions", clearances),
    step("mesh files", meshes),
    step("optimisers step by step", walks),
    step("optimisers by their results", optimisers),
    step("frames of Damiao motors", damiao_frames),
    step("frames of ODrive drives", odrive_frames),
    step("frames of the Piper", piper_frames),
    step("frames of RobStride motors", robstride_frames),
    step("frames of CubeMars motors", cubemars_frames),
];

/// Where the published planning problems are, if they are at hand: their files stay outside of this project.
fn published_problems(root: &Path) -> PathBuf {
    env::var_os("TAUSTREAM_MBM_DIR").map_or_else(|| root.join("../shared/mbm"), PathBuf::from)
}

/// Independent readers of mesh files against ours, facet by facet.
fn meshes(place: &Place) -> Result<Outcome> {
    let python = place.python("venv-meshes", "meshes-requirements.txt", &[])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("meshes.py")).arg(place.programs.join("facets"));
    perform("mesh files against independent readers", &mut command)?;
    Ok(Outcome::Passed)
}

/// Independent forward kinematics, in pinned versions, against ours.
fn kinematics(place: &Place) -> Result<Outcome> {
    let problems = published_problems(&place.root);
    let python = place.python("venv-kinematics", "kinematics-requirements.txt", &["--no-deps"])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("kinematics.py")).arg(place.programs.join("frames"));
    command.arg(&place.root).arg(&problems).current_dir(&place.root);
    perform("forward kinematics against an independent library", &mut command)?;
    Ok(if problems.join("ur5_spherized.urdf").is_file() {
        Outcome::Passed
    } else {
        let looked = problems.display();
        Outcome::Skipped(format!(
            "ur5_spherized of the published problems (not part of this project; looked in {looked}, TAUSTREAM_MBM_DIR names another folder)"
        ))
    })
}

/// Inverse dynamics of an independent library, in pinned versions, against ours.
fn torques(place: &Place) -> Result<Outcome> {
    let python = place.python("venv-torques", "torques-requirements.txt", &["--no-deps"])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("torques.py")).arg(place.programs.join("torques")).arg(&place.root);
    perform("torques of motions against an independent library", &mut command)?;
    Ok(Outcome::Passed)
}

/// Distances by an independent library, in pinned versions, against what was proven of planned motions.
fn clearances(place: &Place) -> Result<Outcome> {
    let python = place.python("venv-clearance", "clearance-requirements.txt", &["--no-deps"])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("clearance.py")).arg(place.programs.join("motions")).arg(&place.root);
    perform("clearances of planned motions against an independent library", &mut command)?;
    Ok(Outcome::Passed)
}

/// The optimisers against programs that walk them from their papers.
fn walks(place: &Place) -> Result<Outcome> {
    let mut walks = Command::new("python3");
    walks.arg(place.root.join("optimizers/tests/oracles/walks.py")).arg("--check");
    perform("walks of the optimisers by programs written from the papers", &mut walks)?;
    Ok(Outcome::Passed)
}

/// The optimisers against an independent library.
fn optimisers(place: &Place) -> Result<Outcome> {
    let python = place.python("venv-optimisers", "mealpy-requirements.txt", &[])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join("optimisers_mealpy.py"));
    command.arg(place.programs.join("examples/benchmarks"));
    perform("optimisers against an independent library", &mut command)?;
    Ok(Outcome::Passed)
}

/// Frames of Damiao motors as somebody else's library packs them.
fn damiao_frames(place: &Place) -> Result<Outcome> {
    let python = place.python("venv", "requirements.txt", &[])?;
    let mut frames = Command::new(python);
    frames.arg(place.peers().join("damiao_frames.py")).arg("--check");
    frames.arg(place.root.join("drivers/tests/damiao_suite/frames.csv"));
    perform("frames of Damiao motors by an independent library", &mut frames)?;
    Ok(Outcome::Passed)
}

/// Frames of `ODrive` drives as an independent encoder packs them from the tables of the firmware.
fn odrive_frames(place: &Place) -> Result<Outcome> {
    let what = "frames of ODrive drives by an independent encoder";
    frames(place, what, "odrive_frames.py", "drivers/tests/odrive_suite/frames.csv")
}

/// Frames of the Piper as its maker's library packs them.
fn piper_frames(place: &Place) -> Result<Outcome> {
    let what = "frames of the Piper by its maker's library";
    frames(place, what, "piper_frames.py", "drivers/tests/piper_suite/frames.csv")
}

/// Frames of `RobStride` motors as two independent libraries pack and read them.
fn robstride_frames(place: &Place) -> Result<Outcome> {
    let what = "frames of RobStride motors by two independent libraries";
    frames(place, what, "robstride_frames.py", "drivers/tests/robstride_suite/frames.csv")
}

/// Frames of `CubeMars` motors as an independent library packs and reads them.
fn cubemars_frames(place: &Place) -> Result<Outcome> {
    let what = "frames of CubeMars motors by an independent library";
    frames(place, what, "cubemars_frames.py", "drivers/tests/cubemars_suite/frames.csv")
}

fn frames(place: &Place, what: &str, program: &str, held: &str) -> Result<Outcome> {
    let python = place.python("venv-frames", "frames-requirements.txt", &["--no-deps"])?;
    let mut command = Command::new(python);
    command.arg(place.peers().join(program)).arg("--check").arg(place.root.join(held));
    perform(what, &mut command)?;
    Ok(Outcome::Passed)
}
