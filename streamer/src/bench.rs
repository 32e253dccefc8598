//! What the streamer's cycle costs, beside the barest loop that could do the same on the same machine.
//!
//! Ratios, each from one run in alternating slices, so that both sides meet the same machine:
//!
//! - *lateness*: wake-ups of the streamer's loop against wake-ups of a bare `clock_nanosleep` loop on the same grid;
//! - *cycle*: time from wake-up to the end of the shipped `run_cycle`, with its link, against the time that the same
//!   system calls with the same frames take in a bare loop (clock, send, receive until empty, clock);
//! - *sixteen*: the cycle of the same arm with 16 joints on 4 buses against its own, on a link without system calls.
//!
//! No servos are needed: the driver writes the frames of the configured drives (SYNC and one setpoint each), calls them
//! energised, and reports the commanded pose as measured. The arm swings along a trajectory all the time, so sampling,
//! guard, encoding and supervision do their full work; decoding of answers is not in the figures, since nothing answers.
mod compare;
mod peers;
mod stages;
mod wake;
mod wide;

use crate::buses::{Bus, Buses};
use crate::cycle::{Core, Next, NoProbe, Probe, run_cycle};
use crate::intake::{self, CommandQueue};
use crate::prepared::PreparedTrajectory;
use crate::report::{self, Readers};
use crate::rt;
use crate::tick::Schedule;
pub use compare::{Compared, compare};
use hdrhistogram::Histogram;
use peers::Peers;
use serde::Serialize;
use stages::StageClock;
pub use stages::StageTime;
use taustream_arm::{Servo, Settings};
use taustream_drivers::codec::canopen::sync;
use taustream_drivers::codec::cia402::{CountScale, counts_from_rad, encode_rpdo};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::codec::setpoint_frames::{Group, SendSchedule, encode_pair, groups};
use taustream_drivers::link::LinkChoice;
use taustream_drivers::{
    CanFrame, CanId, DriveState, DriveTarget, FrameBatch, JointCommand, Nanos, ServoDriver, ServoStatus,
};
use taustream_messages::{CheckedTrajectory, Command, Phase, Replaces};
use taustream_motion::{JointArray, MAX_JOINTS, Stroke, Trajectory};
pub use wake::{Bin, WakeUps, wake_ups};

/// Cycles at the start of each slice that do not count: caches fill, and a slice begins at a new grid.
const WARM_UP: u64 = 20;
/// Slices in which stages are timed, streamer and bare alternately.
const STAGE_SLICES: u64 = 4;
/// Shortest measurement, s.
const SECONDS_MIN: f64 = 0.1;
/// Time of each side of the comparison with sixteen joints, in that of the measurement.
const WIDE_SHARE: f64 = 0.25;
/// Cycles within which the arm must be ready.
const READY_MAX: u64 = 2_000;

/// What to measure.
#[derive(Clone, Debug)]
pub struct BenchOptions {
    /// The arm.
    pub settings: Settings,
    /// How long all slices take together, s.
    pub seconds: f64,
    /// How many slices, bare and streamer alternately.
    pub slices: u32,
    /// The link of the cycle; [`None`]: a link that drops everything, without system calls.
    pub link: Option<LinkChoice>,
    /// Continue without real-time rights.
    pub allow_non_realtime: bool,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The options make no sense.
    #[error("bench of {seconds} s in {slices} slices; give at least 0.1 s and 2 slices")]
    Options {
        /// The seconds asked for.
        seconds: f64,
        /// The slices asked for.
        slices: u32,
    },
    /// A link cannot be opened.
    #[error("{0}")]
    Link(String),
    /// Rights are missing.
    #[error("{0}")]
    Rights(String),
    /// The bench's own arm did not get ready.
    #[error("the bench's arm is {0} instead of moving")]
    NotMoving(&'static str),
    /// A histogram or thread could not be made.
    #[error("{0}")]
    System(String),
}

/// Quantiles of times, ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Quantiles {
    /// How many.
    pub count: u64,
    /// Median.
    pub p50_ns: u64,
    /// 99 %.
    pub p99_ns: u64,
    /// 99.9 %.
    pub p999_ns: u64,
    /// The largest.
    pub max_ns: u64,
}

