//! `taustream watch`: the streamer's reports as they come, until the user has seen enough.
//!
//! It only receives: it takes one of the places for readers of reports, sends nothing, and ends without a trace at the
//! arm. It reports when the streamer has ended, and waits for a new one.
use super::client::{Client, Limit, STREAMER};
use super::status::Status;
use crate::args::WatchArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::{Form, SCHEMA, note};
use crate::view::{Line, Picture, Scale, Screen, Tone, is_terminal, line};
use serde_json::json;
use std::io;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use taustream_messages::{Phase, Report};

/// How often reports are looked for: reports at the highest rate fill their queue in 64 ms.
const POLL: Duration = Duration::from_millis(20);
/// Without a report for this long the streamer counts as gone; the slowest settable rate is one a second.
const SILENCE_S_MAX: f64 = 2.0;
/// Pictures a second on a terminal; more only flicker.
const PICTURE_HZ: f64 = 10.0;
/// Lines a second in a log.
const LINE_HZ: f64 = 1.0;

/// Where reports go.
enum Sink {
    /// A terminal.
    Picture(Screen, Box<Picture>),
    /// A log for people.
    Lines,
    /// One JSON object a report.
    Json,
}

/// Shows reports until the user leaves, or as long or often as was requested.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &WatchArgs) -> Result<(), Failure> {
    interrupt::watch()?;
    // Limits make the bars; an arm whose settings have faults can be watched without.
    let (arm, scale) = match arm::settings_to_talk(settings) {
        Ok(settings) => (ArmName::of(&settings), Some(Scale::of(&settings))),
        Err(_) => (ArmName::read(settings)?, None),
    };
    let name = arm.name.clone();
    let mut client = Client::join(&name)?;
    let mut footprint = client.wire().footprint();
    let end = Limit::after_s(args.seconds.unwrap_or(f64::INFINITY));
    let mut watch = Watch::new(form, arm, scale, args)?;
    while !interrupt::has_come() && !end.is_over() {
        client.drain_reports(|report, phase| watch.take(report, phase))?;
        watch.show_due()?;
        if watch.shown >= watch.count {
            return Ok(());
        }
        watch.show_silence(&client)?;
        if watch.is_silent()
            && footprint.missing().is_some()
            && let Ok(joined) = Client::join(&name)
        {
            // Closed in earnest, the old ports would delete files of the same names that the streamer has made meanwhile.
            Box::leak(Box::new(std::mem::replace(&mut client, joined)));
            footprint = client.wire().footprint();
        }
        if watch.is_left_within(POLL)? {
            break;
        }
    }
    // Who says how long wants to have seen something by then.
    if end.is_over() && watch.sequence.is_none() {
        return Err(client.wire().not_running(STREAMER).into());
    }
    Ok(())
}

/// What was received and shown so far.
struct Watch {
    arm: ArmName,
    sink: Sink,
    /// From one line or picture to the next, by the streamer's clock.
    period_ns: u64,
    count: u64,
    /// Received, and not shown yet.
    due: Vec<(Report, Phase)>,
    /// The report of the last line or picture.
    last: Option<(Report, Phase)>,
    sequence: Option<u64>,
    received: Instant,
    missed: u64,
    shown: u64,
    silence_said: bool,
}

impl Watch {
    fn new(form: Form, arm: ArmName, scale: Option<Scale>, args: &WatchArgs) -> Result<Self, Failure> {
        let (sink, usual_hz) = match form {
            Form::Json => (Sink::Json, f64::INFINITY),
            Form::Text if is_terminal() => {
                let screen = Screen::whole().map_err(closed)?;
                (Sink::Picture(screen, Box::new(Picture::new(arm.clone(), scale))), PICTURE_HZ)
            }
            Form::Text => (Sink::Lines, LINE_HZ),
        };
        let period = Duration::from_secs_f64(1.0 / args.rate_hz.unwrap_or(usual_hz));
        Ok(Self {
            arm,
            sink,
            period_ns: u64::try_from(period.as_nanos()).unwrap_or(u64::MAX),
            count: args.count.unwrap_or(u64::MAX),
            due: Vec::new(),
            last: None,
            sequence: None,
            received: Instant::now(),
            missed: 0,
            shown: 0,
            silence_said: false,
        })
    }

