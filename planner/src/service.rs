//! The replan service: one request after the other, from the streamer's true state.
//!
//! A request is answered from a report of just now. At rest the motion starts at the
//! commanded pose; while a motion runs, it is replaced (`moving`). The streamer takes a replacement in advance and keeps it
//! until its cut, so that nothing of it hangs on this process. A motion whose requester has gone in the meantime is not sent:
//! no client waits for the arm to move.
mod moving;
mod neighbours;
mod reported;
mod scene;
mod scene_effect;
mod streaming;
mod tip;
mod tip_constraints;

use crate::foreign::Foreign;
use crate::held::check_held;
use crate::kept_scene::{SceneFile, restore};
use crate::kind::PlannerKind;
use crate::live_scene::{LiveScene, SceneRevision};
use crate::neighbours::Neighbours;
use crate::plan::{
    Plan, PlanError, PlanOptions, STACK_BYTES, StartMargin, Task, plan_through_until, plan_until,
};
use crate::send::{Outbox, RECEIPT_TAKES, REPORT_WITHIN, SendError, SentTrajectory, check_robot};
use crate::verify::LeastDistance;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::prelude::ipc;
use moving::Latency;
use reported::Reported;
use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};
use streaming::Stream;
use taustream_arm::daemon::{Manager, Promise};
use taustream_arm::{Robot, Scene};
use taustream_messages::clock::now_ns;
use taustream_messages::event::{Events, Topic};
use taustream_messages::files::Footprint;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome, PlanStages, When};
use taustream_messages::plan_detail::PlanDetail;
use taustream_messages::scene::FixedTo;
use taustream_messages::service::{
    CloudServer, CommandClient, PlanServer, SceneServer, ServiceError, TargetServer, Wire,
};
use taustream_messages::tip_goal::TipGoal;
use taustream_messages::{Phase, PlanReply, PlanRequest, Replaces, Report};
use taustream_motion::JointArray;
use tip_constraints::Remembered;
use tracing::{info, warn};

/// How long the service waits for a request before it looks at targets, reports and files again: targets come without events.
const WAIT_AT_MOST: Duration = Duration::from_millis(2);
/// How often it looks at requests, requesters and the scene while it plans.
const ATTEND_EVERY: Duration = Duration::from_millis(2);
/// How often it looks for the files behind its services.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Longest deadline: others wait meanwhile.
const DEADLINE_MAX: Duration = Duration::from_secs(60);
/// How long the streamer may take for a receipt.
const RECEIPT_WITHIN: Duration = Duration::from_secs(2);
/// A turn without planning takes a wait for a report and one for a receipt at most.
const TURN_WITHIN: Duration = Duration::from_secs(5);
/// What verification and sending may take beyond the deadline of a request; a planner that is later hangs.
const OVERRUN_MAX: Duration = Duration::from_secs(10);
/// How long the place of a planner that was killed may stay taken in shared memory.
const TAKE_OVER_WITHIN: Duration = Duration::from_secs(3);

type Request = ActiveRequest<ipc::Service, PlanRequest, (), PlanReply, ()>;

/// Why a planner cannot serve.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OpenError {
    /// A planner serves this arm already.
    #[error("arm `{arm}` has a taustream-planner already ({why}); end that one first")]
    Served {
        /// The arm's name.
        arm: String,
        /// What shared memory said.
        why: String,
    },
    /// Shared memory refused.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The ports to the streamer cannot be opened.
    #[error(transparent)]
    Send(#[from] SendError),
    /// The scene, or the robot, has a shape that cannot be built.
    #[error("{0}")]
    Scene(String),
    /// There is no thread to feed the watchdog from.
    #[error("cannot start a thread: {0}")]
    Thread(String),
}

