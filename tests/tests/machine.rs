//! The vcan machine keeps its promises. Boots it several times (2 to 6 s each), so plain `cargo test` leaves this out:
//! `cargo test -p taustream-tests --test machine`.
#![expect(clippy::panic, clippy::unwrap_used, reason = "a test ends by panicking")]
use rustix::process::{Pid, Signal, kill_process};
use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// A machine with its scratch directories in a folder of this test, so that what stays behind is seen.
struct MachineDirs {
    folder: PathBuf,
}

impl MachineDirs {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("tau-lab-{}-{name}", std::process::id()));
        std::fs::create_dir(&folder).unwrap();
        Self { folder }
    }
    fn command(&self, options: &[&str], words: &[&OsStr]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vcan-machine"));
        command.env("TMPDIR", &self.folder).args(options).arg("--").args(words);
        command
    }
    fn run(&self, options: &[&str], script: &str) -> Output {
        let output =
            self.command(options, &["bash".as_ref(), "-c".as_ref(), script.as_ref()]).output().unwrap();
        self.assert_clean();
        output
    }
    fn assert_clean(&self) {
        let left: Vec<_> =
            std::fs::read_dir(&self.folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(
            left.iter().all(|path| !path.to_string_lossy().contains("vcan-machine")),
            "left behind: {left:?}"
        );
    }
}

impl Drop for MachineDirs {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Goal: status, both outputs, words and environment arrive unchanged; the kernel is named first; CAN is there and up.
#[test]
fn machine_hands_everything_through() {
    let dirs = MachineDirs::new("through");
    let words = ["a b", "", "it's", "$HOME *", "line\nbreak", "back\\slash", "\u{fc}"];
    let script = r#"printf '<%s>' "$@"; printf '[%s]' "$STRANGE"; head -c 300000 /dev/zero | tr '\0' '\377'
        [ "$TAUSTREAM_VCAN" = 1 ] || exit 2; candump -n1 -T2000 vcan1 >&2 & sleep 0.3; cansend vcan1 123##1AABB; wait
        exit 37"#;
    let mut all: Vec<&OsStr> = vec!["bash".as_ref(), "-c".as_ref(), script.as_ref(), "name".as_ref()];
    all.extend(words.iter().map(OsStr::new));
    let strange = OsStr::from_bytes(b"quote ' and \xFF and \n end");
    let output = dirs.command(&["--limit-s", "30"], &all).env("STRANGE", strange).output().unwrap();
    dirs.assert_clean();
    assert_eq!(output.status.code(), Some(37), "{}", text(&output.stderr));
    let mut expected: Vec<u8> = words.iter().flat_map(|word| format!("<{word}>").into_bytes()).collect();
    expected.push(b'[');
    expected.extend_from_slice(strange.as_bytes());
    expected.push(b']');
    expected.extend(std::iter::repeat_n(0xFF, 300_000));
    assert!(output.stdout == expected, "stdout differs: {} of {} bytes", output.stdout.len(), expected.len());
    let errors = text(&output.stderr);
    assert!(errors.starts_with("vcan-machine: guest kernel "), "{errors}");
    assert!(errors.contains("AA BB"), "no CAN FD frame was seen: {errors}");
}

/// Goal: the guest sees the host's files; only a directory named writable takes its changes.
#[test]
fn machine_writes_only_where_it_may() {
    let dirs = MachineDirs::new("writes");
    let (open, shut) = (dirs.folder.join("open, or not"), dirs.folder.join("shut"));
    for folder in [&open, &shut] {
        std::fs::create_dir(folder).unwrap();
        std::fs::write(folder.join("old"), "host").unwrap();
    }
    // A comma cannot be part of a mount option: refused before anything boots.
    let refused = dirs.run(&["--writable", open.to_str().unwrap()], "true");
    assert_eq!(refused.status.code(), Some(125));
    assert!(text(&refused.stderr).contains("comma"), "{}", text(&refused.stderr));
    let renamed = dirs.folder.join("open to all");
    std::fs::rename(&open, &renamed).unwrap();
    let script = format!(
        "for d in '{}' '{}'; do grep -q host \"$d/old\" || exit 2; echo guest > \"$d/new\" && rm \"$d/old\" || exit 3; done",
        renamed.display(),
        shut.display()
    );
    let output = dirs.run(&["--writable", renamed.to_str().unwrap(), "--interfaces", "0"], &script);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let names = |folder: &PathBuf| -> BTreeSet<OsString> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    };
    assert_eq!(names(&renamed), BTreeSet::from(["new".into()]));
    assert_eq!(names(&shut), BTreeSet::from(["old".into()]));
}

/// Goal: a command that does not end is ended, and says so by its status.
#[test]
fn machine_command_out_of_time_ends_with_124() {
    let dirs = MachineDirs::new("time");
    let output = dirs.run(&["--limit-s", "2"], "echo begun; sleep 1000");
    assert_eq!((output.status.code(), text(&output.stdout)), (Some(124), "begun\n".into()));
}

/// Goal: a machine whose output is closed ends early, by itself.
#[test]
fn machine_whose_reader_has_gone_ends() {
    let dirs = MachineDirs::new("unread");
    let words = ["bash".as_ref(), "-c".as_ref(), "while echo more; do sleep 0.1; done".as_ref()];
    let mut machine = dirs.command(&["--limit-s", "100"], &words).stdout(Stdio::piped()).spawn().unwrap();
    drop(machine.stdout.take());
    assert_eq!(machine.wait().unwrap().code(), Some(125));
    dirs.assert_clean();
}

/// Goal: a process left behind by the command does not keep the machine, and the command's status stands.
#[test]
fn machine_daemon_left_behind_does_not_hold_it() {
    let dirs = MachineDirs::new("daemon");
    let output = dirs.run(&["--limit-s", "30"], "setsid sleep 1000 & exit 5");
    assert_eq!(output.status.code(), Some(5), "{}", text(&output.stderr));
}

/// Goal: SIGTERM ends the machine with all its processes, and removes what it made.
#[test]
fn machine_ended_on_request_leaves_nothing() {
    let dirs = MachineDirs::new("term");
    let words = ["bash".as_ref(), "-c".as_ref(), "sleep 1000".as_ref()];
    let mut machine = dirs.command(&["--limit-s", "100"], &words).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(2500));
    assert!(
        !processes_naming(&dirs.folder).is_empty(),
        "no linux.uml was seen: this test would prove nothing"
    );
    let pid = Pid::from_raw(i32::try_from(machine.id()).unwrap()).unwrap();
    kill_process(pid, Signal::TERM).unwrap();
    assert_eq!(machine.wait().unwrap().code(), Some(143));
    dirs.assert_clean();
    assert_eq!(processes_naming(&dirs.folder), Vec::<u32>::new(), "still running");
}

/// Processes whose command line holds a path (linux.uml gets its directories there).
fn processes_naming(folder: &std::path::Path) -> Vec<u32> {
    let needle = folder.as_os_str().as_bytes();
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Some(pid) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        let line = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        if line.windows(needle.len()).any(|window| window == needle) {
            found.push(pid);
        }
    }
    found
}
