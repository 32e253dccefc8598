//! The real `taustream` command, as users meet it.
#[path = "cli/bad_input.rs"]
mod bad_input;
#[path = "cli/buses.rs"]
mod buses;
#[path = "cli/calibrate.rs"]
mod calibrate;
#[path = "cli/common.rs"]
mod common;
#[path = "cli/constraints.rs"]
mod constraints;
#[path = "cli/doctor.rs"]
mod doctor;
#[path = "cli/good_path.rs"]
mod good_path;
#[path = "cli/groups.rs"]
mod groups;
#[path = "cli/imports.rs"]
mod imports;
#[path = "cli/json.rs"]
mod json;
#[path = "cli/manual.rs"]
mod manual;
#[path = "cli/mbm.rs"]
mod mbm;
#[path = "cli/papers.rs"]
mod papers;
#[path = "cli/pictures.rs"]
mod pictures;
#[path = "cli/planners.rs"]
mod planners;
#[path = "cli/plot.rs"]
mod plot;
#[path = "cli/streams.rs"]
mod streams;
#[path = "cli/urdf.rs"]
mod urdf;
#[path = "cli/watch.rs"]
mod watch;
