//! The vcan machine: a kernel with CAN, booted as a process, for hosts whose own kernel has none.
//!
//! User-mode Linux (Debian package user-mode-linux) boots on the host's own file system below an overlay in memory,
//! brings `vcan0` and `vcan1` up, runs one command as root in the caller's directory with the caller's environment
//! and `TAUSTREAM_VCAN=1`, and hands back its output and status. A boot takes 3 to 6 s.
//!
//! What the guest is not: it has one CPU; a system call, reading the clock included, costs 14 to 38 us; its timing
//! is evidence of nothing but regressions. So build outside and run inside.
use crate::scratch::{Scratch, quoted};
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process, kill_process_group, waitid};
use std::ffi::{OsStr, OsString};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{Error, PipeReader, Read, Write, pipe};
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Runs as process 1 until the file system stands.
const INIT: &str = include_str!("../machine/init.sh");
/// Runs as process 1 from then on.
const GUEST: &str = include_str!("../machine/guest.sh");
const CAN_SOFTIRQ: &str = include_str!("../machine/can-softirq.sh");

/// Time for boot, the guest's own time-out and power-off, on top of the command's limit.
const BOOT_AND_HALT: Duration = Duration::from_secs(60);
/// Nice value of the guest: it gets its CPU at once beside ordinary work, and no limit of real-time scheduling stops it.
const NICE: i8 = -20;
/// How often the host looks after the guest.
const LOOK: Duration = Duration::from_millis(20);
/// Time between asking the guest's processes to end and killing them.
const GRACE: Duration = Duration::from_millis(500);

/// Status of a command that ran out of time.
pub const TIMED_OUT: u8 = 124;

/// The programs that the machine needs and the Debian packages that bring them.
const NEEDS: [(&str, &str); 4] =
    [("linux.uml", "user-mode-linux"), ("ip", "iproute2"), ("candump", "can-utils"), ("modprobe", "kmod")];

/// Why the machine gave no status.
#[derive(Debug, thiserror::Error)]
pub enum MachineError {
    /// Programs are not installed.
    #[error("the vcan machine needs packages that are missing; install them: apt-get install --no-install-recommends {}", packages.join(" "))]
    Missing {
        /// The Debian packages.
        packages: Vec<&'static str>,
    },
    /// A path that cannot travel into the guest.
    #[error("{} cannot be used in the vcan machine: {why}", path.display())]
    BadPath {
        /// The path.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// An operation of the host failed.
    #[error("the vcan machine could not {doing}: {source}")]
    Host {
        /// What was being done.
        doing: &'static str,
        /// The operating system's word.
        source: Error,
    },
    /// The caller asked to stop, or the output is closed.
    #[error("the vcan machine was stopped before its command had ended")]
    Stopped,
    /// The guest ended without a status.
    #[error("the vcan machine gave no status (linux.uml: {status}); the end of its log:\n{log}")]
    NoStatus {
        /// How its kernel's process ended.
        status: ExitStatus,
        /// The last lines of the kernel's log.
        log: String,
    },
}

/// A machine to be booted: builder of one run, or of several.
///
/// ```no_run
/// # use std::sync::atomic::AtomicBool;
/// # use taustream_tests::machine::Machine;
/// let status = Machine::new().limit_s(60).run(&["candump".into(), "-n1".into(), "vcan0".into()], &AtomicBool::new(false))?;
/// # Ok::<(), taustream_tests::machine::MachineError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Machine {
    limit_s: u32,
    memory_mib: u32,
    writable: Vec<PathBuf>,
    interfaces: u32,
    nice: i8,
    realtime: Option<u8>,
    cpu: Option<usize>,
}

impl Default for Machine {
    fn default() -> Self {
        Self::new()
    }
}

