//! What the kernel says of an interface, asked by netlink before a link is opened.
//!
//! The kind matters: a bus declared virtual has no bit rate, so its load was not checked; behind an adapter that
//! looks virtual (slcan has no parent device either) there would be real drives. Only the kernel's own word counts.
use super::open::OpenError;
use neli::consts::nl::NlmF;
use neli::consts::rtnl::{Arphrd, Iff, Ifla, IflaInfo, RtAddrFamily, Rtm};
use neli::consts::socket::NlFamily;
use neli::nl::{NlPayload, Nlmsghdr, NlmsghdrBuilder};
use neli::rtnl::{Ifinfomsg, IfinfomsgBuilder};
use neli::socket::synchronous::NlSocketHandle;
use neli::utils::Groups;
use rustix::io::Errno;
use rustix::net::{AddressFamily, Protocol, SocketFlags, SocketType};
use socketcan::CanInterface;
pub(super) use socketcan::nl::CanState;
use std::ffi::CStr;
use std::io::Error;
use std::num::NonZeroU32;

/// An interface as the kernel describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct InterfaceInfo {
    /// True when the hardware type is CAN.
    pub(super) is_can: bool,
    /// True when it is administratively up.
    pub(super) is_up: bool,
    /// True when it hands back what was on the wire; without, the kernel hands back what the interface is given.
    pub(super) echoes: bool,
    /// The driver's kind ("vcan", "vxcan", "can"), if it states one.
    pub(super) kind: Option<String>,
    /// Nominal bit rate, if the driver states one.
    pub(super) bitrate_bit_s: Option<u32>,
    /// State of the controller, if the driver states one.
    pub(super) state: Option<CanState>,
}

/// True when this kernel has raw CAN sockets.
pub(super) fn kernel_has_can() -> bool {
    let protocol = u32::try_from(libc::CAN_RAW).ok().and_then(NonZeroU32::new).map(Protocol::from_raw);
    rustix::net::socket_with(AddressFamily::CAN, SocketType::RAW, SocketFlags::CLOEXEC, protocol).is_ok()
}

/// True when this network namespace has an interface of that name, of whatever kind.
pub(super) fn exists(interface: &str) -> bool {
    index_of(interface).is_ok()
}

/// Asks the kernel.
pub(super) fn of(interface: &str) -> Result<InterfaceInfo, OpenError> {
    let unknown = |source| OpenError::System { interface: interface.to_owned(), doing: "ask for", source };
    let index = index_of(interface).map_err(unknown)?;
    let answer = query(index).map_err(unknown)?;
    let info = match answer.nl_payload() {
        NlPayload::Payload(info) => info,
        NlPayload::Err(refusal) => return Err(unknown(Error::from_raw_os_error(-refusal.error()))),
        NlPayload::Ack(_) | NlPayload::DumpExtAck(_) | NlPayload::Empty => {
            return Err(unknown(Error::other("netlink gave no answer")));
        }
    };
    let is_can = *info.ifi_type() == Arphrd::from(libc::ARPHRD_CAN);
    let controller = is_can.then(|| CanInterface::open_iface(index));
    // Drivers without a controller (vcan) state neither.
    let bitrate_bit_s = controller.as_ref().and_then(|c| c.bit_rate().ok().flatten());
    let state = controller.as_ref().and_then(|c| c.state().ok().flatten());
    let flags = info.ifi_flags();
    let (is_up, echoes) = (flags.contains(Iff::UP), flags.contains(Iff::ECHO));
    Ok(InterfaceInfo { is_can, is_up, echoes, kind: kind_of(info), bitrate_bit_s, state })
}

/// The index of an interface.
fn index_of(interface: &str) -> Result<u32, Error> {
    // Any socket serves to ask for an index; the unix family is there in every sandbox.
    let socket = rustix::net::socket(AddressFamily::UNIX, SocketType::DGRAM, None)?;
    match rustix::net::netdevice::name_to_index(&socket, interface) {
        Ok(index) => Ok(index),
        Err(Errno::NODEV) => Err(Error::from_raw_os_error(libc::ENODEV)),
        Err(errno) => Err(errno.into()),
    }
}

/// One round trip to the kernel.
fn query(index: u32) -> Result<Nlmsghdr<Rtm, Ifinfomsg>, Error> {
    let index = i32::try_from(index).map_err(Error::other)?;
    let request = IfinfomsgBuilder::default()
        .ifi_family(RtAddrFamily::Unspecified)
        .ifi_type(Arphrd::None)
        .ifi_index(index)
        .build()
        .map_err(Error::other)?;
    let request = NlmsghdrBuilder::default()
        .nl_type(Rtm::Getlink)
        .nl_flags(NlmF::REQUEST)
        .nl_payload(NlPayload::Payload(request))
        .build()
        .map_err(Error::other)?;
    let socket = NlSocketHandle::connect(NlFamily::Route, None, Groups::empty()).map_err(Error::other)?;
    socket.send(&request).map_err(Error::other)?;
    let (mut answers, _groups) = socket.recv::<Rtm, Ifinfomsg>().map_err(Error::other)?;
    let none = || Error::other("netlink gave no answer");
    answers.next().ok_or_else(none)?.map_err(Error::other)
}

/// The kind within the link information.
fn kind_of(info: &Ifinfomsg) -> Option<String> {
    let link = info.rtattrs().iter().find(|attribute| *attribute.rta_type() == Ifla::Linkinfo)?;
    let parts = link.get_attr_handle::<IflaInfo>().ok()?;
    let kind = parts.get_attrs().iter().find(|part| *part.rta_type() == IflaInfo::Kind)?;
    let bytes: &[u8] = kind.rta_payload().as_ref();
    // The kernel ends the word with a zero byte; text without one is taken whole.
    let text = CStr::from_bytes_until_nul(bytes).map_or(bytes, CStr::to_bytes);
    Some(String::from_utf8_lossy(text).into_owned())
}
