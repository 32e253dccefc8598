//! What goes wrong with a motor in use, and that nothing comes back by itself.
use super::{Arm, DamiaoArm, JOINTS, START_RAD, edited};
use crate::motor_bench::file;
use taustream_arm::Settings;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn error_of_a_motor_has_text_and_is_cleared_only_on_command() {
    for (code, words) in [
        ("0x8", "over-voltage"),
        ("0xA", "over-current"),
        ("0xC", "winding is too hot"),
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
        arm.clear_faults();
        arm.until_one(2, DriveState::Disabled);
        arm.steps(500);
        assert_eq!(
            (arm.status(2).state, arm.nibble(2)),
            (DriveState::Disabled, 0),
            "and is not energised by itself"
        );
        arm.drive_target = DriveTarget::Disabled;
        arm.step();
        arm.enable();
    }
}

#[test]
fn motor_that_restarts_in_use_is_noticed_and_configured_anew() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.fault(4, "kind=restart");
    arm.until_one(4, DriveState::Fault);
    assert!(arm.why(4).contains("disabled itself, or restarted"), "{}", arm.why(4));
    arm.simulator.clear(None);
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
    arm.enable();
}

/// Off and on again between two looks, it answers as if nothing had been: its registers tell.
#[test]
fn motor_that_restarts_while_it_is_off_is_noticed_before_it_is_energised() {
    let mut arm = Arm::new();
    arm.until(DriveState::Disabled);
    arm.steps(50);
    arm.fault(4, "kind=restart");
    arm.steps(100);
    assert_eq!(arm.status(4).state, DriveState::Disabled);
    arm.hold();
    arm.drive_target = DriveTarget::Enabled;
    arm.until_one(4, DriveState::Fault);
    assert!(arm.why(4).contains("has restarted"), "{}", arm.why(4));
    assert_eq!(arm.nibble(4), 0);
    arm.simulator.clear(None);
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
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
    assert_eq!(arm.under(2).len(), 1, "it may still listen");
    arm.drive_target = DriveTarget::Disabled;
    arm.steps(1_000);
    assert_eq!(arm.status(1).state, DriveState::Absent);
    assert_eq!(arm.nibble(1), 0xD, "it has disabled itself");
    arm.simulator.clear(None);
    arm.until_one(1, DriveState::Fault);
    assert!(arm.why(1).contains("no command for longer"), "{}", arm.why(1));
    arm.clear_faults();
    arm.enable();
}

/// A gap of commands longer than TIMEOUT, by our own fault: the motors are limp, and say why.
#[test]
fn gap_beyond_the_watchdog_is_a_fault_of_every_motor() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.now.0 += 150_000_000;
    arm.steps(3);
    assert_eq!(arm.states(), [DriveState::Fault; JOINTS]);
    assert!(arm.why(0).contains("no command for longer than its TIMEOUT"), "{}", arm.why(0));
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
    arm.clear_faults();
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
    let mut arm = Arm::new();
    for joint in 0..JOINTS {
        arm.fault(joint, "kind=drop,value=0.2");
    }
    arm.until(DriveState::Disabled);
    arm.simulator.clear(None);
    arm.enable();
}

/// A bus that was lost and is back: what was known of its motors is forgotten, and an energised one is left alone.
#[test]
fn bus_that_starts_over_looks_again_before_it_says_anything() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.driver.start_over();
    assert_eq!(arm.states(), [DriveState::Absent; JOINTS]);
    arm.drive_target = DriveTarget::Disabled;
    arm.until(DriveState::EnergisedUnowned);
    // They get no commands now: their own watchdogs disable them, which is reported before anything is cleared.
    arm.until(DriveState::Fault);
    arm.clear_faults();
    arm.enable();
}

/// The shipped CiA 402 arm with Damiao motors at elbow and last joint.
fn mixed() -> Settings {
    let path = file("vcan6.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (node, feedback) in [(3, 0x1D), (6, 0x1E)] {
        let cia402 = format!(
            "node_id = {node}\nprotocol = \"cia402\"\nsign = 1\ngear_ratio = 101.0\ncounts_per_rev = 131072.0\n"
        );
        let damiao = format!(
            "node_id = {}\nprotocol = \"damiao\"\nsign = 1\nfeedback_id = {feedback}\nmode = \"mit\"\n\
             position_range_rad = 12.5\nvelocity_range_rad_s = 30.0\ntorque_range_nm = 150.0\nwatchdog_ms = 100\n\
             stiffness_nm_rad = 500.0\ndamping_nm_s_rad = 5.0\ngain_ramp_ms = 100\n",
            node + 6
        );
        let (before, after) = text.split_once(&cia402).unwrap();
        text = format!("{before}{damiao}{}", after.replacen("reaction = \"ramp\"", "reaction = \"limp\"", 1));
    }
    let text = text.replace("gravity_nm = [0.0, 60.0, 25.0,", "gravity_nm = [0.0, 60.0, 10.0,");
    Settings::from_toml(&path, &text).unwrap_or_else(|faults| panic!("{faults}"))
}

#[test]
fn bus_of_two_protocols_comes_up_follows_and_sends_one_sync_a_cycle() {
    let mut arm = Arm::enabled(mixed());
    arm.steps(300);
    let base = arm.commands;
    let mut worst_rad = [0.0_f64; JOINTS];
    for cycle in 0..2_000 {
        let t_s = f64::from(cycle) * 1e-3;
        for (command, base) in arm.commands.iter_mut().zip(base) {
            command.position_rad = base.position_rad + 0.2 * (1.0 - (2.0 * t_s).cos());
            command.velocity_rad_s = 0.4 * (2.0 * t_s).sin();
        }
        arm.step();
        assert_eq!(arm.under(0x080).len(), 1, "SYNC once a cycle");
        assert_eq!(arm.sent[0].id().raw(), 0x080, "and first");
        for (joint, worst) in worst_rad.iter_mut().enumerate() {
            *worst = worst.max((arm.status(joint).position_rad - arm.commands[joint].position_rad).abs());
        }
    }
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
    assert!(worst_rad.iter().all(|worst| *worst < 0.08), "{worst_rad:?}");
    // A fault of a motor leaves the drives alone, and the other way round.
    arm.fault(2, "kind=fault,value=0xA");
    arm.until_one(2, DriveState::Fault);
    assert_eq!(arm.status(0).state, DriveState::Enabled);
    arm.fault(0, "kind=fault,value=0x3210");
    arm.until_one(0, DriveState::Fault);
    assert_eq!(arm.status(5).state, DriveState::Enabled);
    assert!(arm.why(0).contains("0x3210") && arm.why(2).contains("over-current"));
    arm.drive_target = DriveTarget::Disabled;
    arm.simulator.clear(None);
    arm.steps(500);
    arm.clear_faults();
    arm.until(DriveState::Disabled);
    assert!(START_RAD.len() == JOINTS);
}
