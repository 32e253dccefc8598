//! `ODrive` servo drives by `CANSimple`, firmware 0.6.
use super::identifiers::Use;
use super::motors;
use super::{Protocol, Registration, ServoProtocol};
use crate::bus_load::flow::{Exchange, Flow};
use crate::bus_load::frame::{Format, Frame};
use crate::document::shown;
use crate::reader::{Bounds, FaultList, Table};
use crate::robot::RobotJoint;
use crate::settings::{Bus, Servo, Settings};
use serde_json::Value;
use std::f64::consts::TAU;

/// How an `ODrive` is recognised, scaled and watched. Its angles are turns of its encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odrive {
    /// Motor revolutions a link revolution.
    pub gear_ratio: f64,
    /// Product line, version and variant, as it states them.
    pub hardware: [u8; 3],
    /// Major, minor and revision, as it states them.
    pub firmware: [u8; 3],
    /// Period of its encoder estimates (`encoder_msg_rate_ms`).
    pub encoder_period_ms: u32,
    /// Period of its heartbeat (`heartbeat_msg_rate_ms`).
    pub heartbeat_period_ms: u32,
    /// Without a command for this long it disarms itself: limp.
    pub watchdog_ms: u32,
    /// Where its watchdog and its velocity limit are; none where the owner sets the watchdog with the maker's tool.
    pub endpoints: Option<OdriveEndpoints>,
}

/// Endpoint ids of one firmware on one hardware, from the maker's `flat_endpoints.json`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OdriveEndpoints {
    /// `axis0.config.watchdog_timeout`.
    pub watchdog_timeout: u16,
    /// `axis0.config.enable_watchdog`.
    pub enable_watchdog: u16,
    /// `axis0.controller.config.vel_limit`.
    pub velocity_limit: u16,
}

pub(super) const REGISTRATION: Registration = Registration {
    name: "odrive",
    words: "ODrive CANSimple, firmware 0.6",
    keys: &[
        "gear_ratio",
        "hardware",
        "firmware",
        "encoder_period_ms",
        "heartbeat_period_ms",
        "watchdog",
        "watchdog_ms",
        "endpoint_watchdog_timeout",
        "endpoint_enable_watchdog",
        "endpoint_velocity_limit",
    ],
    // 63 is for drives without an id.
    node_id: [0, 62],
    read: |table| read(table).map(Protocol::from),
};

const GEAR_RATIO: Bounds = Bounds::above(0.0, 1e5, "motor revolutions a link revolution");
const PERIOD_MS: [i64; 2] = [1, 1000];
const ENDPOINT: [i64; 2] = [1, 65_535];
/// Every command and every message that is sent periodically.
const FRAME_BYTES: u32 = 8;
/// What the velocity of a setpoint can say: 16 bits of 0.001 turns/s.
const SPEED_TURNS_S: f64 = 32.767;
/// Beyond so many turns a single float no longer tells a thousandth of a turn.
const TURNS: f64 = 8192.0;
/// Messages of a node: all 32 are its own.
const MESSAGES: u16 = 32;
/// The message that is its feedback.
const ESTIMATES: u16 = 9;

fn read(table: &mut Table<'_>) -> Option<Odrive> {
    let gear_ratio = table.number("gear_ratio", &GEAR_RATIO);
    let hardware = read_version(table, "hardware", "the drive's three numbers, for example \"4.4.58\"");
    let firmware = read_version(table, "firmware", "the drive's three numbers, for example \"0.6.11\"");
    let encoder_period_ms = table.integer("encoder_period_ms", PERIOD_MS[0], PERIOD_MS[1]);
    let heartbeat_period_ms = table.integer("heartbeat_period_ms", PERIOD_MS[0], PERIOD_MS[1]);
    let watchdog_ms = motors::read_watchdog(table);
    let endpoints = read_watchdog(table);
    let firmware = firmware?;
    if !matches!(firmware, [0, 6, _]) {
        let [major, minor, revision] = firmware;
        let expected = "a firmware 0.6: others speak another CANSimple";
        table.fault("firmware", &shown(&format!("{major}.{minor}.{revision}")), expected);
        return None;
    }
    Some(Odrive {
        gear_ratio: gear_ratio?,
        hardware: hardware?,
        firmware,
        encoder_period_ms: u32::try_from(encoder_period_ms?).ok()?,
        heartbeat_period_ms: u32::try_from(heartbeat_period_ms?).ok()?,
        watchdog_ms: watchdog_ms?,
        endpoints: endpoints?,
    })
}

