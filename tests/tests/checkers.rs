//! The checker of recordings is itself checked: a faithful recording passes, and every corrupted one fails for its fault.
#![expect(clippy::expect_used, clippy::panic, reason = "helpers of tests fail by panicking")]
use std::f64::consts::TAU;
use taustream_motion::{MAX_JOINTS, Stroke, Trajectory};
use taustream_tests::cycle_log::{Event, LoggedCycle, parse};
use taustream_tests::setpoints::{BusFrame, Encoding, Flaw, Losses, check_setpoints, check_setpoints_with};

const JOINTS: usize = 6;
const CYCLES: u32 = 400;
const PERIOD_S: f64 = 1e-3;

fn encodings() -> Vec<Encoding> {
    (0..6_u8)
        .map(|joint| Encoding {
            joint: usize::from(joint),
            node_id: joint + 1,
            counts_per_rad: if joint % 2 == 0 { 1.0 } else { -1.0 } * 100.0 * 4096.0 / TAU,
            zero_rad: 0.01 * f64::from(joint),
        })
        .collect()
}

fn moves() -> Trajectory {
    let mut delta_rad = [0.0; MAX_JOINTS];
    for (delta, joint) in delta_rad.iter_mut().take(JOINTS).zip(0_u8..) {
        *delta = 0.4 - 0.15 * f64::from(joint);
    }
    let strokes = [
        Stroke { start_s: 0.0, duration_s: 0.3, n: 5, delta_rad },
        Stroke { start_s: 0.1, duration_s: 0.25, n: 10, delta_rad: delta_rad.map(|d| -0.5 * d) },
    ];
    let mut base_rad = [0.0; MAX_JOINTS];
    base_rad[1] = -1.57;
    Trajectory::new(JOINTS, base_rad, &strokes).expect("a plain trajectory")
}

fn file(trajectory: &Trajectory) -> serde_json::Value {
    let strokes: Vec<serde_json::Value> = trajectory
        .strokes()
        .iter()
        .map(|s| {
            serde_json::json!({
                "start_s": s.start_s, "duration_s": s.duration_s, "n": s.n, "delta_rad": s.delta_rad[..JOINTS],
            })
        })
        .collect();
    serde_json::json!({
        "version": 1, "robot": "ur5", "joints": JOINTS,
        "base_rad": trajectory.base_rad()[..JOINTS], "strokes": strokes,
    })
}

/// A faithful recording: what a streamer without a fault leaves on the bus and in its log.
fn recording() -> (Vec<BusFrame>, Vec<Event>) {
    let trajectory = moves();
    let mut frames = Vec::new();
    let mut log = vec![
        Event::Start { format: 1, robot: "ur5".into(), digest: "00".into(), joints: JOINTS, period_us: 1000 },
        Event::Trajectory {
            tick: 1,
            trajectory_id: 5,
            generation: 1,
            file: file(&trajectory),
            start_offset_rad: Vec::new(),
            cut: None,
        },
    ];
    for tick in 1..=CYCLES {
        let s = f64::from(tick) * PERIOD_S;
        let position_rad = trajectory.sample(s).position_rad[..JOINTS].to_vec();
        frames.push(BusFrame { id: 0x080, data: Vec::new() });
        for e in encodings() {
            let mut data = vec![0x0F, 0x00];
            data.extend(e.counts(position_rad[e.joint]).to_le_bytes());
            frames.push(BusFrame { id: 0x200 + u32::from(e.node_id), data });
        }
        for e in encodings() {
            let mut data = vec![0x37, 0x12];
            data.extend(e.counts(position_rad[e.joint]).to_le_bytes());
            frames.push(BusFrame { id: 0x180 + u32::from(e.node_id), data });
        }
        log.push(Event::Cycle(LoggedCycle {
            tick: u64::from(tick),
            time_ns: u64::from(tick) * 1_000_000,
            sync: vec![u64::from(tick)],
            frames: vec![7 * u64::from(tick)],
            phase: if s < 0.35 { "moving" } else { "holding" }.into(),
            trajectory_id: 5,
            s,
            sigma: 1.0,
            position_rad,
            off_path_rad: vec![0.0; JOINTS],
            joint_sent: vec![true; JOINTS],
            sent: vec![7],
            lost: vec![0],
            axes: Vec::new(),
        }));
    }
    (frames, log)
}

