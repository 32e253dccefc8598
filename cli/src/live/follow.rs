//! Waiting until a motion has ended.
use super::client::{Client, Limit};
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::{fault_sentence, pause_sentence, stalls_sentence};
use serde::Serialize;
use std::fmt;
use std::thread;
use std::time::Duration;
use taustream_messages::{Phase, Report};

/// Without a report for this long the streamer counts as gone; so does a motion that never shows up in one.
const SILENCE_S_MAX: f64 = 2.0;
/// Rounding that the last step of trajectory time may leave.
const END_TOLERANCE_S: f64 = 1e-6;

/// How a motion went, as far as reports tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Executed {
    /// From the first report in which it moved to the first in which it rested, by the streamer's clock.
    pub(crate) executed_s: f64,
    /// Largest tracking error of any joint while it moved.
    pub(crate) tracking_error_rad_max: f64,
    /// Stalls of the streamer's loop on the way: gaps between setpoints that the drives do not bridge.
    pub(crate) stalls: u64,
}

impl fmt::Display for Executed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let error_mrad = self.tracking_error_rad_max * 1e3;
        write!(f, "executed      in {:.3} s, largest tracking error {error_mrad:.3} mrad", self.executed_s)?;
        match stalls_sentence(self.stalls) {
            None => Ok(()),
            Some(sentence) => write!(f, "\nstalls        {sentence}"),
        }
    }
}

/// Says once for each pause why the arm is paused, for a command that waits for its motion.
pub(crate) fn say_pauses(form: Form) -> impl FnMut(&Report, Phase) -> Result<(), Failure> {
    let mut before = None;
    move |report, _| {
        let now = pause_sentence(report);
        if let Some(text) = now.as_ref().filter(|_| now != before) {
            form.progress(text);
        }
        before = now;
        Ok(())
    }
}

/// Waits until the motion has ended; `see` gets every report on the way and may end the wait.
///
/// # Errors
/// When it does not reach its end: fault, stop, another motion, no reports any more, Ctrl-C, or what `see` says.
pub(crate) fn follow(
    client: &Client,
    arm: &ArmName,
    trajectory_id: u64,
    mut see: impl FnMut(&Report, Phase) -> Result<(), Failure>,
) -> Result<Executed, Failure> {
    let mut watch = Watch::of(trajectory_id);
    let mut silence = Limit::after_s(SILENCE_S_MAX);
    loop {
        interrupt::check()?;
        let mut news = Vec::new();
        client.drain_reports(|report, phase| news.push((*report, phase)))?;
        for (report, phase) in &news {
            see(report, *phase)?;
            if let Some(executed) = watch.evaluate(report, *phase, arm)? {
                return Ok(executed);
            }
        }
        if !news.is_empty() && (watch.seen || watch.waits) {
            silence = Limit::after_s(SILENCE_S_MAX);
        } else if silence.is_over() {
            let why = if news.is_empty() {
                "the streamer's reports have ended in mid-motion; look at its log, and at the arm"
            } else {
                "the motion was accepted, but another one runs; `taustream status` shows it"
            };
            return Err(Failure::Failed(why.to_owned()));
        }
        thread::sleep(Duration::from_millis(2));
    }
}

/// Evaluates reports one after another.
struct Watch {
    trajectory_id: u64,
    seen: bool,
    first_ns: Option<u64>,
    tracking_error_rad_max: f64,
    /// Stalls of the streamer before the motion.
    stalls_before: Option<u64>,
    /// It waits for its cut.
    waits: bool,
    /// The trajectory that follows when this one has reached its end.
    next_id: Option<u64>,
}

impl Watch {
    fn of(trajectory_id: u64) -> Self {
        Self {
            trajectory_id,
            seen: false,
            first_ns: None,
            tracking_error_rad_max: 0.0,
            stalls_before: None,
            waits: false,
            next_id: None,
        }
    }

