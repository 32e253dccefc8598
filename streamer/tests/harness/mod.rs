//! A streamer without threads, clocks or buses: the shipped cycle over scripted drives, tick by tick.
mod drives;

pub use drives::World;
use drives::{FakeDriver, FakeLink, Shared};
use std::path::Path;
use std::sync::{Arc, Mutex};
use taustream_arm::Settings;
use taustream_drivers::Nanos;
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces, Report};
use taustream_motion::{JointArray, Stroke, Trajectory, joint_array};
use taustream_streamer::answer::CommandAnswer;
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, Next, NoProbe, run_cycle};
use taustream_streamer::cycle_state::{Cause, Decision, TrajectoryResult};
use taustream_streamer::intake::{self, CommandQueue, Shutdown};
use taustream_streamer::names::Names;
use taustream_streamer::pose_store::PoseRecords;
use taustream_streamer::prepared::PreparedTrajectory;
use taustream_streamer::report::{self, CycleRecord, Note, Readers, Record};
use taustream_streamer::tick::Tick;
use taustream_streamer::write_ahead::Requester;

pub const PERIOD_NS: u64 = 1_000_000;
pub const JOINTS: usize = 6;
/// Where the scripted arm stands at first.
pub const HOME_RAD: JointArray = joint_array([0.0, -1.57, 1.57, -1.57, -1.57, 0.0]);

/// The streamer's cycle with its scripted surroundings.
pub struct CycleHarness {
    pub core: Core,
    pub command_queue: CommandQueue,
    pub world: Shared,
    pub settings: Settings,
    pub readers: Readers,
    pub tick: u64,
    pub cycles: Vec<CycleRecord>,
    pub phases: Vec<(Phase, Phase)>,
    /// The newest report.
    pub report: Option<Report>,
    /// Notes of error frames.
    pub error_notes: u32,
    /// Joint, code and count of each note of emergency messages.
    pub emergencies: Vec<(usize, u32, u32)>,
    /// Keeps the last pose, on this thread.
    pub store: Option<PoseRecords>,
    /// The store looks for a request every so many ticks.
    pub store_every: u64,
    generation: u64,
    last: Next,
}

/// The shipped settings of six servos, with the limits that the tests count cycles by: those are no file's choice.
pub fn shipped_settings() -> Settings {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/vcan6.toml");
    let mut settings = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
    settings.cycle.tolerated_gap_periods = 2;
    settings.cycle.stall_resume_ms = 20;
    settings.cycle.drive_watchdog_ms = 100;
    settings.supervision.feedback_age_s_max = 0.02;
    settings.supervision.tracking_error_rad_max = 0.2;
    settings.supervision.position_jump_rad_max = 0.05;
    settings.supervision.lost_cycles_max = 3;
    settings.supervision.drive_timeout_s = 5.0;
    settings
}

impl CycleHarness {
    pub fn new() -> Self {
        Self::with(shipped_settings())
    }

    pub fn with(settings: Settings) -> Self {
        let world = World::new();
        let world = Arc::new(Mutex::new(world));
        let driver = FakeDriver::new(&world);
        let bus = Bus::new(Box::new(FakeLink(Arc::clone(&world))), Box::new(driver), &settings);
        let (queues, command_queue) = intake::pair();
        let (reports, readers) = report::queues(true);
        let buses = Buses::new(vec![bus]).unwrap();
        let core = Core::new(&settings, buses, queues, reports);
        Self {
            core,
            command_queue,
            world,
            settings,
            readers,
            tick: 0,
            cycles: Vec::new(),
            phases: Vec::new(),
            report: None,
            error_notes: 0,
            emergencies: Vec::new(),
            store: None,
            store_every: 1,
            generation: 0,
            last: Next::Go,
        }
    }

    /// Runs one cycle `periods` after the one before.
    pub fn step_after(&mut self, periods: u64) -> Next {
        self.tick += periods;
        self.world.lock().unwrap().tick = self.tick;
        let time = Nanos(self.tick * PERIOD_NS);
        let tick = Tick {
            number: self.tick,
            deadline: time,
            wake_time: time,
            skipped: periods - 1,
            last_cycle_ns: 1,
        };
        self.last = run_cycle(&mut self.core, tick, &mut NoProbe);
        while let Some(record) = self.readers.records.as_mut().and_then(|records| records.pop().ok()) {
            match record {
                Record::CycleSettings(cycle) => self.cycles.push(cycle),
                Record::Transition(t) => self.phases.push((t.from, t.to)),
                Record::Accepted { .. } => {}
                Record::Lost(n) => panic!("{n} records lost"),
            }
        }
        while self.readers.timings.pop().is_ok() {}
        while let Ok(report) = self.readers.reports.pop() {
            if let Some(store) = &mut self.store {
                store.note(&report);
            }
            self.report = Some(report);
        }
        if let Some(store) = self.store.as_mut().filter(|_| self.tick.is_multiple_of(self.store_every)) {
            store.serve();
        }
        while let Ok(note) = self.readers.notes.pop() {
            self.error_notes += u32::from(matches!(note, Note::BusError { .. }));
            if let Note::Emergency { joint, code, count } = note {
                self.emergencies.push((joint, code, count));
            }
        }
        self.last
    }

