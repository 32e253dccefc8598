//! Opening a link: which one, whether it may be used, and who else uses it.
use super::local::{LocalMaster, LocalServos};
use super::socketcan::{SocketCan, rates_in_words};
use super::{CanLink, interface_info};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use taustream_arm::{Bus, BusKind};

/// Which link carries a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LinkChoice {
    /// SocketCAN where the kernel has it and the interface exists, else the local link if the bus is virtual.
    #[default]
    Auto,
    /// A CAN interface of the kernel.
    #[value(name = "socketcan")]
    SocketCan,
    /// A socket between the processes of this host, behind which there are simulated servos only.
    Local,
}

/// The word is none of `auto`, `socketcan`, `local`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown link {0:?}: expected auto, socketcan or local")]
pub struct UnknownLink(pub String);

impl FromStr for LinkChoice {
    type Err = UnknownLink;

    fn from_str(word: &str) -> Result<Self, UnknownLink> {
        match word {
            "auto" => Ok(Self::Auto),
            "socketcan" => Ok(Self::SocketCan),
            "local" => Ok(Self::Local),
            other => Err(UnknownLink(other.to_owned())),
        }
    }
}

impl fmt::Display for LinkChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::SocketCan => "socketcan",
            Self::Local => "local",
        })
    }
}

/// Which side of the bus a link serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkRole {
    /// Sends setpoints: one on each interface, by lock.
    Master,
    /// Simulated servos. They own the local link's meeting point.
    Servos,
}

/// Who holds a lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holder {
    /// Its process id, when it could be found out.
    pub pid: Option<u32>,
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(pid) = self.pid else { return f.write_str("another process") };
        // Only a hint for the reader, so a process that has just ended is no error.
        match std::fs::read_to_string(format!("/proc/{pid}/comm")) {
            Ok(name) => write!(f, "process {pid} ({})", name.trim().escape_default()),
            Err(_) => write!(f, "process {pid}"),
        }
    }
}

/// Why a link could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Not a name that the kernel takes.
    #[error("{interface:?} is no interface name: expected 1 to 15 characters without blank or '/'")]
    BadName {
        /// The name.
        interface: String,
    },
    /// No CAN sockets in this kernel, and the bus is real.
    #[error(
        "this kernel has no CAN sockets, which bus {bus} on {interface} needs; load them: modprobe can_raw; or, for simulated \
         servos alone, join streamer and taustream-servosim without CAN: start both with --link local"
    )]
    NoCan {
        /// The bus.
        bus: String,
        /// Its interface.
        interface: String,
    },
    /// The interface does not exist.
    #[error("interface {interface} does not exist; {remedy}")]
    Missing {
        /// The interface.
        interface: String,
        /// What to do.
        remedy: String,
    },
    /// The interface is down.
    #[error("interface {interface} is down; bring it up: {command}")]
    Down {
        /// The interface.
        interface: String,
        /// What to do.
        command: String,
    },
    /// The controller is out of order.
    #[error("the controller of {interface} is {state}; fix cable, termination or bit rate, then: {remedy}")]
    Unfit {
        /// The interface.
        interface: String,
        /// Its state.
        state: &'static str,
        /// What to do then.
        remedy: String,
    },
    /// Frames of before the fault have not left yet.
    #[error(
        "frames of before the fault still wait in the queue of {interface} ({bytes} bytes of memory), and would reach the          drives late; let the bus carry them, or drop them: ip link set {interface} down && ip link set {interface} up"
    )]
    Queued {
        /// The interface.
        interface: String,
        /// Memory that they hold.
        bytes: u32,
    },
    /// It has another hardware type.
    #[error(
        "interface {interface} is no CAN interface; name one in the settings (list them: ip link show type can)"
    )]
    NotCan {
        /// The interface.
        interface: String,
    },
    /// A virtual bus on an interface behind which there may be drives.
    #[error(
        "bus {bus} is declared virtual, but {interface} is of kind {kind:?}, not vcan; \
         state its bit rate in the settings, so that its load is checked"
    )]
    NotVirtual {
        /// The bus.
        bus: String,
        /// Its interface.
        interface: String,
        /// What the kernel calls it.
        kind: String,
    },
    /// The interface runs at another bit rate.
    #[error(
        "bus {bus} is declared with {declared_bit_s} bit/s, but {interface} runs at {actual_bit_s} bit/s; \
         set it: ip link set {interface} down && {command}"
    )]
    OtherBitRate {
        /// The bus.
        bus: String,
        /// Its interface.
        interface: String,
        /// As in the settings.
        declared_bit_s: u32,
        /// As the driver says.
        actual_bit_s: u32,
        /// What sets it.
        command: String,
    },
    /// A second master.
    #[error(
        "{interface} already has a master: {holder}; end it first, for two masters send contradictory setpoints"
    )]
    MasterPresent {
        /// The interface.
        interface: String,
        /// Who.
        holder: Holder,
    },
    /// Simulated servos are already there.
    #[error("the local link {interface} already has simulated servos: {holder}; end them first")]
    ServosPresent {
        /// The interface.
        interface: String,
        /// Who.
        holder: Holder,
    },
    /// No process owns the local link's meeting point.
    #[error(
        "nothing serves the local link {interface} ({path}); start the simulated servos first: taustream-servosim"
    )]
    NoServos {
        /// The interface.
        interface: String,
        /// The socket.
        path: PathBuf,
    },
    /// The directory of the local links cannot be trusted.
    #[error(
        "{path} must belong to this user alone (owner uid {uid}, mode {mode:04o}); remove it, or chmod 0700 it"
    )]
    OpenDirectory {
        /// The directory.
        path: PathBuf,
        /// Its owner.
        uid: u32,
        /// Its permissions.
        mode: u32,
    },
    /// A unix socket's path has at most 107 bytes.
    #[error(
        "the path {path} is longer than the 107 bytes of a socket's name; use a shorter runtime directory"
    )]
    PathTooLong {
        /// The socket.
        path: PathBuf,
    },
    /// A file operation below the runtime directory.
    #[error("cannot {doing} {path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// A verb.
        doing: &'static str,
        /// The operating system's word.
        source: std::io::Error,
    },
    /// An operation on the interface.
    #[error("cannot {doing} interface {interface}: {source}")]
    System {
        /// The interface.
        interface: String,
        /// A verb.
        doing: &'static str,
        /// The operating system's word.
        source: std::io::Error,
    },
}

