//! The second way to stop: the streamer's own socket, where shared memory is out of reach.
use crate::arm::ArmName;
use crate::failure::Failure;
use rustix::net::sockopt::socket_peercred;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixStream};
use std::path::Path;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;
use taustream_arm::runtime;
use taustream_messages::operator::{abstract_name, read_answer, socket_file};
use taustream_messages::service::users_of;
use taustream_messages::{CommandReply, Phase};

/// How long one exchange may take: the streamer answers within a few cycles, or says after 1.2 s that the cycle does not.
const EXCHANGE_WITHIN: Duration = Duration::from_secs(3);
/// Longest answer, bytes.
const ANSWER_BYTES_MAX: u64 = 1024;

/// Asks the streamer of an arm by its socket; its answer.
///
/// # Errors
/// What stands in the way, of every name of the socket.
pub(super) fn ask(arm: &ArmName, request: &'static str) -> Result<CommandReply, Failure> {
    // A socket whose queue is full makes its caller wait: not this thread.
    let (answer, answered) = channel();
    let name = arm.name.clone();
    let work = move || drop(answer.send(exchange(&name, request)));
    thread::Builder::new()
        .name("stop".into())
        .spawn(work)
        .map_err(|e| Failure::Failed(format!("cannot start a thread: {e}")))?;
    let result = answered
        .recv_timeout(EXCHANGE_WITHIN)
        .unwrap_or_else(|_| Err(format!("no answer within {} s", EXCHANGE_WITHIN.as_secs())));
    result.map_err(Failure::Socket)
}

/// The phase, by the socket.
pub(super) fn phase(arm: &ArmName) -> Result<Phase, Failure> {
    let reply = ask(arm, taustream_messages::operator::PHASE)?;
    reply.phase().ok_or_else(|| Failure::Socket("it tells no phase".to_owned()))
}

fn exchange(arm: &str, request: &str) -> Result<CommandReply, String> {
    let own = rustix::process::geteuid().as_raw();
    let mut users = vec![own];
    if own == 0 {
        // Root may stop everybody's arm.
        users.extend(users_of(arm).into_iter().filter(|user| *user != 0));
    }
    let mut obstacles = Vec::new();
    for user in users {
        let file = socket_file(arm, &runtime::expected(user, Path::new("/run")));
        let by_file = UnixStream::connect(&file);
        let name = abstract_name(arm, user);
        let by_name =
            || SocketAddr::from_abstract_name(&name).and_then(|address| UnixStream::connect_addr(&address));
        let mut tried = |stream: io::Result<UnixStream>, name: &str| {
            let reply = stream.map_err(|e| e.to_string()).and_then(|stream| talk(stream, user, request));
            reply.map_err(|why| obstacles.push(format!("{name}: {why}"))).ok()
        };
        if let Some(reply) =
            tried(by_file, &file.display().to_string()).or_else(|| tried(by_name(), &format!("@{name}")))
        {
            return Ok(reply);
        }
    }
    Err(obstacles.join("; "))
}

/// One line each way, with a process of the right user only: anybody can take an abstract name.
fn talk(mut stream: UnixStream, user: u32, request: &str) -> Result<CommandReply, String> {
    let peer = socket_peercred(&stream).map_err(|e| e.to_string())?;
    if peer.uid.as_raw() != user {
        let (pid, uid) = (peer.pid.as_raw_nonzero(), peer.uid.as_raw());
        return Err(format!(
            "process {pid} of uid {uid} has taken this name, not the streamer; end that process"
        ));
    }
    let read = stream
        .set_read_timeout(Some(EXCHANGE_WITHIN))
        .and_then(|()| stream.set_write_timeout(Some(EXCHANGE_WITHIN)))
        .and_then(|()| stream.write_all(format!("{request}\n").as_bytes()))
        .and_then(|()| {
            let mut line = String::new();
            BufReader::new(stream.take(ANSWER_BYTES_MAX)).read_line(&mut line)?;
            Ok(line)
        });
    let line = read.map_err(|e| e.to_string())?;
    read_answer(&line).ok_or_else(|| "its answer makes no sense".to_owned())
}