    pub fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.step_after(1);
        }
    }

    /// Runs until a phase is reached; fails after `ticks`.
    pub fn run_until(&mut self, phase: Phase, ticks: u64) {
        for _ in 0..ticks {
            if self.phase() == phase {
                return;
            }
            self.step_after(1);
        }
        panic!("{:?} instead of {phase:?} after {ticks} ticks, cause {:?}", self.phase(), self.cause());
    }

    pub fn phase(&self) -> Phase {
        self.core.supervisor().phase()
    }

    pub fn cause(&self) -> Option<Cause> {
        self.core.supervisor().cause()
    }

    /// Changes the script.
    pub fn script(&self, change: impl FnOnce(&mut World)) {
        change(&mut self.world.lock().unwrap());
    }

    /// Asks, runs one cycle, and returns the answer.
    pub fn ask(&mut self, command: Command) -> CommandAnswer {
        self.ask_until(command, Nanos(u64::MAX))
    }

    /// The same, for a sender that gives up at an instant.
    pub fn ask_until(&mut self, command: Command, valid_until: Nanos) -> CommandAnswer {
        let sequence = self.command_queue.commands.ask(command, valid_until).expect("room for a command");
        self.step_after(1);
        let answer = self.command_queue.commands.answer().expect("every command is answered in its cycle");
        assert_eq!(answer.sequence, sequence);
        answer
    }

    /// Takes what `store` knows, and keeps the last pose in it from now on.
    pub fn keep(&mut self, mut store: PoseRecords, requester: Requester) {
        self.core.restore_poses(&store.restore_poses());
        self.core.record_first(requester);
        self.store = Some(store);
    }

    /// Asks, and runs until there is an answer.
    pub fn ask_and_wait(&mut self, command: Command) -> CommandAnswer {
        let mut answer = self.queue_request(command);
        for _ in 0..3_000 {
            if let Some(answer) = answer {
                return answer;
            }
            self.step_after(1);
            answer = self.command_queue.commands.answer();
        }
        panic!("no answer to {command:?}");
    }

    /// Asks what cannot be answered in the same cycle, and runs it.
    pub fn queue_request(&mut self, command: Command) -> Option<CommandAnswer> {
        self.command_queue.commands.ask(command, Nanos(u64::MAX)).expect("room for a command");
        self.step_after(1);
        self.command_queue.commands.answer()
    }

    /// Runs one cycle that must answer.
    pub fn step_to_answer(&mut self) -> CommandAnswer {
        self.step_after(1);
        self.command_queue.commands.answer().expect("an answer that was waited for")
    }

    /// The service thread's part: starts the links that were handed out over. True when all are there again.
    pub fn restore_buses(&mut self) -> bool {
        let mut handover =
            self.command_queue.trajectories.failed_links().expect("links of failed buses are handed out");
        let mut links = handover.links.iter_mut().flatten();
        handover.recovered = links.all(|link| link.reopen().is_ok());
        let recovered = handover.recovered;
        self.command_queue.trajectories.return_links(handover);
        recovered
    }

    pub fn accept(&mut self, command: Command) {
        let answer = self.ask(command);
        assert!(answer.accepted, "{command:?}: {}", answer.why.sentence(&Names::default()));
    }

    /// Offers a trajectory, runs one cycle, and returns the decision.
    pub fn offer(&mut self, trajectory: Trajectory) -> Decision {
        self.offer_checked(self.prepared(trajectory, Replaces::Rest))
    }

    pub fn offer_as(&mut self, trajectory: Trajectory, generation: u64) -> Decision {
        self.hand_over(self.prepared(trajectory, Replaces::Rest), generation)
    }

    /// Offers a replacement of a trajectory, cut at its trajectory time.
    pub fn offer_cut(&mut self, trajectory: Trajectory, (trajectory_id, at_s): (u64, f64)) -> Decision {
        self.offer_checked(self.prepared(trajectory, Replaces::Cut { trajectory_id, at_s }))
    }

    pub fn offer_cut_as(
        &mut self,
        trajectory: Trajectory,
        (trajectory_id, at_s): (u64, f64),
        generation: u64,
    ) -> Decision {
        self.hand_over(self.prepared(trajectory, Replaces::Cut { trajectory_id, at_s }), generation)
    }

    /// Offers what the intake has checked, as the newest trajectory.
    pub fn offer_checked(&mut self, checked: PreparedTrajectory) -> Decision {
        self.generation += 1;
        self.hand_over(checked, self.generation)
    }

    /// The id of the newest trajectory that was offered.
    pub fn newest_id(&self) -> u64 {
        1000 + self.generation
    }

    /// Id and cut of the trajectory that waits, as the newest report states them after a cycle.
    pub fn core_waiting(&mut self) -> Option<(u64, f64)> {
        self.run(12);
        let report = self.report.unwrap();
        (report.successor_id != 0).then_some((report.successor_id, report.successor_from_s))
    }

    fn prepared(&self, trajectory: Trajectory, replaces: Replaces) -> PreparedTrajectory {
        let checked = CheckedTrajectory {
            trajectory_id: 0,
            generation: 0,
            robot_digest: self.settings.robot.message_digest,
            replaces,
            trajectory,
        };
        PreparedTrajectory::new(checked, &self.settings.robot.limits())
    }

    fn hand_over(&mut self, mut checked: PreparedTrajectory, generation: u64) -> Decision {
        checked.rename(1000 + generation, generation);
        let mut empty = self.command_queue.trajectories.empty_box().expect("boxes go round");
        *empty = checked;
        self.command_queue.trajectories.offer(empty);
        self.step_after(1);
        let TrajectoryResult { decision, .. } = self
            .command_queue
            .trajectories
            .trajectory_result()
            .expect("every trajectory is answered in its cycle");
        decision
    }

    /// From start to holding.
    pub fn enable(&mut self) {
        self.run_until(Phase::Disabled, 60);
        self.run(40);
        self.accept(Command::Enable);
        self.run_until(Phase::Holding, 50);
    }

    /// From start into a motion.
    pub fn move_it(&mut self) -> Trajectory {
        self.enable();
        let trajectory = swing(&HOME_RAD, 1.0);
        assert!(matches!(self.offer(trajectory.clone()), Decision::Accepted { .. }));
        assert_eq!(self.phase(), Phase::Moving);
        trajectory
    }

    pub fn shutdown(&mut self, shutdown: Shutdown) {
        self.command_queue.shutdown_handle().request(shutdown);
    }

    /// The largest |velocity|, |acceleration| and |jerk| over their stop limits, by plain differences of what arrived.
    /// Independent of the guard: uniform steps only, and every gap is reported as a failure.
    pub fn worst_use_of_stop_limits(&self) -> [f64; 3] {
        let world = self.world.lock().unwrap();
        let limits = self.settings.robot.limits();
        let dt = 1e-3;
        let mut worst = [0.0_f64; 3];
        for window in world.arrived.windows(4) {
            assert!(window.windows(2).all(|w| w[1].0 == w[0].0 + 1), "a gap at tick {}", window[0].0);
            for joint in 0..JOINTS {
                let q: Vec<f64> = window.iter().map(|(_, p)| p[joint]).collect();
                let values = [
                    (q[3] - q[2]) / dt,
                    (q[3] - 2.0 * q[2] + q[1]) / (dt * dt),
                    (q[3] - 3.0 * q[2] + 3.0 * q[1] - q[0]) / (dt * dt * dt),
                ];
                let stop = limits[joint].stop;
                let most = [stop.velocity_rad_s, stop.acceleration_rad_s2, stop.jerk_rad_s3];
                for (w, (value, limit)) in worst.iter_mut().zip(values.iter().zip(most)) {
                    *w = w.max(value.abs() / limit);
                }
            }
        }
        assert!(world.arrived.len() > 100, "nothing was looked at");
        worst
    }
}

/// Three overlapping strokes to and fro, `size` rad for the first joint; close to the motion limits at 1.
pub fn swing(base_rad: &JointArray, size: f64) -> Trajectory {
    let stroke = |start_s: f64, sign: f64| Stroke {
        start_s,
        duration_s: 1.05,
        n: 6,
        delta_rad: joint_array([1.0, 0.3, -0.5, 0.4, -0.2, 0.6]).map(|d| d * size * sign),
    };
    Trajectory::new(JOINTS, *base_rad, &[stroke(0.0, 1.0), stroke(0.7, -0.8), stroke(1.65, 0.7)]).unwrap()
}
