//! Ports in shared memory, opened, watched and opened again.
//!
//! Names in shared memory can vanish under a running streamer: the system deletes a user's segments at logout (`RemoveIPC=`),
//! cleaners delete what is old in /tmp, people delete runtime directories. Nobody who comes later finds the streamer then. The
//! thread of this module looks for the files that the ports stand on, says when one is gone, has all ports closed, clears what is
//! left of the arm, and has them opened again. Ports cannot move between threads, so each thread opens its own on request.
#![expect(clippy::disallowed_methods, reason = "this thread is not the real-time one and may sleep")]
use crate::stop_socket::bind_file;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use taustream_messages::files::{ArmFiles, Claim, Footprint};
use taustream_messages::operator::socket_file;
use taustream_messages::service::ServiceError;
use tracing::{error, info, warn};

/// How often the files are looked for.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// How long a thread may take to open its ports, shared memory of a dead process included.
const OPEN_WITHIN: Duration = Duration::from_secs(8);
/// How long to wait before ports that could not be opened are tried again.
const AGAIN_AFTER: Duration = Duration::from_millis(500);
/// Services that have been open for so long need not be cleared away by the next start.
const STARTED_AFTER: Duration = Duration::from_secs(5);

/// What a thread is to do with its ports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Directive {
    /// Close them: their names are gone.
    Close,
    /// Open them.
    Open,
}

/// What a thread has opened.
#[derive(Debug)]
pub struct Opened {
    /// The files that it stands on.
    pub footprint: Footprint,
}

/// Ports cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// Shared memory refuses.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// A thread does not come back.
    #[error("shared memory of arm `{arm}` could not be opened within {} s; look for files of another user: ls -l /dev/shm/taustream.*.{arm}.*", OPEN_WITHIN.as_secs())]
    Hangs {
        /// The arm's name.
        arm: String,
    },
}

/// The end of a thread that owns ports.
#[derive(Debug)]
pub struct PortThread {
    arm: String,
    runtime: PathBuf,
    directives: Receiver<Directive>,
    results: Sender<Result<Opened, ServiceError>>,
}

impl PortThread {
    /// What to do, if anything. Never waits.
    #[must_use]
    pub fn directive(&self) -> Option<Directive> {
        self.directives.try_recv().ok()
    }

    /// The arm.
    #[must_use]
    pub fn arm(&self) -> &str {
        &self.arm
    }

    /// The runtime directory.
    #[must_use]
    pub fn runtime(&self) -> &Path {
        &self.runtime
    }

    /// Says that the ports are closed. They are kept aside for good: closing them in earnest would delete files of the same names
    /// that somebody else has made meanwhile.
    pub fn closed<P>(&self, ports: Option<P>) {
        if let Some(ports) = ports {
            Box::leak(Box::new(ports));
        }
        let _nobody_asks_any_more = self.results.send(Ok(Opened { footprint: Footprint::default() }));
    }

    /// Says what became of opening them, and returns them.
    pub fn opened<P>(&self, result: Result<P, ServiceError>, opened: impl FnOnce(&P) -> Opened) -> Option<P> {
        let said = result.as_ref().map(opened).map_err(Clone::clone);
        let _nobody_asks_any_more = self.results.send(said);
        result.ok()
    }
}

/// The threads that own ports, as their overseer sees them.
#[derive(Debug)]
struct Member {
    directives: SyncSender<Directive>,
    results: Receiver<Result<Opened, ServiceError>>,
}

/// Opens, watches and reopens the ports of all threads.
#[derive(Debug)]
pub struct PortWatch {
    files: ArmFiles,
    arm: String,
    claim: Option<Claim>,
    members: Vec<Member>,
    footprints: Vec<Footprint>,
}

impl PortWatch {
    /// A watch over ports of an arm, and the ends of `count` threads.
    #[must_use]
    pub fn new(arm: &str, runtime: &Path, count: usize) -> (Self, Vec<PortThread>) {
        let (members, ends) = (0..count)
            .map(|_| {
                let (directives, directed) = sync_channel(2);
                let (results, resulted) = channel();
                let end = PortThread {
                    arm: arm.to_owned(),
                    runtime: runtime.to_owned(),
                    directives: directed,
                    results,
                };
                (Member { directives, results: resulted }, end)
            })
            .unzip();
        let files = ArmFiles::of(arm, runtime);
        let watch = Self { files, arm: arm.to_owned(), claim: None, members, footprints: Vec::new() };
        (watch, ends)
    }

