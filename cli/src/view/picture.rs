//! A report as lines for people.
use super::bar::{Ink, progress};
use super::joints::{JointScale, table};
use super::{Line, Span, Tone};
use crate::arm::ArmName;
use crate::words::{fault_sentence, pause_sentence};
use std::time::Duration;
use taustream_arm::Settings;
use taustream_messages::{Phase, Report};

/// Cells of the bar of a motion.
const PROGRESS_CELLS: usize = 30;

/// What the bars are compared with.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Scale {
    pub(super) joints: Vec<JointScale>,
}

impl Scale {
    /// The limits of an arm.
    pub(crate) fn of(settings: &Settings) -> Self {
        let joints = settings.robot.joints.iter().map(|joint| JointScale {
            position_rad: joint.limits.position_rad,
            velocity_rad_s: joint.limits.motion.velocity_rad_s,
            error_rad_max: settings.supervision.tracking_error_rad_max,
        });
        Self { joints: joints.collect() }
    }
}

/// Makes pictures of one arm.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    arm: ArmName,
    scale: Option<Scale>,
    ink: Ink,
}

impl Picture {
    /// Pictures of `arm`, with bars where limits are known.
    pub(crate) fn new(arm: ArmName, scale: Option<Scale>) -> Self {
        Self { arm, scale, ink: Ink::of_locale() }
    }

    /// A report in so many columns; `before` is the report of the last picture, for rates.
    pub(crate) fn lines(
        &self,
        r: &Report,
        phase: Phase,
        before: Option<&Report>,
        columns: usize,
    ) -> Vec<Line> {
        let mut lines = vec![self.state(r, phase), self.motion(r)];
        lines.extend(self.fault(r, phase).wrapped(columns));
        lines.push(Line::default());
        lines.extend(table(r, &self.arm, self.scale.as_ref(), columns, self.ink));
        lines.extend(drive_errors(r, &self.arm).map(|error| Line::of(error, Tone::Bad)));
        lines.push(Line::default());
        lines.extend(self.buses(r));
        lines.push(frames(r, before));
        lines.extend(timing(r));
        lines.into_iter().map(|line| line.cut(columns)).collect()
    }

    fn state(&self, r: &Report, phase: Phase) -> Line {
        let energised = if r.energised == 1 { "energised" } else { "not energised" };
        Line(vec![
            Span::plain(format!("arm {}   ", self.arm.name)),
            Span::new(format!("{:<13}", phase.word().to_uppercase()), tone_of(phase)),
            Span::plain(format!(" {energised}   speed {:.0} %   sigma {:.3}", r.speed_percent, r.sigma)),
        ])
    }

    fn motion(&self, r: &Report) -> Line {
        if r.trajectory_id == 0 {
            return Line::of("no motion since the streamer started", Tone::Quiet);
        }
        let done = progress(r.trajectory_s / r.trajectory_duration_s, PROGRESS_CELLS, self.ink);
        let (at_s, of_s) = (r.trajectory_s, r.trajectory_duration_s);
        Line(vec![
            Span::new(done, Tone::Good),
            Span::plain(format!(
                "  {at_s:.2} of {of_s:.2} s   motion {}, generation {}",
                r.trajectory_id, r.generation
            )),
        ])
    }

    /// How each bus is, and what it lost.
    fn buses(&self, r: &Report) -> impl Iterator<Item = Line> {
        let names = self.arm.names_in(r);
        r.buses().iter().enumerate().map(move |(index, bus)| {
            let is_well = bus.bus_fault == 0 && bus.silent == 0;
            Line(vec![
                Span::plain(format!("{}: ", names.bus(index))),
                Span::new(names.bus_state(index, bus), if is_well { Tone::Good } else { Tone::Bad }),
                Span::plain(format!("   {} sent   {} received", bus.frames_sent, bus.frames_received)),
                count("lost", bus.frames_lost),
                count("error frames", bus.error_frames),
            ])
        })
    }

    fn fault(&self, r: &Report, phase: Phase) -> Line {
        if r.fault_reason == 0 {
            return pause_sentence(r).map_or_else(Line::default, |text| Line::of(text, Tone::Warning));
        }
        let remedy = match phase {
            Phase::Fault => "; then `taustream clear-fault`",
            Phase::Locked => "; cleared: `taustream enable`",
            Phase::Configuring
            | Phase::Disabled
            | Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Homing
            | Phase::Disabling => "",
        };
        Line::of(format!("FAULT: {}{remedy}", fault_sentence(r, &self.arm)), Tone::Bad)
    }
}

