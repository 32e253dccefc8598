//! One master an interface.
//!
//! Two masters on one bus would send contradictory setpoints to the same drives. SocketCAN interfaces are locked by an
//! abstract unix socket name: it is scoped to the network namespace, as the interface is, and vanishes with its
//! process. Ends of a local link are locked by a file beside its socket, scoped to the runtime directory.
use super::open::{Holder, OpenError};
use rustix::net::sockopt::socket_peercred;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::net::{SocketAddr, UnixListener, UnixStream};
use std::path::Path;

/// The right to be master of a SocketCAN interface, held until dropped.
#[derive(Debug)]
pub(super) struct InterfaceLock {
    // The bound name is the lock; no connection is ever accepted.
    _name: UnixListener,
}

impl InterfaceLock {
    /// Takes the lock of an interface of this network namespace.
    pub(super) fn take(interface: &str) -> Result<Self, OpenError> {
        let name = format!("taustream/can-master/{interface}");
        let failed = |source| OpenError::System { interface: interface.to_owned(), doing: "lock", source };
        let address = SocketAddr::from_abstract_name(name).map_err(failed)?;
        match UnixListener::bind_addr(&address) {
            Ok(name) => Ok(Self { _name: name }),
            Err(error) if error.kind() == ErrorKind::AddrInUse => {
                let holder = Holder { pid: holder_of(&address) };
                Err(OpenError::MasterPresent { interface: interface.to_owned(), holder })
            }
            Err(error) => Err(failed(error)),
        }
    }
}

/// The process behind an abstract name; `None` when it has just ended, or lives in another process namespace.
fn holder_of(address: &SocketAddr) -> Option<u32> {
    let stream = UnixStream::connect_addr(address).ok()?;
    let credentials = socket_peercred(&stream).ok()?;
    u32::try_from(credentials.pid.as_raw_nonzero().get()).ok()
}

/// The right to be one end of a local link, held until dropped.
#[derive(Debug)]
pub(super) struct FileLock {
    // The lock of the open file; the file itself stays, for removing it would let two processes lock two files.
    _file: File,
}

impl FileLock {
    /// Takes the lock. `Ok(Err(holder))`: another process has it.
    pub(super) fn take(path: &Path) -> std::io::Result<Result<Self, Holder>> {
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut text = String::new();
                // What another process wrote is a hint for a message, so a bounded piece of it is enough.
                let read = file.take(16).read_to_string(&mut text);
                return Ok(Err(Holder { pid: read.ok().and_then(|_| text.trim().parse().ok()) }));
            }
            Err(TryLockError::Error(error)) => return Err(error),
        }
        file.set_len(0)?;
        file.rewind()?;
        writeln!(file, "{}", std::process::id())?;
        Ok(Ok(Self { _file: file }))
    }
}
