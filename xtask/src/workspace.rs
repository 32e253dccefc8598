//! Where the workspace and its build are.
use anyhow::{Context, Result};
use std::env;
use std::path::{Path, PathBuf};

/// The workspace: the directory above this package.
pub(crate) fn root() -> Result<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().map(Path::to_owned).context("the workspace directory is gone; run this from the source tree")
}

/// Where cargo builds.
pub(crate) fn target(root: &Path) -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), |dir| root.join(dir))
}
