//! Other arms in the same room: what they may occupy counts as obstacles, and one planner at a time commits a motion.
//!
//! [docs/neighbours.md](https://github.com/taustream/taustream/blob/main/docs/neighbours.md) says what is kept, ADR 35 why that is
//! enough.
pub mod commitment;
pub mod grown;
mod other_arm;
pub mod swept;

use crate::send::{SendError, SentTrajectory};
use crate::verify::verify;
use commitment::{CommitError, Commitments, Turn};
use other_arm::OtherArm;
use std::cell::RefCell;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::{Neighbour, Obstacle, Robot, Scene};
use taustream_messages::Outcome;
use taustream_messages::clock::now_ns;
use taustream_motion::Trajectory;

/// How long another planner that commits a motion is waited for.
const TURN_WITHIN: Duration = Duration::from_secs(1);
/// How long a report is waited for that is newer than a commitment.
const REPORT_WITHIN: Duration = Duration::from_millis(1_500);
/// How often it is looked for.
const POLL: Duration = Duration::from_millis(1);
/// After the time until which a motion may be accepted, reports say within this whether it was.
const SETTLED_NS: u64 = 50_000_000;

/// What a motion may take to the streamer beyond the wait for its receipt: a report is waited for first.
pub(crate) const SENDING: Duration = Duration::from_millis(1_200);

/// All neighbours of an arm.
pub struct Neighbours {
    arms: RefCell<Vec<OtherArm>>,
    commitments: Option<Commitments>,
}

impl Neighbours {
    /// No neighbours.
    #[must_use]
    pub fn none() -> Self {
        Self { arms: RefCell::default(), commitments: None }
    }

    /// The neighbours of arm `own`, below the runtime directory that all share.
    ///
    /// # Errors
    /// When a shape cannot be built, or the directory of the locks cannot be made.
    pub fn open(own: &str, neighbours: &[Neighbour], runtime: &Path) -> Result<Self, String> {
        if neighbours.is_empty() {
            return Ok(Self::none());
        }
        let names: Vec<&str> = neighbours.iter().map(|neighbour| neighbour.name.as_str()).collect();
        let commitments = Commitments::open(runtime, own, &names).map_err(|e| e.to_string())?;
        let arm = |neighbour: &Neighbour| {
            OtherArm::new(neighbour, runtime).map_err(|link| {
                format!("neighbour `{}`: the shape of {link} cannot be built", neighbour.name)
            })
        };
        let arms: Vec<OtherArm> = neighbours.iter().map(arm).collect::<Result<_, _>>()?;
        Ok(Self { arms: RefCell::new(arms), commitments: Some(commitments) })
    }

    /// True for an arm that is alone.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.commitments.is_none()
    }

    /// Takes what the others have published.
    pub fn look(&self) {
        self.arms.borrow_mut().iter_mut().for_each(OtherArm::look);
    }

    /// Obstacles for where the others may be, when those of the last call do not cover that any more; `shrinks` as long as nothing
    /// was planned with them.
    ///
    /// # Errors
    /// Why the pose or the motion of one of them is not known, and what to do.
    pub fn obstacles(&self, scene_margin_m: f64, shrinks: bool) -> Result<Option<Vec<Obstacle>>, String> {
        let (mut arms, now_ns) = (self.arms.borrow_mut(), now_ns());
        let mut changed = false;
        for arm in arms.iter_mut() {
            let situation = arm.situation(now_ns).map_err(|unknown| unknown.why)?;
            changed |= arm.rebuild(situation, scene_margin_m, shrinks);
        }
        Ok(changed.then(|| arms.iter().flat_map(|arm| arm.obstacles().to_vec()).collect()))
    }

    /// The others that move, or whose pose is not known, in words: what is refused now may be possible later.
    #[must_use]
    pub fn busy(&self) -> Option<String> {
        let now_ns = now_ns();
        let words = |arm: &OtherArm| match arm.situation(now_ns) {
            Ok(situation) if situation.moves() => Some(arm.words(&situation)),
            Ok(_) => None,
            Err(unknown) => Some(unknown.why),
        };
        let arms = self.arms.borrow();
        let busy: Vec<String> = arms.iter().filter_map(words).collect();
        (!busy.is_empty()).then(|| busy.join("; "))
    }

    /// Why the motion that runs must be looked at: another arm does what its planner has not committed, or nobody knows where it is.
    #[must_use]
    pub fn strayed(&self) -> Option<Strayed> {
        let commitments = self.commitments.as_ref()?;
        let now_ns = now_ns();
        for arm in self.arms.borrow_mut().iter_mut() {
            let name = arm.name().to_owned();
            let committed = |id: u64| match commitments.record_of(&name) {
                Ok(record) => record.is_pending(now_ns) || record.trajectory_ids.contains(&id),
                Err(_) => false,
            };
            match arm.situation(now_ns) {
                Ok(situation) => {
                    if let Some(why) = arm.strayed(&situation, committed) {
                        return Some(Strayed::Moved(why));
                    }
                }
                Err(unknown) if unknown.is_committed(committed) => {}
                Err(unknown) => return Some(Strayed::Unknown(unknown.why)),
            }
        }
        None
    }

    /// The right to commit a motion, with everything known that others have committed before; `None` for an arm that is alone.
    ///
    /// # Errors
    /// When another planner commits one, or what it has sent is not known.
    pub fn take_turn(&self) -> Result<Option<Turn<'_>>, String> {
        let Some(commitments) = &self.commitments else { return Ok(None) };
        let turn = commitments.take_turn(TURN_WITHIN).map_err(|e| e.to_string())?;
        let taken_ns = now_ns();
        self.look();
        for arm in self.arms.borrow_mut().iter_mut() {
            catch_up((commitments, &turn), arm, taken_ns)?;
        }
        Ok(Some(turn))
    }

    /// For a process that sends one motion and plans none: the right to send it, once it is proven in the scene and among the others.
    ///
    /// # Errors
    /// When it is not free, another planner commits a motion, or it is not known where another arm is.
    pub fn commit_one(
        &self,
        (robot, scene): (&Robot, &Scene),
        trajectory: &Trajectory,
        receipt_within: Duration,
    ) -> Result<Option<Turn<'_>>, String> {
        let Some(turn) = self.take_turn()? else { return Ok(None) };
        let since = Instant::now();
        let others = loop {
            match self.obstacles(scene.margin_m, true) {
                Ok(others) => break others.unwrap_or_default(),
                Err(why) if since.elapsed() > REPORT_WITHIN => return Err(why),
                Err(_) => thread::sleep(POLL),
            }
            self.look();
        };
        let obstacles = scene.obstacles.iter().cloned().chain(others).collect();
        verify(robot, &Scene { obstacles, ..scene.clone() }, trajectory).map_err(|e| e.to_string())?;
        turn.announce(receipt_within + SENDING).map_err(|e| e.to_string())?;
        Ok(Some(turn))
    }

    /// What each of them does, in words, and how old its newest report is, s.
    #[must_use]
    pub fn words(&self) -> Vec<NeighbourWords> {
        let now_ns = now_ns();
        let words = |arm: &OtherArm| {
            let age_s = Duration::from_nanos(now_ns.saturating_sub(arm.report_ns())).as_secs_f64();
            let what = match arm.situation(now_ns) {
                Ok(situation) => arm.words(&situation),
                // For people the strokes do not count.
                Err(unknown) => unknown.unseen_id().map_or(unknown.why.clone(), |id| {
                    format!("neighbour `{}` moves along trajectory {id}", arm.name())
                }),
            };
            let report_age_s = (arm.report_ns() > 0).then_some(age_s);
            NeighbourWords { name: arm.name().to_owned(), report_age_s, what }
        };
        self.arms.borrow().iter().map(words).collect()
    }
}

