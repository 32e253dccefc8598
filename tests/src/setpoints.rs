//! The checker of a recording: was every setpoint on the bus the one that the trajectory demands?
//!
//! It shares no encoding with the product. The bus is what the recorder wrote; the claim is the streamer's cycle log. For
//! each cycle: the frames between two SYNCs are exactly one RPDO per servo, their targets equal the encoding
//! of the logged setpoint count by count, and the logged setpoint is on the accepted trajectory (`on_path.rs`).
use crate::carried::Carried;
use crate::cycle_log::{Event, LoggedCycle};
use crate::on_path::PathCheck;
use std::collections::BTreeMap;
use std::fmt;

/// TPDO1 of node 0.
const TPDO1: u32 = 0x180;

/// One frame as the recorder saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct BusFrame {
    /// The id, with the kernel's flags.
    pub id: u32,
    /// The data.
    pub data: Vec<u8>,
}

/// How one joint's setpoint is encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoding {
    /// Joint of the arm.
    pub joint: usize,
    /// Node id.
    pub node_id: u8,
    /// Counts a link radian, with the sign of the direction.
    pub counts_per_rad: f64,
    /// Link angle at count 0.
    pub zero_rad: f64,
}

impl Encoding {
    /// Counts of an angle: rounded half away from zero.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "ranges were checked to fit i32 when settings were read"
    )]
    pub fn counts(&self, position_rad: f64) -> i32 {
        ((position_rad - self.zero_rad) * self.counts_per_rad).round() as i32
    }
    /// The angle of counts.
    #[must_use]
    pub fn rad(&self, counts: i32) -> f64 {
        f64::from(counts) / self.counts_per_rad + self.zero_rad
    }
}

/// What a recording showed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckResult {
    /// Frames of any kind on the bus.
    pub frames: usize,
    /// SYNCs on the bus.
    pub syncs: usize,
    /// Setpoint frames compared.
    pub setpoints: usize,
    /// Setpoints that were compared with a trajectory.
    pub on_trajectory: usize,
    /// Trajectories accepted.
    pub trajectories: usize,
    /// Last position that each servo reported, rad.
    pub last_measured_rad: Vec<f64>,
    /// Last setpoint of each joint, rad.
    pub last_setpoint_rad: Vec<f64>,
}

impl CheckResult {
    /// Takes in what another bus of the same recording showed.
    pub fn add(&mut self, other: Self) {
        self.frames += other.frames;
        self.syncs += other.syncs;
        self.setpoints += other.setpoints;
        self.on_trajectory += other.on_trajectory;
        self.trajectories = self.trajectories.max(other.trajectories);
        self.last_measured_rad.extend(other.last_measured_rad);
        self.last_setpoint_rad = other.last_setpoint_rad;
    }
}

impl fmt::Display for CheckResult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { frames, syncs, setpoints, on_trajectory, .. } = self;
        write!(
            f,
            "{frames} frames on the bus, {syncs} cycles, {setpoints} setpoints equal to the log, {on_trajectory} of them to a trajectory"
        )
    }
}

/// What is wrong with a recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Flaw {
    /// The log is incomplete or contradicts itself.
    #[error("log: {0}")]
    Log(String),
    /// The bus does not carry what the log claims.
    #[error("SYNC {sync} (tick {tick}): {what}")]
    Bus {
        /// Number of the SYNC.
        sync: u64,
        /// Cycle number in the log.
        tick: u64,
        /// The difference.
        what: String,
    },
    /// The logged setpoint is not on the trajectory.
    #[error(
        "tick {tick}: joint {joint} is at {got_rad} rad; the trajectory at s = {s}, with {off_rad} rad on the way back, is at {want_rad} rad"
    )]
    OffTrajectory {
        /// Cycle number.
        tick: u64,
        /// One-based joint.
        joint: usize,
        /// Logged setpoint.
        got_rad: f64,
        /// Where it belongs.
        want_rad: f64,
        /// The difference from the trajectory that the log states.
        off_rad: f64,
        /// Trajectory time.
        s: f64,
    },
}

