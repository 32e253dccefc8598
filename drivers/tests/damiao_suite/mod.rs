//! `Damiao` motors.
use crate::motor_bench;
pub(crate) use crate::motor_bench::{Arm, JOINTS, START_RAD};
use taustream_arm::Settings;
use taustream_drivers::ServoDriver;
use taustream_drivers::protocols::damiao::{Motor, MotorParameters};
use taustream_drivers::sim::settings::DriveSetup;

mod bring_up;
mod faults;
mod frames;
mod golden;
mod hostile;
mod operation;

/// The shipped settings of six motors with some of the text replaced, everywhere.
pub(crate) fn edited(edits: &[(&str, &str)]) -> Settings {
    motor_bench::edited("damiao6.toml", edits)
}

/// MIT as shipped, or `pos_vel`.
pub(crate) fn pos_vel() -> Settings {
    let kp = [("stiffness_nm_rad = 400.0\n", ""), ("stiffness_nm_rad = 60.0\n", "")];
    let kd = [("damping_nm_s_rad = 5.0\n", ""), ("damping_nm_s_rad = 1.5\n", "")];
    edited(
        &[&kp[..], &kd, &[("gain_ramp_ms = 200\n", ""), ("mode = \"mit\"", "mode = \"pos_vel\"")]].concat(),
    )
}

/// What only these motors' tests ask of the bench.
pub(crate) trait DamiaoArm: Sized {
    /// The shipped arm.
    fn new() -> Self;
    /// One without brakes: a joint without torque falls.
    fn without_brakes(settings: Settings) -> Self;
    fn clear_faults(&mut self);
    /// Status nibble of a simulated motor.
    fn nibble(&self, joint: usize) -> u8;
    /// Bytes of the newest cycle's frames under an identifier.
    fn under(&self, id: u32) -> Vec<Vec<u8>>;
}

impl DamiaoArm for Arm {
    fn new() -> Self {
        Self::with(edited(&[]), |_| {})
    }
    fn without_brakes(settings: Settings) -> Self {
        Self::with(settings, |setup| setup.parameters.plant_mut().brake = false)
    }
    fn clear_faults(&mut self) {
        self.driver.clear_faults();
    }
    fn nibble(&self, joint: usize) -> u8 {
        self.servo(joint).get::<Motor>().unwrap().status()
    }
    fn under(&self, id: u32) -> Vec<Vec<u8>> {
        self.sent.iter().filter(|frame| frame.id().raw() == id).map(|frame| frame.data().to_vec()).collect()
    }
}

/// The parameters of a motor, to be changed before it powers up.
pub(crate) fn motor_of(setup: &mut DriveSetup) -> &mut MotorParameters {
    setup.parameters.get_mut().unwrap()
}
