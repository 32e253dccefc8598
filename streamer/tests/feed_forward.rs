//! Torque beside the position on a simulated arm that feels the weight of its masses: what it is worth, and what it does when the
//! model is wrong.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::disallowed_macros,
    reason = "helpers of tests fail by panicking"
)]
#![expect(dead_code, reason = "helpers that other tests use")]
mod arm;
mod fed;

use arm::Arm;
use fed::{JOINTS, section, settings};
use taustream_drivers::CanId;
use taustream_messages::{Command, Phase};
use taustream_streamer::cycle::NoProbe;

/// Stiffness of the shoulder and of the wrist in the shipped settings.
const STIFFNESS_NM_RAD: [f64; 6] = [400.0, 400.0, 400.0, 60.0, 60.0, 60.0];

/// Torques at the joints in the commands of the newest cycle, 0 for a motor that got none. A torque comes with the whole gains.
fn commanded_nm(arm: &Arm) -> [f64; 6] {
    let mut torques: [f64; 6] = [0.0; 6];
    for servo in &arm.settings.servos {
        let range_nm = if servo.joint < 3 { 54.0 } else { 10.0 };
        let id = CanId::standard(u16::from(servo.node_id));
        for frame in arm.sent[servo.bus].iter().filter(|frame| frame.id() == id) {
            let data = frame.data();
            if data.len() == 8 && data[..7] != [0xFF; 7] {
                let code = f64::from(u16::from(data[6] & 0x0F) << 8 | u16::from(data[7]));
                let torque = servo.sign * (code / 4095.0 * 2.0 * range_nm - range_nm);
                let stiffness =
                    f64::from(u16::from(data[3] & 0x0F) << 8 | u16::from(data[4])) / 4095.0 * 500.0;
                let ramps = stiffness < STIFFNESS_NM_RAD[servo.joint] - 0.2;
                assert!(
                    !ramps || torque.abs() <= rounding_nm(servo.joint),
                    "{torque} Nm at {stiffness} Nm/rad"
                );
                torques[servo.joint] = torque;
            }
        }
    }
    torques
}

/// Half a step of the frame's 12 bits.
fn rounding_nm(joint: usize) -> f64 {
    if joint < 3 { 54.0 / 4095.0 } else { 10.0 / 4095.0 }
}

/// What an arm has done.
#[derive(Debug, Default)]
struct Seen {
    /// Greatest difference of the true angle from the commanded one.
    error_rad: [f64; 6],
    /// Greatest true speed.
    speed_rad_s: [f64; 6],
    /// Greatest torque that was commanded.
    torque_nm: [f64; 6],
    /// Commanded angles changed by this at most.
    command_rad: f64,
}

/// Runs cycles, holds every commanded torque against its limit and rate, and looks at the arm.
fn watch(arm: &mut Arm, cycles: u64, mut before: [f64; 6], hurry: f64) -> (Seen, [f64; 6]) {
    let mut seen = Seen::default();
    let first = arm.newest.map(|cycle| cycle.position_rad);
    for _ in 0..cycles {
        arm.step(&mut NoProbe);
        let torques = commanded_nm(arm);
        let commanded = arm.newest.unwrap().position_rad;
        for (joint, torque) in torques.into_iter().enumerate() {
            let ((_, most_nm, rate_nm_s), rounding) = (JOINTS[joint], rounding_nm(joint));
            assert!(torque.abs() <= most_nm + rounding, "joint {joint}: {torque} Nm");
            let step_nm = (torque - before[joint]).abs();
            let most_step = hurry * rate_nm_s * 1e-3 + 2.0 * rounding;
            assert!(
                torque.abs() <= rounding || step_nm <= most_step,
                "joint {joint}: {step_nm} Nm in a cycle"
            );
            let drive = arm.simulator.simulator.drive(joint).unwrap();
            let error_rad = (drive.position_rad() - commanded[joint]).abs();
            seen.error_rad[joint] = seen.error_rad[joint].max(error_rad);
            seen.speed_rad_s[joint] = seen.speed_rad_s[joint].max(drive.velocity_rad_s().abs());
            seen.torque_nm[joint] = seen.torque_nm[joint].max(torque.abs());
            let changed = first.map_or(0.0, |first| (commanded[joint] - first[joint]).abs());
            seen.command_rad = seen.command_rad.max(changed);
        }
        before = torques;
    }
    (seen, before)
}

/// Enables the arm, watched.
fn enable(arm: &mut Arm, hurry: f64) -> [f64; 6] {
    arm.run_until(Phase::Disabled, 8_000);
    arm.run(50);
    arm.ask(Command::Enable);
    let mut torques = [0.0; 6];
    for _ in 0..3_000 {
        if arm.phase() == Phase::Holding {
            return torques;
        }
        torques = watch(arm, 1, torques, hurry).1;
    }
    panic!("{:?}", arm.phase());
}

