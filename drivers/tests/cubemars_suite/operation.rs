//! Energising, following, letting go.
use super::{edited, energised, requests};
use crate::motor_bench::{Arm, JOINTS};
use taustream_arm::{CubeMars, Settings};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::cubemars::frames::{Request, Special};
use taustream_drivers::{DriveState, DriveTarget, JointCommand, ServoDriver, ZeroRefused};

const ENTER: Request = Request::Special(Special::Enter);
const EXIT: Request = Request::Special(Special::Exit);

/// What a motor of the arm is commanded last in the newest cycle, decoded with its ranges.
fn command(arm: &Arm, joint: usize) -> Option<MitCommand> {
    let servo = &arm.settings.servos[joint];
    let reach = servo.protocol.get::<CubeMars>()?.ranges;
    let ranges = MitRanges::symmetric(reach.position_rad, reach.velocity_rad_s, reach.torque_nm);
    requests(arm, servo.node_id).into_iter().rev().find_map(|request| match request {
        Request::Mit(bytes) => Some(MitCommand::decode(bytes, &ranges)),
        Request::Special(_) => None,
    })
}

#[test]
fn enter_is_sent_three_times_with_a_command_without_gains_right_behind_and_gains_rise() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.ready();
    arm.drive_target = DriveTarget::Enabled;
    let (mut ramp, mut enters) = (Vec::new(), 0);
    for _ in 0..500 {
        arm.step();
        let asked = requests(&arm, 2);
        if asked.contains(&ENTER) {
            enters += 1;
            assert!(matches!(asked[..], [ENTER, Request::Mit(_)]), "{asked:?}");
        }
        if let Some(command) = command(&arm, 1) {
            ramp.push(command.stiffness_nm_rad);
            let share = command.stiffness_nm_rad / 400.0;
            assert!((command.damping_nm_s_rad / 5.0 - share).abs() < 2e-3, "damping lags at {share}");
        }
    }
    assert_eq!(enters, 3);
    assert!(ramp[..3].iter().all(|stiffness| stiffness.abs() < 2.5), "the first are without gains: {ramp:?}");
    let rising = ramp.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] <= 400.0 / 200.0 + 0.25);
    assert!(rising, "2 Nm/rad a cycle, and never down: {ramp:?}");
    assert!((ramp[ramp.len() - 1] - 400.0).abs() < 0.2);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
}

/// A motor that remembers an earlier command with full gains: at "enter" it is replaced within the same cycle.
#[test]
fn old_command_with_full_gains_is_not_followed_when_the_motor_is_energised() {
    let mut arm = Arm::with(edited(&[]), |setup| super::motor_of(setup).timeout_ms = 0);
    arm.ready();
    let there = MitCommand {
        position_rad: 3.0,
        stiffness_nm_rad: 400.0,
        damping_nm_s_rad: 1.0,
        ..MitCommand::default()
    };
    let there = Request::Mit(there.encode(&MitRanges::symmetric(12.5, 50.0, 65.0)).unwrap());
    arm.inject(&[ENTER.encode(1), there.encode(1), EXIT.encode(1)]);
    let before_rad = arm.servo(0).position_rad();
    arm.hold();
    arm.drive_target = DriveTarget::Enabled;
    for _ in 0..400 {
        arm.step();
        let moved_rad = (arm.servo(0).position_rad() - before_rad).abs();
        assert!(moved_rad < 0.01, "the pan, which carries no load, jumps by {moved_rad} rad");
    }
    assert_eq!(arm.status(0).state, DriveState::Enabled);
}

#[test]
fn motors_follow_a_sine_under_gravity_and_gains_act() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.steps(500);
    let errors_rad = arm.swing(3_000);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
    println!("largest distances from the command {errors_rad:?} rad");
    assert!(errors_rad.iter().all(|error| *error < 0.06), "{errors_rad:?}");
    // Gravity bends a spring: shoulder lift carries more than pan.
    assert!(errors_rad[1] > 1.5 * errors_rad[0], "gains act: {errors_rad:?}");
}

#[test]
fn torque_that_is_fed_forward_reaches_the_motor_in_its_direction_and_is_cut_off() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.commands[0].torque_nm = 5.0;
    arm.commands[1].torque_nm = 5.0;
    arm.commands[3].torque_nm = 1e9;
    arm.step();
    let torque_nm = |joint: usize| command(&arm, joint).unwrap().torque_nm;
    assert!((torque_nm(0) - 5.0).abs() < 130.0 / 4095.0, "{}", torque_nm(0));
    assert!((torque_nm(1) + 5.0).abs() < 130.0 / 4095.0, "turned round: {}", torque_nm(1));
    assert!((torque_nm(3) - 15.0).abs() < 1e-9, "{}", torque_nm(3));
}

#[test]
fn command_that_is_no_number_leaves_the_last_angle_and_no_velocity() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.commands[0].velocity_rad_s = 1.0;
    arm.step();
    let before = command(&arm, 0).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let good = arm.commands[0];
        arm.commands[0] = JointCommand { position_rad: bad, ..good };
        arm.step();
        arm.commands[0] = good;
        let got = command(&arm, 0).unwrap();
        assert!((got.position_rad - before.position_rad).abs() < 1e-12, "{got:?}");
        assert!(got.velocity_rad_s.abs() < 0.03 && got.torque_nm.abs() < 0.03, "{got:?}");
    }
}

