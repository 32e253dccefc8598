//! The shipped cycle, its CiA 402 driver and its local link under a counting allocator: no allocation, no free.
//!
//! The far end of the link is the simulator's drives, on the same thread and on simulated time, so that 60,000 cycles
//! with trajectories, pauses, stops and faults take seconds and always run the same. Only what `run_cycle` itself does
//! counts.
#![expect(unsafe_code, reason = "a global allocator is an unsafe trait")]
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "helpers of tests fail by panicking"
)]
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use taustream_arm::Settings;
use taustream_drivers::drivers;
use taustream_drivers::link::{self, LinkChoice, LinkRole};
use taustream_drivers::sim::{FaultOrder, Rig, settings::drives};
use taustream_drivers::{CanFrame, CanLink, FrameBatch, Nanos};
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces};
use taustream_motion::{JointArray, Stroke, Trajectory};
use taustream_streamer::buses::{Bus, Buses};
use taustream_streamer::cycle::{Core, NoProbe, Probe, Stage, run_cycle};
use taustream_streamer::facts::{Asked, Decision};
use taustream_streamer::intake::{self, Desk};
use taustream_streamer::names::Names;
use taustream_streamer::report::{Readers, Record};
use taustream_streamer::tick::Tick;

thread_local! {
    static COUNTS: Cell<bool> = const { Cell::new(false) };
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// Counts allocations and frees while this thread says so.
struct Counting;

impl Counting {
    fn note() {
        if COUNTS.with(Cell::get) {
            CALLS.with(|calls| calls.set(calls.get() + 1));
        }
    }
}

// SAFETY: every call goes on to the system's allocator unchanged; the counters are constant-initialised cells.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::note();
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        Self::note();
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const PERIOD_NS: u64 = 1_000_000;
const JOINTS: usize = 6;
const HOME_RAD: [f64; JOINTS] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0];

/// The streamer's cycle on one end of a local link, simulated drives on the other.
struct Arm {
    core: Core,
    desk: Desk,
    readers: Readers,
    rig: Rig,
    far_end: Box<dyn CanLink>,
    batch: FrameBatch,
    out: Vec<Vec<CanFrame>>,
    runtime: PathBuf,
    digest: [u8; 32],
    tick: u64,
    generation: u64,
    counted: u64,
    held_rad: JointArray,
    visited: Vec<Phase>,
}

impl Arm {
    /// An arm of shipped settings.
    fn new(name: &str, settings: &str) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(settings);
        let settings = Settings::load(&file).unwrap_or_else(|faults| panic!("{faults}"));
        let runtime = std::env::temp_dir().join(format!("taustream-{name}-{}", std::process::id()));
        let bus = &settings.buses[0];
        let far_end = link::open(bus, LinkChoice::Local, LinkRole::Servos, &runtime).unwrap();
        let near_end = link::open(bus, LinkChoice::Local, LinkRole::Master, &runtime).unwrap();
        let driver = drivers::of_bus(&settings, 0).unwrap();
        let (queues, desk) = intake::pair();
        let buses =
            Buses::new(vec![Bus::new(near_end, Box::new(driver), settings.supervision.lost_cycles_max)])
                .unwrap();
        let core = Core::new(&settings, buses, queues, true);
        let mut setups = drives(&settings, Some(&HOME_RAD)).unwrap_or_else(|faults| panic!("{faults}"));
        // A limp joint falls, and the streamer rightly refuses to enable it while it does.
        setups.iter_mut().for_each(|setup| setup.parameters.plant_mut().brake = true);
        Self {
            readers: core.readers(),
            core,
            desk,
            rig: Rig::new(setups, 1, 1),
            far_end,
            batch: FrameBatch::new(),
            out: vec![Vec::new()],
            runtime,
            digest: settings.robot.digest,
            tick: 0,
            generation: 0,
            counted: 0,
            held_rad: [0.0; 8],
            visited: Vec::new(),
        }
    }

    fn phase(&self) -> Phase {
        self.core.supervisor().phase()
    }

    /// One counted cycle, then the drives' turn.
    fn step<P: Probe>(&mut self, probe: &mut P) {
        self.tick += 1;
        let now = Nanos(self.tick * PERIOD_NS);
        let tick = Tick { number: self.tick, deadline: now, woke: now, skipped: 0, last_cycle_ns: 1 };
        COUNTS.with(|c| c.set(true));
        run_cycle(&mut self.core, tick, probe);
        COUNTS.with(|c| c.set(false));
        self.counted += 1;
        self.far_end.receive(&mut self.batch);
        self.rig.receive(now, 0, self.batch.frames(), &mut self.out);
        self.rig.advance(now, &mut self.out);
        for chunk in self.out[0].chunks(32) {
            self.far_end.send(chunk);
        }
        self.out[0].clear();
        self.rig.take_events();
        while let Some(record) = self.readers.records.pop() {
            match record {
                Record::Cycle(cycle) => self.held_rad = cycle.position_rad,
                Record::Transition(t) => self.visited.push(t.to),
                Record::Accepted { .. } | Record::Lost(_) => {}
            }
        }
        while self.readers.timings.pop().is_some() {}
        while self.readers.reports.pop().is_some() {}
        while self.readers.notes.pop().is_some() {}
    }

    fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.step(&mut NoProbe);
        }
    }

    fn run_until(&mut self, phase: Phase, cycles: u64) {
        for _ in 0..cycles {
            if self.phase() == phase {
                return;
            }
            self.step(&mut NoProbe);
        }
        let cause = self.core.supervisor().cause();
        panic!("{:?} instead of {phase:?} after {cycles} cycles, cause {cause:?}", self.phase());
    }

    fn ask(&mut self, command: Command) {
        assert!(self.desk.ask(Asked { sequence: self.tick, command }));
        self.step(&mut NoProbe);
        let answer = self.desk.answer().unwrap();
        assert!(answer.accepted, "{command:?}: {}", answer.why.sentence(&Names::default()));
    }

    fn fault(&mut self, spec: &str) {
        let order = FaultOrder::parse(spec, &self.rig.joints()).unwrap();
        self.rig.order(Nanos(self.tick * PERIOD_NS), order);
    }

    fn move_it(&mut self, size: f64) {
        // Towards the middle, so that motions that were cut short do not add up to the end of a range.
        let size = if self.held_rad[0] > 0.0 { -size } else { size };
        let stroke = |start_s: f64, sign: f64| Stroke {
            start_s,
            duration_s: 1.2,
            n: 6,
            delta_rad: [0.9, 0.2, -0.4, 0.3, 0.2, 0.5, 0.0, 0.0].map(|d| d * size * sign),
        };
        let strokes = [stroke(0.0, 1.0), stroke(0.8, -0.5), stroke(1.9, 0.5), stroke(2.6, -1.0)];
        let trajectory = Trajectory::new(JOINTS, self.held_rad, &strokes).unwrap();
        self.generation += 1;
        let generation = self.generation;
        let mut empty = self.desk.empty_box().expect("boxes go round");
        *empty = CheckedTrajectory {
            trajectory_id: generation,
            generation,
            robot_digest: self.digest,
            replaces: Replaces::Rest,
            trajectory,
        };
        self.desk.offer(empty);
        self.step(&mut NoProbe);
        let decision = self.desk.verdict().unwrap().decision;
        assert!(matches!(decision, Decision::Accepted { .. }), "{decision:?}");
    }

    fn enable(&mut self) {
        self.run_until(Phase::Disabled, 8_000);
        self.run(50);
        self.ask(Command::Enable);
        self.run_until(Phase::Holding, 3_000);
        self.run(1);
    }

    /// From fault back to holding, by the whole way down and up.
    fn recover(&mut self) {
        self.run_until(Phase::Fault, 3_000);
        self.rig.clear(None);
        self.run(100);
        self.ask(Command::Disable);
        self.run(500);
        self.ask(Command::ClearFault);
        self.run_until(Phase::Disabled, 8_000);
        self.run(400);
        self.enable();
    }
}

