//! `taustream watch` beside a streamer that the test plays: nothing moves, reports come as a real one sends them.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
use crate::common::Scratch;
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use taustream_messages::service::Wire;
use taustream_messages::{FaultReason, LAYOUT_VERSION, Phase, Report};

/// A streamer as readers of reports see one.
struct Played {
    end: Arc<AtomicBool>,
    mute: Arc<AtomicBool>,
    fault: Arc<AtomicU32>,
    thread: Option<JoinHandle<()>>,
}

impl Played {
    fn start(arm: &str, runtime: PathBuf) -> Self {
        let (end, mute, fault) = <(Arc<AtomicBool>, Arc<AtomicBool>, Arc<AtomicU32>)>::default();
        let thread = thread::spawn({
            let (arm, end, mute, fault) = (arm.to_owned(), end.clone(), mute.clone(), fault.clone());
            move || {
                let wire = Wire::join(&arm, "played", &runtime).expect("joins");
                let publisher = wire.report_publisher().expect("the one publisher");
                let mut sequence = 0;
                while !end.load(Ordering::SeqCst) {
                    if !mute.load(Ordering::SeqCst) {
                        sequence += 1;
                        publisher.send_copy(report(sequence, fault.load(Ordering::SeqCst))).expect("sent");
                    }
                    thread::sleep(Duration::from_millis(10));
                }
            }
        });
        Self { end, mute, fault, thread: Some(thread) }
    }
}

impl Drop for Played {
    fn drop(&mut self) {
        self.end.store(true, Ordering::SeqCst);
        let _ended = self.thread.take().map(JoinHandle::join);
    }
}

fn report(sequence: u64, fault_reason: u32) -> Report {
    Report {
        layout_version: LAYOUT_VERSION,
        joint_count: 6,
        sequence,
        // The streamer's clock, 100 reports a second.
        time_ns: 5_000_000_000 + sequence * 10_000_000,
        phase: if fault_reason == 0 { Phase::Moving.code() } else { Phase::Fault.code() },
        fault_reason,
        fault_joint: 2,
        fault_value: 0.12,
        fault_limit: 0.05,
        trajectory_id: 9,
        trajectory_s: 1.0,
        trajectory_duration_s: 4.0,
        sigma: 1.0,
        speed_percent: 25.0,
        energised: 1,
        ..Report::default()
    }
}

/// A directory, an arm's settings and its played streamer.
struct Stage {
    scratch: Scratch,
    runtime: PathBuf,
    played: Option<Played>,
}

impl Stage {
    fn new(name: &str) -> Self {
        let mut stage = Self::empty(name);
        stage.played = Some(Played::start(&stage.arm(name), stage.runtime.clone()));
        stage
    }

    /// Without a serving process.
    fn empty(name: &str) -> Self {
        let scratch = Scratch::new();
        let runtime = scratch.dir.join("run");
        std::fs::create_dir_all(&runtime).expect("a runtime directory");
        let stage = Self { scratch, runtime, played: None };
        stage.scratch.settings(&stage.arm(name));
        stage
    }

    fn arm(&self, name: &str) -> String {
        format!("watch-{name}-{}", std::process::id())
    }

    fn command(&self, words: &str) -> Command {
        let mut command = self.scratch.command(&words.split(' ').collect::<Vec<_>>());
        command.env("TAUSTREAM_RUNTIME_DIR", &self.runtime);
        command
    }

    fn start(&self, words: &str) -> (Child, BufReader<ChildStdout>) {
        let mut child =
            self.command(words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts");
        let out = BufReader::new(child.stdout.take().expect("a pipe"));
        (child, out)
    }
}

/// The next line, as JSON.
fn next(out: &mut impl BufRead) -> serde_json::Value {
    let mut line = String::new();
    out.read_line(&mut line).expect("a line");
    serde_json::from_str(&line).unwrap_or_else(|e| panic!("{e}: {line:?}"))
}

#[test]
fn watch_streams_every_report_as_one_json_line_like_status() {
    let stage = Stage::new("json");
    let ran = stage.command("watch --settings settings.toml --json --count 20").output().unwrap();
    assert_eq!(ran.status.code(), Some(0), "{}", String::from_utf8_lossy(&ran.stderr));
    let text = String::from_utf8(ran.stdout).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|l| serde_json::from_str(l).expect("JSON")).collect();
    assert_eq!(lines.len(), 20);
    let sequences: Vec<u64> = lines.iter().filter_map(|l| l["sequence"].as_u64()).collect();
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0] + 1), "{sequences:?}");
    assert_eq!(lines[0]["phase"], "moving");
    assert_eq!(lines[0]["joints"].as_array().map(Vec::len), Some(6));
}

#[test]
fn watch_thins_reports_to_the_rate_by_the_streamers_clock() {
    let stage = Stage::new("rate");
    let ran = stage.command("watch --settings settings.toml --json --count 4 --rate-hz 20").output().unwrap();
    let text = String::from_utf8(ran.stdout).unwrap();
    let times: Vec<u64> = text
        .lines()
        .map(|l| {
            serde_json::from_str::<serde_json::Value>(l).expect("JSON")["time_ns"].as_u64().expect("a time")
        })
        .collect();
    assert_eq!(times.len(), 4);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] >= 50_000_000), "{times:?}");
}

