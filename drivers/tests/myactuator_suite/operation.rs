//! Energising, following, letting go.
use super::{edited, position_mode, requests};
use crate::motor_bench::{Arm, JOINTS};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::myactuator::frames::{Request, rad_of};
use taustream_drivers::{DriveState, DriveTarget, ServoDriver};

/// What a motor of the arm is commanded in the newest cycle.
fn command(arm: &Arm, joint: usize) -> Option<MitCommand> {
    let spans = MitRanges::symmetric(12.5, 45.0, 24.0);
    requests(arm, arm.settings.servos[joint].node_id).into_iter().find_map(|request| {
        let Request::Motion(bytes) = request else { return None };
        Some(MitCommand::decode(bytes, &spans))
    })
}

#[test]
fn gains_rise_from_nothing_over_the_ramp_and_no_motor_leaps() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.ready();
    let before_rad = arm.servo(0).position_rad();
    arm.drive_target = DriveTarget::Enabled;
    let mut ramp = Vec::new();
    for _ in 0..500 {
        arm.step();
        ramp.extend(command(&arm, 1).map(|command| command.stiffness_nm_rad));
        let moved_rad = (arm.servo(0).position_rad() - before_rad).abs();
        assert!(moved_rad < 0.01, "the pan, which carries no load, jumps by {moved_rad} rad");
    }
    assert!(ramp[0] < 2.5, "the first is without gains: {ramp:?}");
    assert!(ramp.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] <= 2.3), "{ramp:?}");
    assert!((ramp[ramp.len() - 1] - 400.0).abs() < 0.2);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
}

#[test]
fn motors_follow_a_sine_under_gravity_in_each_mode() {
    for (settings, worst_rad) in [(edited(&[]), 0.06), (position_mode(), 0.06)] {
        let mut arm = Arm::enabled(settings);
        arm.steps(500);
        let errors_rad = arm.swing(3_000);
        assert_eq!(arm.states(), [DriveState::Enabled; JOINTS], "{}", arm.why(0));
        println!("largest distances from the command {errors_rad:?} rad");
        assert!(errors_rad.iter().all(|error| *error < worst_rad), "{errors_rad:?}");
    }
}

#[test]
fn command_in_position_mode_states_angle_and_largest_speed_and_asks_for_the_angle() {
    let arm = {
        let mut arm = Arm::enabled(position_mode());
        arm.commands[0].position_rad = arm.status(0).position_rad + 0.01;
        arm.step();
        arm
    };
    let asked = requests(&arm, 1);
    let [Request::Position { angle, speed }, Request::Angle, ..] = asked[..] else { panic!("{asked:?}") };
    assert!((rad_of(angle) - arm.commands[0].position_rad).abs() < 1e-4);
    let limit = arm.settings.robot.joints[0].limits.stop.velocity_rad_s.to_degrees();
    assert!((f64::from(speed) - limit).abs() <= 1.0, "{speed} for {limit}");
}

#[test]
fn disabling_cuts_the_output_first_and_then_engages_the_brake() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.disable();
    let mut asked = requests(&arm, 1);
    while arm.states().iter().any(|state| *state != DriveState::Disabled) {
        arm.step();
        asked.extend(requests(&arm, 1));
        assert!(asked.len() < 200, "{asked:?}");
    }
    let at = |wanted| asked.iter().position(|request| *request == wanted).unwrap();
    assert!(at(Request::Shutdown) < at(Request::Lock), "{asked:?}");
    assert!((0..JOINTS).all(|joint| !arm.servo(joint).is_enabled()));
}

#[test]
fn torque_that_is_fed_forward_reaches_the_motor_in_its_direction() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.commands[0].torque_nm = 5.0;
    arm.commands[1].torque_nm = 5.0;
    arm.step();
    let torque_nm = |joint: usize| command(&arm, joint).unwrap().torque_nm;
    assert!((torque_nm(0) - 5.0).abs() < 48.0 / 4095.0, "{}", torque_nm(0));
    assert!((torque_nm(1) + 5.0).abs() < 48.0 / 4095.0, "turned round: {}", torque_nm(1));
}

#[test]
fn zero_is_set_where_the_motor_stands_and_acts_after_its_restart() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.ready();
    arm.driver.set_zero(2).unwrap();
    arm.steps(1_500);
    arm.until(DriveState::Disabled);
    arm.steps(5);
    assert!(arm.status(2).position_rad.abs() < 1e-3, "{}", arm.status(2).position_rad);
}
