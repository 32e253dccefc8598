//! Energising, following, letting go.
use super::{Arm, DamiaoArm, JOINTS, edited, motor_of, pos_vel};
use taustream_arm::{Damiao, Settings};
use taustream_drivers::codec::mit::{MitCommand, MitRanges};
use taustream_drivers::protocols::damiao::frames::{Request, Special, Wire};
use taustream_drivers::{DriveState, DriveTarget, JointCommand, ServoDriver, ZeroRefused};

/// What a motor of the arm is commanded in the newest cycle, decoded with its ranges.
fn mit(arm: &Arm, joint: usize) -> Option<MitCommand> {
    let servo = &arm.settings.servos[joint];
    let damiao = servo.protocol.get::<Damiao>()?;
    let span = damiao.ranges;
    let ranges = MitRanges::symmetric(span.position_rad, span.velocity_rad_s, span.torque_nm);
    arm.sent.iter().find_map(|frame| match Request::decode(frame, servo.node_id) {
        Some(Request::Mit(bytes)) => Some(MitCommand::decode(bytes, &ranges)),
        _ => None,
    })
}

#[test]
fn gains_rise_from_nothing_in_proportion_over_the_ramp() {
    let mut arm = Arm::new();
    arm.until(DriveState::Disabled);
    arm.steps(50);
    arm.hold();
    arm.drive_target = DriveTarget::Enabled;
    let mut ramp: Vec<f64> = Vec::new();
    for _ in 0..400 {
        arm.step();
        if let Some(command) = mit(&arm, 1) {
            ramp.push(command.stiffness_nm_rad);
            let share = command.stiffness_nm_rad / 400.0;
            assert!((command.damping_nm_s_rad / 5.0 - share).abs() < 2e-3, "damping lags at {share}");
            let at_rad = -(arm.commands[1].position_rad + std::f64::consts::FRAC_PI_2);
            assert!(
                (command.position_rad - at_rad).abs() < 4e-4,
                "{} instead of {at_rad}",
                command.position_rad
            );
        }
    }
    assert!(ramp[0].abs() < 1e-12, "the first command is without gains: {}", ramp[0]);
    let rising = ramp.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] - pair[0] <= 400.0 / 200.0 + 0.25);
    assert!(rising, "2 Nm/rad a cycle, and never down: {ramp:?}");
    assert!((ramp[ramp.len() - 1] - 400.0).abs() < 0.2);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
}

/// A limp joint is caught where it is, whatever an earlier master commanded.
#[test]
fn old_command_with_full_gains_is_not_taken_up_when_the_motor_is_energised() {
    let mut arm = Arm::new();
    arm.until(DriveState::Disabled);
    arm.steps(50);
    let there = MitCommand {
        position_rad: 3.0,
        stiffness_nm_rad: 400.0,
        damping_nm_s_rad: 1.0,
        ..MitCommand::default()
    };
    let ranges = MitRanges::symmetric(12.5, 45.0, 54.0);
    let frame = Request::Mit(there.encode(&ranges).unwrap()).encode(1, Default::default());
    let mut out = [Vec::new()];
    arm.simulator.receive(arm.now, 0, &[frame], &mut out);
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
fn motors_follow_a_sine_in_both_modes_and_velocity_is_fed_forward() {
    for (settings, worst_rad) in [(edited(&[]), 0.06), (pos_vel(), 0.02)] {
        let mut arm = Arm::enabled(settings);
        arm.steps(500);
        let base = arm.commands;
        let mut errors_rad = [0.0_f64; JOINTS];
        for cycle in 0..3_000 {
            let t_s = f64::from(cycle) * 1e-3;
            for (command, base) in arm.commands.iter_mut().zip(base) {
                *command = JointCommand {
                    position_rad: base.position_rad + 0.3 * (1.0 - (2.0 * t_s).cos()),
                    velocity_rad_s: 0.6 * (2.0 * t_s).sin(),
                    ..*command
                };
            }
            arm.step();
            for (joint, worst) in errors_rad.iter_mut().enumerate() {
                let status = arm.status(joint);
                *worst = worst.max((status.position_rad - arm.commands[joint].position_rad).abs());
            }
        }
        assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
        assert!(errors_rad.iter().all(|error| *error < worst_rad), "{errors_rad:?}");
        // Gravity bends a spring: shoulder lift carries more than pan.
        if arm.settings.servos[0].protocol.get::<Damiao>().unwrap().mode != taustream_arm::DamiaoMode::PosVel
        {
            assert!(errors_rad[1] > 1.5 * errors_rad[0], "gains act: {errors_rad:?}");
        }
    }
}

/// Stiffness is what the motor makes of it: ten times less of it sags about ten times as far.
#[test]
fn softer_joint_sags_further_under_its_load() {
    let sag_rad = |stiffness: &str| {
        let mut arm = Arm::enabled(edited(&[("stiffness_nm_rad = 400.0", stiffness)]));
        arm.steps(3_000);
        arm.servo(1).position_rad() - arm.commands[1].position_rad
    };
    let (stiff_rad, soft_rad) = (sag_rad("stiffness_nm_rad = 400.0"), sag_rad("stiffness_nm_rad = 40.0"));
    assert!((5.0..20.0).contains(&(soft_rad / stiff_rad)), "{stiff_rad} rad and {soft_rad} rad");
}

#[test]
fn torque_that_is_fed_forward_reaches_the_motor_in_its_direction_and_is_cut_off() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.commands[0].torque_nm = 5.0;
    arm.commands[1].torque_nm = 5.0;
    arm.commands[3].torque_nm = 1e9;
    arm.step();
    let torque_nm = |joint: usize| mit(&arm, joint).unwrap().torque_nm;
    assert!((torque_nm(0) - 5.0).abs() < 108.0 / 4095.0 + 1e-9, "{}", torque_nm(0));
    assert!((torque_nm(1) + 5.0).abs() < 108.0 / 4095.0 + 1e-9, "turned round: {}", torque_nm(1));
    assert!((torque_nm(3) - 10.0).abs() < 1e-9, "{}", torque_nm(3));
}

