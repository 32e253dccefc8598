//! enable, disable, pause, resume, speed, stop, torque-off, clear-fault: one command, then the wait for its effect.
use super::client::{Client, Limit};
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::fault_sentence;
use serde::Serialize;
use std::fmt;
use std::thread;
use std::time::Duration;
use taustream_messages::{Command, CommandReply, Phase};

/// What became of a command.
#[derive(Debug, Serialize)]
struct Answer {
    arm: String,
    command: &'static str,
    accepted: bool,
    phase: Option<&'static str>,
    message: String,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.command, self.phase.unwrap_or("phase unknown"))?;
        if self.message.is_empty() { Ok(()) } else { write!(f, " ({})", self.message) }
    }
}

/// The word that users type for a command.
pub(crate) fn word(command: Command) -> &'static str {
    match command {
        Command::Enable => "enable",
        Command::Disable => "disable",
        Command::Pause => "pause",
        Command::Resume => "resume",
        Command::Stop => "stop",
        Command::FastStop => "stop --fast",
        Command::TorqueOff => "torque-off",
        Command::Speed { .. } => "speed",
        Command::ClearFault => "clear-fault",
        Command::Reference { .. } => "reference",
    }
}

/// Whether a phase is where a command leads to. Commands that act at once have nothing to wait for.
fn is_reached(command: Command, phase: Phase) -> bool {
    let de_energised = matches!(phase, Phase::Configuring | Phase::Disabled);
    match command {
        Command::Enable => phase == Phase::Holding,
        Command::Disable => de_energised,
        // The motion may end by itself before the pause has slowed it down.
        Command::Pause => matches!(phase, Phase::Paused | Phase::Holding),
        // An arm that rests is stopped, whatever else is the matter with it.
        Command::Stop => de_energised || matches!(phase, Phase::Holding | Phase::Locked | Phase::Fault),
        Command::FastStop => de_energised || phase == Phase::Fault,
        Command::ClearFault => matches!(phase, Phase::Locked | Phase::Disabled),
        Command::Resume | Command::TorqueOff | Command::Speed { .. } | Command::Reference { .. } => true,
    }
}

/// Whether a command that was accepted in this phase asks for what is already so, or changes no phase.
fn is_so_already(command: Command, phase: Phase) -> bool {
    match command {
        Command::Enable => {
            matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping)
        }
        // A fault stays a fault when its drives are de-energised.
        Command::Disable => phase == Phase::Fault,
        Command::Pause
        | Command::Resume
        | Command::Stop
        | Command::FastStop
        | Command::TorqueOff
        | Command::Speed { .. }
        | Command::Reference { .. }
        | Command::ClearFault => false,
    }
}

/// Whether a phase says that a command will not get where it leads to.
fn is_lost(command: Command, phase: Phase) -> bool {
    let faulted = matches!(phase, Phase::Fault | Phase::Braking | Phase::FastStopping);
    faulted && matches!(command, Command::Enable | Command::Disable | Command::Pause)
}

/// Sends a command, waits up to `wait_s` for its effect, and prints the answer.
pub(crate) fn run(form: Form, arm: &ArmName, command: Command, wait_s: f64) -> Result<(), Failure> {
    let client = Client::join(&arm.name)?;
    let answer = send(&client, arm, command, wait_s)?;
    form.print(&answer)
}

/// Like [`run`], without printing: the demo's way to command.
pub(crate) fn execute(client: &Client, arm: &ArmName, command: Command, wait_s: f64) -> Result<(), Failure> {
    send(client, arm, command, wait_s).map(drop)
}

fn send(client: &Client, arm: &ArmName, command: Command, wait_s: f64) -> Result<Answer, Failure> {
    let reply = ask(client, command, wait_s)?;
    let (name, mut phase) = (word(command), reply.phase());
    if !reply.is_accepted() {
        let at = phase.map_or("in an unknown phase", Phase::word);
        return Err(Failure::Refused(format!("{name} refused while {at}: {}", reply.text())));
    }
    let is_done = |p| is_reached(command, p) || is_so_already(command, p);
    if wait_s > 0.0 && !phase.is_some_and(is_done) {
        phase = Some(wait_for(client, arm, command, wait_s)?);
    }
    Ok(Answer {
        arm: arm.name.clone(),
        command: name,
        accepted: true,
        phase: phase.map(Phase::word),
        message: reply.text(),
    })
}

/// Asks once; an `enable` that comes while drives are still being configured is asked again until they are.
fn ask(client: &Client, command: Command, wait_s: f64) -> Result<CommandReply, Failure> {
    let limit = Limit::after_s(wait_s);
    loop {
        let reply = client.command(command)?;
        let too_early = command == Command::Enable && reply.phase() == Some(Phase::Configuring);
        if reply.is_accepted() || !too_early || limit.is_over() {
            return Ok(reply);
        }
        interrupt::check()?;
        thread::sleep(Duration::from_millis(20));
    }
}

fn wait_for(client: &Client, arm: &ArmName, command: Command, wait_s: f64) -> Result<Phase, Failure> {
    let limit = Limit::after_s(wait_s);
    loop {
        let (report, phase) = client.report()?;
        if is_reached(command, phase) {
            return Ok(phase);
        }
        let name = word(command);
        if is_lost(command, phase) {
            let fault = fault_sentence(&report, arm);
            return Err(Failure::Failed(format!(
                "{name} was accepted, but the arm is {}: {fault}",
                phase.word()
            )));
        }
        if limit.is_over() {
            return Err(Failure::Failed(format!(
                "{name} was accepted, but the arm is still {} after {wait_s} s; see `taustream status`, or give it longer with --wait-s",
                phase.word()
            )));
        }
        interrupt::check()?;
        thread::sleep(Duration::from_millis(5));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Command; 10] = [
        Command::Enable,
        Command::Disable,
        Command::Pause,
        Command::Resume,
        Command::Stop,
        Command::FastStop,
        Command::TorqueOff,
        Command::Speed { percent: 50.0 },
        Command::ClearFault,
        Command::Reference { joint: 0, at_rad: 0.5 },
    ];

    #[test]
    fn command_wait_ends_in_some_phase_and_never_calls_success_a_loss() {
        for command in ALL {
            assert!(Phase::ALL.iter().any(|p| is_reached(command, *p)), "{command:?}");
            for phase in Phase::ALL {
                let at_once = matches!(
                    command,
                    Command::Resume | Command::TorqueOff | Command::Speed { .. } | Command::Reference { .. }
                );
                let both = is_reached(command, phase) && is_lost(command, phase);
                assert!(at_once || !both, "{command:?} {phase:?}");
            }
        }
    }
}