/// What each drive that has an error says.
fn drive_errors(r: &Report, arm: &ArmName) -> impl Iterator<Item = String> {
    let names = arm.names_in(r);
    let codes: Vec<u32> = r.drive_error.iter().copied().take(r.joints()).collect();
    let errors = codes.into_iter().enumerate().filter(|(_, code)| *code != 0);
    errors.map(move |(joint, code)| names.drive_error(joint, code))
}

fn tone_of(phase: Phase) -> Tone {
    match phase {
        Phase::Holding | Phase::Moving => Tone::Good,
        Phase::Configuring | Phase::Disabled | Phase::Enabling | Phase::Disabling => Tone::Plain,
        Phase::Pausing | Phase::Paused | Phase::Stopping | Phase::Locked | Phase::Homing => Tone::Warning,
        Phase::FastStopping | Phase::Braking | Phase::Fault => Tone::Bad,
    }
}

/// A count that should stay 0.
fn count(name: &str, value: u64) -> Span {
    Span::new(format!("   {value} {name}"), if value == 0 { Tone::Plain } else { Tone::Warning })
}

fn frames(r: &Report, before: Option<&Report>) -> Line {
    let rate = |now: u64, then: u64, seconds: f64| {
        #[expect(clippy::cast_precision_loss, reason = "frames of a fraction of a second")]
        let frames = now.saturating_sub(then) as f64;
        frames / seconds
    };
    let rates = before.filter(|b| b.time_ns < r.time_ns).map_or_else(String::new, |b| {
        let seconds = Duration::from_nanos(r.time_ns - b.time_ns).as_secs_f64();
        let (sent, received) = (
            rate(r.frames_sent, b.frames_sent, seconds),
            rate(r.frames_received, b.frames_received, seconds),
        );
        format!("   now {sent:.0} and {received:.0} a second")
    });
    Line(vec![
        Span::plain(format!("frames    {} sent   {} received", r.frames_sent, r.frames_received)),
        count("lost", r.frames_lost),
        Span::new(rates, Tone::Quiet),
    ])
}

fn timing(r: &Report) -> [Line; 2] {
    let us = |ns: u64| ns / 1000;
    let cycles = Line(vec![
        Span::plain(format!("cycles    {}", r.cycles)),
        count("late", r.cycles_late),
        count("skipped", r.cycles_skipped),
        count("stalls", r.stalls),
        count("guard trips", r.guard_trips),
        Span::plain(format!("   plans {} accepted, {} rejected", r.accepted, r.rejected)),
    ]);
    let lateness = Line::of(
        format!(
            "late by   p50 {} us   p99 {} us   max {} us      in the cycle   p99 {} us   max {} us",
            us(r.lateness_ns_p50),
            us(r.lateness_ns_p99),
            us(r.lateness_ns_max),
            us(r.cycle_ns_p99),
            us(r.cycle_ns_max)
        ),
        Tone::Plain,
    );
    [cycles, lateness]
}

