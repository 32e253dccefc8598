//! Faults of joints, of the arm, of the wire and of others on the bus.
use super::Bench;
use taustream_drivers::protocols::piper::fault::arm_code;
use taustream_drivers::protocols::piper::frames::{ALL, Command, JOINTS};
use taustream_drivers::sim::Disturbance;
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

/// The joints that still have torque are not dropped with the one that lost it.
#[test]
fn joint_in_fault_has_its_words_and_the_others_get_their_targets() {
    let mut bench = Bench::enabled();
    bench.arm[2].disturb(Disturbance::Fault(0x04));
    bench.until_one(2, DriveState::Fault);
    bench.steps(20);
    assert_eq!(bench.why(2), "driver of the joint: over-current");
    assert_eq!(bench.commanded().len(), 3);
    assert!(bench.arm[0].driver_status() & 0x40 != 0);
    assert_eq!(bench.status(0).error_code, arm_code(9));

    bench.target = DriveTarget::Disabled;
    bench.steps(200);
    assert!(bench.arm.iter().all(|joint| joint.driver_status() & 0x40 == 0));
    assert_eq!(bench.status(2).state, DriveState::Fault, "a fault stays until it is cleared");
    bench.driver.clear_faults();
    bench.enable();
}

#[test]
fn emergency_stop_is_named_and_ends_on_request_when_the_arm_has_no_torque() {
    let mut bench = Bench::enabled();
    bench.inject(Command::Stop);
    bench.until_one(0, DriveState::Fault);
    bench.steps(5);
    assert!(bench.why(0).contains("emergency stop"), "{}", bench.why(0));
    bench.driver.clear_faults();
    bench.steps(20);
    assert!(bench.arm[0].driver_status() & 0x40 != 0, "clearing a fault must not drop an arm that holds");
    bench.target = DriveTarget::Disabled;
    bench.steps(100);
    bench.driver.clear_faults();
    bench.enable();
}

#[test]
fn arm_whose_control_is_taken_away_gets_no_targets_and_says_so() {
    let mut bench = Bench::enabled();
    bench.inject(Command::Mode { control: 0, movement: 0, speed_percent: 0, follow: 0 });
    bench.until(DriveState::Fault);
    assert!(bench.why(0).contains("takes no targets by CAN now"), "{}", bench.why(0));
    bench.step();
    assert_eq!(bench.commanded(), []);
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled);
    bench.enable();
}

#[test]
fn silent_arm_gets_its_targets_and_is_a_fault() {
    let mut bench = Bench::enabled();
    bench.silent = [true; JOINTS];
    bench.until(DriveState::Fault);
    assert!(bench.why(3).contains("stopped sending"), "{}", bench.why(3));
    assert_eq!(bench.commanded().len(), 3);
    let since_s = bench.now.since_s(bench.status(3).received.unwrap());
    assert!(since_s > 0.3, "its feedback counts as {since_s} s old");
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Absent);
    bench.silent = [false; JOINTS];
    // It is energised still: no frame reached it.
    bench.until(DriveState::EnergisedUnowned);
}

#[test]
fn joint_that_loses_its_torque_by_itself_is_a_fault_of_the_arm() {
    let mut bench = Bench::enabled();
    bench.inject(Command::Disable(5));
    bench.until(DriveState::Fault);
    assert!(bench.why(4).contains("lost its torque by itself"), "{}", bench.why(4));
}

#[test]
fn arm_that_another_master_energises_meanwhile_is_left_alone() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.inject(Command::Enable(ALL));
    bench.until(DriveState::EnergisedUnowned);
    bench.step();
    assert_eq!(bench.commanded(), []);
}

/// Limits that another program narrowed after they were compared.
#[test]
fn arm_that_was_changed_since_is_not_energised() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.hold();
    bench.target = DriveTarget::Enabled;
    for _ in 0..200 {
        bench.step();
        for frame in &mut bench.arriving {
            if frame.id().raw() == 0x473 && frame.data()[0] == 2 {
                let mut data = frame.data().to_vec();
                (data[1], data[2]) = (0, 100);
                *frame = taustream_drivers::CanFrame::classic(frame.id(), &data);
            }
        }
        bench.hold();
    }
    assert_eq!(bench.states(), [DriveState::Fault; JOINTS]);
    assert!(bench.why(1).contains("not as they were"), "{}", bench.why(1));
    assert!(bench.arm.iter().all(|joint| joint.driver_status() == 0));
}

#[test]
fn jammed_joint_and_shifted_encoder_show_in_the_feedback() {
    let mut bench = Bench::enabled();
    bench.arm[5].disturb(Disturbance::EncoderShift(0.2));
    bench.arm[0].disturb(Disturbance::Jammed(true));
    bench.steps(2);
    let before = bench.status(0).position_rad;
    let shifted_rad = bench.status(5).position_rad - bench.arm[5].position_rad();
    assert!((shifted_rad - 0.2).abs() < 0.03, "{shifted_rad}");
    bench.commands[0].position_rad += 0.2;
    bench.steps(40);
    assert!((bench.status(0).position_rad - before).abs() < 1e-4);
}
