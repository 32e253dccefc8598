//! Requests while a motion runs: where it is cut, and what is tried when a cut comes too late.
//!
//! A cut has to lie ahead of the arm when the streamer takes the replacement. So the first one is aimed at where the arm will
//! be after the time that planning and sending have taken lately, and a later one is tried when the arm was faster. What
//! takes too long is planned from where the motion ends: that pose does not move.
use super::{Request, Service, failed, not_ready};
use crate::in_motion::{CutPoint, Replacement, Surroundings};
use crate::kind::PlannerKind;
use crate::plan::PlanOptions;
use crate::send::SentTrajectory;
use crate::stream_cut::{age_s, rate};
use std::time::{Duration, Instant};
use taustream_messages::clock::now_ns;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome, PlanStages, When};
use taustream_messages::{Outcome, Phase, Rejection, Replaces, Report};
use tracing::info;

/// How often a cut is tried before the end of the motion is taken instead.
const TRIES: u32 = 3;
/// How often the end of the motion is tried: it can end, or be replaced, meanwhile.
const END_TRIES: u32 = 4;
/// What planning and sending are taken to last before they were measured, s.
const LATENCY_S: f64 = 0.03;
/// Added for a stream of targets: a few cycles, s.
pub(super) const LATENCY_MARGIN_S: f64 = 0.005;
/// Added for a request: what was measured includes the cycle that takes the replacement, s.
const REQUEST_MARGIN_S: f64 = 0.0015;
/// Most that a search for a way round obstacles may take while the arm moves on, s.
const SEARCH_S_MAX: f64 = 0.2;
/// Measurements that are kept, and the place of the one that counts among them, from the largest.
const MEASURED: usize = 16;
const QUANTILE: usize = 2;
/// A cut this near to the end is none, s.
const NEAR_END_S: f64 = 2e-3;

/// How long replacements have taken lately, from the request to the receipt.
#[derive(Debug, Default)]
pub(super) struct Latency {
    seconds: Vec<f64>,
}

impl Latency {
    pub(super) fn note(&mut self, seconds: f64) {
        if self.seconds.len() == MEASURED {
            self.seconds.remove(0);
        }
        self.seconds.push(seconds);
    }

    /// What nearly all of them have kept, s.
    pub(super) fn quantile_s(&self) -> f64 {
        let mut sorted = self.seconds.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.iter().rev().nth(QUANTILE).or(sorted.last()).copied().unwrap_or(LATENCY_S)
    }
}

/// One way to go on from a motion that runs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Way {
    /// To rest as soon as possible.
    Taper,
    /// From the state at the cut to the goal; from the end of the motion where that is shorter.
    Direct,
    /// To rest, and on to the goal; from the end of the motion where that is shorter.
    RestFirst,
    /// On to the goal past the end of the motion, its corner rounded; from rest there where that is not possible.
    PastEnd,
    /// On to the goal from where the motion ends.
    End,
}

impl std::fmt::Display for Way {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Taper => "to rest as soon as possible",
            Self::Direct => "straight on to the goal",
            Self::RestFirst => "to rest, and on to the goal",
            Self::PastEnd => "past the end of the motion",
            Self::End => "from the end of the motion",
        })
    }
}

/// What became of a try.
enum Tried {
    /// The answer.
    Done(PlanOutcome),
    /// The arm was faster, or another motion runs by now.
    TooLate(Rejection),
    /// This way is none.
    NoWay(String),
}

/// True for phases in which something runs that can be cut.
pub(super) fn runs(phase: Phase) -> bool {
    matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused)
}

