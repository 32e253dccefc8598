//! A streamer played by the tests, and who asks the planner.
use super::common::{pose, ur5, ur5_distances_m, ur5_origins_m};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use taustream_arm::{Obstacle, Robot, Scene, runtime};
use taustream_messages::clock::now_ns;
use taustream_messages::cloud::{CheckedCloud, CloudRequest};
use taustream_messages::plan::{CheckedPlanRequest, PlanOutcome};
use taustream_messages::scene::{FixedTo, ObjectPose, ObjectShape, SceneChange};
use taustream_messages::scene_reply::{ListedObject, MotionEffect, SceneOutcome};
use taustream_messages::service::Wire;
use taustream_messages::{
    CheckedSceneRequest, CheckedTrajectory, Command, CommandReply, LAYOUT_VERSION, Outcome, Phase,
    PlanRequest, Receipt, Rejection, Replaces, Report, SceneReply, SceneRequest,
};
use taustream_motion::{JointArray, Trajectory};
use taustream_planner::service::Service;

pub(super) const FROM: [f64; 6] = [-1.5, -1.2, 1.2, -1.57, -1.57, 0.0];
pub(super) const TO: [f64; 6] = [1.5, -1.2, 1.2, -1.57, -1.57, 0.0];
pub(super) const NO_ID: u64 = 0;

pub(super) fn join(arm: &str, node: &str) -> Wire {
    Wire::join(arm, node, &runtime::directory().expect("a directory")).expect("joins")
}

/// A motion that was accepted, on its own axis of trajectory time.
#[derive(Clone)]
pub(super) struct Motion {
    pub(super) id: u64,
    pub(super) trajectory: Trajectory,
    /// From when it is sampled.
    pub(super) from_s: f64,
}

#[derive(Default)]
pub(super) struct State {
    pub(super) running: Option<Motion>,
    pub(super) waits: Option<Motion>,
    pub(super) zero: Option<Instant>,
    pub(super) generation: u64,
    pub(super) rest_rad: JointArray,
    /// What the arm was commanded, every millisecond.
    pub(super) commanded: Vec<(Instant, JointArray)>,
    pub(super) stops: u32,
}

/// A streamer that takes what it is sent, and runs it.
#[derive(Default)]
pub(super) struct Played {
    pub(super) state: Mutex<State>,
    pub(super) end: AtomicBool,
}

impl State {
    pub(super) fn now_s(&self) -> f64 {
        self.zero.map_or(0.0, |zero| zero.elapsed().as_secs_f64())
    }

    /// Trajectory time goes on; what has ended, rests.
    pub(super) fn step(&mut self) {
        let now_s = self.now_s();
        if self.waits.as_ref().is_some_and(|waits| now_s >= waits.from_s) {
            self.running = self.waits.take();
        }
        if let Some(motion) = &self.running {
            let at_rad = motion.trajectory.sample(now_s).position_rad;
            self.rest_rad = at_rad;
            self.commanded.push((Instant::now(), at_rad));
            if now_s >= motion.trajectory.duration_s() && self.waits.is_none() {
                self.running = None;
            }
        }
    }

    pub(super) fn report(&self, robot: &Robot, sequence: u64) -> Report {
        let end = self.waits.as_ref().or(self.running.as_ref()).map(|motion| &motion.trajectory);
        Report {
            layout_version: LAYOUT_VERSION,
            joint_count: 6,
            sequence,
            time_ns: now_ns(),
            robot_digest: robot.digest,
            phase: if self.running.is_some() { Phase::Moving } else { Phase::Holding }.code(),
            energised: 1,
            sigma: 1.0,
            speed_percent: 100.0,
            generation: self.generation,
            trajectory_id: self.running.as_ref().map_or(NO_ID, |motion| motion.id),
            trajectory_s: self.now_s(),
            trajectory_duration_s: self.running.as_ref().map_or(0.0, |motion| motion.trajectory.duration_s()),
            successor_id: self.waits.as_ref().map_or(0, |motion| motion.id),
            successor_from_s: self.waits.as_ref().map_or(0.0, |motion| motion.from_s),
            end_s: end.map_or(0.0, Trajectory::duration_s),
            end_rad: end.map_or(self.rest_rad, Trajectory::end_rad),
            command_rad: self.rest_rad,
            ..Report::default()
        }
    }

