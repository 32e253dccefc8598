//! `taustream axis`: shows the axes beside the path, and leads one.
use super::client::{Client, Limit};
use crate::args::{AxisAction, AxisArgs};
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::fault_sentence;
use serde::Serialize;
use std::fmt;
use taustream_messages::{AxisGoal, AxisReport, AxisState, Command, Phase, Report};

/// Share of an axis's position that is no difference: what a report's numbers are rounded by.
const ROUNDING: f64 = 1e-9;

/// One axis, in its own unit.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct AxisStatus {
    name: String,
    state: &'static str,
    unit: &'static str,
    command: f64,
    command_velocity: f64,
    /// Null before the first command.
    goal: f64,
    target: f64,
    /// Null before the first feedback.
    measured: f64,
    force_unit: &'static str,
    /// Null where its servo does not say.
    force: f64,
    /// Null where its distance behind the command alone is contact.
    force_max: f64,
}

impl AxisStatus {
    /// Of every axis that a report has.
    pub(crate) fn all(report: &Report, arm: &ArmName) -> Vec<Self> {
        let one = |(index, axis): (usize, &AxisReport)| Self {
            name: arm.axes.get(index).map_or_else(|| format!("axis{}", index + 1), |axis| axis.name.clone()),
            state: axis.state().word(),
            unit: axis.unit(),
            command: axis.command,
            command_velocity: axis.command_velocity,
            goal: axis.goal,
            target: axis.target,
            measured: axis.measured,
            force_unit: axis.force_unit(),
            force: axis.force,
            force_max: axis.force_max,
        };
        report.axes().iter().enumerate().map(one).collect()
    }
}

impl fmt::Display for AxisStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, state, unit, command, measured, target, .. } = self;
        write!(f, "axis {name}: {state}, command {command:.6} {unit}, measured {measured:.6} {unit}")?;
        if (target - command).abs() > ROUNDING {
            write!(f, ", going to {target:.6} {unit}")?;
        }
        if self.force.is_finite() {
            write!(f, ", {:.3} {}", self.force, self.force_unit)?;
        }
        Ok(())
    }
}

/// Every axis of the arm.
#[derive(Debug, Serialize)]
struct Axes {
    arm: String,
    axes: Vec<AxisStatus>,
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.axes.is_empty() {
            return write!(f, "arm {} has no axes beside its path ([[axis]] in its settings)", self.arm);
        }
        let lines: Vec<String> = self.axes.iter().map(ToString::to_string).collect();
        write!(f, "{}", lines.join("\n"))
    }
}

/// What became of a command.
#[derive(Debug, Serialize)]
struct Led {
    arm: String,
    accepted: bool,
    message: String,
    axis: AxisStatus,
}

impl fmt::Display for Led {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}\n{}", self.message, self.axis)
    }
}

/// Shows the axes, or leads one.
pub(crate) fn run(form: Form, arm: &ArmName, args: &AxisArgs) -> Result<(), Failure> {
    let client = Client::join(&arm.name)?;
    let named = args.name.as_deref().filter(|name| args.action.is_some() || *name != "list");
    let index = named.map(|name| index_of(arm, name)).transpose()?;
    if args.action.is_some() && index.is_none() {
        return Err(Failure::Usage(
            "name the axis: `taustream axis NAME open`; `taustream axis` shows all".to_owned(),
        ));
    }
    let (Some(index), Some(action)) = (index, &args.action) else {
        let (report, _) = client.report()?;
        let mut axes = AxisStatus::all(&report, arm);
        if let Some(index) = index {
            axes = axes.into_iter().skip(index).take(1).collect();
        }
        return form.print(&Axes { arm: arm.name.clone(), axes });
    };
    let (goal, force, wait_s) = match action {
        AxisAction::Open(how) => (AxisGoal::Open, how.force, how.wait_s),
        AxisAction::Close(how) => (AxisGoal::Closed, how.force, how.wait_s),
        AxisAction::To { position, how } => (AxisGoal::At(*position), how.force, how.wait_s),
        AxisAction::Stop => (AxisGoal::Stop, None, 10.0),
    };
    let axis = u32::try_from(index).unwrap_or(u32::MAX);
    let reply = client.command(Command::Axis { axis, goal, force })?;
    let phase = reply.phase().map_or("in an unknown phase", Phase::word);
    let name = args.name.as_deref().unwrap_or_default();
    if !reply.is_accepted() {
        return Err(Failure::Refused(format!("axis {name} refused while {phase}: {}", reply.text())));
    }
    let axis = wait_for(&client, arm, (index, goal), wait_s)?;
    form.print(&Led { arm: arm.name.clone(), accepted: true, message: reply.text(), axis })
}

/// The axis of a name.
fn index_of(arm: &ArmName, name: &str) -> Result<usize, Failure> {
    arm.axes.iter().position(|axis| axis.name == name).ok_or_else(|| {
        let names: Vec<&str> = arm.axes.iter().map(|axis| axis.name.as_str()).collect();
        Failure::Usage(match names.as_slice() {
            [] => format!("there is no axis `{name}`: the settings of arm `{}` have no [[axis]]", arm.name),
            names => {
                format!("there is no axis `{name}`; the axes of arm `{}`: {}", arm.name, names.join(", "))
            }
        })
    })
}

/// Waits until the axis stands or is in contact.
fn wait_for(
    client: &Client,
    arm: &ArmName,
    (index, goal): (usize, AxisGoal),
    wait_s: f64,
) -> Result<AxisStatus, Failure> {
    let limit = Limit::after_s(wait_s);
    // The report that a command causes may have been written before it was taken: the next one was not.
    client.report()?;
    loop {
        let (report, phase) = client.report()?;
        let missing = || Failure::Failed("the streamer reports no such axis; use one release".to_owned());
        let axis = report.axes().get(index).copied().ok_or_else(missing)?;
        let status = AxisStatus::all(&report, arm).into_iter().nth(index).ok_or_else(missing)?;
        let is_at = |position: f64| (axis.command - position).abs() <= ROUNDING * (1.0 + position.abs());
        let rests = axis.command_velocity.abs() <= 0.0 && is_at(axis.target);
        match axis.state() {
            AxisState::Holding if rests && wait_s > 0.0 && goal != AxisGoal::Stop && !is_at(axis.goal) => {
                return Err(Failure::Failed(format!(
                    "stopped before its position, by a command, a stall or a short contact: {status}"
                )));
            }
            AxisState::Holding | AxisState::InContact if rests => return Ok(status),
            AxisState::Off | AxisState::Fault => {
                let why = fault_sentence(&report, arm);
                return Err(Failure::Failed(format!("{status}; the arm is {}: {why}", phase.word())));
            }
            AxisState::Holding | AxisState::Moving | AxisState::InContact if wait_s <= 0.0 => {
                return Ok(status);
            }
            AxisState::Holding | AxisState::Moving | AxisState::InContact if limit.is_over() => {
                return Err(Failure::Failed(format!(
                    "the command was accepted, but after {wait_s} s: {status}; see `taustream axis`, or wait longer with --wait-s"
                )));
            }
            AxisState::Holding | AxisState::Moving | AxisState::InContact => interrupt::check()?,
        }
    }
}