fn most(values: &[f64; 6]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Errors at rest and in a motion, of the arm with this section.
fn errors(name: &str, section: &str) -> [[f64; 6]; 2] {
    let mut arm = fed::arm(name, settings(name, 0.5, section), 0.5);
    let torques = enable(&mut arm, 1.0);
    let (_, torques) = watch(&mut arm, 2_000, torques, 1.0);
    let (rest, _) = watch(&mut arm, 200, torques, 1.0);
    arm.move_it(1.0);
    // The first cycle of the motion was not watched, so its torque is not known here.
    let torques = commanded_nm(&arm);
    let (moving, _) = watch(&mut arm, 4_500, torques, 1.0);
    assert_eq!(arm.phase(), Phase::Holding);
    [rest.error_rad, moving.error_rad]
}

#[test]
fn tracking_error_with_torques_is_a_small_part_of_that_without() {
    let [rest, moving] = errors("fed-not", "");
    let [fed_rest, fed_moving] = errors("fed", &section(false, 1.0));
    println!("at rest: {rest:.5?} rad without, {fed_rest:.5?} rad with torques");
    println!("in motion: {moving:.5?} rad without, {fed_moving:.5?} rad with torques");
    assert!(most(&rest) > 5e-3, "the arm must sag to show anything: {rest:?}");
    assert!(most(&fed_rest) < 0.1 * most(&rest), "{fed_rest:?} rad with, {rest:?} rad without");
    assert!(most(&fed_moving) < 0.5 * most(&moving), "{fed_moving:?} rad with, {moving:?} rad without");
}

/// Goal: an arm whose payload is five times what the settings know, or a fifth of it, does not leap when it is enabled: it moves
/// no faster than the rate over the stiffness makes a spring with this damping swing, and by the difference over the stiffness.
#[test]
fn wrong_payload_does_not_make_the_arm_leap_when_it_is_enabled() {
    for (believed_kg, true_kg) in [(2.5, 0.5), (0.5, 2.5), (0.0, 0.0)] {
        let name = format!("fed-wrong-{believed_kg}-{true_kg}");
        let mut arm = fed::arm(&name, settings(&name, believed_kg, &section(false, 1.0)), true_kg);
        let torques = enable(&mut arm, 1.0);
        // What the joint does while its gains rise is not the torque's doing.
        let held = arm.newest.unwrap().position_rad;
        let sag = |arm: &Arm, joint: usize| {
            arm.simulator.simulator.drive(joint).unwrap().position_rad() - held[joint]
        };
        let before: Vec<f64> = (0..6).map(|joint| sag(&arm, joint)).collect();
        let (seen, torques) = watch(&mut arm, 3_000, torques, 1.0);
        let (late, _) = watch(&mut arm, 500, torques, 1.0);
        println!(
            "believed {believed_kg} kg, true {true_kg} kg: sag {before:.4?}\n  {seen:.4?}\n  then {late:.4?}"
        );
        assert_eq!(arm.phase(), Phase::Holding, "{seen:?}");
        assert!(seen.command_rad == 0.0, "commanded angles stay: {seen:?}");
        for joint in 0..6 {
            let (_, _, rate_nm_s) = JOINTS[joint];
            let spring_rad_s = rate_nm_s / STIFFNESS_NM_RAD[joint];
            // A ramp moves an undamped spring at up to twice its own speed; the sag of enabling swings out besides.
            let sagging_rad_s = before[joint].abs() * (STIFFNESS_NM_RAD[joint] / 0.25).sqrt();
            let bound_rad_s = 2.0 * spring_rad_s + sagging_rad_s + 0.02;
            assert!(
                seen.speed_rad_s[joint] <= bound_rad_s,
                "joint {joint}: {seen:?}, at most {bound_rad_s} rad/s"
            );
        }
        assert!(most(&late.speed_rad_s) < 0.01, "{late:?}");
    }
}

/// Goal: the bound above tells a leap: without a rate the same wrong payload throws the arm.
#[test]
fn wrong_payload_without_a_rate_throws_the_arm() {
    let mut arm = fed::arm("fed-thrown", settings("fed-thrown", 2.5, &section(false, 1e3)), 0.5);
    let torques = enable(&mut arm, 1e3);
    let (seen, _) = watch(&mut arm, 3_000, torques, 1e3);
    println!("{seen:.4?}");
    let spring_rad_s = [1, 2].map(|joint| JOINTS[joint].2 / STIFFNESS_NM_RAD[joint]);
    assert!(
        seen.speed_rad_s[1] > 2.0 * spring_rad_s[0] || seen.speed_rad_s[2] > 2.0 * spring_rad_s[1],
        "{seen:?}"
    );
}

#[test]
fn torque_is_gone_with_the_drives_and_begins_at_zero_again() {
    let mut arm = fed::arm("fed-again", settings("fed-again", 0.5, &section(true, 1.0)), 0.5);
    let torques = enable(&mut arm, 1.0);
    let (seen, _) = watch(&mut arm, 1_500, torques, 1.0);
    assert!(most(&seen.torque_nm) > 2.0, "{seen:?}");
    arm.ask(Command::Disable);
    arm.run(1_000);
    assert!(most(&commanded_nm(&arm).map(f64::abs)) == 0.0);
    let torques = enable(&mut arm, 1.0);
    let (again, _) = watch(&mut arm, 1_500, torques, 1.0);
    assert!((most(&again.torque_nm) - most(&seen.torque_nm)).abs() < 0.5, "{again:?} and {seen:?}");
}
