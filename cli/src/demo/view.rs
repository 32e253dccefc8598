//! The live view: in place on a terminal, one line a second elsewhere.
use crate::arm::ArmName;
use crate::output::Form;
use crossterm::cursor::MoveUp;
use crossterm::execute;
use crossterm::style::Print;
use crossterm::terminal::{Clear, ClearType};
use std::fmt::Write as _;
use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};
use taustream_messages::{Phase, Report};

/// Pictures a second on a terminal; more only flicker.
const PICTURE: Duration = Duration::from_millis(100);
/// Lines elsewhere: a log is read later, by people.
const LINE: Duration = Duration::from_secs(1);

/// How to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Style {
    /// Drawn over itself.
    InPlace,
    /// Line by line.
    Lines,
    /// Programs read the summary only.
    Silent,
}

/// Shows reports, rarely enough for people.
pub(crate) struct View {
    style: Style,
    joints: Vec<String>,
    goals: usize,
    current: usize,
    shown: Option<Instant>,
    lines_on_screen: u16,
}

impl View {
    /// A view on stdout.
    pub(crate) fn new(form: Form, arm: &ArmName, goals: usize) -> Self {
        let style = match form {
            Form::Json => Style::Silent,
            Form::Text if io::stdout().is_terminal() => Style::InPlace,
            Form::Text => Style::Lines,
        };
        Self { style, joints: arm.joints.clone(), goals, current: 0, shown: None, lines_on_screen: 0 }
    }

    /// The next move begins, counted from 1.
    pub(crate) fn begin_move(&mut self, number: usize) {
        self.current = number;
    }

    /// Shows a report if it is time to.
    pub(crate) fn show(&mut self, report: &Report, phase: Phase, t_s: f64) {
        let pause = match self.style {
            Style::InPlace => PICTURE,
            Style::Lines => LINE,
            Style::Silent => return,
        };
        if self.shown.is_some_and(|shown| shown.elapsed() < pause) {
            return;
        }
        self.shown = Some(Instant::now());
        // A view that cannot be shown is no reason to stop the arm.
        let _shown = match self.style {
            Style::InPlace => self.draw(&self.picture(report, phase, t_s)),
            Style::Lines | Style::Silent => execute!(io::stdout(), Print(self.line(report, phase, t_s))),
        };
        self.lines_on_screen = u16::try_from(self.joints.len() + 5).unwrap_or(0);
    }

    fn draw(&self, picture: &str) -> io::Result<()> {
        let mut out = io::stdout().lock();
        if self.lines_on_screen > 0 {
            execute!(out, MoveUp(self.lines_on_screen))?;
        }
        for line in picture.lines() {
            execute!(out, Clear(ClearType::CurrentLine), Print(line), Print("\n"))?;
        }
        Ok(())
    }

    /// One line a joint and five round them; `lines_on_screen` counts on it.
    fn picture(&self, r: &Report, phase: Phase, t_s: f64) -> String {
        let mut text = String::new();
        let bar = bar(r.trajectory_s, r.trajectory_duration_s);
        // Writing to a string cannot fail.
        let _ok = writeln!(
            text,
            "{t_s:7.1} s   move {} of {}   {:<13} sigma {:.3}   {bar} {:.2} of {:.2} s",
            self.current,
            self.goals,
            phase.word(),
            r.sigma,
            r.trajectory_s,
            r.trajectory_duration_s
        );
        let _ok =
            writeln!(text, "  joint              commanded     measured   error (mrad)   velocity (rad/s)");
        for (j, name) in self.joints.iter().enumerate() {
            let at = |array: &[f64]| array.get(j).copied().unwrap_or(f64::NAN);
            let _ok = writeln!(
                text,
                "  {name:<16} {:>+11.4}  {:>+11.4}   {:>+12.3}   {:>+16.3}",
                at(&r.command_rad),
                at(&r.measured_rad),
                at(&r.tracking_error_rad) * 1e3,
                at(&r.command_velocity_rad_s)
            );
        }
        let _ok = writeln!(
            text,
            "  lateness (us)  p50 {}  p99 {}  max {}   cycles {}  late {}  skipped {}",
            r.lateness_ns_p50 / 1000,
            r.lateness_ns_p99 / 1000,
            r.lateness_ns_max / 1000,
            r.cycles,
            r.cycles_late,
            r.cycles_skipped
        );
        let _ok = writeln!(
            text,
            "  frames         {} sent  {} lost  {} received",
            r.frames_sent, r.frames_lost, r.frames_received
        );
        let _ok = writeln!(text, "  Ctrl-C stops the arm");
        text
    }

    fn line(&self, r: &Report, phase: Phase, t_s: f64) -> String {
        let pose: Vec<String> = r.measured_rad.iter().take(r.joints()).map(|q| format!("{q:+.3}")).collect();
        format!(
            "{t_s:6.1} s  move {} of {}  {:<13} sigma {:.2}  at {:.2} of {:.2} s  q {} rad  lateness p99 {} us, late {}  frames lost {}\n",
            self.current,
            self.goals,
            phase.word(),
            r.sigma,
            r.trajectory_s,
            r.trajectory_duration_s,
            pose.join(" "),
            r.lateness_ns_p99 / 1000,
            r.cycles_late,
            r.frames_lost
        )
    }
}

/// How far a motion has come: "[####------]".
fn bar(at_s: f64, of_s: f64) -> String {
    const WIDTH: usize = 20;
    let done =
        (1..=WIDTH).filter(|cell| at_s / of_s * 20.0 >= f64::from(u8::try_from(*cell).unwrap_or(u8::MAX)));
    let done = done.count();
    format!("[{}{}]", "#".repeat(done), "-".repeat(WIDTH - done))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn view_picture_has_as_many_lines_as_are_drawn_over() {
        let arm = ArmName { name: "a".into(), joints: vec!["pan".into(), "lift".into()], buses: Vec::new() };
        let mut view = View::new(Form::Json, &arm, 3);
        view.style = Style::InPlace;
        let report = Report { joint_count: 2, ..Report::default() };
        assert_eq!(view.picture(&report, Phase::Moving, 1.0).lines().count(), arm.joints.len() + 5);
        assert_eq!(view.line(&report, Phase::Moving, 1.0).lines().count(), 1);
    }

    #[test]
    fn bar_is_as_long_for_any_number() {
        for (at_s, of_s) in [(0.0, 0.0), (f64::NAN, 1.0), (5.0, 1.0), (-1.0, 1.0), (0.5, 1.0)] {
            assert_eq!(bar(at_s, of_s).len(), 22, "{at_s} of {of_s}");
        }
        assert_eq!(bar(0.5, 1.0), "[##########----------]");
    }
}
