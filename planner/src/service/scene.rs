//! Changes of the scene: taken at any moment, while a motion is planned as well, and checked against what runs at once.
//!
//! A set of changes becomes the next revision of the scene, or is refused as a whole. Nothing goes away because its
//! sender has died: an object stays where it was seen last until somebody says otherwise.
use super::Service;
use super::scene_effect::Effect;
use crate::budget::Budget;
use crate::live_scene::{Changed, SceneRevision};
use crate::verify::{Stretch, first_contact};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::prelude::{ZeroCopySend, ipc};
use std::fmt::Debug;
use std::time::Duration;
use taustream_messages::clock::now_ns;
use taustream_messages::cloud::CheckedCloud;
use taustream_messages::scene::{CheckedSceneRequest, PAGE, SceneChange};
use taustream_messages::scene_reply::SceneOutcome;
use taustream_messages::{Phase, SceneReply, SceneRequest};
use taustream_motion::{JointArray, Trajectory};
use tracing::{info, warn};

/// Most requests of one look: whoever floods the planner does not keep it from planning.
const REQUESTS_MAX: usize = 64;
/// Most point clouds of one look.
const CLOUDS_MAX: usize = 2;
/// How long what was planned before a change may be checked again.
const RECHECK_WITHIN: Duration = Duration::from_millis(200);

type Request = ActiveRequest<ipc::Service, SceneRequest, (), SceneReply, ()>;

/// A request whose changes count, and what they made.
struct Accepted {
    request: Request,
    revision: u64,
    received_ns: u64,
}

