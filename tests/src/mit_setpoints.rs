//! The checker of a recording of motors in MIT mode (Damiao, `CubeMars`): was every command on the bus the one that the log claims?
//!
//! It shares no packing with the product: bits are taken from the bytes by their printed places, and a value is right when
//! it lies at most half a step from what the bits say. There is no SYNC on such a bus, so the log's
//! count of frames tells which frames of the recording are a cycle's.
//!
//! For each cycle of the log: each motor has one frame; outside of enabling and faults that is a command with the whole
//! gains, the logged angle, and the velocity that this angle has from cycle to cycle. That logged angles are those of the
//! accepted trajectory is checked as for every other arm.
use crate::cycle_log::{Event, LoggedCycle};
use crate::on_path::PathCheck;
use crate::setpoints::{BusFrame, CheckResult, Flaw, may_be_off};
use taustream_arm::{CubeMars, Damiao, DamiaoMode, Settings};

/// Registers and requests for feedback.
const REGISTERS: u32 = 0x7FF;
/// Gains that 12 bits span.
const STIFFNESS_SPAN: f64 = 500.0;
const DAMPING_SPAN: f64 = 5.0;
/// Room for the change of velocity within a cycle, rad/s.
const VELOCITY_ROOM_RAD_S: f64 = 0.1;

/// How one motor is commanded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorEncoding {
    /// Joint of the arm.
    pub joint: usize,
    /// Identifier of its commands.
    pub node_id: u8,
    /// Identifier of its feedback.
    pub feedback_id: u16,
    /// Direction of the motor against the link's.
    pub sign: f64,
    /// Link angle where the motor says 0.
    pub zero_rad: f64,
    /// Reach of angle and velocity.
    pub reach: [f64; 2],
    /// Stiffness and damping.
    pub gains: [f64; 2],
}

impl MotorEncoding {
    /// The link angle that a command holds; none for a special command.
    #[must_use]
    pub fn commanded_rad(&self, data: &[u8]) -> Option<f64> {
        let code = Command::of(data)?.position;
        Some(value(code, 16, [-self.reach[0], self.reach[0]]) * self.sign + self.zero_rad)
    }
}

/// The motors of an arm; none when one of its servos is something else.
#[must_use]
pub fn encodings(settings: &Settings) -> Option<Vec<MotorEncoding>> {
    let encoding = |servo: &taustream_arm::Servo| {
        let (feedback_id, ranges, gains) = if let Some(damiao) = servo.protocol.get::<Damiao>() {
            let DamiaoMode::Mit(gains) = damiao.mode else { return None };
            (damiao.feedback_id, damiao.ranges, gains)
        } else {
            let cubemars = servo.protocol.get::<CubeMars>()?;
            (cubemars.feedback_id, cubemars.ranges, cubemars.gains)
        };
        Some(MotorEncoding {
            joint: servo.joint,
            node_id: servo.node_id,
            feedback_id,
            sign: servo.sign,
            zero_rad: servo.zero_offset_rad,
            reach: [ranges.position_rad, ranges.velocity_rad_s],
            gains: [gains.stiffness_nm_rad, gains.damping_nm_s_rad],
        })
    };
    settings.servos.iter().map(encoding).collect()
}

/// The bits `[from, from + count)` of eight bytes, the highest bit of the first byte being bit 0.
fn bits(data: [u8; 8], from: u32, count: u32) -> u32 {
    let all = u64::from_be_bytes(data) << from >> (64 - count);
    u32::try_from(all).unwrap_or(u32::MAX)
}

/// The value that a code of `count` bits says in a range.
fn value(code: u32, count: u32, [low, high]: [f64; 2]) -> f64 {
    low + (high - low) / (f64::from(2_u32.pow(count)) - 1.0) * f64::from(code)
}