impl OpenError {
    /// Only people can help; clearing names cannot.
    #[must_use]
    pub fn is_for_people(&self) -> bool {
        match self {
            Self::Service(e) | Self::Send(SendError::Service(e)) => matches!(
                e,
                ServiceError::Name { .. }
                    | ServiceError::Served { .. }
                    | ServiceError::Foreign { .. }
                    | ServiceError::Blocked { .. }
            ),
            Self::Served { .. } | Self::Send(_) => false,
            Self::Thread(_) | Self::Scene(_) => true,
        }
    }
}

/// The planner of one arm.
pub struct Service<'a> {
    robot: &'a Robot,
    live_scene: RefCell<LiveScene>,
    scene_file: Option<SceneFile>,
    scene_server: SceneServer,
    cloud_server: CloudServer,
    /// What became of a motion by a change of the scene last.
    last_effect: RefCell<String>,
    foreign: Foreign,
    neighbours: Neighbours,
    /// When a neighbour made the streamer stop this arm last.
    stopped_for_neighbour: Cell<Option<Instant>>,
    commands: CommandClient,
    command_events: Events,
    outbox: Outbox<'a>,
    server: PlanServer,
    stop: &'a AtomicBool,
    events: Events,
    /// When the request was taken that is being answered, by `CLOCK_MONOTONIC`, ns.
    received_ns: u64,
    seen: Seen,
    latency: Latency,
    corner_latency: Latency,
    targets: TargetServer,
    stream: Stream,
    promise: Promise,
    reported: Reported,
    kept_constraints: RefCell<Remembered>,
    footprint: Footprint,
}

/// A plan, and the revision of the scene that it was made in.
struct Planned {
    plan: Plan,
    revision: SceneRevision,
}

/// What is known of the streamer between requests.
#[derive(Default)]
struct Seen {
    at: Option<Instant>,
    running: Option<bool>,
}

impl<'a> Service<'a> {
    /// Opens the ports of an arm. The streamer may come later.
    ///
    /// # Errors
    /// When shared memory refuses, for instance because a planner serves this arm already.
    pub fn open(
        wire: &'a Wire,
        robot: &'a Robot,
        scene: &Scene,
        stop: &'a AtomicBool,
    ) -> Result<Self, OpenError> {
        let server = take_server(wire)?;
        let live_scene = LiveScene::new(robot, scene).map_err(|e| OpenError::Scene(e.to_string()))?;
        let outbox = Outbox::open(wire)?;
        let events = wire.events(Topic::Plan);
        if !events.are_there() {
            info!(
                "no events in shared memory: requests are looked for every 2 ms; as a rule, the runtime directory has too long a path for \
                 sockets (107 bytes with the arm's name and 45 more)"
            );
        }
        let promise = Promise::start(Manager::from_environment(), TURN_WITHIN)
            .map_err(|e| OpenError::Thread(e.to_string()))?;
        Ok(Self {
            robot,
            live_scene: RefCell::new(live_scene),
            scene_file: None,
            scene_server: wire.scene_server()?,
            cloud_server: wire.cloud_server()?,
            last_effect: RefCell::default(),
            foreign: Foreign::open(wire)?,
            neighbours: Neighbours::none(),
            stopped_for_neighbour: Cell::new(None),
            commands: wire.command_client()?,
            command_events: wire.events(Topic::Command),
            outbox,
            server,
            stop,
            events,
            received_ns: 0,
            seen: Seen::default(),
            latency: Latency::default(),
            corner_latency: Latency::default(),
            targets: wire.target_server()?,
            stream: Stream::new(robot),
            promise,
            reported: Reported::default(),
            kept_constraints: RefCell::default(),
            footprint: wire.footprint(),
        })
    }

    /// Begins with the scene in a file, if there is one, and keeps every later one there.
    ///
    /// # Errors
    /// When the file makes no sense, or there is no thread to write it from.
    pub fn keep_scene(&mut self, path: &Path) -> Result<(), OpenError> {
        restore(&mut self.live_scene.borrow_mut(), path).map_err(|e| OpenError::Scene(e.to_string()))?;
        let holds = self.live_scene.borrow().objects().iter().any(|object| object.fixed_to == FixedTo::Tip);
        if holds && !self.neighbours.is_empty() {
            let why = "the tip holds an object, which the planners of neighbours ([[neighbour]]) do not know; detach it first";
            return Err(OpenError::Scene(format!("{}: {why}", path.display())));
        }
        let file = SceneFile::open(path).map_err(|e| OpenError::Thread(e.to_string()))?;
        self.scene_file = Some(file);
        Ok(())
    }

