//! What needs a booted Debian.
use super::{Outcome, Part, Step};
use crate::install;
use crate::packages::SERVICES;
use crate::place::{Place, perform};
use anyhow::Result;
use std::process::Command;

pub(super) const STEPS: &[Step] =
    &[Step { name: "services", part: Part::Systemd, packages: &SERVICES, programs: true, run: services }];

/// What `cargo xtask install` installs, booted with a Debian whose process 1 is systemd, and tried there.
fn services(place: &Place) -> Result<Outcome> {
    let folder = place.target.join("services");
    let stage = folder.join("stage");
    // Made again: a file that is installed no more must not be found.
    let _not_there = std::fs::remove_dir_all(&stage);
    install::stage(&place.root, &place.programs, &stage)?;
    let mut command = Command::new(place.programs.join("services"));
    command.arg("boot").arg("--stage").arg(&stage).arg("--cache").arg(folder.join("cache"));
    command.arg("--output").arg(folder.join("output"));
    perform("services under a real systemd", &mut command)?;
    Ok(Outcome::Passed)
}