#[test]
fn watch_into_a_file_is_lines_without_colour_that_say_a_fault_in_words() {
    let stage = Stage::new("lines");
    stage.played.as_ref().unwrap().fault.store(FaultReason::TrackingError.code(), Ordering::SeqCst);
    let ran = stage.command("watch --settings settings.toml --rate-hz 100 --count 3").output().unwrap();
    let text = String::from_utf8(ran.stdout).unwrap();
    assert_eq!(text.lines().count(), 3, "{text}");
    assert!(
        text.contains("FAULT: tracking error (rad) at joint 3 `elbow`: 0.120000 against 0.050000"),
        "{text}"
    );
    assert!(!text.contains('\u{1b}'), "escapes in a file: {text:?}");
}

#[test]
fn watch_says_that_the_streamer_has_gone_waits_and_goes_on() {
    let mut stage = Stage::new("gone");
    let (mut child, mut out) = stage.start("watch --settings settings.toml --json --rate-hz 10");
    assert_eq!(next(&mut out)["phase"], "moving");
    stage.played.as_ref().unwrap().mute.store(true, Ordering::SeqCst);
    let gone = loop {
        let line = next(&mut out);
        if line["phase"].is_null() {
            break line;
        }
    };
    assert!(gone["message"].as_str().unwrap().contains("taustream-streamer have ended"), "{gone}");
    assert!(gone["silent_s"].as_f64().unwrap() >= 2.0, "{gone}");
    // Another one takes over, as after a restart: it counts from 0 again.
    let arm = stage.arm("gone");
    stage.played = None;
    stage.played = Some(Played::start(&arm, stage.runtime.clone()));
    assert_eq!(next(&mut out)["phase"], "moving");
    drop(out);
    assert_eq!(child.wait().unwrap().code(), Some(0), "a closed pipe ends it quietly");
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    assert_eq!(err, "", "nobody is left to tell");
}

#[test]
fn watch_ends_well_on_ctrl_c() {
    let stage = Stage::new("int");
    let (mut child, mut out) = stage.start("watch --settings settings.toml --json");
    assert_eq!(next(&mut out)["phase"], "moving");
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert!(rest.is_empty() || rest.ends_with('\n'), "half a line: {rest:?}");
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

/// Goal: the picture as people see it, and a terminal that is as it was. Method: `script` makes a terminal of a pipe.
#[test]
fn watch_on_a_terminal_draws_in_colour_and_leaves_on_q() {
    let stage = Stage::new("tty");
    let picture = |colour: &str| {
        let program = env!("CARGO_BIN_EXE_taustream");
        let typed = format!("stty cols 120 rows 30; exec '{program}' watch --settings settings.toml");
        let mut script = stage.scratch.program("script", &["-qec", &typed, "/dev/null"]);
        script
            .env("TAUSTREAM_RUNTIME_DIR", &stage.runtime)
            .env("TERM", "xterm-256color")
            .env("NO_COLOR", colour);
        let mut child = script.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut seen = Vec::new();
        // The second picture has rates in it, which need a first one.
        while !String::from_utf8_lossy(&seen).contains("a second") {
            assert!(out.read_until(b'\n', &mut seen).unwrap() > 0, "{}", String::from_utf8_lossy(&seen));
        }
        child.stdin.as_mut().unwrap().write_all(b"q").unwrap();
        out.read_to_end(&mut seen).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{}", String::from_utf8_lossy(&seen));
        String::from_utf8_lossy(&seen).into_owned()
    };
    let coloured = picture("");
    for word in ["MOVING", "shoulder_pan", "in its range", "1.00 of 4.00 s", "q ends"] {
        assert!(coloured.contains(word), "no `{word}`: {coloured:?}");
    }
    assert!(
        coloured.contains("\u{1b}[?1049h") && coloured.contains("\u{1b}[?1049l"),
        "not set back: {coloured:?}"
    );
    assert!(coloured.contains("\u{1b}[38;5;10m"), "no green: {coloured:?}");
    assert!(!picture("1").contains("\u{1b}[38;"), "NO_COLOR, and coloured");
}

#[test]
fn watch_of_nobody_waits_and_says_so_when_the_time_is_over() {
    let stage = Stage::empty("nobody");
    let ran = stage.command("watch --settings settings.toml --seconds 0.1").output().unwrap();
    let err = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert_eq!(ran.status.code(), Some(1), "{err}");
    assert!(err.contains("is not running") && err.contains("start taustream-streamer"), "{err}");
    for words in ["watch --rate-hz 0", "watch --rate-hz nan", "watch --count 0", "watch --seconds -1"] {
        let option = words.split(' ').nth(1).unwrap_or_default();
        let ran = stage.command(words).output().unwrap();
        let err = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert_eq!(ran.status.code(), Some(2), "{words}: {err}");
        assert!(err.contains(option), "{words}: {err}");
    }
}
