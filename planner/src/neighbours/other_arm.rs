//! One other arm, as its streamer and its planner show it.
use super::swept::{Bodies, Occupancy, Part, SLACK_M, joints_of};
use crate::foreign::Foreign;
use crate::send::SendError;
use crate::stream_cut::rate;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use taustream_arm::{Neighbour, Obstacle};
use taustream_messages::files::Footprint;
use taustream_messages::service::{ReportSubscriber, Wire};
use taustream_messages::{Phase, Report};
use taustream_motion::{JointArray, MAX_JOINTS};
use tracing::{info, warn};

/// A report may be that much older than three of its periods.
const LATE_S: f64 = 0.25;
/// Feedback of an arm whose measured pose counts may be so old, s.
const FEEDBACK_S: f64 = 1.0;
/// How often services that are not there are tried, and their files looked for.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// A motion shrinks while it runs; after this time its obstacles are made anew where a plan asks for them.
const SHRINKS_AFTER: Duration = Duration::from_millis(200);

/// The services of the other arm, as this process has opened them.
struct Link {
    // Before the wire, which they are parts of.
    reports: ReportSubscriber,
    trajectories: Foreign,
    footprint: Footprint,
    _wire: Wire,
}

impl Link {
    fn open(arm: &str, runtime: &Path) -> Result<Self, SendError> {
        let wire = Wire::join(arm, "taustream-neighbour", runtime)?;
        let (reports, trajectories) = (wire.report_subscriber()?, Foreign::open(&wire)?);
        Ok(Self { reports, trajectories, footprint: wire.footprint(), _wire: wire })
    }
}

/// Where an arm is, or may come to, by one report.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Situation {
    pub(crate) occupancy: Occupancy,
    /// Distance of the measured joints from the commanded ones.
    off_rad: JointArray,
    /// What runs, and what waits; 0 for none.
    ids: [u64; 2],
    from_s: f64,
    /// How long the motion takes on, at the speed of now, s.
    pub(crate) left_s: f64,
    phase: Phase,
}

impl Situation {
    pub(crate) fn moves(&self) -> bool {
        matches!(self.occupancy, Occupancy::Moves { .. })
    }

    /// The motion that was accepted last.
    pub(crate) fn newest_id(&self) -> u64 {
        if self.ids[1] != 0 { self.ids[1] } else { self.ids[0] }
    }
}

/// Why nobody knows where an arm may come to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unknown {
    pub(crate) why: String,
    /// A motion that runs, or waits, and whose strokes were not received.
    unseen_id: Option<u64>,
}

impl Unknown {
    /// A motion that runs, or waits, and whose strokes were not received.
    pub(crate) fn unseen_id(&self) -> Option<u64> {
        self.unseen_id
    }

    /// True for a motion that its planner has committed: it was checked against the motion of this arm.
    pub(crate) fn is_committed(&self, committed: impl FnOnce(u64) -> bool) -> bool {
        self.unseen_id.is_some_and(committed)
    }
}

impl From<String> for Unknown {
    fn from(why: String) -> Self {
        Self { why, unseen_id: None }
    }
}

/// What obstacles were made of.
struct Built {
    situation: Situation,
    at: Instant,
    obstacles: Vec<Obstacle>,
}

/// Another arm in the room.
pub(crate) struct OtherArm {
    pub(crate) neighbour: Neighbour,
    runtime: PathBuf,
    link: Option<Link>,
    looked: Option<Instant>,
    bodies: Bodies,
    newest: Option<Report>,
    built: Option<Built>,
    /// Where it was when it was looked at last while this arm moved.
    watched: Option<Situation>,
    /// The record of its planner that the newest report knows of.
    pub(crate) known_sequence: u64,
}

impl OtherArm {
    /// Another arm, whose services may come later.
    ///
    /// # Errors
    /// The name of a link whose shape cannot be built.
    pub(crate) fn new(neighbour: &Neighbour, runtime: &Path) -> Result<Self, String> {
        let bodies = Bodies::new(neighbour, Arc::new(neighbour.robot.clone()))?;
        Ok(Self {
            neighbour: neighbour.clone(),
            runtime: runtime.to_owned(),
            link: None,
            looked: None,
            bodies,
            newest: None,
            built: None,
            watched: None,
            known_sequence: 0,
        })
    }

    pub(crate) fn name(&self) -> &str {
        &self.neighbour.name
    }

    /// Takes what has come since the last look, and opens services that have vanished.
    pub(crate) fn look(&mut self) {
        if self.looked.is_none_or(|at| at.elapsed() >= LOOK_EVERY) {
            self.looked = Some(Instant::now());
            if let Some(link) = self.link.take_if(|link| link.footprint.missing().is_some()) {
                // Closed in earnest, it would delete files of the same names that somebody else has made meanwhile.
                let _kept = ManuallyDrop::new(link);
            }
            if self.link.is_none() {
                match Link::open(self.name(), &self.runtime) {
                    Ok(link) => self.link = Some(link),
                    Err(e) => info!("neighbour `{}`: {e}", self.name()),
                }
            }
        }
        let Some(link) = &self.link else { return };
        loop {
            match link.reports.receive() {
                // Copied out before it is checked.
                Ok(Some(sample)) => self.newest = Some(*sample.payload()),
                Ok(None) => break,
                Err(e) => {
                    warn!("cannot receive reports of neighbour `{}`: {e:?}", self.neighbour.name);
                    break;
                }
            }
        }
        // After the reports: what they name was sent before.
        link.trajectories.look();
    }

