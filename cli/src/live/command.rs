//! enable, disable, pause, resume, speed, stop, torque-off, clear-fault: one command, then the wait for its effect.
use super::client::{Client, Limit, STREAMER};
use super::{standstill, stop_way};
use crate::arm::{ArmName, settings_to_talk};
use crate::failure::Failure;
use crate::interrupt;
use crate::output::Form;
use crate::words::fault_sentence;
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};
use taustream_messages::operator::request_of;
use taustream_messages::{Command, CommandReply, Phase, Report};

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
    /// What deserves a look before the first motion.
    notices: Vec<String>,
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.command, self.phase.unwrap_or("phase unknown"))?;
        if !self.message.is_empty() {
            write!(f, " ({})", self.message)?;
        }
        self.notices.iter().try_for_each(|notice| write!(f, "\nNOTICE: {notice}"))
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
        Command::Home { .. } => "home",
        Command::Axis { .. } => "axis",
    }
}

/// Where the arm is, as far as waiting for a command's effect is concerned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Arm {
    phase: Phase,
    /// At least one drive carries torque.
    energised: bool,
}

/// Whether the arm is where a command leads to. Commands that act at once have nothing to wait for.
fn is_reached(command: Command, arm: Arm) -> bool {
    let phase = arm.phase;
    let de_energised = matches!(phase, Phase::Configuring | Phase::Disabled);
    match command {
        Command::Enable => phase == Phase::Holding,
        // A fault stays a fault when its drives are de-energised.
        Command::Disable => de_energised || (phase == Phase::Fault && !arm.energised),
        // The motion may end by itself before the pause has slowed it down.
        Command::Pause => matches!(phase, Phase::Paused | Phase::Holding),
        Command::Home { .. } => phase == Phase::Locked,
        // An arm that rests is stopped, whatever else is the matter with it.
        Command::Stop => de_energised || matches!(phase, Phase::Holding | Phase::Locked | Phase::Fault),
        Command::FastStop => de_energised || phase == Phase::Fault,
        Command::ClearFault => matches!(phase, Phase::Locked | Phase::Disabled),
        // Whoever looks at the arm after the answer sees it no longer paused.
        Command::Resume => !matches!(phase, Phase::Pausing | Phase::Paused),
        Command::TorqueOff | Command::Speed { .. } | Command::Reference { .. } | Command::Axis { .. } => true,
    }
}

/// Whether a command that was accepted in this phase asks for what is already so, or changes no phase.
fn is_so_already(command: Command, phase: Phase) -> bool {
    match command {
        Command::Enable => {
            matches!(phase, Phase::Moving | Phase::Pausing | Phase::Paused | Phase::Stopping)
        }
        Command::Disable
        | Command::Pause
        | Command::Resume
        | Command::Stop
        | Command::FastStop
        | Command::TorqueOff
        | Command::Speed { .. }
        | Command::Reference { .. }
        | Command::Home { .. }
        | Command::Axis { .. }
        | Command::ClearFault => false,
    }
}

/// Whether a phase says that a command will not get where it leads to.
fn is_lost(command: Command, phase: Phase) -> bool {
    match command {
        Command::Enable | Command::Pause | Command::Home { .. } => {
            matches!(phase, Phase::Fault | Phase::Braking | Phase::FastStopping)
        }
        // In a fault that holds, it is under way.
        Command::Disable => matches!(phase, Phase::Braking | Phase::FastStopping),
        Command::Resume
        | Command::Stop
        | Command::FastStop
        | Command::TorqueOff
        | Command::Speed { .. }
        | Command::Reference { .. }
        | Command::Axis { .. }
        | Command::ClearFault => false,
    }
}

/// Sends a command, waits up to `wait_s` for its effect, and prints the answer.
pub(crate) fn run(form: Form, arm: &ArmName, command: Command, wait_s: f64) -> Result<(), Failure> {
    let answer = match request_of(command) {
        Some(request) => stop(arm, command, request, wait_s)?,
        None => send(&Client::join(&arm.name)?, arm, command, wait_s, &mut || {})?,
    };
    form.print(&answer)
}

