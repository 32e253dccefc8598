//! Where the workspace and its build are.
use anyhow::{Context, Result, bail};
use std::env;
use std::path::{self, Path, PathBuf};
use std::process::Command;

/// Packages of the workspace that bring the programs.
const PROGRAMS: [&str; 4] = ["taustream-cli", "taustream-drivers", "taustream-streamer", "taustream-planner"];

/// The workspace: the directory above this package.
pub(crate) fn root() -> Result<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().map(Path::to_owned).context("the workspace directory is gone; run this from the source tree")
}

/// Where cargo builds: this program is in a folder below it, whatever says where that is (`CARGO_TARGET_DIR`, the user's own
/// configuration of cargo, a target triple).
pub(crate) fn target(root: &Path) -> PathBuf {
    let own = env::current_exe().ok();
    let found = own.as_deref().and_then(Path::parent).and_then(Path::parent);
    found.map_or_else(|| root.join("target"), Path::to_owned)
}

/// Cargo, in the workspace. A relative `CARGO_TARGET_DIR` keeps its meaning there.
pub(crate) fn cargo(root: &Path) -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    let given = env::var_os("CARGO_TARGET_DIR").and_then(|dir| path::absolute(dir).ok());
    command.envs(given.map(|dir| ("CARGO_TARGET_DIR", dir)));
    command
}

/// Builds the programs in release, and those of one more package; where they are.
pub(crate) fn build_release(root: &Path, also: Option<&str>) -> Result<PathBuf> {
    println!("building (the first time takes a few minutes) ..");
    let mut command = cargo(root);
    command.args(["build", "--release", "--locked", "--bins"]);
    for package in PROGRAMS.into_iter().chain(also) {
        command.args(["--package", package]);
    }
    let status = command.status().context("cargo cannot be started")?;
    if !status.success() {
        bail!("the build ended with {status}; its messages are above");
    }
    Ok(target(root).join("release"))
}
