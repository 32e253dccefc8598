//! `CubeMars` AK motors in MIT mode.
use crate::motor_bench::{self, Arm};
use taustream_arm::Settings;
use taustream_drivers::protocols::cubemars::CubeMarsParameters;
use taustream_drivers::protocols::cubemars::frames::Request;
use taustream_drivers::sim::settings::DriveSetup;

mod bring_up;
mod faults;
mod frames;
mod golden;
mod hostile;
mod motor;
mod operation;

/// The shipped settings with some of the text replaced, everywhere.
fn edited(edits: &[(&str, &str)]) -> Settings {
    motor_bench::edited("ak6.toml", edits)
}

/// The parameters of a motor, to be changed before it powers up.
fn motor_of(setup: &mut DriveSetup) -> &mut CubeMarsParameters {
    setup.parameters.get_mut().unwrap()
}

fn energised(arm: &Arm) -> Vec<bool> {
    (0..arm.settings.servos.len()).map(|joint| arm.servo(joint).is_enabled()).collect()
}

/// What motor `node_id` is asked in the newest cycle.
fn requests(arm: &Arm, node_id: u8) -> Vec<Request> {
    arm.sent.iter().filter_map(|frame| Request::decode(frame, node_id)).collect()
}
