//! Where a test run finds things, and the ways in which it starts programs.
use crate::workspace;
use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// How long one run in the machine may take before it counts as hung, s.
const MACHINE_LIMIT_S: &str = "900";

/// A source tree with its built programs.
pub(crate) struct Place {
    /// The workspace.
    pub(crate) root: PathBuf,
    /// Where cargo builds.
    pub(crate) target: PathBuf,
    /// The programs that cargo has built.
    pub(crate) programs: PathBuf,
}

impl Place {
    /// The workspace above this package.
    pub(crate) fn find() -> Result<Self> {
        let root = workspace::root()?;
        let target = workspace::target(&root);
        Ok(Self { programs: target.join("debug"), target, root })
    }

    /// Cargo, in the workspace.
    pub(crate) fn cargo(&self) -> Command {
        let mut command = workspace::cargo(&self.root);
        command.env("RUSTDOCFLAGS", "-D warnings");
        command
    }

    /// The words that start the machine, in which a folder of the build can be written; the program follows them.
    pub(crate) fn machine(&self, folder: &str) -> Result<Vec<PathBuf>> {
        let output = self.target.join(folder);
        std::fs::create_dir_all(&output).with_context(|| format!("{} cannot be made", output.display()))?;
        let mut words = vec![self.programs.join("vcan-machine")];
        let options = ["--limit-s", MACHINE_LIMIT_S, "--writable"];
        words.extend(options.map(PathBuf::from));
        words.extend([output, "--".into()]);
        Ok(words)
    }

    /// A program that runs in the machine, in the workspace; its words are still to be added.
    pub(crate) fn in_machine(&self, folder: &str, program: &Path) -> Result<Command> {
        let words = self.machine(folder)?;
        let (machine, rest) = words.split_first().context("no machine to run")?;
        let mut command = Command::new(machine);
        command.args(rest).arg(program).current_dir(&self.root);
        Ok(command)
    }

    /// A Python with exactly what a list of `tests/peers` names, in a folder of the build.
    pub(crate) fn python(&self, folder: &str, list: &str, options: &[&str]) -> Result<PathBuf> {
        let venv = self.target.join(folder);
        let mut make = Command::new("python3");
        perform(&format!("a place for {list}"), make.args(["-m", "venv"]).arg(&venv))?;
        let python = venv.join("bin/python");
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(options);
        install.arg("--requirement").arg(self.peers().join(list));
        perform(&format!("{list} from PyPI"), &mut install)?;
        Ok(python)
    }

    /// The folder of programs that check our work with independent work.
    pub(crate) fn peers(&self) -> PathBuf {
        self.root.join("tests/peers")
    }
}

/// Announces a step, runs it, and says how long it took.
pub(crate) fn perform(what: &str, command: &mut Command) -> Result<()> {
    println!("\n=== {what}");
    let since = Instant::now();
    let status = command.status().with_context(|| format!("{what}: cannot start {command:?}"))?;
    if !status.success() {
        bail!("{what}: {status}");
    }
    println!("=== {what}: passed in {:.0} s", since.elapsed().as_secs_f64());
    Ok(())
}
