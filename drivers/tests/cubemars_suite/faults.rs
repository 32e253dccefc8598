//! What goes wrong with a motor in use, and that nothing comes back by itself.
use super::{edited, requests};
use crate::motor_bench::{Arm, JOINTS};
use taustream_drivers::{DriveState, ServoDriver};

#[test]
fn error_of_a_motor_has_text_and_is_cleared_only_on_command() {
    for (code, words) in [
        ("1", "winding is too hot"),
        ("2", "over-current"),
        ("4", "under-voltage"),
        ("5", "encoder"),
        ("7", "blocked"),
        ("0x7305", "over-current"),
    ] {
        let mut arm = Arm::enabled(edited(&[]));
        arm.fault(2, &format!("kind=fault,value={code}"));
        arm.until_one(2, DriveState::Fault);
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
fn motor_without_feedback_keeps_its_commands_until_disabled_and_is_looked_at_anew() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(1, "kind=silence");
    arm.steps(100);
    let age_s = arm.now.since_s(arm.status(1).received.unwrap());
    assert!(age_s > 0.09, "its feedback grows old: {age_s} s");
    arm.until_one(1, DriveState::Fault);
    assert!(arm.why(1).contains("stopped answering"), "{}", arm.why(1));
    arm.step();
    assert_eq!(requests(&arm, 2).len(), 1, "it may still listen");
    arm.disable();
    arm.steps(1_000);
    assert_eq!(arm.status(1).state, DriveState::Absent);
    arm.simulator.clear(None);
    arm.enable();
}

/// A motor that starts again in use answers nothing for longer than feedback may be missing.
#[test]
fn motor_that_restarts_in_use_is_a_fault_when_it_takes_its_time() {
    let mut arm = Arm::with(edited(&[]), |setup| super::motor_of(setup).boot_s = 0.6);
    arm.enable();
    arm.fault(4, "kind=restart");
    arm.until_one(4, DriveState::Fault);
    assert!(arm.why(4).contains("stopped answering"), "{}", arm.why(4));
    arm.simulator.clear(None);
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

/// A lossy wire delays bring-up, and never energises a motor without its ramp.
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

/// A bus that was lost and is back: what was known of its motors is forgotten, and they are asked only after their watchdog.
#[test]
fn bus_that_starts_over_waits_for_the_watchdog_before_it_asks() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.driver.start_over();
    arm.arriving.clear();
    assert_eq!(arm.states(), [DriveState::Absent; JOINTS]);
    arm.disable();
    for _ in 0..150 {
        assert!(arm.sent.is_empty(), "{:?}", arm.sent);
        arm.step();
    }
    arm.until(DriveState::Disabled);
    arm.enable();
}
