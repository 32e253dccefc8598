//! The streamer's own socket: the second way for `stop`, `stop --fast` and `torque-off`, which needs no shared memory.
//!
//! A request is one line, `stop`, `stop --fast`, `torque-off` or `phase`; the answer is one line, `accepted` or `refused`,
//! the phase, and a sentence. The socket has a name in the runtime directory, and an abstract one, which survives that
//! directory. Only processes of the streamer's user and of root are answered (`SO_PEERCRED`).
//!
//! The thread that serves it also feeds the watchdog, while cycles run and commands are taken. It never logs, never touches a
//! disk, never waits for anybody: sockets are non-blocking, and a client that is slow or many is dropped.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::commands::{ANSWER_S_MAX, NO_ANSWER, TOO_MANY, valid_until};
use crate::intake::CommandPort;
use crate::log::{CommandEvent, EventWriter};
use crate::names::Names;
use crate::report::Pulse;
use crate::rt;
use rustix::net::sockopt::socket_peercred;
use std::fs;
use std::io::{self, ErrorKind, Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::{FileTypeExt, PermissionsExt};
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::Duration;
use taustream_arm::daemon::Manager;
use taustream_drivers::Nanos;
use taustream_messages::Phase;
use taustream_messages::operator::{self, LINE_BYTES_MAX};

/// How often the socket is looked at.
const INTERVAL: Duration = Duration::from_millis(4);
/// Most clients at one time; more are dropped.
const CLIENTS_MAX: usize = 16;
/// Most new clients in one round.
const ACCEPTED_MAX: usize = 16;
/// How long a client may take for its request and for reading the answer, s.
const CLIENT_S_MAX: f64 = 3.0;
/// The thread of commands is alive if it has come round in this time, opening its ports included, s.
const COMMANDS_ALIVE_S: f64 = 20.0;

/// What the thread works with.
#[derive(Debug)]
pub struct StopThread {
    /// To the cycle and back.
    pub port: CommandPort,
    /// What the cycle is doing.
    pub pulse: Arc<Pulse>,
    /// Names of joints and buses.
    pub names: Names,
    /// What is to be logged.
    pub events: EventWriter,
    /// The rounds of the thread that takes commands out of shared memory.
    pub command_rounds: Arc<AtomicU64>,
    /// The arm's name.
    pub arm: String,
}

/// Binds the socket in the runtime directory. Whatever stood there is of a streamer that has gone: a running one holds the bus.
///
/// # Errors
/// When the directory does not take it.
pub fn bind_file(arm: &str, runtime: &Path) -> io::Result<UnixListener> {
    let path = operator::socket_file(arm, runtime);
    if fs::symlink_metadata(&path)
        .is_ok_and(|cycle_state| cycle_state.file_type().is_socket() || cycle_state.is_file())
    {
        fs::remove_file(&path)?;
    }
    let listener = UnixListener::bind(&path)?;
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600))?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

/// Binds the abstract name. `Err` with the holder when somebody else has it.
fn bind_abstract(arm: &str) -> Result<UnixListener, Option<(u32, i32)>> {
    let uid = rustix::process::geteuid().as_raw();
    let address = SocketAddr::from_abstract_name(operator::abstract_name(arm, uid)).map_err(|_| None)?;
    match UnixListener::bind_addr(&address) {
        Ok(listener) => listener.set_nonblocking(true).map(|()| listener).map_err(|_| None),
        Err(e) if e.kind() == ErrorKind::AddrInUse => {
            let holder =
                UnixStream::connect_addr(&address).ok().and_then(|stream| socket_peercred(&stream).ok());
            Err(holder.map(|holder| (holder.uid.as_raw(), holder.pid.as_raw_nonzero().get())))
        }
        Err(_) => Err(None),
    }
}

/// One client.
#[derive(Debug)]
struct Client {
    stream: UnixStream,
    since: Nanos,
    request: Vec<u8>,
    /// The command that waits for the cycle's answer.
    sequence: Option<u64>,
    done: bool,
}

impl Client {
    /// The request, once its line has ended.
    fn line(&mut self) -> Option<String> {
        let mut bytes = [0; LINE_BYTES_MAX];
        match self.stream.read(&mut bytes) {
            Ok(0) => self.done = true,
            Ok(count) => self.request.extend_from_slice(bytes.get(..count).unwrap_or_default()),
            Err(e) if e.kind() == ErrorKind::WouldBlock => return None,
            Err(_) => self.done = true,
        }
        let end = self.request.iter().position(|byte| *byte == b'\n');
        if end.is_none() && self.request.len() >= LINE_BYTES_MAX {
            self.done = true;
        }
        let line = self.request.get(..end?)?;
        Some(String::from_utf8_lossy(line).trim().to_owned())
    }

    fn answer(&mut self, accepted: bool, phase: Phase, text: &str) {
        let line = operator::answer_line(accepted, phase, text);
        // It fits into an empty socket at once, or the client has gone.
        let _gone = self.stream.write_all(line.as_bytes());
        self.done = true;
    }
}

