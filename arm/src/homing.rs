//! How a CiA 402 drive finds the zero of its position by itself, as the table `[servo.homing]` of its servo states it.
//!
//! The drive moves the joint, in its own homing mode and with its own switches; nothing plans or checks that motion. So the
//! table has no default, and a method that moves needs its risk acknowledged.
//!
//! Source: CiA 402-2, "Homing mode".
use crate::reader::{Bounds, Table};
use crate::velocity_unit::{self, VelocityUnit};

/// The homing of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HomingSettings {
    /// Homing method (0x6098).
    pub method: i8,
    /// Unit of the drive's speeds and accelerations.
    pub velocity_unit: VelocityUnit,
    /// Speed towards the switch (0x6099:01), rad/s of the joint.
    pub switch_speed_rad_s: f64,
    /// Speed towards the zero (0x6099:02), rad/s of the joint.
    pub zero_speed_rad_s: f64,
    /// Acceleration (0x609A), rad/s^2 of the joint.
    pub acceleration_rad_s2: f64,
    /// Longest time from the start of the motion to its end.
    pub timeout_s: f64,
}

/// Methods that make the present position the home position: the joint does not move.
const METHODS_AT_REST: [i8; 2] = [35, 37];
const SPEED_RAD_S: Bounds = Bounds::above(0.0, 10.0, "rad/s");
const ACCELERATION_RAD_S2: Bounds = Bounds::above(0.0, 1000.0, "rad/s^2");
const TIMEOUT_S: Bounds = Bounds::within(0.1, 600.0, "s");

impl HomingSettings {
    /// The joint moves.
    #[must_use]
    pub fn moves(&self) -> bool {
        !METHODS_AT_REST.contains(&self.method)
    }

    /// Keys and values of the table.
    #[must_use]
    pub fn entries(&self) -> serde_json::Value {
        serde_json::json!({
            "method": self.method,
            "velocity_unit": self.velocity_unit.word(),
            "switch_speed_rad_s": self.switch_speed_rad_s,
            "zero_speed_rad_s": self.zero_speed_rad_s,
            "acceleration_rad_s2": self.acceleration_rad_s2,
            "timeout_s": self.timeout_s,
        })
    }

    /// What `check` says of it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Self { method, switch_speed_rad_s, zero_speed_rad_s, timeout_s, .. } = *self;
        if self.moves() {
            format!(
                "homing by method {method} at {switch_speed_rad_s} and {zero_speed_rad_s} rad/s within {timeout_s} s, UNCHECKED for collisions"
            )
        } else {
            format!("homing by method {method}, where it stands")
        }
    }
}

/// Reads the table; the outer `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<Option<HomingSettings>> {
    const KEY: &str = "homing";
    let Some(mut homing) = table.table_if_there(KEY) else { return (!table.had(KEY)).then_some(None) };
    let method = homing.integer("method", -128, 127);
    let velocity_unit = velocity_unit::read(&mut homing);
    let switch_speed_rad_s = homing.number("switch_speed_rad_s", &SPEED_RAD_S);
    let zero_speed_rad_s = homing.number("zero_speed_rad_s", &SPEED_RAD_S);
    let acceleration_rad_s2 = homing.number("acceleration_rad_s2", &ACCELERATION_RAD_S2);
    let timeout_s = homing.number("timeout_s", &TIMEOUT_S);
    let acknowledged = homing.flag_or("collision_risk_acknowledged", false);
    let read = (|| {
        Some(HomingSettings {
            method: method.and_then(|method| i8::try_from(method).ok())?,
            velocity_unit: velocity_unit?,
            switch_speed_rad_s: switch_speed_rad_s?,
            zero_speed_rad_s: zero_speed_rad_s?,
            acceleration_rad_s2: acceleration_rad_s2?,
            timeout_s: timeout_s?,
        })
    })();
    if method == Some(0) {
        homing.fault("method", "0", "a homing method of the drive (0 is none)");
    }
    if read.is_some_and(|read| read.moves()) && acknowledged == Some(false) {
        homing.fault(
            "collision_risk_acknowledged",
            "false",
            "true: the drive moves the joint by itself, and nothing checks that motion for collisions",
        );
    }
    homing.done();
    acknowledged.and(read).map(Some)
}
