//! The shipped cycle, its CiA 402 drivers and local links on one side, simulated drives on the other: one thread, on
//! simulated time, so that tens of thousands of cycles take seconds and always run the same.
use std::path::{Path, PathBuf};
use taustream_arm::Settings;
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::protocols;
use taustream_drivers::sim::settings::{drives, queue_frames};
use taustream_drivers::sim::{LinkedSimulator, ServoSimulator};
use taustream_drivers::{CanFrame, CanLink, FrameBatch, Nanos};
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces};
use taustream_motion::{JointLimits, MAX_JOINTS, Stroke, Trajectory};
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, NoProbe, Probe, run_cycle};
use taustream_streamer::cycle_state::Decision;
use taustream_streamer::intake::{self, CommandQueue};
use taustream_streamer::names::Names;
use taustream_streamer::prepared::PreparedTrajectory;
use taustream_streamer::report::{self, CycleRecord, Readers, Record};
use taustream_streamer::tick::Tick;

pub(crate) const JOINTS: usize = 6;
const HOME_RAD: [f64; JOINTS] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];
/// How far a motion goes, from joint to joint; arms of more joints repeat it.
const DELTA_RAD: [f64; JOINTS] = [0.9, 0.2, -0.4, 0.3, 0.2, 0.5];

/// Shipped settings, with the text of the file changed before it is read.
pub(crate) fn shipped(file: &str, edit: impl Fn(&str) -> String) -> Settings {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(file);
    let text = std::fs::read_to_string(&path).unwrap();
    Settings::from_toml(&path, &edit(&text)).unwrap_or_else(|faults| panic!("{faults}"))
}

/// The streamer's cycle on one end of its links, simulated drives on the other.
pub(crate) struct Arm {
    pub(crate) core: Core,
    pub(crate) command_queue: CommandQueue,
    pub(crate) readers: Readers,
    pub(crate) simulator: LinkedSimulator,
    /// The drives' ends; `None` for a bus that was pulled out.
    pub(crate) far_ends: Vec<Option<Box<dyn CanLink>>>,
    /// What the streamer sent in the last cycle, by bus.
    pub(crate) sent: Vec<Vec<CanFrame>>,
    /// Runs a cycle, and says how often it called the allocator, where that is counted.
    pub(crate) around: fn(&mut dyn FnMut()) -> usize,
    /// The sum of it.
    pub(crate) calls: usize,
    pub(crate) settings: Settings,
    batch: FrameBatch,
    out: Vec<Vec<CanFrame>>,
    pub(crate) runtime: PathBuf,
    pub(crate) digest: [u8; 32],
    limits: [JointLimits; MAX_JOINTS],
    pub(crate) tick: u64,
    generation: u64,
    pub(crate) counted: u64,
    /// What the newest cycle sent.
    pub(crate) newest: Option<CycleRecord>,
    pub(crate) visited: Vec<Phase>,
}

impl Arm {
    /// `settings` under a runtime directory of its own. Limp joints have brakes: a limp joint falls, and the streamer
    /// rightly refuses to enable it while it does.
    pub(crate) fn new(name: &str, settings: Settings) -> Self {
        let runtime = std::env::temp_dir().join(format!("taustream-{name}-{}", std::process::id()));
        let (mut far_ends, mut buses) = (Vec::new(), Vec::new());
        for (index, bus) in settings.buses.iter().enumerate() {
            far_ends.push(Some(link::open(bus, LinkChoice::Local, LinkRole::Servos, &runtime).unwrap()));
            let near_end = link::open(bus, LinkChoice::Local, LinkRole::Master, &runtime).unwrap();
            let driver = protocols::of_bus(&settings, index).unwrap();
            buses.push(Bus::new(near_end, Box::new(driver), &settings));
        }
        let (queues, command_queue) = intake::pair();
        let (reports, readers) = report::queues(true);
        let core = Core::new(&settings, Buses::new(buses).unwrap(), queues, reports);
        let home_rad = (settings.robot.name == "ur5").then_some(HOME_RAD.as_slice());
        let mut setups = drives(&settings, home_rad).unwrap_or_else(|faults| panic!("{faults}"));
        setups.iter_mut().for_each(|setup| setup.parameters.plant_mut().brake = true);
        let count = settings.buses.len();
        let queue_frames = queue_frames(&settings).unwrap_or_else(|faults| panic!("{faults}"));
        Self {
            readers,
            core,
            command_queue,
            simulator: LinkedSimulator::new(
                ServoSimulator::new(setups, count, 1),
                &settings.buses,
                queue_frames,
            ),
            far_ends,
            sent: vec![Vec::new(); count],
            around: |cycle| {
                cycle();
                0
            },
            calls: 0,
            batch: FrameBatch::new(),
            out: vec![Vec::new(); count],
            runtime,
            digest: settings.robot.message_digest,
            limits: settings.robot.limits(),
            settings,
            tick: 0,
            generation: 0,
            counted: 0,
            newest: None,
            visited: Vec::new(),
        }
    }

    pub(crate) fn now(&self) -> Nanos {
        Nanos(self.tick * u64::from(self.settings.cycle.period_us) * 1_000)
    }