impl Machine {
    /// 300 s, 1 GiB, two interfaces, nothing writable through to the host, bound to the last CPU, ordinary scheduling
    /// with a nice value of -20 where that is permitted.
    #[must_use]
    pub fn new() -> Self {
        // Its kernel and its processes hand over to each other by ptrace: on one CPU a system call costs half.
        let cpu = rustix::thread::sched_getaffinity(None)
            .ok()
            .and_then(|set| (0..rustix::thread::CpuSet::MAX_CPU).rev().find(|cpu| set.is_set(*cpu)));
        Self {
            limit_s: 300,
            memory_mib: 1024,
            writable: Vec::new(),
            interfaces: 2,
            nice: NICE,
            realtime: None,
            cpu,
        }
    }
    /// Time that the command may take; past it, it gets SIGTERM (status 124), and killed 5 s later (137).
    #[must_use]
    pub fn limit_s(mut self, limit_s: u32) -> Self {
        self.limit_s = limit_s;
        self
    }
    /// Memory of the guest. The host's is taken only as it is touched.
    #[must_use]
    pub fn memory_mib(mut self, memory_mib: u32) -> Self {
        self.memory_mib = memory_mib;
        self
    }
    /// A directory that stays writable through to the host.
    #[must_use]
    pub fn writable(mut self, directory: impl Into<PathBuf>) -> Self {
        self.writable.push(directory.into());
        self
    }
    /// How many interfaces: vcan0, vcan1, ..
    #[must_use]
    pub fn interfaces(mut self, count: u32) -> Self {
        self.interfaces = count;
        self
    }
    /// Nice value on the host; a negative one where it is permitted, else the caller's own.
    #[must_use]
    pub fn nice(mut self, nice: i8) -> Self {
        self.nice = nice;
        self
    }
    /// `SCHED_FIFO` priority on the host instead, where permitted (with a message where not). For guests that sleep most of the
    /// time: a guest that computes takes its whole CPU, and the host's limit for real-time processes then stops it for
    /// 50 ms of every second.
    #[must_use]
    pub fn realtime(mut self, priority: Option<u8>) -> Self {
        self.realtime = priority;
        self
    }
    /// CPU of the host that the guest is bound to; `None`: not bound.
    #[must_use]
    pub fn cpu(mut self, cpu: Option<usize>) -> Self {
        self.cpu = cpu;
        self
    }

    /// Boots, runs the command, passes its output through to this process's stdout and stderr, returns its status.
    /// The first line on stderr names the guest's kernel. `stop` ends the machine early.
    ///
    /// # Errors
    /// Whatever kept the machine from giving a status. The scratch directory is removed in any case.
    pub fn run(&self, command: &[OsString], stop: &AtomicBool) -> Result<u8, MachineError> {
        self.run_into(command, stop, std::io::stdout(), std::io::stderr())
    }