fn read_version(table: &mut Table<'_>, key: &'static str, expected: &str) -> Option<[u8; 3]> {
    let text = table.text(key, expected)?;
    let parts: Option<Vec<u8>> = text.split('.').map(|part| part.parse().ok()).collect();
    let version = parts.and_then(|parts| <[u8; 3]>::try_from(parts).ok());
    if version.is_none() {
        table.fault(key, &shown(&text), expected);
    }
    version
}

/// Endpoints belong to a watchdog that is written: beside the owner's they are unknown keys.
#[expect(clippy::option_option, reason = "what was read, and whether there is one")]
fn read_watchdog(table: &mut Table<'_>) -> Option<Option<OdriveEndpoints>> {
    let expected = "\"written\" (by this software, and read back) or \"owner\" (set with the maker's tool, and not read)";
    let name = table.text("watchdog", expected)?;
    match name.as_str() {
        "written" => {
            let mut endpoint = |key| table.integer(key, ENDPOINT[0], ENDPOINT[1]);
            let watchdog_timeout = endpoint("endpoint_watchdog_timeout");
            let enable_watchdog = endpoint("endpoint_enable_watchdog");
            let velocity_limit = endpoint("endpoint_velocity_limit");
            Some(Some(OdriveEndpoints {
                watchdog_timeout: u16::try_from(watchdog_timeout?).ok()?,
                enable_watchdog: u16::try_from(enable_watchdog?).ok()?,
                velocity_limit: u16::try_from(velocity_limit?).ok()?,
            }))
        }
        "owner" => Some(None),
        other => {
            table.fault("watchdog", &shown(other), expected);
            None
        }
    }
}

impl Odrive {
    fn version(parts: [u8; 3]) -> String {
        let [major, minor, revision] = parts;
        format!("{major}.{minor}.{revision}")
    }
}

