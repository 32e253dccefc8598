//! The checker of MIT recordings is itself checked: a faithful recording passes, and every corrupted one fails for its fault.
//! The frames are packed here by shifting, independently of the product and of the checker.
#![expect(clippy::expect_used, reason = "helpers of tests fail by panicking")]
use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};
use taustream_tests::cycle_log::{Event, LoggedCycle};
use taustream_tests::mit_setpoints::{LogEnds, MotorEncoding, check_setpoints};
use taustream_tests::setpoints::{BusFrame, Flaw};

const MOTORS: usize = 3;
const CYCLES: u32 = 400;
const PERIOD_S: f64 = 1e-3;
const REACH: [f64; 2] = [12.5, 30.0];
const GAINS: [f64; 2] = [200.0, 2.0];

fn motors() -> Vec<MotorEncoding> {
    (0..3_u8)
        .map(|joint| MotorEncoding {
            joint: usize::from(joint),
            node_id: joint + 1,
            feedback_id: 0x11 + u16::from(joint),
            sign: if joint == 1 { -1.0 } else { 1.0 },
            zero_rad: 0.1 * f64::from(joint),
            reach: REACH,
            gains: GAINS,
        })
        .collect()
}

fn moves() -> Trajectory {
    let mut delta_rad = [0.0; MAX_JOINTS];
    delta_rad[..MOTORS].copy_from_slice(&[0.4, -0.3, 0.2]);
    let stroke = Stroke { start_s: 0.0, duration_s: 0.35, n: 5, delta_rad };
    Trajectory::new(MOTORS, [0.0; MAX_JOINTS], &[stroke]).expect("a plain trajectory")
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the values lie inside their ranges"
)]
fn code(value: f64, low: f64, high: f64, bits: u32) -> u64 {
    let top = 2_f64.powi(i32::try_from(bits).expect("few bits")) - 1.0;
    ((value - low) * top / (high - low)).round() as u64
}

fn packed(position: f64, velocity: f64, gains: [f64; 2]) -> Vec<u8> {
    let all = code(position, -REACH[0], REACH[0], 16) << 48
        | code(velocity, -REACH[1], REACH[1], 12) << 36
        | code(gains[0], 0.0, 500.0, 12) << 24
        | code(gains[1], 0.0, 5.0, 12) << 12
        | 0x7FF;
    all.to_be_bytes().to_vec()
}

/// A faithful recording: a look at each motor, then commands, each answered.
fn recording() -> (Vec<BusFrame>, Vec<Event>) {
    let trajectory = moves();
    let strokes = trajectory.strokes().iter().map(|s| {
        serde_json::json!({ "start_s": s.start_s, "duration_s": s.duration_s, "n": s.n, "delta_rad": s.delta_rad[..MOTORS] })
    });
    let file = serde_json::json!({
        "version": 1, "robot": "arm", "joints": MOTORS, "base_rad": trajectory.base_rad()[..MOTORS],
        "strokes": strokes.collect::<Vec<_>>(),
    });
    let mut log = vec![Event::Trajectory {
        tick: 1,
        trajectory_id: 5,
        generation: 1,
        file,
        start_offset_rad: Vec::new(),
        cut: None,
    }];
    let mut frames: Vec<BusFrame> =
        (1..=3).map(|node| BusFrame { id: 0x7FF, data: vec![node, 0, 0xCC, 0, 0, 0, 0, 0] }).collect();
    for tick in 1..=CYCLES {
        let s = f64::from(tick) * PERIOD_S;
        let sample = trajectory.sample(s);
        for m in motors() {
            let position = (sample.position_rad[m.joint] - m.zero_rad) * m.sign;
            let data = packed(position, sample.velocity_rad_s[m.joint] * m.sign, GAINS);
            let answer = [&[0x10 | m.node_id], &data[..7]].concat();
            frames.push(BusFrame { id: u32::from(m.node_id), data });
            frames.push(BusFrame { id: u32::from(m.feedback_id), data: answer });
        }
        log.push(Event::Cycle(LoggedCycle {
            tick: u64::from(tick),
            time_ns: u64::from(tick) * 1_000_000,
            sync: vec![0],
            frames: vec![3 + 3 * u64::from(tick)],
            phase: if s < 0.35 { "moving" } else { "holding" }.into(),
            trajectory_id: 5,
            s,
            sigma: 1.0,
            position_rad: sample.position_rad[..MOTORS].to_vec(),
            off_path_rad: vec![0.0; MOTORS],
            joint_sent: vec![true; MOTORS],
            sent: vec![3],
            lost: vec![0],
            axes: Vec::new(),
        }));
    }
    (frames, log)
}