impl StopThread {
    /// Serves until `stop`. `files` brings the socket in the runtime directory, and a new one when that one has vanished.
    pub fn serve(mut self, files: &Receiver<UnixListener>, mut manager: Manager, stop: &AtomicBool) {
        let by_name = match bind_abstract(&self.arm) {
            Ok(listener) => Some(listener),
            Err(holder) => {
                if let Some((uid, pid)) = holder {
                    self.events.push(CommandEvent::NameTaken { uid, pid });
                }
                None
            }
        };
        let mut by_file = None;
        let mut clients: Vec<Client> = Vec::with_capacity(CLIENTS_MAX);
        let mut life = Life::new(&self.pulse, &self.command_rounds);
        loop {
            let last = stop.load(Ordering::Acquire);
            by_file = files.try_iter().last().or(by_file);
            for listener in by_file.iter().chain(&by_name) {
                self.accept(listener, &mut clients);
            }
            for client in &mut clients {
                self.take_request(client);
            }
            self.return_answers(&mut clients);
            let now = rt::now();
            clients.retain(|client| !client.done && now.since_s(client.since) <= CLIENT_S_MAX);
            life.tell(&mut manager, &self.arm, &self.pulse, &self.command_rounds);
            if last {
                return;
            }
            thread::sleep(INTERVAL);
        }
    }

    fn accept(&mut self, listener: &UnixListener, clients: &mut Vec<Client>) {
        for _ in 0..ACCEPTED_MAX {
            let Ok((stream, _)) = listener.accept() else { return };
            let Ok(peer) = socket_peercred(&stream) else { continue };
            let uid = peer.uid.as_raw();
            if uid != 0 && uid != rustix::process::geteuid().as_raw() {
                let pid = peer.pid.as_raw_nonzero().get();
                self.events.push(CommandEvent::Stranger { uid, pid });
                continue;
            }
            if clients.len() < CLIENTS_MAX && stream.set_nonblocking(true).is_ok() {
                let (since, request) = (rt::now(), Vec::with_capacity(LINE_BYTES_MAX));
                clients.push(Client { stream, since, request, sequence: None, done: false });
            }
        }
    }

    fn take_request(&mut self, client: &mut Client) {
        if client.sequence.is_some() || client.done {
            return;
        }
        let Some(line) = client.line() else { return };
        let phase = self.pulse.phase();
        let Some(command) = operator::command_of(&line) else {
            let asks = line == operator::PHASE;
            let text = if asks { "" } else { "unknown request; use stop, stop --fast, torque-off or phase" };
            return client.answer(asks, phase, text);
        };
        self.events.push(CommandEvent::PendingCommand { command, socket: true });
        match self.port.ask(command, valid_until(rt::now())) {
            Some(sequence) => client.sequence = Some(sequence),
            None => client.answer(false, phase, TOO_MANY),
        }
    }

    fn return_answers(&mut self, clients: &mut [Client]) {
        while let Some(answer) = self.port.answer() {
            self.events.push(CommandEvent::Answered(answer));
            let text = answer.why.sentence(&self.names);
            if let Some(client) = clients.iter_mut().find(|client| client.sequence == Some(answer.sequence)) {
                client.answer(answer.accepted, answer.phase, &text);
            }
        }
        let (now, phase) = (rt::now(), self.pulse.phase());
        for client in clients.iter_mut().filter(|client| client.sequence.is_some() && !client.done) {
            if now.since_s(client.since) > ANSWER_S_MAX {
                client.answer(false, phase, NO_ANSWER);
            }
        }
    }
}

/// What the service manager hears: readiness and the watchdog hang on cycles that have run and on commands that are taken.
/// This thread's own life says nothing about the arm.
#[derive(Debug)]
struct Life {
    cycles: u64,
    rounds: u64,
    round_at: Nanos,
    sent: Option<Phase>,
}

impl Life {
    fn new(pulse: &Pulse, rounds: &AtomicU64) -> Self {
        Self {
            cycles: pulse.cycles(),
            rounds: rounds.load(Ordering::Relaxed),
            round_at: rt::now(),
            sent: None,
        }
    }

    fn tell(&mut self, manager: &mut Manager, arm: &str, pulse: &Pulse, rounds: &AtomicU64) {
        let (now, cycles, rounds) = (rt::now(), pulse.cycles(), rounds.load(Ordering::Relaxed));
        if rounds != self.rounds {
            (self.rounds, self.round_at) = (rounds, now);
        }
        let progress = cycles != self.cycles && now.since_s(self.round_at) <= COMMANDS_ALIVE_S;
        self.cycles = cycles;
        if !progress {
            return;
        }
        manager.progress();
        let phase = pulse.phase();
        if self.sent != Some(phase) {
            self.sent = Some(phase);
            manager.status(&format!("arm {arm}: {}", phase.word()));
        }
    }
}