/// A report in one line of a log, faults as text.
pub(crate) fn line(r: &Report, phase: Phase, arm: &ArmName) -> String {
    let angle = |q: &f64| if q.is_finite() { format!("{q:+.3}") } else { "-".to_owned() };
    let pose: Vec<String> = r.measured_rad.iter().take(r.joints()).map(angle).collect();
    // The fault names the drive that is to blame; without one, the drives speak for themselves.
    let fault = if r.fault_reason == 0 {
        let said = pause_sentence(r).or_else(|| drive_errors(r, arm).next());
        said.map_or_else(String::new, |text| format!("  {text}"))
    } else {
        format!("  FAULT: {}", fault_sentence(r, arm))
    };
    format!(
        "{:<13} sigma {:.2}  at {:.2} of {:.2} s  q {} rad  lateness p99 {} us, late {}  frames lost {}{fault}",
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

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_messages::{BusFault, Cause, FaultReason};
    use taustream_motion::MAX_JOINTS;

    fn arm() -> ArmName {
        ArmName { name: "a".into(), joints: vec!["pan".into(), "lift".into()], ..ArmName::default() }
    }

    fn scale() -> Scale {
        let joint = JointScale { position_rad: [-3.0, 3.0], velocity_rad_s: 2.0, error_rad_max: 0.05 };
        Scale { joints: vec![joint; 2] }
    }

    fn text(lines: &[Line]) -> String {
        let line = |line: &Line| line.0.iter().map(|s| s.text.as_str()).collect::<String>();
        lines.iter().map(line).collect::<Vec<_>>().join("\n")
    }

    fn report() -> Report {
        Report {
            joint_count: 2,
            trajectory_id: 7,
            trajectory_s: 1.0,
            trajectory_duration_s: 4.0,
            measured_rad: [0.5; MAX_JOINTS],
            tracking_error_rad: [0.06; MAX_JOINTS],
            command_velocity_rad_s: [1.0; MAX_JOINTS],
            frames_sent: 1_000,
            time_ns: 2_000_000_000,
            bus_count: 2,
            ..Report::default()
        }
    }

    #[test]
    fn picture_distinguishes_a_faulty_bus_from_a_healthy_one() {
        let mut r = report();
        r.buses[1].bus_fault = BusFault::QueueFull.code();
        let lines = Picture { arm: arm(), scale: None, ink: Ink::ASCII }.lines(&r, Phase::Moving, None, 200);
        let tone = |word: &str| {
            let line = lines.iter().find(|l| text(&[(*l).clone()]).starts_with(word)).unwrap();
            line.0[1].tone
        };
        assert_eq!((tone("bus 1"), tone("bus 2")), (Tone::Good, Tone::Bad), "{}", text(&lines));
    }

    #[test]
    fn picture_shows_phase_joints_bars_and_rates() {
        let before = Report { frames_sent: 900, time_ns: 1_900_000_000, ..report() };
        let lines = Picture { arm: arm(), scale: Some(scale()), ink: Ink::ASCII }.lines(
            &report(),
            Phase::Moving,
            Some(&before),
            200,
        );
        let text = text(&lines);
        for word in
            ["MOVING", "1.00 of 4.00 s", "#######---", "lift", "+60.000", "+1.000", "|###", "now 1000"]
        {
            assert!(text.contains(word), "no `{word}`:\n{text}");
        }
        let beyond = lines.iter().flat_map(|l| &l.0).filter(|s| s.tone == Tone::Bad).count();
        assert_eq!(beyond, 2, "the error bars are beyond their limit:\n{text}");
    }

    #[test]
    fn picture_fits_any_width_and_takes_any_number() {
        let mut odd = report();
        odd.measured_rad = [f64::NAN; MAX_JOINTS];
        odd.command_velocity_rad_s = [f64::INFINITY; MAX_JOINTS];
        (odd.joint_count, odd.trajectory_duration_s, odd.frames_sent) = (u32::MAX, f64::NAN, u64::MAX);
        for columns in 0..220 {
            for r in [report(), odd] {
                let picture = Picture { arm: arm(), scale: Some(scale()), ink: Ink::ASCII };
                for line in picture.lines(&r, Phase::Fault, Some(&odd), columns) {
                    let width: usize = line.0.iter().map(|s| s.text.chars().count()).sum();
                    assert!(width <= columns, "{width} of {columns}: {line:?}");
                }
            }
        }
    }

    #[test]
    fn picture_and_line_state_a_fault_with_its_remedy() {
        let mut fault = report();
        fault.set_cause(Some(Cause::new(FaultReason::TrackingError).at_joint(1)));
        let picture = Picture { arm: arm(), scale: None, ink: Ink::ASCII };
        let shown = text(&picture.lines(&fault, Phase::Fault, None, 200));
        assert!(
            shown.contains("tracking error (rad) at joint 2 `lift`") && shown.contains("clear-fault"),
            "{shown}"
        );
        assert!(line(&fault, Phase::Fault, &arm()).contains("FAULT: tracking error"));
        assert_eq!(line(&fault, Phase::Fault, &arm()).lines().count(), 1);
        let before_feedback = Report { measured_rad: [f64::NAN; MAX_JOINTS], ..report() };
        assert!(
            line(&before_feedback, Phase::Configuring, &arm()).contains("q - - rad"),
            "no NaN for people"
        );
    }
}
