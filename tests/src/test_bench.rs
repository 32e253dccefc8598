//! A stage for one scenario: the real processes on one bus, a `bus-recorder` beside them, everything kept in one folder.
use crate::retry::Failed;
use anyhow::{Context, Result, bail, ensure};
use rustix::process::{Pid, Signal, kill_process};
use serde::Deserialize;
use std::fs::{self, File};
use std::io::Write;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use taustream_arm::Settings;
use taustream_messages::service::{ReportSubscriber, Wire};
use taustream_messages::{FaultReason, Phase, Report};

/// How long anything may take before a scenario is called stuck. Generous: it bounds a hang, it checks no speed.
pub const TIMEOUT: Duration = Duration::from_secs(60);
/// The recorder's file in the folder of a scenario.
pub const RECORDING: &str = "bus.log";
/// The streamer's log of its cycles there.
pub const CYCLE_LOG: &str = "cycles.jsonl";
/// Pause between two looks.
const LOOK: Duration = Duration::from_millis(20);

/// One process of ours. Ended by pid when dropped.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: PathBuf,
    stderr: PathBuf,
}

impl Process {
    fn start(program: &Path, args: &[&str], dir: &Path, name: &str) -> Result<Self> {
        let (stdout, stderr) = (dir.join(format!("{name}.out")), dir.join(format!("{name}.err")));
        let mut child = Command::new(program)
            .args(args)
            .stdin(Stdio::piped())
            .stdout(File::create(&stdout)?)
            .stderr(File::create(&stderr)?)
            .spawn()
            .with_context(|| format!("cannot start {}", program.display()))?;
        let stdin = child.stdin.take();
        Ok(Self { name: name.to_owned(), child, stdin, stdout, stderr })
    }

    /// Waits until the process has printed `words`.
    ///
    /// # Errors
    /// When it ends before, or takes longer than [`TIMEOUT`]; with what it said.
    pub fn await_words(&mut self, words: &str) -> Result<()> {
        let since = Instant::now();
        while !fs::read_to_string(&self.stdout)?.contains(words) {
            if let Some(status) = self.child.try_wait()? {
                bail!("{} ended with {status} before it said `{words}`: {}", self.name, self.said());
            }
            ensure!(since.elapsed() < TIMEOUT, "{} never said `{words}`: {}", self.name, self.said());
            sleep(LOOK);
        }
        Ok(())
    }

    /// Everything it has said so far.
    #[must_use]
    pub fn said(&self) -> String {
        let read = |file: &Path| fs::read_to_string(file).unwrap_or_default();
        format!("{}{}", read(&self.stdout), read(&self.stderr))
    }

    /// Writes a line to its standard input.
    ///
    /// # Errors
    /// When it has ended.
    pub fn show(&mut self, line: &str) -> Result<()> {
        let stdin = self.stdin.as_mut().context("its input is closed")?;
        writeln!(stdin, "{line}").with_context(|| format!("cannot tell {} `{line}`", self.name))
    }

    /// Sends a signal.
    ///
    /// # Errors
    /// When the process has ended.
    pub fn signal(&self, signal: Signal) -> Result<()> {
        let pid = Pid::from_child(&self.child);
        kill_process(pid, signal).with_context(|| format!("cannot signal {}", self.name))
    }

