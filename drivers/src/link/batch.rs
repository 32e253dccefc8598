//! The system calls of the hot path: one `sendmmsg`, one `recvmmsg`, and the look at an interface's flags.
//!
//! Works on any socket that keeps packet borders and carries frames at their kernel size (16 bytes classic, 72 bytes
//! FD): `CAN_RAW`, and `SOCK_SEQPACKET` of the local link. The frames stay where they are; the headers that point at them
//! live on the stack (5 KiB), so that nothing is allocated and no pointer outlives its call. This is the only file
//! of the links with unsafe code.
//!
//! Real time: every function here makes a bounded number of non-blocking system calls and does nothing else.
#![expect(
    unsafe_code,
    reason = "sendmmsg, recvmmsg and SIOCGIFFLAGS have no safe wrapper that does not allocate"
)]

use super::{LinkFault, Sent};
use crate::frame::{BATCH_MAX, CanFrame, FD_SIZE, FrameBatch};
use std::io::Error;
use std::os::fd::{AsRawFd, BorrowedFd};

/// Calls that one batch may take: the first, one after a stale error, and the rest of a partial batch twice (the
/// second tells why the first was partial).
const SEND_CALLS_MAX: usize = 4;

/// What the socket of a local link says when its peer has gone.
const PEER_HAS_GONE: [i32; 4] = [libc::EPIPE, libc::ECONNRESET, libc::ENOTCONN, libc::ECONNREFUSED];

/// Name of an interface as the kernel takes it: terminated by a zero byte.
pub(super) type InterfaceName = [libc::c_char; libc::IFNAMSIZ];

/// Hands the frames over, in order; says how many were taken and why not all.
///
/// Real time: usually one system call, at most [`SEND_CALLS_MAX`].
pub(super) fn send(socket: BorrowedFd<'_>, frames: &[CanFrame]) -> Sent {
    let mut count = 0;
    let mut repeated = false;
    for _ in 0..SEND_CALLS_MAX {
        let rest = frames.get(count..).unwrap_or(&[]);
        if rest.is_empty() {
            break;
        }
        match send_some(socket, rest) {
            // A socket that was not used while its interface was down keeps one ENETDOWN after the interface has
            // come back; a signal may interrupt even a call that does not wait. Both deserve one more try.
            Err(libc::ENETDOWN | libc::EINTR) if !repeated => repeated = true,
            Ok(taken) => count += taken,
            Err(errno) => return Sent { count, fault: Some(fault_of(errno)) },
        }
    }
    // The kernel swallows the reason of a partial batch when the next call takes frames again.
    let fault = (count < frames.len()).then_some(LinkFault::QueueFull);
    Sent { count, fault }
}

/// Whose socket it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SocketKind {
    /// `CAN_RAW`: the kernel counts what it had to drop.
    Can,
    /// `SOCK_SEQPACKET` of the local link.
    Local,
}

/// What one call took from a socket.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Received {
    /// Frames of others: those that are in the batch.
    pub(super) frames: usize,
    /// This socket's own frames, come back when they were on the wire. They never enter the batch.
    pub(super) confirmed: u64,
    /// The kernel's count of packets that found this socket's receive buffer full, where a packet carried it. It counts
    /// from the opening of the socket and wraps.
    pub(super) dropped: Option<u32>,
}

/// How a packet came.
#[derive(Clone, Copy, Debug, Default)]
struct Packet {
    size: usize,
    own: bool,
    dropped: Option<u32>,
}

/// Replaces the batch by what has arrived, oldest first. Packets that are no frames by their size are left out, and
/// so are this socket's own. The end of a stream socket is [`LinkFault::Gone`], reported at once if no frame came
/// before it, else by the next call.
///
/// Real time: one system call, never waits.
pub(super) fn receive(
    socket: BorrowedFd<'_>,
    kind: SocketKind,
    into: &mut FrameBatch,
) -> Result<Received, LinkFault> {
    into.clear();
    let mut packets = [Packet::default(); BATCH_MAX];
    let taken = match receive_some((socket, kind), into.slots(), &mut packets) {
        Ok(taken) => taken,
        Err(libc::EAGAIN | libc::EINTR) => return Ok(Received::default()),
        Err(errno) => return Err(fault_of(errno)),
    };
    let slots = into.slots();
    let (mut count, mut confirmed, mut newest_dropped) = (0, 0, None);
    for (from, Packet { size, own, dropped }) in packets.iter().take(taken).copied().enumerate() {
        newest_dropped = dropped.or(newest_dropped);
        if own {
            confirmed += 1;
            continue;
        }
        if size == 0 {
            if count == 0 {
                return Err(LinkFault::Gone);
            }
            break;
        }
        // Slots never overtake: `count <= from`, so the frame moves into a slot already read.
        slots.swap(count, from);
        if slots.get_mut(count).is_some_and(|slot| slot.settle(size)) {
            count += 1;
        }
    }
    into.set_count(count);
    into.set_more(taken == BATCH_MAX);
    Ok(Received { frames: count, confirmed, dropped: newest_dropped })
}

