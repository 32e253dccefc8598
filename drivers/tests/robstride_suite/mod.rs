//! `RobStride` motors.
use crate::motor_bench::{self, Arm};
use taustream_arm::Settings;
use taustream_drivers::CanFrame;
use taustream_drivers::protocols::robstride::frames::Request;
use taustream_drivers::protocols::robstride::{RobStrideMotor, RobStrideParameters};
use taustream_drivers::sim::settings::DriveSetup;

mod bring_up;
mod faults;
mod frames;
mod golden;
mod hostile;
mod motor;
mod operation;

const HOST: u8 = 0xFD;

/// The shipped settings with some of the text replaced, everywhere.
fn edited(edits: &[(&str, &str)]) -> Settings {
    motor_bench::edited("robstride6.toml", edits)
}

/// The parameters of a motor, to be changed before it powers up.
fn motor_of(setup: &mut DriveSetup) -> &mut RobStrideParameters {
    setup.parameters.get_mut().unwrap()
}

fn motor(arm: &Arm, joint: usize) -> &RobStrideMotor {
    arm.servo(joint).get().unwrap()
}

fn energised(arm: &Arm) -> Vec<bool> {
    (0..arm.settings.servos.len()).map(|joint| arm.servo(joint).is_enabled()).collect()
}

/// What a frame asks of motor `node_id`.
fn request(frame: &CanFrame, node_id: u8) -> Option<Request> {
    Request::decode(frame, node_id).map(|(_, request)| request)
}

/// What motor `node_id` is asked in the newest cycle.
fn requests(arm: &Arm, node_id: u8) -> Vec<Request> {
    arm.sent.iter().filter_map(|frame| request(frame, node_id)).collect()
}
