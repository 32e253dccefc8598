//! Simulated servos, with a motor and gravity, behind a real link. CiA 402 drives with an object dictionary are here, the
//! motors of each other protocol in its folder.
//!
//! [`Drive`] is one drive, [`ServoModel`] any servo, [`ServoSimulator`] the servos of an arm with faults on request, [`serve`]
//! runs the simulator on links. All but the last are pure: frames and time in, frames out.
//!
//! What is simple: each joint is one inertia with a pendulum's gravity, uncoupled from the others; a bus with a bit rate knows no
//! bit errors ([`wire`]); profiles of the modes other than cyclic synchronous position are trapezoids.
pub mod arguments;
pub mod bit_time;
pub(crate) mod controller;
mod dictionary;
pub(crate) mod disturbance;
mod drive;
mod drive_motion;
mod drive_objects;
pub(crate) mod drive_settings;
pub mod faults;
pub(crate) mod impedance;
mod linked;
mod lss;
pub(crate) mod mechanics;
pub mod model;
mod modes;
mod network;
mod objects;
mod pdo;
pub(crate) mod plant;
pub mod planted;
mod power;
pub mod priority;
mod quirks;
mod sdo_block;
mod sdo_server;
pub mod serve;
pub mod settings;
pub mod simulator;
pub mod wire;

pub use controller::LoopParameters;
pub use disturbance::Disturbance;
pub use drive::{Drive, DriveParameters};
pub use faults::{FaultRequest, SimulatorCommand};
pub use impedance::Mounting;
pub use linked::LinkedSimulator;
pub use model::{ModelParameters, ServoModel};
pub use plant::PlantParameters;
pub use planted::{ObjectChange, PlantedObject};
pub use power::PowerState;
pub use quirks::DriveQuirks;
pub use simulator::ServoSimulator;
pub use wire::{Wire, WireCounters};