#[test]
fn command_that_is_no_number_leaves_the_last_angle_and_no_velocity() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.commands[0].velocity_rad_s = 1.0;
    arm.step();
    let before = mit(&arm, 0).unwrap();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for field in 0..3 {
            let good = arm.commands[0];
            let mut command = good;
            match field {
                0 => command.position_rad = bad,
                1 => command.velocity_rad_s = bad,
                _ => command.torque_nm = bad,
            }
            arm.commands[0] = command;
            arm.step();
            arm.commands[0] = good;
            let got = mit(&arm, 0).unwrap();
            assert!((got.position_rad - before.position_rad).abs() < 1e-12, "{got:?}");
            assert!(got.velocity_rad_s.abs() < 0.03 && got.torque_nm.abs() < 0.03, "{got:?}");
        }
    }
}

#[test]
fn command_far_from_the_joint_energises_nothing() {
    let mut arm = Arm::new();
    arm.until(DriveState::Disabled);
    arm.steps(50);
    arm.hold();
    arm.commands[2].position_rad += 0.06;
    arm.drive_target = DriveTarget::Enabled;
    arm.until_one(2, DriveState::Fault);
    assert!(arm.why(2).contains("too far from the measured position"), "{}", arm.why(2));
    assert_eq!(arm.nibble(2), 0);
}

#[test]
fn disabling_removes_torque_and_torque_off_does_so_in_the_same_cycle_from_every_state() {
    let mut arm = Arm::enabled(edited(&[]));
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
    arm.until(DriveState::Disabled);
    assert!((0..JOINTS).all(|joint| arm.nibble(joint) == 0));
    for cycles in [1, 2, 3, 8, 12, 20, 40, 120, 300] {
        let mut arm = Arm::new();
        arm.until(DriveState::Disabled);
        arm.steps(50);
        arm.hold();
        arm.drive_target = DriveTarget::Enabled;
        arm.steps(cycles);
        arm.drive_target = DriveTarget::TorqueOff;
        arm.step();
        let off = Request::Special(Special::Disable, 0);
        for servo in &arm.settings.servos {
            let commanded = arm.sent.iter().any(|frame| Request::decode(frame, servo.node_id) == Some(off));
            assert!(commanded, "{cycles} cycles after enable: node {} gets no command", servo.node_id);
        }
        arm.steps(5);
        assert!((0..JOINTS).all(|joint| arm.nibble(joint) == 0), "{cycles} cycles after enable");
        // The returning target does not energise anything by itself.
        arm.drive_target = DriveTarget::Enabled;
        arm.steps(300);
        assert!((0..JOINTS).all(|joint| arm.nibble(joint) == 0), "{cycles} cycles after enable");
    }
}