/// What was measured.
#[derive(Clone, Debug, Serialize)]
pub struct CycleBench {
    /// What carried the frames.
    pub link: String,
    /// Joints of the arm.
    pub joints: usize,
    /// Period, us.
    pub period_us: u32,
    /// Ran at real-time priority with locked memory.
    pub realtime: bool,
    /// Wake-up lateness of the streamer's loop.
    pub streamer_lateness: Quantiles,
    /// Wake-up lateness of the bare loop.
    pub bare_lateness: Quantiles,
    /// Time of the streamer's whole cycle.
    pub streamer_cycle: Quantiles,
    /// Time of the same system calls with the same frames.
    pub bare_cycle: Quantiles,
    /// p99 lateness, streamer over bare.
    pub lateness_p99_ratio: f64,
    /// Median cycle time, streamer over bare.
    pub cycle_p50_ratio: f64,
    /// 99 % cycle time, streamer over bare.
    pub cycle_p99_ratio: f64,
    /// Median cycle time of 16 joints on 4 buses over that of this arm, both on a link without system calls.
    pub sixteen_p50_ratio: f64,
    /// Deadlines skipped by either loop.
    pub skipped: u64,
    /// What one clock read takes; every stage's times include one.
    pub clock_read: Quantiles,
    /// Time of every stage, measured apart: the clock reads in between cost time themselves.
    pub stages: Vec<StageTime>,
}

/// Measures the cycle on a thread of its own, which gets the priority that the streamer's would have.
///
/// # Errors
/// When a link or a right is missing, or the options make no sense.
pub fn cycle(options: &BenchOptions) -> Result<CycleBench, BenchError> {
    let (seconds, slices) = (options.seconds, options.slices);
    if !(SECONDS_MIN..=3_600.0).contains(&seconds) || !(2..=10_000).contains(&slices) {
        return Err(BenchError::Options { seconds, slices });
    }
    let own = options.clone();
    let cycle = on_the_real_time_thread(own.settings.cycle, own.allow_non_realtime, move |realtime| {
        Bench::prepare(&own)?.measure(&own, realtime)
    })?;
    let sixteen = compare(
        &BenchOptions { link: None, seconds: (seconds * WIDE_SHARE).max(SECONDS_MIN), ..options.clone() },
        &[wide::widened(&options.settings)],
    )?;
    let sixteen_p50_ratio = sixteen.last().map_or(f64::NAN, |wide| wide.p50_ratio);
    Ok(CycleBench { sixteen_p50_ratio, ..cycle })
}

/// Does `work` on a thread of its own with the priority that the streamer's would have; tells it whether it has it.
fn on_the_real_time_thread<T: Send + 'static>(
    cycle: taustream_arm::settings::CycleSettings,
    allow_non_realtime: bool,
    work: impl FnOnce(bool) -> Result<T, BenchError> + Send + 'static,
) -> Result<T, BenchError> {
    let work = move || {
        let mut missing = Vec::new();
        missing.extend(rt::lock_memory().err());
        missing.extend(rt::enter(cycle.priority, cycle.cpu).err().into_iter().flatten());
        if !missing.is_empty() && !allow_non_realtime {
            let list: Vec<String> = missing.iter().map(ToString::to_string).collect();
            return Err(BenchError::Rights(list.join("; ")));
        }
        work(missing.is_empty())
    };
    let thread = std::thread::Builder::new()
        .name("bench".into())
        .stack_size(2 << 20)
        .spawn(work)
        .map_err(|e| BenchError::System(e.to_string()))?;
    #[expect(clippy::disallowed_methods, reason = "a measurement ends by itself, and no arm is there")]
    let measured = thread.join().map_err(|_| BenchError::System("the bench has panicked".into()));
    measured?
}

/// Writes the frames of energised servos, and believes them to follow at once.
struct BenchDriver {
    servos: Vec<Servo>,
    groups: Vec<Group>,
    send_schedule: SendSchedule,
    joints: Vec<usize>,
    commands: [JointCommand; MAX_JOINTS],
    drive_target: DriveTarget,
    now: Nanos,
}