    /// Serves until `stop` is set, or the files behind its services vanish.
    pub fn serve(&mut self) -> Ending {
        let mut looked = Instant::now();
        while !self.stop.load(Ordering::Relaxed) {
            self.promise.back_within(TURN_WITHIN);
            self.turn();
            self.events.wait(WAIT_AT_MOST);
            if looked.elapsed() >= LOOK_EVERY {
                looked = Instant::now();
                if let Some(missing) = self.footprint.missing() {
                    warn!(
                        "{} of this running planner has vanished or was replaced (RemoveIPC=yes at logout, a cleaner of /tmp, rm -rf, \
                         or a streamer that started over); opening its services anew",
                        missing.display()
                    );
                    return Ending::NamesGone;
                }
            }
        }
        Ending::Stopped
    }

    /// Looks at the streamer, and at one request.
    fn turn(&mut self) {
        match self.outbox.newest_report() {
            Ok(newest) => self.seen.note(newest.is_some()),
            Err(e) => warn!("{e}"),
        }
        self.foreign.look();
        self.watch_neighbours();
        self.take_scene_requests();
        match self.server.receive() {
            Ok(Some(request)) => self.take(&request),
            Ok(None) => {}
            Err(e) => warn!("cannot take a request: {e:?}"),
        }
        self.follow();
    }

    fn take(&mut self, request: &Request) {
        self.received_ns = now_ns();
        self.reported.begin();
        // Copied out before it is checked.
        let copy = *request.payload();
        let outcome = match CheckedPlanRequest::try_from(&copy) {
            Ok(checked) => match self.answer(request, &checked) {
                Ok(outcome) => outcome,
                Err(reason) => failed(&self.with_neighbours(reason)),
            },
            Err(e) => failed(&e.to_string()),
        };
        let reply = PlanReply::new(&outcome, &self.reported.detail());
        // What others are in the way of now may be possible later.
        let for_now = matches!(outcome, PlanOutcome::Failed { .. }) && self.neighbours.busy().is_some();
        self.reply_with(request, (&outcome, if for_now { reply.for_now() } else { reply }));
    }

    fn answer(&mut self, request: &Request, requested: &CheckedPlanRequest) -> Result<PlanOutcome, String> {
        let expected = self.robot.joints.len();
        if requested.joints != expected {
            let (got, robot) = (requested.joints, &self.robot.name);
            return Err(format!("the goal has {got} joint values, {robot} has {expected} joints"));
        }
        let options = options(requested)?;
        let (report, phase) = self.outbox.current_report(REPORT_WITHIN).map_err(|e| e.to_string())?;
        check_robot(self.robot, &report).map_err(|e| e.to_string())?;
        self.know_neighbours()?;
        if let Some(tip) = requested.tip.filter(|_| requested.when != When::Cancel) {
            return self.go_to_tip(request, (requested, &options), (&tip, &report, phase));
        }
        match (phase, requested.when) {
            (Phase::Holding, When::Cancel) => Err("nothing runs that could be cancelled".to_owned()),
            (Phase::Holding, When::AtOnce | When::AfterCurrent | When::Queue) if report.energised == 1 => {
                let planned = self.plan(request, report.command_rad, (requested, &options))?;
                Ok(self.remembering(self.send(request, &planned), &requested.constraints))
            }
            (phase, _) if moving::runs(phase) => {
                self.replan_in_motion(request, (requested, &options), report)
            }
            _ => Err(not_ready(phase)),
        }
    }