/// Whether `wanted` packs to this code: it lies within half a step of it, or outside the range on its side.
fn packs(wanted: f64, code: u32, count: u32, [low, high]: [f64; 2]) -> bool {
    let step = (high - low) / (f64::from(2_u32.pow(count)) - 1.0);
    let off = (wanted.clamp(low, high) - value(code, count, [low, high])) / step;
    off.abs() <= 0.5 + 1e-6
}

/// One MIT command on the bus.
#[derive(Clone, Copy, Debug)]
struct Command {
    position: u32,
    velocity: u32,
    stiffness: u32,
    damping: u32,
}

impl Command {
    /// None for the special commands, which begin with seven bytes of 0xFF.
    fn of(data: &[u8]) -> Option<Self> {
        let data: [u8; 8] = data.try_into().ok()?;
        let special = data.iter().take(7).all(|byte| *byte == 0xFF);
        (!special).then(|| Self {
            position: bits(data, 0, 16),
            velocity: bits(data, 16, 12),
            stiffness: bits(data, 28, 12),
            damping: bits(data, 40, 12),
        })
    }
}

/// Where the log ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogEnds {
    /// With the streamer, which ended in order: every command is in it.
    WithTheStreamer,
    /// Before: the streamer was killed, and what it last sent was not written down.
    Early,
}

/// Checks one bus of a recording that began before the streamer's first frame.
///
/// # Errors
/// The first flaw.
pub fn check_setpoints(
    (frames, log): (&[BusFrame], &[Event]),
    bus: usize,
    (motors, period_s): (&[MotorEncoding], f64),
    ends: LogEnds,
) -> Result<CheckResult, Flaw> {
    let ours =
        |frame: &&BusFrame| frame.id == REGISTERS || motors.iter().any(|m| u32::from(m.node_id) == frame.id);
    let sent: Vec<&BusFrame> = frames.iter().filter(ours).collect();
    let mut check_result = CheckResult { frames: frames.len(), ..last_measured(frames, motors) };
    let mut path = PathCheck::default();
    let mut claimed = vec![false; sent.len()];
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
                let before = last.filter(|last| last.tick + 1 == cycle.tick);
                check_result.setpoints +=
                    compare_cycle(&sent, (before, cycle), bus, (motors, period_s), &mut claimed)?;
                check_result.on_trajectory += path.compare(cycle)?;
                check_result.syncs += 1;
                last = Some(cycle);
            }
        }
    }
    if ends == LogEnds::Early {
        let known = claimed.iter().rposition(|claimed| *claimed).map_or(0, |at| at + 1);
        claimed.split_at_mut(known).1.fill(true);
    }
    // Whatever has stiffness moves an arm: only a cycle sends it that the log knows.
    let unclaimed = sent.iter().zip(&claimed).find(|(frame, claimed)| {
        !**claimed && frame.id != REGISTERS && Command::of(&frame.data).is_some_and(|c| c.stiffness > 0)
    });
    if let Some((frame, _)) = unclaimed {
        return Err(Flaw::Log(format!(
            "motor {} was commanded by a frame that the log does not know",
            frame.id
        )));
    }
    check_result.last_setpoint_rad = last.map(|c| c.position_rad.clone()).unwrap_or_default();
    Ok(check_result)
}

