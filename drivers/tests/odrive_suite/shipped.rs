//! The shipped settings: the drivers of their bus against the simulated servos of their `[simulator]`.
use crate::shipped_bench::{self, Arm};
use taustream_arm::Settings;
use taustream_drivers::sim::FaultRequest;
use taustream_drivers::{DriveState, ServoDriver};

fn settings(edits: &[(&str, &str)]) -> Settings {
    shipped_bench::settings("odrive6.toml", edits)
}

#[test]
fn shipped_settings_drive_their_simulated_drives() {
    let mut arm = Arm::new(&settings(&[]));
    arm.enable();
    let from: Vec<f64> = arm.commands.iter().map(|command| command.position_rad).collect();
    for cycle in 1..=800 {
        let phase = std::f64::consts::PI * f64::from(cycle) / 800.0;
        for joint in 0..6 {
            arm.commands[joint].position_rad = from[joint] + 0.2 * (1.0 - phase.cos());
        }
        arm.step();
    }
    (0..200).for_each(|_| arm.step());
    for joint in 0..6 {
        let away_rad = arm.simulator.drive(joint).unwrap().position_rad() - arm.commands[joint].position_rad;
        assert!(away_rad.abs() < 2e-3, "joint {joint} rests {away_rad} rad away");
    }
}

#[test]
fn watchdog_of_the_owner_and_faults_on_request_act_on_the_shipped_arm() {
    let ids = [
        ("endpoint_watchdog_timeout = 153\n", ""),
        ("endpoint_enable_watchdog = 154\n", ""),
        ("endpoint_velocity_limit = 388\n", ""),
        ("watchdog = \"written\"", "watchdog = \"owner\""),
    ];
    let mut arm = Arm::new(&settings(&ids));
    arm.enable();
    let names = arm.simulator.joints();
    let text = format!("joint={},kind=fault,value=0x4000", names[2]);
    arm.simulator.request(arm.now, FaultRequest::parse(&text, &names).unwrap());
    (0..100).for_each(|_| arm.step());
    let status = arm.driver.status(2);
    assert_eq!(status.state, DriveState::Fault);
    assert_eq!(arm.driver.explain(status.error_code), "ODrive error 0x4000: power stage too hot");
}

/// A drive of another firmware on the bus: refused by name, and the others are not touched by it.
#[test]
fn drive_with_another_firmware_is_refused() {
    let revision = ("brake = true", "brake = true\nodrive_firmware_revision = [10, 10, 9, 10, 10, 10]");
    let mut arm = Arm::new(&settings(&[revision]));
    (0..800).for_each(|_| arm.step());
    let states: Vec<DriveState> = (0..6).map(|joint| arm.driver.status(joint).state).collect();
    assert_eq!(states.iter().filter(|state| **state == DriveState::Disabled).count(), 5, "{states:?}");
    assert_eq!(states[2], DriveState::Refused);
}
