//! What the cycle tells the other threads: a report at the set rate, timings and records every cycle, notes on events.
//!
//! Everything is a plain value pushed into a bounded queue. A full queue drops the newest value and counts it: the
//! cycle never waits for a reader.
use crate::cycle_state::{BUSES_MAX, BusState, Decision};
use crate::cycle_state::{CycleState, TRANSITIONS_MAX, TrajectoryResult, Transition, Trip};
use crate::guard::GuardedCommand;
use crate::supervise::{Actions, Supervisor, is_energised};
use crate::track::Track;
use rtrb::{Consumer, Producer, RingBuffer};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use taustream_arm::Settings;
use taustream_drivers::{ErrorFrame, FixedPdos};
use taustream_messages::{AxisReport, BusFault, BusReport, LAYOUT_VERSION, Phase, Replaces, Report};
use taustream_motion::axis::AXES_MAX;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Reports that may wait for the service thread.
const REPORTS: usize = 16;
/// Timings that may wait: a second at 1 kHz, and more.
const TIMINGS: usize = 4096;
/// Notes that may wait.
const NOTES: usize = 256;
/// Records that may wait for the cycle log: 16 s at 1 kHz.
const RECORDS: usize = 16_384;

/// How one cycle kept its time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// Wake-up after the deadline, ns.
    pub lateness_ns: u64,
    /// Time in the cycle before, ns.
    pub cycle_ns: u64,
}

/// Something that people should read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Note {
    /// The phase changed.
    Transition(Transition),
    /// The guard refused a setpoint; the joints brake over these ranges.
    Trip {
        /// Why.
        trip: Trip,
        /// Lowest and highest angle a joint, rad.
        sweep_rad: [[f64; 2]; MAX_JOINTS],
    },
    /// The controller of a bus tells of an error.
    BusError {
        /// Index of the bus.
        bus: usize,
        /// What it tells.
        error: ErrorFrame,
        /// Error frames of this bus since the note before this one, this one included.
        count: u64,
    },
    /// A bus failed, and nothing more is sent on it.
    BusFailed {
        /// Index of the bus.
        bus: usize,
        /// Why.
        bus_fault: BusFault,
    },
    /// A drive has PDOs that are not needed and cannot be switched off.
    FixedPdos {
        /// Zero-based joint.
        joint: usize,
        /// Which.
        pdos: FixedPdos,
    },
    /// A drive has sent an emergency message.
    Emergency {
        /// Zero-based joint.
        joint: usize,
        /// Its code.
        code: u32,
        /// Emergency messages of this drive since the note before this one, this one included.
        count: u32,
    },
    /// No setpoint left for longer than the drives bridge.
    Stall {
        /// How long, s.
        gap_s: f64,
        /// The motion continues in time; else it stands still until the joints rest.
        goes_on: bool,
    },
}

/// One cycle that sent setpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleRecord {
    /// Cycle number.
    pub tick: u64,
    /// `CLOCK_MONOTONIC` of the wake-up, ns.
    pub time_ns: u64,
    /// SYNCs handed to each bus so far, this cycle's included.
    pub syncs: [u64; BUSES_MAX],
    /// Frames handed to each bus so far, this cycle's included.
    pub frames: [u64; BUSES_MAX],
    /// The phase after the cycle.
    pub phase: Phase,
    /// The trajectory that made the setpoint; 0 when the arm holds or brakes.
    pub trajectory_id: u64,
    /// Its trajectory time, s.
    pub s: f64,
    /// The time scale.
    pub sigma: f64,
    /// What was encoded, rad; axes behind the joints.
    pub position_rad: JointArray,
    /// What the axes do.
    pub axes: [AxisReport; AXES_MAX],
    /// How far `position_rad` is from the trajectory while a difference is faded out, rad.
    pub off_path_rad: JointArray,
    /// Whether the setpoint of each joint was handed to its bus in this cycle.
    pub joint_sent: [bool; MAX_JOINTS],
    /// Frames taken by each bus.
    pub sent: [u32; BUSES_MAX],
    /// Frames refused by each bus.
    pub lost: [u32; BUSES_MAX],
}