    /// `CLOCK_MONOTONIC` of the newest report, ns; 0 before the first.
    pub(crate) fn report_ns(&self) -> u64 {
        self.newest.map_or(0, |report| report.time_ns)
    }

    /// Where it is, or may come to.
    ///
    /// # Errors
    /// Why that is not known, and what to do.
    pub(crate) fn situation(&self, now_ns: u64) -> Result<Situation, Unknown> {
        let unknown =
            |why: &str| Err(format!("the pose of neighbour `{}` is not known: {why}", self.name()).into());
        let start = format!("start taustream-streamer with {} as this user", self.neighbour.file.display());
        let Some(report) = &self.newest else {
            return unknown(&format!("its streamer does not report; {start}"));
        };
        let age_s = Duration::from_nanos(now_ns.saturating_sub(report.time_ns)).as_secs_f64();
        let age_s_max = LATE_S + 3.0 / self.neighbour.report_rate_hz;
        if age_s > age_s_max {
            return unknown(&format!(
                "its newest report is {age_s:.2} s old, at most {age_s_max:.2} s are allowed; {start}"
            ));
        }
        let Some((report, phase)) = report.checked() else {
            return unknown("its reports are of another release; use programs of one release");
        };
        if report.robot_digest != self.neighbour.robot.message_digest {
            return unknown(&format!(
                "its streamer drives another robot than {} says; start both with the same files",
                self.neighbour.file.display()
            ));
        }
        self.situation_in(report, phase)
    }

    fn situation_in(&self, report: &Report, phase: Phase) -> Result<Situation, Unknown> {
        let unknown =
            |why: String| Err(format!("the pose of neighbour `{}` is not known: {why}", self.name()).into());
        let joints = self.neighbour.robot.joints.len();
        let (commanded_rad, measured_rad) =
            (joints_of(&report.command_rad, joints), joints_of(&report.measured_rad, joints));
        if report.joints() != joints || !commanded_rad.iter().chain(&measured_rad).all(|q| q.is_finite()) {
            return unknown("its report has joints that are no numbers; look at its streamer".to_owned());
        }
        let mut ages_s = report.feedback_age_s.iter().take(joints);
        if let Some(feedback_s) = ages_s.find(|age_s| age_s.is_nan() || **age_s > FEEDBACK_S) {
            return unknown(format!(
                "the feedback of its drives is {feedback_s:.2} s old (it is {}); look at its streamer",
                phase.word()
            ));
        }
        let off_rad: JointArray = std::array::from_fn(|j| (measured_rad[j] - commanded_rad[j]).abs());
        let rests = |pose_rad: JointArray, off_rad: JointArray| Situation {
            occupancy: Occupancy::Rests { pose_rad },
            off_rad,
            ids: [0; 2],
            from_s: 0.0,
            left_s: 0.0,
            phase,
        };
        match phase {
            Phase::Configuring
            | Phase::Disabled
            | Phase::Locked
            | Phase::Fault
            | Phase::Disabling
            | Phase::Enabling
                if report.energised == 0 =>
            {
                Ok(rests(measured_rad, [0.0; MAX_JOINTS]))
            }
            Phase::Configuring
            | Phase::Disabled
            | Phase::Locked
            | Phase::Fault
            | Phase::Disabling
            | Phase::Enabling
            | Phase::Holding => Ok(rests(commanded_rad, off_rad)),
            Phase::Homing | Phase::Braking => unknown(format!(
                "it is {}, which follows no path that is known; wait until that has ended",
                phase.word()
            )),
            Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping | Phase::FastStopping => {
                self.moves(report, phase, off_rad)
            }
        }
    }

    fn moves(&self, report: &Report, phase: Phase, off_rad: JointArray) -> Result<Situation, Unknown> {
        let ids = [report.trajectory_id, report.successor_id];
        let strokes = |id: u64| self.link.as_ref().and_then(|link| link.trajectories.known(id));
        let unseen = |id: u64| Unknown {
            why: format!(
                "the motion of neighbour `{}` is not known: trajectory {id} was sent before this process looked; wait until it has ended",
                self.name()
            ),
            unseen_id: Some(id),
        };
        let running = strokes(ids[0]).ok_or_else(|| unseen(ids[0]))?;
        let (now_s, from_s) = (report.trajectory_s.max(0.0), report.successor_from_s);
        if !now_s.is_finite() || !from_s.is_finite() {
            return Err(
                format!("the report of neighbour `{}` has times that are no numbers", self.name()).into()
            );
        }
        let end_s = running.duration_s().max(now_s);
        let mut last_s = end_s;
        let mut parts = vec![Part { trajectory: running, span_s: [now_s, end_s] }];
        if ids[1] != 0 {
            let waits = strokes(ids[1]).ok_or_else(|| unseen(ids[1]))?;
            let from_s = from_s.max(now_s);
            last_s = waits.duration_s().max(from_s);
            parts[0].span_s[1] = from_s.min(end_s).max(now_s);
            parts.push(Part { trajectory: waits, span_s: [from_s, last_s] });
        }
        let rate = rate(report);
        let left_s = if rate > 0.0 { (last_s - now_s) / rate } else { f64::INFINITY };
        Ok(Situation { occupancy: Occupancy::Moves { parts }, off_rad, ids, from_s, left_s, phase })
    }

