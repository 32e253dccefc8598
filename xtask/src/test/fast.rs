//! What needs nothing but a Rust toolchain.
use super::{Outcome, Part, Step, rights};
use crate::packages;
use crate::place::{Place, perform};
use crate::planted;
use anyhow::Result;
use std::env;
use std::process::Command;

/// The version that deny.toml is written for.
const DENY_VERSION: &str = "0.20.2";

const fn step(name: &'static str, run: fn(&Place) -> Result<Outcome>) -> Step {
    Step { name, part: Part::Fast, packages: &[], programs: false, run }
}

pub(super) const STEPS: &[Step] = &[
    step("format", |place| cargo(place, "format", &["fmt", "--all", "--check"])),
    step("lints", |place| {
        cargo(place, "lints", &["clippy", "--locked", "--workspace", "--all-targets", "--", "-D", "warnings"])
    }),
    step("tests", |place| {
        cargo(place, "unit, property and command line tests", &["test", "--locked", "--workspace"])
    }),
    step("planted faults", planted_faults),
    step("documentation", |place| {
        cargo(place, "documentation", &["doc", "--locked", "--workspace", "--no-deps"])
    }),
    Step { programs: true, ..step("commands of the documentation", documents) },
    Step { programs: true, ..step("demo without real-time rights", rights::demo) },
];

/// Licences, sources and banned crates of all dependencies.
pub(super) const LICENCES: &[Step] = &[Step { part: Part::Licences, ..step("licences", licences) }];

/// Builds all programs. The same features as for the tests: a build of the programs alone would build every
/// dependency a second time.
pub(super) fn build(place: &Place) -> Result<()> {
    cargo(place, "programs", &["test", "--locked", "--workspace", "--no-run"]).map(|_| ())
}

fn cargo(place: &Place, what: &str, words: &[&str]) -> Result<Outcome> {
    perform(what, place.cargo().args(words))?;
    Ok(Outcome::Passed)
}

/// Every planted fault still applies; `cargo xtask planted` shows that it is found.
fn planted_faults(place: &Place) -> Result<Outcome> {
    if !place.root.join(".git").exists() || !packages::exists("git") {
        return Ok(Outcome::Skipped("this is no git checkout, or git is missing".to_owned()));
    }
    let count = planted::check(&place.root)?;
    println!("\n=== planted faults: {count} patches apply");
    Ok(Outcome::Passed)
}

/// Every command block of README and docs, as printed.
fn documents(place: &Place) -> Result<Outcome> {
    let mut command = Command::new(place.programs.join("documents"));
    command.arg("--root").arg(&place.root).arg("--output").arg(place.target.join("documents"));
    perform("commands of the documentation", &mut command)?;
    Ok(Outcome::Passed)
}

/// cargo-deny is built into the target folder where it is not installed: few machines have it.
fn licences(place: &Place) -> Result<Outcome> {
    let tools = place.target.join("tools");
    let mut path = env::var_os("PATH").unwrap_or_default();
    if !packages::exists("cargo-deny") {
        // Without optimisation: building takes most of the time.
        let install =
            ["install", "--debug", "--locked", "--quiet", "cargo-deny", "--version", DENY_VERSION, "--root"];
        let what = "cargo-deny from crates.io (some minutes, once)";
        perform(what, place.cargo().args(install).arg(&tools))?;
        let all = std::iter::once(tools.join("bin")).chain(env::split_paths(&path));
        path = env::join_paths(all)?;
    }
    let words = ["deny", "--locked", "check", "licenses", "bans", "sources"];
    perform("licences, sources and bans", place.cargo().args(words).env("PATH", path))?;
    Ok(Outcome::Passed)
}
