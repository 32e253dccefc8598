//! The codec against frames of an independent library (`tests/peers/cubemars_frames.py` writes them, and checks them in every
//! whole test run).
use std::collections::{BTreeMap, BTreeSet};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::cubemars::frames::{Feedback, Request, Special};
use taustream_drivers::{CanFrame, CanId};

const FRAMES: &str = include_str!("frames.csv");

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|at| u8::from_str_radix(&hex[2 * at..2 * at + 2], 16).unwrap()).collect()
}

fn frame(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').unwrap();
    CanFrame::classic(CanId::standard(u16::from_str_radix(id, 16).unwrap()), &bytes(data))
}

fn numbers<const N: usize>(words: &[&str]) -> [f64; N] {
    std::array::from_fn(|at| words[at].parse().unwrap())
}

/// What we send for a line must be the line's frame, and what we read in that frame the line's values.
fn compare(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split(',').collect();
    let node: u8 = words[1].parse().unwrap();
    let special = match words[0] {
        "mit" => return compare_mit(node, &words),
        "feedback" => return compare_feedback(node, &words),
        "enter" => Special::Enter,
        "exit" => Special::Exit,
        "zero" => Special::SetZero,
        unknown => return Err(format!("{unknown} is no case")),
    };
    let (ours, theirs) = (Request::Special(special).encode(node), frame(words[2]));
    let read = Request::decode(&theirs, node);
    if ours == theirs && read == Some(Request::Special(special)) {
        Ok(())
    } else {
        Err(format!("{theirs:?}"))
    }
}

/// The library truncates where we round: each of its five codes is ours, or the one below.
fn compare_mit(node: u8, words: &[&str]) -> Result<(), String> {
    let [position, velocity, torque, p, v, kp, kd, t] = numbers(&words[2..10]);
    let command = MitCommand {
        position_rad: p,
        velocity_rad_s: v,
        stiffness_nm_rad: kp,
        damping_nm_s_rad: kd,
        torque_nm: t,
    };
    let ours = command.encode(&MitRanges::symmetric(position, velocity, torque)).unwrap();
    let Some(Request::Mit(theirs)) = Request::decode(&frame(words[10]), node) else {
        return Err("no command to us".to_owned());
    };
    let (ours, theirs) = (u64::from_be_bytes(ours), u64::from_be_bytes(theirs));
    for (shift, mask) in [(48, 0xFFFF), (36, 0xFFF), (24, 0xFFF), (12, 0xFFF), (0, 0xFFF)] {
        let code = |all: u64| all >> shift & mask;
        if code(ours).checked_sub(code(theirs)).is_none_or(|above| above > 1) {
            return Err(format!("ours {ours:016X}, the library's {theirs:016X}"));
        }
    }
    Ok(())
}

fn compare_feedback(node: u8, words: &[&str]) -> Result<(), String> {
    let [position, velocity, torque] = numbers(&words[2..5]);
    let theirs = CanFrame::classic(CanId::standard(0), &bytes(words[5]));
    let feedback = Feedback::decode(&theirs, node, 0).ok_or("no feedback to us")?;
    if feedback.encode(node, 0) != theirs {
        return Err(format!("{feedback:?}"));
    }
    let values = feedback.values(&MitRanges::symmetric(position, velocity, torque));
    let ours = [values.position_rad, values.velocity_rad_s, values.torque_nm];
    let library: [f64; 3] = numbers(&words[6..9]);
    let near = ours.iter().zip(library).all(|(ours, theirs)| (ours - theirs).abs() < 1e-12);
    if near { Ok(()) } else { Err(format!("ours {ours:?}, the library's {library:?}")) }
}

#[test]
fn frames_are_those_of_an_independent_library() {
    let mut kinds = BTreeMap::new();
    for (number, line) in (1..).zip(FRAMES.lines()) {
        compare(line).unwrap_or_else(|difference| panic!("line {number}: {difference}"));
        *kinds.entry(line.split(',').next().unwrap()).or_insert(0) += 1;
    }
    assert!(kinds["mit"] >= 300 && kinds["feedback"] >= 300 && kinds.len() == 5, "{kinds:?}");
}

/// The manual's own example spreads a range over 2^N codes where everything that reads them takes 2^N - 1: at most one step
/// from ours, and beyond the last code at the end of the range, which is why ours does not.
#[test]
fn manual_s_packing_differs_by_one_step_at_most() {
    let ranges = MitRanges::symmetric(12.5, 50.0, 18.0);
    for at in 0..=100_000_u32 {
        let position_rad = 25.0 * f64::from(at) / 100_000.0 - 12.5;
        #[expect(clippy::cast_possible_truncation, reason = "as the manual does")]
        let manual = ((position_rad + 12.5) * (65_536.0 / 25.0)) as i32;
        let off = manual - i32::from(ranges.position.encode(position_rad).unwrap());
        assert!((-1..=1).contains(&off), "{position_rad}: {off} steps");
    }
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
        // Of a feedback the high digit of its angle, else the first digit of the frame's data.
        let at = match kind {
            "feedback" => line.match_indices(',').nth(4).unwrap().0 + 3,
            _ => line.find('#').unwrap() + 1,
        };
        let digit = if &line[at..=at] == "A" { "5" } else { "A" };
        let corrupted = format!("{}{digit}{}", &line[..at], &line[at + 1..]);
        assert!(compare(&corrupted).is_err(), "not noticed: {corrupted}");
    }
    assert_eq!(tried.len(), 5);
}
