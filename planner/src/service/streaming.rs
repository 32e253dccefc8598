//! Streams of targets: each one cuts what the one before it has committed, and what is committed ends at rest.
//!
//! The newest request counts. A target that cannot be kept is approached as far as it can be, and the answer says so; one that
//! cannot be approached at all leaves the committed motion as it is. So a stream that ends, a client that dies, and a planner
//! that dies leave the arm at rest, on a way that was proven.
use super::moving::{LATENCY_MARGIN_S, Latency, is_too_late, runs};
use super::{RECEIPT_WITHIN, Service, is_alive, not_ready};
use crate::budget::Budget;
use crate::in_motion::folded;
use crate::live_scene::SceneRevision;
use crate::replacement::to_rest;
use crate::send::{RECEIPT_TAKES, REPORT_WITHIN, check_robot};
use crate::stream::{Follower, Lead, Piece, Reference, Trend};
use crate::stream_cut::{cut, rate};
use crate::verify::{Stretch, verify_free};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::prelude::ipc;
use std::time::{Duration, Instant};
use taustream_arm::Robot;
use taustream_messages::clock::now_ns;
use taustream_messages::target::{CheckedTargets, Target, TargetOutcome, TargetReply, TargetRequest};
use taustream_messages::{Outcome, Phase, Replaces, Report};
use taustream_motion::cut::{Kept, kept};
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, Trajectory};
use tracing::{info, warn};

/// How often a piece is made anew because the arm was faster; each aims twice as far ahead. The last target of a stream has
/// no newer one behind it, so that giving up on it would leave the arm on the way.
const TRIES: u32 = 5;
/// Shares of the way to a target that are tried until one is proven free.
const SHARES: [f64; 5] = [1.0, 0.5, 0.25, 0.125, 0.03];
/// How often refusals are logged, at most.
const LOG_EVERY: Duration = Duration::from_secs(1);
/// How long the proof of a piece may take, with all shares of its way: an arm that is followed moves on meanwhile.
const PROOF_WITHIN: Duration = Duration::from_millis(500);
/// What a target that does not fit into one message is continued after.
const CONTINUE_AFTER: Duration = Duration::from_millis(100);

type Request = ActiveRequest<ipc::Service, TargetRequest, (), TargetReply, ()>;

/// What is followed.
pub(super) struct Stream {
    follower: Follower,
    latency: Latency,
    committed: Option<Committed>,
    unfinished: Option<Unfinished>,
    trend: Trend,
    logged: Option<Instant>,
    not_logged: u64,
}

/// The newest piece that the streamer has accepted.
struct Committed {
    trajectory_id: u64,
    reference: Reference,
    /// CLOCK_MONOTONIC of its receipt: older reports do not know it.
    receipt_ns: u64,
}

/// Targets of which one message could not carry all.
struct Unfinished {
    targets: CheckedTargets,
    sender_pid: u32,
    since: Instant,
}

/// From where, and when, a piece goes on.
struct Start {
    base: Trajectory,
    reference: Reference,
    replaces: Replaces,
    cut_s: f64,
    folded_s: f64,
    /// Strokes that begin before this are kept: those before the cut, or all of a taper.
    kept_until_s: f64,
    /// Trajectory time of an instant of CLOCK_MONOTONIC: at `now_ns` it is `now_s`, and passes at `rate`.
    now_ns: u64,
    now_s: f64,
    rate: f64,
}

impl Start {
    /// Trajectory time of an instant `due_s` after `sent_ns`.
    fn at_s(&self, sent_ns: u64, due_s: f64) -> f64 {
        let sent_s = if sent_ns >= self.now_ns {
            Duration::from_nanos(sent_ns - self.now_ns).as_secs_f64()
        } else {
            -Duration::from_nanos(self.now_ns - sent_ns).as_secs_f64()
        };
        self.now_s + self.rate * (sent_s + due_s)
    }
}

/// Why a piece was not accepted.
enum Failed {
    /// The arm was faster: another try from the state of then may do.
    TooLate(String),
    /// For good.
    Refused(String),
}

impl Stream {
    pub(super) fn new(robot: &Robot) -> Self {
        let follower = Follower::new(robot.joints.len(), &robot.limits());
        Self {
            follower,
            latency: Latency::default(),
            committed: None,
            unfinished: None,
            trend: Trend::default(),
            logged: None,
            not_logged: 0,
        }
    }

    /// True when what runs, or waits, is the newest piece of the stream.
    pub(super) fn leads(&self, report: &Report) -> bool {
        self.committed.as_ref().is_some_and(|committed| {
            [report.trajectory_id, report.successor_id].contains(&committed.trajectory_id)
        })
    }

