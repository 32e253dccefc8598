//! `taustream demo`: simulated servos, streamer and planner as real processes, a few moves, a summary and plots.
mod changing;
mod file;
mod processes;
mod session;
mod summary;
mod view;

use crate::args::DemoArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::plot::recording;
use file::DemoFile;
use processes::Processes;
use session::Session;
use std::fs;
use summary::Summary;

/// Runs the demo and prints the result.
pub(crate) fn run(form: Form, args: &DemoArgs) -> Result<(), Failure> {
    interrupt::watch()?;
    let summary = perform(form, args).map_err(Failure::of_demo)?;
    form.print(&summary)
}

fn perform(form: Form, args: &DemoArgs) -> Result<Summary, Failure> {
    let demo = DemoFile::load(&arm::demo(&args.config)?)?;
    let arm = ArmName::of(&demo.settings);
    fs::create_dir_all(&args.output).map_err(|e| Failure::writing(args.output.display().to_string(), e))?;

    let mut processes = Processes::start(form, &demo, args)?;
    let moved = move_and_disable(form, args, &demo, &arm);
    // The processes end in order whatever became of the moves; their own failure counts only when nothing else did.
    let ended = processes.end();
    let mut summary = moved?;
    ended?;

    summary.plots = recording::write_all(&args.output, &demo.settings.robot.joints, &summary.samples)?;
    summary.add_cycle_log(&processes.cycle_log());
    Ok(summary)
}

/// Moves through all goals, then brings the arm to rest and switches the drives off, also after a failure or Ctrl-C.
fn move_and_disable(form: Form, args: &DemoArgs, demo: &DemoFile, arm: &ArmName) -> Result<Summary, Failure> {
    let mut session = Session::begin(form, demo, arm, args.limit_s)?;
    let moved = session.go_through_goals(demo);
    match moved {
        Ok(()) => session.finish(),
        Err(why) => {
            let why = session.with_fault(why);
            let stopped = session.stop_in_order();
            // Here Ctrl-C does stop the arm, unlike in a command that only waits.
            let by_user = matches!(why, Failure::Interrupted(_));
            Err(if by_user { Failure::Interrupted(stopped.to_owned()) } else { why })
        }
    }
}
