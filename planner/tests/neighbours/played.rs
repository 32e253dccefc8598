//! Two arms: a played streamer and a real planner each, over real shared memory, in time that passes faster.
use super::common::{pose, ur5};
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::{Neighbour, Robot, Scene, runtime};
use taustream_messages::clock::now_ns;
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome};
use taustream_messages::service::Wire;
use taustream_messages::{
    CheckedTrajectory, Command, CommandReply, LAYOUT_VERSION, Outcome, Phase, PlanReply, PlanRequest,
    Receipt, Rejection, Replaces, Report,
};
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::service::Service;

pub(super) const MARGIN_M: f64 = 0.05;
/// The tip of either arm in front of the other one, of both on the way from [`FROM`] to [`TO`].
pub(super) const FROM: [f64; 6] = [-1.3, -1.2, 1.2, -1.57, -1.57, 0.0];
pub(super) const MIDDLE: [f64; 6] = [0.0, -1.2, 1.2, -1.57, -1.57, 0.0];
pub(super) const TO: [f64; 6] = [1.3, -1.2, 1.2, -1.57, -1.57, 0.0];

/// The base of either arm in the frame of the other one: they face each other.
pub(super) fn base() -> Isometry3<f64> {
    let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::PI);
    Isometry3::from_parts(Translation3::new(-1.0, 0.0, 0.0), turned)
}

pub(super) fn join(arm: &str, node: &str) -> Wire {
    Wire::join(arm, node, &runtime::directory().expect("a directory")).expect("joins")
}

#[derive(Default)]
pub(super) struct State {
    pub(super) running: Option<(u64, Trajectory)>,
    waits: Option<(u64, Trajectory, f64)>,
    pub(super) now_s: f64,
    pub(super) generation: u64,
    pub(super) rest_rad: JointArray,
    /// Where the arm was every millisecond.
    pub(super) commanded: Vec<(Instant, JointArray)>,
    pub(super) stops: u32,
    /// Trajectory time that passes a second; 0 for a pause.
    pub(super) speed: f64,
    /// The arm is where its commands are not.
    pub(super) phase: Option<Phase>,
}

#[derive(Default)]
pub(super) struct Played {
    pub(super) state: Mutex<State>,
    pub(super) mute: AtomicBool,
    /// Receipts are lost.
    pub(super) deaf: AtomicBool,
    end: AtomicBool,
}

impl State {
    fn step(&mut self, passed_s: f64) {
        let Some((_, motion)) = &self.running else { return };
        self.now_s += passed_s * self.speed;
        self.rest_rad = motion.sample(self.now_s).position_rad;
        if let Some((id, waiting, _)) = self.waits.take_if(|(_, _, from_s)| self.now_s >= *from_s) {
            self.rest_rad = waiting.sample(self.now_s).position_rad;
            self.running = Some((id, waiting));
        }
        let ended = self.running.as_ref().is_some_and(|(_, motion)| self.now_s >= motion.duration_s());
        if ended && self.waits.is_none() {
            self.running = None;
        }
    }

    fn report(&self, robot: &Robot, sequence: u64) -> Report {
        let moving = if self.speed > 0.0 { Phase::Moving } else { Phase::Paused };
        let phase = self.phase.unwrap_or(if self.running.is_some() { moving } else { Phase::Holding });
        let last = self.waits.as_ref().map(|(_, motion, _)| motion);
        let last = last.or(self.running.as_ref().map(|(_, motion)| motion));
        Report {
            layout_version: LAYOUT_VERSION,
            joint_count: 6,
            sequence,
            time_ns: now_ns(),
            robot_digest: robot.digest,
            phase: phase.code(),
            energised: u32::from(self.phase.is_none()),
            sigma: self.speed.min(1.0),
            speed_percent: 100.0,
            generation: self.generation,
            trajectory_id: self.running.as_ref().map_or(0, |(id, _)| *id),
            trajectory_s: self.now_s,
            successor_id: self.waits.as_ref().map_or(0, |(id, ..)| *id),
            successor_from_s: self.waits.as_ref().map_or(0.0, |(_, _, from_s)| *from_s),
            end_s: last.map_or(0.0, Trajectory::duration_s),
            end_rad: last.map_or(self.rest_rad, Trajectory::end_rad),
            command_rad: self.rest_rad,
            measured_rad: self.rest_rad,
            ..Report::default()
        }
    }