impl Service<'_> {
    /// Answers a request while a motion runs.
    pub(super) fn replan_in_motion(
        &mut self,
        request: &Request,
        (requested, options): (&CheckedPlanRequest, &PlanOptions),
        mut report: Report,
    ) -> Result<PlanOutcome, String> {
        let (asked, running) = (requested.constraints, self.running_constraints(&report));
        let mut options = *options;
        let ways: &[Way] = match requested.when {
            When::Cancel => {
                // A taper leaves the path.
                options.constraints = running.ok_or(
                    "parts of what runs keep different constraints of the tip; use `taustream stop`, which stays on the path",
                )?;
                &[Way::Taper]
            }
            // Rounding its end changes the motion before it, which keeps what was asked for there.
            When::Queue if running != Some(asked) => &[Way::End],
            When::AtOnce if is_free_choice(options.planner) => &[Way::Direct, Way::RestFirst, Way::End],
            // Whoever names a searcher wants its path.
            When::AtOnce => &[Way::RestFirst, Way::End],
            When::AfterCurrent => &[Way::End],
            When::Queue => &[Way::PastEnd, Way::End],
        };
        let options = &options;
        let mut why = String::new();
        for way in ways {
            let tries = if *way == Way::End { END_TRIES } else { TRIES };
            for number in 0..tries {
                let begun = Instant::now();
                match self.try_way(request, (requested, options), &report, (*way, number))? {
                    Tried::Done(outcome) => return Ok(outcome),
                    Tried::NoWay(reason) => {
                        info!("{way:?}: {reason}");
                        self.reported.step(format!("{way}: {reason}"), begun.elapsed().as_secs_f64(), None);
                        why = reason;
                        break;
                    }
                    Tried::TooLate(rejection) => {
                        info!("{way:?}: {rejection}");
                        self.reported.step(
                            format!("{way}: {rejection}"),
                            begun.elapsed().as_secs_f64(),
                            None,
                        );
                        why = rejection.to_string();
                    }
                }
                let (next, phase) =
                    self.outbox.fresh_report(super::REPORT_WITHIN).map_err(|e| e.to_string())?;
                if phase == Phase::Holding && next.energised == 1 && requested.when != When::Cancel {
                    // It has ended meanwhile.
                    let planned = self.plan(request, next.command_rad, (requested, options))?;
                    return Ok(self.remembering(self.send(request, &planned), &asked));
                }
                if !runs(phase) {
                    return Err(not_ready(phase));
                }
                report = next;
            }
        }
        Err(why)
    }

    fn try_way(
        &mut self,
        request: &Request,
        (requested, options): (&CheckedPlanRequest, &PlanOptions),
        report: &Report,
        (way, number): (Way, u32),
    ) -> Result<Tried, String> {
        let begun = Instant::now();
        let search_s =
            if way == Way::RestFirst { SEARCH_S_MAX.min(options.deadline.as_secs_f64()) } else { 0.0 };
        // Rounding a corner takes longer, and is to make no other cut later.
        let latency = if way == Way::PastEnd { &self.corner_latency } else { &self.latency };
        let latency_s = (latency.quantile_s() + REQUEST_MARGIN_S + search_s) * f64::from(1 << number);
        let cut = self.cut(report, (requested.when, way), latency_s);
        let end = self.cut(report, (requested.when, Way::End), latency_s);
        if way != Way::End && cut.at_s > cut.end_s - NEAR_END_S {
            return Ok(Tried::NoWay(format!(
                "the motion ends at {:.3} s, before a cut could be kept",
                cut.end_s
            )));
        }
        let limited = match way {
            Way::RestFirst => PlanOptions { deadline: Duration::from_secs_f64(search_s), ..*options },
            Way::Taper | Way::Direct | Way::PastEnd | Way::End => *options,
        };
        // Joints that the request says nothing of go on to where the motion leads them.
        let (revision, held_joints) = (self.revision(), requested.held_joints);
        let points_rad = requested.holding_at(&end.end_rad).points_rad();
        let made = self.work(request, limited.deadline, |cancel| {
            let (robot, scene) = (&*revision.robot, &*revision.scene);
            let surroundings = Surroundings { robot, scene, cancel, held_joints };
            match way {
                Way::Taper => surroundings.taper(&cut, &limited),
                Way::Direct => surroundings.direct_or_after_end([&cut, &end], &points_rad, &limited),
                Way::RestFirst => surroundings.rest_first_or_after_end([&cut, &end], &points_rad, &limited),
                Way::PastEnd => surroundings.past_end([&cut, &end], &points_rad, &limited),
                Way::End => surroundings.after_end((&end, &points_rad), &limited),
            }
        })?;
        let made = match made {
            Ok(made) => made,
            Err(e) => return Ok(Tried::NoWay(e.to_string())),
        };
        let from_s = match made.replaces {
            Replaces::Cut { at_s, .. } => at_s,
            Replaces::Rest => 0.0,
        };
        let turn = match self.commit(&revision, (&made.trajectory, from_s), super::RECEIPT_WITHIN) {
            Ok(turn) => turn,
            Err(reason) => return Ok(Tried::NoWay(reason)),
        };
        let (planning_s, proven_ns) = (begun.elapsed().as_secs_f64(), now_ns());
        if !request.is_connected() {
            return Ok(Tried::Done(failed("the client has disconnected; motion not sent")));
        }
        let sent = self.outbox.send_after(
            self.robot,
            report,
            (&made.trajectory, made.replaces),
            super::RECEIPT_WITHIN,
        );
        turn.settle(&sent);
        let sent = sent.map_err(|e| e.to_string())?;
        // What came too late counts as well: the next one is aimed further ahead.
        let latency = if way == Way::PastEnd { &mut self.corner_latency } else { &mut self.latency };
        latency.note((begun.elapsed().as_secs_f64() - search_s).max(0.0));
        if let Some(Outcome::Rejected(rejection)) = sent.receipt.and_then(|receipt| receipt.outcome())
            && is_too_late(&rejection, made.replaces != end.replaces() && cut.from_s < cut.at_s)
        {
            return Ok(Tried::TooLate(rejection));
        }
        let running = self.running_constraints(report);
        let asked = options.constraints;
        // What was kept of the motion before keeps what was asked for there.
        let is_one = made.replaces != end.replaces() || running == Some(asked);
        self.remember(sent.trajectory_id, is_one.then_some(asked));
        let motion_s = made.trajectory.duration_s() - from_s;
        self.reported.step(format!("{way}: {}", made.how), planning_s, Some(motion_s));
        self.reported.motion((&made.trajectory, from_s), made.least.clone());
        let stages = PlanStages { planned_ns: made.planned_ns, ..self.stages(&sent, proven_ns) };
        Ok(Tried::Done(outcome(&sent, made, (planning_s, stages))))
    }

    /// The cut of what runs, or waits, for a replacement that reaches the streamer within `latency_s`.
    pub(super) fn cut_ahead(&self, report: &Report, latency_s: f64) -> CutPoint {
        self.cut(report, (When::AtOnce, Way::Direct), latency_s)
    }

    /// What is cut, and when, for a replacement that reaches the streamer within `latency_s`.
    fn cut(&self, report: &Report, (when, way): (When, Way), latency_s: f64) -> CutPoint {
        let ahead_s = report.trajectory_s + rate(report) * (since_s(report) + latency_s);
        let waits = report.successor_id != 0;
        // `AfterCurrent` replaces what waits, and `Queue` comes after it.
        let running_known = self.outbox.known(report.trajectory_id);
        let end_of_running = when == When::AfterCurrent && (!waits || running_known.is_some());
        let at_its_end = matches!(way, Way::PastEnd | Way::End);
        let takes_waiting = waits && !end_of_running && (at_its_end || ahead_s >= report.successor_from_s);
        let (trajectory_id, trajectory) = if takes_waiting {
            (report.successor_id, self.outbox.known(report.successor_id))
        } else {
            (report.trajectory_id, running_known)
        };
        let known_end = trajectory.as_ref().map(|known| (known.duration_s(), known.end_rad()));
        let (end_s, end_rad) = known_end.unwrap_or((report.end_s, report.end_rad));
        let at_s = match way {
            Way::End => end_s,
            // What waits cannot be cut before it begins.
            Way::PastEnd if takes_waiting => ahead_s.max(report.successor_from_s).min(end_s),
            Way::PastEnd | Way::Taper | Way::Direct | Way::RestFirst => ahead_s.min(end_s),
        };
        let from_s = if takes_waiting { report.successor_from_s } else { at_s };
        CutPoint { trajectory_id, trajectory, at_s, from_s, end_s, end_rad }
    }
}