    /// `Some` when the motion has ended at its end; an error when it has ended elsewhere.
    fn evaluate(&mut self, r: &Report, phase: Phase, arm: &ArmName) -> Result<Option<Executed>, Failure> {
        let stopped = |how: &str, why: &str| {
            let (at_s, of_s) = (r.trajectory_s, r.trajectory_duration_s);
            Failure::Failed(format!("the motion was {how} at {at_s:.3} of {of_s:.3} s: {why}"))
        };
        if r.trajectory_id != self.trajectory_id {
            if self.seen && self.next_id == Some(r.trajectory_id) {
                return Ok(Some(self.executed(r)));
            }
            // Until the first report after the acceptance an older motion stands there.
            self.stalls_before = Some(r.stalls);
            let why = format!("another one, {}, took over", r.trajectory_id);
            if self.seen {
                return Err(stopped("dropped", &why));
            }
            let waited = std::mem::replace(&mut self.waits, r.successor_id == self.trajectory_id);
            return if waited && !self.waits { Err(self.not_begun(r, phase)) } else { Ok(None) };
        }
        self.seen = true;
        let follows = r.successor_id != 0 && r.successor_from_s + END_TOLERANCE_S >= r.trajectory_duration_s;
        self.next_id = follows.then_some(r.successor_id);
        self.stalls_before.get_or_insert(r.stalls);
        let errors = r.tracking_error_rad.iter().take(r.joints());
        self.tracking_error_rad_max = errors.fold(self.tracking_error_rad_max, |max, e| max.max(e.abs()));
        match phase {
            Phase::Holding => {}
            Phase::Fault | Phase::FastStopping | Phase::Braking | Phase::Locked => {
                return Err(stopped("stopped", &fault_sentence(r, arm)));
            }
            Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping => {
                self.first_ns.get_or_insert(r.time_ns);
                return Ok(None);
            }
            Phase::Configuring | Phase::Disabled | Phase::Enabling | Phase::Homing | Phase::Disabling => {
                return Err(stopped("dropped", &format!("the arm is {}", phase.word())));
            }
        }
        if r.trajectory_s + END_TOLERANCE_S < r.trajectory_duration_s {
            return Err(stopped("dropped", "the arm was stopped by another command"));
        }
        Ok(Some(self.executed(r)))
    }

    fn executed(&self, r: &Report) -> Executed {
        let executed_ns = self.first_ns.map_or(0, |first| r.time_ns.saturating_sub(first));
        Executed {
            executed_s: Duration::from_nanos(executed_ns).as_secs_f64(),
            tracking_error_rad_max: self.tracking_error_rad_max,
            stalls: r.stalls.saturating_sub(self.stalls_before.unwrap_or(r.stalls)),
        }
    }

