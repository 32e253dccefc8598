//! What `check` prints of a servo that is its protocol's own.
use serde::ser::{Serialize, SerializeMap, Serializer};
use std::fmt;
use taustream_arm::{DamiaoMode, Protocol, ScaleObject};

/// A protocol's own numbers, under the keys of the settings file in JSON and as a sentence on the screen.
#[derive(Debug)]
pub(super) struct ProtocolLine(pub(super) Protocol);

impl Serialize for ProtocolLine {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        match &self.0 {
            Protocol::Cia402(cia402) => {
                map.serialize_entry("gear_ratio", &cia402.gear_ratio)?;
                map.serialize_entry("counts_per_rev", &cia402.counts_per_rev)?;
                map.serialize_entry("home_offset_counts", &cia402.home_offset_counts)?;
                let overruled: Vec<u16> = cia402.overruled.objects().map(ScaleObject::index).collect();
                map.serialize_entry("overruled_objects", &overruled)?;
            }
            Protocol::Damiao(damiao) => {
                map.serialize_entry("feedback_id", &damiao.feedback_id)?;
                map.serialize_entry("position_range_rad", &damiao.position_range_rad)?;
                map.serialize_entry("velocity_range_rad_s", &damiao.velocity_range_rad_s)?;
                map.serialize_entry("torque_range_nm", &damiao.torque_range_nm)?;
                map.serialize_entry("watchdog_ms", &damiao.watchdog_ms)?;
                match damiao.mode {
                    DamiaoMode::Mit { stiffness_nm_rad, damping_nm_s_rad, gain_ramp_ms } => {
                        map.serialize_entry("mode", "mit")?;
                        map.serialize_entry("stiffness_nm_rad", &stiffness_nm_rad)?;
                        map.serialize_entry("damping_nm_s_rad", &damping_nm_s_rad)?;
                        map.serialize_entry("gain_ramp_ms", &gain_ramp_ms)?;
                    }
                    DamiaoMode::PosVel => map.serialize_entry("mode", "pos_vel")?,
                }
            }
        }
        map.end()
    }
}

impl fmt::Display for ProtocolLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Protocol::Cia402(cia402) => {
                write!(f, "gear {}, {} counts/rev", cia402.gear_ratio, cia402.counts_per_rev)?;
                if cia402.home_offset_counts != 0 {
                    write!(f, ", home offset {} counts", cia402.home_offset_counts)?;
                }
                for object in cia402.overruled.objects() {
                    write!(f, ", 0x{:04X} ({}) of the drive NOT COMPARED", object.index(), object.name())?;
                }
                Ok(())
            }
            Protocol::Damiao(damiao) => {
                write!(f, "feedback 0x{:03X}, ", damiao.feedback_id)?;
                match damiao.mode {
                    DamiaoMode::Mit { stiffness_nm_rad, damping_nm_s_rad, gain_ramp_ms } => write!(
                        f,
                        "mit {stiffness_nm_rad} Nm/rad, {damping_nm_s_rad} Nm s/rad, ramped in {gain_ramp_ms} ms"
                    )?,
                    DamiaoMode::PosVel => f.write_str("pos_vel")?,
                }
                let (rad, rad_s) = (damiao.position_range_rad, damiao.velocity_range_rad_s);
                write!(f, ", +-{rad} rad, +-{rad_s} rad/s, +-{} Nm", damiao.torque_range_nm)?;
                write!(f, ", limp after {} ms", damiao.watchdog_ms)
            }
        }
    }
}
