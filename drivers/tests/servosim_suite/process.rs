//! The process: usage, commands on the standard input, signals, and a master on the local link.
use rustix::process::{Pid, Signal, kill_process};
use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use taustream_arm::{Bus, BusKind};
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::{CanFrame, CanId, FrameBatch};

const SETTINGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/settings/vcan6.toml");

/// A runtime directory of a test's own.
struct Runtime(PathBuf);

impl Runtime {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("servosim-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_taustream-servosim"));
        command.env("TAUSTREAM_RUNTIME_DIR", &self.0).env_remove("RUST_LOG").args(args);
        command
    }
}

impl Drop for Runtime {
    fn drop(&mut self) {
        let _left_behind = std::fs::remove_dir_all(&self.0);
    }
}

/// A running simulator; killed when a test fails.
struct Process {
    child: Child,
    lines: BufReader<ChildStdout>,
}

impl Process {
    fn start(runtime: &Runtime, args: &[&str]) -> Self {
        let all = [&["--settings", SETTINGS, "--link", "local"], args].concat();
        let mut command = runtime.command(&all);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap());
        let mut process = Self { child, lines };
        let ready = process.line();
        assert_eq!(ready, "taustream-servosim ready: 6 drives on local link vcan0");
        process
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        assert!(self.lines.read_line(&mut line).unwrap() > 0, "the simulator has ended");
        line.trim_end().to_owned()
    }

    fn request(&mut self, line: &str) -> String {
        writeln!(self.child.stdin.as_mut().unwrap(), "{line}").unwrap();
        self.line()
    }

    /// Ends it as a service manager would; its exit code.
    fn terminate(mut self) -> Option<i32> {
        kill_process(Pid::from_child(&self.child), Signal::TERM).unwrap();
        self.child.wait().unwrap().code()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _has_ended = self.child.kill();
        let _is_reaped = self.child.wait();
    }
}

#[test]
fn bad_usage_ends_with_2_and_one_sentence() {
    let runtime = Runtime::new("usage");
    for (args, words) in [
        (&["--settings", "nowhere"][..], "nowhere"),
        (&["--settings", SETTINGS, "--fault", "joint=9,kind=stuck"], "joint=9 is no joint of this arm"),
        (&["--settings", SETTINGS, "--fault", "kind=stuck"], "joint is missing"),
        (&["--settings", SETTINGS, "--start-rad", "1,2"], "--start-rad has 2 angles; ur5 has 6 joints"),
        (
            &["--settings", SETTINGS, "--start-rad", "0,0,9,0,0,0"],
            "\"9\" for elbow: expected -3.1416 to 3.1416 rad",
        ),
        (&["--settings", SETTINGS, "--start-rad", "0,0,nan,0,0,0"], "\"nan\" for elbow"),
        (&["--settings", SETTINGS, "--link", "pigeon"], "pigeon"),
        (&[], "--settings"),
    ] {
        let Output { status, stderr, stdout } = runtime.command(args).output().unwrap();
        let stderr = String::from_utf8_lossy(&stderr);
        assert_eq!(status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains(words), "{args:?}: {stderr}");
        assert!(stdout.is_empty(), "{args:?}");
    }
    let help = runtime.command(&["--help"]).output().unwrap();
    let help = String::from_utf8_lossy(&help.stdout).into_owned();
    for words in ["silence", "restart", "Examples:", "[simulator]", "Exit status"] {
        assert!(help.contains(words), "--help does not say {words}");
    }
}

#[test]
fn fault_requests_are_acknowledged_and_their_end_does_not_end_the_simulator() {
    let runtime = Runtime::new("orders");
    let mut process = Process::start(&runtime, &["--start-rad", "0.5,-1.57,1.57,-1.57,-1.57,0"]);
    assert_eq!(
        process.request("fault joint=elbow,kind=delay,value=3,after=moving"),
        "ok: delay of 3.0 ms of elbow is ordered"
    );
    assert!(process.request("fault joint=elbow").starts_with("error: kind is missing"));
    assert!(process.request("dance").starts_with("error: unknown order \"dance\""));
    assert!(process.request(&"x".repeat(5000)).starts_with("error: a line of 5001 bytes"));
    assert_eq!(process.request("clear"), "ok: cleared");
    let status = process.request("status");
    assert!(
        status.starts_with("status joint=shoulder_pan node=1 position_rad=0.5 velocity_rad_s=0 "),
        "{status}"
    );
    for _ in 1..6 {
        assert!(process.line().starts_with("status joint="));
    }
    assert_eq!(process.line(), "ok: status");
    assert_eq!(process.request("fault joint=1,kind=warning"), "ok: warning of shoulder_pan is ordered");
    assert_eq!(process.line(), "fault begins: warning of shoulder_pan");
    drop(process.child.stdin.take());
    std::thread::sleep(std::time::Duration::from_millis(50));
    assert!(process.child.try_wait().unwrap().is_none(), "ended with its standard input");
    assert_eq!(process.terminate(), Some(0));
}

#[test]
fn second_simulator_on_one_link_is_refused() {
    let runtime = Runtime::new("second");
    let process = Process::start(&runtime, &[]);
    let second = runtime.command(&["--settings", SETTINGS, "--link", "local"]).output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    let stderr = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(stderr.contains("already has simulated servos"), "{stderr}");
    assert_eq!(process.terminate(), Some(0));
}

#[test]
fn master_on_the_local_link_is_answered_by_all_six_drives() {
    let runtime = Runtime::new("master");
    let process = Process::start(&runtime, &[]);
    let bus = Bus::new("arm", "vcan0", BusKind::Virtual);
    let mut master = link::open(&bus, LinkChoice::Local, LinkRole::Master, &runtime.0).unwrap();
    let mut answered = [false; 6];
    let mut batch = FrameBatch::new();
    // Asked again until all have booted and answered; a drive that never does fails the test by its number.
    for _ in 0..200 {
        let requests: Vec<CanFrame> = (1..=6)
            .map(|node| CanFrame::classic(CanId::standard(0x600 + node), &[0x40, 0, 0x10, 0, 0, 0, 0, 0]))
            .collect();
        assert_eq!(master.send(&requests).count, 6);
        std::thread::sleep(std::time::Duration::from_millis(10));
        assert_eq!(master.receive(&mut batch), None);
        for frame in batch.frames() {
            let id = frame.id().as_standard_data().unwrap();
            if (0x581..=0x586).contains(&id) {
                assert_eq!(frame.data(), [0x43, 0, 0x10, 0, 0x92, 0x01, 0x02, 0x00]);
                answered[usize::from(id - 0x581)] = true;
            }
        }
        if answered == [true; 6] {
            break;
        }
    }
    assert_eq!(answered, [true; 6]);
    assert_eq!(process.terminate(), Some(0));
}
