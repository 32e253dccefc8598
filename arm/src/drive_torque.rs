//! Torques of a CiA 402 drive, as the table `[servo.torque]` of its servo states them.
//!
//! A drive counts torques in thousandths of its motor's rated torque (0x6076), so nothing is sent or read without it.
//!
//! Source: CiA 402-2: 0x6076 (millinewton metres), 0x6077 and 0x60B2 (per thousand of it).
use crate::reader::{Bounds, Table};

/// The torques of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TorqueSettings {
    /// Rated torque of the motor, which 0x6076 must state, Nm.
    pub rated_nm: f64,
    /// Its setpoints carry a torque beside the position (0x60B2).
    pub offset: bool,
    /// Its answers carry the torque that it measures (0x6077).
    pub actual: bool,
}

const RATED_NM: Bounds = Bounds::within(0.001, 1e4, "Nm");

impl TorqueSettings {
    /// Thousandths of the rated torque in a newton metre at the joint, for a motor that turns in direction `sign`.
    #[must_use]
    pub fn per_mille_per_nm(&self, sign: f64, gear_ratio: f64) -> f64 {
        1000.0 * sign / (gear_ratio * self.rated_nm)
    }
    /// Keys and values of the table.
    #[must_use]
    pub fn entries(&self) -> serde_json::Value {
        serde_json::json!({ "rated_torque_nm": self.rated_nm, "offset": self.offset, "actual": self.actual })
    }
    /// What `check` says of it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let offset = if self.offset { ", torque offset (0x60B2) in its setpoints" } else { "" };
        let actual = if self.actual { ", torque (0x6077) in its answers" } else { "" };
        format!("rated torque {} Nm of the motor{offset}{actual}", self.rated_nm)
    }
}

/// Reads the table; the outer `None` only after a fault.
pub(crate) fn read(table: &mut Table<'_>) -> Option<Option<TorqueSettings>> {
    const KEY: &str = "torque";
    let Some(mut torque) = table.table_if_there(KEY) else { return (!table.had(KEY)).then_some(None) };
    let rated_nm = torque.number("rated_torque_nm", &RATED_NM);
    let offset = torque.flag_or("offset", false);
    let actual = torque.flag_or("actual", false);
    if offset == Some(false) && actual == Some(false) {
        torque.fault("offset", "false", "true, or actual = true: without either the table does nothing");
    }
    torque.done();
    Some(Some(TorqueSettings { rated_nm: rated_nm?, offset: offset?, actual: actual? }))
}
