//! The demo's child processes: started one after the other, ended in the opposite order, never left behind.
//!
//! Each child gets a process group of its own, so that Ctrl-C reaches only the demo: the arm must come to rest
//! before its servos go.
use super::file::DemoFile;
use crate::args::DemoArgs;
use crate::failure::Failure;
use crate::interrupt;
use crate::live::client::Limit;
use crate::output::{Form, note};
use rustix::process::{Pid, Signal, kill_process};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Longest wait for a ready line. A machine that emulates its kernel is slow to start processes.
const READY_S_MAX: f64 = 20.0;
/// Longest wait for an orderly end; the streamer may have to stop the arm first.
const END_S_MAX: f64 = 10.0;
/// Lines of a log that are quoted when a process fails.
const QUOTED_LINES: usize = 4;

/// All children, in the order of their start.
pub(crate) struct Processes {
    children: Vec<Process>,
    output: PathBuf,
}

/// One child and its log.
struct Process {
    name: &'static str,
    child: Child,
    log: PathBuf,
    said: Receiver<String>,
}

impl Processes {
    /// Starts servos, streamer and planner, each when the one before is ready.
    pub(crate) fn start(form: Form, demo: &DemoFile, args: &DemoArgs) -> Result<Self, Failure> {
        let mut all = Self { children: Vec::new(), output: args.output.clone() };
        let settings = demo.settings.file.as_os_str();
        let link = args.link.to_string();
        let joints = demo.settings.robot.joints.len();
        let start: Vec<String> = demo.start_rad.iter().take(joints).map(f64::to_string).collect();
        let start = start.join(",");
        let cycle_log = all.cycle_log();

        let words = |given: &[&str]| -> Vec<OsString> {
            let settings = ["--settings".into(), settings.to_owned()];
            settings.into_iter().chain(given.iter().map(Into::into)).collect()
        };
        all.add(form, "taustream-servosim", &words(&["--link", &link, "--start-rad", &start]))?;

        let mut streamer = words(&["--link", &link, "--cycle-log"]);
        let state = cycle_log.with_file_name("state");
        streamer.push(cycle_log.into_os_string());
        streamer.extend(["--state-dir".into(), state.into_os_string()]);
        if let Err(refused) = all.add(form, "taustream-streamer", &streamer) {
            // The streamer's own refusal names the option exactly when rights are missing.
            if !refused.to_string().contains("--allow-non-realtime") {
                return Err(refused);
            }
            note(format_args!("{refused}"));
            note("NOTE: going on WITHOUT real-time rights (--allow-non-realtime): expect late cycles");
            streamer.push("--allow-non-realtime".into());
            all.add(form, "taustream-streamer", &streamer)?;
        }
        all.add(form, "taustream-planner", &words(&[]))?;
        Ok(all)
    }

    /// Where the streamer writes its cycle log.
    pub(crate) fn cycle_log(&self) -> PathBuf {
        self.output.join("cycles.jsonl")
    }

    fn add(&mut self, form: Form, name: &'static str, words: &[OsString]) -> Result<(), Failure> {
        let mut process = Process::spawn(name, words, &self.output)?;
        match process.wait_until_ready() {
            Ok(ready) => {
                self.children.push(process);
                form.progress(ready);
                Ok(())
            }
            Err(failure) => {
                // Its failure was reported; how it ends after that does not matter.
                let _ended = process.end();
                Err(failure)
            }
        }
    }

    /// Ends planner, streamer and servos in this order; the streamer stops the arm by itself if it still moves.
    pub(crate) fn end(&mut self) -> Result<(), Failure> {
        let mut first_failure = Ok(());
        while let Some(mut process) = self.children.pop() {
            let ended = process.end();
            if first_failure.is_ok() {
                first_failure = ended;
            }
        }
        first_failure
    }
}

impl Drop for Processes {
    /// After an early return: nothing of ours continues running.
    fn drop(&mut self) {
        if let Err(failure) = self.end() {
            note(format_args!("taustream: {failure}"));
        }
    }
}

