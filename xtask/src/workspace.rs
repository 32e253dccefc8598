//! Where the workspace and its build are.
use anyhow::{Context, Result, bail};
use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Packages of the workspace that bring the programs.
const PROGRAMS: [&str; 4] = ["taustream-cli", "taustream-drivers", "taustream-streamer", "taustream-planner"];

/// The workspace: the directory above this package.
pub(crate) fn root() -> Result<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().map(Path::to_owned).context("the workspace directory is gone; run this from the source tree")
}

/// Where cargo builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir))
}

/// Builds the programs in release, and those of one more package; where they are.
pub(crate) fn build_release(root: &Path, also: Option<&str>) -> Result<PathBuf> {
    println!("building (the first time takes a few minutes) ..");
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["build", "--release", "--locked", "--bins"]).current_dir(root);
    for package in PROGRAMS.into_iter().chain(also) {
        command.args(["--package", package]);
    }
    let status = command.status().context("cargo cannot be started")?;
    if !status.success() {
        bail!("the build ended with {status}; its messages are above");
    }
    Ok(target(root).join("release"))
}
