//! Energising, following, de-energising.
use super::Bench;
use taustream_drivers::protocols::piper::frames::{ALL, Command, FOLLOW_FAST, JOINTS};
use taustream_drivers::{
    DriveState, DriveTarget, FrameBatch, JointCommand, JointSet, ServoDriver, ZeroRefused,
};

#[test]
fn arm_holds_where_it_stands_and_follows_a_motion() {
    let mut bench = Bench::enabled();
    let from: Vec<f64> = (0..JOINTS).map(|joint| bench.commands[joint].position_rad).collect();
    for (joint, from_rad) in from.iter().enumerate() {
        let moved_rad = bench.arm[joint].position_rad() - from_rad;
        assert!(moved_rad.abs() < 0.01, "joint {joint} moved by {moved_rad} rad while it was energised");
    }
    let mut worst_rad = 0.0_f64;
    for cycle in 1..=300 {
        let phase = std::f64::consts::PI * f64::from(cycle) / 300.0;
        for (joint, from_rad) in from.iter().enumerate() {
            bench.commands[joint].position_rad = from_rad + 0.2 * (1.0 - phase.cos());
        }
        bench.step();
        for joint in 0..JOINTS {
            let away_rad = bench.arm[joint].position_rad() - bench.commands[joint].position_rad;
            worst_rad = worst_rad.max(away_rad.abs());
        }
    }
    assert!(worst_rad < 0.02, "{worst_rad} rad behind");
    bench.steps(100);
    for joint in 0..JOINTS {
        let away_rad = bench.arm[joint].position_rad() - bench.commands[joint].position_rad;
        assert!(away_rad.abs() < 1e-3, "joint {joint} rests {away_rad} rad away");
        assert!((bench.status(joint).position_rad - bench.arm[joint].position_rad()).abs() < 1e-3);
    }
}

#[test]
fn cycle_has_three_frames_and_each_is_marked_with_its_two_joints() {
    let mut bench = Bench::enabled();
    let mut batch = FrameBatch::new();
    bench.driver.encode(bench.now, bench.target, &bench.commands, &mut batch);
    assert_eq!(batch.frames().len(), 3);
    for (pair, frame) in (0_u8..).zip(batch.frames()) {
        assert!(matches!(Command::decode(frame), Some(Command::Targets(of, _)) if of == pair));
    }
    assert_eq!(batch.setpoints_in(1), JointSet::of(0).union(JointSet::of(1)));
    let all = (0..JOINTS).fold(JointSet::EMPTY, |all, joint| all.union(JointSet::of(joint)));
    assert_eq!(batch.setpoints_in(3), all);
}

/// Energised first, commanded to take targets then: and before either, the targets are where the arm stands.
#[test]
fn targets_come_before_the_joints_are_energised_and_before_they_are_taken() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    // A target of somebody else, which the arm remembers.
    bench.inject(Command::Targets(0, [140_000, 170_000]));
    bench.steps(2);
    bench.hold();
    bench.target = DriveTarget::Enabled;
    let mut order = Vec::new();
    while bench.states() != [DriveState::Enabled; JOINTS] {
        bench.step();
        order.extend(bench.commanded().into_iter().filter(|command| command.acts()));
    }
    assert!(matches!(
        order[..4],
        [Command::Targets(0, _), Command::Targets(1, _), Command::Targets(2, _), Command::Enable(ALL)]
    ));
    let mode = Command::Mode { control: 1, movement: 1, speed_percent: 100, follow: FOLLOW_FAST };
    assert!(order.contains(&mode));
    bench.steps(50);
    for joint in 0..JOINTS {
        let away_rad = bench.arm[joint].position_rad() - bench.commands[joint].position_rad;
        assert!(away_rad.abs() < 0.02, "joint {joint} is {away_rad} rad away");
    }
}

#[test]
fn command_far_from_where_the_arm_stands_energises_nothing() {
    let mut bench = Bench::new();
    bench.until(DriveState::Disabled);
    bench.hold();
    bench.commands[2].position_rad += 0.3;
    bench.target = DriveTarget::Enabled;
    bench.until(DriveState::Fault);
    assert!(bench.why(2).contains("too far from the measured position"), "{}", bench.why(2));
    assert!(bench.arm.iter().all(|joint| joint.driver_status() == 0));
}

#[test]
fn command_that_is_no_number_keeps_the_last_target() {
    let mut bench = Bench::enabled();
    let before = bench.arm[1].position_rad();
    bench.commands[1] = JointCommand { position_rad: f64::NAN, ..JointCommand::default() };
    bench.steps(100);
    assert!((bench.arm[1].position_rad() - before).abs() < 0.01);
}

#[test]
fn arm_falls_when_it_is_disabled_and_torque_off_is_sent_at_once_in_every_state() {
    let mut bench = Bench::enabled();
    bench.target = DriveTarget::Disabled;
    bench.step();
    assert_eq!(bench.commanded(), [Command::Disable(ALL)]);
    bench.until(DriveState::Disabled);
    bench.enable();
    bench.target = DriveTarget::TorqueOff;
    bench.step();
    assert_eq!(bench.commanded(), [Command::Disable(ALL)]);
    assert!(bench.arm.iter().all(|joint| joint.driver_status() == 0));

    let mut bench = Bench::new();
    bench.steps(15);
    bench.target = DriveTarget::TorqueOff;
    bench.step();
    assert_eq!(bench.commanded(), [Command::Disable(ALL)]);
}

#[test]
fn zero_is_set_for_a_joint_that_is_not_energised() {
    let mut bench = Bench::with(|_, parameters| parameters.plant.gravity_nm = 0.0);
    assert_eq!(bench.driver.set_zero(4), Err(ZeroRefused::NotReady));
    bench.until(DriveState::Disabled);
    bench.driver.set_zero(4).unwrap();
    bench.steps(5);
    assert!(bench.status(4).position_rad.abs() < 2e-5, "{}", bench.status(4).position_rad);
    assert!(bench.status(5).position_rad.abs() > 0.1);
    assert_eq!(bench.driver.set_zero(6), Err(ZeroRefused::NoSuchJoint));
    bench.enable();
    assert_eq!(bench.driver.set_zero(4), Err(ZeroRefused::NotReady));
}
