//! Servo protocols as pure functions between frames and values, and the drivers built on them.
//!
//! The encoders and decoders serve both ends: the master in this crate, and the simulated drives. No I/O, no clock.
pub mod canopen;
pub mod cia402;
pub mod cia402_words;
pub mod digital_inputs;
pub mod drive_torque;
pub mod emcy;
pub mod error_text;
pub mod mit;
pub mod object;
pub mod sdo;
pub mod sdo_client;
pub mod setpoint_frames;

pub use canopen::{Emcy, Nmt, NmtState, PdoEntry};
pub use object::Address;
pub use sdo::{SdoBytes, SdoRequest, SdoResponse, SegmentBytes};
