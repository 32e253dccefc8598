//! The `taustream` command: plans, runs and watches the motion of CAN-connected arms.
#![forbid(unsafe_code)]

mod angles;
mod args;
mod arm;
mod demo;
mod doctor;
mod failure;
mod hand_over;
mod interrupt;
mod live;
mod manual;
mod offline;
mod output;
mod plot;
mod progress;
mod view;
mod words;

use args::{Action, Cli};
use arm::ArmName;
use failure::Failure;
use output::{Form, note};
use std::env;
use std::path::Path;
use std::process::ExitCode;
use std::sync::OnceLock;
use taustream_arm::printable::printable_json;
use taustream_messages::Command;
use taustream_messages::clock::now_ns;

/// When this process began, by `CLOCK_MONOTONIC`, ns.
static STARTED_NS: OnceLock<u64> = OnceLock::new();

/// When this process began, by `CLOCK_MONOTONIC`, ns.
fn started_ns() -> u64 {
    *STARTED_NS.get_or_init(now_ns)
}

fn main() -> ExitCode {
    started_ns();
    let cli = match Cli::from_words(env::args_os()) {
        Ok(cli) => cli,
        Err(error) => return usage(&error),
    };
    if !matches!(cli.action, Action::HandedOver) {
        return finish(&cli, hand_over::to_services(&cli).and_then(|()| perform(&cli)));
    }
    match hand_over::taken() {
        Ok(Ok(taken)) => finish(&taken, perform(&taken)),
        Ok(Err(error)) => usage(&error),
        Err(failure) => finish(&cli, Err(failure)),
    }
}

/// Converts the result of a command into a message and an exit code.
fn finish(cli: &Cli, outcome: Result<(), Failure>) -> ExitCode {
    let form = Form::of(cli);
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => report(form, &failure),
    }
}

fn perform(cli: &Cli) -> Result<(), Failure> {
    let form = Form::of(cli);
    let settings = cli.settings.as_deref();
    match &cli.action {
        Action::Plan(args) => offline::plan::run(form, args),
        Action::Import(args) => offline::import::run(form, args),
        Action::Sample(args) => offline::sample::run(form, args),
        Action::Plot(args) => offline::plot::run(form, args),
        Action::Cost(args) => offline::cost::run(form, args),
        Action::Verify(args) => offline::verify::run(form, args),
        Action::Check(args) => offline::check::run(form, args),
        Action::Replan(args) => interrupt::watch().and_then(|()| live::replan::run(form, settings, args)),
        Action::Follow(args) => interrupt::watch().and_then(|()| live::targets::run(form, settings, args)),
        Action::Jog(args) => interrupt::watch().and_then(|()| live::jog::run(form, settings, args)),
        Action::Scene(args) => interrupt::watch().and_then(|()| live::scene::run(form, settings, args)),
        Action::Cancel(args) => interrupt::watch().and_then(|()| live::cancel::run(form, settings, args)),
        Action::Recover(args) => interrupt::watch().and_then(|()| live::recover::run(form, settings, args)),
        Action::Run(args) => interrupt::watch().and_then(|()| live::run::run(form, settings, args)),
        Action::Enable(args) => {
            interrupt::watch().and_then(|()| live::command::enable(form, settings, args.wait_s))
        }
        Action::Disable(args) => command(form, settings, Command::Disable, args.wait_s),
        Action::Pause(args) => command(form, settings, Command::Pause, args.wait_s),
        Action::Resume(args) => command(form, settings, Command::Resume, args.wait_s),
        Action::Speed(args) => command(form, settings, Command::Speed { percent: args.percent }, 0.0),
        Action::Stop(args) if args.fast => command(form, settings, Command::FastStop, args.waiting.wait_s),
        Action::Stop(args) => command(form, settings, Command::Stop, args.waiting.wait_s),
        Action::TorqueOff(args) => command(form, settings, Command::TorqueOff, args.wait_s),
        Action::ClearFault(args) => command(form, settings, Command::ClearFault, args.wait_s),
        Action::Axis(args) => {
            interrupt::watch().and_then(|()| live::axis::run(form, &ArmName::read(settings)?, args))
        }
        Action::Home(args) => interrupt::watch().and_then(|()| live::home::run(form, settings, args)),
        Action::Calibrate(args) => {
            interrupt::watch().and_then(|()| live::calibrate::run(form, settings, args))
        }
        Action::Reference(args) => live::reference::run(form, settings, args),
        Action::Status => live::status::run(form, &ArmName::read(settings)?),
        Action::Watch(args) => live::watch::run(form, settings, args),
        Action::Doctor(args) => doctor::run(form, settings, args),
        Action::Bench(args) => offline::bench::run(form, settings, args),
        Action::Demo(args) => demo::run(form, args),
        Action::Completions { shell } => manual::completions(form, *shell),
        Action::Man(args) => manual::run(form, args),
        Action::HandedOver => {
            Err(Failure::Usage("a command that was handed over cannot hand over".to_owned()))
        }
    }
}

fn command(form: Form, settings: Option<&Path>, command: Command, wait_s: f64) -> Result<(), Failure> {
    interrupt::watch()?;
    live::command::run(form, &ArmName::read(settings)?, command, wait_s)
}

/// Prints the reason on stderr, in the form that was requested.
fn report(form: Form, failure: &Failure) -> ExitCode {
    if !matches!(failure, Failure::BrokenPipe) {
        match form {
            // A result is at the beginning of its line.
            Form::Text if matches!(failure, Failure::Demo { .. }) => note(failure),
            Form::Text => note(format_args!("taustream: {failure}")),
            Form::Json => note(printable_json(&failure.to_json().to_string())),
        }
    }
    ExitCode::from(failure.exit_code())
}

/// Words that clap does not take. Help and version come this way too, and are no failure.
fn usage(error: &clap::Error) -> ExitCode {
    let wants_json = env::args_os().any(|word| word == "--json");
    if error.use_stderr() && wants_json {
        // clap's first paragraph is the reason; what follows is the usage, which is of no use to a program.
        let text = error.to_string();
        let reason = text.split("\n\n").next().unwrap_or_default().trim_start_matches("error: ").trim();
        return report(Form::Json, &Failure::Usage(reason.to_owned()));
    }
    if error.use_stderr() {
        // What was typed stands in it.
        note(error.to_string().trim_end());
    } else {
        // A closed stdout leaves nobody to tell.
        let _closed = error.print();
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2))
}
