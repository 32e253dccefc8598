//! The checker of a recording of motors of any protocol: was every setpoint on the bus the one that the log claims?
//!
//! It shares no packing with the product: bits are taken from the bytes by their printed places. The log says for each cycle
//! and joint whether a setpoint was handed to the bus, so the setpoints of a joint on the bus are those of the log, in order.
//! A command without gains moves nothing: such ones may lie between (some motors can only be asked by one).
use crate::cycle_log::{Event, LoggedCycle};
use crate::mit_setpoints::LogEnds;
use crate::on_path::PathCheck;
use crate::setpoints::{BusFrame, CheckResult, Flaw};
use std::f64::consts::{PI, TAU};
use taustream_arm::protocol::odrive::Odrive;
use taustream_arm::{CubeMars, MyActuator, MyActuatorMode, RobStride, Servo, Settings};

/// Flag of a 29-bit identifier.
const EXTENDED: u32 = 0x8000_0000;
/// Room for the sums of a check in doubles.
const ROOM_RAD: f64 = 1e-9;

/// What a frame commands a joint.
#[derive(Clone, Copy, Debug)]
struct Commanded {
    position_rad: f64,
    /// Half a step of the code.
    half_rad: f64,
    /// It moves the joint.
    holds: bool,
}

/// A number of 0 to 2^16 - 1 in minus to plus a reach, with half its step.
fn spanned(high: u8, low: u8, reach: f64) -> [f64; 2] {
    let step = 2.0 * reach / 65_535.0;
    [-reach + step * f64::from(u16::from_be_bytes([high, low])), 0.5 * step]
}

/// Position in motor units and half a step, and whether it moves the joint; none when a frame commands this servo nothing.
fn of_motor(servo: &Servo, frame: &BusFrame) -> Option<([f64; 2], bool)> {
    let node = u32::from(servo.node_id);
    let data: [u8; 8] = frame.data.as_slice().try_into().ok()?;
    // kp of the packed commands: four bits of the fourth byte and the fifth.
    let stiff = data[3] & 0xF != 0 || data[4] != 0;
    if let Some(own) = servo.protocol.get::<MyActuator>() {
        return match own.mode {
            MyActuatorMode::Motion(_, ranges) if frame.id == 0x400 + node => {
                Some((spanned(data[0], data[1], ranges.position_rad), stiff))
            }
            MyActuatorMode::Position if frame.id == 0x140 + node && data[0] == 0xA4 => {
                let step = 0.01 * PI / 180.0;
                let angle = i32::from_le_bytes([data[4], data[5], data[6], data[7]]);
                Some(([f64::from(angle) * step, 0.5 * step], true))
            }
            MyActuatorMode::Motion(..) | MyActuatorMode::Position => None,
        };
    }
    if let Some(own) = servo.protocol.get::<CubeMars>() {
        let special = data[..7].iter().all(|byte| *byte == 0xFF);
        // Its own answer has its number in the first byte, under the same identifier.
        let answer = u32::from(own.feedback_id) == node && u32::from(data[0]) == node;
        let is_command = frame.id == node && !special && !answer;
        return is_command.then(|| (spanned(data[0], data[1], own.ranges.position_rad), stiff));
    }
    if let Some(own) = servo.protocol.get::<RobStride>() {
        let is_command = frame.id & EXTENDED != 0 && frame.id >> 24 & 0x1F == 1 && frame.id & 0xFF == node;
        let stiff = data[4] != 0 || data[5] != 0;
        return is_command.then(|| (spanned(data[0], data[1], own.ranges.position_rad), stiff));
    }
    if let Some(own) = servo.protocol.get::<Odrive>() {
        let turns = f32::from_le_bytes([data[0], data[1], data[2], data[3]]);
        let scale = TAU / own.gear_ratio;
        let half = 0.5 * f64::from(turns.abs().max(1.0)) * f64::from(f32::EPSILON);
        return (frame.id == node << 5 | 0x0C).then(|| ([f64::from(turns) * scale, half * scale], true));
    }
    if servo.protocol.name() == "piper" {
        let pair = (node - 1) / 2;
        let at = if node % 2 == 1 { 0 } else { 4 };
        let angle = i32::from_be_bytes([data[at], data[at + 1], data[at + 2], data[at + 3]]);
        let step = 0.001 * PI / 180.0;
        return (frame.id == 0x155 + pair).then(|| ([f64::from(angle) * step, 0.5 * step], true));
    }
    None
}

fn commanded(servo: &Servo, frame: &BusFrame) -> Option<Commanded> {
    let ([motor_rad, half_rad], holds) = of_motor(servo, frame)?;
    let position_rad = motor_rad * servo.sign + servo.zero_offset_rad;
    Some(Commanded { position_rad, half_rad, holds })
}

