//! A whole Debian with systemd as process 1, booted in the machine's kernel with our files installed.
//!
//! The image stays as it is: everything that is installed or written lies in memory above it and is gone afterwards,
//! except for the output directory.
use crate::machine::Machine;
use crate::scratch::{Scratch, quoted};
use anyhow::{Context, Result, ensure};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;

const INIT: &str = include_str!("../machine/systemd-init.sh");
const DRIVER: &str = include_str!("../machine/driver.sh");
/// Starts the driver when everything that boots has been started, and ends the machine with it.
const DRIVER_UNIT: &str = "\
[Unit]
Description=Driver of the test
After=multi-user.target
[Service]
Type=exec
ExecStart=/bin/bash /machine/driver.sh
ExecStopPost=/bin/systemctl --no-block poweroff --force
[Install]
WantedBy=multi-user.target
";
/// Units of Debian that would wait for a terminal, a network or the time of day.
const MASKED: [&str; 5] = [
    "getty.target",
    "console-getty.service",
    "systemd-timesyncd.service",
    "systemd-networkd-wait-online.service",
    "apt-daily.timer",
];

/// What is booted.
#[derive(Debug)]
pub struct Booted<'a> {
    /// The Debian image.
    pub image: &'a Path,
    /// Directories whose contents are laid over its root, owned by root, in this order.
    pub files: &'a [&'a Path],
    /// Directory of the host that stays writable as /machine/output; the journal is left there.
    pub output: &'a Path,
    /// How long the command may take, s.
    pub limit_s: u32,
}

impl Booted<'_> {
    /// Boots, runs a command as root when systemd has started everything, and returns its status.
    ///
    /// # Errors
    /// Whatever kept the machine from giving a status.
    pub fn run(&self, command: &[&str], stop: &AtomicBool) -> Result<u8> {
        let scratch = Scratch::new().context("no scratch directory")?;
        let own = scratch.path().join("files");
        lay_out(&own)?;
        pack(&scratch.path().join("files.tar"), &[&[own.as_path()], self.files].concat())?;
        let mut script = format!("timeout -k 5 {}", self.limit_s).into_bytes();
        for word in command {
            script.push(b' ');
            script.extend(quoted(OsStr::new(word)));
        }
        scratch.write("init.sh", INIT.as_bytes())?;
        scratch.write("driver.sh", DRIVER.as_bytes())?;
        scratch.write("command.sh", &script)?;
        let mut words: Vec<OsString> = vec!["systemd.show_status=0".into()];
        words.push(word("ubd0r=", self.image, &scratch.path().join("image.link"))?);
        words.push(word("machine_out=", self.output, &scratch.path().join("output.link"))?);
        let machine = Machine::new().limit_s(self.limit_s);
        let status = machine.boot(&scratch, &words, stop, (std::io::stdout(), std::io::stderr()));
        Ok(status?)
    }
}

/// What every booted machine gets: a name, an identity, the driver, nothing that waits in vain.
fn lay_out(root: &Path) -> Result<()> {
    let units = root.join("etc/systemd/system");
    fs::create_dir_all(units.join("multi-user.target.wants"))?;
    fs::write(root.join("etc/hostname"), "machine\n")?;
    fs::write(root.join("etc/hosts"), "127.0.0.1 localhost machine\n")?;
    // With an identity it is no first boot, on which systemd would enable whatever it finds.
    fs::write(root.join("etc/machine-id"), format!("{:032x}\n", 0x7a05))?;
    fs::write(root.join("etc/fstab"), "")?;
    fs::write(units.join("driver.service"), DRIVER_UNIT)?;
    symlink("../driver.service", units.join("multi-user.target.wants/driver.service"))?;
    for unit in MASKED {
        symlink("/dev/null", units.join(unit))?;
    }
    Ok(())
}

/// One archive of all, as root's: whoever runs the test need not be root for it.
fn pack(archive: &Path, directories: &[&Path]) -> Result<()> {
    let mut tar = Command::new("tar");
    tar.args(["--owner=0", "--group=0", "--create", "--file"]).arg(archive);
    for directory in directories {
        tar.arg("-C").arg(directory.canonicalize()?).arg(".");
    }
    let status = tar.status().context("cannot start tar")?;
    ensure!(status.success(), "tar: {status}");
    Ok(())
}

/// A word of the kernel's command line, which has no way to quote: a link in the scratch directory, whose name needs none,
/// stands for the path.
fn word(key: &str, path: &Path, link: &Path) -> Result<OsString> {
    let path: PathBuf = path.canonicalize().with_context(|| format!("{} is not there", path.display()))?;
    symlink(&path, link).with_context(|| format!("cannot link {}", path.display()))?;
    let mut word = OsString::from(key);
    word.push(link);
    Ok(word)
}
