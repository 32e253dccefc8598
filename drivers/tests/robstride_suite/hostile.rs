//! Frames that should never be sent: nothing panics, nothing moves, nothing is believed that is not the motor's.
use super::{HOST, edited, requests};
use crate::motor_bench::{Arm, JOINTS};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof, proptest};
use taustream_drivers::protocols::robstride::frames::{Feedback, Mode, Reply, Request};
use taustream_drivers::{CanFrame, CanId, DriveState, DriveTarget};

/// Frames that are often nearly right: types of the protocol, the arm's motors, any length, classic or FD.
fn frames() -> impl Strategy<Value = CanFrame> {
    let kind = prop_oneof![0_u32..32, Just(1), Just(2), Just(17), Just(18), Just(21)];
    let target = prop_oneof![0_u32..10, Just(u32::from(HOST)), any::<u8>().prop_map(u32::from)];
    let id = prop_oneof![
        (kind, any::<u16>(), target)
            .prop_map(|(kind, data, target)| { 0x8000_0000 | kind << 24 | u32::from(data) << 8 | target }),
        (0_u32..4, 1_u32..8).prop_map(|(mode, node)| 0x8200_00FD | mode << 22 | node << 8),
        any::<u32>(),
    ];
    (id, proptest::collection::vec(any::<u8>(), 0..12), any::<bool>()).prop_map(|(id, bytes, fd)| {
        let id = CanId::from_raw(id);
        if fd { CanFrame::fd(id, &bytes) } else { CanFrame::classic(id, &bytes[..bytes.len().min(8)]) }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// Not one frame of another master or motor energises a motor that the target keeps off.
    #[test]
    fn master_energises_nothing_whatever_it_receives(received in proptest::collection::vec(frames(), 1..400)) {
        let mut arm = Arm::with(edited(&[]), |_| {});
        arm.until(DriveState::Disabled);
        for frame in received {
            arm.arriving.push(frame);
            arm.step();
            for node in 1..=6 {
                for request in requests(&arm, node) {
                    let moves = matches!(
                        request,
                        Request::Enable | Request::SetZero | Request::Operation(_) | Request::Version | Request::Other(_)
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
            arm.now.0 += 1_000_000;
            for answer in arm.inject(&[frame]) {
                assert_eq!(answer.data().len(), 8);
            }
            for joint in 0..JOINTS {
                let servo = arm.servo(joint);
                assert!(servo.position_rad().is_finite() && servo.velocity_rad_s().abs() < 100.0);
            }
        }
    }
}

/// Feedback of a motor without a request, in every mode and with every fault: it is watched, and nothing is switched on for it.
#[test]
fn forged_feedback_never_makes_the_master_energise() {
    for mode in [Mode::Reset, Mode::Calibration, Mode::Run, Mode::Unknown] {
        for faults in [0, 1, 0x3F] {
            let mut arm = Arm::with(edited(&[]), |_| {});
            arm.until(DriveState::Disabled);
            for _ in 0..50 {
                arm.step();
                let forged = Feedback { mode, faults, state: [0x90, 0, 0x80, 8, 0, 30], decicelsius: 300 };
                arm.arriving.push(Reply::Feedback(forged).encode(3, HOST));
            }
            assert!(!arm.servo(2).is_enabled());
            let state = arm.status(2).state;
            assert!(state != DriveState::Enabled && state != DriveState::Enabling, "{mode:?}: {state:?}");
            arm.drive_target = DriveTarget::TorqueOff;
            arm.step();
            assert!(requests(&arm, 3).contains(&Request::Stop));
        }
    }
}

/// Values that are no numbers, for another master, of another parameter or another motor: none of them configures a motor.
#[test]
fn forged_values_configure_nothing() {
    let honest = |index: u16, value: f32| Reply::Value { index, read: true, value: value.to_le_bytes() };
    for (forged, node, host) in [
        (honest(0x7028, f32::NAN), 3, HOST),
        (honest(0x700B, f32::INFINITY), 3, HOST),
        (honest(0x7019, f32::NAN), 3, HOST),
        (honest(0x7028, 1.0), 3, 0xFC),
        (honest(0x7028, 1.0), 9, HOST),
    ] {
        let mut arm = Arm::with(edited(&[]), |_| {});
        let mut refused = false;
        for _ in 0..600 {
            arm.step();
            arm.arriving.insert(0, forged.encode(node, host));
            refused |= arm.status(2).state == DriveState::Refused;
        }
        let state = arm.status(2).state;
        let own = (node, host) == (3, HOST);
        // A forged answer in the place of the motor's own is refused with its value; what is not the motor's changes nothing.
        assert!(
            if own { refused } else { state == DriveState::Disabled },
            "{forged:?}: {state:?} {}",
            arm.why(2)
        );
        assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()));
    }
}
