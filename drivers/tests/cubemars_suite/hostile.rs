//! Frames that should never be sent: nothing panics, nothing moves, nothing is believed that is not the motor's.
use super::{edited, requests};
use crate::motor_bench::{Arm, JOINTS};
use proptest::prelude::{Just, ProptestConfig, Strategy, any, prop_oneof, proptest};
use taustream_drivers::protocols::cubemars::frames::{Feedback, Request, Special};
use taustream_drivers::{CanFrame, CanId, DriveState, DriveTarget};

/// Frames that are often nearly right: the arm's motors, special requests, any length, classic or FD.
fn frames() -> impl Strategy<Value = CanFrame> {
    let id = prop_oneof![0_u32..9, any::<u32>()];
    let first =
        prop_oneof![Just(vec![]), Just(vec![0xFF; 7]), (0_u8..9).prop_map(|node| vec![node, 0x80, 0, 0x80])];
    let rest = proptest::collection::vec(any::<u8>(), 0..9);
    (id, first, rest, any::<bool>()).prop_map(|(id, first, rest, fd)| {
        let bytes = [first, rest].concat();
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
                    // After a forged error a command without gains asks for the state.
                    let idle = matches!(request, Request::Mit([_, _, 0x80, 0, 0, 0, 8, 0]));
                    assert!(idle || request == Request::Special(Special::Exit), "{request:?} without a request");
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

/// Feedback of a motor without a request, with every error: it is watched, and nothing is switched on for it.
#[test]
fn forged_feedback_never_makes_the_master_energise() {
    for error in 0..=8_u8 {
        let mut arm = Arm::with(edited(&[]), |_| {});
        arm.until(DriveState::Disabled);
        for _ in 0..50 {
            arm.step();
            let forged = Feedback { state: [0x90, 0, 0x80, 8, 0], health: Some([70, error]) };
            arm.arriving.push(forged.encode(3, 3));
        }
        assert!(!arm.servo(2).is_enabled());
        let state = arm.status(2).state;
        assert!(state != DriveState::Enabled && state != DriveState::Enabling, "error {error}: {state:?}");
        arm.drive_target = DriveTarget::TorqueOff;
        arm.step();
        assert!(requests(&arm, 3).contains(&Request::Special(Special::Exit)));
    }
}
