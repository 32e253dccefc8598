//! A simulated CiA 402 drive as the section `[simulator]` has it.
use super::disturbance::Disturbance;
use super::drive::{Drive, DriveParameters};
use super::model::{ModelParameters, ServoModel};
use super::plant::PlantParameters;
use super::planted::PlantedObject;
use super::power::PowerState;
use super::quirks::DriveQuirks;
use super::settings::{Load, SimulatedJoint};
use crate::frame::CanFrame;
use crate::servo::Nanos;
use taustream_arm::Cia402;

/// Its own keys.
pub(crate) const KEYS: [&str; 15] = [
    "objects",
    "dummy_mapping",
    "following_window_rad",
    "following_timeout_ms",
    "soft_limit_margin_rad",
    "slow_rad_s2",
    "quick_stop_rad_s2",
    "watchdog_ms",
    "fixed_pdos",
    "late_mode_display",
    "limits_setpoints",
    "sdo_answer_ms",
    "switch_on_ms",
    "reset_edges",
    "falls_back",
];

pub(crate) fn simulate(joint: &SimulatedJoint<'_>) -> Box<dyn ModelParameters> {
    let servo = joint.servo;
    let cia402 = servo.protocol.get::<Cia402>().copied();
    let limits = &joint.limits;
    let [low_rad, high_rad] = limits.position_rad;
    let margin_rad = joint.number("soft_limit_margin_rad", 0.02, 0.0..=3.0);
    let (slow_rad_s2, quick_rad_s2) =
        (limits.motion.acceleration_rad_s2.max(1e-3), limits.stop.acceleration_rad_s2.max(1e-3));
    let brake = cia402.and_then(|cia402| cia402.brake);
    let plant = joint.plant(Load::LARGE);
    Box::new(DriveParameters {
        node_id: servo.node_id,
        sign: servo.sign,
        gear_ratio: cia402.map_or(1.0, |cia402| cia402.gear_ratio),
        counts_per_rev: cia402.map_or(1.0, |cia402| cia402.counts_per_rev),
        zero_offset_rad: servo.zero_offset_rad,
        home_offset_counts: cia402.map_or(0, |cia402| cia402.home_offset_counts),
        dummy_mapping: joint.flag("dummy_mapping", true),
        start_rad: joint.start_rad(),
        plant: PlantParameters { brake: plant.brake || brake.is_some(), ..plant },
        loops: joint.loops(),
        following_window_rad: joint.number("following_window_rad", 0.3, 1e-6..=100.0),
        following_timeout_ms: joint.whole("following_timeout_ms", 50, 0..=65_535),
        soft_limit_rad: [low_rad - margin_rad, high_rad + margin_rad],
        slow_rad_s2: joint.number("slow_rad_s2", slow_rad_s2, 1e-3..=1e4),
        quick_rad_s2: joint.number("quick_stop_rad_s2", quick_rad_s2, 1e-3..=1e4),
        watchdog_ms: joint.whole("watchdog_ms", joint.settings.cycle.drive_watchdog_ms, 0..=65_535),
        reaction: servo.reaction,
        boot_s: joint.boot_s(),
        step_ns: joint.step_ns(),
        brake,
        rated_nm: cia402.and_then(|cia402| Some(cia402.torque?.rated_nm * cia402.gear_ratio)),
        quirks: quirks(joint),
    })
}

fn quirks(joint: &SimulatedJoint<'_>) -> DriveQuirks {
    DriveQuirks {
        fixed_pdos: joint.flag("fixed_pdos", false),
        late_mode_display: joint.flag("late_mode_display", false),
        limits_setpoints: joint.flag("limits_setpoints", false),
        sdo_answer_s: joint.number("sdo_answer_ms", 0.0, 0.0..=10_000.0) * 1e-3,
        switch_on_s: joint.number("switch_on_ms", 0.0, 0.0..=60_000.0) * 1e-3,
        reset_edges: joint.whole::<u8>("reset_edges", 1, 1..=10).saturating_sub(1),
        falls_back: joint.whole("falls_back", 0, 0..=10),
    }
}

impl ModelParameters for DriveParameters {
    fn build(&self, objects: &[PlantedObject]) -> Box<dyn ServoModel> {
        let mut drive = Drive::new(*self);
        objects.iter().for_each(|object| drive.plant(*object));
        Box::new(drive)
    }
    fn plant_mut(&mut self) -> &mut PlantParameters {
        &mut self.plant
    }
    fn start_rad_mut(&mut self) -> &mut f64 {
        &mut self.start_rad
    }
    fn takes_object(&self, object: PlantedObject) -> Option<bool> {
        Some(Drive::shipped(self).plant(object))
    }
}

impl ServoModel for Drive {
    fn advance(&mut self, now: Nanos, out: &mut Vec<CanFrame>) {
        Self::advance(self, now, out);
    }
    fn receive(&mut self, now: Nanos, frame: &CanFrame, out: &mut Vec<CanFrame>) {
        Self::receive(self, now, frame, out);
    }
    fn disturb(&mut self, disturbance: Disturbance, out: &mut Vec<CanFrame>) {
        Self::disturb(self, disturbance, out);
    }
    fn is_enabled(&self) -> bool {
        self.power_state() == PowerState::OperationEnabled
    }
    fn position_rad(&self) -> f64 {
        Self::position_rad(self)
    }
    fn velocity_rad_s(&self) -> f64 {
        Self::velocity_rad_s(self)
    }
    fn weigh(&mut self, weight_nm: f64) -> bool {
        self.mechanics.plant.weight_nm = Some(weight_nm);
        true
    }
    fn node_id(&self) -> u8 {
        Self::node_id(self)
    }
    fn describe(&self) -> String {
        let (power, network, word) = (self.power_state(), self.network_state(), self.statusword());
        format!("power={power:?} network={network:?} statusword=0x{word:04X}")
    }
    fn boxed_clone(&self) -> Box<dyn ServoModel> {
        Box::new(self.clone())
    }
}