    /// Goes to a position or a pose of the tip.
    fn go_to_tip(
        &mut self,
        request: &Request,
        (requested, options): (&CheckedPlanRequest, &PlanOptions),
        (tip, report, phase): (&TipGoal, &Report, Phase),
    ) -> Result<PlanOutcome, String> {
        let rests = phase == Phase::Holding && report.energised == 1;
        match &tip.line {
            Some(_) if !requested.via_rad.is_empty() => {
                Err("a straight line of the tip passes no way points".to_owned())
            }
            Some(line) if rests => {
                let start = (report.command_rad, requested.held_joints);
                let planned = self.plan_straight(request, start, (tip, line, options))?;
                Ok(self.remembering(self.send(request, &planned), &requested.constraints))
            }
            Some(_) if moving::runs(phase) => {
                Err("a straight line of the tip begins at rest; wait until the motion has ended".to_owned())
            }
            None if rests || moving::runs(phase) => {
                let from_rad = match requested.when {
                    When::AfterCurrent | When::Queue if !rests => report.end_rad,
                    When::AtOnce | When::AfterCurrent | When::Queue | When::Cancel => report.command_rad,
                };
                let near_rad = requested.via_rad.last().copied().unwrap_or(from_rad);
                self.answer_tip(request, (requested, options), (tip, near_rad))
            }
            Some(_) | None => Err(not_ready(phase)),
        }
    }

    /// Plans from a pose at rest.
    fn plan(
        &self,
        request: &Request,
        start_rad: JointArray,
        (requested, options): (&CheckedPlanRequest, &PlanOptions),
    ) -> Result<Planned, String> {
        let (revision, requested) = (self.revision(), requested.holding_at(&start_rad));
        self.check_start(&revision, &start_rad)?;
        let robot = holding(&revision.robot, requested.held_joints, &start_rad);
        let (robot, scene, goal_rad) = (&*robot, &*revision.scene, requested.goal_rad);
        // The arm stands where it stands: after a stop or a sag it could not be moved otherwise.
        let task = Task { robot, scene, start_rad, goal_rad, margin: StartMargin::AsItStands };
        let points_rad = requested.points_rad();
        let planned = self.work(request, options.deadline, |cancel| {
            if requested.via_rad.is_empty() {
                return plan_until(&task, options, Some(cancel));
            }
            let all_rad: Vec<JointArray> = std::iter::once(start_rad).chain(points_rad).collect();
            plan_through_until((robot, scene, StartMargin::AsItStands), &all_rad, options, Some(cancel))
        })?;
        let plan = planned.map_err(|e: PlanError| {
            self.reported.stages(e.stages());
            e.to_string()
        })?;
        self.reported.stages(&plan.stages);
        check_held(robot, &plan.trajectory, requested.held_joints).map_err(|e| e.to_string())?;
        Ok(Planned { plan, revision })
    }

    /// Works on a thread of its own: whatever goes wrong there, the service continues. The work ends when its requester goes;
    /// others are answered meanwhile.
    fn work<T: Send>(
        &self,
        request: &Request,
        deadline: Duration,
        work: impl FnOnce(&AtomicBool) -> T + Send,
    ) -> Result<T, String> {
        self.promise.back_within(deadline + OVERRUN_MAX);
        let cancel = AtomicBool::new(false);
        let result = thread::scope(|scope| {
            let worker = thread::Builder::new().name("plan".to_owned()).stack_size(STACK_BYTES);
            // Dropped at the end, however the work ends: that wakes whoever attends.
            let (working, ended) = channel::<()>();
            let cancelled = &cancel;
            let handle = worker.spawn_scoped(scope, move || {
                let _working = working;
                work(cancelled)
            })?;
            self.attend(request, deadline, &ended, &cancel);
            std::io::Result::Ok(handle.join())
        });
        match result {
            Ok(Ok(worked)) => Ok(worked),
            Ok(Err(_)) => Err("the planner has a fault and gave up on this goal; see its log".to_owned()),
            Err(e) => Err(format!("the planner cannot start a thread: {e}")),
        }
    }