/// Bytes of kernel memory that frames of this socket still hold: those that wait in the interface's queue. What a
/// controller already has in its mailboxes is not counted.
pub(super) fn queued_bytes(socket: BorrowedFd<'_>) -> std::io::Result<u32> {
    // linux/sock_diag.h: the third word is the memory of what is being sent.
    const WORDS: usize = 9;
    const SENDING: usize = 2;
    let mut words = [0_u32; WORDS];
    let mut size = libc::socklen_t::try_from(size_of_val(&words)).unwrap_or(0);
    // SAFETY: `words` is exclusively borrowed and `size` is its size in bytes; the kernel writes no more than that, and
    // any bytes make valid integers.
    let result = unsafe {
        let into = words.as_mut_ptr().cast();
        libc::getsockopt(socket.as_raw_fd(), libc::SOL_SOCKET, libc::SO_MEMINFO, into, &raw mut size)
    };
    if result < 0 { Err(Error::last_os_error()) } else { Ok(words[SENDING]) }
}

/// Whether an interface is up, asked through any socket of its network namespace.
///
/// Real time: one system call, never waits.
pub(super) fn interface_is_up(socket: BorrowedFd<'_>, name: InterfaceName) -> Result<bool, LinkFault> {
    let mut request =
        libc::ifreq { ifr_name: name, ifr_ifru: libc::__c_anonymous_ifr_ifru { ifru_flags: 0 } };
    // SAFETY: SIOCGIFFLAGS reads the name of the `ifreq` it is given and writes its flags; `request` is a live,
    // exclusively borrowed `ifreq`, and its name is terminated (see `interface_name`).
    let result = unsafe { libc::ioctl(socket.as_raw_fd(), libc::SIOCGIFFLAGS, &raw mut request) };
    if result < 0 {
        return Err(fault_of(errno()));
    }
    // SAFETY: the call succeeded, so the kernel has written `ifru_flags`; it was initialised before, too.
    let flags = unsafe { request.ifr_ifru.ifru_flags };
    Ok(i32::from(flags) & libc::IFF_UP != 0)
}

/// A name as the kernel takes it; `None` when it is too long.
pub(super) fn interface_name(name: &str) -> Option<InterfaceName> {
    let mut raw: InterfaceName = [0; libc::IFNAMSIZ];
    // The last byte stays zero: it terminates the longest name.
    let (_, slots) = raw.split_last_mut()?;
    if name.len() > slots.len() {
        return None;
    }
    for (slot, byte) in slots.iter_mut().zip(name.bytes()) {
        *slot = libc::c_char::from_ne_bytes([byte]);
    }
    Some(raw)
}

/// One `sendmmsg` of at most [`BATCH_MAX`] frames: how many were taken (at least one), or the errno.
fn send_some(socket: BorrowedFd<'_>, frames: &[CanFrame]) -> Result<usize, i32> {
    let (mut parts, mut headers) = empty_headers();
    let mut requested: libc::c_uint = 0;
    for ((part, header), frame) in parts.iter_mut().zip(headers.iter_mut()).zip(frames) {
        // A send reads through this pointer only, although `iovec` is typed for both directions.
        part.iov_base = (&raw const *frame).cast_mut().cast();
        part.iov_len = frame.wire_size();
        header.msg_hdr.msg_iov = part;
        header.msg_hdr.msg_iovlen = 1;
        requested += 1;
    }
    // MSG_NOSIGNAL: a local peer that has gone must be an error value, not a SIGPIPE.
    let flags = libc::MSG_DONTWAIT | libc::MSG_NOSIGNAL;
    // SAFETY: the first `requested` headers each point at one live `iovec` of `parts`, which points at a frame of
    // `frames`; `wire_size` is at most the frame's 72 bytes, and a frame has no padding. All three live to the end
    // of this call, and the kernel writes `msg_len` of `headers` only.
    let taken = unsafe { libc::sendmmsg(socket.as_raw_fd(), headers.as_mut_ptr(), requested, flags) };
    usize::try_from(taken).map_err(|_| errno())
}