/// The cut of an accepted replacement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutRecord {
    /// The trajectory that is cut.
    pub trajectory_id: u64,
    /// Trajectory time of the cut, s.
    pub at_s: f64,
    /// Trajectory time from which the replacement is sampled, s.
    pub from_s: f64,
}

/// One line of the cycle log.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a box would be allocated by the cycle")]
pub enum Record {
    /// A trajectory was accepted: it runs from this cycle on, or waits for its cut.
    Accepted {
        /// Cycle number.
        tick: u64,
        /// The trajectory.
        trajectory_id: u64,
        /// The held pose less the trajectory's base, faded out at the start, rad.
        start_offset_rad: JointArray,
        /// What it cuts; `None` for one that begins at rest.
        cut: Option<CutRecord>,
    },
    /// The phase changed.
    Transition(Transition),
    /// A cycle sent setpoints.
    CycleSettings(CycleRecord),
    /// This many records found the queue full.
    Lost(u64),
}

/// What the cycle is doing, for threads that need no more than that.
#[derive(Debug)]
pub struct Pulse {
    cycles: AtomicU64,
    phase: AtomicU32,
}

impl Pulse {
    /// Cycles that have run.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycles.load(Ordering::Relaxed)
    }

    /// The phase after the last of them.
    #[must_use]
    pub fn phase(&self) -> Phase {
        Phase::from_code(self.phase.load(Ordering::Relaxed)).unwrap_or(Phase::Configuring)
    }
}

/// The reading ends of the queues.
#[derive(Debug)]
pub struct Readers {
    /// What the cycle is doing.
    pub pulse: Arc<Pulse>,
    /// Reports without sequence numbers and histograms.
    pub reports: Consumer<Report>,
    /// One entry a cycle.
    pub timings: Consumer<Timing>,
    /// Events.
    pub notes: Consumer<Note>,
    /// The cycle log's lines, if one is kept.
    pub records: Option<Consumer<Record>>,
}

/// The writing ends of the queues, for the cycle.
#[derive(Debug)]
pub struct Writers {
    pulse: Arc<Pulse>,
    reports: Producer<Report>,
    timings: Producer<Timing>,
    notes: Producer<Note>,
    records: Option<Producer<Record>>,
}

/// Makes both ends; with a queue of records for a cycle log if `recording`. Each queue has one writer and one reader,
/// and neither ever waits for the other.
#[must_use]
pub fn queues(recording: bool) -> (Writers, Readers) {
    let (reports, reports_in) = RingBuffer::new(REPORTS);
    let (timings, timings_in) = RingBuffer::new(TIMINGS);
    let (notes, notes_in) = RingBuffer::new(NOTES);
    let (records, records_in) = recording.then(|| RingBuffer::new(RECORDS)).unzip();
    let phase = AtomicU32::new(Phase::Configuring.code());
    let pulse = Arc::new(Pulse { cycles: AtomicU64::new(0), phase });
    let writers = Writers { pulse: Arc::clone(&pulse), reports, timings, notes, records };
    (
        writers,
        Readers { pulse, reports: reports_in, timings: timings_in, notes: notes_in, records: records_in },
    )
}

/// Counts since start, and the writing ends of the queues.
#[derive(Debug)]
pub struct Reporter {
    queues: Writers,
    every_ticks: u64,
    next_tick: u64,
    period_ns: u64,
    frozen_before: bool,
    records_lost: u64,
    last_running: Running,
    noted: [NotedBus; BUSES_MAX],
    noted_drives: [NotedDrive; MAX_JOINTS],
    counts: Report,
}

