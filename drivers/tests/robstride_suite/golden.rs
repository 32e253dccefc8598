//! The codec against frames of independent libraries (`tests/peers/robstride_frames.py` writes them, and checks them in every
//! whole test run).
use std::collections::{BTreeMap, BTreeSet};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::robstride::frames::{Operation, Reply, Request, ranges};
use taustream_drivers::{CanFrame, CanId};

const FRAMES: &str = include_str!("frames.csv");

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap()).collect()
}

fn frame(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').unwrap();
    CanFrame::classic(CanId::extended(u32::from_str_radix(id, 16).unwrap()), &bytes(data))
}

fn numbers<const N: usize>(words: &[&str]) -> [f64; N] {
    std::array::from_fn(|at| words[at].parse().unwrap())
}

fn ranges_of(words: &[&str]) -> MitRanges {
    let [position, velocity, torque, stiffness, damping] = numbers(words);
    ranges([position, velocity, torque], stiffness, damping)
}

/// What we send for a line must be the line's frame, and what we read in that frame the line's values.
fn compare(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split(',').collect();
    let node: u8 = words[1].parse().unwrap();
    let host = |at: usize| words[at].parse::<u8>().unwrap();
    let last = words[words.len() - 1];
    match words[0] {
        "operation" => compare_operation(node, &words),
        "feedback" => compare_feedback(node, &words),
        "state" => compare_state(node, &words),
        "identity" => {
            let number = <[u8; 8]>::try_from(bytes(words[2])).unwrap();
            same(&Reply::decode(&frame(last), node, 0xFD), &Some(Reply::Identity(number)))?;
            same(&Reply::Identity(number).encode(node, 0xFD), &frame(last))
        }
        "value" => compare_value(node, host(2), &words),
        kind => {
            let index = || words[3].parse().unwrap();
            let request = match kind {
                "enable" => Request::Enable,
                "stop" => Request::Stop,
                "get_id" => Request::GetId,
                "read" => Request::Read(index()),
                "write" => Request::Write(index(), bytes(words[4]).try_into().unwrap()),
                unknown => return Err(format!("{unknown} is no case")),
            };
            same(&request.encode(host(2), node), &frame(last))?;
            same(&Request::decode(&frame(last), node), &Some((host(2), request)))
        }
    }
}

fn same<T: PartialEq + std::fmt::Debug>(ours: &T, theirs: &T) -> Result<(), String> {
    if ours == theirs { Ok(()) } else { Err(format!("ours {ours:?}, the library's {theirs:?}")) }
}

/// The library spreads -1 to 1 over 0 to 0xFFFE and truncates where we spread it over 0 to 0xFFFF, as the manual does, and
/// round: its codes are at most two below ours. Gains it spreads as we do.
fn compare_operation(node: u8, words: &[&str]) -> Result<(), String> {
    let [p, v, kp, kd, t] = numbers(&words[7..12]);
    let command = MitCommand {
        position_rad: p,
        velocity_rad_s: v,
        stiffness_nm_rad: kp,
        damping_nm_s_rad: kd,
        torque_nm: t,
    };
    let ours = Operation::encode(&command, &ranges_of(&words[2..7])).unwrap();
    let Some((0, Request::Operation(theirs))) = Request::decode(&frame(words[12]), node) else {
        return Err("no operation to us".to_owned());
    };
    same(
        &Request::decode(&Request::Operation(ours).encode(0xFD, node), node).unwrap().1,
        &Request::Operation(ours),
    )?;
    let codes = |Operation { torque, bytes: [a, b, c, d, e, f, g, h] }| {
        [[a, b], [c, d], [e, f], [g, h]]
            .map(u16::from_be_bytes)
            .into_iter()
            .chain([torque])
            .collect::<Vec<_>>()
    };
    for ((ours, theirs), most) in codes(ours).into_iter().zip(codes(theirs)).zip([2, 2, 1, 1, 2]) {
        if ours.checked_sub(theirs).is_none_or(|above| above > most) {
            return Err(format!("code {ours} is the library's {theirs}"));
        }
    }
    Ok(())
}

