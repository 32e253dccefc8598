//! Debian packages that a task needs: looked for, announced, installed.
use anyhow::{Context, Result, bail};
use std::path::Path;
use std::process::{Command, Stdio};

/// What the vcan machine needs.
pub(crate) const MACHINE: [&str; 4] = ["user-mode-linux", "iproute2", "can-utils", "kmod"];

/// What runs other people's libraries.
pub(crate) const PEERS: [&str; 2] = ["python3", "python3-venv"];

/// What runs other people's masters and devices in the machine.
pub(crate) const MACHINE_AND_PEERS: [&str; 6] =
    ["user-mode-linux", "iproute2", "can-utils", "kmod", "python3", "python3-venv"];

/// What the machine boots a whole Debian with, and what formats the manual pages that are installed there.
pub(crate) const SERVICES: [&str; 7] =
    ["user-mode-linux", "iproute2", "can-utils", "kmod", "mmdebstrap", "squashfs-tools-ng", "groff-base"];

/// Makes sure that all packages are there. What is missing is named in one list and installed, as root or with sudo.
pub(crate) fn ensure(packages: &[&str]) -> Result<()> {
    let mut missing: Vec<&str> = packages.iter().copied().filter(|p| !is_installed(p)).collect();
    missing.sort_unstable();
    missing.dedup();
    if missing.is_empty() {
        return Ok(());
    }
    let list = missing.join(" ");
    if !exists("apt-get") {
        bail!("this host has no apt-get; install what Debian calls: {list}");
    }
    let sudo: &[&str] = if is_root() {
        &[]
    } else if exists("sudo") {
        &["sudo"]
    } else {
        bail!(
            "packages are missing and this is neither root nor is there sudo; as root: \
             apt-get install --no-install-recommends {list}"
        );
    };
    println!("installing Debian packages: {list}");
    apt(sudo, &["update"])?;
    let mut install = vec!["install", "--yes", "--no-install-recommends"];
    install.extend(&missing);
    apt(sudo, &install)?;
    match missing.iter().find(|p| !is_installed(p)) {
        None => Ok(()),
        Some(package) => {
            bail!("apt-get ended well, but {package} is still not installed; look at its output above")
        }
    }
}

fn apt(sudo: &[&str], words: &[&str]) -> Result<()> {
    let mut words = sudo.iter().chain(&["apt-get"]).chain(words);
    let program = words.next().context("no program")?;
    let words: Vec<&&str> = words.collect();
    println!("+ {program} {}", words.iter().map(|w| **w).collect::<Vec<_>>().join(" "));
    let status = Command::new(program)
        .args(&words)
        .env("DEBIAN_FRONTEND", "noninteractive")
        .status()
        .with_context(|| format!("{program} cannot be started"))?;
    if !status.success() {
        bail!("apt-get ended with {status}; is the network up, and is this Debian 12 or newer?");
    }
    Ok(())
}

/// What dpkg says. A host without dpkg has no Debian packages.
fn is_installed(package: &str) -> bool {
    let said = Command::new("dpkg-query")
        .args(["--show", "--showformat=${db:Status-Status}", package])
        .stderr(Stdio::null())
        .output();
    said.is_ok_and(|output| output.stdout == b"installed")
}

/// Whether a program is on the path.
pub(crate) fn exists(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|directory| directory.join(program).is_file())
}

/// Whether this process has root's rights.
pub(crate) fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    Path::new("/proc/self").metadata().is_ok_and(|own| own.uid() == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_that_are_installed_need_nothing() {
        // Every Debian has dpkg itself; elsewhere there is nothing to test.
        if exists("dpkg-query") {
            assert!(is_installed("dpkg"));
            assert!(!is_installed("no-such-package-of-taustream"));
            assert!(ensure(&["dpkg"]).is_ok());
        }
        assert!(ensure(&[]).is_ok());
    }

    #[test]
    fn programs_are_found_on_the_path_only() {
        assert!(exists("sh"));
        assert!(!exists("no-such-program-of-taustream"));
    }
}
