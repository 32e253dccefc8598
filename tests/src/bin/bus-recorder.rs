//! Records the frames of every CAN interface, in the format of `candump -L`, and fails when one of them is missing.
//!
//! One raw socket, bound to no interface, continues when an interface is deleted and made again. Frames wait in a receive
//! buffer that holds seconds of traffic and are taken in batches, so the recorder costs the machine few system calls. After SIGTERM
//! it empties the socket, and asks the kernel whether a frame was ever dropped.
#![expect(unsafe_code, reason = "raw CAN sockets, recvmmsg and time stamps have no safe wrapper")]
use anyhow::{Context, Result, bail, ensure};
use signal_hook::consts::{SIGINT, SIGTERM};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Error, ErrorKind, Write};
use std::mem::{MaybeUninit, size_of, size_of_val};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::Duration;

/// Frames of one system call.
const BATCH: usize = 64;
/// Pause between two looks at the socket.
const LOOK: Duration = Duration::from_millis(5);
/// Looks without a frame after which the socket counts as empty, once the end was requested.
const EMPTY_LOOKS: u32 = 20;
/// Looks after which a bus that does not fall silent is an error.
const ENDING_LOOKS_MAX: u32 = 2_000;
/// Receive buffer: some 80 000 frames with the kernel's own bookkeeping.
const BUFFER_BYTES: libc::c_int = 64 << 20;
/// Place of the number of dropped frames among the words of `SO_MEMINFO` (`linux/sock_diag.h`).
const MEMINFO_DROPS: usize = 8;

fn main() -> Result<()> {
    let file = std::env::args_os().nth(1).context("usage: bus-recorder FILE")?;
    let mut out = BufWriter::new(File::create(&file).with_context(|| file.display().to_string())?);
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let socket = open().context("no CAN socket")?;
    let mut batch = Batch::new();
    let mut names = Names::default();
    println!("bus-recorder ready");
    let (mut empty_looks, mut ending_looks) = (0, 0);
    while empty_looks < EMPTY_LOOKS {
        let ends = stop.load(Ordering::Relaxed);
        let mut line = String::new();
        let mut taken = 0;
        loop {
            let count = batch.receive(&socket).context("cannot receive")?;
            for record in batch.records(count) {
                line.clear();
                record?.write_to(&mut line, &mut names)?;
                out.write_all(line.as_bytes())?;
            }
            taken += count;
            if count < BATCH {
                break;
            }
        }
        out.flush()?;
        empty_looks = if ends && taken == 0 { empty_looks + 1 } else { 0 };
        ending_looks += u32::from(ends);
        ensure!(ending_looks < ENDING_LOOKS_MAX, "recording incomplete: frames keep coming after the end");
        sleep(LOOK);
    }
    let dropped = dropped(&socket)?;
    ensure!(
        dropped == 0,
        "recording incomplete: the kernel dropped {dropped} frames, for this was read too slowly"
    );
    Ok(())
}

/// One frame with its time and place.
struct Record<'a> {
    time: libc::timespec,
    interface: u32,
    frame: &'a libc::canfd_frame,
    is_fd: bool,
}

impl Record<'_> {
    /// A line of `candump -L`.
    fn write_to(&self, line: &mut String, names: &mut Names) -> Result<()> {
        let name = names.of(self.interface)?;
        let (id, data) = (self.frame.can_id, self.frame.data.iter().take(self.frame.len.into()));
        write!(line, "({}.{:06}) {name} ", self.time.tv_sec, self.time.tv_nsec / 1000)?;
        if id & libc::CAN_EFF_FLAG != 0 {
            write!(line, "{:08X}#", id & libc::CAN_EFF_MASK)?;
        } else {
            write!(line, "{:03X}#", id & libc::CAN_SFF_MASK)?;
        }
        if self.is_fd {
            write!(line, "#{:X}", self.frame.flags & 0xF)?;
        }
        if !self.is_fd && id & libc::CAN_RTR_FLAG != 0 {
            line.push('R');
        } else {
            for byte in data {
                write!(line, "{byte:02X}")?;
            }
        }
        line.push('\n');
        Ok(())
    }
}

/// Names of interfaces; one that was deleted keeps its own.
#[derive(Default)]
struct Names(BTreeMap<u32, String>);

impl Names {
    fn of(&mut self, index: u32) -> Result<&str> {
        match self.0.entry(index) {
            Entry::Occupied(name) => Ok(name.into_mut()),
            Entry::Vacant(slot) => {
                let name = interface_name(index);
                Ok(slot.insert(name.with_context(|| format!("interface {index} went with its name"))?))
            }
        }
    }
}

fn interface_name(index: u32) -> Result<String> {
    let mut name = [0_u8; libc::IF_NAMESIZE];
    // SAFETY: `name` is exclusively borrowed and has the size that if_indextoname asks for.
    let found = unsafe { libc::if_indextoname(index, name.as_mut_ptr().cast()) };
    ensure!(!found.is_null(), "{}", Error::last_os_error());
    let end = name.iter().position(|byte| *byte == 0).context("a name without end")?;
    Ok(std::str::from_utf8(&name[..end])?.to_owned())
}

/// What one system call fills.
struct Batch {
    frames: [libc::canfd_frame; BATCH],
    sources: [libc::sockaddr_can; BATCH],
    control: [[u64; 8]; BATCH],
    vectors: [libc::iovec; BATCH],
    headers: [libc::mmsghdr; BATCH],
}

