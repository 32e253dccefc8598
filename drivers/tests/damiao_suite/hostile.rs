//! Frames that should never be sent: nothing panics, nothing moves, nothing is believed that is not the motor's.
use super::{Arm, DamiaoArm, JOINTS, edited};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof, proptest};
use taustream_drivers::protocols::damiao::frames::{Reply, Request, Special, Wire};
use taustream_drivers::{CanFrame, CanId, DriveState, DriveTarget};

/// Frames that are often nearly right: identifiers of the protocol, its first bytes, any length, classic or FD.
fn frames() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![
        0x00_u32..0x20,
        0x100_u32..0x110,
        0x200_u32..0x210,
        0x300_u32..0x310,
        Just(0x7FF_u32),
        any::<u32>(),
    ];
    let first = prop_oneof![
        Just(vec![]),
        Just(vec![0xFF; 7]),
        (0_u8..16).prop_map(|id| vec![id, 0, 0x33]),
        (0_u8..16).prop_map(|id| vec![id, 0, 0x55, 9]),
        (0_u8..16).prop_map(|id| vec![id, 0, 0xCC])
    ];
    let rest = proptest::collection::vec(any::<u8>(), 0..12);
    (id, first, rest, any::<bool>()).prop_map(|(id, first, rest, fd)| {
        let bytes = [first, rest].concat();
        let id = CanId::from_raw(id);
        if fd { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes[..bytes.len().min(8)]) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn decoders_take_any_frame(frame in frames(), node in 0_u8..=255, feedback in 0_u16..=u16::MAX) {
        let reply = Reply::decode(&frame, node, feedback);
        assert!(reply.is_none() || frame.id().raw() == u32::from(feedback));
        let node = node & 0xF;
        if let Some(request) = Request::decode(&frame, node) {
            let again = Request::decode(&request.encode(node, Wire::Classic), node);
            // What would read as a special command is sent one step lower; floats may be no numbers.
            let alike = matches!(request, Request::Mit([0xFF, 0xFF, ..]) | Request::PosVel { .. });
            assert!(alike || again == Some(request), "{request:?} became {again:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Not one frame of another master energises a motor that the target keeps off.
    #[test]
    fn master_energises_nothing_whatever_it_receives(received in proptest::collection::vec(frames(), 1..400)) {
        let mut arm = Arm::new();
        arm.until(DriveState::Disabled);
        for frame in received {
            arm.arriving.push(frame);
            arm.step();
            for servo in &arm.settings.servos {
                for frame in &arm.sent {
                    let request = Request::decode(frame, servo.node_id);
                    let moves = matches!(
                        request,
                        Some(Request::Special(Special::Enable | Special::SetZero, _)
                            | Request::Mit(_) | Request::PosVel { .. } | Request::OtherMode(_) | Request::Store)
                    );
                    assert!(!moves, "{request:?} without a request");
                }
            }
        }
    }

    /// The simulated motors take anything, stay finite, and inside their torque.
    #[test]
    fn simulated_motors_survive_any_master(received in proptest::collection::vec(frames(), 1..400)) {
        let mut arm = Arm::enabled(edited(&[]));
        for frame in received {
            let mut out = [Vec::new()];
            arm.now.0 += 1_000_000;
            arm.simulator.advance(arm.now, &mut out);
            arm.simulator.receive(arm.now, 0, &[frame], &mut out);
            for joint in 0..JOINTS {
                let motor = arm.servo(joint);
                assert!(motor.position_rad().is_finite() && motor.velocity_rad_s().abs() < 100.0);
            }
            for frame in &out[0] {
                assert_eq!(frame.data().len(), 8);
            }
        }
    }
}

/// Feedback of a motor without a request, with every status: it is watched, and nothing is switched on for it.
#[test]
fn forged_feedback_never_makes_the_master_energise() {
    for status in 0..16_u8 {
        let mut arm = Arm::new();
        arm.until(DriveState::Disabled);
        for _ in 0..50 {
            arm.step();
            arm.arriving.push(CanFrame::classic(
                CanId::standard(0x13),
                &[status << 4 | 3, 0x90, 0, 0x80, 8, 0, 30, 30],
            ));
        }
        assert_eq!(arm.nibble(2), 0);
        let state = arm.status(2).state;
        assert!(
            state != DriveState::Enabled && state != DriveState::Enabling,
            "status {status:X}: {state:?}"
        );
        arm.drive_target = DriveTarget::TorqueOff;
        arm.step();
        assert!(
            arm.sent.iter().any(|f| Request::decode(f, 3) == Some(Request::Special(Special::Disable, 0)))
        );
    }
}
