//! A real streamer process with simulated drives beside it, under a runtime directory of its own.
use rustix::process::{Pid, Signal, kill_process};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Program, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use taustream_arm::Settings;
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::sim::serve::serve;
use taustream_drivers::sim::settings::{drives, queue_frames};
use taustream_drivers::sim::{LinkedSimulator, ServoSimulator};
use taustream_messages::operator::{abstract_name, read_answer, socket_file};
use taustream_messages::service::Wire;
use taustream_messages::{
    CheckedTrajectory, Command, CommandReply, CommandRequest, Outcome, Phase, Replaces, Report,
    TrajectoryMessage,
};
use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};

const HOME_RAD: [f64; 6] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
/// Whatever hangs is found out by this; nothing is measured by it.
pub(crate) const GIVEN_UP_AFTER: Duration = Duration::from_secs(60);

static NEXT: AtomicU32 = AtomicU32::new(0);

/// An arm that nobody else has: its directories, its settings, its drives.
pub(crate) struct Arm {
    pub(crate) name: String,
    pub(crate) root: PathBuf,
    pub(crate) runtime: PathBuf,
    pub(crate) settings: Settings,
    file: PathBuf,
    stop: Arc<AtomicBool>,
    drives: Option<JoinHandle<()>>,
}

impl Arm {
    pub(crate) fn new(stem: &str) -> Self {
        let name = format!("{stem}-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let root = std::env::temp_dir().join(format!("taustream-{name}"));
        let runtime = root.join("run");
        fs::create_dir_all(&runtime).unwrap();
        fs::set_permissions(&runtime, std::os::unix::fs::PermissionsExt::from_mode(0o700)).unwrap();
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config").canonicalize().unwrap();
        let text = fs::read_to_string(config.join("settings/vcan6.toml")).unwrap();
        let line = |line: &str| {
            let key = line.split('=').next().unwrap_or_default().trim();
            match key {
                "name" if line.contains("\"vcan6\"") => format!("name = \"{name}\""),
                "period_us" => "period_us = 2000".to_owned(),
                "drive_watchdog_ms" | "watchdog_ms" => format!("{key} = 1000"),
                "stall_resume_ms" => "stall_resume_ms = 500".to_owned(),
                "feedback_age_s_max" => "feedback_age_s_max = 0.4".to_owned(),
                _ => line
                    .replace("\"../", &format!("\"{}/", config.display()))
                    .replace("scenes/pillars", "scenes/open"),
            }
        };
        let text: Vec<String> = text.lines().map(line).collect();
        let file = root.join("settings.toml");
        fs::write(&file, text.join("\n")).unwrap();
        let settings = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
        let mut arm = Self { name, root, runtime, settings, file, stop: Arc::default(), drives: None };
        arm.start_drives();
        arm
    }

    /// Drives on their end of the links, in this process.
    fn start_drives(&mut self) {
        let (settings, runtime, stop) = (self.settings.clone(), self.runtime.clone(), Arc::clone(&self.stop));
        let (ready, is_ready) = std::sync::mpsc::channel();
        self.drives = Some(thread::spawn(move || {
            let setups = drives(&settings, Some(&HOME_RAD)).unwrap_or_else(|faults| panic!("{faults}"));
            let simulator = ServoSimulator::new(setups, settings.buses.len(), 1);
            let queue = queue_frames(&settings).unwrap_or_else(|faults| panic!("{faults}"));
            let simulator = LinkedSimulator::new(simulator, &settings.buses, queue);
            let open = |bus| link::open(bus, LinkChoice::Local, LinkRole::Servos, &runtime).unwrap();
            let links = settings.buses.iter().map(open).collect();
            ready.send(()).unwrap();
            serve(links, simulator, None, &stop).unwrap();
        }));
        is_ready.recv().unwrap();
    }

    /// Starts a streamer and waits until it is ready.
    pub(crate) fn streamer(&self, words: &[&str], stderr: Stdio) -> Streamer {
        let mut child = Program::new(env!("CARGO_BIN_EXE_taustream-streamer"))
            .args([
                "--settings",
                self.file.to_str().unwrap(),
                "--link",
                "local",
                "--allow-non-realtime",
                "--state-dir",
            ])
            .arg(self.root.join("state"))
            .args(words)
            .env("TAUSTREAM_RUNTIME_DIR", &self.runtime)
            .env_remove("NOTIFY_SOCKET")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(stderr)
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdout.read_line(&mut line).unwrap();
        let streamer = Streamer { child, _stdout: stdout.into_inner() };
        assert!(line.contains("ready"), "the streamer did not start: {line:?}");
        streamer
    }

    pub(crate) fn join(&self) -> Wire {
        Wire::join(&self.name, "test", &self.runtime).unwrap()
    }

    /// Segments of this arm.
    pub(crate) fn segments(&self) -> Vec<PathBuf> {
        let mine = format!(".{}.", self.name);
        let entries = fs::read_dir("/dev/shm").unwrap().flatten();
        entries.filter(|e| e.file_name().to_string_lossy().contains(&mine)).map(|e| e.path()).collect()
    }

    /// One line by the streamer's own socket: by its file, or by its abstract name.
    pub(crate) fn by_socket(&self, request: &str, by_name: bool) -> CommandReply {
        self.try_by_socket(request, by_name).unwrap_or_else(|| panic!("no answer to {request:?}"))
    }

    /// The same; `None` for a client that is turned away.
    pub(crate) fn try_by_socket(&self, request: &str, by_name: bool) -> Option<CommandReply> {
        let uid = rustix::process::geteuid().as_raw();
        let stream = if by_name {
            SocketAddr::from_abstract_name(abstract_name(&self.name, uid))
                .and_then(|address| UnixStream::connect_addr(&address))
        } else {
            UnixStream::connect(socket_file(&self.name, &self.runtime))
        };
        let mut stream = stream.unwrap();
        stream.set_read_timeout(Some(GIVEN_UP_AFTER)).unwrap();
        stream.write_all(format!("{request}\n").as_bytes()).ok()?;
        let mut line = String::new();
        stream.read_to_string(&mut line).ok()?;
        read_answer(&line)
    }

    pub(crate) fn until_phase_by_socket(&self, phase: Phase) {
        let since = Instant::now();
        while self.by_socket("phase", true).phase() != Some(phase) {
            assert!(since.elapsed() < GIVEN_UP_AFTER, "the arm never was {phase:?}");
            thread::sleep(Duration::from_millis(20));
        }
    }
}

impl Drop for Arm {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _panicked = self.drives.take().map(JoinHandle::join);
        for segment in self.segments() {
            let _left = fs::remove_file(segment);
        }
        let _left = fs::remove_dir_all(&self.root);
    }
}

