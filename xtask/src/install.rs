//! `cargo xtask install`: the one list of what goes where, for installing by hand, for tests and for packages.
use crate::{manual, packages, workspace};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::env;
use std::ffi::OsStr;
use std::fs::{self, DirBuilder, Permissions};
use std::io::ErrorKind;
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

const HELP: &str = "\
Examples:
  cargo xtask install                                       build in release, then install on this machine through sudo
  cargo xtask install --root stage --programs target/debug  into a directory, from programs that are there

docs/services.md has the next steps: settings, bus, users, start.";

/// Where to install.
#[derive(Args, Debug)]
pub(crate) struct RootArguments {
    /// The root of the file system to install into; below / it takes root's rights, through sudo for anybody else.
    #[arg(long, value_name = "DIR", default_value = "/")]
    root: PathBuf,
}

/// The words of `cargo xtask install`.
#[derive(Args, Debug)]
#[command(after_help = HELP)]
pub(crate) struct Arguments {
    #[command(flatten)]
    root: RootArguments,
    /// Take the programs from here instead of building them.
    #[arg(long, value_name = "DIR")]
    programs: Option<PathBuf>,
}

/// Programs, which go to /usr/bin.
const PROGRAMS: [&str; 4] = ["taustream", "taustream-planner", "taustream-streamer", "taustream-servosim"];

/// Files of the source tree: from, to, mode.
const FILES: [(&str, &str, u32); 14] = [
    ("systemd/taustream@.target", "usr/lib/systemd/system/taustream@.target", 0o644),
    ("systemd/taustream-streamer@.service", "usr/lib/systemd/system/taustream-streamer@.service", 0o644),
    ("systemd/taustream-planner@.service", "usr/lib/systemd/system/taustream-planner@.service", 0o644),
    ("systemd/taustream-servosim@.service", "usr/lib/systemd/system/taustream-servosim@.service", 0o644),
    (
        "systemd/taustream-.service.d/common.conf",
        "usr/lib/systemd/system/taustream-.service.d/common.conf",
        0o644,
    ),
    ("systemd/sysusers.conf", "usr/lib/sysusers.d/taustream.conf", 0o644),
    ("systemd/tmpfiles.conf", "usr/lib/tmpfiles.d/taustream.conf", 0o644),
    ("systemd/modules-load.conf", "usr/lib/modules-load.d/taustream.conf", 0o644),
    // sudo takes no rule that others may write.
    ("systemd/sudoers", "etc/sudoers.d/taustream", 0o440),
    ("config/demo.toml", "usr/share/taustream/demo.toml", 0o644),
    ("README.md", "usr/share/doc/taustream/README.md", 0o644),
    ("CHANGELOG.md", "usr/share/doc/taustream/CHANGELOG.md", 0o644),
    ("LICENSE-APACHE", "usr/share/doc/taustream/LICENSE-APACHE", 0o644),
    ("LICENSE-MIT", "usr/share/doc/taustream/LICENSE-MIT", 0o644),
];

/// Folders of the source tree that are taken whole: shipped data, and bus files that do nothing before they are copied
/// to /etc/systemd/network, because a wrong bit rate disturbs a bus that works.
const FOLDERS: [(&str, &str); 6] = [
    ("docs", "usr/share/doc/taustream/docs"),
    ("config/paths", "usr/share/taustream/paths"),
    ("config/robots", "usr/share/taustream/robots"),
    ("config/scenes", "usr/share/taustream/scenes"),
    ("config/settings", "usr/share/taustream/settings"),
    ("systemd/network", "usr/share/taustream/network"),
];