fn check_mode(frames: &[BusFrame], log: &[Event]) -> Result<taustream_tests::setpoints::CheckResult, Flaw> {
    check_setpoints((frames, log), 0, (&motors(), PERIOD_S), LogEnds::WithTheStreamer)
}

/// The place of the command to a motor in a cycle.
fn place(frames: &[BusFrame], cycle: usize, node: u32) -> usize {
    let of_node = frames.iter().enumerate().filter(|(_, frame)| frame.id == node);
    of_node.map(|(at, _)| at).nth(cycle - 1).expect("the command")
}

#[test]
fn faithful_recording_passes_and_everything_was_compared() {
    let (frames, log) = recording();
    let check_result = check_mode(&frames, &log).expect("nothing is wrong with it");
    assert_eq!((check_result.syncs, check_result.setpoints), (400, 1200));
    assert!(check_result.on_trajectory >= 340 * MOTORS && check_result.trajectories == 1);
    for (measured, end) in check_result.last_measured_rad.iter().zip(moves().end_rad()) {
        assert!((measured - end).abs() < 4e-4, "{measured} and {end}");
    }
}

/// Each: what is corrupted in the frame of motor 2 in cycle 200, and words of the flaw.
#[test]
fn command_with_any_field_corrupted_fails() {
    type Doctor = fn(&mut Vec<u8>);
    let corrupted: [(Doctor, &str); 6] = [
        (|data| data[1] = data[1].wrapping_add(1), "was sent to"),
        (|data| data[0] ^= 0x01, "was sent to"),
        (|data| data[2] ^= 0x08, "rad/s"),
        (|data| data[4] ^= 0x40, "has the gains"),
        (|data| data[5] ^= 0x10, "has the gains"),
        (|data| data.truncate(7), "is not commanded while moving"),
    ];
    for (doctor, words) in corrupted {
        let (mut frames, log) = recording();
        let at = place(&frames, 200, 2);
        doctor(&mut frames[at].data);
        let flaw = check_mode(&frames, &log).expect_err(words).to_string();
        assert!(flaw.contains(words) && flaw.contains("tick 200"), "{words}: {flaw}");
    }
}

#[test]
fn frames_too_few_too_many_or_of_nobody_fail() {
    let (mut frames, log) = recording();
    frames.remove(place(&frames, 250, 3));
    check_mode(&frames, &log).expect_err("a frame is missing");

    let (mut frames, log) = recording();
    let twice = frames[place(&frames, 100, 1)].clone();
    frames.insert(place(&frames, 100, 1), twice);
    check_mode(&frames, &log).expect_err("a frame came twice");

    let (mut frames, log) = recording();
    let stray = frames[place(&frames, 100, 1)].clone();
    frames.push(stray.clone());
    let flaw = check_mode(&frames, &log).expect_err("a command after the end").to_string();
    assert!(flaw.contains("the log does not know"), "{flaw}");
    // A streamer that was killed has sent what it did not write down; what it did write is checked.
    check_setpoints((&frames, &log), 0, (&motors(), PERIOD_S), LogEnds::Early)
        .expect("the tail is not checked");
    let at = place(&frames, 300, 1);
    frames[at].data[1] ^= 0x10;
    check_setpoints((&frames, &log), 0, (&motors(), PERIOD_S), LogEnds::Early).expect_err("the rest is");
}
