//! enable, disable, pause, resume, speed, stop, torque-off, clear-fault: one command, then the wait for its effect.
use super::client::{Client, Limit, STREAMER};
use super::stop_way;
use crate::arm::ArmName;
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::fault_sentence;
use serde::Serialize;
use std::fmt;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;
use taustream_messages::operator::request_of;
use taustream_messages::{Command, CommandReply, Phase};

/// How long shared memory may take for an answer to a stop, before the other way is taken.
const SHARED_MEMORY_S_MAX: f64 = 1.5;

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
    let answer = match request_of(command) {
        Some(request) => stop(arm, command, request, wait_s)?,
        None => send(&Client::join(&arm.name)?, arm, command, wait_s, &mut || {})?,
    };
    form.print(&answer)
}

/// How far a command has come by shared memory.
enum Progress {
    Answered,
    Ended(Result<Answer, Failure>),
}

/// Stops by shared memory, or by the streamer's own socket where shared memory fails or is slow.
fn stop(arm: &ArmName, command: Command, request: &'static str, wait_s: f64) -> Result<Answer, Failure> {
    let (progress, progressed) = channel();
    let (target, to) = (arm.clone(), progress.clone());
    let work = move || {
        let ended = Client::join(&target.name).and_then(|client| {
            send(&client, &target, command, wait_s, &mut || drop(to.send(Progress::Answered)))
        });
        drop(progress.send(Progress::Ended(ended)));
    };
    thread::Builder::new()
        .name("shared memory".into())
        .spawn(work)
        .map_err(|e| Failure::Failed(format!("cannot start a thread: {e}")))?;
    let limit = Limit::after_s(SHARED_MEMORY_S_MAX);
    let mut answered = false;
    let why = loop {
        match progressed.recv_timeout(Duration::from_millis(5)) {
            Ok(Progress::Answered) => answered = true,
            Ok(Progress::Ended(Err(failure))) if failure.is_of_transport() => {
                break failure;
            }
            Ok(Progress::Ended(ended)) => return ended,
            Err(RecvTimeoutError::Disconnected) => break no_answer(arm),
            Err(RecvTimeoutError::Timeout) if !answered && limit.is_over() => break no_answer(arm),
            Err(RecvTimeoutError::Timeout) => interrupt::check()?,
        }
    };
    match stop_by_socket(arm, command, request, wait_s) {
        Ok(answer) => {
            let message = format!(
                "{}; by the streamer's own socket, because shared memory failed: {why}",
                answer.message
            );
            Ok(Answer { message, ..answer })
        }
        // Both ways agree that nobody is there.
        Err(failure) if failure.is_of_socket() && why.kind() == "not-running" => Err(why),
        Err(failure) if failure.is_of_socket() => Err(Failure::Failed(format!("{why}; {failure}"))),
        Err(failure) => Err(failure),
    }
}

fn no_answer(arm: &ArmName) -> Failure {
    Failure::NoAnswer { who: STREAMER, arm: arm.name.clone(), waited_s: SHARED_MEMORY_S_MAX }
}

fn stop_by_socket(
    arm: &ArmName,
    command: Command,
    request: &'static str,
    wait_s: f64,
) -> Result<Answer, Failure> {
    let reply = stop_way::ask(arm, request)?;
    let limit = Limit::after_s(wait_s);
    let mut phase = accepted(command, &reply)?;
    while wait_s > 0.0 && !phase.is_some_and(|p| is_reached(command, p)) {
        if limit.is_over() {
            return Err(too_long(command, phase, wait_s));
        }
        interrupt::check()?;
        thread::sleep(Duration::from_millis(20));
        phase = Some(stop_way::phase(arm)?);
    }
    Ok(answer(arm, command, phase, &reply))
}

/// Like [`run`], without printing: the demo's way to command.
pub(crate) fn execute(client: &Client, arm: &ArmName, command: Command, wait_s: f64) -> Result<(), Failure> {
    send(client, arm, command, wait_s, &mut || {}).map(drop)
}

fn send(
    client: &Client,
    arm: &ArmName,
    command: Command,
    wait_s: f64,
    answered: &mut dyn FnMut(),
) -> Result<Answer, Failure> {
    let reply = ask(client, command, wait_s)?;
    answered();
    let mut phase = accepted(command, &reply)?;
    let is_done = |p| is_reached(command, p) || is_so_already(command, p);
    if wait_s > 0.0 && !phase.is_some_and(is_done) {
        phase = Some(wait_for(client, arm, command, wait_s)?);
    }
    Ok(answer(arm, command, phase, &reply))
}

/// The phase in which a command was accepted.
fn accepted(command: Command, reply: &CommandReply) -> Result<Option<Phase>, Failure> {
    let (name, phase) = (word(command), reply.phase());
    if reply.is_accepted() {
        return Ok(phase);
    }
    let at = phase.map_or("in an unknown phase", Phase::word);
    Err(Failure::Refused(format!("{name} refused while {at}: {}", reply.text())))
}

fn answer(arm: &ArmName, command: Command, phase: Option<Phase>, reply: &CommandReply) -> Answer {
    Answer {
        arm: arm.name.clone(),
        command: word(command),
        accepted: true,
        phase: phase.map(Phase::word),
        message: reply.text(),
    }
}

fn too_long(command: Command, phase: Option<Phase>, wait_s: f64) -> Failure {
    Failure::Failed(format!(
        "{} was accepted, but the arm is still {} after {wait_s} s; see `taustream status`, or give it longer with --wait-s",
        word(command),
        phase.map_or("in an unknown phase", Phase::word)
    ))
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
            return Err(too_long(command, Some(phase), wait_s));
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
