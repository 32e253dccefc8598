//! A joint of a simulated Piper as the section `[simulator]` has it.
use super::arm_range_rad;
use super::frames::Limits;
use super::sim::{PiperJoint, PiperParameters};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::disturbance::Disturbance;
use crate::sim::plant::PlantParameters;
use crate::sim::planted::PlantedObject;
use crate::sim::settings::{Load, SimulatedJoint};
use crate::sim::{ModelParameters, ServoModel};
use taustream_arm::protocol::piper::Piper;

/// Its own keys.
pub(crate) const KEYS: [&str; 1] = ["piper_speed_rad_s"];

/// An arm whose own limits are those of the robot, to the tenth of a degree outside of them.
pub(crate) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let Some(piper) = servo.protocol.get::<Piper>() else {
        return crate::sim::drive_settings::simulate(joint);
    };
    let [least_rad, most_rad] = arm_range_rad(servo, joint.limits.position_rad);
    let speed_rad_s =
        joint.number("piper_speed_rad_s", joint.limits.stop.velocity_rad_s.max(1e-3), 1e-3..=65.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturation is fine")]
    let limits = Limits {
        joint: servo.node_id,
        most_decidegrees: (most_rad.to_degrees() * 10.0).ceil() as i16,
        least_decidegrees: (least_rad.to_degrees() * 10.0).floor() as i16,
        speed_mrad_s: (speed_rad_s * 1e3).ceil() as u16,
    };
    Box::new(PiperParameters {
        number: servo.node_id,
        sign: servo.sign,
        zero_offset_rad: servo.zero_offset_rad,
        start_rad: joint.start_rad(),
        plant: joint.plant(Load::LARGE),
        loops: joint.loops(),
        limits,
        firmware: piper.firmware,
        boot_s: joint.boot_s(),
        step_ns: joint.step_ns(),
        arm: joint.shared(),
    })
}

impl ModelParameters for PiperParameters {
    fn build(&self, _: &[PlantedObject]) -> Box<dyn ServoModel> {
        Box::new(PiperJoint::new(self.clone()))
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.start_rad
    }
}

impl ServoModel for PiperJoint {
    fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        Self::advance(self, now, out);
    }
    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        Self::receive(self, now, frame, out);
    }
    fn disturb(&mut self, disturbance: Disturbance, _: &mut Vec<CanFrame>) {
        Self::disturb(self, disturbance);
    }
    fn is_enabled(&self) -> bool {
        Self::is_enabled(self)
    }
    fn position_rad(&self) -> f64 {
        Self::position_rad(self)
    }
    fn velocity_rad_s(&self) -> f64 {
        Self::velocity_rad_s(self)
    }
    fn node_id(&self) -> u8 {
        Self::node_id(self)
    }
    fn describe(&self) -> String {
        format!("driver=0x{:02X} takes_targets={}", self.driver_status(), self.is_enabled())
    }
    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}