/// Compares one cycle's frames with its line of the log; how many commands were compared.
fn compare_cycle(
    sent: &[&BusFrame],
    (before, cycle): (Option<&LoggedCycle>, &LoggedCycle),
    bus: usize,
    (motors, period_s): (&[MotorEncoding], f64),
    claimed: &mut [bool],
) -> Result<usize, Flaw> {
    let tick = cycle.tick;
    let of_bus = |list: &[u64]| list.get(bus).copied().and_then(|n| usize::try_from(n).ok()).unwrap_or(0);
    let (end, count) = (of_bus(&cycle.frames), of_bus(&cycle.sent));
    let flaw = |what: String| Flaw::Bus { sync: cycle.frames.get(bus).copied().unwrap_or(0), tick, what };
    if of_bus(&cycle.lost) != 0 {
        return Err(flaw(format!("frames lost on bus {bus}")));
    }
    let range = end.checked_sub(count).map(|begin| begin..end);
    let mine =
        range.clone().and_then(|range| sent.get(range)).ok_or_else(|| flaw("is not on the bus".into()))?;
    if let Some(slots) = range.and_then(|range| claimed.get_mut(range)) {
        slots.fill(true);
    }
    let mut compared = 0;
    for motor in motors {
        let mut of_motor = mine.iter().filter(|frame| is_to(frame, motor.node_id));
        let (first, second) = (of_motor.next(), of_motor.next());
        if second.is_some() {
            return Err(flaw(format!("motor {} has more than one frame", motor.node_id)));
        }
        let command = first.filter(|frame| frame.id != REGISTERS).and_then(|frame| Command::of(&frame.data));
        let Some(command) = command else {
            if may_be_off(&cycle.phase) {
                continue;
            }
            return Err(flaw(format!("motor {} is not commanded while {}", motor.node_id, cycle.phase)));
        };
        compare_command(motor, command, (before, cycle), period_s).map_err(flaw)?;
        compared += 1;
    }
    Ok(compared)
}

fn is_to(frame: &BusFrame, node_id: u8) -> bool {
    let named = || frame.data.first() == Some(&node_id) && frame.data.get(1) == Some(&0);
    frame.id == u32::from(node_id) || frame.id == REGISTERS && named()
}

fn compare_command(
    motor: &MotorEncoding,
    command: Command,
    (before, cycle): (Option<&LoggedCycle>, &LoggedCycle),
    period_s: f64,
) -> Result<(), String> {
    let node = motor.node_id;
    let angle =
        |cycle: &LoggedCycle| cycle.slot(motor.joint).map(|(rad, _)| (rad - motor.zero_rad) * motor.sign);
    let wanted = angle(cycle).ok_or_else(|| format!("no setpoint of joint {}", motor.joint + 1))?;
    let [reach_rad, reach_rad_s] = motor.reach;
    if !packs(wanted, command.position, 16, [-reach_rad, reach_rad]) {
        let got = value(command.position, 16, [-reach_rad, reach_rad]);
        return Err(format!("motor {node} was sent to {got} rad, the log says {wanted} rad of the motor"));
    }
    let whole = packs(motor.gains[0], command.stiffness, 12, [0.0, STIFFNESS_SPAN])
        && packs(motor.gains[1], command.damping, 12, [0.0, DAMPING_SPAN]);
    if !whole && !may_be_off(&cycle.phase) {
        return Err(format!("motor {node} has the gains {command:?} while {}", cycle.phase));
    }
    if let Some(past) = before.and_then(angle) {
        let got = value(command.velocity, 12, [-reach_rad_s, reach_rad_s]);
        let rate = (wanted - past) / period_s;
        let room = VELOCITY_ROOM_RAD_S + 2.0 * reach_rad_s / 4095.0;
        if (got - rate).abs() > room && cycle.sigma > 0.0 {
            return Err(format!("motor {node} was sent {got} rad/s, its angle changes by {rate} rad/s"));
        }
    }
    Ok(())
}

fn last_measured(frames: &[BusFrame], motors: &[MotorEncoding]) -> CheckResult {
    let newest = |m: &MotorEncoding| {
        let id = u32::from(m.feedback_id);
        let data: [u8; 8] = frames.iter().rev().find(|f| f.id == id)?.data.as_slice().try_into().ok()?;
        let [reach_rad, _] = m.reach;
        Some(value(bits(data, 8, 16), 16, [-reach_rad, reach_rad]) * m.sign + m.zero_rad)
    };
    let last_measured_rad = motors.iter().map(|m| newest(m).unwrap_or(f64::NAN)).collect();
    CheckResult { last_measured_rad, ..CheckResult::default() }
}