impl ServoDriver for BenchDriver {
    fn encode(
        &mut self,
        now: Nanos,
        drive_target: DriveTarget,
        commands: &[JointCommand; MAX_JOINTS],
        out: &mut FrameBatch,
    ) {
        (self.commands, self.drive_target, self.now) = (*commands, drive_target, now);
        if self.servos.iter().any(|servo| CountScale::of(servo).is_some()) {
            out.push(sync());
        }
        let command = |servo: &Servo| commands.get(servo.joint).copied().unwrap_or_default();
        let counts =
            |servo: &Servo| Some(counts_from_rad(&CountScale::of(servo)?, command(servo).position_rad));
        for (number, group) in self.groups.iter().enumerate() {
            let frame = match *group {
                _ if !self.send_schedule.is_due(number) => None,
                Group::One(at) => self.servos.get(at).map(|servo| setpoint(servo, &command(servo))),
                Group::Pair([first, second]) => {
                    let pair = self.servos.get(first).zip(self.servos.get(second));
                    pair.and_then(|(a, b)| Some(encode_pair(a.node_id, [counts(a)?, counts(b)?])))
                }
            };
            frame.into_iter().for_each(|frame| {
                out.push(frame);
            });
        }
        self.send_schedule.advance();
    }
    fn decode(&mut self, _now: Nanos, _frame: &CanFrame) {}
    fn joints(&self) -> &[usize] {
        &self.joints
    }
    fn status(&self, joint: usize) -> ServoStatus {
        let enabled = self.drive_target == DriveTarget::Enabled;
        ServoStatus {
            state: if enabled { DriveState::Enabled } else { DriveState::Disabled },
            position_rad: self.commands.get(joint).map_or(f64::NAN, |c| c.position_rad),
            received: Some(self.now),
            ..ServoStatus::UNKNOWN
        }
    }
    fn clear_faults(&mut self) {}
    fn start_over(&mut self) {}
    fn explain(&self, error_code: u32) -> String {
        format!("{error_code:#06x}")
    }
}

/// The frame of an energised servo's setpoint: counts of a CiA 402 drive, a packed command of every other servo.
fn setpoint(servo: &Servo, command: &JointCommand) -> CanFrame {
    if let Some(scale) = CountScale::of(servo) {
        return encode_rpdo(servo.node_id, 0x000F, counts_from_rad(&scale, command.position_rad));
    }
    let packed = MitCommand {
        position_rad: (command.position_rad - servo.zero_offset_rad) * servo.sign,
        velocity_rad_s: command.velocity_rad_s * servo.sign,
        stiffness_nm_rad: 100.0,
        damping_nm_s_rad: 1.0,
        torque_nm: command.torque_nm * servo.sign,
    };
    let bytes = packed.encode(&MitRanges::symmetric(12.5, 30.0, 10.0)).unwrap_or_default();
    CanFrame::classic(CanId::standard(u16::from(servo.node_id)), &bytes)
}

/// One side's times.
struct Times {
    lateness: Histogram<u64>,
    cycle: Histogram<u64>,
}

impl Times {
    fn new() -> Result<Self, BenchError> {
        Ok(Self { lateness: histogram()?, cycle: histogram()? })
    }

    fn take(&mut self, cycle: u64, lateness_ns: u64, time_ns: u64) {
        if cycle >= WARM_UP {
            self.lateness.saturating_record(lateness_ns);
            self.cycle.saturating_record(time_ns);
        }
    }
}

/// The streamer's cycle, ready, and the frames for the bare loop.
struct Bench {
    core: Core,
    command_queue: CommandQueue,
    readers: Readers,
    frames: Vec<CanFrame>,
    batch: FrameBatch,
    peers: Peers,
    link: String,
    motion: PreparedTrajectory,
    generation: u64,
    ticks: u64,
    skipped: u64,
}

impl Bench {
    fn prepare(options: &BenchOptions) -> Result<Self, BenchError> {
        let settings = &options.settings;
        let peers = Peers::open(options)?;
        let base_rad = middle(settings);
        let at_base = base_rad.map(|position_rad| JointCommand { position_rad, ..JointCommand::default() });
        let mut buses = Vec::new();
        let mut frames = Vec::new();
        for (index, bus) in settings.buses.iter().enumerate() {
            let servos: Vec<_> = settings.servos.iter().filter(|s| s.bus == index).cloned().collect();
            if index == 0 {
                frames.extend(servos.iter().any(|s| CountScale::of(s).is_some()).then(sync));
                frames.extend(servos.iter().map(|servo| setpoint(servo, &JointCommand::default())));
            }
            let joints = servos.iter().map(|s| s.joint).collect();
            let (drive_target, now) = (DriveTarget::Disabled, Nanos(0));
            let groups = groups(servos.len(), bus.traffic.packed);
            let send_schedule = SendSchedule::new(bus.traffic);
            let driver =
                BenchDriver { servos, groups, send_schedule, joints, commands: at_base, drive_target, now };
            buses.push(Bus::new(peers.master(bus)?, Box::new(driver), settings));
        }
        let buses = Buses::new(buses).map_err(|e| BenchError::System(e.to_string()))?;
        let link = buses.describe();
        let (queues, command_queue) = intake::pair();
        let (reports, readers) = report::queues(false);
        let core = Core::new(settings, buses, queues, reports);
        let batch = FrameBatch::new();
        let joints = settings.robot.joints.len();
        let (generation, ticks, skipped) = (0, 0, 0);
        let motion = PreparedTrajectory::new(
            CheckedTrajectory {
                trajectory_id: 0,
                generation: 0,
                robot_digest: [0; 32],
                replaces: Replaces::Rest,
                trajectory: to_and_fro(&base_rad, joints).map_err(|e| BenchError::System(e.to_string()))?,
            },
            &settings.robot.limits(),
        );
        let mut bench = Self {
            core,
            command_queue,
            readers,
            frames,
            batch,
            peers,
            link,
            motion,
            generation,
            ticks,
            skipped,
        };
        bench.get_moving(settings.cycle.period_us)?;
        Ok(bench)
    }