/// It spreads 0 to 0xFFFE over -1 to 1: at the upper end that is half a step of ours more.
fn compare_feedback(node: u8, words: &[&str]) -> Result<(), String> {
    let ranges = ranges_of(&words[2..7]);
    let Some(Reply::Feedback(feedback)) = Reply::decode(&frame(words[7]), node, 0xFF) else {
        return Err("no feedback to us".to_owned());
    };
    same(&Reply::Feedback(feedback).encode(node, 0xFF), &frame(words[7]))?;
    let [position, velocity, torque, celsius] = numbers(&words[8..12]);
    let ours = feedback.values(&ranges);
    for (ours, theirs, step) in [
        (ours.position_rad, position, ranges.position.step()),
        (ours.velocity_rad_s, velocity, ranges.velocity.step()),
        (ours.torque_nm, torque, ranges.torque.step()),
        (f64::from(feedback.decicelsius) / 10.0, celsius, 1e-9),
    ] {
        if (ours - theirs).abs() > 1.01 * step {
            return Err(format!("{ours} is the library's {theirs}"));
        }
    }
    Ok(())
}

/// The other library spreads as the manual does: RS02 with +-44 rad/s and +-17 Nm.
fn compare_state(node: u8, words: &[&str]) -> Result<(), String> {
    let Some(Reply::Feedback(feedback)) = Reply::decode(&frame(words[7]), node, 0xFD) else {
        return Err("no feedback to us".to_owned());
    };
    let [faults, theirs @ ..] = numbers::<5>(&words[2..7]);
    let reach = [4.0 * std::f64::consts::PI, 44.0, 17.0];
    let values = feedback.values(&ranges(reach, 500.0, 5.0));
    let celsius = f64::from(feedback.decicelsius) / 10.0;
    let ours = [values.position_rad, values.velocity_rad_s, values.torque_nm, celsius];
    if ours.iter().zip(theirs).any(|(ours, theirs)| (ours - theirs).abs() > 1e-12) {
        return Err(format!("ours {ours:?}, the library's {theirs:?}"));
    }
    same(&f64::from(feedback.faults & 0x1F), &faults)
}

fn compare_value(node: u8, host: u8, words: &[&str]) -> Result<(), String> {
    let wanted: f64 = words[4].parse().unwrap();
    let Some(Reply::Value { index, read: true, value }) = Reply::decode(&frame(words[5]), node, host) else {
        return Err("no value to us".to_owned());
    };
    same(&index, &words[3].parse().unwrap())?;
    same(&Reply::Value { index, read: true, value }.encode(node, host), &frame(words[5]))?;
    let ours = if index == 0x700B {
        f64::from(f32::from_le_bytes(value))
    } else {
        f64::from(u32::from_le_bytes(value))
    };
    same(&ours.to_bits(), &wanted.to_bits())
}

#[test]
fn frames_are_those_of_independent_libraries() {
    let mut kinds = BTreeMap::new();
    for (number, line) in (1..).zip(FRAMES.lines()) {
        compare(line).unwrap_or_else(|difference| panic!("line {number}: {difference}"));
        *kinds.entry(line.split(',').next().unwrap()).or_insert(0) += 1;
    }
    let most = ["operation", "feedback", "state"].iter().all(|kind| kinds[kind] >= 100);
    assert!(most && kinds.len() == 10, "{kinds:?}");
}

/// Every kind of line, corrupted by one digit of its frame, is noticed.
#[test]
fn frame_that_differs_by_one_digit_is_noticed() {
    let mut tried = BTreeSet::new();
    for line in FRAMES.lines() {
        let kind = line.split(',').next().unwrap();
        if !tried.insert(kind) {
            continue;
        }
        // Where the data are empty: the receiver.
        let data = line.find('#').unwrap();
        let at = if matches!(kind, "enable" | "stop" | "get_id") { data - 2 } else { data + 1 };
        let digit = if &line[at..=at] == "A" { "5" } else { "A" };
        let corrupted = format!("{}{digit}{}", &line[..at], &line[at + 1..]);
        assert!(compare(&corrupted).is_err(), "not noticed: {corrupted}");
    }
    assert_eq!(tried.len(), 10);
}