impl Service<'_> {
    /// The newest revision of the scene.
    pub(super) fn revision(&self) -> SceneRevision {
        self.live_scene.borrow().current().clone()
    }

    /// Takes what has come, and checks the motion that runs once against all of it.
    pub(super) fn take_scene_requests(&self) {
        let (mut accepted, mut changed) = (Vec::new(), Changed::default());
        for _ in 0..REQUESTS_MAX {
            let request = match self.scene_server.receive() {
                Ok(Some(request)) => request,
                Ok(None) => break,
                Err(e) => {
                    warn!("cannot take a change of the scene: {e:?}");
                    break;
                }
            };
            let received_ns = now_ns();
            // Copied out before it is checked.
            let copy = *request.payload();
            match self.take_scene_request(&copy, &mut changed) {
                Ok(Some(listed)) => self.answer_scene(&request, &listed),
                Ok(None) => {
                    let revision = self.live_scene.borrow().current().number;
                    accepted.push(Accepted { request, revision, received_ns });
                }
                Err(reason) => self.answer_scene(&request, &SceneOutcome::Refused { reason }),
            }
        }
        self.take_clouds();
        if accepted.is_empty() {
            return;
        }
        let effect = self.effect_on_motion(&changed);
        if let Some(file) = &self.scene_file {
            file.keep(&self.live_scene.borrow());
        }
        let total = self.live_scene.borrow().objects().len();
        for Accepted { request, revision, received_ns } in accepted {
            let outcome = SceneOutcome::Changed {
                revision,
                total,
                effect: effect.effect,
                note: effect.note.clone(),
                times_ns: [received_ns, effect.checked_ns, effect.acted_ns],
            };
            self.answer_scene(&request, &outcome);
        }
    }

    /// Takes point clouds, few at a time: each takes as long as a tree over its points.
    fn take_clouds(&self) {
        for _ in 0..CLOUDS_MAX {
            let request = match self.cloud_server.receive() {
                Ok(Some(request)) => request,
                Ok(None) => return,
                Err(e) => return warn!("cannot take a point cloud: {e:?}"),
            };
            let received_ns = now_ns();
            let read = CheckedCloud::try_from(request.payload()).map_err(|e| e.to_string());
            let put = |cloud: CheckedCloud| self.live_scene.borrow_mut().put_cloud(&cloud);
            let changed = read.and_then(|cloud| put(cloud).map_err(|e| e.to_string()));
            let outcome = match changed {
                Ok(changed) => {
                    let Effect { effect, note, checked_ns, acted_ns } = self.effect_on_motion(&changed);
                    if let Some(file) = &self.scene_file {
                        file.keep(&self.live_scene.borrow());
                    }
                    let live = self.live_scene.borrow();
                    let (revision, total) = (live.current().number, live.objects().len());
                    let times_ns = [received_ns, checked_ns, acted_ns];
                    SceneOutcome::Changed { revision, total, effect, note, times_ns }
                }
                Err(reason) => SceneOutcome::Refused { reason },
            };
            self.answer_scene(&request, &outcome);
        }
    }

    /// A page of the list, or nothing for changes that count from now on.
    fn take_scene_request(
        &self,
        copy: &SceneRequest,
        changed: &mut Changed,
    ) -> Result<Option<SceneOutcome>, String> {
        match CheckedSceneRequest::try_from(copy).map_err(|e| e.to_string())? {
            CheckedSceneRequest::List { first } => Ok(Some(self.page(first))),
            CheckedSceneRequest::Change(changes) => {
                self.check_tip_changes(&changes)?;
                let at_rest = self.rests_at(&changes);
                let made = self.live_scene.borrow_mut().apply(&changes, at_rest.as_ref());
                changed.join(&made.map_err(|e| e.to_string())?);
                Ok(None)
            }
        }
    }

    fn page(&self, first: usize) -> SceneOutcome {
        let live = self.live_scene.borrow();
        let objects = live.objects();
        SceneOutcome::Listed {
            revision: live.current().number,
            total: objects.len(),
            first,
            objects: objects.into_iter().skip(first).take(PAGE).collect(),
            last_effect: self.last_effect.borrow().clone(),
        }
    }

    /// The commanded pose of an arm that is known to rest, for changes that need it.
    fn rests_at(&self, changes: &[SceneChange]) -> Option<JointArray> {
        let of_tip = |change: &SceneChange| match change {
            SceneChange::Attach { .. } | SceneChange::Detach { .. } | SceneChange::Add { .. } => true,
            SceneChange::Move { .. } | SceneChange::Remove { .. } => false,
        };
        if !changes.iter().any(of_tip) {
            return None;
        }
        let (report, phase) = self.known_report()?;
        let rests = matches!(phase, Phase::Holding | Phase::Paused | Phase::Disabled | Phase::Locked);
        rests.then_some(report.command_rad)
    }

    fn answer_scene<P: Debug + ZeroCopySend + 'static>(
        &self,
        request: &ActiveRequest<ipc::Service, P, (), SceneReply, ()>,
        outcome: &SceneOutcome,
    ) {
        // A sender that has gone needs no answer.
        if let Err(e) = request.send_copy(SceneReply::new(outcome)) {
            info!("the answer to a change of the scene was not taken: {e:?}");
        }
        self.events.notify();
        if let SceneOutcome::Refused { reason } = outcome {
            info!("change of the scene refused: {reason}");
        }
    }

    /// Refuses a motion that was planned in an older revision when what has changed since is in its way.
    pub(super) fn still_free(
        &self,
        planned_in: &SceneRevision,
        (trajectory, from_s): (&Trajectory, f64),
    ) -> Result<(), String> {
        let now = self.revision();
        if now.number == planned_in.number {
            return Ok(());
        }
        let changed = self.live_scene.borrow().changed_since(planned_in.number);
        let Some(changed) = changed else {
            return Err("the scene has changed too often while the motion was planned; ask again".to_owned());
        };
        if changed.is_empty() {
            return Ok(());
        }
        let world = now.world.only(&changed.obstacles, &changed.links);
        let span_s = [from_s, trajectory.duration_s().max(from_s)];
        let budget = Budget::until(RECHECK_WITHIN, None);
        match first_contact(&Stretch { world: &world, span_s }, trajectory, &budget) {
            None => Ok(()),
            Some((_, violation)) => Err(format!(
                "the scene has changed while the motion was planned, which is not free any more: {violation}; ask again"
            )),
        }
    }
}
