//! Bytes: the examples of the maker's manual, and what is not a motor's.
use taustream_drivers::codec::mit::{MitCommand, MitRanges, MitState};
use taustream_drivers::protocols::myactuator::frames::{
    Reply, Request, Status, angle_of, rad_of, speed_limit_of,
};
use taustream_drivers::{CanFrame, CanId};

/// Source: "Servo Motor Control Protocol V4.2", examples of sections 2.12 to 2.33 and 5.4: identifier, bytes, meaning.
const REQUESTS: [(u16, [u8; 8], Request); 8] = [
    (0x141, [0x92, 0, 0, 0, 0, 0, 0, 0], Request::Angle),
    (0x141, [0x9A, 0, 0, 0, 0, 0, 0, 0], Request::Status),
    (0x141, [0x80, 0, 0, 0, 0, 0, 0, 0], Request::Shutdown),
    (0x141, [0xA4, 0, 0xF4, 0x01, 0xA0, 0x8C, 0, 0], Request::Position { angle: 36_000, speed: 500 }),
    (0x141, [0xA4, 0, 0xF4, 0x01, 0x60, 0x73, 0xFF, 0xFF], Request::Position { angle: -36_000, speed: 500 }),
    (0x141, [0xB3, 0, 0, 0, 0xE8, 0x03, 0, 0], Request::Watchdog(1000)),
    (0x141, [0xB5, 0, 0, 0, 0, 0, 0, 0], Request::Model),
    (
        0x401,
        [0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55],
        Request::Motion([0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55]),
    ),
];

const UNDER_VOLTAGE: Status =
    Status { winding_celsius: 50, stage_celsius: 0, is_released: true, decivolts: 485, errors: 0x0004 };

const REPLIES: [(u16, [u8; 8], Reply); 4] = [
    (0x241, [0x92, 0, 0, 0, 0xA0, 0x8C, 0, 0], Reply::Angle(36_000)),
    (0x241, [0x9A, 0x32, 0, 0x01, 0xE5, 0x01, 0x04, 0], Reply::Status(UNDER_VOLTAGE)),
    (0x241, [0xB5, 0x58, 0x38, 0x53, 0x32, 0x56, 0x31, 0x30], Reply::Model(*b"X8S2V10")),
    (0x501, [0x01, 0xE6, 0x66, 0x82, 0xEB, 0x55, 0, 0], Reply::Motion([0xE6, 0x66, 0x82, 0xEB, 0x55])),
];

#[test]
fn examples_of_the_manual_are_packed_and_read_byte_by_byte() {
    for (id, bytes, request) in REQUESTS {
        let frame = CanFrame::classic(CanId::standard(id), &bytes);
        assert_eq!(request.encode(1), frame, "{request:?}");
        assert_eq!(Request::decode(&frame, 1), Some(request));
        assert_eq!(Request::decode(&frame, 2), None, "{request:?} is not for motor 2");
    }
    for (id, bytes, reply) in REPLIES {
        let frame = CanFrame::classic(CanId::standard(id), &bytes);
        assert_eq!(reply.encode(1), frame, "{reply:?}");
        assert_eq!(Reply::decode(&frame, 1), Some(reply));
        assert_eq!(Reply::decode(&frame, 2), None, "{reply:?} is not motor 2's");
    }
}

#[test]
fn motion_mode_packs_the_numbers_of_the_manual() {
    let spans = MitRanges::symmetric(12.5, 45.0, 24.0);
    let command = MitCommand::decode([0xE6, 0x66, 0x82, 0xE0, 0x52, 0x33, 0x3B, 0x55], &spans);
    // The manual cuts off at two or three digits.
    for (got, stated) in [
        (command.position_rad, 9.99),
        (command.velocity_rad_s, 1.021),
        (command.stiffness_nm_rad, 10.012),
        (command.damping_nm_s_rad, 1.0),
        (command.torque_nm, 10.004),
    ] {
        assert!((got - stated).abs() < 0.011, "{got} is not {stated}");
    }
    let state = MitState::decode([0xE6, 0x66, 0x82, 0xEB, 0x55], &spans);
    assert!(
        (state.position_rad - 9.99).abs() < 0.011 && (state.torque_nm - 10.004).abs() < 1e-3,
        "{state:?}"
    );
}

#[test]
fn angles_and_speeds_round_and_saturate() {
    assert_eq!(angle_of(std::f64::consts::TAU), 36_000);
    assert!((rad_of(-36_000) + std::f64::consts::TAU).abs() < 1e-12);
    assert_eq!((angle_of(f64::NAN), angle_of(f64::INFINITY)), (0, i32::MAX));
    assert_eq!((speed_limit_of(0.0), speed_limit_of(1.0), speed_limit_of(1e9)), (1, 58, 65_535));
}

#[test]
fn frames_of_another_kind_or_length_are_nobodys() {
    let bytes = [0x9A, 0, 0, 0, 0, 0, 0, 0];
    for frame in [
        CanFrame::classic(CanId::standard(0x141), &bytes[..7]),
        CanFrame::classic(CanId::standard(0x141), &[]),
        CanFrame::fd(CanId::standard(0x141), &bytes),
        CanFrame::classic(CanId::extended(0x141), &bytes),
        CanFrame::classic(CanId::standard_remote(0x141), &bytes),
        CanFrame::classic(CanId::standard(0x161), &bytes),
    ] {
        assert_eq!(Request::decode(&frame, 1), None, "{frame:?}");
    }
    // A reply in motion mode that names another motor than its identifier does.
    let other = CanFrame::classic(CanId::standard(0x501), &[2, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(Reply::decode(&other, 1), None);
}
