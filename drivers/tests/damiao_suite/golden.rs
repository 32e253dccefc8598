//! The codec against frames of an independent library (`tests/peers/damiao_frames.py` writes them, and checks them in
//! every whole test run).
use std::fmt::Debug;
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::damiao::frames::{Reply, Request, Special, Wire};
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

fn agree(what: &str, (ours, theirs): (&dyn Debug, &dyn Debug), same: bool) -> Result<(), String> {
    if same { Ok(()) } else { Err(format!("{what}: ours {ours:?}, the library's {theirs:?}")) }
}

/// What we send for a line must be the line's frame, and what we read in that frame the line's values.
fn compare(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split(',').collect();
    let node: u8 = words[1].parse().unwrap();
    if words[0] == "feedback" {
        return compare_feedback(node, &words);
    }
    let theirs = frame(words[words.len() - 1]);
    let request = match words[0] {
        "mit" => {
            let [position, velocity, torque, p, v, kp, kd, t] = numbers(&words[2..10]);
            let command = MitCommand {
                position_rad: p,
                velocity_rad_s: v,
                stiffness_nm_rad: kp,
                damping_nm_s_rad: kd,
                torque_nm: t,
            };
            Request::Mit(command.encode(&MitRanges::symmetric(position, velocity, torque)).unwrap())
        }
        "pos_vel" => {
            #[expect(clippy::cast_possible_truncation, reason = "the frame has this width")]
            let narrow = |word: &str| word.parse::<f64>().unwrap() as f32;
            Request::PosVel { position_rad: narrow(words[2]), velocity_rad_s: narrow(words[3]) }
        }
        "enable" => Request::Special(Special::Enable, 0),
        "disable" => Request::Special(Special::Disable, 0),
        "zero" => Request::Special(Special::SetZero, 0),
        "clear" => Request::Special(Special::ClearError, 0),
        "store" => Request::Store,
        "refresh" => Request::Refresh,
        "read" => Request::Read(words[2].parse().unwrap()),
        "write" => Request::Write(words[2].parse().unwrap(), bytes(words[3]).try_into().unwrap()),
        // Modes that we never send; simulated motors must know them when they see them.
        "other" => {
            let mode = Request::OtherMode(words[2].parse().unwrap());
            let read = Request::decode(&theirs, node);
            return agree(line, (&read, &mode), read == Some(mode));
        }
        unknown => return Err(format!("{unknown} is no case")),
    };
    let ours = request.encode(node, Wire::Classic);
    let read = Request::decode(&theirs, node);
    if let (Request::Mit(ours), Some(Request::Mit(theirs))) = (request, read) {
        return agree(line, (&hex(ours), &hex(theirs)), is_truncated_of(theirs, ours));
    }
    agree(line, (&ours, &theirs), ours == theirs)?;
    agree(line, (&read, &request), read == Some(request))
}

fn hex(bytes: [u8; 8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// The library truncates where we round: each of its five codes is ours, or the one below.
fn is_truncated_of(theirs: [u8; 8], ours: [u8; 8]) -> bool {
    let (theirs, ours) = (u64::from_be_bytes(theirs), u64::from_be_bytes(ours));
    [(48, 0xFFFF), (36, 0xFFF), (24, 0xFFF), (12, 0xFFF), (0, 0xFFF)].into_iter().all(|(shift, mask)| {
        let code = |all: u64| all >> shift & mask;
        code(ours).checked_sub(code(theirs)).is_some_and(|above| above <= 1)
    })
}

fn compare_feedback(node: u8, words: &[&str]) -> Result<(), String> {
    let feedback_id: u16 = words[2].parse().unwrap();
    let [position, velocity, torque] = numbers(&words[3..6]);
    let frame = CanFrame::classic(CanId::standard(feedback_id), &bytes(words[6]));
    let Some(Reply::Feedback(feedback)) = Reply::decode(&frame, node, feedback_id) else {
        return Err(format!("{words:?} is no feedback to us"));
    };
    let values = feedback.values(&MitRanges::symmetric(position, velocity, torque));
    let ours = [
        f64::from(feedback.status),
        values.position_rad,
        values.velocity_rad_s,
        values.torque_nm,
        f64::from(feedback.stage_celsius),
        f64::from(feedback.winding_celsius),
    ];
    let theirs: [f64; 6] = numbers(&words[7..13]);
    let same = ours.iter().zip(theirs).all(|(ours, theirs)| ours.to_bits() == theirs.to_bits());
    agree("feedback", (&ours, &theirs), same)
}

#[test]
fn frames_are_those_of_an_independent_library() {
    let mut kinds = std::collections::BTreeMap::new();
    for (number, line) in (1..).zip(FRAMES.lines()) {
        compare(line).unwrap_or_else(|difference| panic!("line {number}: {difference}"));
        *kinds.entry(line.split(',').next().unwrap()).or_insert(0) += 1;
    }
    let most = ["mit", "pos_vel", "feedback"].iter().all(|kind| kinds[kind] >= 300);
    assert!(most && kinds.len() == 12, "{kinds:?}");
}

/// Every kind of line, corrupted by one digit of its frame, is noticed.
#[test]
fn frame_that_differs_by_one_digit_is_noticed() {
    let mut tried = std::collections::BTreeSet::new();
    for line in FRAMES.lines() {
        let kind = line.split(',').next().unwrap();
        if !tried.insert(kind) {
            continue;
        }
        // Of a feedback the status, else the first digit of the frame's data; of an unused mode its identifier.
        let at = match kind {
            "feedback" => line.match_indices(',').nth(5).unwrap().0 + 1,
            "other" => line.find('#').unwrap() - 3,
            _ => line.find('#').unwrap() + 1,
        };
        let digit = match (kind, &line[at..=at]) {
            ("other", _) => "1",
            (_, "A") => "5",
            _ => "A",
        };
        let corrupted = format!("{}{digit}{}", &line[..at], &line[at + 1..]);
        assert!(compare(&corrupted).is_err(), "not noticed: {corrupted}");
    }
    assert_eq!(tried.len(), 12);
}