/// Installs.
pub(crate) fn run(arguments: &Arguments) -> Result<ExitCode> {
    let source = workspace::root()?;
    let programs = match &arguments.programs {
        Some(programs) => programs.clone(),
        None => workspace::build_release(&source, None)?,
    };
    let root = &arguments.root.root;
    if is_this_machine(root) && !packages::is_root() {
        return as_root(&[
            "install".as_ref(),
            "--root".as_ref(),
            root.as_os_str(),
            "--programs".as_ref(),
            programs.as_os_str(),
        ]);
    }
    let count = stage(&source, &programs, root)?;
    manual::install(&programs.join("taustream"), &root.join("usr/share"))?;
    println!("installed {count} files, manual pages and completions below {}", root.display());
    if is_this_machine(root) {
        manager(&[
            &["systemd-sysusers"],
            &["systemd-tmpfiles", "--create"],
            &["systemctl", "daemon-reload"],
        ])?;
        println!("next: /usr/share/doc/taustream/docs/services.md, \"An arm\"");
    }
    Ok(ExitCode::SUCCESS)
}

/// Removes.
pub(crate) fn undo(arguments: &RootArguments) -> Result<ExitCode> {
    let root = &arguments.root;
    let here = is_this_machine(root);
    if here && !packages::is_root() {
        return as_root(&["uninstall".as_ref(), "--root".as_ref(), root.as_os_str()]);
    }
    if here && services_run()? {
        bail!("services are running; stop them first: systemctl disable --now 'taustream@*.target'");
    }
    let mut count = manual::remove(&root.join("usr/share"))?;
    for Item { to, .. } in items(&workspace::root()?, Path::new(""))? {
        let path = root.join(&to);
        match fs::remove_file(&path) {
            Ok(()) => count += 1,
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(e).with_context(|| format!("{} cannot be removed", path.display())),
        }
        // Folders of our own go with their last file; other files there keep them.
        for folder in to.ancestors().skip(1).take_while(|f| f.to_string_lossy().contains("taustream")) {
            if fs::remove_dir(root.join(folder)).is_err() {
                break;
            }
        }
    }
    println!("removed {count} files below {}", root.display());
    if here {
        manager(&[&["systemctl", "daemon-reload"]])?;
        println!("kept: /etc/taustream, /var/lib/taustream, user taustream, group taustream-operators");
    }
    Ok(ExitCode::SUCCESS)
}

/// A file to be installed.
struct Item {
    from: PathBuf,
    to: PathBuf,
    mode: u32,
}

/// Copies everything below `root`; how many files.
pub(crate) fn stage(source: &Path, programs: &Path, root: &Path) -> Result<usize> {
    let items = items(source, programs)?;
    for item in &items {
        place(item, &root.join(&item.to)).with_context(|| {
            format!("{} cannot be installed as {}", item.from.display(), root.join(&item.to).display())
        })?;
    }
    Ok(items.len())
}

fn items(source: &Path, programs: &Path) -> Result<Vec<Item>> {
    let item = |from: PathBuf, to: PathBuf, mode| Item { from, to, mode };
    let mut items: Vec<Item> = Vec::new();
    items.extend(PROGRAMS.map(|name| item(programs.join(name), Path::new("usr/bin").join(name), 0o755)));
    items.extend(FILES.map(|(from, to, mode)| item(source.join(from), to.into(), mode)));
    for (folder, to) in FOLDERS {
        let mut files = Vec::new();
        list(&source.join(folder), &mut files)?;
        for from in files {
            let below = from.strip_prefix(source.join(folder))?.to_owned();
            items.push(item(from, Path::new(to).join(below), 0o644));
        }
    }
    Ok(items)
}

/// Every file of a folder and its folders.
fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = fs::read_dir(folder).with_context(|| format!("{} cannot be read", folder.display()))?;
    for entry in entries {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            list(&entry.path(), files)?;
        } else {
            files.push(entry.path());
        }
    }
    Ok(())
}

/// A file is written beside its place and moved there: a program that runs continues with its old file, and no process meets
/// half a rule.
fn place(item: &Item, to: &Path) -> Result<()> {
    if let Some(folder) = to.parent() {
        DirBuilder::new().recursive(true).mode(0o755).create(folder)?;
    }
    let mut name = to.file_name().context("no name")?.to_owned();
    // sudo and systemd pass over names with such an end.
    name.push(".new~");
    let beside = to.with_file_name(name);
    fs::copy(&item.from, &beside)?;
    fs::set_permissions(&beside, Permissions::from_mode(item.mode))?;
    fs::rename(&beside, to)?;
    Ok(())
}