impl ServoProtocol for Odrive {
    fn name(&self) -> &'static str {
        REGISTRATION.name
    }

    fn gear_ratio(&self) -> f64 {
        self.gear_ratio
    }

    fn carries_torque(&self) -> bool {
        true
    }

    fn identifiers(&self, node_id: u8) -> Vec<Use> {
        let id = |message: u16| u16::from(node_id) << 5 | message;
        let others = (0..MESSAGES).filter(|message| *message != ESTIMATES);
        let own = others.map(|message| Use::standard(id(message), "CANSimple messages", "node_id"));
        own.chain([Use::standard(id(ESTIMATES), "encoder estimates", "node_id")]).collect()
    }

    fn check_joint(&self, table: &Table<'_>, joint: &RobotJoint, [sign, zero_rad]: [f64; 2]) {
        let turns_a_rad = sign * self.gear_ratio / TAU;
        let value = format!("{:?}", self.gear_ratio);
        for position_rad in joint.limits.position_rad {
            let turns = (position_rad - zero_rad) * turns_a_rad;
            if turns.abs() > TURNS {
                let expected = format!(
                    "at most {TURNS} turns of the motor, which a frame can tell apart: joint {} at {position_rad} rad would be \
                     {turns:.0} turns",
                    joint.name
                );
                table.fault("gear_ratio", &value, &expected);
                return;
            }
        }
        let turns_s = joint.limits.stop.velocity_rad_s * turns_a_rad.abs();
        if turns_s > SPEED_TURNS_S {
            let expected = format!(
                "at most {SPEED_TURNS_S} turns/s of the motor, which a frame can say: joint {} at its limit would be \
                 {turns_s:.1} turns/s",
                joint.name
            );
            table.fault("gear_ratio", &value, &expected);
        }
    }

    fn check_settings(&self, fault_list: &FaultList, at: usize, servo: &Servo, settings: &Settings) {
        motors::check_watchdog(fault_list, at, self.watchdog_ms, settings);
        motors::check_every_cycle(fault_list, at, servo, settings);
        let fault = |key: &str, value: u32, expected: &str| {
            fault_list.add(None, &format!("servo[{at}].{key}"), &value.to_string(), expected);
        };
        let age_s = settings.supervision.feedback_age_s_max;
        if f64::from(self.encoder_period_ms) * 1e-3 > 0.5 * age_s {
            let expected = format!(
                "at most half of supervision.feedback_age_s_max = {age_s}: a lost one must not stop the arm"
            );
            fault("encoder_period_ms", self.encoder_period_ms, &expected);
        }
        let timeout_s = settings.supervision.drive_timeout_s;
        if f64::from(self.heartbeat_period_ms) * 1e-3 > 0.2 * timeout_s {
            let expected = format!(
                "at most a fifth of supervision.drive_timeout_s = {timeout_s}: it tells that enabling is done"
            );
            fault("heartbeat_period_ms", self.heartbeat_period_ms, &expected);
        }
    }

    fn flows(&self, servos: &[Protocol], _: &Bus, cycle_hz: f64, format: Format) -> Vec<Flow> {
        let frame = Frame::standard(format, FRAME_BYTES);
        let servos: Vec<&Self> = servos.iter().filter_map(Protocol::get).collect();
        let count = u32::try_from(servos.len()).unwrap_or(u32::MAX);
        let all = |what, period_ms: fn(&Self) -> u32| {
            let rate_hz = servos.iter().map(|drive| 1000.0 / f64::from(period_ms(drive))).sum();
            Flow { what, frame, rate_hz, burst: count }
        };
        let mut flows = Exchange { servos: count, cycle_hz, command: frame, answer: None }.flows();
        flows.push(all("encoder estimates", |drive| drive.encoder_period_ms));
        flows.push(all("heartbeats", |drive| drive.heartbeat_period_ms));
        flows
    }

    fn entries(&self) -> Vec<(&'static str, Value)> {
        let mut entries: Vec<(&'static str, Value)> = vec![
            ("gear_ratio", self.gear_ratio.into()),
            ("hardware", Self::version(self.hardware).into()),
            ("firmware", Self::version(self.firmware).into()),
            ("encoder_period_ms", self.encoder_period_ms.into()),
            ("heartbeat_period_ms", self.heartbeat_period_ms.into()),
            ("watchdog", if self.endpoints.is_some() { "written" } else { "owner" }.into()),
            ("watchdog_ms", self.watchdog_ms.into()),
        ];
        if let Some(endpoints) = self.endpoints {
            entries.extend([
                ("endpoint_watchdog_timeout", Value::from(endpoints.watchdog_timeout)),
                ("endpoint_enable_watchdog", endpoints.enable_watchdog.into()),
                ("endpoint_velocity_limit", endpoints.velocity_limit.into()),
            ]);
        }
        entries
    }

    fn sentence(&self) -> String {
        let watchdog = match self.endpoints {
            Some(_) => format!("limp after {} ms", self.watchdog_ms),
            None => format!(
                "limp after {} ms, if its owner has set it so: this software does not look",
                self.watchdog_ms
            ),
        };
        format!(
            "gear {}, hardware {}, firmware {}, estimates every {} ms, {watchdog}",
            self.gear_ratio,
            Self::version(self.hardware),
            Self::version(self.firmware),
            self.encoder_period_ms
        )
    }
}
