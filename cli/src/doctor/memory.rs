//! Swap, shared memory, and the directory where the processes meet.
use super::finding::Finding;
use super::subject::{COMM_MAX, Subject};
use super::tree::shown;
use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;

/// The services of one arm take below 16 MiB; twice that leaves room for a second one.
const SHM_FREE_MIN: u64 = 32 << 20;
/// Names that iceoryx2 files of ours begin with: prefix, user, arm.
const PREFIX: &str = "taustream.";
/// Programs that use shared memory, as the kernel cuts their names.
const PROGRAMS: [&str; 3] = ["taustream-streamer", "taustream-planner", "taustream"];

pub(crate) fn examine(s: &Subject) -> Vec<Finding> {
    vec![swap(s), shared_memory(s), stale_segments(s), runtime_directory(s), lasting_names(s)]
}

fn swap(s: &Subject) -> Finding {
    const NAME: &str = "swap";
    match s.tree.text("proc/swaps") {
        None => Finding::unknown(NAME, "/proc/swaps cannot be read"),
        Some(text) if text.lines().count() <= 1 => Finding::ok(NAME, "none"),
        Some(text) => {
            let first = text.lines().nth(1).and_then(|l| l.split_whitespace().next()).unwrap_or_default();
            Finding::warning(
                NAME,
                format!(
                    "{}: the streamer locks its memory, but the rest of the computer may stall",
                    shown(first)
                ),
                "swapoff --all, and take it out of /etc/fstab",
            )
        }
    }
}

fn shared_memory(s: &Subject) -> Finding {
    const NAME: &str = "/dev/shm";
    match s.shm_free {
        None => Finding::unknown(NAME, "its size is not readable"),
        Some(bytes) if bytes < SHM_FREE_MIN => Finding::problem(
            NAME,
            format!("{} MiB free; the services of an arm want {} MiB", bytes >> 20, SHM_FREE_MIN >> 20),
            "remove what is not needed there, or: mount -o remount,size=256M /dev/shm",
        ),
        Some(bytes) => Finding::ok(NAME, format!("{} MiB free", bytes >> 20)),
    }
}

/// Files that processes left which ended without cleaning up.
fn stale_segments(s: &Subject) -> Finding {
    const NAME: &str = "stale segments";
    let own = std::process::id();
    let is_ours = |name: &str| PROGRAMS.iter().any(|p| p.get(..COMM_MAX).unwrap_or(p) == name);
    let running = s.processes().any(|(pid, name)| pid != own && is_ours(&name));
    // "taustream.UID.ARM.": a user, and the name of an arm.
    let owner = |name: String| {
        let mut words = name.strip_prefix(PREFIX)?.splitn(3, '.');
        Some(format!("{PREFIX}{}.{}.", words.next()?, words.next()?))
    };
    let owners: BTreeSet<String> = s.tree.names("dev/shm").into_iter().filter_map(owner).collect();
    if owners.is_empty() {
        return Finding::ok(NAME, "none");
    }
    if running {
        return Finding::ok(NAME, "not checked: taustream is running, and its segments are in use");
    }
    let list: Vec<String> = owners.iter().take(4).map(|o| shown(o)).collect();
    let more = if owners.len() > list.len() { ", .." } else { "" };
    Finding::warning(
        NAME,
        format!("no process runs, but there are files of {}{more}", list.join(", ")),
        "the next start removes its own; to remove all of them while nothing runs: rm /dev/shm/taustream.*",
    )
}

fn runtime_directory(s: &Subject) -> Finding {
    const NAME: &str = "runtime directory";
    let Ok(metadata) = s.tree.path(&s.runtime).symlink_metadata() else {
        return Finding::ok(NAME, format!("{} will be made at the first start", s.runtime));
    };
    let remedy = format!("remove {}, or set TAUSTREAM_RUNTIME_DIR to a directory of your own", s.runtime);
    if !metadata.is_dir() {
        return Finding::problem(NAME, format!("{} is no directory", s.runtime), remedy);
    }
    if metadata.uid() != s.uid {
        let what = format!("{} belongs to uid {}, and this is uid {}", s.runtime, metadata.uid(), s.uid);
        // Services of that user may run there: it is not to be removed.
        return Finding::problem(
            NAME,
            what,
            "act as that user, or set TAUSTREAM_RUNTIME_DIR to a directory of your own",
        );
    }
    let mode = metadata.mode() & 0o7777;
    if mode & 0o077 != 0 {
        return Finding::problem(
            NAME,
            format!("{} has mode {mode:04o}: others may get at the arm's sockets", s.runtime),
            format!("chmod 0700 {}", s.runtime),
        );
    }
    Finding::ok(NAME, format!("{} belongs to uid {} alone", s.runtime, s.uid))
}

/// What deletes the files of running services behind their back.
fn lasting_names(s: &Subject) -> Finding {
    const NAME: &str = "files of services";
    if s.uid >= LOGIN_UID_MIN && s.tree.has("run/systemd/system") && removes_ipc(s) {
        return Finding::warning(
            NAME,
            format!(
                "logind deletes the segments of uid {} at its last logout (RemoveIPC=yes): commands then fail until the services are open again",
                s.uid
            ),
            "run the services as a system user, or: loginctl enable-linger, or RemoveIPC=no in /etc/systemd/logind.conf",
        );
    }
    if ["/tmp/", "tmp/", "/var/tmp/", "var/tmp/"].iter().any(|start| s.runtime.starts_with(start)) {
        return Finding::warning(
            NAME,
            format!(
                "{}: cleaners of /tmp delete what is old, sockets and locks of running services too",
                s.runtime
            ),
            "set TAUSTREAM_RUNTIME_DIR to a directory below /run, or log in by logind, which makes /run/user/UID",
        );
    }
    Finding::ok(NAME, "nothing is known to delete them")
}

/// Users from here on log in; logind spares those below.
const LOGIN_UID_MIN: u32 = 1000;

/// Whether logind removes what a user left in shared memory: its default, unless a configuration says otherwise. The last one
/// that is read counts: drop-ins by their names, after the main file.
fn removes_ipc(s: &Subject) -> bool {
    let mut files = vec!["etc/systemd/logind.conf".to_owned()];
    let mut names: Vec<String> =
        ["usr/lib/systemd/logind.conf.d", "run/systemd/logind.conf.d", "etc/systemd/logind.conf.d"]
            .iter()
            .flat_map(|folder| s.tree.names(folder).into_iter().map(move |name| format!("{folder}/{name}")))
            .collect();
    names.sort_by(|a, b| a.rsplit('/').next().cmp(&b.rsplit('/').next()));
    files.extend(names);
    let setting = |line: &str| {
        let (key, value) = line.split_once('=')?;
        (key.trim() == "RemoveIPC").then(|| !["no", "false", "off", "0"].contains(&value.trim()))
    };
    let texts = files.iter().filter_map(|file| s.tree.text(file));
    texts.flat_map(|text| text.lines().filter_map(setting).collect::<Vec<_>>()).last().unwrap_or(true)
}