    /// Waits while a motion is planned: answers other requests, and cancels it when nobody waits for it any more.
    fn attend(&self, request: &Request, deadline: Duration, ended: &Receiver<()>, cancel: &AtomicBool) {
        let since = Instant::now();
        let requester = Requester::of(request);
        while ended.recv_timeout(ATTEND_EVERY) == Err(RecvTimeoutError::Timeout) {
            if !cancel.load(Ordering::Relaxed) && !requester.waits(request) {
                info!(
                    "whoever asked for the motion is gone after {:.1} s; planning ends",
                    since.elapsed().as_secs_f64()
                );
                cancel.store(true, Ordering::Relaxed);
            }
            self.foreign.look();
            self.watch_neighbours();
            self.take_scene_requests();
            if self.stop.load(Ordering::Relaxed) {
                cancel.store(true, Ordering::Relaxed);
            }
            while let Ok(Some(other)) = self.server.receive() {
                let refused = failed(&format!(
                    "the planner plans for another request, for {:.1} s of at most {:.1} s; ask again after it",
                    since.elapsed().as_secs_f64(),
                    deadline.as_secs_f64()
                ));
                self.reply(&other, (&refused, &PlanDetail::default()));
            }
        }
    }

    fn send(&self, request: &Request, Planned { plan, revision }: &Planned) -> PlanOutcome {
        let proven_ns = now_ns();
        let turn = match self.commit(revision, (&plan.trajectory, 0.0), RECEIPT_WITHIN) {
            Ok(turn) => turn,
            Err(reason) => return failed(&reason),
        };
        if !request.is_connected() {
            return failed("the client has disconnected; motion not sent");
        }
        let sent = self.outbox.send(self.robot, &plan.trajectory, Replaces::Rest, RECEIPT_WITHIN);
        turn.settle(&sent);
        // After it was sent: nobody moves later for it.
        self.reported.motion((&plan.trajectory, 0.0), LeastDistance::of(&plan.proof, 0.0));
        match sent {
            Ok(sent) => PlanOutcome::Planned {
                trajectory_id: sent.trajectory_id,
                planning_s: plan.planning_s,
                duration_s: plan.proof.duration_s,
                clearance_m: plan.proof.clearance_m,
                strokes: u32::try_from(plan.trajectory.strokes().len()).unwrap_or(u32::MAX),
                how: plan.how.clone(),
                receipt: sent.receipt.map(Box::new),
                stages: self.stages(&sent, proven_ns),
            },
            Err(e) => failed(&e.to_string()),
        }
    }
}

impl Service<'_> {
    /// When what was done for the request that is being answered; the receipt has just come.
    fn stages(&self, sent: &SentTrajectory, proven_ns: u64) -> PlanStages {
        let (received_ns, planned_ns) = (self.received_ns, proven_ns);
        PlanStages { received_ns, planned_ns, proven_ns, sent_ns: sent.sent_ns, receipt_ns: now_ns() }
    }

    fn reply(&self, request: &Request, (outcome, detail): (&PlanOutcome, &PlanDetail)) {
        self.reply_with(request, (outcome, PlanReply::new(outcome, detail)));
    }

    fn reply_with(&self, request: &Request, (outcome, reply): (&PlanOutcome, PlanReply)) {
        // A requester that has gone needs no answer.
        if let Err(e) = request.send_copy(reply) {
            info!("the answer was not taken: {e:?}");
        }
        self.events.notify();
        match outcome {
            PlanOutcome::Failed { reason } => info!("answered: {reason}"),
            PlanOutcome::Planned { trajectory_id, planning_s, duration_s, how, receipt, .. } => info!(
                trajectory_id,
                planning_s,
                duration_s,
                outcome = ?receipt.as_ref().map(|r| r.outcome()),
                "answered: {how}"
            ),
        }
    }
}

/// Why a planner does not serve any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// It was stopped.
    Stopped,
    /// The files behind its services are gone: nobody finds it.
    NamesGone,
}

