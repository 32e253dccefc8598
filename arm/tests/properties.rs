//! Properties over random input: no text makes a reader panic, and what is written is read back bit for bit.
mod common;
use common::{Reader, edited, faults_of};
use proptest::prelude::{Strategy, any, prop, prop_assert, prop_assert_eq, proptest};
use proptest::test_runner::Config;
use std::path::Path;
use taustream_arm::TrajectoryFile;
use taustream_motion::stroke::{DURATION_S_MIN, END_S_MAX};
use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};

const READERS: [Reader; 8] = [
    Reader::Robot,
    Reader::Scene,
    Reader::Settings,
    Reader::Damiao,
    Reader::Gripper,
    Reader::RobStride,
    Reader::CubeMars,
    Reader::Trajectory,
];

/// Pieces that hostile files are made of.
const PIECES: [&str; 28] = [
    "nan",
    "-inf",
    "1e400",
    "99999999999999999999",
    "-0.0",
    "\"",
    "'''",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    ",",
    "\n",
    "\\u0000",
    "\u{202e}",
    "[[joint]]\n",
    "[[box]]\n",
    "dh = 1\n",
    "null",
    "true",
    "0x7f",
    "1979-05-27T07:32:00Z",
    "[[[[[[[[",
    "\"a\":",
    "-",
    "1e-320",
    "#",
];

/// One change of a text: cut a stretch out, and put a piece or a copy of another stretch there.
#[derive(Clone, Debug)]
struct Mutation {
    at: usize,
    cut: usize,
    piece: Option<usize>,
    copy: (usize, usize),
}

fn mutation() -> impl Strategy<Value = Mutation> {
    let piece = prop::option::of(0..PIECES.len());
    (any::<usize>(), 0..40_usize, piece, (any::<usize>(), 0..200_usize))
        .prop_map(|(at, cut, piece, copy)| Mutation { at, cut, piece, copy })
}

fn mutated(text: &str, mutations: &[Mutation]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for mutation in mutations {
        let at = mutation.at % (chars.len() + 1);
        let from = mutation.copy.0 % (chars.len() + 1);
        let put: Vec<char> = match mutation.piece {
            Some(piece) => PIECES[piece].chars().collect(),
            None => chars.iter().skip(from).take(mutation.copy.1).copied().collect(),
        };
        let end = (at + mutation.cut).min(chars.len());
        chars.splice(at..end, put);
    }
    chars.into_iter().collect()
}

/// Numbers of every magnitude that the format takes, and the awkward ones.
fn angle() -> impl Strategy<Value = f64> {
    let awkward = prop::sample::select(vec![
        0.0,
        -0.0,
        5e-324,
        -2.2e-308,
        0.1,
        1.0 / 3.0,
        1000.0,
        -1e-7,
        999.999_999_999_999_9,
    ]);
    prop::strategy::Union::new([(-1000.0..1000.0).boxed(), (-1e-3..1e-3).boxed(), awkward.boxed()])
}

fn stroke() -> impl Strategy<Value = Stroke> {
    let delta_rad = prop::array::uniform16(angle());
    (0.0..END_S_MAX / 2.0, DURATION_S_MIN..END_S_MAX / 2.0, 4_u32..=64, delta_rad)
        .prop_map(|(start_s, duration_s, n, delta_rad)| Stroke { start_s, duration_s, n, delta_rad })
}

/// A trajectory of the given numbers, with the slots beyond the joints at zero.
#[expect(clippy::expect_used, reason = "a helper of tests fails by panicking")]
fn trajectory(joints: usize, mut base_rad: [f64; MAX_JOINTS], mut strokes: Vec<Stroke>) -> Trajectory {
    base_rad[joints..].fill(0.0);
    for stroke in &mut strokes {
        stroke.delta_rad[joints..].fill(0.0);
    }
    strokes.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    Trajectory::new(joints, base_rad, &strokes).expect("sound by construction")
}

fn bits(trajectory: &Trajectory) -> Vec<u64> {
    let mut numbers = trajectory.base_rad().to_vec();
    for stroke in trajectory.strokes() {
        numbers.extend([stroke.start_s, stroke.duration_s, f64::from(stroke.n)]);
        numbers.extend(stroke.delta_rad);
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

proptest! {
    #![proptest_config(Config { cases: 1000, failure_persistence: None, ..Config::default() })]

    #[test]
    fn mutated_file_of_any_kind_never_panics(reader in prop::sample::select(READERS.to_vec()), mutations in prop::collection::vec(mutation(), 1..6)) {
        let text = mutated(&reader.good_text(), &mutations);
        if let Err(faults) = reader.read(&text) {
            prop_assert!(!faults.0.is_empty());
            for fault in &faults.0 {
                let shown = fault.to_string();
                prop_assert!(shown.len() < 2000 && !shown.chars().any(char::is_control), "{shown:?}");
            }
        }
    }

    #[test]
    fn random_text_never_panics(reader in prop::sample::select(READERS.to_vec()), text in "\\PC{0,200}") {
        let _ = reader.read(&text);
    }

    #[test]
    fn trajectory_file_written_and_read_keeps_every_bit(
        joints in 1..=MAX_JOINTS,
        base_rad in prop::array::uniform16(angle()),
        strokes in prop::collection::vec(stroke(), 0..20),
        digest in prop::option::of("[0-9a-f]{64}"),
    ) {
        let file = TrajectoryFile { robot: "ur5".to_owned(), digest, kinds: Default::default(), trajectory: trajectory(joints, base_rad, strokes) };
        let read = TrajectoryFile::from_json(Path::new("t.json"), &file.to_json());
        prop_assert_eq!(read.as_ref().map(|read| bits(&read.trajectory)), Ok(bits(&file.trajectory)));
        prop_assert_eq!(read, Ok(file));
    }
}

/// The comparison above is worth nothing if it cannot see one bit.
#[test]
fn bit_comparison_sees_the_sign_of_zero_and_the_last_bit() {
    let file = |text: &str| bits(&TrajectoryFile::from_json(Path::new("t.json"), text).unwrap().trajectory);
    let text = Reader::Trajectory.good_text();
    for (from, to) in [("[0.0,", "[-0.0,"), ("[0.5,", "[0.5000000000000001,"), ("\"n\":10", "\"n\":11")] {
        assert_ne!(file(&text), file(&edited(&text, from, to)), "{from} -> {to}");
    }
}

#[test]
fn deeply_nested_file_is_refused_and_does_not_overflow() {
    for reader in READERS {
        let open = if reader == Reader::Trajectory { "{\"a\":[" } else { "a = [" };
        let faults = faults_of(reader, &format!("{open}{}", "[".repeat(100_000)));
        assert!(faults.to_string().len() < 1000, "{faults}");
    }
}