impl Drop for Arm {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.runtime);
    }
}

fn calls() -> u64 {
    CALLS.with(Cell::get)
}

/// Motions, stops and faults for so many cycles, each of them counted.
fn never_allocates(mut arm: Arm, cycles: u64) {
    arm.enable();
    let mut round = 0;
    while arm.counted < cycles {
        arm.move_it(1.0);
        arm.run(400);
        arm.ask(Command::Pause);
        arm.run_until(Phase::Paused, 1_500);
        arm.ask(Command::Speed { percent: 60.0 });
        arm.ask(Command::Resume);
        arm.run(200);
        arm.ask(Command::Speed { percent: 100.0 });
        arm.run_until(Phase::Holding, 8_000);
        arm.move_it(1.0);
        arm.run(700);
        arm.ask(Command::Stop);
        arm.run_until(Phase::Holding, 1_500);
        arm.run(100);
        arm.move_it(0.5);
        arm.run(500);
        let joint = round % JOINTS + 1;
        match round % 4 {
            0 => arm.fault(&format!("joint={joint},kind=silence")),
            1 => arm.fault(&format!("joint={joint},kind=fault")),
            2 => arm.fault(&format!("joint={joint},kind=jump,value=0.1")),
            _ => arm.ask(Command::FastStop),
        }
        arm.recover();
        round += 1;
    }
    assert_eq!(calls(), 0, "allocations and frees in {} cycles", arm.counted);
    for phase in [Phase::Moving, Phase::Paused, Phase::Stopping, Phase::FastStopping, Phase::Fault] {
        assert!(arm.visited.contains(&phase), "{phase:?} was never reached");
    }
    assert!(round >= 4, "only {round} rounds");
}

#[test]
fn cycle_over_sixty_thousand_runs_with_motions_stops_and_faults_never_allocates() {
    never_allocates(Arm::new("no-alloc", "vcan6.toml"), 60_000);
}

#[test]
fn cycle_with_damiao_motors_never_allocates() {
    never_allocates(Arm::new("no-alloc-damiao", "damiao6.toml"), 40_000);
}

/// Allocates once, in a stage of the shipped cycle.
struct Planted;

impl Probe for Planted {
    fn ended(&mut self, stage: Stage) {
        if stage == Stage::Guard {
            std::hint::black_box(Box::new(1_u64));
        }
    }
}

#[test]
fn planted_allocation_in_the_cycle_is_counted() {
    let mut arm = Arm::new("planted", "vcan6.toml");
    arm.run(10);
    assert_eq!(calls(), 0);
    arm.step(&mut Planted);
    assert_eq!(calls(), 2, "one allocation and its free");
}