/// What was last noted of a bus.
#[derive(Clone, Copy, Debug, Default)]
struct NotedBus {
    error: ErrorFrame,
    error_frames: u64,
    tick: u64,
    failed: Option<BusFault>,
}

/// What was last noted of a drive.
#[derive(Clone, Copy, Debug, Default)]
struct NotedDrive {
    fixed_pdos: FixedPdos,
    emergency: u32,
    emergencies: u32,
    tick: u64,
}

/// The trajectory that runs or ran last.
#[derive(Clone, Copy, Debug, Default)]
struct Running {
    id: u64,
    s: f64,
    duration_s: f64,
}

impl Reporter {
    /// A reporter for the arm of `settings`, with these local links.
    #[must_use]
    pub fn new(settings: &Settings, local: &[bool], queues: Writers) -> Self {
        let (cycle, joints, axes) = (&settings.cycle, settings.robot.joints.len(), settings.axes.len());
        let period_ns = u64::from(cycle.period_us.max(1)) * 1_000;
        #[expect(clippy::cast_precision_loss, reason = "nanoseconds of a period")]
        let ticks = (1e9 / (cycle.report_rate_hz * period_ns as f64)).round().clamp(1.0, 1e9);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 1e9")]
        let every_ticks = ticks as u64;
        let mut buses = [BusReport::default(); BUSES_MAX];
        for (bus, local) in buses.iter_mut().zip(local) {
            bus.local = u32::from(*local);
        }
        let counts = Report {
            layout_version: LAYOUT_VERSION,
            joint_count: u32::try_from(joints).unwrap_or(u32::MAX),
            bus_count: u32::try_from(local.len()).unwrap_or(u32::MAX),
            axis_count: u32::try_from(axes).unwrap_or(u32::MAX),
            buses,
            robot_digest: settings.robot.message_digest,
            ..Report::default()
        };
        Self {
            queues,
            every_ticks,
            next_tick: 0,
            period_ns,
            frozen_before: false,
            records_lost: 0,
            last_running: Running::default(),
            noted: [NotedBus::default(); BUSES_MAX],
            noted_drives: [NotedDrive::default(); MAX_JOINTS],
            counts,
        }
    }

    /// Counts this cycle and tells what is due.
    ///
    /// Real time: copies into queues; never waits, never allocates.
    pub fn write(
        &mut self,
        cycle_state: &CycleState,
        command: &GuardedCommand,
        track: &Track,
        supervision: (&Supervisor, &Actions),
    ) {
        let (supervisor, actions) = supervision;
        let stalls = self.stalls_now(cycle_state);
        self.count(cycle_state, stalls);
        if let Some(running) = track.running() {
            let duration_s = running.trajectory.duration_s();
            self.last_running =
                Running { id: running.trajectory_id, s: cycle_state.trajectory_s, duration_s };
        }
        let timing =
            Timing { lateness_ns: cycle_state.tick.lateness_ns(), cycle_ns: cycle_state.tick.last_cycle_ns };
        let _ = self.queues.timings.push(timing);
        let pulse = &self.queues.pulse;
        pulse.phase.store(supervisor.phase().code(), Ordering::Relaxed);
        pulse.cycles.store(self.counts.cycles, Ordering::Relaxed);
        self.write_notes(cycle_state, &actions.transitions);
        if self.queues.records.is_some() {
            self.write_records(cycle_state, command, track, supervision);
        }
        let spliced = cycle_state.trajectory_result.is_some() || cycle_state.took_over;
        let changed = actions.transitions[0].is_some() || spliced;
        if changed || cycle_state.tick.number >= self.next_tick {
            self.next_tick = cycle_state.tick.number + self.every_ticks;
            let report = self.report(cycle_state, command, track, supervisor);
            let _ = self.queues.reports.push(report);
        }
    }