/// Whether cycles may be lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Losses {
    /// Every cycle of the log is on the bus, whole.
    None,
    /// Cycles of which the log says that the bus took only a part, or nothing, are so on the bus. That nothing is on the
    /// bus beyond what the log claims holds all the more.
    AsLogged,
}

/// Checks one bus of a recording that began before the first SYNC.
///
/// # Errors
/// The first flaw.
pub fn check_setpoints(
    frames: &[BusFrame],
    log: &[Event],
    bus: usize,
    encodings: &[Encoding],
) -> Result<CheckResult, Flaw> {
    check_setpoints_with(Losses::None, (frames, log), bus, encodings)
}

/// Checks one bus of a recording in which cycles may have been lost.
///
/// # Errors
/// The first flaw.
pub fn check_setpoints_with(
    losses: Losses,
    (frames, log): (&[BusFrame], &[Event]),
    bus: usize,
    encodings: &[Encoding],
) -> Result<CheckResult, Flaw> {
    let check_setpoints =
        |outcomes: &ProcessOutcomes| check_assuming(outcomes, losses, (frames, log), bus, encodings);
    let whole = check_setpoints(&ProcessOutcomes::new());
    let doubtful = if losses == Losses::AsLogged { before_silences(log, bus) } else { Vec::new() };
    let other = whole
        .is_err()
        .then(|| outcomes_of(&doubtful).iter().find_map(|outcomes| check_setpoints(outcomes).ok()));
    other.flatten().map_or(whole, Ok)
}

/// Checks with cycles that did not fare as the log says.
fn check_assuming(
    outcomes: &ProcessOutcomes,
    losses: Losses,
    (frames, log): (&[BusFrame], &[Event]),
    bus: usize,
    encodings: &[Encoding],
) -> Result<CheckResult, Flaw> {
    let mut carried = Carried::new(frames, bus, encodings);
    let mut check_result =
        CheckResult { frames: frames.len(), syncs: carried.syncs(), ..last_measured(frames, encodings) };
    let mut path = PathCheck::default();
    let mut last: Option<&LoggedCycle> = None;
    for event in log {
        match event {
            Event::Start { .. } | Event::Phase { .. } => {}
            Event::Lost { records } => return Err(Flaw::Log(format!("{records} records are missing"))),
            Event::Trajectory { trajectory_id, file, start_offset_rad, cut, .. } => {
                match cut {
                    Some(cut) => path.replace(*trajectory_id, file, cut)?,
                    None => path.accept(*trajectory_id, file, start_offset_rad)?,
                }
                check_result.trajectories += 1;
            }
            Event::Cycle(cycle) => {
                let whole = is_whole(cycle, bus);
                if !whole && losses == Losses::None {
                    return Err(Flaw::Log(format!(
                        "tick {}: frames lost on bus {bus}: {:?}",
                        cycle.tick, cycle.lost
                    )));
                }
                check_result.on_trajectory += path.compare(cycle)?;
                if is_lost(cycle, bus) {
                    continue; // Nothing of it left: the next cycle takes its place.
                }
                follows(last, cycle, bus)?;
                check_result.setpoints += match outcomes.get(&cycle.tick) {
                    None if whole => carried.compare_whole(cycle)?,
                    None | Some(ProcessOutcome::InPart) => carried.compare_rest(cycle)?,
                    Some(ProcessOutcome::Gone) => carried.pass_over(),
                };
                last = Some(cycle);
            }
        }
    }
    carried.nothing_else()?;
    check_result.last_setpoint_rad = last.map(|c| c.position_rad.clone()).unwrap_or_default();
    Ok(check_result)
}

/// How a cycle fared that the kernel had taken when its interface went: frames on the way go with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ProcessOutcome {
    /// Only a part of it came through, its SYNC first.
    InPart,
    /// Nothing of it came through.
    Gone,
}