    /// As [`Self::run`], with the output handed to writers instead. They are called from threads of their own.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_into(
        &self,
        command: &[OsString],
        stop: &AtomicBool,
        stdout: impl Write + Send + 'static,
        stderr: impl Write + Send + 'static,
    ) -> Result<u8, MachineError> {
        let packages = missing_packages();
        if !packages.is_empty() {
            return Err(MachineError::Missing { packages });
        }
        let scratch = Scratch::new().map_err(host("make its scratch directory"))?;
        self.prepare(&scratch, command)?;
        let words = [format!("machine_interfaces={}", self.interfaces).into()];
        self.boot(&scratch, &words, stop, (stdout, stderr))
    }

    /// Boots what lies in the scratch directory, with further words for the kernel, until its status is there.
    pub(crate) fn boot(
        &self,
        scratch: &Scratch,
        words: &[OsString],
        stop: &AtomicBool,
        (stdout, stderr): (impl Write + Send + 'static, impl Write + Send + 'static),
    ) -> Result<u8, MachineError> {
        let (out_reader, out_writer) = pipe().map_err(host("make a pipe"))?;
        let (err_reader, err_writer) = pipe().map_err(host("make a pipe"))?;
        let log = File::create(scratch.path().join("log")).map_err(host("make its log"))?;
        // The guest's consoles travel as stdin and stdout of the launching shell: see `launcher`.
        let mut guest = Guest::start(
            self.launcher(scratch.path())?.args(words).stdin(out_writer).stdout(err_writer).stderr(log),
        )?;
        let without_feedback = Arc::new(AtomicBool::new(false));
        let copies =
            [copy(out_reader, stdout, &without_feedback), copy(err_reader, stderr, &without_feedback)];
        let limit = BOOT_AND_HALT + Duration::from_secs(self.limit_s.into());
        let in_time = guest.wait(limit, &[stop, &without_feedback]);
        // The consoles end when the last process of the guest has.
        let status = guest.end();
        for copy in copies {
            // A copying thread ends by the end of its pipe, and cannot panic.
            let _ended = copy.join();
        }
        if in_time? {
            read_status(scratch, status.map_err(host("wait for linux.uml"))?)
        } else {
            Ok(TIMED_OUT)
        }
    }

    /// Writes what the guest reads.
    fn prepare(&self, scratch: &Scratch, command: &[OsString]) -> Result<(), MachineError> {
        let mut writable = Vec::new();
        for directory in &self.writable {
            writable.extend(shareable(directory)?);
        }
        let here = std::env::current_dir().map_err(host("find the working directory"))?;
        let failed = host("write its scripts");
        scratch
            .write("init.sh", INIT.as_bytes())
            .and_then(|()| scratch.write("guest.sh", GUEST.as_bytes()))
            .and_then(|()| scratch.write("can-softirq.sh", CAN_SOFTIRQ.as_bytes()))
            .and_then(|()| scratch.write("writable", &writable))
            .and_then(|()| scratch.write("command.sh", &command_script(&here, self.limit_s, command)))
            .map_err(failed)
    }

    /// The process that becomes the guest's kernel.
    fn launcher(&self, scratch: &Path) -> Result<Command, MachineError> {
        // The kernel takes consoles by descriptor number, and descriptors 0 to 2 are the only ones that a child gets
        // without a race; so a shell moves them to 5 and 6, and gives the kernel's own words to the log.
        // umask 0: files that the guest makes get its umask, not both.
        // Where the kernel shares its time between sessions, the nice value of the session counts.
        const MOVE: &str = "umask 0; exec 5>&0 6>&1 </dev/null 1>&2; \
             { echo \"$NICE\" > /proc/self/autogroup; } 2> /dev/null; unset NICE; exec \"$@\"";
        if scratch.as_os_str().as_bytes().iter().any(u8::is_ascii_whitespace) {
            let why = "it is named on a kernel's command line, so it must have no blank; set TMPDIR".into();
            return Err(MachineError::BadPath { path: scratch.into(), why });
        }
        // A session, and with it a group, of its own.
        let mut command = Command::new("setsid");
        command.args(["/bin/sh", "-c", MOVE, "vcan-machine"]).env_clear();
        // No TMPDIR: the guest's memory belongs into /dev/shm. HOME: where it would keep its sockets.
        command.env("PATH", search_path()).env("HOME", scratch).env("NICE", self.nice.to_string());
        if let Some(cpu) = self.cpu {
            command.args(["taskset", "-c", &cpu.to_string()]);
        }
        // `nice` continues without where it is not permitted.
        command.args(["nice", "-n", &self.nice.to_string()]);
        if let Some(priority) = self.realtime {
            if may_have_priority(priority) {
                command.args(["chrt", "-f", &priority.to_string()]);
            } else {
                eprintln!(
                    "vcan-machine: SCHED_FIFO {priority} is not permitted here (needs CAP_SYS_NICE or RLIMIT_RTPRIO); \
                     running without, so timing figures will be worse"
                );
            }
        }
        command.args(["linux.uml", "root=/dev/root", "rootfstype=hostfs", "rootflags=/", "ro", "quiet"]);
        command.args(["loglevel=4", "umid=guest", "con=null", "ssl=null", "con0=null,fd:2"]);
        command.args(["con1=null,fd:5", "con2=null,fd:6"]);
        command.arg(format!("mem={}M", self.memory_mib));
        for (key, file) in [("uml_dir", ""), ("machine_dir", ""), ("init", "init.sh")] {
            let mut word = OsString::from(format!("{key}="));
            word.push(if file.is_empty() { scratch.to_path_buf() } else { scratch.join(file) });
            command.arg(word);
        }
        Ok(command)
    }
}

/// The Debian packages that are missing on this host.
#[must_use]
pub fn missing_packages() -> Vec<&'static str> {
    missing_in(&search_path())
}

/// As [`missing_packages`], for programs sought in these folders.
fn missing_in(path: &OsStr) -> Vec<&'static str> {
    let is_there = |program: &str| std::env::split_paths(path).any(|folder| folder.join(program).is_file());
    NEEDS.iter().filter(|(program, _)| !is_there(program)).map(|(_, package)| *package).collect()
}

