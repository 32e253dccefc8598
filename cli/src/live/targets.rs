//! `taustream follow`: a stream of targets from standard input to the planner.
use super::client::{Client, Limit};
use super::target_lines::LineReader;
use super::target_port::TargetPort;
use crate::args::FollowArgs;
use crate::arm;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::io::BufReader;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::text::counted;
use taustream_messages::target::{DUE_S_MAX, Target, TargetOutcome};

/// How often answers are looked for while no line comes.
const LOOK: Duration = Duration::from_millis(2);
/// Lines that are read ahead: they are taken every few milliseconds, and only the newest is sent.
const LINES_AHEAD: usize = 1024;
/// How long the last answers may take, s.
const ANSWER_S_MAX: f64 = 5.0;
/// How often a refusal is shown to people, at most.
const SAY_EVERY: Duration = Duration::from_secs(1);

/// What was read from standard input.
enum Line {
    Targets(Vec<Target>),
    Wrong { number: u64, why: String },
}

/// What became of one request, as a line for programs.
#[derive(Serialize)]
struct Answer<'a> {
    sequence: u64,
    outcome: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    trajectory_id: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cut_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rest_in_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    planning_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<&'a str>,
}

/// The whole stream.
#[derive(Default, Serialize)]
struct Summary {
    arm: String,
    lines: u64,
    sent: u64,
    taken: u64,
    superseded: u64,
    refused: u64,
    wrong_lines: u64,
    planning_s_max: f64,
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} read, {} sent", counted(self.lines, "target"), self.sent)?;
        write!(
            f,
            "{} taken, {} superseded by newer ones, {} refused, {} not understood; planning took at most {:.1} ms",
            self.taken,
            self.superseded,
            self.refused,
            counted(self.wrong_lines, "line"),
            self.planning_s_max * 1e3
        )
    }
}

/// Sends every line as it comes, the newest first, until standard input ends.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &FollowArgs) -> Result<(), Failure> {
    let settings = arm::settings(settings)?;
    let client = Client::join(&settings.name)?;
    let joints = settings.robot.joints.len();
    let lines = read_lines(joints, args.rate_hz);
    let mut stream = Stream {
        form,
        port: TargetPort::open(&client, joints, DUE_S_MAX)?,
        summary: Summary { arm: settings.name.clone(), ..Summary::default() },
        said: None,
    };
    let mut newest = None;
    while !interrupt::has_come() {
        let more = stream.take(&lines, &mut newest)?;
        stream.collect()?;
        if stream.port.is_free()
            && let Some(targets) = newest.take()
        {
            stream.port.send(targets)?;
            stream.summary.sent += 1;
        }
        if !more && newest.is_none() {
            break;
        }
    }
    let limit = Limit::after_s(ANSWER_S_MAX);
    while !stream.port.is_idle() && !limit.is_over() {
        stream.collect()?;
        thread::sleep(LOOK);
    }
    let summary = stream.summary;
    form.print(&summary)?;
    if interrupt::has_come() {
        let what = "interrupted: the arm goes on to the last target taken and holds there; `taustream stop` stops it on its way";
        return Err(Failure::Interrupted(what.to_owned()));
    }
    if summary.taken == 0 && summary.lines > 0 {
        return Err(Failure::Refused("no target was taken; the reasons stand above".to_owned()));
    }
    Ok(())
}

/// Reads standard input on a thread of its own, at most `rate_hz` lines a second.
fn read_lines(joints: usize, rate_hz: Option<f64>) -> Receiver<Line> {
    let (sender, receiver) = sync_channel(LINES_AHEAD);
    let pause = rate_hz.map(|rate_hz| Duration::from_secs_f64(1.0 / rate_hz));
    thread::spawn(move || {
        let mut reader = LineReader::new(joints, BufReader::new(std::io::stdin()));
        let mut due = Instant::now();
        while let Some((number, read)) = reader.next_line() {
            let line = match read {
                Ok(targets) if targets.is_empty() => continue,
                Ok(targets) => Line::Targets(targets),
                Err(e) => Line::Wrong { number, why: e.to_string() },
            };
            if let Some(pause) = pause {
                thread::sleep(due.saturating_duration_since(Instant::now()));
                due = Instant::now().max(due) + pause;
            }
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

struct Stream<'a> {
    form: Form,
    port: TargetPort<'a>,
    summary: Summary,
    said: Option<Instant>,
}

impl Stream<'_> {
    /// Waits a moment for lines, and keeps the newest. False when there are no more.
    fn take(&mut self, lines: &Receiver<Line>, newest: &mut Option<Vec<Target>>) -> Result<bool, Failure> {
        let first = match lines.recv_timeout(LOOK) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => return Ok(true),
            Err(RecvTimeoutError::Disconnected) => return Ok(false),
        };
        let mut line = Ok(first);
        loop {
            match line {
                Ok(Line::Targets(targets)) => {
                    self.summary.lines += 1;
                    if newest.replace(targets).is_some() {
                        self.summary.superseded += 1;
                    }
                }
                Ok(Line::Wrong { number, why }) => {
                    self.summary.wrong_lines += 1;
                    self.say(&format!("line {number} is skipped: {why}"));
                }
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => return Ok(true),
            }
            line = lines.try_recv();
        }
    }

    /// Takes the answers that have come.
    fn collect(&mut self) -> Result<(), Failure> {
        for (sequence, outcome) in self.port.answers()? {
            self.note(sequence, &outcome)?;
        }
        Ok(())
    }

    fn note(&mut self, sequence: u64, outcome: &TargetOutcome) -> Result<(), Failure> {
        let mut answer = Answer {
            sequence,
            outcome: "superseded",
            trajectory_id: None,
            cut_s: None,
            rest_in_s: None,
            planning_s: None,
            reason: None,
        };
        match outcome {
            TargetOutcome::Superseded => self.summary.superseded += 1,
            TargetOutcome::Refused { reason } => {
                self.summary.refused += 1;
                (answer.outcome, answer.reason) = ("refused", Some(reason.as_str()));
                self.say(&format!("target {sequence} is refused: {reason}"));
            }
            TargetOutcome::Taken { trajectory_id, cut_s, rest_in_s, planning_s, note } => {
                self.summary.taken += 1;
                self.summary.planning_s_max = self.summary.planning_s_max.max(*planning_s);
                answer.outcome = "taken";
                answer.trajectory_id = Some(*trajectory_id);
                (answer.cut_s, answer.rest_in_s) = (Some(*cut_s), Some(*rest_in_s));
                answer.planning_s = Some(*planning_s);
                if !note.is_empty() {
                    answer.reason = Some(note);
                    self.say(&format!("target {sequence}: {note}"));
                }
            }
        }
        match self.form {
            Form::Json => self.form.print_line(&crate::output::to_json(&answer)?),
            Form::Text => Ok(()),
        }
    }

    /// Says something to people, once a second at most.
    fn say(&mut self, text: &str) {
        if self.said.is_none_or(|said| said.elapsed() >= SAY_EVERY) {
            self.said = Some(Instant::now());
            self.form.progress(text);
        }
    }
}
