//! What must change nothing: frames of others, truncated ones, joints that there are not.
use super::Bench;
use taustream_drivers::protocols::piper::frames::{JOINTS, Limits, Message};
use taustream_drivers::{CanFrame, CanId, DriveState, ServoDriver};

#[test]
fn truncated_frames_frames_of_other_kinds_and_answers_for_other_joints_change_nothing() {
    let mut bench = Bench::enabled();
    let angles = Message::Angles(0, [90_000, 90_000]).encode();
    for _ in 0..50 {
        bench.step();
        for length in 0..8 {
            bench.arriving.push(CanFrame::classic(angles.id(), &angles.data()[..length]));
        }
        bench.arriving.push(CanFrame::fd(angles.id(), &[0x7F; 64]));
        for flag in [0x8000_0000, 0x4000_0000, 0x2000_0000] {
            bench.arriving.push(CanFrame::classic(CanId::from_raw(angles.id().raw() | flag), angles.data()));
        }
        for joint in [0, 7, 8, 255] {
            let limits = Limits { joint, most_decidegrees: 0, least_decidegrees: 0, speed_mrad_s: 0 };
            bench.arriving.push(Message::Limits(limits).encode());
        }
        bench.arriving.push(Message::Firmware([0xFF; 8]).encode());
        assert_eq!(bench.states(), [DriveState::Enabled; JOINTS]);
        assert!((bench.status(0).position_rad - bench.arm[0].position_rad()).abs() < 0.02);
    }
}

/// An endless name of a firmware does not run over, and is refused in the end.
#[test]
fn firmware_without_a_name_is_refused_when_the_time_is_over() {
    let mut bench = Bench::with(|_, parameters| parameters.firmware = [b'x'; 8]);
    for _ in 0..600 {
        bench.step();
        for _ in 0..20 {
            bench.arriving.push(Message::Firmware(*b"S-S-S-S-").encode());
        }
    }
    assert_eq!(bench.states(), [DriveState::Refused; JOINTS]);
    assert!(bench.why(0).contains("does not answer this question"), "{}", bench.why(0));
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
        bench.arriving.push(CanFrame::classic(CanId::standard(id), &bytes));
        if id % 64 == 0 {
            bench.step();
        }
    }
    bench.steps(20);
    for joint in 0..JOINTS {
        assert!(bench.status(joint).position_rad.is_finite());
    }
    bench.driver.start_over();
    assert_eq!(bench.states(), [DriveState::Absent; JOINTS]);
}
