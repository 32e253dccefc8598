//! The codec against frames of an independent encoder (`tests/peers/odrive_frames.py` writes them, and checks them in every
//! whole test run).
use std::fmt::Debug;
use taustream_drivers::protocols::odrive::frames::{Command, EndpointValue, InputPosition, Message, Version};
use taustream_drivers::{CanFrame, CanId};

const FRAMES: &str = include_str!("frames.csv");

fn frame(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').unwrap();
    let bytes: Vec<u8> =
        (0..data.len() / 2).map(|at| u8::from_str_radix(&data[2 * at..2 * at + 2], 16).unwrap()).collect();
    CanFrame::classic(CanId::standard(u16::from_str_radix(id, 16).unwrap()), &bytes)
}

fn number<T: std::str::FromStr<Err: Debug>>(word: &str) -> T {
    word.parse().unwrap()
}

fn agree(line: &str, ours: &dyn Debug, theirs: &dyn Debug, same: bool) -> Result<(), String> {
    if same { Ok(()) } else { Err(format!("{line}: ours {ours:?}, the encoder's {theirs:?}")) }
}

/// The bytes that both sides use; the encoder fills up to eight.
fn same_used_bytes(ours: &CanFrame, theirs: &CanFrame) -> bool {
    let used = ours.data().len();
    let (own, rest) = theirs.data().split_at(used.min(theirs.data().len()));
    ours.id() == theirs.id() && ours.data() == own && rest.iter().all(|byte| *byte == 0)
}

/// What we send for a line must be the line's frame, and what we read in that frame the line's values.
fn compare(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split(',').collect();
    let node: u8 = number(words[1]);
    let theirs = frame(words[words.len() - 1]);
    let command = match words[0] {
        "position" => Command::Position(InputPosition {
            position_turns: number(words[2]),
            velocity_mturns_s: number(words[3]),
            torque_mnm: number(words[4]),
        }),
        "write" => {
            Command::Write(number(words[2]), EndpointValue::Word(number::<u32>(words[3]).to_le_bytes()))
        }
        "state" => Command::AxisState(number(words[2])),
        "mode" => Command::ControllerMode(number(words[2]), number(words[3])),
        "clear" => Command::ClearErrors,
        "estop" => Command::Estop,
        "absolute" => Command::AbsolutePosition(number(words[2])),
        _ => return compare_message(line, &words, node, &theirs),
    };
    let (ours, read) = (command.encode(node), Command::decode(&theirs, node));
    agree(line, &ours, &theirs, same_used_bytes(&ours, &theirs))?;
    agree(line, &read, &command, read == Some(command))
}

fn compare_message(line: &str, words: &[&str], node: u8, theirs: &CanFrame) -> Result<(), String> {
    let bytes = |from: usize| std::array::from_fn(|at| number(words[from + at]));
    let message = match words[0] {
        "estimates" => {
            Message::Estimates { position_turns: number(words[2]), velocity_turns_s: number(words[3]) }
        }
        "heartbeat" => Message::Heartbeat {
            errors: number(words[2]),
            state: number(words[3]),
            result: number(words[4]),
            done: words[5] == "1",
        },
        "error" => Message::Error { active: number(words[2]), disarmed: number(words[3]) },
        "version" => Message::Version(Version {
            protocol: number(words[2]),
            hardware: bytes(3),
            firmware: bytes(6),
            unreleased: number(words[9]),
        }),
        "endpoint" => Message::Endpoint(
            number(words[2]),
            Some(EndpointValue::Word(number::<u32>(words[3]).to_le_bytes())),
        ),
        unknown => return Err(format!("{unknown} is no case")),
    };
    let read = Message::decode(theirs, node);
    agree(line, &read, &message, read == Some(message))?;
    // A random heartbeat has bits that no drive uses.
    let ours = message.encode(node);
    agree(line, &ours, theirs, words[0] == "heartbeat" || ours == *theirs)
}

#[test]
fn frames_are_those_of_an_independent_encoder() {
    let mut kinds = std::collections::BTreeMap::new();
    for (at, line) in (1..).zip(FRAMES.lines()) {
        compare(line).unwrap_or_else(|difference| panic!("line {at}: {difference}"));
        *kinds.entry(line.split(',').next().unwrap()).or_insert(0) += 1;
    }
    let most =
        ["position", "estimates", "heartbeat", "write", "endpoint"].iter().all(|kind| kinds[kind] >= 100);
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
        let data = line.find('#').unwrap() + 1;
        // A frame without data is known by its identifier, a request to clear errors too; of an endpoint the number.
        let at = match kind {
            "estop" | "clear" => data - 2,
            "endpoint" | "write" => data + 2,
            _ => data,
        };
        let digit = if &line[at..=at] == "A" { "5" } else { "A" };
        let corrupted = format!("{}{digit}{}", &line[..at], &line[at + 1..]);
        assert!(compare(&corrupted).is_err(), "not noticed: {corrupted}");
    }
    assert_eq!(tried.len(), 12);
}
