//! What needs nothing but a Rust toolchain.
use super::{Outcome, Part, Step, rights};
use crate::packages;
use crate::place::{Place, perform};
use anyhow::Result;

const fn step(name: &'static str, run: fn(&Place) -> Result<Outcome>) -> Step {
    Step { name, part: Part::Fast, packages: &[], programs: false, run }
}

pub(super) const STEPS: &[Step] = &[
    step("format", |place| cargo(place, "format", &["fmt", "--all", "--check"])),
    step("licences", licences),
    step("lints", |place| {
        cargo(place, "lints", &["clippy", "--locked", "--workspace", "--all-targets", "--", "-D", "warnings"])
    }),
    step("tests", |place| {
        cargo(place, "unit, property and command line tests", &["test", "--locked", "--workspace"])
    }),
    step("documentation", |place| {
        cargo(place, "documentation", &["doc", "--locked", "--workspace", "--no-deps"])
    }),
    Step { programs: true, ..step("demo without real-time rights", rights::demo) },
];

/// Builds all programs. The same features as for the tests: a build of the programs alone would build every
/// dependency a second time.
pub(super) fn build(place: &Place) -> Result<()> {
    cargo(place, "programs", &["test", "--locked", "--workspace", "--no-run"]).map(|_| ())
}

fn cargo(place: &Place, what: &str, words: &[&str]) -> Result<Outcome> {
    perform(what, place.cargo().args(words))?;
    Ok(Outcome::Passed)
}

/// Licences, sources and banned crates of all dependencies, where cargo-deny is installed: building it takes longer than
/// many a test.
fn licences(place: &Place) -> Result<Outcome> {
    if !packages::exists("cargo-deny") {
        return Ok(Outcome::Skipped(
            "cargo-deny is not installed (cargo install --locked cargo-deny)".into(),
        ));
    }
    cargo(place, "licences, sources and bans", &["deny", "--locked", "check", "licenses", "bans", "sources"])
}