/// The place of the RPDO of `node` after the SYNC of number `sync`.
fn place(frames: &[BusFrame], sync: usize, node: u8) -> usize {
    let mut seen = 0;
    for (at, frame) in frames.iter().enumerate() {
        seen += usize::from(frame.id == 0x080);
        if seen == sync && frame.id == 0x200 + u32::from(node) {
            return at;
        }
    }
    panic!("no setpoint of node {node} after SYNC {sync}");
}

fn nth_cycle(log: &mut [Event], n: usize) -> &mut LoggedCycle {
    let mut cycles = log.iter_mut().filter_map(|e| if let Event::Cycle(c) = e { Some(c) } else { None });
    cycles.nth(n).expect("the cycle")
}

#[test]
fn faithful_recording_passes_and_everything_was_compared() {
    let (frames, log) = recording();
    let check_result = check_setpoints(&frames, &log, 0, &encodings()).expect("nothing is wrong with it");
    assert_eq!(check_result.syncs, 400);
    assert_eq!(check_result.frames, 400 * 13);
    assert_eq!(check_result.setpoints, 400 * JOINTS);
    assert!(check_result.on_trajectory >= 349 * JOINTS);
    assert_eq!(check_result.trajectories, 1);
    let end = moves().end_rad();
    for (joint, measured) in check_result.last_measured_rad.iter().enumerate() {
        assert!((measured - end[joint]).abs() < 2.0 * TAU / 409_600.0, "joint {joint}: {measured}");
    }
}

#[test]
fn frame_off_by_two_counts_fails() {
    for (sync, node) in [(1, 1), (200, 4), (400, 6)] {
        let (mut frames, log) = recording();
        let at = place(&frames, sync, node);
        let counts = i32::from_le_bytes(frames[at].data[2..6].try_into().expect("4 bytes")) + 2;
        frames[at].data[2..6].copy_from_slice(&counts.to_le_bytes());
        let flaw = check_setpoints(&frames, &log, 0, &encodings()).expect_err("two counts off");
        assert!(matches!(flaw, Flaw::Bus { sync: s, .. } if s == sync as u64), "{flaw}");
    }
}

#[test]
fn frame_missing_fails() {
    let (mut frames, log) = recording();
    frames.remove(place(&frames, 250, 3));
    let flaw = check_setpoints(&frames, &log, 0, &encodings()).expect_err("a frame is missing");
    assert!(flaw.to_string().contains("5 setpoint frames for 6 servos"), "{flaw}");
}

#[test]
fn frame_missing_passes_only_in_a_fault_and_only_as_a_gap() {
    let (mut frames, mut log) = recording();
    nth_cycle(&mut log, 389).phase = "fault".into();
    let at = place(&frames, 390, 3);
    frames.remove(at);
    let check_result =
        check_setpoints(&frames, &log, 0, &encodings()).expect("a drive that dropped out gets no setpoint");
    assert_eq!(check_result.setpoints, 400 * JOINTS - 1);
    let other = place(&frames, 390, 4);
    frames.insert(at, frames[other].clone());
    check_setpoints(&frames, &log, 0, &encodings())
        .expect_err("one frame too few for one node, one too many for another");
}

#[test]
fn drive_not_commanded_to_follow_fails_in_motion_and_passes_in_a_fault() {
    let (mut frames, mut log) = recording();
    let at = place(&frames, 200, 3);
    frames[at].data = vec![0x06, 0, 1, 2, 3, 0];
    let flaw = check_setpoints(&frames, &log, 0, &encodings()).expect_err("a drive that does not follow");
    assert!(flaw.to_string().contains("not commanded to follow while moving"), "{flaw}");
    nth_cycle(&mut log, 199).phase = "fault".into();
    check_setpoints(&frames, &log, 0, &encodings()).expect("a drive that is off in a fault");
}

#[test]
fn sync_missing_fails() {
    let (mut frames, log) = recording();
    let at = place(&frames, 120, 1) - 1;
    assert_eq!(frames[at].id, 0x080);
    frames.remove(at);
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("a SYNC is missing");
}

#[test]
fn frame_late_by_one_cycle_fails() {
    let (mut frames, log) = recording();
    let at = place(&frames, 99, 2);
    let late = frames.remove(at);
    let after = place(&frames, 100, 2);
    frames.insert(after, late);
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("a frame came one cycle late");
}