    /// Runs untimed cycles until the arm moves.
    fn get_moving(&mut self, period_us: u32) -> Result<(), BenchError> {
        let mut schedule = Schedule::starting_after(rt::now(), period_us);
        for cycle in 0..READY_MAX {
            let phase = self.core.supervisor().phase();
            if phase == Phase::Moving {
                return Ok(());
            }
            if phase == Phase::Disabled && cycle % 100 == 50 {
                let _ = self.command_queue.commands.ask(Command::Enable, Nanos(u64::MAX));
            }
            rt::sleep_until(schedule.deadline());
            self.cycle(&mut schedule, &mut NoProbe);
        }
        Err(BenchError::NotMoving(self.core.supervisor().phase().word()))
    }

    /// One cycle at its deadline, as `rt::run` does it, on tick numbers that never stall; (lateness, time) in ns.
    fn cycle<P: Probe>(&mut self, schedule: &mut Schedule, probe: &mut P) -> (u64, u64) {
        let wake_time = rt::now();
        let mut tick = schedule.wake(wake_time);
        self.skipped += std::mem::take(&mut tick.skipped);
        let lateness_ns = tick.lateness_ns();
        self.ticks += 1;
        tick.number = self.ticks;
        let next = run_cycle(&mut self.core, tick, probe);
        let time_ns = rt::now().0.saturating_sub(wake_time.0);
        debug_assert_eq!(next, Next::Go);
        self.keep_moving();
        (lateness_ns, time_ns)
    }

    /// Offers the way back when one has ended, and empties the queues that are not read here.
    fn keep_moving(&mut self) {
        while self.command_queue.trajectories.trajectory_result().is_some()
            || self.command_queue.commands.answer().is_some()
        {}
        if self.core.supervisor().phase() != Phase::Holding {
            return;
        }
        let Some(mut filled) = self.command_queue.trajectories.empty_box() else { return };
        self.generation += 1;
        (*filled).clone_from(&self.motion);
        filled.rename(self.generation, self.generation);
        self.command_queue.trajectories.offer(filled);
    }

    fn streamer_slice(&mut self, period_us: u32, cycles: u64, into: &mut Times) {
        let mut schedule = Schedule::starting_after(rt::now(), period_us);
        for cycle in 0..cycles {
            rt::sleep_until(schedule.deadline());
            let (lateness_ns, time_ns) = self.cycle(&mut schedule, &mut NoProbe);
            into.take(cycle, lateness_ns, time_ns);
        }
        self.empty_queues();
    }

    /// The same sleep, clock, send and receive, and nothing else.
    fn bare_slice(&mut self, period_us: u32, cycles: u64, into: &mut Times) {
        let mut schedule = Schedule::starting_after(rt::now(), period_us);
        for cycle in 0..cycles {
            rt::sleep_until(schedule.deadline());
            let wake_time = rt::now();
            for link in self.core.links_mut() {
                link.send(&self.frames);
                link.receive(&mut self.batch);
            }
            let time_ns = rt::now().0.saturating_sub(wake_time.0);
            let tick = schedule.wake(wake_time);
            self.skipped += tick.skipped;
            into.take(cycle, tick.lateness_ns(), time_ns);
        }
    }

