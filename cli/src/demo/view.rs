//! The demo's live view: in place on a terminal, one line a second elsewhere.
use crate::output::Form;
use crate::view::{Line, Picture, Screen, Tone, is_terminal, line};
use crate::{arm::ArmName, view::Scale};
use std::io::{self, Write};
use std::time::{Duration, Instant};
use taustream_arm::printable::printable;
use taustream_messages::{Phase, Report};

/// Pictures a second on a terminal; more only flicker.
const PICTURE: Duration = Duration::from_millis(100);
/// Lines elsewhere: a log is read later, by people.
const LINE: Duration = Duration::from_secs(1);

/// How to show.
enum Style {
    /// Drawn over itself.
    InPlace(Screen),
    /// Line by line.
    Lines,
    /// Programs read the summary only.
    Silent,
}

/// Shows reports, rarely enough for people.
pub(crate) struct View {
    style: Style,
    arm: ArmName,
    picture: Picture,
    goals: usize,
    current: usize,
    shown: Option<(Instant, Report)>,
}

impl View {
    /// A view on stdout.
    pub(crate) fn new(form: Form, arm: &ArmName, scale: Scale, goals: usize) -> Self {
        let style = match form {
            Form::Json => Style::Silent,
            Form::Text if is_terminal() => Style::InPlace(Screen::below()),
            Form::Text => Style::Lines,
        };
        let picture = Picture::new(arm.clone(), Some(scale));
        Self { style, arm: arm.clone(), picture, goals, current: 0, shown: None }
    }

    /// The next move begins, counted from 1.
    pub(crate) fn begin_move(&mut self, number: usize) {
        self.current = number;
    }

    /// Shows a report if it is time to.
    pub(crate) fn show(&mut self, report: &Report, phase: Phase, t_s: f64) {
        let pause = match self.style {
            Style::InPlace(_) => PICTURE,
            Style::Lines => LINE,
            Style::Silent => return,
        };
        if self.shown.as_ref().is_some_and(|(at, _)| at.elapsed() < pause) {
            return;
        }
        let which = format!("{t_s:6.1} s  move {} of {}", self.current, self.goals);
        // A view that cannot be shown is no reason to stop the arm.
        let _shown = match &mut self.style {
            Style::InPlace(screen) => {
                let before = self.shown.as_ref().map(|(_, before)| before);
                let mut lines = vec![Line::of(which, Tone::Plain)];
                lines.extend(self.picture.lines(report, phase, before, screen.size().0));
                lines.push(Line::of("Ctrl-C stops the arm", Tone::Quiet));
                screen.draw(&lines)
            }
            Style::Lines | Style::Silent => {
                let line = format!("{which}  {}", line(report, phase, &self.arm));
                writeln!(io::stdout(), "{}", printable(&line))
            }
        };
        self.shown = Some((Instant::now(), *report));
    }
}
