//! `taustream home`: has a drive find its zero by itself, and says what became of it.
use super::client::{Client, Limit};
use super::reference::joint_of;
use crate::args::HomeArgs;
use crate::arm::{self, ArmName};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::fault_sentence;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use taustream_arm::{Cia402, Settings};
use taustream_messages::{Command, Phase, ReferenceState, Report};

/// What energising before a homing, and the return from it, may take beside the homing itself, s.
const BESIDE_S: f64 = 15.0;

/// What became of a homing.
#[derive(Debug, Serialize)]
struct Homed {
    arm: String,
    joint: String,
    accepted: bool,
    phase: &'static str,
    referenced: bool,
    known: &'static str,
    /// Where it holds; only valid when referenced.
    command_rad: f64,
    message: String,
}

impl fmt::Display for Homed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, phase, known, command_rad, .. } = self;
        if self.referenced {
            write!(f, "{joint}: {known}; it holds at {command_rad:.6} rad (phase {phase})")
        } else {
            write!(f, "{joint}: {} (phase {phase})", self.message)
        }
    }
}

/// Homes a joint, and waits for its end.
pub(crate) fn run(form: Form, given: Option<&Path>, args: &HomeArgs) -> Result<(), Failure> {
    let settings = arm::settings(given)?;
    let names = ArmName::of(&settings);
    let joint = joint_of(&settings, &args.joint)?;
    let wait_s = args.wait_s.unwrap_or_else(|| timeout_s(&settings, joint) + BESIDE_S);
    let client = Client::join(&settings.name)?;
    let reply = client.command(Command::Home { joint: u32::try_from(joint).unwrap_or(u32::MAX) })?;
    if !reply.is_accepted() {
        let at = reply.phase().map_or("in an unknown phase", Phase::word);
        return Err(Failure::Refused(format!("home refused while {at}: {}", reply.text())));
    }
    let name = settings.slot(joint).map(|joint| joint.name.clone()).unwrap_or_default();
    let (report, phase) =
        if wait_s > 0.0 { wait_for(&client, &names, (joint, &name), wait_s)? } else { client.report()? };
    let known = reference_state(&report, joint);
    form.print(&Homed {
        arm: settings.name,
        joint: name,
        accepted: true,
        phase: phase.word(),
        referenced: known.is_referenced(),
        known: known.word(),
        command_rad: report.command_rad.get(joint).copied().unwrap_or(f64::NAN),
        message: reply.text(),
    })
}

fn timeout_s(settings: &Settings, joint: usize) -> f64 {
    let servo = settings.servos.iter().find(|servo| servo.joint == joint);
    let homing = servo.and_then(|servo| servo.protocol.get::<Cia402>()?.homing);
    homing.map_or(0.0, |homing| homing.timeout_s)
}

fn reference_state(report: &Report, joint: usize) -> ReferenceState {
    ReferenceState::from_code(report.reference_state.get(joint).copied().unwrap_or_default())
}

/// Waits until the homing is over.
fn wait_for(
    client: &Client,
    names: &ArmName,
    (joint, name): (usize, &str),
    wait_s: f64,
) -> Result<(Report, Phase), Failure> {
    let limit = Limit::after_s(wait_s);
    // The report that a command causes may have been written before it was taken: the next one was not.
    client.report()?;
    loop {
        let (report, phase) = client.report()?;
        match phase {
            Phase::Homing => {}
            Phase::Locked if reference_state(&report, joint) == ReferenceState::Homed => {
                return Ok((report, phase));
            }
            Phase::Locked | Phase::Disabling | Phase::Disabled => {
                return Err(Failure::Failed(format!(
                    "the homing of {name} was stopped before its end; it is not referenced, and the arm is {}",
                    phase.word()
                )));
            }
            Phase::Configuring
            | Phase::Enabling
            | Phase::Holding
            | Phase::Moving
            | Phase::Pausing
            | Phase::Paused
            | Phase::Stopping
            | Phase::FastStopping
            | Phase::Braking
            | Phase::Fault => {
                let fault = fault_sentence(&report, names);
                return Err(Failure::Failed(format!(
                    "the homing of {name} has not ended: the arm is {}: {fault}",
                    phase.word()
                )));
            }
        }
        if limit.is_over() {
            return Err(Failure::Failed(format!(
                "home was accepted, but {name} still homes after {wait_s} s; `taustream stop` ends it, or wait longer with --wait-s"
            )));
        }
        interrupt::check()?;
    }
}