    fn take(&mut self, checked: CheckedTrajectory) -> Outcome {
        if checked.generation != self.generation + 1 {
            let (got, newest) = (checked.generation, self.generation);
            return Outcome::Rejected(Rejection::StaleGeneration { got, newest });
        }
        let (id, motion) = (checked.trajectory_id, checked.trajectory);
        let outcome = match checked.replaces {
            Replaces::Rest => {
                assert!(self.running.is_none(), "from rest while the arm moves");
                (self.now_s, self.running) = (0.0, Some((id, motion)));
                Outcome::Accepted { from_s: 0.0, tick: 9 }
            }
            Replaces::Cut { at_s, .. } => {
                let by_s = self.now_s - at_s;
                if by_s > 0.0 || self.running.is_none() {
                    return Outcome::Rejected(Rejection::CutPassed { at_s, by_s });
                }
                self.waits = Some((id, motion, at_s));
                Outcome::Accepted { from_s: at_s, tick: 0 }
            }
        };
        self.generation += 1;
        outcome
    }
}

impl Played {
    fn play(&self, arm: &str, robot: &Robot, begun: &AtomicUsize) {
        let wire = join(arm, "played-streamer");
        let reports = wire.report_publisher().expect("port");
        let receipts = wire.receipt_publisher().expect("port");
        let trajectories = wire.trajectory_subscriber().expect("port");
        let commands = wire.command_server().expect("port");
        begun.fetch_add(1, Ordering::SeqCst);
        let (mut sequence, mut stepped) = (0, Instant::now());
        while !self.end.load(Ordering::SeqCst) {
            let mut state = self.state.lock().expect("no panic");
            let passed_s = stepped.elapsed().as_secs_f64();
            stepped = Instant::now();
            state.step(passed_s);
            let at = (stepped, state.rest_rad);
            state.commanded.push(at);
            sequence += 1;
            let mut is_due = sequence % 10 == 0;
            while let Some(sample) = trajectories.receive().expect("received") {
                let checked =
                    CheckedTrajectory::try_from(&*Box::new(*sample.payload())).expect("a good message");
                let (id, generation) = (checked.trajectory_id, checked.generation);
                let outcome = state.take(checked);
                if !self.deaf.load(Ordering::SeqCst) {
                    receipts.send_copy(Receipt::new(id, generation, &outcome)).expect("sent");
                }
                is_due = true;
            }
            while let Some(request) = commands.receive().expect("received") {
                let command = Command::try_from(request.payload()).expect("a command");
                assert!(matches!(command, Command::Stop | Command::FastStop), "{command:?}");
                (state.running, state.waits, state.stops) = (None, None, state.stops + 1);
                request.send_copy(CommandReply::accepted(Phase::Stopping, "stopping")).expect("sent");
            }
            if is_due && !self.mute.load(Ordering::SeqCst) {
                reports.send_copy(state.report(robot, sequence)).expect("sent");
            }
            drop(state);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Two arms in one room.
pub(super) struct Room {
    pub(super) names: [String; 2],
    pub(super) runtime: PathBuf,
    pub(super) arms: [Played; 2],
}

impl Room {
    /// Arms in two poses, whose trajectory time passes at a speed.
    pub(super) fn new(test: &str, poses: [[f64; 6]; 2], speed: f64) -> Self {
        let names = ["left", "right"].map(|side| format!("{side}-{test}-{}", std::process::id()));
        let arms = poses.map(|rest| {
            let played = Played::default();
            {
                let mut state = played.state.lock().expect("no panic");
                (state.rest_rad, state.speed) = (pose(rest), speed);
            }
            played
        });
        Self { names, runtime: runtime::directory().expect("a directory"), arms }
    }

    /// What the settings of an arm say of the other one.
    fn neighbour(&self, of: usize) -> Neighbour {
        Neighbour {
            name: self.names[1 - of].clone(),
            file: PathBuf::from("other.toml"),
            robot: ur5(),
            base: base(),
            margin_m: MARGIN_M,
            tracking_error_rad_max: 0.05,
            report_rate_hz: 100.0,
        }
    }

    /// Runs planners and streamers around a test; `minds` says which planners know the other arm.
    pub(super) fn run(&self, minds: [bool; 2], test: impl FnOnce(&Self)) {
        let (robot, scene) = (ur5(), Scene { margin_m: 0.02, ..Scene::default() });
        let (stop, ready) = (AtomicBool::new(false), AtomicUsize::new(0));
        thread::scope(|s| {
            for (side, minds) in minds.into_iter().enumerate() {
                let (robot, scene, stop, ready) = (&robot, &scene, &stop, &ready);
                s.spawn(move || self.arms[side].play(&self.names[side], robot, ready));
                s.spawn(move || {
                    let wire = join(&self.names[side], "planner");
                    let mut service = Service::open(&wire, robot, scene, stop).expect("opens");
                    if minds {
                        let other = [self.neighbour(side)];
                        service.mind_neighbours(&self.names[side], &other, &self.runtime).expect("minds");
                    }
                    ready.fetch_add(1, Ordering::SeqCst);
                    service.serve();
                });
            }
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
                wait_until("everybody is ready", || ready.load(Ordering::SeqCst) == 4);
                // Every planner has seen the other arm once.
                thread::sleep(Duration::from_millis(200));
                test(self);
            }));
            stop.store(true, Ordering::SeqCst);
            self.arms.iter().for_each(|arm| arm.end.store(true, Ordering::SeqCst));
            if let Err(panic) = result {
                std::panic::resume_unwind(panic);
            }
        });
    }

