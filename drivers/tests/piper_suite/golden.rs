//! The codec against frames of the maker's own library (`tests/peers/piper_frames.py` writes them, and checks them in every
//! whole test run).
use std::fmt::Debug;
use taustream_drivers::protocols::piper::frames::{Command, Driver, Limits, Message, Status};
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
    if same { Ok(()) } else { Err(format!("{line}: ours {ours:?}, the library's {theirs:?}")) }
}

/// What we send for a line must be the line's frame, and what we read in that frame the line's values.
fn compare(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split(',').collect();
    let theirs = frame(words[words.len() - 1]);
    let command = match words[0] {
        "targets" => Command::Targets(number(words[1]), [number(words[2]), number(words[3])]),
        "enable" => Command::Enable(number(words[1])),
        "disable" => Command::Disable(number(words[1])),
        "ask" => Command::AskLimits(number(words[1])),
        "zero" => Command::SetZero(number(words[1])),
        "clear" => Command::ClearErrors(number(words[1])),
        "mode" => Command::Mode {
            control: number(words[1]),
            movement: number(words[2]),
            speed_percent: number(words[3]),
            follow: number(words[4]),
        },
        "stop" => Command::Stop,
        "resume" => Command::Resume,
        _ => return compare_message(line, &words, &theirs),
    };
    let (ours, read) = (command.encode(), Command::decode(&theirs));
    agree(line, &ours, &theirs, ours == theirs)?;
    agree(line, &read, &command, read == Some(command))
}

fn compare_message(line: &str, words: &[&str], theirs: &CanFrame) -> Result<(), String> {
    let message = match words[0] {
        "angles" => Message::Angles(number(words[1]), [number(words[2]), number(words[3])]),
        "status" => {
            let [beyond, unreached] = number::<u16>(words[7]).to_be_bytes();
            Message::Status(Status {
                control: number(words[1]),
                arm: number(words[2]),
                movement: number(words[3]),
                teaching: number(words[4]),
                motion: number(words[5]),
                point: number(words[6]),
                beyond,
                unreached,
            })
        }
        "speed" => Message::Speed(number(words[1]), number(words[2]), number(words[3])),
        "driver" => {
            let driver = Driver {
                supply_decivolts: number(words[2]),
                stage_celsius: number(words[3]),
                motor_celsius: number(words[4]),
                status: number(words[5]),
                current_milliamperes: number(words[6]),
            };
            Message::Driver(number(words[1]), driver)
        }
        "limits" => Message::Limits(Limits {
            joint: number(words[1]),
            most_decidegrees: number(words[2]),
            least_decidegrees: number(words[3]),
            speed_mrad_s: number(words[4]),
        }),
        "acknowledge" => Message::Acknowledge(number(words[1]), words[2] == "1"),
        unknown => return Err(format!("{unknown} is no case")),
    };
    let read = Message::decode(theirs);
    agree(line, &read, &message, read == Some(message))?;
    let ours = message.encode();
    // These have bytes that the library does not read.
    let partly = matches!(words[0], "speed" | "limits" | "acknowledge");
    agree(line, &ours, theirs, partly || ours == *theirs)
}

#[test]
fn frames_are_those_of_the_makers_library() {
    let mut kinds = std::collections::BTreeMap::new();
    for (at, line) in (1..).zip(FRAMES.lines()) {
        compare(line).unwrap_or_else(|difference| panic!("line {at}: {difference}"));
        *kinds.entry(line.split(',').next().unwrap()).or_insert(0) += 1;
    }
    let most = ["targets", "angles", "status", "driver", "limits"].iter().all(|kind| kinds[kind] >= 100);
    assert!(most && kinds.len() == 15, "{kinds:?}");
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
        let at = line.find('#').unwrap() + 2;
        let digit = if &line[at..=at] == "A" { "5" } else { "A" };
        let corrupted = format!("{}{digit}{}", &line[..at], &line[at + 1..]);
        assert!(compare(&corrupted).is_err(), "not noticed: {corrupted}");
    }
    assert_eq!(tried.len(), 15);
}
