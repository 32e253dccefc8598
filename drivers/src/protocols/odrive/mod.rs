//! `ODrive` servo drives by `CANSimple`, firmware 0.6.
//!
//! Heartbeats and estimates come by themselves and answer no command, so these drives are no table for [`crate::motors`].
pub mod axis;
pub mod driver;
pub mod fault;
pub mod frames;
pub mod sim;
mod sim_settings;

use super::{CodeWords, DriverError, Registration, boxed};
use crate::bring_up::timing::{self, Timeouts};
use crate::servo::Nanos;
use axis::{AxisPlan, Watchdog};
use driver::{AxisMapping, OdriveDriver};
use sim::Endpoints;
use std::f64::consts::TAU;
use taustream_arm::protocol::odrive::Odrive;
use taustream_arm::{Servo, Settings};
use taustream_motion::MAX_JOINTS;

pub(super) const REGISTRATION: Registration = Registration {
    name: "odrive",
    driver: |settings, bus| boxed(driver(settings, bus)),
    simulate: sim_settings::simulate,
    simulator_keys: &sim_settings::KEYS,
    words: Some(CodeWords {
        codes: (fault::BASE >> 16) as u16,
        explain: fault::explain_on,
        explain_refusal: fault::explain_refusal,
    }),
    status: fault::status_text,
};

/// The master of the `ODrive` axes of `settings.buses[bus]`; it may have none.
///
/// # Errors
/// When the settings cannot be configured in such drives.
pub fn driver(settings: &Settings, bus: usize) -> Result<OdriveDriver, DriverError> {
    if bus >= settings.buses.len() {
        return Err(DriverError::NoSuchBus { bus, buses: settings.buses.len() });
    }
    let supervision = &settings.supervision;
    let time = |key, value| timing::nanos(value).ok_or(DriverError::Supervision { key, value });
    let timeouts = Timeouts {
        step: time("drive_timeout_s", supervision.drive_timeout_s)?,
        feedback: time("feedback_age_s_max", supervision.feedback_age_s_max)?,
    };
    // As with every drive: energising must not start with a step.
    let near_rad = supervision.tracking_error_rad_max.min(supervision.position_jump_rad_max);
    time("tracking_error_rad_max and position_jump_rad_max", near_rad)?;
    let mut driver = OdriveDriver::new(timeouts, near_rad, settings.cycle.period_us);
    for servo in settings.servos.iter().filter(|servo| servo.bus == bus) {
        let Some(odrive) = servo.protocol.get::<Odrive>() else { continue };
        let (joint, joints) = (servo.joint, settings.slots().min(MAX_JOINTS));
        let limits = settings.slot(joint).filter(|_| joint < joints).map(|joint| joint.limits);
        let Some(limits) = limits else { return Err(DriverError::JointBeyond { joint, joints }) };
        driver.add(mapping(servo, odrive), plan(odrive, limits.stop.velocity_rad_s));
    }
    Ok(driver)
}

const fn mapping(servo: &Servo, odrive: &Odrive) -> AxisMapping {
    AxisMapping {
        joint: servo.joint,
        node_id: servo.node_id,
        sign: servo.sign,
        zero_offset_rad: servo.zero_offset_rad,
        gear_ratio: odrive.gear_ratio,
    }
}

fn plan(odrive: &Odrive, speed_rad_s: f64) -> AxisPlan {
    AxisPlan {
        hardware: odrive.hardware,
        firmware: odrive.firmware,
        watchdog: odrive.endpoints.map_or(Watchdog::Owner, |_| Watchdog::Written {
            timeout_s: timeout_s(odrive),
            endpoints: endpoints(odrive),
        }),
        speed_turns_s: speed_rad_s * odrive.gear_ratio / TAU,
        heartbeat: Nanos(u64::from(odrive.heartbeat_period_ms) * 1_000_000),
    }
}

/// The timeout of the watchdog as its endpoint holds it.
fn timeout_s(odrive: &Odrive) -> f32 {
    #[expect(clippy::cast_possible_truncation, reason = "the endpoint has this width")]
    let timeout_s = (f64::from(odrive.watchdog_ms) * 1e-3) as f32;
    timeout_s
}

/// Endpoints of the settings; ids that no drive has where there are none.
fn endpoints(odrive: &Odrive) -> Endpoints {
    let none = Endpoints { watchdog_timeout: 0xFFFD, enable_watchdog: 0xFFFE, velocity_limit: 0xFFFF };
    odrive.endpoints.map_or(none, |known| Endpoints {
        watchdog_timeout: known.watchdog_timeout,
        enable_watchdog: known.enable_watchdog,
        velocity_limit: known.velocity_limit,
    })
}