#[test]
fn joints_swapped_fails() {
    let (mut frames, log) = recording();
    let (a, b) = (place(&frames, 300, 1), place(&frames, 300, 5));
    let data = frames[a].data.clone();
    frames[a].data = frames[b].data.clone();
    frames[b].data = data;
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("two joints are swapped");
}

#[test]
fn frame_twice_or_short_fails() {
    let (mut frames, log) = recording();
    let at = place(&frames, 17, 6);
    frames.insert(at, frames[at].clone());
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("a frame came twice");

    let (mut frames, log) = recording();
    let at = place(&frames, 18, 6);
    frames[at].data.pop();
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("a frame is short");
}

#[test]
fn setpoint_off_the_trajectory_by_one_bit_fails() {
    let (mut frames, mut log) = recording();
    let cycle = nth_cycle(&mut log, 150);
    cycle.position_rad[1] = f64::from_bits(cycle.position_rad[1].to_bits() + 1);
    let flaw = check_setpoints(&frames, &log, 0, &encodings()).expect_err("one bit off");
    assert!(matches!(flaw, Flaw::OffTrajectory { joint: 2, .. }), "{flaw}");

    let (_, mut log) = recording();
    nth_cycle(&mut log, 150).s += 1e-4;
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("another trajectory time");
    frames.clear();
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("an empty bus");
}

#[test]
fn log_that_hides_something_fails() {
    let (frames, mut log) = recording();
    log.push(Event::Lost { records: 1 });
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("records are missing");

    let (frames, mut log) = recording();
    let unknown = log.len() - 20;
    log.remove(unknown);
    let flaw =
        check_setpoints(&frames, &log, 0, &encodings()).expect_err("the bus carried more than the log says");
    assert!(flaw.to_string().contains("the log does not know"), "{flaw}");

    let (frames, mut log) = recording();
    nth_cycle(&mut log, 9).lost = vec![1];
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("a lost frame");

    let (frames, mut log) = recording();
    log.remove(1);
    let flaw = check_setpoints(&frames, &log, 0, &encodings()).expect_err("a motion that was never accepted");
    assert!(flaw.to_string().contains("never accepted"), "{flaw}");

    let (frames, mut log) = recording();
    nth_cycle(&mut log, 30).s = 0.0;
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("trajectory time went back");
}

/// A recording of a bus that took nothing of cycle 101, three frames of cycle 201, and nothing from cycle 301 on.
fn lossy_recording() -> (Vec<BusFrame>, Vec<Event>) {
    let (mut frames, mut log) = recording();
    let mut lose = |from: usize, to: usize| {
        let (first, last) = (sync_place(&frames, from), sync_place(&frames, to));
        frames.drain(first..last);
    };
    // From the end, so that the places in front stay.
    lose(301, 401);
    lose(101, 102);
    for node in 3..=6 {
        frames.remove(place(&frames, 200, node)); // The SYNC of cycle 201 is the 200th now.
    }
    let mut syncs = 0;
    for n in 0..400 {
        let cycle = nth_cycle(&mut log, n);
        let (sent, lost) = match n + 1 {
            // The cycle in which the bus failed wanted its frames out; the silent ones after it want nothing.
            101 | 301 => (0, 7),
            201 => (3, 4),
            302.. => (0, 0),
            _ => (7, 0),
        };
        syncs += u64::from(sent > 0);
        (cycle.sent, cycle.lost, cycle.sync) = (vec![sent], vec![lost], vec![syncs]);
    }
    (frames, log)
}

/// The place of a SYNC; behind the last one, the end.
fn sync_place(frames: &[BusFrame], sync: usize) -> usize {
    let mut syncs = frames.iter().enumerate().filter(|(_, frame)| frame.id == 0x080);
    syncs.nth(sync - 1).map_or(frames.len(), |(at, _)| at)
}

#[test]
fn recording_with_losses_passes_only_where_they_are_allowed() {
    let (frames, log) = lossy_recording();
    check_setpoints(&frames, &log, 0, &encodings()).expect_err("cycles are missing");
    let check_result =
        check_setpoints_with(Losses::AsLogged, (&frames, &log), 0, &encodings()).expect("the log says so");
    assert_eq!((check_result.syncs, check_result.setpoints), (299, 298 * JOINTS + 2));
}