/// A program of the same build: beside this one.
fn beside_us(name: &str) -> Result<PathBuf, Failure> {
    let own = std::env::current_exe().map_err(|e| {
        Failure::Failed(format!("the demo cannot find its own program: {e}; is /proc mounted?"))
    })?;
    let path = own.with_file_name(name);
    if path.is_file() {
        Ok(path)
    } else {
        let how = "`cargo xtask demo` builds everything; by hand: cargo build --release --workspace";
        Err(Failure::unfit(&path, format!("there is no such program beside `taustream`; {how}")))
    }
}

impl Process {
    fn spawn(name: &'static str, words: &[OsString], output: &Path) -> Result<Self, Failure> {
        let program = beside_us(name)?;
        let log = output.join(format!("{name}.log"));
        let fail = |e| Failure::writing(log.display().to_string(), e);
        let errors = File::create(&log).map_err(fail)?;
        let mut copy = errors.try_clone().map_err(fail)?;
        let mut child = Command::new(&program)
            .args(words)
            .env("NO_COLOR", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(errors)
            .process_group(0)
            .spawn()
            .map_err(|e| Failure::Failed(format!("{} cannot be started: {e}", program.display())))?;

        // The pipe is read to its end, so that the child never waits for us.
        let (say, said) = channel();
        if let Some(out) = child.stdout.take() {
            thread::spawn(move || {
                for line in BufReader::new(out).lines().map_while(Result::ok) {
                    // A full disk or a demo that has gone on must not stop the reading.
                    let _logged = writeln!(copy, "{line}");
                    let _heard = say.send(line);
                }
            });
        }
        Ok(Self { name, child, log, said })
    }

    /// The child's ready line.
    fn wait_until_ready(&mut self) -> Result<String, Failure> {
        let beginning = format!("{} ready", self.name);
        let limit = Limit::after_s(READY_S_MAX);
        loop {
            match self.said.recv_timeout(Duration::from_millis(20)) {
                Ok(line) if line.starts_with(&beginning) => return Ok(line),
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) if !limit.is_over() => interrupt::check()?,
                Err(RecvTimeoutError::Timeout) => {
                    return Err(self.failed(&format!("was not ready within {READY_S_MAX} s")));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let how = match self.child.wait() {
                        Ok(status) => format!("ended at once ({status})"),
                        Err(e) => format!("ended at once ({e})"),
                    };
                    return Err(self.failed(&how));
                }
            }
        }
    }

    fn end(&mut self) -> Result<(), Failure> {
        if let Ok(Some(status)) = self.child.try_wait() {
            return self.evaluate(status);
        }
        let pid = i32::try_from(self.child.id()).ok().and_then(Pid::from_raw);
        if let Some(pid) = pid {
            // An error means that it has just ended, which the wait below finds out.
            let _gone = kill_process(pid, Signal::TERM);
        }
        let limit = Limit::after_s(END_S_MAX);
        while !limit.is_over() {
            if let Ok(Some(status)) = self.child.try_wait() {
                return self.evaluate(status);
            }
            thread::sleep(Duration::from_millis(10));
        }
        let killed = self.child.kill().and_then(|()| self.child.wait());
        let how = if killed.is_ok() { "and was killed" } else { "and could not be killed" };
        Err(self.failed(&format!("did not end within {END_S_MAX} s after SIGTERM, {how}")))
    }

    fn evaluate(&self, status: ExitStatus) -> Result<(), Failure> {
        if status.success() { Ok(()) } else { Err(self.failed(&format!("ended with {status}"))) }
    }

    /// A failure with the last lines of the log, which say more than we can.
    fn failed(&self, how: &str) -> Failure {
        let text = fs::read_to_string(&self.log).unwrap_or_default();
        let mut lines: Vec<&str> =
            text.lines().rev().filter(|l| !l.trim().is_empty()).take(QUOTED_LINES).collect();
        lines.reverse();
        let log = self.log.display();
        let said = if lines.is_empty() { "it printed nothing".to_owned() } else { lines.join(" | ") };
        Failure::Failed(format!("{} {how}: {said} (log: {log})", self.name))
    }
}
