//! Faults of drives, of the wire and of the master.
use super::{Bench, JOINTS, node};
use taustream_drivers::protocols::odrive::frames::{Command, ERROR_WATCHDOG};
use taustream_drivers::sim::Disturbance;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

#[test]
fn error_of_a_drive_stands_in_its_words_and_is_cleared_on_request() {
    let mut bench = Bench::enabled();
    bench.drives[1].disturb(Disturbance::Fault(0x2000));
    bench.until_one(1, DriveState::Fault);
    assert_eq!(bench.why(1), "ODrive error 0x2000: motor too hot");
    assert_eq!(bench.status(0).state, DriveState::Enabled);
    bench.target = DriveTarget::Disabled;
    bench.steps(200);
    assert_eq!(bench.status(1).state, DriveState::Fault, "an error stays until it is cleared");
    bench.driver.clear_faults();
    bench.until(DriveState::Disabled);
    bench.enable();
}

#[test]
fn drive_whose_watchdog_runs_out_is_disarmed_and_says_so() {
    let mut bench = Bench::enabled();
    // The master stalls: nothing is sent for longer than the watchdog allows.
    let mut out = Vec::new();
    for _ in 0..100 {
        bench.now.0 += super::CYCLE_NS;
        for drive in &mut bench.drives {
            drive.advance(bench.now, &mut out);
        }
    }
    assert!(bench.drives.iter().all(|drive| !drive.is_enabled() && drive.errors() == ERROR_WATCHDOG));
    bench.until(DriveState::Fault);
    for joint in 0..JOINTS {
        assert!(bench.status(joint).lost_master);
        assert!(bench.why(joint).contains("its watchdog allows"), "{}", bench.why(joint));
    }
    bench.target = DriveTarget::Disabled;
    bench.enable();
}

#[test]
fn silent_drive_gets_its_setpoints_and_is_a_fault() {
    let mut bench = Bench::enabled();
    bench.silent[2] = true;
    bench.until_one(2, DriveState::Fault);
    assert!(bench.why(2).contains("stopped sending"), "{}", bench.why(2));
    assert!(matches!(bench.commanded(2)[..], [Command::Position(_)]));
    let since_s = bench.now.since_s(bench.status(2).received.unwrap());
    assert!(since_s > 0.3, "its feedback counts as {since_s} s old");
    bench.target = DriveTarget::Disabled;
    bench.until_one(2, DriveState::Absent);
    bench.silent[2] = false;
    bench.until(DriveState::Disabled);
}

#[test]
fn drive_that_restarts_while_it_follows_is_configured_again() {
    let mut bench = Bench::enabled();
    bench.drives[0].disturb(Disturbance::Restart);
    bench.until_one(0, DriveState::Fault);
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled);
    assert_eq!(bench.drives[0].watchdog(), (super::TIMEOUT_S, true));
    bench.enable();
}

/// A restart that the master did not see has switched the watchdog off: that is looked at before energising.
#[test]
fn drive_that_forgot_its_watchdog_is_not_energised() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.drives[0].disturb(Disturbance::Restart);
    bench.steps(100);
    assert_eq!(bench.status(0).state, DriveState::Disabled);
    bench.hold();
    bench.target = DriveTarget::Enabled;
    bench.until_one(0, DriveState::Fault);
    assert!(bench.why(0).contains("has restarted"), "{}", bench.why(0));
    assert!(!bench.drives[0].is_enabled());
    bench.target = DriveTarget::Disabled;
    bench.steps(2);
    bench.enable();
}

#[test]
fn drive_that_another_program_disarms_is_a_fault_and_one_that_it_arms_is_left_alone() {
    let mut bench = Bench::enabled();
    let now = bench.now;
    bench.drives[0].receive(now, &Command::AxisState(1).encode(node(0)), &mut Vec::new());
    bench.until_one(0, DriveState::Fault);
    assert!(bench.why(0).contains("left closed loop by itself"), "{}", bench.why(0));

    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    let now = bench.now;
    bench.drives[1].receive(now, &Command::ClearErrors.encode(node(1)), &mut Vec::new());
    bench.drives[1].receive(now, &Command::AxisState(8).encode(node(1)), &mut Vec::new());
    bench.steps(20);
    bench.until_one(1, DriveState::EnergisedUnowned);
}

#[test]
fn jammed_joint_and_shifted_encoder_show_in_the_feedback() {
    let mut bench = Bench::enabled();
    bench.drives[0].disturb(Disturbance::Jammed(true));
    bench.drives[1].disturb(Disturbance::EncoderShift(0.2));
    bench.steps(5);
    let shifted_rad = bench.status(1).position_rad - bench.drives[1].position_rad();
    assert!((shifted_rad - 0.2).abs() < 0.02, "{shifted_rad}");
    let before = bench.status(0).position_rad;
    bench.travel(0.3, 100);
    assert!((bench.status(0).position_rad - before).abs() < 1e-4);
}