/// Goal: what the losses excuse is only what the log claims: a frame after the bus failed, a frame that the log lacks, a
/// wrong target in a cycle that was lost in part are all found.
#[test]
fn recording_with_losses_that_carries_what_the_log_does_not_claim_fails() {
    let lossy = |frames: &[BusFrame], log: &[Event]| {
        check_setpoints_with(Losses::AsLogged, (frames, log), 0, &encodings())
            .expect_err("a flaw")
            .to_string()
    };
    let (mut frames, log) = lossy_recording();
    let stale = sync_place(&frames, 299);
    let again: Vec<BusFrame> = frames[stale..].to_vec();
    frames.extend(again);
    assert!(lossy(&frames, &log).contains("the log does not know"), "stale setpoints after the bus failed");

    let (mut frames, log) = lossy_recording();
    let at = place(&frames, 200, 2);
    frames[at].data[2] ^= 4;
    assert!(lossy(&frames, &log).contains("node 2 got target"), "a wrong target in a part of a cycle");

    let (mut frames, log) = lossy_recording();
    frames.remove(sync_place(&frames, 200));
    lossy(&frames, &log);

    let (frames, mut log) = lossy_recording();
    nth_cycle(&mut log, 100).sent = vec![7];
    lossy(&frames, &log);
}

/// Goal: frames that the kernel took and that went with their interface are excused for the last cycle before a silence,
/// and for no other; what came through of it must still be right.
#[test]
fn last_cycle_before_a_gap_may_go_with_its_interface_and_no_other() {
    let (frames, log) = lossy_recording();
    let check_mode =
        |frames: &[BusFrame]| check_setpoints_with(Losses::AsLogged, (frames, &log), 0, &encodings());
    let without = |from: usize, to: usize| {
        let (first, last) = (sync_place(&frames, from), sync_place(&frames, to));
        [&frames[..first], &frames[last..]].concat()
    };
    assert_eq!(check_mode(&without(299, 300)).unwrap().setpoints, 297 * JOINTS + 2, "the last one is gone");
    check_mode(&without(150, 151)).expect_err("one in mid-motion is gone");
    check_mode(&without(298, 300)).expect_err("two are gone");

    let mut part = frames.clone();
    part.truncate(place(&frames, 299, 4));
    assert_eq!(check_mode(&part).unwrap().setpoints, 297 * JOINTS + 2 + 3, "a part came through");
    part[place(&frames, 299, 2)].data[2] ^= 4;
    check_mode(&part).expect_err("a wrong target in what came through");
}

/// Lines as the streamer writes them: the words of the format are fixed.
#[test]
fn log_line_of_every_kind_is_read() {
    let log = r#"{"event":"start","format":1,"robot":"ur5","digest":"8c","joints":1,"period_us":1000}
{"event":"trajectory","tick":4,"trajectory_id":7,"generation":2,"file":{},"start_offset_rad":[0.0]}
{"event":"cycle","tick":5,"time_ns":9,"sync":[3],"frames":[8],"phase":"moving","trajectory_id":7,"s":0.5,"sigma":1.0,"position_rad":[-0.5],"off_path_rad":[0.0],"joint_sent":[true],"sent":[2],"lost":[0]}
{"event":"phase","tick":6,"from":"moving","to":"holding","reason":"end of trajectory","joint":null,"bus":null,"code":null,"value":null}
{"event":"lost","records":3}"#;
    let events = parse(log).expect("every line");
    assert!(matches!(events[0], Event::Start { joints: 1, .. }));
    assert!(matches!(events[1], Event::Trajectory { trajectory_id: 7, .. }));
    assert!(matches!(&events[2], Event::Cycle(cycle) if cycle.joint_sent == [true] && cycle.tick == 5));
    assert!(matches!(&events[3], Event::Phase { to, .. } if to == "holding"));
    assert_eq!(events[4], Event::Lost { records: 3 });
}

#[test]
fn log_line_that_is_not_understood_is_an_error() {
    assert!(parse("{\"event\":\"surprise\"}").is_err());
    assert!(parse("{\"event\":\"cycle\",\"tick\":1}").is_err());
    assert!(parse("not json").is_err());
    assert_eq!(
        parse("{\"event\":\"lost\",\"records\":3}").expect("a plain line"),
        [Event::Lost { records: 3 }]
    );
}