/// By cycle number; who is not in it fared as the log says.
type ProcessOutcomes = BTreeMap<u64, ProcessOutcome>;

/// Cycles in a row without a frame that make a silence.
const SILENCE_CYCLES: usize = 20;
/// More silences are not excused in one recording.
const SILENCES_MAX: usize = 3;

/// The last cycles that a bus took before it fell silent.
fn before_silences(log: &[Event], bus: usize) -> Vec<u64> {
    let cycle = |event: &Event| match event {
        Event::Cycle(cycle) => Some((cycle.tick, is_lost(cycle, bus))),
        Event::Start { .. } | Event::Phase { .. } | Event::Lost { .. } | Event::Trajectory { .. } => None,
    };
    let cycles: Vec<(u64, bool)> = log.iter().filter_map(cycle).collect();
    let silent = |rest: &&[(u64, bool)]| rest.iter().skip(1).all(|(_, lost)| *lost) && !rest[0].1;
    cycles.windows(SILENCE_CYCLES + 1).filter(silent).map(|rest| rest[0].0).take(SILENCES_MAX).collect()
}

/// Every way in which these cycles may have fared.
fn outcomes_of(ticks: &[u64]) -> Vec<ProcessOutcomes> {
    let mut all = vec![ProcessOutcomes::new()];
    for tick in ticks {
        let before = all.clone();
        for outcome in [ProcessOutcome::InPart, ProcessOutcome::Gone] {
            all.extend(before.iter().cloned().map(|mut outcomes| {
                outcomes.insert(*tick, outcome);
                outcomes
            }));
        }
    }
    all
}

/// Phases in which single drives may be off, on their way on or off, or in another mode.
pub(crate) fn may_be_off(phase: &str) -> bool {
    matches!(phase, "enabling" | "fast-stopping" | "braking" | "fault" | "locked" | "disabling" | "homing")
}

fn last_measured(frames: &[BusFrame], encodings: &[Encoding]) -> CheckResult {
    let newest = |e: &Encoding| {
        let id = TPDO1 + u32::from(e.node_id);
        let data = frames.iter().rev().find(|f| f.id == id).map(|f| f.data.as_slice())?;
        target(data).map(|counts| e.rad(counts))
    };
    let last_measured_rad = encodings.iter().map(|e| newest(e).unwrap_or(f64::NAN)).collect();
    CheckResult { last_measured_rad, ..CheckResult::default() }
}

/// The i32 behind the control or status word of a PDO of 6 bytes.
pub(crate) fn target(data: &[u8]) -> Option<i32> {
    let bytes: [u8; 4] = data.get(2..6)?.try_into().ok()?;
    (data.len() == 6).then(|| i32::from_le_bytes(bytes))
}

fn follows(last: Option<&LoggedCycle>, cycle: &LoggedCycle, bus: usize) -> Result<(), Flaw> {
    let flaw = |what: String| Err(Flaw::Log(format!("tick {}: {what}", cycle.tick)));
    let Some(last) = last else { return Ok(()) };
    if cycle.tick <= last.tick || cycle.time_ns <= last.time_ns {
        return flaw(format!("does not come after tick {}", last.tick));
    }
    if cycle.sync.get(bus) <= last.sync.get(bus) {
        return flaw(format!("SYNC count {:?} after {:?}", cycle.sync, last.sync));
    }
    if cycle.trajectory_id == last.trajectory_id && cycle.s < last.s {
        return flaw(format!("trajectory time went back from {} to {}", last.s, cycle.s));
    }
    Ok(())
}

/// All frames of the cycle were taken, and there were some.
fn is_whole(cycle: &LoggedCycle, bus: usize) -> bool {
    cycle.lost.get(bus) == Some(&0) && !is_lost(cycle, bus)
}

/// No frame of the cycle was taken.
fn is_lost(cycle: &LoggedCycle, bus: usize) -> bool {
    cycle.sent.get(bus).is_none_or(|sent| *sent == 0)
}