fn is_this_machine(root: &Path) -> bool {
    root.canonicalize().is_ok_and(|root| root == Path::new("/"))
}

/// Runs this program again as root through sudo, which asks for the password itself.
///
/// # Errors
/// When there is no sudo; with the command to run as root.
fn as_root(arguments: &[&OsStr]) -> Result<ExitCode> {
    let own = env::current_exe().context("the path of this program is unknown; is /proc mounted?")?;
    let shown: Vec<String> = arguments.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let command = format!("{} {}", own.display(), shown.join(" "));
    if !packages::exists("sudo") {
        bail!("this takes root's rights, and there is no sudo; as root: {command}");
    }
    println!("+ sudo {command}");
    let status = Command::new("sudo").arg("--").arg(&own).args(arguments).status();
    let status = status.context("sudo cannot be started")?;
    if !status.success() {
        bail!("sudo {command}: {status}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether systemd runs this machine: a container or a chroot has the programs of systemd at most.
fn has_systemd() -> bool {
    Path::new("/run/systemd/system").is_dir()
}

/// Whether systemd runs a service of ours. A machine without systemd runs none.
fn services_run() -> Result<bool> {
    if !has_systemd() {
        return Ok(false);
    }
    let status = Command::new("systemctl").args(["--quiet", "is-active", "taustream*"]).status();
    Ok(status.context("systemctl cannot be started")?.success())
}

/// Notifies systemd of changed files. A machine without systemd needs none of it.
fn manager(commands: &[&[&str]]) -> Result<()> {
    if !has_systemd() {
        println!("systemd does not run here: users, directories and units are not set up");
        return Ok(());
    }
    for words in commands {
        let (program, rest) = words.split_first().context("no program")?;
        let status = Command::new(program).args(rest).status();
        let status = status.with_context(|| format!("{program} cannot be started"))?;
        if !status.success() {
            bail!("{}: {status}", words.join(" "));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: a file that is added to the unit folder must not be forgotten in the list.
    #[test]
    fn every_file_of_the_systemd_folder_is_installed_once() {
        let source = workspace::root().unwrap();
        let mut there = Vec::new();
        list(&source.join("systemd"), &mut there).unwrap();
        let items = items(&source, Path::new("/programs")).unwrap();
        for file in &there {
            assert_eq!(items.iter().filter(|item| item.from == *file).count(), 1, "{}", file.display());
        }
        let mut places: Vec<&PathBuf> = items.iter().map(|item| &item.to).collect();
        places.sort_unstable();
        places.dedup();
        assert_eq!(places.len(), items.len(), "two files for one place");
        assert!(items.iter().all(|item| item.to.is_relative()));
    }

    #[test]
    fn installed_tree_is_removed_without_a_trace_but_of_others() {
        let root = env::temp_dir().join(format!("taustream-install-{}", std::process::id()));
        let programs = root.join("programs");
        fs::create_dir_all(&programs).unwrap();
        for name in PROGRAMS {
            fs::write(programs.join(name), name).unwrap();
        }
        let into = root.join("root");
        let count = stage(&workspace::root().unwrap(), &programs, &into).unwrap();
        assert_eq!(stage(&workspace::root().unwrap(), &programs, &into).unwrap(), count, "a second time");
        let rule = fs::metadata(into.join("etc/sudoers.d/taustream")).unwrap();
        assert_eq!(rule.permissions().mode() & 0o7777, 0o440);
        let own = into.join("usr/share/taustream/settings/own.toml");
        fs::write(&own, "").unwrap();
        undo(&RootArguments { root: into.clone() }).unwrap();
        let mut left = Vec::new();
        list(&into, &mut left).unwrap();
        assert_eq!(left, [own]);
        assert!(!into.join("usr/share/doc/taustream").exists());
        fs::remove_dir_all(root).unwrap();
    }
}
