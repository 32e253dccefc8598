//! The arms that are simulated: the shipped settings, and variants of them in mode and bus.
use anyhow::{Context, Result, ensure};
use std::path::Path;
use taustream_arm::Settings;

/// An arm by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SimulatedArm {
    /// Its name, for `TAUSTREAM_ARM`.
    pub name: &'static str,
    /// File below `config/settings`.
    file: &'static str,
    /// Texts of the file and what stands there instead, in every place.
    replaced: &'static [(&'static str, &'static str)],
}

const FD_RATES: (&str, &str) = ("virtual = true", "bitrate_bit_s = 1000000\ndata_bitrate_bit_s = 5000000");

/// Every arm.
pub const ALL: [SimulatedArm; 9] = [
    SimulatedArm { name: "vcan6", file: "vcan6.toml", replaced: &[] },
    SimulatedArm { name: "dual-bus", file: "dual-bus.toml", replaced: &[] },
    SimulatedArm { name: "one-bus", file: "one-bus.toml", replaced: &[] },
    SimulatedArm { name: "damiao6", file: "damiao6.toml", replaced: &[] },
    SimulatedArm { name: "damiao6-fd", file: "damiao6.toml", replaced: &[FD_RATES] },
    SimulatedArm { name: "pos-vel", file: "damiao6.toml", replaced: POS_VEL },
    SimulatedArm { name: "robstride6", file: "robstride6.toml", replaced: &[] },
    SimulatedArm { name: "odrive6", file: "odrive6.toml", replaced: &[] },
    SimulatedArm { name: "vcan6-go-on", file: "vcan6.toml", replaced: GO_ON },
];

const POS_VEL: &[(&str, &str)] = &[
    ("mode = \"mit\"", "mode = \"pos_vel\""),
    ("\nstiffness_nm_rad = 400.0", ""),
    ("\nstiffness_nm_rad = 60.0", ""),
    ("\ndamping_nm_s_rad = 5.0", ""),
    ("\ndamping_nm_s_rad = 1.5", ""),
    ("\ngain_ramp_ms = 200", ""),
];

/// Drives that extrapolate, so that the motion continues in time after a short stall.
const GO_ON: &[(&str, &str)] = &[
    ("\nreaction = \"ramp\"", "\nreaction = \"ramp\"\nafter_stall = \"go-on\""),
    ("\n[simulator]", "\n[simulator]\nextrapolation_ms = 50.0"),
];

impl SimulatedArm {
    /// Reads and checks its settings.
    ///
    /// # Errors
    /// When the file cannot be read, lacks a text that is to be replaced, or the settings are refused.
    pub fn settings(&self) -> Result<Settings> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/settings").join(self.file);
        let mut text = std::fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        for (from, to) in self.replaced {
            ensure!(text.contains(from), "{}: no {from:?}", path.display());
            text = text.replace(from, to);
        }
        Settings::from_toml(&path, &text).map_err(|faults| anyhow::anyhow!("{}: {faults}", self.name))
    }

    /// The arm of this name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        ALL.into_iter().find(|arm| arm.name == name)
    }
}