/// The process that waits for an answer.
struct Requester(Option<u32>);

impl Requester {
    /// The process, if it is one that can be seen from here.
    fn of(request: &Request) -> Self {
        Self(Some(request.payload().sender_pid()).filter(|pid| is_alive(*pid)))
    }

    /// It has not dropped its request, and was not killed with it.
    fn waits(&self, request: &Request) -> bool {
        request.is_connected() && self.0.is_none_or(is_alive)
    }
}

/// A process that exists and has not ended (proc(5): the state stands after the name in parentheses).
fn is_alive(pid: u32) -> bool {
    let state = |stat: String| stat.rsplit_once(')').and_then(|(_, rest)| rest.trim().chars().next());
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok();
    stat.and_then(state).is_some_and(|state| !matches!(state, 'Z' | 'X'))
}

impl Seen {
    fn note(&mut self, reported: bool) {
        if reported {
            self.at = Some(Instant::now());
        }
        let running = self.is_recent();
        if self.running != Some(running) {
            self.running = Some(running);
            if running {
                info!("the streamer reports");
            } else {
                info!("waiting for the streamer; start taustream-streamer with the same settings");
            }
        }
    }

    fn is_recent(&self) -> bool {
        self.at.is_some_and(|at| at.elapsed() <= REPORT_WITHIN)
    }
}

/// The robot, with joints that hold where they stand.
fn holding<'r>(robot: &'r Robot, held_joints: u32, at_rad: &JointArray) -> Cow<'r, Robot> {
    if held_joints == 0 { Cow::Borrowed(robot) } else { Cow::Owned(robot.holding(held_joints, at_rad)) }
}

fn options(requested: &CheckedPlanRequest) -> Result<PlanOptions, String> {
    let planner = match requested.planner.as_str() {
        "" => PlannerKind::default(),
        name => PlannerKind::from_name(name)
            .ok_or_else(|| format!("unknown planner `{name}`; use one of {}", PlannerKind::names()))?,
    };
    let default = PlanOptions::default();
    let (deadline, spends_deadline) = match requested.deadline_ms {
        0 => (default.deadline, false),
        ms => (Duration::from_millis(ms.into()).min(DEADLINE_MAX), true),
    };
    let (seed, blend, constraints) = (requested.seed, requested.blend, requested.constraints);
    Ok(PlanOptions { seed, deadline, planner, blend, constraints, spends_deadline, ..default })
}

/// Why an arm in this phase gets no plan, and what to do.
fn not_ready(phase: Phase) -> String {
    let hint = match phase {
        Phase::Disabled | Phase::Locked => "run `taustream enable`",
        Phase::Fault => "run `taustream clear-fault`, then `taustream enable`",
        Phase::Holding => "its drives are not energised; run `taustream enable`",
        Phase::Configuring
        | Phase::Enabling
        | Phase::Moving
        | Phase::Pausing
        | Phase::Paused
        | Phase::Stopping
        | Phase::FastStopping
        | Phase::Braking
        | Phase::Homing
        | Phase::Disabling => "wait until that has ended and try again",
    };
    format!("the arm is {}; {hint}", phase.word())
}

fn failed(reason: &str) -> PlanOutcome {
    PlanOutcome::Failed { reason: reason.to_owned() }
}

/// The one place of a planner. That of a killed planner is free again once shared memory has been cleaned up.
fn take_server(wire: &Wire) -> Result<PlanServer, OpenError> {
    let since = Instant::now();
    loop {
        match wire.plan_server() {
            Ok(server) => return Ok(server),
            Err(ServiceError::Refused { arm, why, .. }) if since.elapsed() > TAKE_OVER_WITHIN => {
                return Err(OpenError::Served { arm, why });
            }
            Err(e) if since.elapsed() > TAKE_OVER_WITHIN => return Err(e.into()),
            Err(_) => thread::sleep(Duration::from_millis(100)),
        }
    }
}