    /// Opens the ports of all threads for the first time. What a streamer that died has left behind is cleared away: at once
    /// when nobody else uses the arm's names, and otherwise when it stands in the way.
    ///
    /// # Errors
    /// When shared memory refuses, for instance because a streamer serves this arm already.
    pub fn open_first(&mut self) -> Result<(), PortError> {
        self.claim = Some(self.files.claim("streamer")?);
        let Err(first) = self.open() else { return Ok(()) };
        if let PortError::Service(
            ServiceError::Foreign { .. } | ServiceError::Blocked { .. } | ServiceError::Name { .. },
        ) = first
        {
            return Err(first);
        }
        warn!("{first}; clearing what is left of arm `{}` and opening its services anew", self.arm);
        self.reopen()
    }

    fn all(&mut self, directive: Directive) -> Result<Vec<Footprint>, PortError> {
        let since = Instant::now();
        for member in &self.members {
            // Two directives fit, and each is answered before the next is given.
            let _thread_has_ended = member.directives.try_send(directive);
        }
        let mut footprints = Vec::new();
        let mut failed = None;
        for member in &self.members {
            match member.results.recv_timeout(OPEN_WITHIN.saturating_sub(since.elapsed())) {
                Ok(Ok(opened)) => footprints.push(opened.footprint),
                Ok(Err(e)) => failed = Some(PortError::Service(e)),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    failed = Some(PortError::Hangs { arm: self.arm.clone() });
                }
            }
        }
        failed.map_or(Ok(footprints), Err)
    }

    fn open(&mut self) -> Result<(), PortError> {
        let _nobody_clears = self.files.opening()?;
        self.footprints = self.all(Directive::Open)?;
        Ok(())
    }

    fn reopen(&mut self) -> Result<(), PortError> {
        self.footprints.clear();
        self.all(Directive::Close)?;
        // The directory itself may be gone; what is wrong with it is said by whoever opens files there.
        let _said_by_open = taustream_arm::runtime::directory();
        self.files.clear();
        // The old claim first: its locks are of this process, and may be of files that are gone.
        self.claim = None;
        self.claim = Some(self.files.claim("streamer")?);
        self.open()
    }

    /// Watches on a thread of its own until `stop`.
    ///
    /// # Errors
    /// When no thread is to be had.
    pub fn start(
        mut self,
        sockets: Sender<UnixListener>,
        stop: Arc<AtomicBool>,
    ) -> std::io::Result<JoinHandle<()>> {
        let work = move || {
            let since = Instant::now();
            while !stop.load(Ordering::Acquire) {
                thread::sleep(LOOK_EVERY);
                self.look();
                self.look_for_socket(&sockets);
                if since.elapsed() > STARTED_AFTER
                    && let Some(claim) = &self.claim
                {
                    claim.started();
                }
            }
            if let Some(claim) = &self.claim {
                claim.started();
            }
            let _gone = std::fs::remove_file(socket_file(&self.arm, self.files.runtime()));
        };
        thread::Builder::new().name("ports".into()).stack_size(512 << 10).spawn(work)
    }

    /// The socket in the runtime directory can vanish as well.
    fn look_for_socket(&self, sockets: &Sender<UnixListener>) {
        let runtime = self.files.runtime();
        if socket_file(&self.arm, runtime).symlink_metadata().is_ok() {
            return;
        }
        // A directory that was deleted is made again: whoever looks for the streamer looks there.
        if let Ok(listener) = taustream_arm::runtime::directory()
            .map_err(std::io::Error::other)
            .and_then(|_| bind_file(&self.arm, runtime))
        {
            let _thread_has_ended = sockets.send(listener);
        }
    }

    fn look(&mut self) {
        let is_open = !self.footprints.is_empty();
        let missing = self.footprints.iter().find_map(Footprint::missing).map(Path::to_owned);
        if is_open && missing.is_none() {
            return;
        }
        if let Some(missing) = missing {
            error!(
                "{} of this running streamer has vanished or was replaced: another process deletes files (RemoveIPC=yes at logout, a cleaner \
                 of /tmp, rm -rf); `stop`, `stop --fast` and `torque-off` work all the same; opening the services anew",
                missing.display()
            );
        }
        match self.reopen() {
            Ok(()) => info!("the services of arm `{}` are open again", self.arm),
            Err(e) => {
                error!("{e}; trying again");
                thread::sleep(AGAIN_AFTER);
            }
        }
    }
}