    pub(super) fn take(&mut self, checked: CheckedTrajectory) -> Outcome {
        if checked.generation != self.generation + 1 {
            let (got, newest) = (checked.generation, self.generation);
            return Outcome::Rejected(Rejection::StaleGeneration { got, newest });
        }
        let (id, trajectory) = (checked.trajectory_id, checked.trajectory);
        let outcome = match checked.replaces {
            Replaces::Rest => {
                assert!(self.running.is_none(), "from rest while the arm moves");
                (self.zero, self.running) =
                    (Some(Instant::now()), Some(Motion { id, trajectory, from_s: 0.0 }));
                Outcome::Accepted { from_s: 0.0, tick: 9 }
            }
            Replaces::Cut { at_s, .. } => {
                let by_s = self.now_s() - at_s;
                if by_s > 0.0 {
                    return Outcome::Rejected(Rejection::CutPassed { at_s, by_s });
                }
                self.waits = Some(Motion { id, trajectory, from_s: at_s });
                Outcome::Accepted { from_s: at_s, tick: 0 }
            }
        };
        self.generation += 1;
        outcome
    }
}

impl Played {
    pub(super) fn play(&self, arm: &str, robot: &Robot) {
        let wire = join(arm, "played-streamer");
        let reports = wire.report_publisher().expect("port");
        let receipts = wire.receipt_publisher().expect("port");
        let trajectories = wire.trajectory_subscriber().expect("port");
        let commands = wire.command_server().expect("port");
        self.state.lock().expect("no panic").rest_rad = pose(FROM);
        let mut sequence = 0;
        while !self.end.load(Ordering::SeqCst) {
            let mut state = self.state.lock().expect("no panic");
            state.step();
            sequence += 1;
            // Every 10 ms, and at once when something was accepted.
            let mut is_due = sequence % 10 == 0;
            while let Some(sample) = trajectories.receive().expect("received") {
                let checked =
                    CheckedTrajectory::try_from(&*Box::new(*sample.payload())).expect("a good message");
                let (id, generation) = (checked.trajectory_id, checked.generation);
                let outcome = state.take(checked);
                receipts.send_copy(Receipt::new(id, generation, &outcome)).expect("sent");
                is_due = true;
            }
            while let Some(request) = commands.receive().expect("received") {
                let command = Command::try_from(request.payload()).expect("a command");
                assert!(matches!(command, Command::Stop | Command::FastStop), "{command:?}");
                (state.running, state.waits, state.stops) = (None, None, state.stops + 1);
                request.send_copy(CommandReply::accepted(Phase::Stopping, "stopping")).expect("sent");
            }
            if is_due {
                reports.send_copy(state.report(robot, sequence)).expect("sent");
            }
            drop(state);
            thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Runs a service and a played streamer around a test.
pub(super) fn with_service(name: &str, scene: &Scene, played: &Played, test: impl FnOnce(&Asker)) {
    let (arm, robot) = (format!("test-{name}-{}", std::process::id()), ur5());
    let (stop, ready) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|s| {
        s.spawn(|| played.play(&arm, &robot));
        s.spawn(|| {
            let wire = join(&arm, "planner");
            let mut service = Service::open(&wire, &robot, scene, &stop).expect("opens");
            ready.store(true, Ordering::SeqCst);
            service.serve();
        });
        // Whatever the test does, the threads end: a panic is handed on after that.
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            let since = Instant::now();
            while !ready.load(Ordering::SeqCst) {
                assert!(since.elapsed() < Duration::from_secs(20), "the service did not open");
                thread::sleep(Duration::from_millis(5));
            }
            test(&Asker { wire: join(&arm, "client") });
        }));
        stop.store(true, Ordering::SeqCst);
        played.end.store(true, Ordering::SeqCst);
        if let Err(panic) = result {
            std::panic::resume_unwind(panic);
        }
    });
}

/// Who asks the planner.
pub(super) struct Asker {
    pub(super) wire: Wire,
}

impl Asker {
    pub(super) fn scene(&self, request: &CheckedSceneRequest) -> SceneOutcome {
        let client = self.wire.scene_client().expect("port");
        let pending = client.send_copy(SceneRequest::from(request)).expect("sent");
        let since = Instant::now();
        loop {
            if let Some(reply) = pending.receive().expect("received") {
                return SceneReply::outcome(reply.payload());
            }
            assert!(since.elapsed() < Duration::from_secs(20), "no answer");
            thread::sleep(Duration::from_millis(1));
        }
    }