/// Checks the recording of an arm with one bus that began before the streamer's first frame.
///
/// # Errors
/// The first flaw.
pub fn check(
    frames: &[BusFrame],
    log: &[Event],
    settings: &Settings,
    ends: LogEnds,
) -> Result<CheckResult, Flaw> {
    let mut check_result = CheckResult { frames: frames.len(), ..CheckResult::default() };
    let mut path = PathCheck::default();
    let mut cycles: Vec<&LoggedCycle> = Vec::new();
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
                check_result.on_trajectory += path.compare(cycle)?;
                cycles.push(cycle);
            }
        }
    }
    check_result.syncs = cycles.len();
    for servo in &settings.servos {
        let on_bus: Vec<Commanded> = frames.iter().filter_map(|frame| commanded(servo, frame)).collect();
        check_result.setpoints += compare_joint(servo.joint, &on_bus, &cycles, ends)?;
    }
    check_result.last_setpoint_rad =
        cycles.last().map(|cycle| cycle.position_rad.clone()).unwrap_or_default();
    Ok(check_result)
}

/// The setpoints of one joint, in order; how many were compared.
fn compare_joint(
    joint: usize,
    on_bus: &[Commanded],
    cycles: &[&LoggedCycle],
    ends: LogEnds,
) -> Result<usize, Flaw> {
    let mut rest = on_bus.iter();
    let mut compared = 0;
    // A command without gains, which no cycle sent, may stand for the one that a cycle sent right behind it to the same place.
    let (mut stood_for, mut last_rad) = (0_usize, f64::NAN);
    let sent = |cycle: &&&LoggedCycle| cycle.slot(joint).is_some_and(|(_, sent)| sent);
    for cycle in cycles.iter().filter(sent) {
        let flaw = |what: String| Flaw::Bus { sync: 0, tick: cycle.tick, what };
        let wanted_rad = cycle.slot(joint).map_or(f64::NAN, |(wanted_rad, _)| wanted_rad);
        let is_at =
            |command: &Commanded, rad: f64| (command.position_rad - rad).abs() <= command.half_rad + ROOM_RAD;
        let found = rest.by_ref().find(|command| {
            let agrees = is_at(command, wanted_rad);
            let is_behind = stood_for > 0 && command.holds && !agrees && is_at(command, last_rad);
            stood_for -= usize::from(is_behind);
            !is_behind && (command.holds || agrees)
        });
        match found {
            Some(command) if is_at(command, wanted_rad) => {
                stood_for += usize::from(!command.holds);
                (compared, last_rad) = (compared + 1, wanted_rad);
            }
            Some(command) => {
                let sent_rad = command.position_rad;
                return Err(flaw(format!(
                    "joint {} was sent to {sent_rad} rad, the log says {wanted_rad} rad",
                    joint + 1
                )));
            }
            None => return Err(flaw(format!("the setpoint of joint {} is not on the bus", joint + 1))),
        }
    }
    let unknown = rest.filter(|command| command.holds).count();
    if unknown > stood_for && ends == LogEnds::WithTheStreamer {
        let joint = joint + 1;
        return Err(Flaw::Log(format!(
            "joint {joint} was commanded {unknown} times that the log does not know"
        )));
    }
    Ok(compared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn cycle(tick: u64, position_rad: f64) -> Event {
        let line = format!(
            "{{\"event\":\"cycle\",\"tick\":{tick},\"time_ns\":0,\"sync\":[0],\"frames\":[1],\"phase\":\"holding\",\"trajectory_id\":0,\
             \"s\":0.0,\"sigma\":0.0,\"position_rad\":[{position_rad},0,0,0,0,0],\"off_path_rad\":[0,0,0,0,0,0],\
             \"joint_sent\":[true,false,false,false,false,false],\"sent\":[1],\"lost\":[0]}}"
        );
        serde_json::from_str(&line).unwrap()
    }

    /// Motion mode of motor 1, which spans 12.5 rad, at half the stiffness.
    fn frame(code: u16) -> BusFrame {
        let [high, low] = code.to_be_bytes();
        BusFrame { id: 0x401, data: vec![high, low, 0x80, 0x08, 0, 0, 0, 0] }
    }

    #[test]
    fn commands_that_the_log_does_not_claim_are_flaws_and_those_that_it_claims_are_counted() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings/rmd6.toml");
        let settings = Settings::load(&file).unwrap();
        let step_rad = 25.0 / 65_535.0;
        let log = [cycle(1, -12.5 + 40_000.0 * step_rad), cycle(2, -12.5 + 40_010.4 * step_rad)];
        let check = |frames: &[BusFrame]| check(frames, &log, &settings, LogEnds::WithTheStreamer);
        let good = [frame(40_000), frame(40_010)];
        assert_eq!(check(&good).unwrap().setpoints, 2);
        let without_gains = BusFrame { data: vec![0, 0, 0x80, 0, 0, 0, 0, 0], ..frame(0) };
        assert_eq!(check(&[good[0].clone(), without_gains, good[1].clone()]).unwrap().setpoints, 2);
        for (bad, words) in [
            (vec![frame(40_000), frame(40_011)], "the log says"),
            (vec![frame(40_000)], "is not on the bus"),
            (vec![frame(40_010), frame(40_000)], "the log says"),
            (vec![frame(40_000), frame(40_010), frame(40_010)], "does not know"),
        ] {
            let flaw = check(&bad).unwrap_err().to_string();
            assert!(flaw.contains(words), "{flaw}");
        }
    }
}