    /// It waited for its cut, and does not any more.
    fn not_begun(&self, r: &Report, phase: Phase) -> Failure {
        Failure::Failed(if r.successor_id == 0 {
            format!(
                "trajectory {} waited for its cut and was dropped: the arm is {}",
                self.trajectory_id,
                phase.word()
            )
        } else {
            format!(
                "trajectory {} took the place of trajectory {}, which waited",
                r.successor_id, self.trajectory_id
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(id: u64, at_s: f64, time_ms: u64) -> Report {
        Report {
            joint_count: 1,
            trajectory_id: id,
            trajectory_s: at_s,
            trajectory_duration_s: 1.0,
            time_ns: time_ms * 1_000_000,
            ..Report::default()
        }
    }

    fn arm() -> ArmName {
        ArmName { name: "a".into(), ..ArmName::default() }
    }

    fn walk(steps: &[(Report, Phase)]) -> Result<Option<Executed>, String> {
        let mut watch = Watch::of(7);
        for (report, phase) in steps {
            if let Some(end) = watch.evaluate(report, *phase, &arm()).map_err(|e| e.to_string())? {
                return Ok(Some(end));
            }
        }
        Ok(None)
    }

    #[test]
    fn motion_that_reaches_its_end_is_done_and_timed_by_the_streamers_clock() {
        let steps = [
            (report(3, 1.0, 90), Phase::Holding),
            (report(7, 0.0, 100), Phase::Moving),
            (report(7, 0.5, 600), Phase::Paused),
            (report(7, 1.0, 1350), Phase::Holding),
        ];
        let end = walk(&steps).unwrap().unwrap();
        assert!((end.executed_s - 1.25).abs() < 1e-12, "{end:?}");
        assert!(!end.to_string().contains("stalls"), "{end}");
    }

    #[test]
    fn motion_in_which_the_loop_stalled_says_so_with_the_count_of_its_own_stalls() {
        let with = |stalls, report| Report { stalls, ..report };
        let steps = [
            (with(4, report(3, 1.0, 90)), Phase::Holding),
            (with(5, report(7, 0.5, 100)), Phase::Moving),
            (with(6, report(7, 1.0, 1350)), Phase::Holding),
        ];
        let end = walk(&steps).unwrap().unwrap();
        assert_eq!(end.stalls, 2);
        assert!(end.to_string().contains("2 gaps between setpoints"), "{end}");
    }

    /// A motion that waits behind another one for its cut at `from_s`.
    fn waits(from_s: f64, report: Report) -> Report {
        Report { successor_id: 7, successor_from_s: from_s, ..report }
    }

    #[test]
    fn motion_that_waits_for_its_cut_is_followed_from_there() {
        let steps = [
            (waits(1.0, report(3, 0.2, 90)), Phase::Moving),
            (waits(1.0, report(3, 0.2, 95)), Phase::Paused),
            (report(7, 1.0, 1_000), Phase::Moving),
            (Report { trajectory_duration_s: 2.0, ..report(7, 2.0, 2_000) }, Phase::Holding),
        ];
        assert!((walk(&steps).unwrap().unwrap().executed_s - 1.0).abs() < 1e-12);
        let dropped = walk(&[steps[0], (report(3, 0.3, 120), Phase::Stopping)]).unwrap_err();
        assert!(dropped.contains("was dropped: the arm is stopping"), "{dropped}");
        let other = Report { successor_id: 8, ..report(3, 0.3, 120) };
        let replaced = walk(&[steps[0], (other, Phase::Moving)]).unwrap_err();
        assert!(replaced.contains("trajectory 8 took the place of trajectory 7"), "{replaced}");
    }

    /// Goal: a motion whose end is where the next one begins has reached it; one that is cut before has not.
    #[test]
    fn motion_that_goes_over_into_the_next_at_its_end_is_done() {
        let next = |from_s, report| Report { successor_id: 9, successor_from_s: from_s, ..report };
        let over = (report(9, 1.0, 1_100), Phase::Moving);
        assert!(walk(&[(next(1.0, report(7, 0.5, 100)), Phase::Moving), over]).unwrap().is_some());
        let cut = walk(&[(next(0.9, report(7, 0.5, 100)), Phase::Moving), over]).unwrap_err();
        assert!(cut.contains("another one, 9"), "{cut}");
    }

    #[test]
    fn motion_that_does_not_reach_its_end_says_why() {
        let moving = (report(7, 0.4, 100), Phase::Moving);
        let stopped = walk(&[moving, (report(7, 0.5, 200), Phase::Holding)]).unwrap_err();
        assert!(stopped.contains("0.500 of 1.000 s"), "{stopped}");
        let replaced = walk(&[moving, (report(9, 0.1, 200), Phase::Moving)]).unwrap_err();
        assert!(replaced.contains("another one, 9"), "{replaced}");
        let faulted = walk(&[moving, (report(7, 0.5, 200), Phase::Fault)]).unwrap_err();
        assert!(faulted.contains("no fault is reported"), "{faulted}");
        let disabled = walk(&[moving, (report(7, 0.5, 200), Phase::Disabled)]).unwrap_err();
        assert!(disabled.contains("disabled"), "{disabled}");
    }
}