/// Writes down what became of a motion that was sent.
///
/// # Errors
/// When the disk refuses.
pub fn settle(turn: &Turn<'_>, sent: &Result<SentTrajectory, SendError>) -> Result<(), CommitError> {
    let (trajectory_id, was_answered) = match sent {
        Ok(sent) => match sent.receipt.and_then(|receipt| receipt.outcome()) {
            Some(Outcome::Rejected(_)) => (None, true),
            Some(Outcome::Accepted { .. }) => (Some(sent.trajectory_id), true),
            None => (Some(sent.trajectory_id), false),
        },
        // Nobody has received it, or nobody knows.
        Err(SendError::Service(_) | SendError::WrongRobot { .. }) => (None, true),
        Err(SendError::Transport { .. }) => (None, false),
    };
    turn.settle(trajectory_id, was_answered)
}

/// What is known of a neighbour, for people.
#[derive(Clone, Debug, PartialEq)]
pub struct NeighbourWords {
    /// The arm.
    pub name: String,
    /// How old its newest report is, s; `None` before the first.
    pub report_age_s: Option<f64>,
    /// Whether it rests, moves, or is not known.
    pub what: String,
}

/// What another arm does that counts for the motion that runs.
#[derive(Clone, Debug, PartialEq)]
pub enum Strayed {
    /// It is elsewhere than it was, or moves without a commitment: that is known, and can be checked.
    Moved(String),
    /// Nobody knows where it is.
    Unknown(String),
}

/// Brings what is known of an arm to what its planner has committed.
fn catch_up(
    (commitments, turn): (&Commitments, &Turn<'_>),
    arm: &mut OtherArm,
    taken_ns: u64,
) -> Result<(), String> {
    let record = commitments.record_of(arm.name()).map_err(|e: CommitError| e.to_string())?;
    if record.is_pending(taken_ns) {
        let left_s = Duration::from_nanos(record.pending_until_ns - taken_ns).as_secs_f64();
        return Err(format!(
            "the planner of neighbour `{}` has sent a motion and did not see what became of it; ask again in {left_s:.1} s",
            arm.name()
        ));
    }
    if record.sequence == arm.known_sequence && record.pending_until_ns == 0 {
        return Ok(());
    }
    let newer_than_ns =
        taken_ns.max(record.pending_until_ns.saturating_add(SETTLED_NS).min(taken_ns + SETTLED_NS));
    let since = Instant::now();
    while arm.report_ns() <= newer_than_ns {
        if since.elapsed() > REPORT_WITHIN {
            return Err(match arm.situation(now_ns()) {
                Err(unknown) => unknown.why,
                Ok(_) => format!(
                    "neighbour `{}` has not reported for {REPORT_WITHIN:?}; look at its streamer",
                    arm.name()
                ),
            });
        }
        thread::sleep(POLL);
        arm.look();
    }
    arm.known_sequence = record.sequence;
    if record.pending_until_ns != 0 {
        turn.clear_pending(arm.name()).map_err(|e| e.to_string())?;
    }
    Ok(())
}