    /// Notes a report that has arrived.
    fn take(&mut self, report: &Report, phase: Phase) {
        // A streamer that was started again counts from 0.
        let gap = self.sequence.and_then(|last| report.sequence.checked_sub(last.saturating_add(1)));
        self.missed = self.missed.saturating_add(gap.unwrap_or(0));
        self.sequence = Some(report.sequence);
        self.received = Instant::now();
        self.silence_said = false;
        let newest = self.due.last().or(self.last.as_ref()).map(|(r, _)| r.time_ns);
        let is_due = newest.is_none_or(|last_ns| {
            let passed_ns = report.time_ns.checked_sub(last_ns);
            // Time that runs backwards is another host's clock, or none: show it.
            passed_ns.is_none_or(|passed_ns| passed_ns >= self.period_ns)
        });
        if is_due {
            self.due.push((*report, phase));
        }
    }

    /// Shows what is due; of several only the newest makes a picture.
    fn show_due(&mut self) -> Result<(), Failure> {
        let due = std::mem::take(&mut self.due);
        let skipped = if matches!(self.sink, Sink::Picture(..)) { due.len().saturating_sub(1) } else { 0 };
        for (report, phase) in due.into_iter().skip(skipped) {
            if self.shown >= self.count {
                break;
            }
            self.show(&report, phase)?;
            self.last = Some((report, phase));
            self.shown += 1;
        }
        Ok(())
    }

    fn show(&mut self, report: &Report, phase: Phase) -> Result<(), Failure> {
        let before = self.last.as_ref().map(|(r, _)| r);
        match &mut self.sink {
            Sink::Json => Form::Json.print(&Status::of(report, phase, &self.arm)),
            Sink::Lines => {
                let t_s = Duration::from_nanos(report.time_ns).as_secs_f64();
                let line = line(report, phase, &self.arm);
                Form::Text.print_line(&format!("{t_s:10.3} s  {line}"))
            }
            Sink::Picture(screen, picture) => {
                let mut lines = picture.lines(report, phase, before, screen.size().0);
                lines.push(footer(self.missed));
                screen.draw(&lines).map_err(closed)
            }
        }
    }

    fn is_silent(&self) -> bool {
        self.received.elapsed().as_secs_f64() >= SILENCE_S_MAX
    }

    /// Says that no reports come, once in a log and all the time on a terminal.
    fn show_silence(&mut self, client: &Client) -> Result<(), Failure> {
        let silent_s = self.received.elapsed().as_secs_f64();
        if silent_s < SILENCE_S_MAX {
            return Ok(());
        }
        let why = match self.sequence {
            None => client.wire().not_running(STREAMER).to_string(),
            Some(_) => format!("the reports of {STREAMER} have ended: it has gone, or it hangs"),
        };
        let said = std::mem::replace(&mut self.silence_said, true);
        match &mut self.sink {
            Sink::Picture(screen, picture) => {
                let mut lines = vec![Line::of(
                    format!("NO REPORTS for {silent_s:.0} s: {why}. Waiting for it .."),
                    Tone::Bad,
                )];
                if let Some((report, phase)) = &self.last {
                    lines.push(Line::of("The last report (the arm may have changed since):", Tone::Warning));
                    lines.extend(picture.lines(report, *phase, None, screen.size().0));
                }
                lines.push(footer(self.missed));
                screen.draw(&lines).map_err(closed)
            }
            Sink::Lines if !said => {
                note(format_args!("no reports for {silent_s:.1} s: {why}; waiting for it .."));
                Ok(())
            }
            Sink::Json if !said => {
                let arm = &self.arm.name;
                let line = json!({ "schema": SCHEMA, "arm": arm, "phase": null, "silent_s": silent_s, "message": why });
                Form::Json.print_line(&line.to_string())
            }
            Sink::Lines | Sink::Json => Ok(()),
        }
    }

    /// Waits; true when the user leaves.
    fn is_left_within(&self, pause: Duration) -> Result<bool, Failure> {
        match &self.sink {
            Sink::Picture(screen, _) => screen.is_left_within(pause).map_err(closed),
            Sink::Lines | Sink::Json => {
                thread::sleep(pause);
                Ok(false)
            }
        }
    }
}

fn closed(error: io::Error) -> Failure {
    Failure::writing("standard output", error)
}

fn footer(missed: u64) -> Line {
    let missed =
        if missed == 0 { String::new() } else { format!("; {missed} reports came too fast for this view") };
    Line::of(format!("q ends the view; the arm continues{missed}"), Tone::Quiet)
}