    /// Logs a refusal, unless one was logged just now.
    fn log(&mut self, what: &str) {
        if self.logged.is_some_and(|at| at.elapsed() < LOG_EVERY) {
            self.not_logged += 1;
            return;
        }
        info!(not_logged = self.not_logged, "{what}");
        (self.logged, self.not_logged) = (Some(Instant::now()), 0);
    }
}

impl Service<'_> {
    /// Takes the newest request of a stream, or continues towards a target that one message could not reach.
    pub(super) fn follow(&mut self) {
        let mut newest: Option<Request> = None;
        loop {
            match self.targets.receive() {
                Ok(Some(request)) => {
                    if let Some(older) = newest.replace(request) {
                        answer(&older, &TargetOutcome::Superseded);
                    }
                }
                Ok(None) => break,
                Err(e) => {
                    warn!("cannot take a target: {e:?}");
                    break;
                }
            }
        }
        let Some(request) = newest else { return self.continue_unfinished() };
        self.stream.unfinished = None;
        // Copied out before it is checked.
        let copy = *request.payload();
        let outcome = match CheckedTargets::try_from(&copy) {
            Ok(targets) => self.follow_targets(&targets, copy.sender_pid()),
            Err(e) => Err(e.to_string()),
        };
        let outcome = outcome.unwrap_or_else(|reason| {
            self.stream.log(&format!("target refused: {reason}"));
            TargetOutcome::Refused { reason }
        });
        answer(&request, &outcome);
    }

    fn continue_unfinished(&mut self) {
        let due = |unfinished: &Unfinished| unfinished.since.elapsed() >= CONTINUE_AFTER;
        if !self.stream.unfinished.as_ref().is_some_and(due) {
            return;
        }
        let Some(Unfinished { targets, sender_pid, .. }) = self.stream.unfinished.take() else { return };
        if !is_alive(sender_pid) {
            return info!("whoever sent the target is gone; the arm comes to rest on its way to it");
        }
        if let Err(reason) = self.follow_targets(&targets, sender_pid) {
            self.stream.log(&format!("the way to a far target ends early: {reason}"));
        }
    }

    fn follow_targets(&mut self, targets: &CheckedTargets, sender_pid: u32) -> Result<TargetOutcome, String> {
        let expected = self.robot.joints.len();
        if targets.joints != expected {
            let (got, robot) = (targets.joints, &self.robot.name);
            return Err(format!("the target has {got} joint values, {robot} has {expected} joints"));
        }
        let (inside, note) = self.inside(targets);
        let sent_s = Duration::from_nanos(inside.sent_ns).as_secs_f64();
        let lead = match inside.targets.as_slice() {
            [one] if one.due_s <= 0.0 => self.stream.trend.note(sent_s, one),
            _ => {
                self.stream.trend.clear();
                None
            }
        };
        let mut why = String::new();
        for number in 0..TRIES {
            let begun = Instant::now();
            match self.try_piece(&inside, lead.as_ref(), (&note, number)) {
                Ok((outcome, share)) => {
                    self.stream.latency.note(begun.elapsed().as_secs_f64());
                    if share < 1.0 {
                        let since = Instant::now();
                        self.stream.unfinished = Some(Unfinished { targets: inside, sender_pid, since });
                    }
                    return Ok(outcome);
                }
                Err(Failed::Refused(reason)) => return Err(reason),
                Err(Failed::TooLate(reason)) => why = reason,
            }
        }
        Err(why)
    }

    /// The targets moved inside the position limits, and what to say of it.
    fn inside(&self, targets: &CheckedTargets) -> (CheckedTargets, String) {
        let mut inside = targets.clone();
        let mut note = String::new();
        for target in &mut inside.targets {
            for (q, joint) in target.position_rad.iter_mut().zip(&self.robot.joints) {
                if joint.limits.outside_rad(*q) == 0.0 {
                    continue;
                }
                if note.is_empty() {
                    let ([low, high], unit) = (joint.limits.position_rad, joint.kind.unit());
                    note = format!(
                        "{} is kept inside its limits, {low} to {high} {unit}: {q} {unit} asked",
                        joint.name
                    );
                }
                *q = joint.limits.nearest_inside(*q);
            }
        }
        (inside, note)
    }

    fn try_piece(
        &mut self,
        targets: &CheckedTargets,
        lead: Option<&Lead>,
        (note, number): (&str, u32),
    ) -> Result<(TargetOutcome, f64), Failed> {
        let begun = Instant::now();
        let refused = |e: &dyn std::fmt::Display| Failed::Refused(e.to_string());
        let (mut report, mut phase) = self.outbox.current_report(REPORT_WITHIN).map_err(|e| refused(&e))?;
        let receipt_ns = self.stream.committed.as_ref().map_or(0, |committed| committed.receipt_ns);
        if number > 0 || report.time_ns <= receipt_ns {
            (report, phase) = self.outbox.fresh_report(REPORT_WITHIN).map_err(|e| refused(&e))?;
        }
        check_robot(self.robot, &report).map_err(|e| refused(&e))?;
        self.know_neighbours().map_err(Failed::Refused)?;
        self.unconstrained(&report, runs(phase)).map_err(Failed::Refused)?;
        let latency_s = (self.stream.latency.quantile_s() + LATENCY_MARGIN_S) * f64::from(1 << number);
        let start = self.start(&report, phase, latency_s)?;
        let revision = self.revision();
        let (piece, note) = self.proven(&revision, &start, targets, (lead, note))?;
        let planning_s = begun.elapsed().as_secs_f64();
        let left = still_valid(targets).map_err(|e| refused(&e))?;
        let within = left.min(RECEIPT_WITHIN) + RECEIPT_TAKES;
        let turn =
            self.commit(&revision, (&piece.trajectory, start.cut_s), within).map_err(Failed::Refused)?;
        let motion = (&piece.trajectory, start.replaces);
        let sent = self.outbox.send_after(self.robot, &report, motion, within);
        turn.settle(&sent);
        let sent = sent.map_err(|e| refused(&e))?;
        match sent.receipt.and_then(|receipt| receipt.outcome()) {
            Some(Outcome::Accepted { .. }) => {}
            Some(Outcome::Rejected(rejection)) if is_too_late(&rejection, start.folded_s < start.cut_s) => {
                return Err(Failed::TooLate(rejection.to_string()));
            }
            Some(Outcome::Rejected(rejection)) => return Err(refused(&rejection)),
            None => return Err(refused(&"the streamer did not answer; look at its log")),
        }
        let outcome = TargetOutcome::Taken {
            trajectory_id: sent.trajectory_id,
            cut_s: start.cut_s,
            rest_in_s: piece.trajectory.duration_s() - start.cut_s,
            planning_s,
            note,
        };
        self.stream.committed = Some(Committed {
            trajectory_id: sent.trajectory_id,
            reference: piece.reference,
            receipt_ns: now_ns(),
        });
        Ok((outcome, piece.share))
    }

    /// A piece that is proven free and inside the limits, as far towards the target as there is one.
    fn proven(
        &mut self,
        revision: &SceneRevision,
        start: &Start,
        targets: &CheckedTargets,
        (lead, note): (Option<&Lead>, &str),
    ) -> Result<(Piece, String), Failed> {
        let world = &*revision.world;
        let kept = kept(&start.base, start.kept_until_s, start.folded_s);
        let from = (&start.reference, start.cut_s);
        let budget = Budget::until(PROOF_WITHIN, None);
        let mut why = "no strokes lead on from here: the message has no room for them".to_owned();
        // Where the way ahead is blocked, the target itself may be free.
        let leads = lead.map(|lead| (1.0, Some(lead)));
        for (share, lead) in leads.into_iter().chain(SHARES.map(|share| (share, None))) {
            let piece = match targets.targets.as_slice() {
                [one] if one.due_s <= 0.0 => {
                    let near_rad = near(&kept, &one.position_rad, share);
                    self.stream.follower.to_pose(&kept, from, (&near_rad, lead))
                }
                chunk => {
                    let nearer: Vec<Target> = chunk
                        .iter()
                        .map(|target| Target {
                            position_rad: near(&kept, &target.position_rad, share),
                            ..*target
                        })
                        .collect();
                    let at_s = |due_s: f64| start.at_s(targets.sent_ns, due_s);
                    self.stream.follower.through(&kept, from, (&nearer, &at_s))
                }
            };
            let Some(piece) = piece else { continue };
            let span_s = [start.cut_s, piece.trajectory.duration_s().max(start.cut_s)];
            match verify_free(&Stretch { world, span_s }, &piece.trajectory, &budget) {
                Ok(()) if share < 1.0 => {
                    let percent = share * 100.0;
                    return Ok((piece, format!("stopped after {percent} % of the way: {why}")));
                }
                Ok(()) => return Ok((piece, note.to_owned())),
                Err(violation) => why = violation.to_string(),
            }
        }
        Err(Failed::Refused(why))
    }

    /// What the next piece continues.
    fn start(&self, report: &Report, phase: Phase, latency_s: f64) -> Result<Start, Failed> {
        let joints = self.robot.joints.len();
        if phase == Phase::Holding && report.energised == 1 {
            let base = Trajectory::new(joints, report.command_rad, &[])
                .map_err(|e| Failed::Refused(format!("the streamer reports no pose: {e}")))?;
            // Trajectory time begins when the streamer takes it.
            let now_s = -latency_s;
            return Ok(Start {
                reference: Reference::at_rest(&report.command_rad),
                replaces: Replaces::Rest,
                cut_s: 0.0,
                folded_s: 0.0,
                kept_until_s: 0.0,
                now_ns: now_ns(),
                now_s,
                rate: report.speed_percent / 100.0,
                base,
            });
        }
        if !runs(phase) {
            return Err(Failed::Refused(not_ready(phase)));
        }
        let own = self.stream.committed.as_ref().filter(|committed| {
            let id = committed.trajectory_id;
            id == report.successor_id || id == report.trajectory_id && report.successor_id == 0
        });
        let waits = report.successor_id != 0;
        let trajectory_id = if waits { report.successor_id } else { report.trajectory_id };
        let Some(base) = self.outbox.known(trajectory_id) else {
            let why = "a motion runs that this planner has not sent; wait until it has ended, or bring it to rest: taustream stop";
            return Err(Failed::Refused(why.to_owned()));
        };
        let cut = cut(report, now_ns(), latency_s, base.duration_s());
        let cut_s = cut.at_s;
        let mut start = Start {
            reference: Reference::at_rest(&report.command_rad),
            replaces: Replaces::Cut { trajectory_id, at_s: cut_s },
            cut_s,
            folded_s: cut.folded_s,
            kept_until_s: cut_s,
            now_ns: report.time_ns,
            now_s: report.trajectory_s,
            rate: rate(report),
            base,
        };
        match own {
            Some(own) => {
                start.reference = own.reference.clone();
                // A motion that was brought to rest before the stream still does that.
                start.kept_until_s = start.reference.kept_until_s(cut_s);
            }
            None => start.come_to_rest(&self.robot.limits())?,
        }
        Ok(start)
    }
}