    pub(crate) fn phase(&self) -> Phase {
        self.core.supervisor().phase()
    }

    /// One counted cycle, then the drives' turn.
    pub(crate) fn step<P: Probe>(&mut self, probe: &mut P) {
        self.tick += 1;
        let now = self.now();
        let tick = Tick { number: self.tick, deadline: now, wake_time: now, skipped: 0, last_cycle_ns: 1 };
        let core = &mut self.core;
        self.calls += (self.around)(&mut || {
            run_cycle(core, tick, probe);
        });
        self.counted += 1;
        for (bus, far_end) in self.far_ends.iter_mut().enumerate() {
            self.sent[bus].clear();
            let Some(far_end) = far_end else { continue };
            far_end.receive(&mut self.batch);
            self.sent[bus].extend_from_slice(self.batch.frames());
            self.simulator.receive(now, bus, self.batch.frames(), &mut self.out);
        }
        self.simulator.advance(now, &mut self.out);
        for (far_end, out) in self.far_ends.iter_mut().zip(&mut self.out) {
            if let Some(far_end) = far_end {
                for chunk in out.chunks(32) {
                    far_end.send(chunk);
                }
            }
            out.clear();
        }
        self.simulator.simulator.take_events();
        while let Some(record) = self.readers.records.as_mut().and_then(|records| records.pop().ok()) {
            match record {
                Record::CycleSettings(cycle) => self.newest = Some(cycle),
                Record::Transition(t) => self.visited.push(t.to),
                Record::Accepted { .. } | Record::Lost(_) => {}
            }
        }
        while self.readers.timings.pop().is_ok() {}
        while self.readers.reports.pop().is_ok() {}
        while self.readers.notes.pop().is_ok() {}
    }

    pub(crate) fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.step(&mut NoProbe);
        }
    }

    pub(crate) fn run_until(&mut self, phase: Phase, cycles: u64) {
        for _ in 0..cycles {
            if self.phase() == phase {
                return;
            }
            self.step(&mut NoProbe);
        }
        let cause = self.core.supervisor().cause();
        panic!("{:?} instead of {phase:?} after {cycles} cycles, cause {cause:?}", self.phase());
    }

    pub(crate) fn ask(&mut self, command: Command) {
        self.try_ask(command).unwrap_or_else(|why| panic!("{command:?}: {why}"));
    }

    /// Gives a command; why it was refused.
    pub(crate) fn try_ask(&mut self, command: Command) -> Result<(), String> {
        assert!(self.command_queue.commands.ask(command, Nanos(u64::MAX)).is_some());
        self.step(&mut NoProbe);
        let answer = self.command_queue.commands.answer().unwrap();
        if answer.accepted { Ok(()) } else { Err(answer.why.sentence(&Names::default())) }
    }

    pub(crate) fn move_it(&mut self, size: f64) -> Trajectory {
        // Towards the middle, so that motions that were cut short do not add up to the end of a range.
        let mut hold_position_rad = self.newest.map_or([0.0; MAX_JOINTS], |cycle| cycle.position_rad);
        // Behind the joints stand axes that are no joints of the path.
        let joints = self.settings.robot.joints.len();
        hold_position_rad[joints..].fill(0.0);
        let size = if hold_position_rad[0] > 0.0 { -size } else { size };
        let stroke = |start_s: f64, sign: f64| Stroke {
            start_s,
            duration_s: 1.2,
            n: 6,
            delta_rad: std::array::from_fn(|joint| {
                if joint < joints { DELTA_RAD[joint % DELTA_RAD.len()] * size * sign } else { 0.0 }
            }),
        };
        let strokes = [stroke(0.0, 1.0), stroke(0.8, -0.5), stroke(1.9, 0.5), stroke(2.6, -1.0)];
        let trajectory = Trajectory::new(joints, hold_position_rad, &strokes).unwrap();
        let decision = self.offer(&trajectory, Replaces::Rest);
        assert!(matches!(decision, Decision::Accepted { .. }), "{decision:?}");
        trajectory
    }

    /// Offers a trajectory whose id is its generation, runs one cycle, and returns the decision.
    pub(crate) fn offer(&mut self, trajectory: &Trajectory, replaces: Replaces) -> Decision {
        self.generation += 1;
        let generation = self.generation;
        let mut empty = self.command_queue.trajectories.empty_box().expect("boxes go round");
        let checked = CheckedTrajectory {
            trajectory_id: generation,
            generation,
            robot_digest: self.digest,
            replaces,
            trajectory: trajectory.clone(),
        };
        *empty = PreparedTrajectory::new(checked, &self.limits);
        self.command_queue.trajectories.offer(empty);
        self.step(&mut NoProbe);
        self.command_queue.trajectories.trajectory_result().unwrap().decision
    }

    pub(crate) fn enable(&mut self) {
        self.run_until(Phase::Disabled, 8_000);
        self.run(50);
        self.ask(Command::Enable);
        self.run_until(Phase::Holding, 3_000);
        self.run(1);
    }
}

impl Drop for Arm {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.runtime);
    }
}