    pub(super) fn cloud(&self, cloud: &CheckedCloud) -> SceneOutcome {
        let client = self.wire.cloud_client().expect("port");
        let pending = client.send_copy(*CloudRequest::new(cloud)).expect("sent");
        let since = Instant::now();
        loop {
            if let Some(reply) = pending.receive().expect("received") {
                return SceneReply::outcome(reply.payload());
            }
            assert!(since.elapsed() < Duration::from_secs(20), "no answer");
            thread::sleep(Duration::from_millis(1));
        }
    }

    pub(super) fn change(&self, changes: &[SceneChange]) -> (MotionEffect, String) {
        match self.scene(&CheckedSceneRequest::Change(changes.to_vec())) {
            SceneOutcome::Changed { effect, note, times_ns: [received, checked, acted], .. } => {
                assert!(received <= checked && checked <= acted);
                (effect, note)
            }
            outcome @ (SceneOutcome::Listed { .. } | SceneOutcome::Refused { .. }) => panic!("{outcome:?}"),
        }
    }

    pub(super) fn refused(&self, changes: &[SceneChange]) -> String {
        match self.scene(&CheckedSceneRequest::Change(changes.to_vec())) {
            SceneOutcome::Refused { reason } => reason,
            outcome @ (SceneOutcome::Listed { .. } | SceneOutcome::Changed { .. }) => panic!("{outcome:?}"),
        }
    }

    pub(super) fn objects(&self) -> Vec<ListedObject> {
        let mut all = Vec::new();
        loop {
            match self.scene(&CheckedSceneRequest::List { first: all.len() }) {
                SceneOutcome::Listed { total, first, objects, .. } => {
                    assert_eq!(first, all.len());
                    all.extend(objects);
                    if all.len() >= total {
                        return all;
                    }
                }
                outcome @ (SceneOutcome::Changed { .. } | SceneOutcome::Refused { .. }) => {
                    panic!("{outcome:?}")
                }
            }
        }
    }

    pub(super) fn go(&self, goal_rad: JointArray) -> PlanOutcome {
        let client = self.wire.plan_client().expect("port");
        let request = CheckedPlanRequest::to_pose(6, goal_rad);
        let pending = client.send_copy(PlanRequest::from(&request)).expect("sent");
        let since = Instant::now();
        loop {
            if let Some(reply) = pending.receive().expect("received") {
                return reply.payload().outcome();
            }
            assert!(since.elapsed() < Duration::from_secs(30), "no answer");
            thread::sleep(Duration::from_millis(1));
        }
    }
}

pub(super) fn at(position_m: [f64; 3]) -> ObjectPose {
    ObjectPose { position_m, quaternion_xyzw: [0.0, 0.0, 0.0, 1.0] }
}

pub(super) fn ball(name: &str, position_m: [f64; 3], radius_m: f64) -> SceneChange {
    SceneChange::Add {
        name: name.to_owned(),
        shape: ObjectShape::Sphere { radius_m },
        pose: at(position_m),
        fixed_to: FixedTo::Base,
        mass_kg: 0.0,
        replaces: false,
    }
}

/// Where the tip is on the way from [`FROM`] to [`TO`] when the base's joint stands at an angle.
pub(super) fn on_the_way(pan_rad: f64) -> [f64; 3] {
    let mut q = FROM;
    q[0] = pan_rad;
    *ur5_origins_m(&pose(q)).last().expect("a tip")
}

pub(super) fn empty() -> Scene {
    Scene { margin_m: 0.02, ..Scene::default() }
}

/// What was commanded after an instant keeps the margin from obstacles, by a check that knows nothing of the planner.
pub(super) fn assert_commanded_free(played: &Played, since: Instant, obstacles: Vec<Obstacle>) {
    let (robot, scene) = (ur5(), Scene { obstacles, ..empty() });
    let state = played.state.lock().expect("no panic");
    let poses: Vec<&JointArray> =
        state.commanded.iter().filter(|(when, _)| *when >= since).map(|(_, q)| q).collect();
    assert!(poses.len() > 100, "{} setpoints", poses.len());
    for q in poses {
        let (from_obstacles_m, _) = ur5_distances_m(&robot, &scene, q);
        assert!(from_obstacles_m > scene.margin_m - 1e-6, "{from_obstacles_m} m at {q:?}");
    }
}

pub(super) fn wait_until_rest(played: &Played) {
    let since = Instant::now();
    while played.state.lock().expect("no panic").running.is_some() {
        assert!(since.elapsed() < Duration::from_secs(20), "the arm moves on");
        thread::sleep(Duration::from_millis(10));
    }
}