/// The caller's PATH, and the places of the administrator's programs, which a user's PATH may lack.
fn search_path() -> OsString {
    let mut path = std::env::var_os("PATH").unwrap_or_default();
    path.push(":/usr/sbin:/usr/bin:/sbin:/bin");
    path
}

/// Tries, for `chrt` would end the launch with a message of its own.
fn may_have_priority(priority: u8) -> bool {
    let mut trial = Command::new("chrt");
    trial.args(["-f", &priority.to_string(), "true"]).env("PATH", search_path());
    trial.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    trial.status().is_ok_and(|status| status.success())
}

/// A line of the file of writable directories.
fn shareable(directory: &Path) -> Result<Vec<u8>, MachineError> {
    let bad = |why: String| MachineError::BadPath { path: directory.into(), why };
    let path = directory.canonicalize().map_err(|error| bad(error.to_string()))?;
    if !path.is_dir() {
        return Err(bad("it is no directory".into()));
    }
    let mut line = path.into_os_string().into_vec();
    // A mount option ends at a comma, and a line at its end.
    if line.iter().any(|byte| matches!(byte, b',' | b'\n' | b'\\')) {
        return Err(bad("a directory that stays writable must have no comma, newline or backslash".into()));
    }
    line.push(b'\n');
    Ok(line)
}

/// What the guest's shell reads to become the command: environment, umask, directory, time limit.
fn command_script(here: &Path, limit_s: u32, command: &[OsString]) -> Vec<u8> {
    let mut script = Vec::new();
    let inherited = std::env::vars_os().filter(|(name, _)| may_travel(name));
    for (name, value) in inherited.chain([("TAUSTREAM_VCAN".into(), "1".into())]) {
        script.extend_from_slice(b"export ");
        script.extend_from_slice(name.as_bytes());
        script.push(b'=');
        script.extend(quoted(&value));
        script.push(b'\n');
    }
    let mut umask = String::new();
    // Writing to a String cannot fail.
    let _never = write!(umask, "umask {:04o}\ncd -- ", own_umask());
    script.extend_from_slice(umask.as_bytes());
    script.extend(quoted(here.as_os_str()));
    script.extend_from_slice(b" || exit 125\nexec setsid --wait timeout -k 5 ");
    script.extend_from_slice(limit_s.to_string().as_bytes());
    for word in command {
        script.push(b' ');
        script.extend(quoted(word));
    }
    script.push(b'\n');
    script
}

/// Whether a variable may be exported in the guest: bash refuses to set some of its own, and directories under /run are
/// not there.
fn may_travel(name: &OsStr) -> bool {
    const NOT: [&str; 8] = [
        "BASHOPTS",
        "BASH_VERSINFO",
        "EUID",
        "PPID",
        "SHELLOPTS",
        "UID",
        "XDG_RUNTIME_DIR",
        "TAUSTREAM_RUNTIME_DIR",
    ];
    let bytes = name.as_bytes();
    let is_word = bytes.iter().all(|byte| byte.is_ascii_alphanumeric() || *byte == b'_');
    is_word
        && bytes.first().is_some_and(|first| !first.is_ascii_digit())
        && !NOT.iter().any(|not| name == *not)
}

/// This process's umask, read where that does not change it.
fn own_umask() -> u32 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("Umask:"));
    line.and_then(|text| u32::from_str_radix(text.trim(), 8).ok()).unwrap_or(0o022)
}

/// The guest's processes, killed with this value.
struct Guest {
    launched: Child,
    /// Set once it was reaped: from then on its number must not be signalled.
    ended: Option<ExitStatus>,
}

impl Guest {
    fn start(command: &mut Command) -> Result<Self, MachineError> {
        let launched = command.spawn().map_err(host("start linux.uml"))?;
        Ok(Self { launched, ended: None })
    }

    /// Waits until its kernel has ended; false when it took too long.
    fn wait(&self, limit: Duration, stops: &[&AtomicBool]) -> Result<bool, MachineError> {
        let deadline = Instant::now() + limit;
        while !self.has_ended() {
            if stops.iter().any(|stop| stop.load(Ordering::Relaxed)) {
                return Err(MachineError::Stopped);
            }
            if Instant::now() > deadline {
                return Ok(false);
            }
            std::thread::sleep(LOOK);
        }
        Ok(true)
    }