/// Whether [`open`] takes the local link for a bus.
///
/// # Errors
/// As [`open`], when the host has no link for it.
pub fn is_local(bus: &Bus, choice: LinkChoice) -> Result<bool, OpenError> {
    wants_socketcan(bus, choice).map(|socketcan| !socketcan)
}

/// Opens the link of a bus. `runtime` is the directory under which local links meet; it is not touched otherwise.
///
/// # Errors
/// Whatever makes the link unusable, with what to do about it.
pub fn open(
    bus: &Bus,
    choice: LinkChoice,
    role: LinkRole,
    runtime: &Path,
) -> Result<Box<dyn CanLink>, OpenError> {
    check_name(&bus.interface)?;
    if wants_socketcan(bus, choice)? {
        return Ok(Box::new(SocketCan::open(bus, role)?));
    }
    if let Some(words) = rates_in_words(bus.kind) {
        // Only when asked for by name: `auto` must not take a real bus for a simulated one.
        tracing::warn!("the local link {} has no bit rate; the simulator models {words}", bus.interface);
    }
    match role {
        LinkRole::Master => Ok(Box::new(LocalMaster::open(bus, runtime)?)),
        LinkRole::Servos => Ok(Box::new(LocalServos::open(bus, runtime)?)),
    }
}

/// Decides between SocketCAN and the local link, and says so where it was not asked for by name.
fn wants_socketcan(bus: &Bus, choice: LinkChoice) -> Result<bool, OpenError> {
    let has_can = interface_info::kernel_has_can();
    let interface = &bus.interface;
    match choice {
        LinkChoice::Local => Ok(false),
        LinkChoice::Auto if has_can && interface_info::exists(interface) => Ok(true),
        LinkChoice::Auto if bus.kind == BusKind::Virtual => {
            let why = if has_can { "the interface does not exist" } else { "this kernel has no CAN" };
            tracing::warn!("bus {} uses the local link instead of {interface}: {why}", bus.name);
            Ok(false)
        }
        LinkChoice::Auto | LinkChoice::SocketCan if has_can => Ok(true),
        LinkChoice::Auto | LinkChoice::SocketCan => {
            Err(OpenError::NoCan { bus: bus.name.clone(), interface: interface.clone() })
        }
    }
}

/// An interface name goes into file names and messages, so it is checked as the kernel checks it.
fn check_name(interface: &str) -> Result<(), OpenError> {
    let strange = |byte: u8| byte == b'/' || byte == b':' || !byte.is_ascii_graphic();
    let length_fits = (1..libc::IFNAMSIZ).contains(&interface.len());
    if !length_fits || interface == "." || interface == ".." || interface.bytes().any(strange) {
        return Err(OpenError::BadName { interface: interface.to_owned() });
    }
    Ok(())
}