/// One `recvmmsg`: how many packets came (at least one) and how, or the errno.
fn receive_some(
    (socket, kind): (BorrowedFd<'_>, SocketKind),
    slots: &mut [CanFrame; BATCH_MAX],
    packets: &mut [Packet; BATCH_MAX],
) -> Result<usize, i32> {
    let (mut parts, mut headers) = empty_headers();
    let mut controls = [Control::default(); BATCH_MAX];
    let mut requested: libc::c_uint = 0;
    let buffers = slots.iter_mut().zip(&mut controls);
    for ((part, header), (slot, control)) in parts.iter_mut().zip(headers.iter_mut()).zip(buffers) {
        part.iov_base = (&raw mut *slot).cast();
        part.iov_len = FD_SIZE;
        header.msg_hdr.msg_iov = part;
        header.msg_hdr.msg_iovlen = 1;
        // Only a CAN socket writes control messages of ours; a unix peer could hand descriptors over in them.
        if kind == SocketKind::Can {
            header.msg_hdr.msg_control = (&raw mut *control).cast();
            header.msg_hdr.msg_controllen = size_of::<Control>();
        }
        requested += 1;
    }
    // MSG_TRUNC: the true size of a packet that is too long, so that it is not taken for an FD frame.
    let flags = libc::MSG_DONTWAIT | libc::MSG_TRUNC;
    // SAFETY: each of the `requested` headers points at one live `iovec` of `parts`, which points at a whole slot of 72
    // bytes, exclusively borrowed; any bytes make a valid `CanFrame` (integers without padding). On a CAN socket each points
    // at a live `Control` too, with its size. The kernel writes no more than `iov_len` and `msg_controllen` there, and the
    // lengths into `headers`. The null time-out means none.
    let taken = unsafe {
        libc::recvmmsg(socket.as_raw_fd(), headers.as_mut_ptr(), requested, flags, std::ptr::null_mut())
    };
    let taken = usize::try_from(taken).map_err(|_| errno())?;
    for ((packet, header), control) in packets.iter_mut().zip(&headers).zip(&controls).take(taken) {
        packet.dropped = control.dropped(header.msg_hdr.msg_controllen);
        packet.size = usize::try_from(header.msg_len).unwrap_or(usize::MAX);
        // can.rst: set on frames that this very socket has sent; MSG_DONTROUTE on those of any socket of this host.
        packet.own = header.msg_hdr.msg_flags & libc::MSG_CONFIRM != 0;
    }
    Ok(taken)
}

/// One control message of 4 bytes: the header and the value of `SO_RXQ_OVFL`, aligned as the kernel wants it.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct Control {
    length: usize,
    level: libc::c_int,
    kind: libc::c_int,
    value: [u32; 2],
}

impl Control {
    /// The count of dropped packets, when the kernel has written one into the first `written` bytes. It writes none while
    /// nothing was dropped.
    fn dropped(&self, written: usize) -> Option<u32> {
        const LEAST: usize = std::mem::offset_of!(Control, value) + size_of::<u32>();
        let is_count = self.level == libc::SOL_SOCKET && self.kind == libc::SO_RXQ_OVFL;
        (written >= LEAST && self.length >= LEAST && is_count).then_some(self.value[0])
    }
}

/// Headers that point at nothing.
fn empty_headers() -> ([libc::iovec; BATCH_MAX], [libc::mmsghdr; BATCH_MAX]) {
    // SAFETY: both are plain C structs of integers and raw pointers, for which all-zero bytes are valid values
    // (null pointers, zero lengths).
    unsafe { (std::mem::zeroed(), std::mem::zeroed()) }
}

/// The calling thread's last error; reads a thread-local, allocates nothing.
fn errno() -> i32 {
    Error::last_os_error().raw_os_error().unwrap_or(0)
}

/// What an errno of a link's socket means.
fn fault_of(errno: i32) -> LinkFault {
    match errno {
        libc::ENOBUFS | libc::EAGAIN => LinkFault::QueueFull,
        libc::ENETDOWN => LinkFault::Down,
        libc::ENXIO | libc::ENODEV => LinkFault::Gone, // The interface was deleted.
        peer if PEER_HAS_GONE.contains(&peer) => LinkFault::Gone,
        other => LinkFault::Os(other),
    }
}