/// The motor keeps the time by itself; what is limp and has no brake falls.
#[test]
fn motors_disable_themselves_when_commands_stop_and_fall_without_a_brake() {
    let mut arm = Arm::without_brakes(edited(&[]));
    for joint in 0..JOINTS {
        arm.commands[joint].position_rad = super::START_RAD[joint];
    }
    // Joints that hang limp are caught as they fall: here they start from where they came to rest.
    arm.until(DriveState::Disabled);
    arm.steps(20_000);
    arm.hold();
    arm.drive_target = DriveTarget::Enabled;
    arm.step();
    arm.until(DriveState::Enabled);
    let lift_rad = arm.commands[1].position_rad;
    for cycle in 0..1_000 {
        arm.commands[1].position_rad = lift_rad - 0.5 * f64::from(cycle) * 1e-3;
        arm.commands[1].velocity_rad_s = -0.5;
        arm.step();
    }
    arm.commands[1].velocity_rad_s = 0.0;
    arm.steps(500);
    let hold_position_rad = arm.servo(1).position_rad();
    // The streamer is gone: only time passes.
    let mut out = [Vec::new()];
    let mut fell_after_ms = None;
    for ms in 1..=2_000_u32 {
        arm.now.0 += 1_000_000;
        arm.simulator.advance(arm.now, &mut out);
        if fell_after_ms.is_none() && arm.nibble(1) == 0xD {
            fell_after_ms = Some(ms);
        }
    }
    assert!(matches!(fell_after_ms, Some(99..=102)), "TIMEOUT is 100 ms: {fell_after_ms:?}");
    assert!((0..JOINTS).all(|joint| arm.nibble(joint) == 0xD));
    let fell_rad = (arm.servo(1).position_rad() - hold_position_rad).abs();
    assert!(fell_rad > 0.2, "a limp joint falls: {fell_rad} rad");
}

#[test]
fn zero_is_set_only_when_the_motor_rests_configured_and_off() {
    let mut arm = Arm::enabled(edited(&[]));
    assert_eq!(arm.driver.set_zero(2), Err(ZeroRefused::NotReady));
    assert_eq!(arm.driver.set_zero(7), Err(ZeroRefused::NoSuchJoint));
    arm.drive_target = DriveTarget::Disabled;
    arm.step();
    arm.until(DriveState::Disabled);
    // Until the brake has closed the joint sinks.
    arm.steps(100);
    let true_rad = arm.servo(2).position_rad();
    assert_eq!(arm.driver.set_zero(2), Ok(()));
    arm.step();
    assert_eq!(arm.under(3), [vec![0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE]]);
    arm.steps(3);
    assert!(arm.status(2).position_rad.abs() < 5e-4, "zero is here now: {}", arm.status(2).position_rad);
    assert!((arm.servo(2).position_rad() - true_rad).abs() < 1e-9, "and nothing has moved");
}

#[test]
fn registers_are_never_asked_for_while_the_arm_follows() {
    let mut arm = Arm::enabled(edited(&[]));
    for _ in 0..1_000 {
        arm.step();
        assert_eq!(arm.sent.len(), JOINTS, "one frame a motor and cycle");
        assert!(arm.sent.iter().all(|frame| frame.id().raw() <= 6), "{:?}", arm.sent);
    }
}

#[test]
fn motor_that_also_speaks_by_itself_changes_nothing() {
    let mut arm = Arm::with(edited(&[]), |setup| {
        motor_of(setup).continuous_ms = 1;
        motor_of(setup).mode_offset_ids = true;
    });
    arm.enable();
    arm.steps(500);
    assert_eq!(arm.states(), [DriveState::Enabled; JOINTS]);
}

/// Goal: in operation a command to one of the motors from elsewhere is noticed by its frame, in whatever mode; answers and
/// commands to other motors are not.
#[test]
fn commands_of_another_master_are_noticed_in_operation() {
    for settings in [edited(&[]), pos_vel()] {
        let commands = [
            Request::Mit([0x80, 0, 0x80, 0, 0, 0, 8, 0]),
            Request::PosVel { position_rad: 0.5, velocity_rad_s: 1.0 },
            Request::Special(Special::Disable, 0),
        ];
        for command in commands {
            let mut arm = Arm::enabled(settings.clone());
            arm.steps(600);
            assert_eq!(arm.driver.other_master(), None, "own traffic");
            let frame = command.encode(2, Wire::Classic);
            arm.arriving.push(frame);
            arm.step();
            assert_eq!(arm.driver.other_master(), Some(frame.id()), "{command:?}");
            arm.steps(600);
            assert_eq!(arm.driver.other_master(), None, "{command:?}: it has stopped");
            arm.arriving.push(command.encode(9, Wire::Classic));
            arm.step();
            assert_eq!(arm.driver.other_master(), None, "{command:?} to a motor of somebody else");
        }
    }
}

/// Goal: whoever leaves the section of the simulator out gets joints that the motors can carry: the first enable holds, far
/// inside what stops an arm.
#[test]
fn motors_of_settings_without_a_simulator_section_are_enabled_and_hold() {
    for settings in [edited(&[]), pos_vel()] {
        let settings = Settings { simulator: None, ..settings };
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
}