/// A streamer process; killed when dropped.
pub(crate) struct Streamer {
    child: Child,
    _stdout: std::process::ChildStdout,
}

impl Streamer {
    pub(crate) fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(i32::try_from(self.child.id()).unwrap()).unwrap();
        kill_process(pid, signal).unwrap();
    }

    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    pub(crate) fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }
}

impl Drop for Streamer {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _gone = self.child.wait();
    }
}

/// A command line's ports.
pub(crate) struct Operator {
    generation: u64,
    wire: Wire,
}

impl Operator {
    pub(crate) fn of(arm: &Arm) -> Self {
        Self { generation: 0, wire: arm.join() }
    }

    /// The answer to a command; `None` when the sender gave up after `valid_for`.
    pub(crate) fn try_command(&self, command: Command, valid_for: Duration) -> Option<CommandReply> {
        let client = self.wire.command_client().unwrap();
        let pending = client.send_copy(CommandRequest::new(command, valid_for)).unwrap();
        let since = Instant::now();
        while since.elapsed() < valid_for {
            if let Some(reply) = pending.receive().unwrap() {
                return Some(*reply.payload());
            }
            thread::sleep(Duration::from_millis(1));
        }
        None
    }

    pub(crate) fn command(&self, command: Command) -> CommandReply {
        self.try_command(command, GIVEN_UP_AFTER).unwrap_or_else(|| panic!("no answer to {command:?}"))
    }

    /// A report that was written after this call.
    pub(crate) fn report(&self) -> Report {
        let reports = self.wire.report_subscriber().unwrap();
        let since = Instant::now();
        loop {
            if let Some(report) = reports.receive().unwrap() {
                return *report.payload();
            }
            assert!(since.elapsed() < GIVEN_UP_AFTER, "no report");
            thread::sleep(Duration::from_millis(2));
        }
    }

    pub(crate) fn phase(&self) -> Phase {
        Phase::from_code(self.report().phase).unwrap()
    }

    pub(crate) fn until(&self, phase: Phase) {
        let since = Instant::now();
        while self.phase() != phase {
            assert!(since.elapsed() < GIVEN_UP_AFTER, "{:?} instead of {phase:?}", self.phase());
        }
    }

    pub(crate) fn enable(&self) {
        self.until(Phase::Disabled);
        let since = Instant::now();
        // Its speeds may still be unknown.
        while !self.command(Command::Enable).is_accepted() {
            assert!(since.elapsed() < GIVEN_UP_AFTER, "never enabled");
        }
        self.until(Phase::Holding);
    }

    /// What became of a motion under a generation, sent by somebody who waits for so long.
    pub(crate) fn send(&self, arm: &Arm, generation: u64, valid_for: Duration) -> Outcome {
        let mut base_rad = [0.0; MAX_JOINTS];
        base_rad[..6].copy_from_slice(&self.report().command_rad[..6]);
        let size = if base_rad[0] > 0.5 { -1.2 } else { 1.2 };
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad[0] = size;
        let stroke = Stroke { start_s: 0.0, duration_s: 20.0, n: 6, delta_rad };
        let message = TrajectoryMessage::new(&CheckedTrajectory {
            trajectory_id: 1 + (generation & 0xffff),
            generation,
            robot_digest: arm.settings.robot.message_digest,
            replaces: Replaces::Rest,
            trajectory: Trajectory::new(6, base_rad, &[stroke]).unwrap(),
        });
        let (receipts, sender) =
            (self.wire.receipt_subscriber().unwrap(), self.wire.trajectory_publisher().unwrap());
        sender.send_copy(*message.valid_for(valid_for)).unwrap();
        let since = Instant::now();
        loop {
            if let Some(receipt) = receipts.receive().unwrap() {
                return receipt.outcome().unwrap();
            }
            assert!(since.elapsed() < GIVEN_UP_AFTER, "no receipt");
            thread::sleep(Duration::from_millis(2));
        }
    }

    /// Enables, and sets out on a motion of 20 s.
    pub(crate) fn set_out(&mut self, arm: &Arm) {
        self.enable();
        self.generation += 1;
        let outcome = self.send(arm, self.generation, GIVEN_UP_AFTER);
        assert!(matches!(outcome, Outcome::Accepted { .. }), "{outcome:?}");
        self.until(Phase::Moving);
    }
}
