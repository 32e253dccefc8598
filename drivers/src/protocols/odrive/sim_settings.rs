//! A simulated `ODrive` as the section `[simulator]` has it.
use super::frames::Version;
use super::sim::{Odrive, OdriveParameters};
use super::{endpoints, timeout_s};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use crate::sim::disturbance::Disturbance;
use crate::sim::plant::PlantParameters;
use crate::sim::planted::PlantedObject;
use crate::sim::settings::{Load, SimulatedJoint};
use crate::sim::{ModelParameters, ServoModel};
use std::f64::consts::TAU;

/// Its own keys.
pub(crate) const KEYS: [&str; 3] =
    ["odrive_velocity_limit_turns_s", "odrive_confirms_writes", "odrive_firmware_revision"];

/// A drive as its owner has set it: what the settings state of it is true.
pub(crate) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let Some(odrive) = servo.protocol.get::<taustream_arm::protocol::odrive::Odrive>() else {
        return crate::sim::drive_settings::simulate(joint);
    };
    let speed_turns_s = joint.limits.stop.velocity_rad_s * odrive.gear_ratio / TAU;
    let limit = joint.number("odrive_velocity_limit_turns_s", 1.25 * speed_turns_s.max(1e-3), 1e-3..=1e6);
    #[expect(clippy::cast_possible_truncation, reason = "the endpoint has this width")]
    let velocity_limit_turns_s = limit as f32;
    let [major, minor, revision] = odrive.firmware;
    let revision = joint.whole("odrive_firmware_revision", u32::from(revision), 0..=255);
    Box::new(OdriveParameters {
        node_id: servo.node_id,
        sign: servo.sign,
        zero_offset_rad: servo.zero_offset_rad,
        gear_ratio: odrive.gear_ratio,
        start_rad: joint.start_rad(),
        plant: joint.plant(Load::LARGE),
        loops: joint.loops(),
        version: Version {
            protocol: 2,
            hardware: odrive.hardware,
            firmware: [major, minor, revision],
            unreleased: 0,
        },
        endpoints: endpoints(odrive),
        velocity_limit_turns_s,
        watchdog: if odrive.endpoints.is_some() { (0.0, false) } else { (timeout_s(odrive), true) },
        encoder_period_ms: odrive.encoder_period_ms,
        heartbeat_period_ms: odrive.heartbeat_period_ms,
        confirms_writes: joint.flag("odrive_confirms_writes", false),
        boot_s: joint.boot_s(),
        step_ns: joint.step_ns(),
    })
}

impl ModelParameters for OdriveParameters {
    fn build(&self, _: &[PlantedObject]) -> Box<dyn ServoModel> {
        Box::new(Odrive::new(*self))
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.start_rad
    }
}

impl ServoModel for Odrive {
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
        format!("state={} errors=0x{:X}", self.state(), self.errors())
    }
    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}
