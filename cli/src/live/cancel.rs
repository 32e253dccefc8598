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
use taustream_planner::PlannerKind;

/// How long the planner may take, ms.
const DEADLINE_MS: u32 = 1_000;

/// Asks the planner for the taper, and prints the receipt.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &CancelArgs) -> Result<(), Failure> {
    let settings = arm::settings_to_talk(settings)?;
    let client = Client::join(&settings.name)?;
    let request = CheckedPlanRequest {
        joints: settings.robot.joints.len(),
        goal_rad: [0.0; MAX_JOINTS],
        tip: None,
        when: When::Cancel,
        deadline_ms: DEADLINE_MS,
        seed: 1,
        planner: PlannerKind::default().name().to_owned(),
    };
    go(form, (&client, &settings), &request, args.wait)
}