    /// Waits for its end.
    ///
    /// # Errors
    /// When it takes longer than [`TIMEOUT`].
    pub fn await_end(&mut self) -> Result<ExitStatus> {
        let since = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            ensure!(since.elapsed() < TIMEOUT, "{} does not end: {}", self.name, self.said());
            sleep(LOOK);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended already; then there is nothing left to end.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// What a command line answered.
#[derive(Debug)]
pub struct Answer {
    /// Its exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// A motion that the streamer has accepted.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct Motion {
    trajectory_id: u64,
    /// When what was done.
    pub stages: Stages,
}

/// When what was done for a request, s after it was sent.
#[derive(Clone, Copy, Debug, Deserialize)]
#[expect(missing_docs, reason = "docs/json.md has them")]
pub struct Stages {
    pub command_s: f64,
    pub received_s: f64,
    pub planned_s: f64,
    pub proven_s: f64,
    pub sent_s: f64,
    pub accepted_s: f64,
    pub answered_s: f64,
}

impl Motion {
    /// Whether a report speaks of this motion: the newest one may be older than the acceptance.
    fn is_in(self, report: &Report) -> bool {
        report.trajectory_id == self.trajectory_id
    }
}

/// The processes of one scenario.
#[derive(Debug)]
pub struct TestBench {
    dir: PathBuf,
    programs: PathBuf,
    settings_file: PathBuf,
    /// The settings that all processes share.
    pub settings: Settings,
    /// The simulated servos.
    pub simulator: Process,
    /// The streamer.
    pub streamer: Process,
    /// The planner.
    pub planner: Process,
    recorder: Process,
    reports: ReportSubscriber,
    wire: Wire,
}

/// Where a stage finds things.
#[derive(Clone, Debug)]
pub struct Place {
    /// Folder of the built programs.
    pub programs: PathBuf,
    /// Settings file.
    pub settings: PathBuf,
    /// Pose of the simulated servos at start, "q1,..".
    pub start_rad: String,
    /// Folder for logs; one folder a scenario is made in it.
    pub output: PathBuf,
}

impl TestBench {
    /// Starts recorder, simulator, streamer and planner, in this order, and waits until the arm is ready to be enabled.
    ///
    /// # Errors
    /// When one of them does not come up.
    pub fn open(place: &Place, scenario: &str) -> Result<Self> {
        let dir = place.output.join(scenario);
        fs::create_dir_all(&dir)?;
        let settings = Settings::load(&place.settings)?;
        let settings_arg = place.settings.to_str().context("the settings' path is not UTF-8")?;
        let program = |name: &str| place.programs.join(name);

        let recording = dir.join(RECORDING);
        let recording = recording.to_str().context("the recording's path is not UTF-8")?;
        let program_file = program("bus-recorder");
        let program_file = program_file.to_str().context("the programs' path is not UTF-8")?;
        // Above ordinary programs, far below the cycle: frames then never wait for the machine's other work.
        let recorder_args = ["--fifo", "10", program_file, recording];
        let mut recorder = Process::start(Path::new("chrt"), &recorder_args, &dir, "bus-recorder")?;
        recorder.await_words("bus-recorder ready")?;
        let simulator_args =
            ["--settings", settings_arg, "--link", "socketcan", "--start-rad", &place.start_rad];
        let mut simulator =
            Process::start(&program("taustream-servosim"), &simulator_args, &dir, "servosim")?;
        simulator.await_words("taustream-servosim ready")?;
        let log = dir.join(CYCLE_LOG);
        let log_arg = log.to_str().context("the log's path is not UTF-8")?;
        let state = dir.join("state");
        let state_arg = state.to_str().context("the state directory's path is not UTF-8")?;
        let streamer_args = [
            "--settings",
            settings_arg,
            "--link",
            "socketcan",
            "--cycle-log",
            log_arg,
            "--state-dir",
            state_arg,
        ];
        let mut streamer = Process::start(&program("taustream-streamer"), &streamer_args, &dir, "streamer")?;
        streamer.await_words("taustream-streamer ready")?;
        let mut planner =
            Process::start(&program("taustream-planner"), &["--settings", settings_arg], &dir, "planner")?;
        planner.await_words("taustream-planner ready")?;

        let wire = Wire::join(&settings.name, "scenario", &taustream_arm::runtime::directory()?)?;
        let reports = wire.report_subscriber()?;
        let mut bench = Self {
            dir,
            programs: place.programs.clone(),
            settings_file: place.settings.clone(),
            settings,
            simulator,
            streamer,
            planner,
            recorder,
            reports,
            wire,
        };
        bench.await_phase(Phase::Disabled)?;
        Ok(bench)
    }

    /// The folder of this scenario's files.
    #[must_use]
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Runs a program of the machine, its words separated by blanks.
    ///
    /// # Errors
    /// When it fails; with what it said.
    pub fn run(&self, program: &str, words: &str) -> Result<()> {
        let output = Command::new(program).args(words.split(' ')).output();
        let output = output.with_context(|| format!("cannot start {program}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "{program} {words}: {}: {said}", output.status);
        Ok(())
    }

    /// Starts the planner again, as a service manager would.
    ///
    /// # Errors
    /// When it does not come up.
    pub fn restart_planner(&mut self) -> Result<()> {
        let settings = self.settings_file.to_str().context("path is not UTF-8")?;
        let program = self.programs.join("taustream-planner");
        self.planner = Process::start(&program, &["--settings", settings], &self.dir, "planner-again")?;
        self.planner.await_words("taustream-planner ready")
    }

    /// Starts the streamer again after its end, as a service manager would. Its cycles are not logged: a log ends with its
    /// streamer.
    ///
    /// # Errors
    /// When it does not come up.
    pub fn restart_streamer(&mut self) -> Result<()> {
        let settings = self.settings_file.to_str().context("path is not UTF-8")?;
        let state = self.dir.join("state");
        let state = state.to_str().context("path is not UTF-8")?;
        let args = ["--settings", settings, "--link", "socketcan", "--state-dir", state];
        let program = self.programs.join("taustream-streamer");
        self.streamer = Process::start(&program, &args, &self.dir, "streamer-again")?;
        self.streamer.await_words("taustream-streamer ready")?;
        // A streamer that was killed young clears the names of the services at its next start; readers join anew.
        let wire = Wire::join(&self.settings.name, "scenario", &taustream_arm::runtime::directory()?)?;
        let reports = wire.report_subscriber()?;
        // Closed in earnest, the old ones would delete files of the same names that the streamer has made meanwhile.
        let _kept = ManuallyDrop::new(std::mem::replace(&mut self.reports, reports));
        let _kept = ManuallyDrop::new(std::mem::replace(&mut self.wire, wire));
        Ok(())
    }

    /// What the recorder has written so far, in whole lines.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn recorded(&self) -> Result<String> {
        let mut text = fs::read_to_string(self.dir.join(RECORDING))?;
        text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
        Ok(text)
    }

    /// Starts another streamer on the same bus and waits for its end.
    ///
    /// # Errors
    /// When it does not end.
    pub fn second_streamer(&self) -> Result<(ExitStatus, String)> {
        self.other_streamer(&self.settings_file)
    }

    /// Starts another streamer, of another arm on another interface, and waits for its end.
    ///
    /// # Errors
    /// When it does not end.
    pub fn streamer_on(&self, interface: &str) -> Result<(ExitStatus, String)> {
        let (ours, bus) = (&self.settings, self.settings.buses.first().context("no bus")?);
        let text = fs::read_to_string(&self.settings_file)?
            .replace(&format!("name = \"{}\"", ours.name), &format!("name = \"on-{interface}\""))
            .replace(&format!("interface = \"{}\"", bus.interface), &format!("interface = \"{interface}\""));
        // Its robot and scene are named relative to it, so it stands beside ours; the machine's disk forgets it.
        let file = self.settings_file.with_file_name(format!("on-{interface}.toml"));
        fs::write(&file, text)?;
        let ended = self.other_streamer(&file);
        fs::remove_file(&file)?;
        ended
    }

    fn other_streamer(&self, settings: &Path) -> Result<(ExitStatus, String)> {
        let settings = settings.to_str().context("path is not UTF-8")?;
        let program = self.programs.join("taustream-streamer");
        let args = ["--settings", settings, "--link", "socketcan"];
        let mut other = Process::start(&program, &args, &self.dir, "other-streamer")?;
        let status = other.await_end()?;
        Ok((status, other.said()))
    }

    /// Runs `taustream ARGS` with this stage's settings.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn cli(&self, args: &[&str]) -> Result<Answer> {
        let output = Command::new(self.programs.join("taustream"))
            .args(args)
            .env("TAUSTREAM_SETTINGS", &self.settings_file)
            .stdin(Stdio::null())
            .output()
            .context("cannot start taustream")?;
        let mut log = fs::OpenOptions::new().create(true).append(true).open(self.dir.join("cli.log"))?;
        let answer = Answer {
            code: output.status.code().unwrap_or(-1),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        };
        writeln!(log, "$ taustream {}\n{answer:?}", args.join(" "))?;
        Ok(answer)
    }

    /// Starts `taustream ARGS` with this stage's settings, and leaves its standard input open.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start_cli(&self, args: &[&str], name: &str) -> Result<Process> {
        let settings = self.settings_file.to_str().context("path is not UTF-8")?;
        let args = [args, &["--settings", settings]].concat();
        Process::start(&self.programs.join("taustream"), &args, &self.dir, name)
    }

    /// Runs a command that must be done.
    ///
    /// # Errors
    /// When it is refused; with its reason.
    pub fn cli_done(&self, args: &[&str]) -> Result<Answer> {
        let answer = self.cli(args)?;
        ensure!(
            answer.code == 0,
            "taustream {} ended with {}: {}",
            args.join(" "),
            answer.code,
            answer.stderr
        );
        Ok(answer)
    }

    /// Runs a command that must be refused with a sentence that holds `words`.
    ///
    /// # Errors
    /// When it is not refused, or for another reason.
    pub fn cli_refused(&self, args: &[&str], words: &str) -> Result<Answer> {
        let answer = self.cli(args)?;
        ensure!(
            answer.code == 1,
            "taustream {} ended with {}, not 1: {answer:?}",
            args.join(" "),
            answer.code
        );
        ensure!(
            answer.stderr.contains(words),
            "taustream {}: no `{words}` in: {}",
            args.join(" "),
            answer.stderr
        );
        Ok(answer)
    }

    /// Asks for a motion to `goal_rad` and expects that the streamer takes it.
    ///
    /// # Errors
    /// When it is refused.
    pub fn replan(&self, goal_rad: &str) -> Result<Motion> {
        let words = ["replan", "--goal", goal_rad, "--seed", "1", "--deadline-ms", "2500", "--json"];
        let answer = self.cli_done(&words)?;
        serde_json::from_str(&answer.stdout).with_context(|| format!("no receipt in {answer:?}"))
    }

    /// The newest report.
    ///
    /// # Errors
    /// When none comes.
    pub fn report(&mut self) -> Result<(Report, Phase)> {
        let since = Instant::now();
        // What waited in the buffer is old: take the last of it, or the next to come.
        let mut newest = None;
        loop {
            while let Some(sample) = self.reports.receive()? {
                newest = Some(*sample);
            }
            if let Some((report, phase)) = newest.as_ref().and_then(Report::checked) {
                return Ok((*report, phase));
            }
            ensure!(since.elapsed() < TIMEOUT, "no report: {}", self.streamer.said());
            sleep(LOOK);
        }
    }

    /// Waits until `wanted` holds.
    ///
    /// # Errors
    /// When it does not come to hold; with the last report.
    pub fn await_report(&mut self, what: &str, wanted: impl Fn(&Report, Phase) -> bool) -> Result<Report> {
        let since = Instant::now();
        loop {
            let (report, phase) = self.report()?;
            if wanted(&report, phase) {
                return Ok(report);
            }
            ensure!(
                since.elapsed() < TIMEOUT,
                "waited for {what}; the arm is {} ({:?} joint {} value {}), s = {} of {}: {}",
                phase.word(),
                report.fault(),
                report.fault_joint,
                report.fault_value,
                report.trajectory_s,
                report.trajectory_duration_s,
                self.streamer.said()
            );
            sleep(LOOK);
        }
    }

    /// Waits for a phase.
    ///
    /// # Errors
    /// When it does not come.
    pub fn await_phase(&mut self, wanted: Phase) -> Result<Report> {
        self.await_report(wanted.word(), |_, phase| phase == wanted)
    }

    /// Waits until a motion is under way: past `share` of its duration.
    ///
    /// # Errors
    /// When it does not get there.
    pub fn await_in_progress(&mut self, motion: Motion, share: f64) -> Result<Report> {
        self.await_through_stalls("a motion under way", |r, phase| {
            motion.is_in(r) && phase == Phase::Moving && r.trajectory_s > share * r.trajectory_duration_s
        })
    }

    /// Waits until a motion has ended at its end.
    ///
    /// # Errors
    /// When it does not get there.
    pub fn await_end_of(&mut self, motion: Motion) -> Result<Report> {
        self.await_through_stalls("the end of the motion", |r, phase| {
            motion.is_in(r) && phase == Phase::Holding && r.trajectory_s >= r.trajectory_duration_s
        })
    }

    /// Like [`Self::await_report`] for a motion without a pause: a host that held the machine up for longer than
    /// `stall_resume_ms` leaves the arm paused, and this resumes it with a message, as an operator would.
    ///
    /// # Errors
    /// When it does not come to hold, or the arm paused without a stall.
    pub fn await_through_stalls(
        &mut self,
        what: &str,
        wanted: impl Fn(&Report, Phase) -> bool,
    ) -> Result<Report> {
        loop {
            let report = self.await_report(what, |r, phase| phase == Phase::Paused || wanted(r, phase))?;
            if Phase::from_code(report.phase) != Some(Phase::Paused) {
                return Ok(report);
            }
            ensure!(report.stalls > 0, "the arm paused by itself without a stall");
            println!("       (the host stalled the machine: {} stalls so far; resuming)", report.stalls);
            self.cli_done(&["resume"])?;
        }
    }

    /// What did not hold, with the arm's state, and whether the host held the machine up.
    #[must_use]
    pub fn failed(&mut self, error: anyhow::Error) -> Failed {
        let Ok((report, phase)) = self.report() else { return Failed { error, stalled: false } };
        let state = format!(
            "the arm is {} ({:?}, {} stalls, {} late cycles, feedback {:.3?} s old)",
            phase.word(),
            report.cause(),
            report.stalls,
            report.cycles_late,
            report.feedback_age_s.iter().take(report.joints()).collect::<Vec<_>>()
        );
        Failed { error: error.context(state), stalled: self.is_stalled(&report) }
    }

    /// The streamer counted stalls, or has no feedback in time (the simulator is stalled with the rest, a fault of
    /// the arm concerns one joint or one bus).
    fn is_stalled(&self, report: &Report) -> bool {
        let limit_s = self.settings.supervision.feedback_age_s_max;
        let all_late = report.feedback_age_s.iter().take(report.joints()).all(|age_s| *age_s > limit_s);
        let bus_well = report.buses().iter().all(|bus| bus.bus_fault == 0);
        report.stalls > 0 || (all_late && bus_well) || report.fault() == Some(FaultReason::Stall)
    }

    /// Ends everything in order and leaves the recording: its text and the path of the cycle log.
    ///
    /// # Errors
    /// When the streamer does not end well.
    pub fn close(mut self) -> Result<(String, PathBuf)> {
        self.streamer.signal(Signal::TERM)?;
        let status = self.streamer.await_end()?;
        ensure!(status.success(), "the streamer ended with {status}: {}", self.streamer.said());
        self.leave()
    }

    /// Like [`Self::close`] for a scenario in which the streamer may have been killed.
    ///
    /// # Errors
    /// When the other processes do not end.
    pub fn close_whatever_became_of_the_streamer(mut self) -> Result<(String, PathBuf)> {
        if self.streamer.signal(Signal::TERM).is_ok() {
            self.streamer.await_end()?;
        }
        self.leave()
    }

    fn leave(mut self) -> Result<(String, PathBuf)> {
        for process in [&mut self.planner, &mut self.simulator] {
            process.signal(Signal::TERM)?;
            process.await_end()?;
        }
        // Nobody sends any more: what the recorder still has to take is all there is.
        self.recorder.signal(Signal::TERM)?;
        let status = self.recorder.await_end()?;
        ensure!(status.success(), "the recorder ended with {status}: {}", self.recorder.said());
        Ok((fs::read_to_string(self.dir.join(RECORDING))?, self.dir.join(CYCLE_LOG)))
    }
}
