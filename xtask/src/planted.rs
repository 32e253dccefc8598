//! `cargo xtask planted`: faults that are planted on purpose, each of which the test that guards its promise must find.
//!
//! A file of `tests/planted` is a patch of the product below two lines: the promise that it breaks and the words of the
//! `cargo test` that must fail with it, and pass without it. Patches are applied to a copy of the last commit in the target
//! folder, never to the checkout, so an interrupted run leaves nothing behind that counts.
use crate::workspace;
use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Output};

/// Where the page lists promises, faults and tests.
const PAGE: &str = "docs/planted-faults.md";
/// A test that runs for longer hangs, s.
const TEST_S_MAX: &str = "900";

/// The words of `cargo xtask planted`.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Plant only faults whose name contains one of these [default: all].
    names: Vec<String>,
    /// List the faults, their promises and tests, and run nothing.
    #[arg(long)]
    list: bool,
    /// Check that every patch still applies, that its test exists and that the page lists it; run nothing.
    #[arg(long, conflicts_with = "list")]
    check: bool,
}

/// One planted fault.
#[derive(Debug)]
struct Planted {
    name: String,
    patch: PathBuf,
    promise: String,
    test: String,
}

impl Planted {
    fn read(patch: PathBuf) -> Result<Self> {
        let text = fs::read_to_string(&patch)?;
        let line = |key: &str| {
            let found = text.lines().find_map(|line| line.strip_prefix(key));
            found
                .map(|line| line.trim().to_owned())
                .with_context(|| format!("{}: no `{key}`", patch.display()))
        };
        let (promise, test) = (line("Promise:")?, line("Test:")?);
        let name = patch.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, patch, promise, test })
    }

    /// The name of the function that must fail.
    fn function(&self) -> &str {
        self.test.rsplit([' ', ':']).next().unwrap_or_default()
    }

    fn patch(&self) -> Result<&str> {
        self.patch.to_str().context("the path of the patch is not UTF-8")
    }
}