    /// Looks without reaping: as long as its zombie is there, no other process gets its number, which is its group's.
    fn has_ended(&self) -> bool {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        self.pid().is_none_or(|pid| !matches!(waitid(WaitId::Pid(pid), options), Ok(None)))
    }

    /// Kills what is left of it, and tells how its kernel ended.
    fn end(&mut self) -> std::io::Result<ExitStatus> {
        if let Some(status) = self.ended {
            return Ok(status);
        }
        if !self.has_ended() {
            self.signal(Signal::TERM);
            let deadline = Instant::now() + GRACE;
            while Instant::now() < deadline && !self.has_ended() {
                std::thread::sleep(LOOK);
            }
        }
        self.signal(Signal::KILL);
        let status = self.launched.wait()?;
        self.ended = Some(status);
        Ok(status)
    }

    fn pid(&self) -> Option<Pid> {
        i32::try_from(self.launched.id()).ok().and_then(Pid::from_raw)
    }

    fn signal(&self, signal: Signal) {
        if let Some(pid) = self.pid() {
            // The group is there as soon as the launched process has made it. An error says that nobody is left.
            let _nobody = kill_process_group(pid, signal);
            let _nobody = kill_process(pid, signal);
        }
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        let _status = self.end();
    }
}

/// Copies a console to a writer until it ends. When the writer fails (`| head`), the output of the guest is lost, so it is
/// stopped; until then the console is still emptied, for the guest would wait on a full one.
fn copy(
    mut from: PipeReader,
    mut to: impl Write + Send + 'static,
    without_feedback: &Arc<AtomicBool>,
) -> JoinHandle<()> {
    let without_feedback = Arc::clone(without_feedback);
    std::thread::spawn(move || {
        let mut buffer = [0; 1 << 14];
        while let Ok(count) = from.read(&mut buffer) {
            let Some(bytes) = buffer.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            if !without_feedback.load(Ordering::Relaxed)
                && to.write_all(bytes).and_then(|()| to.flush()).is_err()
            {
                without_feedback.store(true, Ordering::Relaxed);
            }
        }
    })
}

/// The status that the guest has left, or the end of its kernel's log.
fn read_status(scratch: &Scratch, status: ExitStatus) -> Result<u8, MachineError> {
    if let Ok(Ok(status)) = scratch.read("status").map(|text| text.trim().parse()) {
        return Ok(status);
    }
    let log = scratch.read("log").unwrap_or_else(|error| error.to_string());
    let lines: Vec<&str> = log.lines().collect();
    let log = lines.get(lines.len().saturating_sub(25)..).unwrap_or(&[]).join("\n");
    Err(MachineError::NoStatus { status, log })
}

fn host(doing: &'static str) -> impl Fn(Error) -> MachineError {
    move |source| MachineError::Host { doing, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn machine_on_a_bare_host_names_the_packages_and_how_to_get_them() {
        let packages = missing_in(OsStr::new("/nowhere:/proc"));
        assert_eq!(packages, ["user-mode-linux", "iproute2", "can-utils", "kmod"]);
        let text = MachineError::Missing { packages }.to_string();
        assert!(
            text.ends_with("apt-get install --no-install-recommends user-mode-linux iproute2 can-utils kmod")
        );
    }

    #[test]
    fn machine_command_script_lets_no_word_break_out() {
        let command = ["a b", "'; rm -rf /; '", "", "$(x)"].map(OsString::from);
        let script = command_script(Path::new("/it's"), 9, &command);
        let last = r"cd -- '/it'\''s' || exit 125
exec setsid --wait timeout -k 5 9 'a b' ''\''; rm -rf /; '\''' '' '$(x)'
";
        assert!(script.ends_with(last.as_bytes()), "{}", String::from_utf8_lossy(&script));
        assert!(!may_travel(OsStr::new("BASH_FUNC_x%%")) && !may_travel(OsStr::new("UID")));
        assert!(
            !may_travel(OsStr::new("1X")) && !may_travel(OsStr::new("")) && may_travel(OsStr::new("PATH"))
        );
    }
}