/// Enables the arm, and then looks whether it bears what its masses weigh.
pub(crate) fn enable(form: Form, given: Option<&Path>, wait_s: f64) -> Result<(), Failure> {
    let arm = ArmName::read(given)?;
    let client = Client::join(&arm.name)?;
    let mut answer = send(&client, &arm, Command::Enable, wait_s, &mut || {})?;
    // Settings with a fault have been mentioned, and keep nobody from enabling.
    if let (true, Ok(settings)) = (wait_s > 0.0, settings_to_talk(given)) {
        answer.notices = standstill::notices(&client, &settings)?;
    }
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
    while wait_s > 0.0 && !phase.is_some_and(|p| is_reached(command, Arm { phase: p, energised: true })) {
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
    if !reply.is_accepted() {
        let at = reply.phase().map_or("in an unknown phase", Phase::word);
        let why = refusal(client, arm, command, &reply)?;
        return Err(Failure::Refused(format!("{} refused while {at}: {why}", word(command))));
    }
    let mut phase = accepted(command, &reply)?;
    let acts_at_once = phase.is_some_and(|p| is_reached(command, Arm { phase: p, energised: true }));
    let is_done = |p| is_so_already(command, p) || (acts_at_once && command != Command::ClearFault);
    if wait_s > 0.0 && !phase.is_some_and(is_done) {
        phase = Some(wait_for(client, arm, (command, phase), wait_s)?);
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
        notices: Vec::new(),
    }
}

fn too_long(command: Command, phase: Option<Phase>, wait_s: f64) -> Failure {
    Failure::Failed(format!(
        "{} was accepted, but the arm is still {} after {wait_s} s; see `taustream status`, or give it longer with --wait-s",
        word(command),
        phase.map_or("in an unknown phase", Phase::word)
    ))
}

/// Why a command was refused. An answer is short; the fault that stands in the way of `enable` is not always.
fn refusal(
    client: &Client,
    arm: &ArmName,
    command: Command,
    reply: &CommandReply,
) -> Result<String, Failure> {
    if command != Command::Enable || reply.phase() != Some(Phase::Fault) {
        return Ok(reply.text());
    }
    let (report, phase) = client.report()?;
    let fault = fault_sentence(&report, arm);
    let is_there = phase == Phase::Fault && report.fault_reason != 0;
    Ok(if is_there { format!("`clear-fault` first, once the cause is fixed: {fault}") } else { reply.text() })
}

/// Asks once. An `enable` that comes while drives are still being configured waits until they are, by the reports, and asks
/// then, or when its time is over: the refusal says what is missing.
fn ask(client: &Client, command: Command, wait_s: f64) -> Result<CommandReply, Failure> {
    let limit = Limit::after_s(wait_s);
    loop {
        while command == Command::Enable && !limit.is_over() && client.report()?.1 == Phase::Configuring {
            interrupt::check()?;
        }
        let reply = client.command(command)?;
        // A drive may have been lost between the report and the question.
        let too_early = command == Command::Enable && reply.phase() == Some(Phase::Configuring);
        if reply.is_accepted() || !too_early || limit.is_over() {
            return Ok(reply);
        }
        interrupt::check()?;
        thread::sleep(ASK_AGAIN);
    }
}

/// Pause between two questions; the streamer's log has a line for each.
const ASK_AGAIN: Duration = Duration::from_millis(500);
/// Reports in a row that a cleared fault must stay away, and for how long: a drive whose fault is still there, or that is
/// refused again, says so within a few cycles.
const CLEAR_REPORTS: u32 = 3;
const CLEAR_FOR: Duration = Duration::from_millis(250);

/// Whether what is waited for has lasted.
struct Lasting {
    since: Option<Instant>,
    reports: u32,
}

impl Lasting {
    /// Takes one report; true when it is enough.
    fn take(&mut self, command: Command, reached: bool) -> bool {
        if !reached {
            (self.since, self.reports) = (None, 0);
            return false;
        }
        self.reports += 1;
        let since = *self.since.get_or_insert_with(Instant::now);
        command != Command::ClearFault || (self.reports >= CLEAR_REPORTS && since.elapsed() >= CLEAR_FOR)
    }
}

fn wait_for(
    client: &Client,
    arm: &ArmName,
    (command, from): (Command, Option<Phase>),
    wait_s: f64,
) -> Result<Phase, Failure> {
    let limit = Limit::after_s(wait_s);
    let mut lasting = Lasting { since: None, reports: 0 };
    let mut was_cleared = false;
    let name = word(command);
    loop {
        let (report, phase) = client.report()?;
        // A fault that comes while drives are being de-energised is no end of that.
        let new_fault = command == Command::Disable
            && phase == Phase::Fault
            && from.is_some_and(|from| from != Phase::Fault);
        if !new_fault
            && lasting.take(command, is_reached(command, Arm { phase, energised: report.energised != 0 }))
        {
            return Ok(phase);
        }
        let came_back = was_cleared && phase == Phase::Fault;
        was_cleared |= command == Command::ClearFault && phase != Phase::Fault;
        if came_back {
            let fault = fault_sentence(&report, arm);
            return Err(Failure::Failed(format!("the fault was cleared and came back: {fault}")));
        }
        if new_fault || is_lost(command, phase) {
            let fault = fault_sentence(&report, arm);
            return Err(Failure::Failed(format!(
                "{name} was accepted, but the arm is {}: {fault}",
                phase.word()
            )));
        }
        if limit.is_over() {
            let why = still_there(&report, phase, arm);
            return Err(Failure::Failed(format!(
                "{name} was accepted, but the arm is still {} after {wait_s} s{why}; see `taustream status`, or give it \
                 longer with --wait-s",
                phase.word()
            )));
        }
        interrupt::check()?;
        thread::sleep(Duration::from_millis(5));
    }
}

/// What keeps the arm where it is: its fault, or the first drive that says what is wrong with it.
fn still_there(report: &Report, phase: Phase, arm: &ArmName) -> String {
    if phase == Phase::Fault {
        return format!(" ({})", fault_sentence(report, arm));
    }
    let names = arm.names_in(report);
    let errors = report.drive_error.iter().enumerate().take(report.joints());
    let found =
        errors.filter(|(_, code)| **code != 0).map(|(joint, code)| names.drive_error(joint, *code)).next();
    found.map_or_else(String::new, |found| format!(" ({found})"))
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
            assert!(
                Phase::ALL.iter().any(|p| is_reached(command, Arm { phase: *p, energised: false })),
                "{command:?}"
            );
            for phase in Phase::ALL {
                let arm = Arm { phase, energised: false };
                let at_once = matches!(
                    command,
                    Command::Resume | Command::TorqueOff | Command::Speed { .. } | Command::Reference { .. }
                );
                let both = is_reached(command, arm) && is_lost(command, phase);
                assert!(at_once || !both, "{command:?} {phase:?}");
            }
        }
    }

    /// Goal: `resume && status` never shows the pause that was just ended.
    #[test]
    fn resume_waits_until_the_arm_is_not_paused_any_more() {
        let reached = |phase| is_reached(Command::Resume, Arm { phase, energised: true });
        assert!(!reached(Phase::Paused) && !reached(Phase::Pausing));
        assert!(reached(Phase::Moving) && reached(Phase::Holding) && reached(Phase::Fault));
    }

    /// Goal: `disable && clear-fault` works: the first returns only when no drive carries torque any more.
    #[test]
    fn disable_in_a_fault_waits_until_nothing_is_energised() {
        let arm = |energised| Arm { phase: Phase::Fault, energised };
        assert!(!is_reached(Command::Disable, arm(true)) && !is_so_already(Command::Disable, Phase::Fault));
        assert!(!is_lost(Command::Disable, Phase::Fault));
        assert!(is_reached(Command::Disable, arm(false)));
    }

    /// Goal: a fault that comes back at once was not cleared.
    #[test]
    fn cleared_fault_counts_only_when_it_stays_away() {
        let mut lasting = Lasting { since: None, reports: 0 };
        assert!(!lasting.take(Command::ClearFault, true));
        assert!(!lasting.take(Command::ClearFault, false));
        for _ in 0..CLEAR_REPORTS {
            assert!(!lasting.take(Command::ClearFault, true), "too early");
        }
        lasting.since = Instant::now().checked_sub(CLEAR_FOR);
        assert!(lasting.take(Command::ClearFault, true));
        // Every other command is done where it leads to.
        assert!(Lasting { since: None, reports: 0 }.take(Command::Enable, true));
    }
}