    fn count(&mut self, cycle_state: &CycleState, stalls: bool) {
        let c = &mut self.counts;
        c.cycles += 1;
        c.cycles_skipped += cycle_state.tick.skipped;
        c.cycles_late += u64::from(cycle_state.tick.lateness_ns() > self.period_ns / 2);
        c.guard_trips += u64::from(cycle_state.trip.is_some() || cycle_state.axis_trip.is_some());
        c.stalls += u64::from(stalls);
        for (found, bus) in cycle_state.buses.iter().zip(&mut c.buses) {
            let lost = u64::from(lost_frames(found));
            bus.frames_sent += u64::from(found.sent);
            bus.frames_lost += lost;
            bus.frames_received += u64::from(found.received);
            bus.cycles_lost += u64::from(lost > 0);
            bus.error_frames = found.error_frames;
            c.frames_sent += u64::from(found.sent);
            c.frames_lost += lost;
            c.frames_received += u64::from(found.received);
        }
    }

    /// Trajectory time stops because the loop was late; a failed bus is reported as such.
    fn stalls_now(&self, cycle_state: &CycleState) -> bool {
        let begins = cycle_state.bridged || cycle_state.frozen && !self.frozen_before;
        begins && cycle_state.failed_bus().is_none()
    }

    /// Notes what a controller tells: what is new at most ten times a second, the same again once a second, with its
    /// count, so that a flood of error frames does not flood the log.
    fn note_buses(&mut self, cycle_state: &CycleState) {
        let second_ticks = 1_000_000_000 / self.period_ns;
        for (bus, (found, noted)) in cycle_state.buses.iter().zip(&mut self.noted).enumerate() {
            if found.failed != noted.failed {
                noted.failed = found.failed;
                if let Some(bus_fault) = found.failed {
                    let _ = self.queues.notes.push(Note::BusFailed { bus, bus_fault });
                }
            }
            let count = found.error_frames.saturating_sub(noted.error_frames);
            let is_new = kind(found.newest_error) != kind(noted.error);
            let rest_ticks = if is_new { second_ticks / 10 } else { second_ticks };
            let is_due =
                noted.error_frames == 0 || cycle_state.tick.number.saturating_sub(noted.tick) >= rest_ticks;
            if count > 0 && is_due {
                let error = found.newest_error;
                (noted.error, noted.error_frames, noted.tick) =
                    (error, found.error_frames, cycle_state.tick.number);
                let _ = self.queues.notes.push(Note::BusError { bus, error, count });
            }
        }
    }

    /// Notes emergency messages, of healthy drives too: what is new at most ten times a second, the same again once a second.
    fn note_drives(&mut self, cycle_state: &CycleState) {
        let second_ticks = 1_000_000_000 / self.period_ns;
        for (joint, (servo, noted)) in cycle_state.servos.iter().zip(&mut self.noted_drives).enumerate() {
            let (code, count) = (servo.emergency, servo.emergencies.wrapping_sub(noted.emergencies));
            let rest_ticks = if code == noted.emergency { second_ticks } else { second_ticks / 10 };
            let is_due =
                noted.emergencies == 0 || cycle_state.tick.number.saturating_sub(noted.tick) >= rest_ticks;
            if count > 0 && is_due {
                *noted = NotedDrive {
                    emergency: code,
                    emergencies: servo.emergencies,
                    tick: cycle_state.tick.number,
                    ..*noted
                };
                let _ = self.queues.notes.push(Note::Emergency { joint, code, count });
            }
            // Bring-up is long over when a drive reports its position.
            if servo.state.reports() && servo.fixed_pdos != noted.fixed_pdos {
                noted.fixed_pdos = servo.fixed_pdos;
                let _ = self.queues.notes.push(Note::FixedPdos { joint, pdos: servo.fixed_pdos });
            }
        }
    }

