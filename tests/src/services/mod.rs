//! The installed services under a real systemd: what is installed for the test, and what is tried in the guest.
//!
//! [`files`] makes a controller of the installed tree: settings, buses, enabled units. [`checks`] runs in the guest as
//! root, after boot, and checks from outside: by systemctl, journalctl, /proc, and the command line as other users.
pub mod arm;
pub mod checks;
pub mod files;
pub mod guest;
pub mod hardening;
pub mod recovery;
pub mod rights;
pub mod stall;

/// Name of the arm's settings, and so of the units' instances.
pub const ARM: &str = "arm1";
/// Its streamer.
pub const STREAMER: &str = "taustream-streamer@arm1.service";
/// Its planner.
pub const PLANNER: &str = "taustream-planner@arm1.service";
/// Its servos.
pub const SERVOSIM: &str = "taustream-servosim@arm1.service";
/// A user who may command the arm.
pub const OPERATOR: &str = "olga";
/// A user who may not.
pub const STRANGER: &str = "stan";