impl Batch {
    /// Boxed: its parts point at each other.
    fn new() -> Box<Self> {
        // SAFETY: every part is plain data for which zero bytes are a value.
        Box::new(unsafe { MaybeUninit::zeroed().assume_init() })
    }

    /// Takes what waits, at most a batch, and says how many.
    fn receive(&mut self, socket: &OwnedFd) -> Result<usize> {
        for at in 0..BATCH {
            self.vectors[at] = libc::iovec {
                iov_base: (&raw mut self.frames[at]).cast(),
                iov_len: size_of::<libc::canfd_frame>(),
            };
            let header = &mut self.headers[at].msg_hdr;
            header.msg_name = (&raw mut self.sources[at]).cast();
            header.msg_namelen = u32::try_from(size_of::<libc::sockaddr_can>())?;
            header.msg_iov = &raw mut self.vectors[at];
            header.msg_iovlen = 1;
            header.msg_control = (&raw mut self.control[at]).cast();
            header.msg_controllen = size_of_val(&self.control[at]);
        }
        // SAFETY: the headers point into `self`, which is exclusively borrowed and does not move while the call lasts; each
        // length is that of the part it stands for.
        let count = unsafe {
            libc::recvmmsg(
                socket.as_raw_fd(),
                self.headers.as_mut_ptr(),
                u32::try_from(BATCH)?,
                libc::MSG_DONTWAIT,
                std::ptr::null_mut(),
            )
        };
        if let Ok(count) = usize::try_from(count) {
            return Ok(count);
        }
        let error = Error::last_os_error();
        let empty = matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted);
        if empty { Ok(0) } else { Err(error.into()) }
    }

    fn records(&self, count: usize) -> impl Iterator<Item = Result<Record<'_>>> {
        (0..count.min(BATCH)).map(|at| {
            let is_fd = match usize::try_from(self.headers[at].msg_len)? {
                libc::CAN_MTU => false,
                libc::CANFD_MTU => true,
                size => bail!("a frame of {size} bytes"),
            };
            Ok(Record {
                time: self.time(at).context("a frame without its time")?,
                interface: u32::try_from(self.sources[at].can_ifindex)?,
                frame: &self.frames[at],
                is_fd,
            })
        })
    }

    /// The kernel's time stamp.
    fn time(&self, at: usize) -> Option<libc::timespec> {
        // SAFETY: the header was filled by recvmmsg and points at `self.control`, whose bytes are initialised; the
        // macros stay inside the length that the kernel has written.
        unsafe {
            let header = libc::CMSG_FIRSTHDR(&raw const self.headers[at].msg_hdr);
            let is_time = !header.is_null()
                && (*header).cmsg_level == libc::SOL_SOCKET
                && (*header).cmsg_type == libc::SCM_TIMESTAMPNS;
            is_time.then(|| libc::CMSG_DATA(header).cast::<libc::timespec>().read_unaligned())
        }
    }
}

/// A socket for the frames of all interfaces, own or others', with their times.
fn open() -> Result<OwnedFd> {
    // SAFETY: no pointer is passed.
    let raw = unsafe { libc::socket(libc::PF_CAN, libc::SOCK_RAW | libc::SOCK_CLOEXEC, libc::CAN_RAW) };
    ensure!(raw >= 0, "{}", Error::last_os_error());
    // SAFETY: the kernel has just given this descriptor to nobody else.
    let socket = unsafe { OwnedFd::from_raw_fd(raw) };
    set(&socket, (libc::SOL_CAN_RAW, libc::CAN_RAW_FD_FRAMES), 1)?;
    set(&socket, (libc::SOL_SOCKET, libc::SO_TIMESTAMPNS), 1)?;
    set(&socket, (libc::SOL_SOCKET, libc::SO_RCVBUFFORCE), BUFFER_BYTES)?;
    // SAFETY: zero bytes are a value of this plain structure: no interface, so all of them.
    let mut address: libc::sockaddr_can = unsafe { MaybeUninit::zeroed().assume_init() };
    address.can_family = u16::try_from(libc::AF_CAN)?;
    let size = u32::try_from(size_of_val(&address))?;
    // SAFETY: `address` lives and `size` is its size.
    let bound = unsafe { libc::bind(socket.as_raw_fd(), (&raw const address).cast(), size) };
    ensure!(bound == 0, "{}", Error::last_os_error());
    Ok(socket)
}

fn set(socket: &OwnedFd, (level, name): (libc::c_int, libc::c_int), value: libc::c_int) -> Result<()> {
    let size = u32::try_from(size_of_val(&value))?;
    // SAFETY: `value` lives and `size` is its size.
    let set = unsafe { libc::setsockopt(socket.as_raw_fd(), level, name, (&raw const value).cast(), size) };
    ensure!(set == 0, "socket option {name}: {}", Error::last_os_error());
    Ok(())
}

/// Frames that found the receive buffer full.
fn dropped(socket: &OwnedFd) -> Result<u32> {
    let mut words = [0_u32; MEMINFO_DROPS + 1];
    let mut size = u32::try_from(size_of_val(&words))?;
    // SAFETY: `words` is exclusively borrowed and `size` is its size in bytes.
    let got = unsafe {
        let into = words.as_mut_ptr().cast();
        libc::getsockopt(socket.as_raw_fd(), libc::SOL_SOCKET, libc::SO_MEMINFO, into, &raw mut size)
    };
    ensure!(
        got == 0 && usize::try_from(size)? == size_of_val(&words),
        "SO_MEMINFO: {}",
        Error::last_os_error()
    );
    Ok(words[MEMINFO_DROPS])
}
