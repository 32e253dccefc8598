//! Commands that need files only.
pub(crate) mod bench;
mod bus_table;
pub(crate) mod check;
mod checked_robot;
mod compare;
pub(crate) mod cost;
mod cost_bench;
mod follow_bench;
pub(crate) mod import;
mod papers;
pub(crate) mod plan;
mod planners;
pub(crate) mod plot;
mod protocol_line;
pub(crate) mod sample;
mod stops_bench;
mod timing_bench;
pub(crate) mod verify;