    /// Like the two slices above, with a clock read after every stage and every bare call.
    fn stage_slices(&mut self, period_us: u32, cycles: u64) -> Result<StageClock, BenchError> {
        let mut clock = StageClock::new()?;
        for slice in 0..STAGE_SLICES {
            let mut schedule = Schedule::starting_after(rt::now(), period_us);
            clock.begin_slice();
            for _ in 0..(cycles / STAGE_SLICES).max(2 * WARM_UP) {
                rt::sleep_until(schedule.deadline());
                clock.begin_cycle();
                if slice % 2 == 0 {
                    self.cycle(&mut schedule, &mut clock);
                } else {
                    for link in self.core.links_mut() {
                        link.send(&self.frames);
                    }
                    clock.sent();
                    for link in self.core.links_mut() {
                        link.receive(&mut self.batch);
                    }
                    clock.received();
                    schedule.wake(rt::now());
                }
            }
            self.empty_queues();
        }
        Ok(clock)
    }

    fn empty_queues(&mut self) {
        while self.readers.timings.pop().is_ok() {}
        while self.readers.reports.pop().is_ok() {}
        while self.readers.notes.pop().is_ok() {}
    }

    fn measure(mut self, options: &BenchOptions, realtime: bool) -> Result<CycleBench, BenchError> {
        let period_us = options.settings.cycle.period_us.max(1);
        let slice_s = options.seconds / f64::from(options.slices);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 3.6e9")]
        let cycles = (slice_s * 1e6 / f64::from(period_us)) as u64 + WARM_UP;
        let (mut bare, mut streamer) = (Times::new()?, Times::new()?);
        self.skipped = 0;
        for slice in 0..options.slices {
            if slice % 2 == 0 {
                self.bare_slice(period_us, cycles, &mut bare);
            } else {
                self.streamer_slice(period_us, cycles, &mut streamer);
            }
        }
        let skipped = self.skipped;
        let clock = self.stage_slices(period_us, STAGE_SLICES * cycles / 2)?;
        let phase = self.core.supervisor().phase();
        if !matches!(phase, Phase::Moving | Phase::Holding) {
            return Err(BenchError::NotMoving(phase.word()));
        }
        self.peers.close();
        let (streamer_lateness, bare_lateness) = (quantiles(&streamer.lateness), quantiles(&bare.lateness));
        let (streamer_cycle, bare_cycle) = (quantiles(&streamer.cycle), quantiles(&bare.cycle));
        Ok(CycleBench {
            link: self.link,
            joints: options.settings.robot.joints.len(),
            period_us,
            realtime,
            streamer_lateness,
            bare_lateness,
            streamer_cycle,
            bare_cycle,
            lateness_p99_ratio: ratio(streamer_lateness.p99_ns, bare_lateness.p99_ns),
            cycle_p50_ratio: ratio(streamer_cycle.p50_ns, bare_cycle.p50_ns),
            cycle_p99_ratio: ratio(streamer_cycle.p99_ns, bare_cycle.p99_ns),
            sixteen_p50_ratio: f64::NAN,
            skipped,
            clock_read: clock.clock_read(),
            stages: clock.times(),
        })
    }
}

fn histogram() -> Result<Histogram<u64>, BenchError> {
    Histogram::new_with_bounds(1, 10_000_000_000, 3).map_err(|e| BenchError::System(e.to_string()))
}

fn quantiles(times: &Histogram<u64>) -> Quantiles {
    Quantiles {
        count: times.len(),
        p50_ns: times.value_at_quantile(0.5),
        p99_ns: times.value_at_quantile(0.99),
        p999_ns: times.value_at_quantile(0.999),
        max_ns: times.max(),
    }
}

#[expect(clippy::cast_precision_loss, reason = "nanoseconds of seconds")]
fn ratio(a: u64, b: u64) -> f64 {
    a as f64 / b.max(1) as f64
}

/// The middle of every joint's range.
fn middle(settings: &Settings) -> JointArray {
    settings.robot.limits().map(|l| (l.position_rad[0] + l.position_rad[1]) / 2.0)
}

/// Six overlapping strokes away from `base_rad` and back to it, slow enough for any arm, half of them running at a time.
fn to_and_fro(base_rad: &JointArray, joints: usize) -> Result<Trajectory, taustream_motion::TrajectoryError> {
    let mut strokes = [Stroke::default(); 6];
    for (index, stroke) in (0_u8..).zip(&mut strokes) {
        let delta = if index < 3 { 0.02 } else { -0.02 };
        let mut delta_rad = [0.0; MAX_JOINTS];
        delta_rad.iter_mut().take(joints).for_each(|d| *d = delta);
        *stroke = Stroke { start_s: f64::from(index), duration_s: 3.0, n: 6, delta_rad };
    }
    Trajectory::new(joints, *base_rad, &strokes)
}
