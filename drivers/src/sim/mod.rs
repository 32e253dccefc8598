//! Simulated servos, with a motor and gravity, behind a real link: CiA 402 drives with an object dictionary, and Damiao
//! motors with their registers.
//!
//! [`Drive`] is one drive, [`Motor`] one Damiao motor, [`ServoSimulator`] the servos of an arm with faults on request, [`serve`] runs
//! the simulator on links. All but the last are pure: frames and time in, frames out.
//!
//! What is simple: each joint is one inertia with a pendulum's gravity, uncoupled from the others; a bus with a bit rate knows no
//! bit errors ([`wire`]); of the modes of operation there is only cyclic synchronous position.
pub mod arguments;
pub mod bit_time;
mod controller;
mod dictionary;
mod disturbance;
mod drive;
mod drive_motion;
mod drive_objects;
pub mod faults;
mod linked;
mod mechanics;
mod motor;
mod motor_registers;
mod network;
mod objects;
mod pdo;
mod plant;
pub mod planted;
mod power;
pub mod priority;
mod sdo_server;
pub mod serve;
mod servo;
pub mod settings;
pub mod simulator;
pub mod wire;

pub use controller::LoopParameters;
pub use disturbance::Disturbance;
pub use drive::{Drive, DriveParameters};
pub use faults::{FaultRequest, SimulatorCommand};
pub use linked::LinkedSimulator;
pub use motor::{Motor, MotorParameters};
pub use plant::PlantParameters;
pub use planted::PlantedObject;
pub use power::PowerState;
pub use servo::{ServoParameters, SimulatedServo};
pub use simulator::ServoSimulator;
pub use wire::{Wire, WireCounters};