fn is_free_choice(planner: PlannerKind) -> bool {
    matches!(planner, PlannerKind::Auto | PlannerKind::Straight)
}

/// Age of a report, s.
fn since_s(report: &Report) -> f64 {
    age_s(report, now_ns())
}

/// Refusals that another try, from the state of then, may not meet; `folded_early`: strokes were folded at another instant than
/// the cut.
pub(super) fn is_too_late(rejection: &Rejection, folded_early: bool) -> bool {
    match rejection {
        // What was to run by now still waits: strokes were folded that have not ended when it takes over.
        Rejection::KeptStrokesDiffer { .. } => folded_early,
        Rejection::CutPassed { .. }
        | Rejection::CutOutside { .. }
        | Rejection::OtherTrajectory { .. }
        | Rejection::NothingToCut { .. }
        | Rejection::SpeedChanges
        | Rejection::StaleGeneration { .. }
        | Rejection::TooLate { .. }
        | Rejection::Busy => true,
        Rejection::Malformed(_)
        | Rejection::WrongRobot
        | Rejection::JointCount { .. }
        | Rejection::Limit { .. }
        | Rejection::NotAtBase { .. }
        | Rejection::NotReady { .. }
        | Rejection::KeptBaseDiffers { .. } => false,
    }
}

fn outcome(sent: &SentTrajectory, made: Replacement, (planning_s, stages): (f64, PlanStages)) -> PlanOutcome {
    let at_s = match made.replaces {
        Replaces::Cut { at_s, .. } => at_s,
        Replaces::Rest => 0.0,
    };
    PlanOutcome::Planned {
        trajectory_id: sent.trajectory_id,
        planning_s,
        duration_s: made.trajectory.duration_s() - at_s,
        clearance_m: made.least.clearance_m,
        strokes: u32::try_from(made.trajectory.strokes().len()).unwrap_or(u32::MAX),
        how: made.how,
        receipt: sent.receipt.map(Box::new),
        stages,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latency_counts_what_nearly_all_have_kept_and_forgets_the_oldest() {
        let mut latency = Latency::default();
        assert!((latency.quantile_s() - LATENCY_S).abs() < 1e-12);
        latency.note(0.5);
        assert!((latency.quantile_s() - 0.5).abs() < 1e-12);
        for milliseconds in 0..MEASURED {
            latency.note(milliseconds as f64 * 1e-3);
        }
        assert_eq!(latency.seconds.len(), MEASURED);
        assert!((latency.quantile_s() - 13e-3).abs() < 1e-12, "{}", latency.quantile_s());
    }
}
