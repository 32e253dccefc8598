//! The `AgileX` Piper: one arm controller with six joints.
//!
//! One frame holds targets of two joints and the arm is energised as a whole, so it is no table for [`crate::motors`].
pub mod controller;
pub mod driver;
pub mod fault;
pub mod frames;
pub mod sim;
mod sim_settings;

use super::{CodeWords, DriverError, Registration, boxed};
use crate::bring_up::timing::{self, Timeouts};
use controller::ArmPlan;
use driver::{JointSlot, PiperDriver};
use frames::{FOLLOW_FAST, FOLLOW_SMOOTH, JOINTS};
use taustream_arm::protocol::piper::{Piper, PiperFollow};
use taustream_arm::{Servo, Settings};
use taustream_motion::MAX_JOINTS;

pub(super) const REGISTRATION: Registration = Registration {
    name: "piper",
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

/// The master of the Piper on `settings.buses[bus]`.
///
/// # Errors
/// When the settings do not name all of its joints, or cannot be used.
pub fn driver(settings: &Settings, bus: usize) -> Result<PiperDriver, DriverError> {
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

    let on_bus = settings.servos.iter().filter(|servo| servo.bus == bus);
    let mut joints: Vec<(&Servo, Piper)> =
        on_bus.filter_map(|servo| Some((servo, *servo.protocol.get::<Piper>()?))).collect();
    joints.sort_by_key(|(servo, _)| servo.node_id);
    let numbers = joints.iter().map(|(servo, _)| usize::from(servo.node_id));
    let whole = numbers.eq(1..=JOINTS);
    let Some((_, piper)) = joints.first().copied().filter(|_| whole) else {
        let words = "a Piper is driven with all of its joints, node ids 1 to 6, on one bus".to_owned();
        return Err(DriverError::Protocol(words));
    };
    let mut plan = ArmPlan {
        firmware: piper.firmware,
        speed_percent: piper.speed_percent,
        follow: match piper.follow {
            PiperFollow::Fast => FOLLOW_FAST,
            PiperFollow::Smooth => FOLLOW_SMOOTH,
        },
        joints: [([0.0; 2], 0.0); JOINTS],
    };
    let mut slots = [JointSlot { joint: 0, sign: 1.0, zero_offset_rad: 0.0 }; JOINTS];
    for ((slot, planned), (servo, _)) in slots.iter_mut().zip(&mut plan.joints).zip(joints) {
        let (joint, joints) = (servo.joint, settings.slots().min(MAX_JOINTS));
        let limits = settings.slot(joint).filter(|_| joint < joints).map(|joint| joint.limits);
        let Some(limits) = limits else { return Err(DriverError::JointBeyond { joint, joints }) };
        *slot = JointSlot { joint, sign: servo.sign, zero_offset_rad: servo.zero_offset_rad };
        *planned = (arm_range_rad(servo, limits.position_rad), limits.stop.velocity_rad_s);
    }
    Ok(PiperDriver::new(plan, slots, timeouts, near_rad, settings.cycle.period_us))
}

/// A joint's range as the arm counts it, the smaller angle first.
fn arm_range_rad(servo: &Servo, range_rad: [f64; 2]) -> [f64; 2] {
    let [a, b] = range_rad.map(|angle_rad| (angle_rad - servo.zero_offset_rad) * servo.sign);
    [a.min(b), a.max(b)]
}
