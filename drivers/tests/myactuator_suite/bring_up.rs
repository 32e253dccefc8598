//! From silence to a configured motor: what is asked, what is refused, what is left alone.
use super::{edited, motor, motor_of, position_mode, requests};
use crate::motor_bench::{Arm, JOINTS};
use taustream_drivers::protocols::myactuator::frames::{Reply, Request};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn motors_are_only_asked_until_they_are_known_and_get_their_watchdog() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    let mut asked = Vec::new();
    while arm.states().iter().any(|state| *state != DriveState::Disabled) {
        arm.step();
        asked.extend(requests(&arm, 3));
        assert!(asked.len() < 2_000, "{:?}", arm.states());
    }
    let first_write = asked.iter().position(|request| matches!(request, Request::Watchdog(_))).unwrap();
    let looks = |request: &Request| matches!(request, Request::Angle | Request::Status | Request::Model);
    assert!(asked[..first_write].iter().all(looks), "{asked:?}");
    assert!(asked[..first_write].contains(&Request::Model), "identity before the first write: {asked:?}");
    let writes: Vec<&Request> = asked.iter().filter(|request| !looks(request)).collect();
    assert_eq!(writes, [&Request::Watchdog(100), &Request::ReportErrors(true)]);
    assert!((0..JOINTS).all(|joint| motor(&arm, joint).watchdog_ms() == 100));
    arm.steps(2);
    for joint in 0..JOINTS {
        let off_rad = (arm.status(joint).position_rad - arm.servo(joint).position_rad()).abs();
        assert!(off_rad < 1e-3, "joint {joint} is reported {off_rad} rad off");
    }
}

#[test]
fn another_model_is_refused_and_named() {
    let mut arm = Arm::with(edited(&[]), |setup| {
        if setup.joint == "elbow" {
            motor_of(setup).model = *b"X8S2V11";
        }
    });
    arm.until_one(2, DriveState::Refused);
    arm.steps(100);
    let why = arm.why(2);
    assert!(why.contains("\"V11\"") || why.contains("\"11\"") || why.contains("2V11"), "{why}");
    assert!(why.contains("model"), "{why}");
    assert_eq!(arm.status(1).state, DriveState::Disabled, "the others go on");
    assert_eq!(motor(&arm, 2).watchdog_ms(), 0, "nothing was written to a motor of another model");
}

/// In both modes: what a dead streamer left following is not touched, until its torque is asked to go.
#[test]
fn motor_that_is_found_released_is_left_alone_until_torque_off() {
    for settings in [edited(&[]), position_mode()] {
        let mut arm = Arm::enabled(settings.clone());
        arm.driver = taustream_drivers::protocols::of_bus(&settings, 0).unwrap();
        arm.drive_target = DriveTarget::Disabled;
        for _ in 0..40 {
            arm.step();
            let asked = requests(&arm, 1);
            assert!(
                asked.iter().all(|request| matches!(request, Request::Angle | Request::Status)),
                "{asked:?}"
            );
        }
        assert_eq!(arm.status(0).state, DriveState::EnergisedUnowned, "{}", arm.why(0));
        assert!(arm.why(0).contains("torque-off"), "{}", arm.why(0));
        arm.drive_target = DriveTarget::TorqueOff;
        arm.steps(400);
        assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()));
        arm.drive_target = DriveTarget::Disabled;
        arm.until(DriveState::Disabled);
    }
}

#[test]
fn refused_watchdog_is_named_with_what_the_motor_holds() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.fault(1, "kind=refuse");
    arm.until_one(1, DriveState::Refused);
    let why = arm.why(1);
    assert!(why.contains("communication interruption protection") && why.contains("watchdog_ms"), "{why}");
}

#[test]
fn frames_of_another_master_are_noticed_and_nothing_is_written_meanwhile() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    for _ in 0..300 {
        arm.arriving.push(Request::Motion([0x80, 0, 0x80, 0, 0, 0, 8, 0]).encode(4));
        arm.step();
        assert!(requests(&arm, 4).iter().all(|request| !matches!(request, Request::Watchdog(_))));
    }
    assert!(arm.driver.other_master().is_some());
    assert_eq!(arm.status(3).state, DriveState::Configuring);
    arm.until(DriveState::Disabled);
}

#[test]
fn any_bytes_of_a_motor_are_survived() {
    let mut arm = Arm::enabled(edited(&[]));
    let mut word = 1_u64;
    for _ in 0..20_000 {
        word = word.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let frame = Reply::Other((word >> 56) as u8).encode(1 + (word % 6) as u8);
        let id = frame.id().raw() + u32::from(word & 0x100 != 0) * 0x2C0;
        let bytes = word.to_le_bytes();
        let length = (word >> 17) as usize % 9;
        let id = taustream_drivers::CanId::from_raw(id);
        arm.arriving.push(taustream_drivers::CanFrame::classic(id, &bytes[..length]));
        arm.step();
        assert!(arm.status(0).position_rad.is_finite() && arm.servo(0).position_rad().is_finite());
    }
}
