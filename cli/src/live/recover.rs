//! `taustream recover`: leads joints that are outside their position limits back inside.
use super::client::Client;
use super::replan::go;
use crate::args::RecoverArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::output::Form;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use taustream_messages::plan::CheckedPlanRequest;
use taustream_planner::enter::Entry;

/// Nothing had to be done.
#[derive(Debug, Serialize)]
struct Inside {
    arm: String,
    accepted: bool,
}

impl fmt::Display for Inside {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "every joint of arm `{}` is inside its position limits; nothing to do", self.arm)
    }
}

/// Plans from the commanded pose to the nearest one inside, and prints the receipt.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &RecoverArgs) -> Result<(), Failure> {
    let settings = arm::settings_to_talk(settings)?;
    let arm = ArmName::of(&settings);
    let client = Client::join(&arm.name)?;
    let (report, _) = client.report()?;
    let Some(entry) = Entry::of(&settings.robot, &report.command_rad) else {
        return form.print(&Inside { arm: arm.name, accepted: false });
    };
    let request = CheckedPlanRequest {
        deadline_ms: args.deadline_ms,
        ..CheckedPlanRequest::to_pose(settings.robot.joints.len(), entry.pose_rad)
    };
    go(form, (&client, &settings), &request, (args.wait, false, 0.0))
}