    fn write_notes(&mut self, cycle_state: &CycleState, transitions: &[Option<Transition>; TRANSITIONS_MAX]) {
        if let Some(trip) = cycle_state.trip {
            let _ = self.queues.notes.push(Note::Trip { trip, sweep_rad: cycle_state.sweep_rad });
        }
        self.note_buses(cycle_state);
        self.note_drives(cycle_state);
        if self.stalls_now(cycle_state) {
            let _ = self
                .queues
                .notes
                .push(Note::Stall { gap_s: cycle_state.gap_s, goes_on: cycle_state.bridged });
        }
        self.frozen_before = cycle_state.frozen;
        for transition in transitions.iter().flatten() {
            let _ = self.queues.notes.push(Note::Transition(*transition));
        }
    }

    fn write_records(
        &mut self,
        cycle_state: &CycleState,
        command: &GuardedCommand,
        track: &Track,
        (supervisor, actions): (&Supervisor, &Actions),
    ) {
        if let Some(accepted) = accepted(cycle_state, track) {
            self.record(accepted);
        }
        for transition in actions.transitions.iter().flatten() {
            self.record(Record::Transition(*transition));
        }
        if cycle_state.live {
            self.record(Record::CycleSettings(CycleRecord {
                tick: cycle_state.tick.number,
                time_ns: cycle_state.tick.wake_time.0,
                syncs: cycle_state.buses.map(|b| b.syncs),
                frames: cycle_state.buses.map(|b| b.frames),
                phase: supervisor.phase(),
                trajectory_id: cycle_state.trajectory_id,
                s: if cycle_state.trajectory_id == 0 { 0.0 } else { cycle_state.trajectory_s },
                sigma: cycle_state.scale.sigma,
                position_rad: command.setpoint().position_rad,
                axes: cycle_state.axes,
                off_path_rad: cycle_state.off_path_rad,
                joint_sent: std::array::from_fn(|joint| cycle_state.taken.contains(joint)),
                sent: cycle_state.buses.map(|b| b.sent),
                lost: cycle_state.buses.map(|b| lost_frames(&b)),
            }));
        }
    }

    fn record(&mut self, record: Record) {
        let Some(records) = &mut self.queues.records else { return };
        if self.records_lost > 0 && records.push(Record::Lost(self.records_lost)).is_ok() {
            self.records_lost = 0;
        }
        if self.records_lost > 0 || records.push(record).is_err() {
            self.records_lost += 1;
        }
    }

