//! Fourteen joints and two grippers on two and on four buses are one arm: enabled, moved, paused and stopped as one, by the
//! shipped cycle with its drivers against simulated motors.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    reason = "helpers of tests fail by panicking"
)]
#[expect(dead_code, reason = "shipped arms have tests of their own")]
mod arm;
mod bimanual;

use arm::Arm;
use bimanual::{GRIPPERS, JOINTS, settings};
use taustream_drivers::sim::{FaultRequest, ServoModel};
use taustream_messages::{AxisGoal, AxisState, Command, FaultReason, Phase};
use taustream_motion::JointArray;

/// A joint of this speed stands.
const STILL_RAD_S: f64 = 2e-3;
/// A joint of this speed moves.
const MOVING_RAD_S: f64 = 1e-2;

fn speeds(arm: &Arm) -> Vec<f64> {
    let speed = |slot| arm.simulator.simulator.drive(slot).map(ServoModel::velocity_rad_s).unwrap().abs();
    (0..JOINTS + GRIPPERS).map(speed).collect()
}

fn commanded(arm: &Arm) -> JointArray {
    arm.newest.unwrap().position_rad
}

/// In the middle of a motion of all joints.
fn moving(name: &str, buses: usize) -> Arm {
    let mut arm = Arm::new(name, settings(buses));
    arm.enable();
    arm.move_it(1.0);
    arm.run(600);
    let slow: Vec<usize> = (0..JOINTS).filter(|joint| speeds(&arm)[*joint] < MOVING_RAD_S).collect();
    assert!(slow.is_empty(), "joints {slow:?} do not move");
    arm
}

/// Every joint stands, and its command too.
fn all_stand(arm: &mut Arm) {
    let before = commanded(arm);
    arm.run(50);
    let after = commanded(arm);
    assert_eq!(before[..JOINTS], after[..JOINTS], "commands go on");
    let fast: Vec<usize> = (0..JOINTS).filter(|joint| speeds(arm)[*joint] > STILL_RAD_S).collect();
    assert!(fast.is_empty(), "joints {fast:?} do not stand: {:?}", speeds(arm));
}

fn request(arm: &mut Arm, fault: &str) {
    let request = FaultRequest::parse(fault, &arm.simulator.simulator.joints()).unwrap();
    arm.simulator.simulator.request(arm.now(), request);
}

#[test]
fn sixteen_servos_are_enabled_moved_paused_and_stopped_as_one() {
    for buses in [2, 4] {
        let mut arm = moving(&format!("one-{buses}"), buses);
        arm.ask(Command::Pause);
        arm.run_until(Phase::Paused, 1_500);
        arm.run(200);
        all_stand(&mut arm);
        arm.ask(Command::Resume);
        arm.run_until(Phase::Holding, 8_000);
        let reached = commanded(&arm);
        arm.ask(Command::Axis { axis: 1, goal: AxisGoal::Open, force: None });
        arm.run(3_000);
        assert_eq!(arm.newest.unwrap().axes[1].state(), AxisState::Holding);
        let grippers =
            [JOINTS, JOINTS + 1].map(|slot| arm.simulator.simulator.drive(slot).unwrap().position_rad());
        assert!((grippers[0] - 2.0).abs() < 0.05 && (grippers[1] - 4.0).abs() < 0.05, "{grippers:?}");
        for (joint, reached_rad) in reached.iter().enumerate().take(JOINTS) {
            let measured = arm.simulator.simulator.drive(joint).unwrap().position_rad();
            assert!((measured - reached_rad).abs() < 0.02, "joint {joint} is at {measured}");
        }
        arm.move_it(0.7);
        arm.run(500);
        arm.ask(Command::Stop);
        arm.run_until(Phase::Holding, 1_500);
        arm.run(200);
        all_stand(&mut arm);
        arm.ask(Command::Disable);
        arm.run_until(Phase::Disabled, 1_500);
    }
}

/// Whichever servo is silent, on whichever bus: the whole arm stops, and the fault names it.
#[test]
fn sixteen_servos_stop_when_one_is_silent_and_the_fault_names_it() {
    for (buses, silent) in [(2, "2"), (2, "14"), (4, "9"), (4, "gripper2")] {
        let mut arm = moving(&format!("silent-{buses}-{silent}"), buses);
        let slot = silent.parse::<usize>().map_or(JOINTS + 1, |number| number - 1);
        request(&mut arm, &format!("joint={silent},kind=silence"));
        arm.run_until(Phase::Fault, 3_000);
        let cause = arm.core.supervisor().cause().expect("a fault has a cause");
        assert_eq!(cause.joint, Some(slot), "{buses} buses, servo {silent}: {cause:?}");
        assert!(
            matches!(cause.reason, FaultReason::FeedbackLate | FaultReason::DriveFault),
            "{buses} buses, servo {silent}: {cause:?}"
        );
        arm.run(300);
        all_stand(&mut arm);
    }
}

/// A bus that is gone stops the joints of the others, on their path, and is named.
#[test]
fn sixteen_servos_stop_when_one_bus_is_gone_and_the_fault_names_it() {
    for (buses, gone) in [(2, 0), (2, 1), (4, 2)] {
        let mut arm = moving(&format!("gone-{buses}-{gone}"), buses);
        arm.far_ends[gone] = None;
        arm.run_until(Phase::Fault, 3_000);
        let cause = arm.core.supervisor().cause().expect("a fault has a cause");
        assert_eq!((cause.reason, cause.bus), (FaultReason::BusFault, Some(gone)), "{cause:?}");
        arm.run(300);
        let per_bus = (JOINTS + GRIPPERS) / buses;
        let others = (0..JOINTS).filter(|joint| joint / per_bus != gone);
        let fast: Vec<usize> = others.filter(|joint| speeds(&arm)[*joint] > STILL_RAD_S).collect();
        assert!(fast.is_empty(), "joints {fast:?} of the other buses do not stand: {:?}", speeds(&arm));
        let held = (0..JOINTS).filter(|joint| joint / per_bus != gone);
        let off: Vec<usize> = held.filter(|joint| !enabled(&arm, *joint)).collect();
        assert!(off.is_empty(), "joints {off:?} of the other buses do not hold");
    }
}

fn enabled(arm: &Arm, slot: usize) -> bool {
    arm.simulator.simulator.drive(slot).unwrap().is_enabled()
}
