//! What must change nothing: floats that are no numbers, frames of others, truncated ones, doubled ids.
use super::{Bench, JOINTS, node};
use taustream_drivers::protocols::odrive::frames::{Message, STATE_CLOSED_LOOP};
use taustream_drivers::{CanFrame, CanId, DriveState};

/// A drive without calibration sends what is no number: it is as good as nothing, and supervision sees an old position.
#[test]
fn estimates_that_are_no_numbers_are_no_feedback() {
    let mut bench = Bench::enabled();
    bench
        .arriving
        .retain(|frame| !matches!(Message::decode(frame, node(0)), Some(Message::Estimates { .. })));
    let before = bench.status(0).received;
    for (position_turns, velocity_turns_s) in
        [(f32::NAN, 0.0), (f32::INFINITY, 0.0), (0.0, f32::NAN), (0.0, f32::NEG_INFINITY)]
    {
        for _ in 0..50 {
            bench.step();
            bench
                .arriving
                .retain(|frame| !matches!(Message::decode(frame, node(0)), Some(Message::Estimates { .. })));
            bench.arriving.push(Message::Estimates { position_turns, velocity_turns_s }.encode(node(0)));
        }
        let status = bench.status(0);
        assert!(status.position_rad.is_finite() && status.velocity_rad_s.is_finite());
    }
    assert_eq!(bench.status(0).received, before);
    assert_eq!(bench.status(0).state, DriveState::Fault);

    // It does not become configured either.
    let mut bench = Bench::new();
    for _ in 0..1_000 {
        bench.step();
        bench
            .arriving
            .retain(|frame| !matches!(Message::decode(frame, node(0)), Some(Message::Estimates { .. })));
        bench
            .arriving
            .push(Message::Estimates { position_turns: f32::NAN, velocity_turns_s: 0.0 }.encode(node(0)));
    }
    assert!(bench.why(0).contains("estimates that are numbers"), "{}", bench.why(0));
    assert_eq!(bench.status(1).state, DriveState::Disabled);
}

#[test]
fn frames_of_other_nodes_truncated_frames_and_other_kinds_change_nothing() {
    let mut bench = Bench::enabled();
    let own = Message::Estimates { position_turns: 99.0, velocity_turns_s: 0.0 };
    let beat = Message::Heartbeat { errors: 0xFFFF, state: 1, result: 0, done: false };
    for _ in 0..50 {
        bench.step();
        for message in [own, beat] {
            bench.arriving.push(message.encode(node(0) + 1));
            for length in 0..7 {
                let frame = message.encode(node(0));
                bench.arriving.push(CanFrame::classic(frame.id(), &frame.data()[..length]));
            }
            for flag in [0x8000_0000, 0x4000_0000, 0x2000_0000] {
                let id = message.encode(node(0)).id().raw() | flag;
                bench.arriving.push(CanFrame::classic(CanId::from_raw(id), message.encode(node(0)).data()));
            }
        }
        assert_eq!(bench.states(), [DriveState::Enabled; JOINTS]);
        assert!((bench.status(0).position_rad - bench.drives[0].position_rad()).abs() < 0.01);
    }
}

/// Two drives with one id: their heartbeats contradict each other, so none is energised.
#[test]
fn doubled_id_of_which_one_is_energised_is_left_alone() {
    let mut bench = Bench::new();
    for _ in 0..500 {
        bench.step();
        let beat = Message::Heartbeat { errors: 0, state: STATE_CLOSED_LOOP, result: 0, done: true };
        bench.arriving.push(beat.encode(node(0)));
    }
    assert_eq!(bench.status(0).state, DriveState::EnergisedUnowned);
    assert_eq!(bench.drives[0].watchdog(), (0.0, false));
}

#[test]
fn every_identifier_with_any_bytes_leaves_the_master_standing() {
    let mut bench = Bench::enabled();
    let mut seed = 1_u64;
    for id in 0..=0x7FF_u16 {
        let bytes: Vec<u8> = (0..8)
            .map(|_| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                seed.to_be_bytes()[0]
            })
            .collect();
        bench.arriving.push(CanFrame::classic(CanId::standard(id), &bytes[..usize::from(id) % 9]));
        if id % 64 == 0 {
            bench.step();
        }
    }
    bench.steps(20);
    for joint in 0..JOINTS {
        assert!(bench.status(joint).position_rad.is_finite());
    }
}
