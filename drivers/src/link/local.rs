//! The local link: a bus between two processes of one host, for hosts whose kernel has no CAN.
//!
//! The simulated servos own a `SOCK_SEQPACKET` socket under the runtime directory; the master connects to it. Packets are
//! frames at their kernel size, so both links share their hot path. Unlike a bus, it joins exactly two ends; like vcan,
//! it has no bit rate, and frames that the servos send while no master is there are lost without a fault.
use super::batch::SocketKind;
use super::lock::FileLock;
use super::open::{Holder, OpenError};
use super::{CanLink, LinkFault, Sent, batch};
use crate::frame::{CanFrame, FrameBatch};
use rustix::event::epoll;
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType};
use std::fs::{DirBuilder, Permissions};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use taustream_arm::Bus;

/// Never inherited by a child, never waiting.
const FLAGS: SocketFlags = SocketFlags::CLOEXEC.union(SocketFlags::NONBLOCK);

/// Where one local link meets.
#[derive(Clone, Debug)]
struct Meeting {
    interface: String,
    directory: PathBuf,
}

impl Meeting {
    fn of(bus: &Bus, runtime: &Path) -> Self {
        Self { interface: bus.interface.clone(), directory: runtime.join("links") }
    }

    /// The socket that the servos own.
    fn socket(&self) -> PathBuf {
        self.directory.join(format!("{}.socket", self.interface))
    }

    fn address(&self) -> Result<SocketAddrUnix, OpenError> {
        let path = self.socket();
        SocketAddrUnix::new(&path).map_err(|_| OpenError::PathTooLong { path })
    }

    /// Makes the directory, or checks that the one that is there belongs to this user alone: whoever may connect may move
    /// the arm.
    fn prepare(&self) -> Result<(), OpenError> {
        let path = &self.directory;
        let failed = |doing| move |source| OpenError::File { path: path.clone(), doing, source };
        DirBuilder::new().recursive(true).mode(0o700).create(path).map_err(failed("create"))?;
        let metadata = std::fs::symlink_metadata(path).map_err(failed("look at"))?;
        let mode = metadata.mode() & 0o7777;
        let is_ours = metadata.is_dir() && metadata.uid() == rustix::process::geteuid().as_raw();
        if !is_ours || mode & 0o077 != 0 {
            return Err(OpenError::OpenDirectory { path: path.clone(), uid: metadata.uid(), mode });
        }
        Ok(())
    }

    /// Takes the lock of one side.
    fn lock(&self, side: &str) -> Result<Result<FileLock, Holder>, OpenError> {
        let path = self.directory.join(format!("{}.{side}.lock", self.interface));
        FileLock::take(&path).map_err(|source| OpenError::File { path, doing: "lock", source })
    }

    fn failed(&self, doing: &'static str, errno: Errno) -> OpenError {
        OpenError::File { path: self.socket(), doing, source: errno.into() }
    }
}

/// A socket of the local link's kind.
fn seqpacket(meeting: &Meeting) -> Result<OwnedFd, OpenError> {
    rustix::net::socket_with(AddressFamily::UNIX, SocketType::SEQPACKET, FLAGS, None)
        .map_err(|errno| meeting.failed("open a socket for", errno))
}

/// The master's end.
#[derive(Debug)]
pub(super) struct LocalMaster {
    meeting: Meeting,
    peer: OwnedFd,
    gone: bool,
    _lock: FileLock,
}

impl LocalMaster {
    /// Locks the link and connects to the servos.
    pub(super) fn open(bus: &Bus, runtime: &Path) -> Result<Self, OpenError> {
        let meeting = Meeting::of(bus, runtime);
        meeting.prepare()?;
        let lock = meeting
            .lock("master")?
            .map_err(|holder| OpenError::MasterPresent { interface: meeting.interface.clone(), holder })?;
        let peer = connect(&meeting)?;
        Ok(Self { meeting, peer, gone: false, _lock: lock })
    }
}

/// Connects to the servos.
fn connect(meeting: &Meeting) -> Result<OwnedFd, OpenError> {
    let peer = seqpacket(meeting)?;
    match rustix::net::connect(&peer, &meeting.address()?) {
        Ok(()) => Ok(peer),
        // The file is missing, or was left behind by servos that were killed.
        Err(Errno::NOENT | Errno::CONNREFUSED) => {
            Err(OpenError::NoServos { interface: meeting.interface.clone(), path: meeting.socket() })
        }
        Err(errno) => Err(meeting.failed("connect to", errno)),
    }
}