/// All faults, in the order of their names.
fn read_all(root: &Path) -> Result<Vec<Planted>> {
    let mut all = Vec::new();
    for file in fs::read_dir(root.join("tests/planted")).context("tests/planted")? {
        all.push(Planted::read(file?.path())?);
    }
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

/// A working tree of the last commit, gone when dropped. One that an interrupted run has left is replaced.
struct Tree {
    root: PathBuf,
    at: PathBuf,
}

impl Tree {
    fn new(root: &Path) -> Result<Self> {
        let tree = Self { root: root.to_owned(), at: workspace::target(root).join("planted") };
        tree.remove();
        let at = tree.at.to_str().context("the path of the target directory is not UTF-8")?;
        git(root, &["worktree", "add", "--detach", "--force", at, "HEAD"])?;
        Ok(tree)
    }

    fn remove(&self) {
        let _there_was_none = fs::remove_dir_all(&self.at);
        let _nothing_to_prune = git(&self.root, &["worktree", "prune"]);
    }

    /// Runs a test, built apart: no program with a fault in it ever stands among the ordinary ones. A test that hangs fails.
    fn passes(&self, test: &str) -> Result<bool> {
        let built =
            self.cargo_test(test, None).arg("--no-run").output().context("cargo cannot be started")?;
        ensure!(built.status.success(), "`cargo test {test}` did not build:\n{}", printed(&built));
        let output = self.cargo_test(test, Some(TEST_S_MAX)).output().context("timeout cannot be started")?;
        let passed = output.status.success();
        ensure!(!passed || printed(&output).contains("1 passed"), "`cargo test {test}` runs no test");
        Ok(passed)
    }

    /// `cargo test` in the copy, ended after `limit_s` where there is one.
    fn cargo_test(&self, test: &str, limit_s: Option<&str>) -> Command {
        let cargo = workspace::cargo(&self.at).get_program().to_owned();
        let mut command = if let Some(limit_s) = limit_s {
            let mut command = Command::new("timeout");
            command.arg(limit_s).arg(cargo);
            command
        } else {
            Command::new(cargo)
        };
        command.arg("test").args(test.split(' ').filter(|word| !word.is_empty())).current_dir(&self.at);
        command.env("CARGO_TARGET_DIR", workspace::target(&self.root).join("planted-build"));
        command
    }

    /// True when the test fails with the fault.
    fn is_found(&self, planted: &Planted) -> Result<bool> {
        git(&self.at, &["apply", planted.patch()?])?;
        let found = self.passes(&planted.test).map(|passes| !passes);
        git(&self.at, &["checkout", "--", "."])?;
        found
    }
}

impl Drop for Tree {
    fn drop(&mut self) {
        self.remove();
    }
}

fn git(directory: &Path, words: &[&str]) -> Result<()> {
    let output = Command::new("git").args(words).current_dir(directory).output().context("git")?;
    ensure!(output.status.success(), "git {}: {}", words.join(" "), printed(&output));
    Ok(())
}

fn printed(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Plants each fault and runs its test.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode> {
    let root = workspace::root()?;
    if arguments.check {
        let count = check(&root)?;
        println!("PLANTED OK: {count} patches apply, and their tests exist");
        return Ok(ExitCode::SUCCESS);
    }
    let mut all = read_all(&root)?;
    let names = &arguments.names;
    all.retain(|planted| names.is_empty() || names.iter().any(|name| planted.name.contains(name)));
    ensure!(!all.is_empty(), "no planted fault has a name like {}", names.join(" "));
    if arguments.list {
        for Planted { name, promise, test, .. } in &all {
            println!("{name}: {promise}\n    cargo test {test}");
        }
        return Ok(ExitCode::SUCCESS);
    }
    let tree = Tree::new(&root)?;
    // Without any fault first: what fails here is no evidence, and every patch then costs one build only.
    for planted in &all {
        ensure!(tree.passes(&planted.test)?, "{}: the test fails without the fault", planted.name);
    }
    println!("{} tests pass without the faults", all.len());
    let mut unnoticed = 0;
    for planted in &all {
        let found = tree.is_found(planted).with_context(|| planted.name.clone())?;
        println!("{} {}", if found { "found    " } else { "UNNOTICED" }, planted.name);
        unnoticed += usize::from(!found);
    }
    if unnoticed > 0 {
        bail!("{unnoticed} of {} planted faults were not noticed by their tests", all.len());
    }
    println!("PLANTED OK: {} faults, all of them found", all.len());
    Ok(ExitCode::SUCCESS)
}

/// Checks that every patch applies to the checkout, that its test exists and that page and patches agree.
pub(crate) fn check(root: &Path) -> Result<usize> {
    let all = read_all(root)?;
    let page = fs::read_to_string(root.join(PAGE)).context(PAGE)?;
    let sources = sources(root)?;
    let mut stale = Vec::new();
    for planted in &all {
        if let Err(e) = git(root, &["apply", "--check", planted.patch()?]) {
            stale.push(format!("{}: does not apply; adapt it to the new code: {e:#}", planted.name));
        }
        let (function, name) = (planted.function(), &planted.name);
        if !sources.contains(&format!("fn {function}()")) {
            stale.push(format!("{name}: its test `{function}` is gone; name the one that guards this now"));
        }
        if !page.contains(&format!("| `{name}` | `{function}`")) {
            stale.push(format!("{name}: {PAGE} does not list it with `{function}`"));
        }
    }
    let rows = page.lines().filter(|line| line.starts_with("| ") && line.contains(" | `")).count();
    if rows != all.len() {
        stale.push(format!("{PAGE} lists {rows} faults, tests/planted has {}", all.len()));
    }
    ensure!(stale.is_empty(), "planted faults are stale:\n  {}", stale.join("\n  "));
    Ok(all.len())
}

/// The text of all Rust files of the workspace.
fn sources(root: &Path) -> Result<String> {
    let output = Command::new("git").args(["ls-files", "-z", "*.rs"]).current_dir(root).output();
    let output = output.context("git")?;
    ensure!(output.status.success(), "git ls-files: {}", printed(&output));
    let mut text = String::new();
    for name in String::from_utf8_lossy(&output.stdout).split('\0').filter(|name| !name.is_empty()) {
        // A file that was deleted and not yet committed is none.
        text.push_str(&fs::read_to_string(root.join(name)).unwrap_or_default());
    }
    Ok(text)
}
