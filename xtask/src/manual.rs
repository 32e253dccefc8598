//! `cargo xtask man`: manual pages and shell completions where an installed system looks for them.
//!
//! The command line makes both of its own definitions; this only knows the places.
use crate::workspace;
use anyhow::{Context, Result, bail};
use clap::Args;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Each shell, and its completion file below the share directory.
const COMPLETIONS: [(&str, &str); 3] = [
    ("bash", "bash-completion/completions/taustream"),
    ("zsh", "zsh/vendor-completions/_taustream"),
    ("fish", "fish/vendor_completions.d/taustream.fish"),
];

/// The words of `cargo xtask man`.
#[derive(Args, Debug)]
#[command(after_help = "Example: cargo xtask man target/share && man -l target/share/man/man1/taustream.1")]
pub(crate) struct Arguments {
    /// Share directory to write into, as /usr/share is one; made when it is missing.
    #[arg(value_name = "DIR")]
    share: PathBuf,
}

/// Builds the command line and lets it write.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode> {
    let root = workspace::root()?;
    let mut build = workspace::cargo(&root);
    build.args(["build", "--release", "--locked", "--package", "taustream-cli"]);
    if !build.status().context("cargo cannot be started")?.success() {
        bail!("the build has failed; its messages are above");
    }
    let taustream = workspace::target(&root).join("release/taustream");
    install(&taustream, &arguments.share)?;
    println!("manual pages and completions written to {}", arguments.share.display());
    Ok(ExitCode::SUCCESS)
}

/// Writes manual pages and completions below `share` (an installed system's /usr/share) by the `taustream` given.
pub(crate) fn install(taustream: &Path, share: &Path) -> Result<()> {
    output(taustream, &["man".as_ref(), share.join("man/man1").as_os_str()])?;
    for (shell, file) in COMPLETIONS {
        let file = share.join(file);
        let script = output(taustream, &["completions".as_ref(), shell.as_ref()])?;
        let written =
            file.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&file, script));
        written.with_context(|| format!("{} cannot be written", file.display()))?;
    }
    Ok(())
}

/// Removes what [`install`] has written; how many files.
pub(crate) fn remove(share: &Path) -> Result<usize> {
    let pages =
        fs::read_dir(share.join("man/man1")).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_ours = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name == "taustream.1" || (name.starts_with("taustream-") && name.ends_with(".1"))
    };
    let completions = COMPLETIONS.iter().map(|(_, file)| share.join(file)).filter(|path| path.exists());
    let files: Vec<PathBuf> = pages.filter(is_ours).chain(completions).collect();
    for file in &files {
        fs::remove_file(file).with_context(|| format!("{} cannot be removed", file.display()))?;
    }
    Ok(files.len())
}

/// What a run prints; an error with its words when it fails.
fn output(program: &Path, words: &[&std::ffi::OsStr]) -> Result<Vec<u8>> {
    let ran = Command::new(program).args(words).output();
    let ran = ran.with_context(|| format!("{} cannot be started", program.display()))?;
    if !ran.status.success() {
        bail!("{} ended with {}: {}", program.display(), ran.status, String::from_utf8_lossy(&ran.stderr));
    }
    Ok(ran.stdout)
}