impl Start {
    /// A motion that is not of this stream comes to rest first: its strokes are no average of a reference.
    fn come_to_rest(&mut self, limits: &[JointLimits; MAX_JOINTS]) -> Result<(), Failed> {
        let folded =
            folded(&self.base, self.cut_s, self.folded_s).map_err(|e| Failed::Refused(e.to_string()))?;
        let tapered = to_rest(&folded, self.cut_s, limits).ok_or_else(|| {
            Failed::Refused(format!(
                "no strokes were found that bring the motion to rest from {:.3} s",
                self.cut_s
            ))
        })?;
        let rest_s = tapered.duration_s().max(self.cut_s);
        self.reference = Reference::at_rest_from(rest_s, &tapered.end_rad());
        (self.base, self.kept_until_s) = (tapered, f64::INFINITY);
        Ok(())
    }
}

/// How much of the time is left for which a request is valid.
fn still_valid(targets: &CheckedTargets) -> Result<Duration, String> {
    let age = Duration::from_nanos(now_ns().saturating_sub(targets.sent_ns));
    let valid = Duration::from_secs_f64(targets.valid_s);
    valid.checked_sub(age).filter(|left| !left.is_zero()).ok_or_else(|| {
        let (age_s, valid_s) = (age.as_secs_f64(), targets.valid_s);
        format!("{age_s:.3} s have passed since it was sent, and it was valid for {valid_s:.3} s; send a newer one")
    })
}

/// The pose at a share of the straight way from where the kept strokes lead to a target.
fn near(kept: &Kept, target_rad: &JointArray, share: f64) -> JointArray {
    if share >= 1.0 {
        return *target_rad;
    }
    let mut from_rad = kept.base_rad;
    for stroke in kept.strokes {
        from_rad.iter_mut().zip(&stroke.delta_rad).for_each(|(q, delta)| *q += delta);
    }
    let mut near_rad = [0.0; MAX_JOINTS];
    for (joint, q) in near_rad.iter_mut().enumerate() {
        *q = from_rad[joint] + share * (target_rad[joint] - from_rad[joint]);
    }
    near_rad
}

fn answer(request: &Request, outcome: &TargetOutcome) {
    let sequence = request.payload().sequence();
    // A sender that has gone needs no answer.
    if let Err(e) = request.send_copy(TargetReply::new(sequence, outcome)) {
        info!("the answer to a target was not taken: {e:?}");
    }
}