    /// What it does, for whoever has to wait for it.
    pub(crate) fn words(&self, situation: &Situation) -> String {
        let (name, phase) = (self.name(), situation.phase.word());
        if !situation.moves() {
            return format!("neighbour `{name}` rests ({phase})");
        }
        let id = situation.newest_id();
        if situation.left_s.is_finite() {
            format!("neighbour `{name}` is {phase} along trajectory {id} for {:.1} s more", situation.left_s)
        } else {
            format!("neighbour `{name}` is {phase} on trajectory {id}, which it may resume")
        }
    }

    /// Obstacles for where it is now, if those that were made last do not cover that; `shrinks` when a motion that has gone on shall
    /// leave what lies behind it.
    pub(crate) fn rebuild(&mut self, situation: Situation, scene_margin_m: f64, shrinks: bool) -> bool {
        if let Some(built) = &self.built {
            let is_old = shrinks && situation.moves() && built.at.elapsed() > SHRINKS_AFTER;
            if !is_old && self.covers(&built.situation, &situation) {
                return false;
            }
        }
        // The scene's margin is kept from every obstacle as it is.
        let extra_m = (self.neighbour.margin_m - scene_margin_m).max(0.0);
        let obstacles = self.bodies.obstacles(&situation.occupancy, &situation.off_rad, extra_m);
        self.watched = Some(situation.clone());
        self.built = Some(Built { situation, at: Instant::now(), obstacles });
        true
    }

    /// The obstacles that were made last.
    pub(crate) fn obstacles(&self) -> &[Obstacle] {
        self.built.as_ref().map_or(&[], |built| &built.obstacles)
    }

    /// True when what was built of one situation holds for a later one.
    fn covers(&self, built: &Situation, now: &Situation) -> bool {
        match (&built.occupancy, &now.occupancy) {
            (Occupancy::Rests { .. }, Occupancy::Rests { .. }) => self.apart_m(built, now) <= SLACK_M,
            (Occupancy::Moves { .. }, Occupancy::Moves { .. }) => {
                let same = built.ids == now.ids
                    && (now.ids[1] == 0 || built.from_s.to_bits() == now.from_s.to_bits());
                let took_over = now.ids[1] == 0 && built.ids[1] == now.ids[0];
                same || took_over
            }
            (Occupancy::Rests { .. } | Occupancy::Moves { .. }, _) => false,
        }
    }

    /// How far an arm that rests has moved, m.
    fn apart_m(&self, before: &Situation, now: &Situation) -> f64 {
        let (Occupancy::Rests { pose_rad: from_rad }, Occupancy::Rests { pose_rad: to_rad }) =
            (&before.occupancy, &now.occupancy)
        else {
            return 0.0;
        };
        let turn_rad: JointArray = std::array::from_fn(|j| {
            (to_rad[j] - from_rad[j]).abs() + (now.off_rad[j] - before.off_rad[j]).max(0.0)
        });
        self.bodies.farthest_move_m(from_rad, &turn_rad)
    }

    /// Why the motion of this arm is not known to be free of the other one any more: it has moved without a motion that its planner has
    /// committed. `committed` says whether a motion is one.
    pub(crate) fn strayed(&mut self, now: &Situation, committed: impl FnOnce(u64) -> bool) -> Option<String> {
        let before = self.watched.clone();
        let strayed = match (&before, now.moves()) {
            (Some(before), true) if before.moves() && before.newest_id() == now.newest_id() => None,
            (_, true) if committed(now.newest_id()) => None,
            (_, true) => Some(format!(
                "neighbour `{}` moves by trajectory {}, which its planner has not committed",
                self.name(),
                now.newest_id()
            )),
            (Some(before), false) if !before.moves() => {
                let apart_m = self.apart_m(before, now);
                if apart_m <= SLACK_M {
                    // It stays what it was, so that many small steps are a large one.
                    return None;
                }
                Some(format!(
                    "neighbour `{}` ({}) has moved by up to {apart_m:.3} m",
                    self.name(),
                    now.phase.word()
                ))
            }
            // Its motion ended on its path.
            (_, false) => None,
        };
        self.watched = Some(now.clone());
        strayed
    }
}
