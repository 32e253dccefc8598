//! Commands that talk to the running streamer and planner.
pub(crate) mod cancel;
pub(crate) mod client;
pub(crate) mod command;
pub(crate) mod follow;
pub(crate) mod jog;
mod jog_keys;
mod jog_path;
pub(crate) mod recover;
pub(crate) mod reference;
pub(crate) mod replan;
pub(crate) mod run;
pub(crate) mod scene;
pub(crate) mod status;
mod stop_way;
mod target_lines;
mod target_port;
pub(crate) mod targets;
pub(crate) mod watch;
