//! Errors, silence, a dead master.
use super::{edited, requests};
use crate::motor_bench::{Arm, JOINTS};
use taustream_drivers::protocols::myactuator::frames::Request;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn motor_in_an_error_is_named_and_its_output_cut_before_it_recovers_by_itself() {
    let mut arm = Arm::enabled(edited(&[]));
    // Over-temperature, which ends by itself; the motor would go on with its last command.
    arm.fault(2, "kind=fault,value=0x1000");
    arm.until_one(2, DriveState::Fault);
    assert!(arm.why(2).contains("its winding is too hot"), "{}", arm.why(2));
    arm.steps(50);
    assert!(!arm.servo(2).is_enabled());
    arm.steps(1_500);
    assert!(!arm.servo(2).is_enabled(), "it must not go on by itself when the error is over");
    assert_eq!(arm.status(1).state, DriveState::Enabled, "the others hold");
}

#[test]
fn lasting_error_is_cleared_on_request_by_a_restart() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(0, "kind=fault,value=0x0010");
    arm.until_one(0, DriveState::Fault);
    assert!(arm.why(0).contains("over-current"), "{}", arm.why(0));
    arm.disable();
    arm.steps(1_000);
    assert_eq!(arm.status(0).state, DriveState::Fault, "it lasts");
    arm.driver.clear_faults();
    arm.steps(1_000);
    arm.until(DriveState::Disabled);
}

#[test]
fn silent_motor_is_a_fault_that_names_it_and_the_others_go_on() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(4, "kind=silence");
    arm.steps(600);
    assert_eq!(arm.status(4).state, DriveState::Fault);
    assert!(arm.why(4).contains("stopped answering"), "{}", arm.why(4));
    assert_eq!(arm.status(3).state, DriveState::Enabled);
}

#[test]
fn motors_cut_their_output_when_the_master_dies_and_do_not_go_on_when_it_is_back() {
    let mut arm = Arm::enabled(edited(&[]));
    for _ in 0..200 {
        arm.now.0 += 1_000_000;
        let sent = arm.inject(&[]);
        assert!(sent.is_empty());
    }
    assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()), "the watchdog of 100 ms");
    arm.steps(100);
    assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()), "{:?}", arm.states());
    assert!(arm.states().iter().all(|state| *state == DriveState::Fault), "{:?}", arm.states());
    assert!(arm.why(0).contains("disabled itself"), "{}", arm.why(0));
}

#[test]
fn torque_off_cuts_every_output_within_a_few_cycles_and_asks_again_when_it_is_lost() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(1, "kind=drop,value=0.5,for_s=0.2");
    arm.drive_target = DriveTarget::TorqueOff;
    arm.step();
    assert!(requests(&arm, 1).contains(&Request::Shutdown), "the output first: {:?}", requests(&arm, 1));
    arm.steps(100);
    assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()), "{:?}", arm.states());
}