impl CanLink for LocalMaster {
    fn is_local(&self) -> bool {
        true
    }

    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        if self.gone {
            return Sent { count: 0, fault: Some(LinkFault::Gone) };
        }
        let sent = batch::send(self.peer.as_fd(), frames);
        self.gone = sent.fault == Some(LinkFault::Gone);
        sent
    }

    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        // What the servos sent before they went is still read: `gone` by a failed send does not stop it.
        match batch::receive(self.peer.as_fd(), SocketKind::Local, into) {
            Ok(received) if received.frames == 0 && self.gone => Some(LinkFault::Gone),
            Ok(_) => None,
            Err(fault) => {
                self.gone |= fault == LinkFault::Gone;
                Some(fault)
            }
        }
    }

    fn describe(&self) -> String {
        format!("local link {}", self.meeting.interface)
    }

    fn readiness(&self) -> Option<BorrowedFd<'_>> {
        (!self.gone).then(|| self.peer.as_fd())
    }

    fn reopen(&mut self) -> Result<(), OpenError> {
        if self.gone {
            self.peer = connect(&self.meeting)?;
            self.gone = false;
        }
        Ok(())
    }
}

/// The servos' end, which owns the meeting point.
#[derive(Debug)]
pub(super) struct LocalServos {
    meeting: Meeting,
    listener: OwnedFd,
    master: Option<OwnedFd>,
    /// Watches the master, or the listener while there is none: never both, or a second master that waits would keep
    /// it readable.
    events: OwnedFd,
    _lock: FileLock,
}

impl LocalServos {
    /// Locks the link and opens its meeting point.
    pub(super) fn open(bus: &Bus, runtime: &Path) -> Result<Self, OpenError> {
        let meeting = Meeting::of(bus, runtime);
        meeting.prepare()?;
        let lock = meeting
            .lock("servos")?
            .map_err(|holder| OpenError::ServosPresent { interface: meeting.interface.clone(), holder })?;
        let path = meeting.socket();
        // Under the lock no process listens there: what is left was left by servos that were killed.
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(OpenError::File { path, doing: "remove the stale", source });
            }
            Ok(()) | Err(_) => {}
        }
        let listener = seqpacket(&meeting)?;
        let failed = |doing| {
            let meeting = &meeting;
            move |errno| meeting.failed(doing, errno)
        };
        rustix::net::bind(&listener, &meeting.address()?).map_err(failed("bind"))?;
        std::fs::set_permissions(&path, Permissions::from_mode(0o600)).map_err(|source| OpenError::File {
            path,
            doing: "protect",
            source,
        })?;
        // One master at a time; a second place for the one that comes back before the first is seen gone.
        rustix::net::listen(&listener, 2).map_err(failed("listen on"))?;
        let events = epoll::create(epoll::CreateFlags::CLOEXEC).map_err(failed("watch"))?;
        watch(&events, &listener).map_err(failed("watch"))?;
        Ok(Self { meeting, listener, master: None, events, _lock: lock })
    }

    /// Takes a master that waits, if none is there.
    fn welcome(&mut self) {
        if self.master.is_some() {
            return;
        }
        // An error is a master that gave up again, or none waiting.
        let Ok(master) = rustix::net::accept_with(&self.listener, FLAGS) else { return };
        // Without a place in `events` (the kernel is out of memory) the master is turned away, not left unheard.
        if watch(&self.events, &master).is_ok() {
            let _is_watched = epoll::delete(&self.events, &self.listener);
            self.master = Some(master);
        }
    }

    /// Clears the master that has gone, and listens for the next.
    fn part(&mut self) {
        self.master = None; // Closing it takes it out of `events`.
        let _is_watched_already = watch(&self.events, &self.listener);
    }
}

/// Adds a socket to what is watched for reading.
fn watch(events: &OwnedFd, socket: &OwnedFd) -> rustix::io::Result<()> {
    epoll::add(events, socket, epoll::EventData::new_u64(0), epoll::EventFlags::IN)
}

impl CanLink for LocalServos {
    fn is_local(&self) -> bool {
        true
    }

    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        let all = Sent { count: frames.len(), fault: None };
        let Some(master) = &self.master else { return all };
        let sent = batch::send(master.as_fd(), frames);
        if sent.fault == Some(LinkFault::Gone) {
            self.part();
            return all;
        }
        sent
    }

    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        into.clear();
        self.welcome();
        let master = self.master.as_ref()?;
        match batch::receive(master.as_fd(), SocketKind::Local, into) {
            Ok(_) => None,
            Err(LinkFault::Gone) => {
                self.part();
                None
            }
            Err(fault) => Some(fault),
        }
    }

    fn describe(&self) -> String {
        format!("local link {}", self.meeting.interface)
    }

    fn readiness(&self) -> Option<BorrowedFd<'_>> {
        Some(self.events.as_fd())
    }
}

impl Drop for LocalServos {
    fn drop(&mut self) {
        // Still under the lock. A file left behind is harmless: the next servos remove it.
        let _left_behind = std::fs::remove_file(self.meeting.socket());
    }
}
