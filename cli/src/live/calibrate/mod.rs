//! `taustream calibrate gravity`: measures torques in poses at rest, and fits the masses of the robot file to them.
mod answer;
mod held;
mod measuring;

use crate::args::{CalibrateArgs, CalibrateWhat, GravityArgs};
use crate::arm;
use crate::failure::Failure;
use crate::output::{Form, deliver, to_json};
use answer::Answer;
use held::Held;
use std::path::Path;
use taustream_arm::mass_fit::{Unknown, fit};

/// Measures, or reads what was measured, and prints the fit.
pub(crate) fn run(form: Form, settings: Option<&Path>, args: &CalibrateArgs) -> Result<(), Failure> {
    let CalibrateWhat::Gravity(args) = &args.what;
    let settings = arm::settings_to_talk(settings)?;
    let robot = &settings.robot;
    robot.dynamics().map_err(|e| Failure::Refused(e.to_string()))?;
    let held = match &args.from {
        Some(file) => held::read(file, robot)?,
        None => measuring::measure(form, &settings, args)?,
    };
    let unknown = unknown(args);
    let poses: Vec<_> = held.iter().map(Held::pose).collect();
    let fitted = fit(robot, &poses, unknown).map_err(|e| Failure::Refused(e.to_string()))?;
    let answer = Answer::of(&settings, &held, (&fitted, unknown));
    deliver(form, args.output.as_deref(), &to_json(&answer)?, &answer)
}

const fn unknown(args: &GravityArgs) -> Unknown {
    if args.payload { Unknown::Payload } else { Unknown::Links }
}
