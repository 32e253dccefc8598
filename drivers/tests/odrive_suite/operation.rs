//! Energising, following, de-energising.
use super::{Bench, JOINTS, START_RAD, node};
use taustream_drivers::protocols::odrive::frames::{Command, InputPosition};
use taustream_drivers::{DriveState, DriveTarget, FrameBatch, JointCommand, JointSet, ServoDriver};

#[test]
fn drives_hold_where_they_stand_and_follow_a_motion() {
    let mut bench = Bench::enabled();
    bench.steps(100);
    for joint in 0..JOINTS {
        let moved_rad = bench.drives[joint].position_rad() - START_RAD[joint];
        assert!(moved_rad.abs() < 2e-3, "joint {joint} moved by {moved_rad} rad while it was energised");
    }
    let worst_rad = bench.travel(0.6, 750);
    assert!(worst_rad < 0.02, "{worst_rad} rad behind");
    bench.steps(250);
    for joint in 0..JOINTS {
        let away_rad = bench.drives[joint].position_rad() - bench.commands[joint].position_rad;
        assert!(away_rad.abs() < 1e-3, "joint {joint} rests {away_rad} rad away");
        assert!((bench.status(joint).position_rad - bench.drives[joint].position_rad()).abs() < 1e-3);
    }
}

#[test]
fn setpoints_are_marked_with_their_joint_and_there_is_one_to_a_drive_in_a_cycle() {
    let mut bench = Bench::enabled();
    let mut batch = FrameBatch::new();
    bench.driver.encode(bench.now, bench.target, &bench.commands, &mut batch);
    assert_eq!(batch.frames().len(), JOINTS);
    for (joint, frame) in batch.frames().iter().enumerate() {
        assert!(matches!(Command::decode(frame, node(joint)), Some(Command::Position(_))));
    }
    let all = (0..JOINTS).fold(JointSet::EMPTY, |all, joint| all.union(JointSet::of(joint)));
    assert_eq!(batch.setpoints_in(JOINTS), all);
    assert_eq!(batch.setpoints_in(1), JointSet::of(0));
}

/// A setpoint that the drive remembers from before must not take effect: the new one comes first, in the same cycle.
#[test]
fn remembered_setpoint_does_not_move_a_drive_that_is_energised() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    let far = InputPosition { position_turns: 50.0, velocity_mturns_s: 0, torque_mnm: 0 };
    for joint in 0..JOINTS {
        let now = bench.now;
        bench.drives[joint].receive(now, &Command::Position(far).encode(node(joint)), &mut Vec::new());
    }
    bench.enable();
    bench.steps(100);
    for joint in 0..JOINTS {
        let moved_rad = bench.drives[joint].position_rad() - START_RAD[joint];
        assert!(moved_rad.abs() < 5e-3, "joint {joint} moved by {moved_rad} rad");
    }
}

/// A second request would interrupt the first.
#[test]
fn closed_loop_is_requested_once_while_the_heartbeat_is_slow() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.steps(50);
    bench.hold();
    bench.target = DriveTarget::Enabled;
    let mut requests = 0;
    while bench.states() != [DriveState::Enabled; JOINTS] {
        bench.step();
        requests += bench.commanded(0).iter().filter(|command| **command == Command::AxisState(8)).count();
    }
    assert_eq!(requests, 1);
}

#[test]
fn command_far_from_where_the_drive_stands_energises_nothing() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.hold();
    bench.commands[1].position_rad += 0.3;
    bench.commands[2].position_rad = f64::NAN;
    bench.target = DriveTarget::Enabled;
    bench.steps(500);
    for joint in [1, 2] {
        assert_eq!(bench.status(joint).state, DriveState::Fault, "joint {joint}");
        assert!(bench.why(joint).contains("too far from the measured position"), "{}", bench.why(joint));
        assert!(!bench.drives[joint].is_enabled());
    }
    assert_eq!(bench.status(0).state, DriveState::Enabled);
}

#[test]
fn command_that_is_no_number_keeps_the_last_position_at_rest() {
    let mut bench = Bench::enabled();
    let before = bench.drives[0].position_rad();
    bench.commands[0] =
        JointCommand { position_rad: f64::NAN, velocity_rad_s: 1.0, ..JointCommand::default() };
    bench.steps(100);
    let Some(Command::Position(input)) = bench.commanded(0).first().copied() else { panic!("no setpoint") };
    assert!(input.position_turns.is_finite() && input.velocity_mturns_s == 0);
    assert!((bench.drives[0].position_rad() - before).abs() < 2e-3);
}

#[test]
fn drives_are_disabled_and_enabled_again_though_their_watchdog_ran_out_meanwhile() {
    let mut bench = Bench::enabled();
    bench.target = DriveTarget::Disabled;
    bench.until(DriveState::Disabled);
    bench.steps(500);
    assert!(
        bench.drives.iter().all(|drive| drive.errors() != 0),
        "the simulated watchdog runs while idle too"
    );
    assert_eq!(bench.states(), [DriveState::Disabled; JOINTS]);
    bench.enable();
}

#[test]
fn torque_off_is_sent_at_once_in_every_state() {
    let mut bench = Bench::new();
    bench.steps(40);
    bench.target = DriveTarget::TorqueOff;
    bench.step();
    for joint in 0..JOINTS {
        assert_eq!(bench.commanded(joint), [Command::AxisState(1)]);
    }
    let mut bench = Bench::enabled();
    bench.target = DriveTarget::TorqueOff;
    bench.step();
    assert!(bench.drives.iter().all(|drive| !drive.is_enabled()));
}

#[test]
fn zero_is_not_offered() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    assert_eq!(bench.driver.set_zero(0), Err(taustream_drivers::ZeroRefused::NotOffered));
}
