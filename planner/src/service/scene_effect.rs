//! What a change of the scene means for the motion that runs: nothing, another way to its goal, or a stop on its path.
//!
//! The rest of the motion is swept against what has changed. Where it is not free any more, a replacement at a cut leads
//! to the same goal, if one is proven while the arm can still stop before the contact; else the streamer stops the arm on its path.
//! When a stop ends is computed as the streamer does it. The streamer's stop needs no plan, so that it always exists.
use super::moving::{LATENCY_MARGIN_S, runs};
use super::{RECEIPT_TAKES, Service};
use crate::budget::Budget;
use crate::in_motion::{CutPoint, NoReplacement, Replacement, Surroundings};
use crate::live_scene::{Changed, SceneRevision};
use crate::plan::PlanOptions;
use crate::stop_ahead::{StopAhead, Stops};
use crate::stream_cut::{age_s, rate};
use crate::verify::{Stretch, Violation, first_contact};
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_messages::clock::now_ns;
use taustream_messages::scene_reply::MotionEffect;
use taustream_messages::{Command, CommandRequest, Outcome, Phase, Report};
use taustream_motion::Trajectory;
use tracing::{info, warn};

/// How long the next report is waited for when the last one may be of before a motion was accepted.
const REPORT_SOON: Duration = Duration::from_millis(100);
/// How long the sweep of the motion that runs may take; what is not settled then counts as blocked.
const SWEEP_WITHIN: Duration = Duration::from_millis(50);
/// Most that a search for another way may take, s.
const SEARCH_S_MAX: f64 = 0.2;
/// A search that has less time is not begun, s.
const SEARCH_S_MIN: f64 = 0.02;
/// For how long a replacement may be taken: after it the stop is sent.
const VALID: Duration = Duration::from_millis(100);
/// What a stop takes until the streamer begins it, s.
const STOP_BEGINS_S: f64 = 0.005;
/// For how long a stop may be carried out, and how long its answer is waited for.
const STOP_VALID: Duration = Duration::from_millis(200);
/// How often that answer is looked for.
const LOOK: Duration = Duration::from_millis(1);

/// What became of the motion.
pub(super) struct Effect {
    pub(super) effect: MotionEffect,
    /// Which link, which obstacle, where and when; empty where nothing is in the way.
    pub(super) note: String,
    pub(super) checked_ns: u64,
    pub(super) acted_ns: u64,
}

impl Effect {
    fn none(effect: MotionEffect) -> Self {
        let now_ns = now_ns();
        Self { effect, note: String::new(), checked_ns: now_ns, acted_ns: now_ns }
    }
}

/// A part of what the streamer has accepted, and when it runs, in trajectory time.
struct Part {
    trajectory: Trajectory,
    span_s: [f64; 2],
}

/// The first contact of the motion that runs.
struct InTheWay {
    /// Trajectory time of now.
    now_s: f64,
    /// Trajectory time of the first contact.
    at_s: f64,
    parts: Vec<Part>,
    violation: Violation,
}

/// The joints of groups that a motion leaves where they are, a bit each: a way round takes no other arm along.
fn resting(robot: &Robot, motion: &Trajectory) -> u32 {
    let rests = |joint: usize| motion.strokes().iter().all(|stroke| stroke.delta_rad[joint] == 0.0);
    let groups = robot.groups.iter().filter(|group| group.joints.iter().all(|joint| rests(*joint)));
    groups.flat_map(|group| &group.joints).fold(0, |bits, joint| bits | (1 << joint))
}