    fn report(
        &self,
        cycle_state: &CycleState,
        command: &GuardedCommand,
        track: &Track,
        supervisor: &Supervisor,
    ) -> Report {
        let setpoint = command.setpoint();
        let (tracking_error_rad, tracking_error_rad_max) = supervisor.watch().tracking_rad();
        let (joints, slots) = (self.counts.joints(), self.counts.slots());
        let of_path = |values: &JointArray| of_path(joints, values);
        let mut r = self.counts;
        (r.tick, r.time_ns, r.phase) =
            (cycle_state.tick.number, cycle_state.tick.wake_time.0, supervisor.phase().code());
        r.set_cause(supervisor.cause());
        r.set_pause(supervisor.paused_by());
        for (bus, found) in r.buses.iter_mut().zip(&cycle_state.buses) {
            let passive = found.passive.then_some(BusFault::ErrorPassive);
            bus.bus_fault = found.failed.or(passive).map_or(0, BusFault::code);
            bus.silent = u32::from(found.failed.is_some());
            bus.in_flight = found.in_flight;
            (bus.receive_lost, bus.echoes_missing) = (found.overflowed, found.echoes_missing);
            (bus.error_class, bus.error_data) = (found.newest_error.class, found.newest_error.data);
        }
        r.energised = u32::from(cycle_state.servos.iter().take(slots).any(|s| is_energised(s.state)));
        r.generation = track.newest_generation();
        let run = self.last_running;
        (r.trajectory_id, r.trajectory_s, r.trajectory_duration_s) = (run.id, run.s, run.duration_s);
        (r.successor_id, r.successor_from_s) =
            track.waiting().map_or((0, 0.0), |w| (w.trajectory.trajectory_id, w.from_s));
        let last = track.waiting().map(|waiting| &waiting.trajectory).or(track.running());
        (r.end_s, r.end_rad) = last.map_or((0.0, of_path(&cycle_state.commanded_rad)), |last| {
            (last.trajectory.duration_s(), last.trajectory.end_rad())
        });
        (r.sigma, r.speed_percent) = (cycle_state.scale.sigma, supervisor.speed() * 100.0);
        r.command_rad = of_path(&cycle_state.commanded_rad);
        r.command_velocity_rad_s = of_path(&setpoint.velocity_rad_s);
        r.command_acceleration_rad_s2 = of_path(&setpoint.acceleration_rad_s2);
        r.command_jerk_rad_s3 = of_path(&setpoint.jerk_rad_s3);
        r.axes = cycle_state.axes;
        (r.tracking_error_rad, r.tracking_error_rad_max) = (tracking_error_rad, tracking_error_rad_max);
        (r.first_speed, r.adopted) =
            (u32::from(supervisor.is_first_speed()), u32::from(supervisor.has_adopted()));
        r.multi_turn_offset_rad = supervisor.referencing().offsets_rad();
        r.reference_state =
            std::array::from_fn(|joint| supervisor.referencing().resolved(joint).reference_state.code());
        for (joint, servo) in cycle_state.servos.iter().enumerate().take(slots) {
            r.measured_rad[joint] = servo.position_rad;
            r.measured_velocity_rad_s[joint] = servo.velocity_rad_s;
            r.measured_torque_nm[joint] = servo.torque_nm;
            r.feedback_age_s[joint] = supervisor.watch().age_s(cycle_state, joint);
            r.drive_status[joint] = servo.status_word;
            r.drive_error[joint] = servo.error_code;
            if cycle_state.unreachable[joint] {
                // Nothing is commanded there any more.
                r.command_velocity_rad_s[joint] = 0.0;
                r.command_acceleration_rad_s2[joint] = 0.0;
                r.command_jerk_rad_s3[joint] = 0.0;
            }
        }
        r
    }
}

/// The record of a trajectory that was accepted in this cycle.
fn accepted(cycle_state: &CycleState, track: &Track) -> Option<Record> {
    let TrajectoryResult { trajectory_id, decision, .. } = cycle_state.trajectory_result?;
    let tick = cycle_state.tick.number;
    match decision {
        Decision::Accepted { tick } => {
            let start_offset_rad = *track.start_offset_rad();
            Some(Record::Accepted { tick, trajectory_id, start_offset_rad, cut: None })
        }
        Decision::Waits { from_s } => {
            let waiting = track.waiting().map(|waiting| &waiting.trajectory);
            let mut known = waiting.into_iter().chain(track.running());
            let replaces = known.find(|known| known.trajectory_id == trajectory_id)?.replaces;
            let Replaces::Cut { trajectory_id: cut_id, at_s } = replaces else { return None };
            let cut = Some(CutRecord { trajectory_id: cut_id, at_s, from_s });
            Some(Record::Accepted { tick, trajectory_id, start_offset_rad: [0.0; MAX_JOINTS], cut })
        }
        Decision::Cut(_)
        | Decision::Stale { .. }
        | Decision::NotAtBase { .. }
        | Decision::NotReady { .. } => None,
    }
}

/// What belongs to the joints of the path; axes behind them are left out.
fn of_path(joints: usize, values: &JointArray) -> JointArray {
    std::array::from_fn(|joint| if joint < joints { values[joint] } else { 0.0 })
}

fn lost_frames(found: &BusState) -> u32 {
    found.requested.saturating_sub(found.sent)
}

/// An error without its counters, which change with every frame.
fn kind(error: ErrorFrame) -> (u32, [u8; 6]) {
    let [a, b, c, d, e, f, ..] = error.data;
    (error.class, [a, b, c, d, e, f])
}
