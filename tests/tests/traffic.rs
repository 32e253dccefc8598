//! Recordings with turns and shared frames: faithful ones become plain ones, corrupted ones fail for their fault.
#![expect(clippy::unwrap_used, reason = "a test ends by panicking")]
use taustream_arm::Traffic;
use taustream_tests::cycle_log::{Event, LoggedCycle};
use taustream_tests::setpoints::{BusFrame, Encoding, check_setpoints};
use taustream_tests::traffic::as_plain;

const CYCLES: u32 = 40;

fn encodings() -> Vec<Encoding> {
    let encoding = |joint: u8| Encoding {
        joint: usize::from(joint),
        node_id: joint + 1,
        counts_per_rad: 1e5,
        zero_rad: 0.0,
    };
    (0..4).map(encoding).collect()
}

fn position_rad(cycle: u32) -> Vec<f64> {
    (0..4_u32).map(|joint| f64::from(cycle * (joint + 1)) * 1e-4).collect()
}

/// Two pairs on one bus that take turns of two cycles, with the log of the cycles.
fn recording() -> (Vec<BusFrame>, Vec<Event>) {
    let (mut frames, mut log) = (Vec::new(), Vec::new());
    for cycle in 1..=CYCLES {
        frames.push(BusFrame { id: 0x080, data: Vec::new() });
        let q = position_rad(cycle);
        if cycle == 1 {
            let control = |node: u32| BusFrame { id: 0x200 + node, data: vec![0x0F, 0x00] };
            frames.extend((1..=4).map(control));
        }
        for (first, turn) in [(0, 1), (2, 0)] {
            // A controlword that is new takes its target along.
            if cycle % 2 == turn || cycle == 1 {
                let counts = |joint: usize| encodings()[joint].counts(q[joint]).to_le_bytes();
                let id = 0x301 + u32::try_from(first).unwrap();
                frames.push(BusFrame { id, data: [counts(first), counts(first + 1)].concat() });
            }
        }
        log.push(Event::Cycle(LoggedCycle {
            tick: u64::from(cycle),
            time_ns: u64::from(cycle) * 1_000_000,
            frames: vec![2 * u64::from(cycle) + 5],
            sync: vec![u64::from(cycle)],
            phase: "holding".into(),
            trajectory_id: 0,
            s: 0.0,
            sigma: 0.0,
            position_rad: q,
            off_path_rad: vec![0.0; 4],
            joint_sent: vec![true; 4],
            sent: vec![2],
            lost: vec![0],
            axes: Vec::new(),
        }));
    }
    (frames, log)
}

const TRAFFIC: Traffic = Traffic { setpoint_every: 2, stagger: true, feedback_every: 1, packed: true };

/// The first flaw of the alternation or of the checker.
fn flaw_of(frames: Vec<BusFrame>, log: &[Event]) -> Option<String> {
    let plain = match as_plain(frames, log, 0, &encodings(), TRAFFIC) {
        Ok(plain) => plain,
        Err(flaw) => return Some(flaw.to_string()),
    };
    check_setpoints(&plain, log, 0, &encodings()).err().map(|flaw| flaw.to_string())
}

#[test]
fn faithful_recording_of_alternating_pairs_passes() {
    let (frames, log) = recording();
    let plain = as_plain(frames, &log, 0, &encodings(), TRAFFIC).unwrap();
    let check_result = check_setpoints(&plain, &log, 0, &encodings()).unwrap();
    assert_eq!(check_result.setpoints, 4 * CYCLES as usize);
}

#[test]
fn corrupted_recordings_fail_for_their_fault() {
    let shared = |frames: &[BusFrame], id: u32, nth: usize| {
        frames.iter().enumerate().filter(|(_, frame)| frame.id == id).nth(nth).unwrap().0
    };
    let (mut wrong_target, log) = recording();
    let at = shared(&wrong_target, 0x303, 7);
    wrong_target[at].data[5] ^= 1;
    assert!(flaw_of(wrong_target, &log).unwrap().contains("node 4 got target"));
    let (mut swapped, _) = recording();
    let at = shared(&swapped, 0x301, 5);
    swapped[at].data.rotate_left(4);
    assert!(flaw_of(swapped, &log).unwrap().contains("node 1 got target"));
    let (mut missing, _) = recording();
    missing.remove(shared(&missing, 0x301, 9));
    assert!(flaw_of(missing, &log).unwrap().contains("node 1 had no target for 2 cycles"));
    let (mut short, _) = recording();
    let at = shared(&short, 0x303, 3);
    short[at].data.pop();
    assert!(flaw_of(short, &log).unwrap().contains("a shared setpoint frame of 7 bytes"));
    let (mut off, _) = recording();
    let at = shared(&off, 0x202, 0);
    off[at].data[0] = 0x07;
    assert!(flaw_of(off, &log).unwrap().contains("node 2 is not commanded to follow"));
}