impl Service<'_> {
    /// The streamer's newest report, when it reports.
    pub(super) fn known_report(&self) -> Option<(Report, Phase)> {
        let found = match self.outbox.current_report(REPORT_SOON) {
            // What was accepted after it is not in it.
            Ok((report, _)) if report.time_ns <= self.outbox.accepted_ns() => {
                self.outbox.fresh_report(REPORT_SOON)
            }
            found => found,
        };
        found.map_err(|e| info!("no report while the scene changes: {e}")).ok()
    }

    /// Checks the motion that runs against what has changed, and leads or stops the arm where it is not free any more.
    pub(super) fn effect_on_motion(&self, changed: &Changed) -> Effect {
        let Some((report, _)) = self.known_report().filter(|(_, phase)| runs(*phase)) else {
            return Effect::none(MotionEffect::Rests);
        };
        if changed.is_empty() {
            return Effect::none(MotionEffect::Free);
        }
        let revision = self.revision();
        let Some(parts) = self.committed(&report) else {
            let checked_ns = now_ns();
            let why = "a motion runs that this planner does not know, so that nothing is proven of it";
            return self.stop((MotionEffect::StoppedLate, false), (why, checked_ns));
        };
        let in_the_way = contact(&revision, changed, &report, parts);
        let checked_ns = now_ns();
        let Some(in_the_way) = in_the_way else {
            return Effect { checked_ns, ..Effect::none(MotionEffect::Free) };
        };
        self.avoid(&revision, (&report, &in_the_way), checked_ns)
    }

    /// What the streamer has accepted, from now on; `None` when its strokes are not known.
    fn committed(&self, report: &Report) -> Option<Vec<Part>> {
        let now_s = now_s(report);
        self.foreign.look();
        let strokes = |id: u64| self.outbox.known(id).or_else(|| self.foreign.known(id));
        let running = strokes(report.trajectory_id)?;
        let end_s = running.duration_s();
        if report.successor_id == 0 {
            return Some(vec![Part { trajectory: running, span_s: [now_s, end_s.max(now_s)] }]);
        }
        let waits = strokes(report.successor_id)?;
        let from_s = report.successor_from_s.max(now_s);
        let waits_span_s = [from_s, waits.duration_s().max(from_s)];
        Some(vec![
            Part { trajectory: running, span_s: [now_s, from_s] },
            Part { trajectory: waits, span_s: waits_span_s },
        ])
    }

    fn avoid(
        &self,
        revision: &SceneRevision,
        (report, in_the_way): (&Report, &InTheWay),
        checked_ns: u64,
    ) -> Effect {
        let InTheWay { now_s, at_s, parts, violation } = in_the_way;
        let rate = rate(report);
        let in_s = if rate > 0.0 { (at_s - now_s).max(0.0) / rate } else { f64::INFINITY };
        let when = if in_s.is_finite() { format!(", in {in_s:.3} s") } else { String::new() };
        let why = format!("the motion is not free any more: {violation}{when}");
        warn!("{why}");
        let pieces: Vec<(&Trajectory, f64)> =
            parts.iter().map(|part| (&part.trajectory, part.span_s[0])).collect();
        let stops = StopAhead::new(&self.robot.limits(), self.robot.joints.len(), &pieces)
            .stops(now_s + rate * STOP_BEGINS_S, rate);
        let Stops { gentle_rest_s, fast_rest_s } = stops;
        let spare_s = if rate > 0.0 { (at_s - gentle_rest_s) / rate } else { f64::INFINITY };
        let rerouted =
            if self.stream.leads(report) { None } else { self.reroute(revision, report, (*at_s, spare_s)) };
        if let Some((trajectory_id, how)) = rerouted {
            let effect = MotionEffect::Rerouted { trajectory_id };
            let note = format!("{why}; rerouted: {how}");
            return self.note(Effect { effect, note, checked_ns, acted_ns: now_ns() });
        }
        // A search has taken some of the time.
        let passed_s = rate * Duration::from_nanos(now_ns().saturating_sub(checked_ns)).as_secs_f64();
        let is_late = |rest_s: f64| rest_s + passed_s >= *at_s;
        match (is_late(gentle_rest_s), is_late(fast_rest_s)) {
            (false, _) => self.stop((MotionEffect::Stopped, false), (&why, checked_ns)),
            (true, false) => self.stop((MotionEffect::Stopped, true), (&why, checked_ns)),
            (true, true) => self.stop((MotionEffect::StoppedLate, true), (&why, checked_ns)),
        }
    }

    /// Another way to the goal, if one is proven and accepted while a stop would still be in time.
    fn reroute(
        &self,
        revision: &SceneRevision,
        report: &Report,
        (contact_s, spare_s): (f64, f64),
    ) -> Option<(u64, String)> {
        let begun = Instant::now();
        let cancel = AtomicBool::new(false);
        // A stop stays on the path, and keeps whatever it keeps.
        let constraints = self.running_constraints(report)?;
        let latency_s = self.latency.quantile_s() + LATENCY_MARGIN_S;
        for search_s in [0.0, SEARCH_S_MAX] {
            let left_s = spare_s - begun.elapsed().as_secs_f64() - latency_s;
            let search_s = search_s.min(left_s);
            if left_s <= 0.0 || (search_s > 0.0 && search_s < SEARCH_S_MIN) {
                return None;
            }
            let report = self.known_report().map_or(*report, |(newer, _)| newer);
            let cut = self.cut_ahead(&report, latency_s + search_s);
            if cut.at_s >= contact_s {
                return None;
            }
            let deadline = Duration::from_secs_f64(if search_s > 0.0 { search_s } else { left_s.min(1.0) });
            let options = PlanOptions { deadline, constraints, ..PlanOptions::default() };
            let goal_rad = cut.end_rad;
            let (robot, scene) = (&*revision.robot, &*revision.scene);
            let held_joints = cut.trajectory.as_ref().map_or(0, |motion| resting(robot, motion));
            let surroundings = Surroundings { robot, scene, cancel: &cancel, held_joints };
            let made = if search_s > 0.0 {
                surroundings.rest_first((&cut, &[goal_rad]), &options)
            } else {
                surroundings.direct((&cut, &[goal_rad]), &options)
            };
            if let Some(sent) = self.send_reroute(revision, &report, (&cut, made)) {
                self.remember(sent.0, Some(constraints));
                return Some(sent);
            }
        }
        None
    }

    fn send_reroute(
        &self,
        revision: &SceneRevision,
        report: &Report,
        (cut, made): (&CutPoint, Result<Replacement, NoReplacement>),
    ) -> Option<(u64, String)> {
        let made = made.map_err(|e| info!("no other way from {:.3} s: {e}", cut.at_s)).ok()?;
        let replaced = (&made.trajectory, made.replaces);
        let turn = self.commit(revision, (&made.trajectory, cut.at_s), VALID + RECEIPT_TAKES);
        let turn = turn.map_err(|reason| info!("the other way is not sent: {reason}")).ok()?;
        let sent = self.outbox.send_after(self.robot, report, replaced, VALID + RECEIPT_TAKES);
        turn.settle(&sent);
        let sent = sent.map_err(|e| warn!("{e}")).ok()?;
        match sent.receipt.and_then(|receipt| receipt.outcome()) {
            Some(Outcome::Accepted { .. }) => Some((sent.trajectory_id, made.how)),
            outcome @ (Some(Outcome::Rejected(_)) | None) => {
                info!("the other way was not taken: {outcome:?}");
                None
            }
        }
    }

    /// Lets the streamer stop the arm on its path.
    pub(super) fn stop(
        &self,
        (effect, fast): (MotionEffect, bool),
        (why, checked_ns): (&str, u64),
    ) -> Effect {
        let (command, words) = if fast {
            (Command::FastStop, "a fast stop on the path, which ends in a fault")
        } else {
            (Command::Stop, "a stop on the path")
        };
        let sent = self.command(command);
        let acted_ns = now_ns();
        let (effect, note) = match (sent, effect) {
            (Ok(()), MotionEffect::StoppedLate) => {
                (effect, format!("{why}; {words}, which may end beyond the first contact"))
            }
            (Ok(()), _) => (effect, format!("{why}; {words}")),
            (Err(reason), _) => {
                (MotionEffect::StoppedLate, format!("{why}; {words} was not taken: {reason}"))
            }
        };
        self.note(Effect { effect, note, checked_ns, acted_ns })
    }

    fn command(&self, command: Command) -> Result<(), String> {
        let pending = self
            .commands
            .send_copy(CommandRequest::new(command, STOP_VALID))
            .map_err(|e| format!("it could not be sent: {e:?}"))?;
        self.command_events.notify();
        let since = Instant::now();
        while since.elapsed() < STOP_VALID {
            match pending.receive() {
                Ok(Some(reply)) => {
                    let reply = reply.payload();
                    return if reply.is_accepted() { Ok(()) } else { Err(reply.text()) };
                }
                Ok(None) => thread::sleep(LOOK),
                Err(e) => return Err(format!("its answer could not be read: {e:?}")),
            }
        }
        Err("the streamer did not answer".to_owned())
    }

    fn note(&self, effect: Effect) -> Effect {
        warn!("{}", effect.note);
        self.last_effect.borrow_mut().clone_from(&effect.note);
        effect
    }
}

/// Trajectory time of now.
fn now_s(report: &Report) -> f64 {
    report.trajectory_s + rate(report) * age_s(report, now_ns())
}

/// The first contact of what was accepted with what has changed.
fn contact(
    revision: &SceneRevision,
    changed: &Changed,
    report: &Report,
    parts: Vec<Part>,
) -> Option<InTheWay> {
    let world = revision.world.only(&changed.obstacles, &changed.links);
    let budget = Budget::until(SWEEP_WITHIN, None);
    let found = parts.iter().find_map(|part| {
        let stretch = Stretch { world: &world, span_s: part.span_s };
        first_contact(&stretch, &part.trajectory, &budget)
    });
    found.map(|(at_s, violation)| InTheWay { now_s: now_s(report), at_s, parts, violation })
}
