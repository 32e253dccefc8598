//! `taustream cancel`: brings the running motion to rest by a replacement, and drops what waits.
use super::client::Client;
use super::replan::go;
use crate::args::CancelArgs;
use crate::arm;
use crate::failure::Failure;
use crate::output::Form;
use std::path::Path;
use taustream_messages::plan::{CheckedPlanRequest, When};
use taustream_motion::MAX_JOINTS;

/// How long the planner may take, ms.
const DEADLINE_MS: u32 = 1_000;

/// Asks the planner for the taper, and prints the receipt.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &CancelArgs) -> Result<(), Failure> {
    let settings = arm::settings_to_talk(settings)?;
    let client = Client::join(&settings.name)?;
    let request = CheckedPlanRequest {
        when: When::Cancel,
        deadline_ms: DEADLINE_MS,
        ..CheckedPlanRequest::to_pose(settings.robot.joints.len(), [0.0; MAX_JOINTS])
    };
    go(form, (&client, &settings), &request, (args.wait, false, 0.0))
}
