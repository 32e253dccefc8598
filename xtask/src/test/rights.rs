//! The demo as an ordinary user has it: no right to real-time priority, 8 MiB of memory to lock.
use super::Outcome;
use crate::packages::is_root;
use crate::place::{Place, perform};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::os::unix::fs::{PermissionsExt, chown};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The user `nobody`, and its group.
const NOBODY: u32 = 65_534;
/// How long the demo may take, s.
const LIMIT_S: &str = "240";
const PROGRAMS: [&str; 4] = ["taustream", "taustream-servosim", "taustream-streamer", "taustream-planner"];

/// A folder that anybody can read, whoever may enter the source tree.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Result<Self> {
        let path = std::env::temp_dir().join(format!("taustream src {}", std::process::id()));
        fs::create_dir(&path).with_context(|| format!("{} cannot be made", path.display()))?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _left_for_the_next_start_of_the_host = fs::remove_dir_all(&self.0);
    }
}

/// Runs the demo without rights, as root by taking them away.
pub(super) fn demo(place: &Place) -> Result<Outcome> {
    let what = "demo without real-time rights";
    let folder = Folder::new()?;
    let here = &folder.0;
    for program in PROGRAMS {
        fs::copy(place.programs.join(program), here.join(program)).with_context(|| program.to_owned())?;
    }
    copy_all(&place.root.join("config"), &here.join("config"))?;
    let output = here.join("output");
    fs::create_dir(&output)?;
    for path in [here, &output] {
        fs::set_permissions(path, fs::Permissions::from_mode(0o755))?;
    }
    let words: &[&str] = if is_root() {
        chown(&output, Some(NOBODY), Some(NOBODY))?;
        &[
            "setpriv",
            "--reuid=65534",
            "--regid=65534",
            "--clear-groups",
            "prlimit",
            "--rtprio=0",
            "--memlock=8388608",
        ]
    } else {
        &["prlimit", "--rtprio=0"]
    };
    let (program, rest) = words.split_first().context("no program")?;
    let log = output.join("demo.log");
    let mut command = Command::new(program);
    command.args(rest).arg(here.join("taustream")).args(["demo", "--limit-s", LIMIT_S, "--config"]);
    command.arg(here.join("config/demo.toml")).arg("--output").arg(&output).current_dir(&output);
    command.env("TAUSTREAM_RUNTIME_DIR", output.join("run")).stderr(fs::File::create(&log)?);
    let result = perform(what, &mut command);
    let said = fs::read_to_string(&log).unwrap_or_default();
    eprint!("{said}");
    result?;
    ensure!(said.contains("WITHOUT real-time rights"), "{what}: it had them, so this proved nothing");
    Ok(Outcome::Passed)
}

fn copy_all(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir(to).with_context(|| format!("{} cannot be made", to.display()))?;
    for entry in fs::read_dir(from).with_context(|| format!("{} cannot be read", from.display()))? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_all(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}
