//! `MyActuator` motors.
use crate::motor_bench::{self, Arm};
use taustream_arm::Settings;
use taustream_drivers::protocols::myactuator::frames::Request;
use taustream_drivers::protocols::myactuator::{Motor, MotorParameters};
use taustream_drivers::sim::settings::DriveSetup;

mod bring_up;
mod faults;
mod frames;
mod operation;

/// The shipped settings with some of the text replaced, everywhere.
fn edited(edits: &[(&str, &str)]) -> Settings {
    motor_bench::edited("rmd6.toml", edits)
}

/// The same in position mode.
fn position_mode() -> Settings {
    let gains = [
        ("stiffness_nm_rad = 400.0\n", ""),
        ("stiffness_nm_rad = 60.0\n", ""),
        ("damping_nm_s_rad = 5.0\n", ""),
        ("damping_nm_s_rad = 1.5\n", ""),
        ("gain_ramp_ms = 200\n", ""),
        ("position_range_rad = 12.5\nvelocity_range_rad_s = 45.0\ntorque_range_nm = 24.0\n", ""),
        ("mode = \"motion\"", "mode = \"position\""),
    ];
    edited(&gains)
}

/// The parameters of a motor, to be changed before it powers up.
fn motor_of(setup: &mut DriveSetup) -> &mut MotorParameters {
    setup.parameters.get_mut().unwrap()
}

fn motor(arm: &Arm, joint: usize) -> &Motor {
    arm.servo(joint).get().unwrap()
}

/// What motor `node_id` is asked in the newest cycle.
fn requests(arm: &Arm, node_id: u8) -> Vec<Request> {
    arm.sent.iter().filter_map(|frame| Request::decode(frame, node_id)).collect()
}
