//! The parts of the suite.
mod adopt;
mod arm;
mod bench;
mod brake;
mod hostile;
mod inputs;
mod modes;
mod motion;
mod network;
mod power;
mod process;
mod profile_limits;
mod quirks;
mod scale;
mod torque;
