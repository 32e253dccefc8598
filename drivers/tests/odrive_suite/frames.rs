//! Frames against bytes written out by hand from the maker's protocol page, and frames of which nothing may be read.
use taustream_drivers::protocols::odrive::frames::{
    Command, EndpointValue, InputPosition, Message, Query, STATE_CLOSED_LOOP,
};
use taustream_drivers::{CanFrame, CanId};

#[test]
fn requests_are_remote_and_hold_no_data() {
    for (query, id) in [
        (Query::Version, 0x4000_00A0),
        (Query::Heartbeat, 0x4000_00A1),
        (Query::Error, 0x4000_00A3),
        (Query::Estimates, 0x4000_00A9),
    ] {
        let frame = Command::Request(query).encode(5);
        assert_eq!((frame.id().raw(), frame.data()), (id, &[][..]));
        assert_eq!(Command::decode(&frame, 5), Some(Command::Request(query)));
        // The other way of asking, for adapters without remote frames.
        let plain = CanFrame::classic(CanId::from_raw(id & 0x7FF), &[]);
        assert_eq!(Command::decode(&plain, 5), Some(Command::Request(query)));
        assert!(!Command::is_to(&frame, 5) && Message::decode(&frame, 5).is_none());
    }
}

#[test]
fn endpoints_have_the_width_of_their_value() {
    let read = Command::Read(0x0199).encode(1);
    assert_eq!((read.id().raw(), read.data()), (0x024, &[0, 0x99, 0x01, 0][..]));
    let switch = Command::Write(154, EndpointValue::Byte(1)).encode(1);
    assert_eq!(switch.data(), &[1, 154, 0, 0, 1]);
    let timeout = Command::Write(153, EndpointValue::Word(0.1_f32.to_le_bytes())).encode(1);
    assert_eq!(timeout.data(), &[1, 153, 0, 0, 0xCD, 0xCC, 0xCC, 0x3D]);
    // The confirmation of a write has no value, or one.
    let confirmation = CanFrame::classic(CanId::standard(0x025), &[0, 154, 0, 0]);
    assert_eq!(Message::decode(&confirmation, 1), Some(Message::Endpoint(154, None)));
}

#[test]
fn feed_forward_is_cut_off_at_its_16_bits_and_positions_that_are_no_numbers_are_not_sent() {
    let input = InputPosition::new(1.5, 100.0, -100.0).unwrap();
    assert_eq!((input.velocity_mturns_s, input.torque_mnm), (i16::MAX, i16::MIN));
    let input = InputPosition::new(-2.0, 0.0014, f64::NAN).unwrap();
    assert_eq!((input.velocity_mturns_s, input.torque_mnm), (1, 0));
    for position in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(InputPosition::new(position, 0.0, 0.0), None);
    }
}

#[test]
fn frames_of_others_and_short_ones_say_nothing() {
    let all = [
        Message::Heartbeat { errors: 1, state: STATE_CLOSED_LOOP, result: 0, done: true }.encode(7),
        Message::Error { active: 0, disarmed: 1 }.encode(7),
        Message::Estimates { position_turns: 1.0, velocity_turns_s: 2.0 }.encode(7),
        Message::Endpoint(3, Some(EndpointValue::Word([1; 4]))).encode(7),
    ];
    for frame in &all {
        assert!(Message::decode(frame, 7).is_some());
        for node in (0..=u8::MAX).filter(|node| *node != 7) {
            assert_eq!(Message::decode(frame, node), None, "node {node}");
        }
        for length in 0..4 {
            assert_eq!(Message::decode(&CanFrame::classic(frame.id(), &frame.data()[..length]), 7), None);
        }
    }
    let heartbeat = CanFrame::classic(all[0].id(), &all[0].data()[..7]);
    assert!(Message::decode(&heartbeat, 7).is_some(), "seven bytes are all that a heartbeat uses");
    for id in [0x8000_00E1, 0x2000_00E1, 0x4000_00E1, 0x0000_08E1] {
        assert_eq!(Message::decode(&CanFrame::classic(CanId::from_raw(id), &[0; 8]), 7), None, "{id:X}");
    }
}

#[test]
fn no_identifier_and_no_length_breaks_the_decoders() {
    for id in 0..=0x7FF_u16 {
        for length in 0..=8 {
            for fill in [0x00, 0x01, 0x7F, 0xFF] {
                let frame = CanFrame::classic(CanId::standard(id), &[fill; 8][..length]);
                for node in [0, 1, 62, 63, 64, 255] {
                    let _ = (Message::decode(&frame, node), Command::decode(&frame, node));
                    let _ = Command::is_to(&frame, node);
                }
            }
        }
    }
}