#[test]
fn command_far_from_the_joint_energises_nothing() {
    let mut arm = Arm::with(edited(&[]), |_| {});
    arm.ready();
    arm.commands[2].position_rad += 0.06;
    arm.drive_target = DriveTarget::Enabled;
    arm.until_one(2, DriveState::Fault);
    assert!(arm.why(2).contains("too far from the measured position"), "{}", arm.why(2));
    assert!(!arm.servo(2).is_enabled());
}

#[test]
fn torque_off_removes_torque_in_the_same_cycle_from_every_state() {
    for cycles in [1, 2, 3, 8, 12, 20, 40, 120, 300] {
        let mut arm = Arm::with(edited(&[]), |_| {});
        arm.ready();
        arm.drive_target = DriveTarget::Enabled;
        arm.steps(cycles);
        arm.drive_target = DriveTarget::TorqueOff;
        arm.step();
        for servo in &arm.settings.servos {
            let asked = requests(&arm, servo.node_id);
            // What it remembers is replaced first.
            let left = matches!(asked[..], [Request::Mit(_), EXIT]);
            assert!(left, "{cycles} cycles after enable: node {} gets {asked:?}", servo.node_id);
        }
        arm.steps(5);
        assert_eq!(energised(&arm), [false; JOINTS], "{cycles} cycles after enable");
        // The returning target does not energise anything by itself.
        arm.drive_target = DriveTarget::Enabled;
        arm.steps(300);
        assert_eq!(energised(&arm), [false; JOINTS], "{cycles} cycles after enable");
    }
}

/// The motor keeps the time by itself; what is limp and has no brake falls.
#[test]
fn motors_of_a_master_that_vanished_go_limp_after_their_watchdog() {
    // It stays in motor mode, so its brake stays open.
    let mut arm = Arm::enabled(edited(&[]));
    arm.steps(500);
    let held_rad = arm.servo(1).position_rad();
    let fallen_rad = |arm: &mut Arm, ms: u64| {
        for _ in 0..ms {
            arm.now.0 += 1_000_000;
            arm.inject(&[]);
        }
        (arm.servo(1).position_rad() - held_rad).abs()
    };
    let until_rad = fallen_rad(&mut arm, 95);
    assert!(until_rad < 1e-3, "it holds for its watchdog: {until_rad} rad");
    let after_rad = fallen_rad(&mut arm, 700);
    assert!(after_rad > 0.2, "a limp joint falls: {after_rad} rad");
}

#[test]
fn zero_is_set_only_when_the_motor_rests_and_is_off() {
    let mut arm = Arm::enabled(edited(&[]));
    assert_eq!(arm.driver.set_zero(2), Err(ZeroRefused::NotReady));
    assert_eq!(arm.driver.set_zero(7), Err(ZeroRefused::NoSuchJoint));
    arm.disable();
    arm.until(DriveState::Disabled);
    // Until the brake has closed the joint sinks.
    arm.steps(100);
    let true_rad = arm.servo(2).position_rad();
    assert_eq!(arm.driver.set_zero(2), Ok(()));
    arm.step();
    assert_eq!(requests(&arm, 3), [Request::Special(Special::SetZero)]);
    // It does not answer for a second, which is reported, and comes back by itself.
    arm.steps(1_500);
    arm.until(DriveState::Disabled);
    assert!(arm.status(2).position_rad.abs() < 5e-4, "zero is here now: {}", arm.status(2).position_rad);
    assert!((arm.servo(2).position_rad() - true_rad).abs() < 1e-9, "and nothing has moved");
}

#[test]
fn arm_that_follows_sends_one_frame_a_motor_and_cycle() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.steps(10);
    for _ in 0..1_000 {
        arm.step();
        assert_eq!(arm.sent.len(), JOINTS);
        for node in 1..=6 {
            assert!(matches!(requests(&arm, node)[..], [Request::Mit(_)]), "{:?}", arm.sent);
        }
    }
}

/// Goal: in operation a command to one of the motors from elsewhere is noticed by its frame; answers and commands to other
/// motors are not.
#[test]
fn commands_of_another_master_are_noticed_in_operation() {
    for request in [Request::Mit([0x80, 0, 0x80, 0, 0, 0, 8, 0]), ENTER, EXIT] {
        let mut arm = Arm::enabled(edited(&[]));
        arm.steps(600);
        assert_eq!(arm.driver.other_master(), None, "own traffic");
        let frame = request.encode(2);
        arm.arriving.push(frame);
        arm.step();
        assert_eq!(arm.driver.other_master(), Some(frame.id()), "{request:?}");
        arm.steps(600);
        assert_eq!(arm.driver.other_master(), None, "{request:?}: it has stopped");
        arm.arriving.push(request.encode(9));
        arm.step();
        assert_eq!(arm.driver.other_master(), None, "{request:?} to a motor of somebody else");
    }
}

/// Goal: whoever leaves the section of the simulator out gets joints that the motors can carry: the first enable holds, far
/// inside what stops an arm.
#[test]
fn motors_of_settings_without_a_simulator_section_are_enabled_and_hold() {
    let settings = Settings { simulator: None, ..edited(&[]) };
    let limit_rad = settings.supervision.tracking_error_rad_max;
    let mut arm = Arm::enabled(settings);
    let mut worst_rad = 0.0_f64;
    for _ in 0..2_000 {
        arm.step();
        for joint in 0..JOINTS {
            let status = arm.status(joint);
            assert_eq!(status.state, DriveState::Enabled, "joint {joint}: {}", arm.why(joint));
            worst_rad = worst_rad.max((status.position_rad - arm.commands[joint].position_rad).abs());
        }
    }
    println!("largest distance from the command {worst_rad:.6} rad");
    assert!(worst_rad < 0.5 * limit_rad, "{worst_rad} rad from the command");
}
