//! What goes wrong with a motor in use, and that nothing comes back by itself.
use super::{edited, motor};
use crate::motor_bench::{Arm, JOINTS};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn error_of_a_motor_has_text_and_is_cleared_only_on_command() {
    for (code, words) in [
        ("0x01", "under-voltage"),
        ("0x02", "over-current"),
        ("0x04", "too hot"),
        ("0x08", "encoder"),
        ("0x10", "blocked"),
        ("0x20", "not calibrated"),
        ("0x43", "over-voltage"),
        ("0x41", "driver chip"),
        ("0x7305", "over-current"),
    ] {
        let mut arm = Arm::enabled(edited(&[]));
        arm.fault(2, &format!("kind=fault,value={code}"));
        arm.until_one(2, DriveState::Fault);
        arm.steps(2);
        assert!(arm.why(2).contains(words), "{code}: {}", arm.why(2));
        let others = (0..JOINTS)
            .filter(|joint| *joint != 2)
            .all(|joint| arm.status(joint).state == DriveState::Enabled);
        assert!(others, "{:?}", arm.states());
        arm.simulator.clear(None);
        arm.steps(1_000);
        assert_eq!(arm.status(2).state, DriveState::Fault, "it stays");
        arm.driver.clear_faults();
        arm.until_one(2, DriveState::Disabled);
        arm.steps(500);
        assert_eq!((arm.status(2).state, arm.servo(2).is_enabled()), (DriveState::Disabled, false));
        arm.disable();
        arm.enable();
    }
}

#[test]
fn warning_of_a_motor_is_passed_on_and_ends() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(1, "kind=warning");
    arm.steps(5);
    assert!(arm.status(1).warning);
    assert_eq!(arm.status(1).state, DriveState::Enabled);
    arm.simulator.clear(None);
    arm.steps(5);
    assert!(!arm.status(1).warning);
}

#[test]
fn motor_that_restarts_in_use_is_noticed_and_configured_anew() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(4, "kind=restart");
    arm.until_one(4, DriveState::Fault);
    // Commands to a motor in reset mode are not answered: it shows as one that fell silent.
    assert!(arm.why(4).contains("stopped answering"), "{}", arm.why(4));
    arm.simulator.clear(None);
    arm.disable();
    arm.enable();
}

/// Off and on again between two looks, it answers as if nothing had been: its watchdog tells.
#[test]
fn motor_that_restarts_while_it_is_off_is_noticed_before_it_is_energised() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.ready();
    arm.fault(4, "kind=restart");
    arm.steps(100);
    assert_eq!(arm.status(4).state, DriveState::Disabled);
    arm.hold();
    arm.drive_target = DriveTarget::Enabled;
    arm.until_one(4, DriveState::Fault);
    assert!(arm.why(4).contains("has restarted"), "{}", arm.why(4));
    assert!(!arm.servo(4).is_enabled());
    arm.simulator.clear(None);
    arm.disable();
    arm.enable();
}

#[test]
fn motor_without_feedback_keeps_its_commands_until_disabled_and_is_configured_anew() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(1, "kind=silence");
    arm.steps(100);
    let age_s = arm.now.since_s(arm.status(1).received.unwrap());
    assert!(age_s > 0.09, "its feedback grows old: {age_s} s");
    arm.until_one(1, DriveState::Fault);
    assert!(arm.why(1).contains("stopped answering"), "{}", arm.why(1));
    arm.step();
    assert_eq!(super::requests(&arm, 2).len(), 1, "it may still listen");
    arm.disable();
    arm.steps(1_000);
    assert_eq!(arm.status(1).state, DriveState::Absent);
    assert!(!arm.servo(1).is_enabled(), "it has dropped its torque");
    arm.simulator.clear(None);
    arm.enable();
}

/// A gap of commands longer than the watchdog, by our own fault: the motors are limp, and that is a fault.
#[test]
fn gap_beyond_the_watchdog_is_a_fault_of_every_motor() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.now.0 += 150_000_000;
    arm.steps(3);
    assert_eq!(arm.states(), [DriveState::Fault; JOINTS]);
    assert!(arm.why(0).contains("disabled itself, or restarted"), "{}", arm.why(0));
    arm.disable();
    arm.enable();
}

#[test]
fn jammed_and_slipping_joints_show_in_what_is_measured() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.steps(500);
    arm.fault(0, "kind=jump,value=0.3");
    let before_rad = arm.status(0).position_rad;
    arm.steps(3);
    let jump_rad = arm.status(0).position_rad - before_rad;
    assert!((0.2..0.31).contains(&jump_rad), "{jump_rad}");
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(0, "kind=stuck");
    arm.steps(5);
    arm.commands[0].position_rad += 0.1;
    arm.steps(500);
    let off_rad = (arm.status(0).position_rad - arm.commands[0].position_rad).abs();
    assert!(off_rad > 0.09, "a jammed joint does not follow: {off_rad}");
}

/// A lossy wire delays bring-up, and never energises a motor without its ramp or configures a wrong one.
#[test]
fn lossy_wire_only_delays_bring_up() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    for joint in 0..JOINTS {
        arm.fault(joint, "kind=drop,value=0.2");
    }
    arm.until(DriveState::Disabled);
    arm.simulator.clear(None);
    arm.enable();
}

/// A bus that was lost and is back: what was known of its motors is forgotten.
#[test]
fn bus_that_starts_over_looks_again_before_it_says_anything() {
    let mut arm = Arm::enabled(edited(&[]));
    // Longer than the motors' watchdog without a frame.
    for _ in 0..200 {
        arm.now.0 += 1_000_000;
        arm.inject(&[]);
    }
    arm.driver.start_over();
    assert_eq!(arm.states(), [DriveState::Absent; JOINTS]);
    arm.disable();
    arm.step();
    assert_eq!(motor(&arm, 0).faults(), 0);
    arm.until(DriveState::Disabled);
    arm.enable();
}