    pub(super) fn ask(&self, side: usize, goal: [f64; 6]) -> PlanReply {
        let wire = join(&self.names[side], "client");
        let client = wire.plan_client().expect("port");
        let request = CheckedPlanRequest { deadline_ms: 400, ..CheckedPlanRequest::to_pose(6, pose(goal)) };
        let pending = client.send_copy(PlanRequest::from(&request)).expect("sent");
        let since = Instant::now();
        loop {
            if let Some(reply) = pending.receive().expect("received") {
                return *reply.payload();
            }
            assert!(since.elapsed() < Duration::from_secs(30), "no answer");
            thread::sleep(Duration::from_millis(1));
        }
    }

    /// The answer once the planner has seen what is true: an arm that has just come to rest still moves in its newest report.
    fn settled(&self, side: usize, goal: [f64; 6]) -> PlanReply {
        let mut reply = self.ask(side, goal);
        wait_until("the planner has seen that both arms rest", || {
            let is_behind = reply.is_for_now() && !self.is_moving(0) && !self.is_moving(1);
            if is_behind {
                reply = self.ask(side, goal);
            }
            !is_behind
        });
        reply
    }

    pub(super) fn go(&self, side: usize, goal: [f64; 6]) {
        let outcome = self.settled(side, goal).outcome();
        assert!(matches!(outcome, PlanOutcome::Planned { .. }), "{outcome:?}");
    }

    pub(super) fn refusal(&self, side: usize, goal: [f64; 6]) -> (String, bool) {
        let reply = self.ask(side, goal);
        let PlanOutcome::Failed { reason } = reply.outcome() else { panic!("{:?}", reply.outcome()) };
        (reason, reply.is_for_now())
    }

    /// Why a goal is refused for good while both arms rest.
    pub(super) fn lasting_refusal(&self, side: usize, goal: [f64; 6]) -> String {
        let reply = self.settled(side, goal);
        let PlanOutcome::Failed { reason } = reply.outcome() else { panic!("{:?}", reply.outcome()) };
        assert!(!reply.is_for_now(), "{reason}");
        reason
    }

    pub(super) fn is_moving(&self, side: usize) -> bool {
        self.arms[side].state.lock().expect("no panic").running.is_some()
    }

    pub(super) fn wait_for_rest(&self) {
        wait_until("both arms rest", || !self.is_moving(0) && !self.is_moving(1));
    }

    /// The least distance of the two arms at any millisecond since the test has begun, by a check that knows nothing of the planner.
    pub(super) fn least_distance_m(&self) -> f64 {
        let logs = [0, 1].map(|side| self.arms[side].state.lock().expect("no panic").commanded.clone());
        let (robot, mut other, mut least_m) = (ur5(), 0, f64::INFINITY);
        for (when, q) in logs[0].iter().step_by(4) {
            while logs[1].get(other + 1).is_some_and(|(then, _)| then <= when) {
                other += 1;
            }
            let Some((_, of_other)) = logs[1].get(other) else { break };
            let apart_m = super::common::ur5_pair_distance_m(&robot, [q, of_other], &base());
            least_m = least_m.min(apart_m);
        }
        least_m
    }
}

pub(super) fn wait_until(what: &str, mut is: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is() {
        assert!(since.elapsed() < Duration::from_secs(30), "waited in vain until {what}");
        thread::sleep(Duration::from_millis(2));
    }
}
