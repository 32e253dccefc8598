//! Other arms in the room: their obstacles are those of the scene's newest revision, and each motion is committed before it is sent.
use super::{OpenError, Service};
use crate::live_scene::{Changed, SceneRevision};
use crate::neighbours::commitment::Turn;
use crate::neighbours::{Neighbours, SENDING, Strayed, settle};
use crate::send::{SendError, SentTrajectory};
use crate::service::moving::runs;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};
use taustream_arm::Neighbour;
use taustream_messages::clock::now_ns;
use taustream_messages::scene::{FixedTo, SceneChange};
use taustream_messages::scene_reply::MotionEffect;
use taustream_motion::{JointArray, Trajectory};
use tracing::warn;

/// How often the streamer is asked to stop for the same reason.
const STOP_EVERY: Duration = Duration::from_millis(500);

/// A motion that may be sent: no neighbour's planner commits one meanwhile.
#[must_use]
pub(super) struct Committing<'s>(Option<Turn<'s>>);

impl Committing<'_> {
    /// Writes down what became of it.
    pub(super) fn settle(self, sent: &Result<SentTrajectory, SendError>) {
        let Some(turn) = self.0 else { return };
        if let Err(e) = settle(&turn, sent) {
            warn!("{e}");
        }
    }
}

impl Service<'_> {
    /// Counts other arms in the same room from now on. `runtime` is the runtime directory that all share.
    ///
    /// # Errors
    /// When a shape of theirs cannot be built, or the directory of the locks cannot be made.
    pub fn mind_neighbours(
        &mut self,
        own: &str,
        neighbours: &[Neighbour],
        runtime: &Path,
    ) -> Result<(), OpenError> {
        self.neighbours = Neighbours::open(own, neighbours, runtime).map_err(OpenError::Scene)?;
        Ok(())
    }

    /// Refuses to fix an object to the tip of an arm with neighbours: their planners would not know of it.
    pub(super) fn check_tip_changes(&self, changes: &[SceneChange]) -> Result<(), String> {
        let to_tip = |change: &&SceneChange| match change {
            SceneChange::Attach { .. } => true,
            SceneChange::Add { fixed_to, .. } => *fixed_to == FixedTo::Tip,
            SceneChange::Remove { .. } | SceneChange::Move { .. } | SceneChange::Detach { .. } => false,
        };
        if self.neighbours.is_empty() || !changes.iter().any(|change| to_tip(&change)) {
            return Ok(());
        }
        Err("the arm has neighbours ([[neighbour]]), whose planners do not know what its tip holds; describe the tool in the robot file"
            .to_owned())
    }

    /// Brings the scene to where the neighbours are, or may come to.
    pub(super) fn know_neighbours(&self) -> Result<(), String> {
        self.neighbours.look();
        self.occupy(true).map(drop)
    }

    fn occupy(&self, shrinks: bool) -> Result<Changed, String> {
        let scene_margin_m = self.revision().scene.margin_m;
        match self.neighbours.obstacles(scene_margin_m, shrinks)? {
            Some(obstacles) => self.live_scene.borrow_mut().occupy(obstacles).map_err(|e| e.to_string()),
            None => Ok(Changed::default()),
        }
    }

    /// Refuses a start inside the margin of a motion that another arm is about to make: that motion was checked against the start, and
    /// only as long as this arm stands there.
    pub(super) fn check_start(&self, revision: &SceneRevision, start_rad: &JointArray) -> Result<(), String> {
        if self.neighbours.is_empty() {
            return Ok(());
        }
        let Some(busy) = self.neighbours.busy() else { return Ok(()) };
        let names: BTreeSet<String> = self.live_scene.borrow().occupied_names().map(str::to_owned).collect();
        match revision.world.only(&names, &BTreeSet::new()).contact(start_rad) {
            None => Ok(()),
            Some(contact) => Err(format!(
                "the arm stands too near to what a neighbour is about to pass: {contact}; {busy}"
            )),
        }
    }

    /// A refusal, with what other arms do that may be its reason.
    pub(super) fn with_neighbours(&self, reason: String) -> String {
        match self.neighbours.busy() {
            Some(busy) if !reason.contains(&busy) => {
                format!("{reason}; --wait-s waits for this: {busy}")
            }
            Some(_) | None => reason,
        }
    }

    /// The right to send a motion that was proven in a revision of the scene: nothing that has changed since is in its way, and no
    /// neighbour's planner commits another one until what became of it is written down.
    pub(super) fn commit(
        &self,
        planned_in: &SceneRevision,
        motion: (&Trajectory, f64),
        receipt_within: Duration,
    ) -> Result<Committing<'_>, String> {
        let turn = self.neighbours.take_turn()?;
        if let Some(turn) = &turn {
            self.occupy(false)?;
            self.still_free(planned_in, motion)?;
            turn.announce(receipt_within + SENDING).map_err(|e| e.to_string())?;
        } else {
            self.still_free(planned_in, motion)?;
        }
        Ok(Committing(turn))
    }

    /// What other arms do that their planners have not committed is a change of the scene; where nobody knows where they are, this one
    /// stops.
    pub(super) fn watch_neighbours(&self) {
        if self.neighbours.is_empty() {
            return;
        }
        self.neighbours.look();
        if !self.outbox.last_report().is_some_and(|(_, phase)| runs(phase)) {
            return;
        }
        match self.neighbours.strayed() {
            None => {}
            Some(Strayed::Moved(why)) => {
                warn!("{why}");
                match self.occupy(false) {
                    Ok(changed) => {
                        let _logged = self.effect_on_motion(&changed);
                    }
                    Err(why) => self.stop_for_neighbour(&why),
                }
            }
            Some(Strayed::Unknown(why)) => self.stop_for_neighbour(&why),
        }
    }

    fn stop_for_neighbour(&self, why: &str) {
        if self.stopped_for_neighbour.get().is_some_and(|at| at.elapsed() < STOP_EVERY) {
            return;
        }
        self.stopped_for_neighbour.set(Some(Instant::now()));
        let _logged = self.stop((MotionEffect::Stopped, false), (why, now_ns()));
    }
}
