//! The shipped settings: the drivers of their bus against the simulated servos of their `[simulator]`.
use crate::shipped_bench::{self, Arm};
use taustream_arm::Settings;
use taustream_drivers::sim::FaultRequest;
use taustream_drivers::{DriveState, ServoDriver};

fn settings(edits: &[(&str, &str)]) -> Settings {
    shipped_bench::settings("piper.toml", edits)
}

#[test]
fn shipped_settings_drive_the_simulated_arm() {
    let mut arm = Arm::new(&settings(&[]));
    arm.enable();
    let from: Vec<f64> = arm.commands.iter().map(|command| command.position_rad).collect();
    for cycle in 1..=400 {
        let phase = std::f64::consts::PI * f64::from(cycle) / 400.0;
        for (command, from_rad) in arm.commands.iter_mut().zip(&from).take(6) {
            command.position_rad = from_rad + 0.2 * (1.0 - phase.cos());
        }
        arm.step();
    }
    (0..100).for_each(|_| arm.step());
    for joint in 0..6 {
        let away_rad = arm.simulator.drive(joint).unwrap().position_rad() - arm.commands[joint].position_rad;
        assert!(away_rad.abs() < 2e-3, "joint {joint} rests {away_rad} rad away");
    }
}

#[test]
fn faults_on_request_act_on_the_shipped_arm() {
    let mut arm = Arm::new(&settings(&[]));
    arm.enable();
    let names = arm.simulator.joints();
    let text = format!("joint={},kind=fault,value=0x10", names[3]);
    arm.simulator.request(arm.now, FaultRequest::parse(&text, &names).unwrap());
    (0..100).for_each(|_| arm.step());
    let status = arm.driver.status(3);
    assert_eq!(status.state, DriveState::Fault);
    assert_eq!(arm.driver.explain(status.error_code), "driver of the joint: collision detected");
}

/// The arm's own speed limit in the simulator: narrower than the robot file's, it is refused with both numbers.
#[test]
fn slower_arm_than_the_robot_file_says_is_refused() {
    let slow = ("brake = false", "brake = false\npiper_speed_rad_s = [3.0, 3.0, 2.0, 3.0, 3.0, 3.0]");
    let mut arm = Arm::new(&settings(&[slow]));
    (0..400).for_each(|_| arm.step());
    let status = arm.driver.status(2);
    assert_eq!(status.state, DriveState::Refused);
    let words = taustream_drivers::words::explain_refusal(&status.refusal());
    assert!(words.contains("speed limit of this joint is 2.000 rad/s"), "{words}");
}
