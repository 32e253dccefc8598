//! The kernel's CAN: a raw socket on an interface.
use super::batch::{self, InterfaceName, Received, SocketKind};
use super::error_frame::ERROR_CLASSES;
use super::interface_info::CanState;
use super::lock::InterfaceLock;
use super::open::{LinkRole, OpenError};
use super::{CanLink, LinkFault, Sent, interface_info};
use crate::frame::{CanFrame, FrameBatch};
use rustix::net::sockopt::{set_socket_recv_buffer_size, set_socket_recv_buffer_size_force};
use socketcan::{CanFdSocket, Socket, SocketOptions};
use std::os::fd::{AsFd, BorrowedFd};
use taustream_arm::{Bus, BusKind};

/// Receive buffer. The default holds 278 frames, less than what six drives send in 50 ms; this holds some 2700.
const RECEIVE_BUFFER_BYTES: usize = 2 << 20;

/// A raw socket on a CAN interface.
#[derive(Debug)]
pub(super) struct SocketCan {
    bus: Bus,
    socket: CanFdSocket,
    name: InterfaceName,
    /// The interface was deleted: this socket is dead, whatever comes back under the name.
    gone: bool,
    /// The interface was seen down, and not yet up again.
    down: bool,
    role: LinkRole,
    /// Own frames that came back.
    confirmed: u64,
    /// The interface itself hands them back, when they were on the wire.
    echoes: bool,
    /// Packets that found the receive buffer full.
    overflowed: u64,
    /// The kernel's own count of them, which wraps.
    overflow_count: u32,
    _lock: Option<InterfaceLock>,
}

impl SocketCan {
    /// Opens, checks and (for a master) locks the interface of a bus.
    pub(super) fn open(bus: &Bus, role: LinkRole) -> Result<Self, OpenError> {
        let interface = &bus.interface;
        let name = batch::interface_name(interface)
            .ok_or_else(|| OpenError::BadName { interface: interface.clone() })?;
        check(bus)?;
        say_what_is_modelled(bus, role);
        // Locked before a socket is there: a refused master must not even take frames.
        let lock = match role {
            LinkRole::Master => Some(InterfaceLock::take(interface)?),
            LinkRole::Servos => None,
        };
        let (socket, echoes) = open_socket(interface, role)?;
        Ok(Self {
            bus: bus.clone(),
            socket,
            name,
            gone: false,
            down: false,
            role,
            confirmed: 0,
            echoes,
            overflowed: 0,
            overflow_count: 0,
            _lock: lock,
        })
    }

    fn take(&mut self, into: &mut FrameBatch) -> Result<(), LinkFault> {
        let Received { frames: _, confirmed, dropped } =
            batch::receive(self.socket.as_fd(), SocketKind::Can, into)?;
        self.confirmed += confirmed;
        if let Some(count) = dropped {
            self.overflowed += u64::from(count.wrapping_sub(self.overflow_count));
            self.overflow_count = count;
        }
        Ok(())
    }

    /// Asks whether an interface that was down still is.
    fn look_up(&mut self) -> Option<LinkFault> {
        match batch::interface_is_up(self.socket.as_fd(), self.name) {
            Ok(true) => {
                self.down = false;
                None
            }
            Ok(false) => Some(LinkFault::Down),
            Err(fault) => self.note(fault),
        }
    }

    /// Keeps what outlasts a call: the kernel tells of a deleted or downed interface only once.
    fn note(&mut self, fault: LinkFault) -> Option<LinkFault> {
        match fault {
            LinkFault::Gone => self.gone = true,
            LinkFault::Down => self.down = true,
            LinkFault::QueueFull | LinkFault::Os(_) => {}
        }
        Some(fault)
    }
}

impl CanLink for SocketCan {
    fn send(&mut self, frames: &[CanFrame]) -> Sent {
        if self.gone {
            return Sent { count: 0, fault: Some(LinkFault::Gone) };
        }
        let sent = batch::send(self.socket.as_fd(), frames);
        if let Some(fault) = sent.fault {
            self.note(fault);
        }
        sent
    }

    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault> {
        if self.gone {
            into.clear();
            return Some(LinkFault::Gone);
        }
        let mut result = self.take(into);
        if result == Err(LinkFault::Down) {
            // The word may be stale, and it hides the frames behind it: read again, then ask for the truth.
            self.down = true;
            result = self.take(into);
        }
        match result {
            Ok(()) if self.down => self.look_up(),
            Ok(()) => None,
            Err(fault) => self.note(fault),
        }
    }

    fn describe(&self) -> String {
        format!("socketcan {}", self.bus.interface)
    }

    fn readiness(&self) -> Option<BorrowedFd<'_>> {
        (!self.gone).then(|| self.socket.as_fd())
    }

    fn confirmed(&self) -> Option<u64> {
        (self.role == LinkRole::Master).then_some(self.confirmed)
    }

    fn confirms_from_wire(&self) -> bool {
        self.echoes
    }

    fn overflowed(&self) -> u64 {
        self.overflowed
    }

    fn has_queued(&self) -> bool {
        // A kernel that does not say is taken for one that holds nothing.
        !self.gone && batch::queued_bytes(self.socket.as_fd()).is_ok_and(|bytes| bytes > 0)
    }

    fn reopen(&mut self) -> Result<(), OpenError> {
        let interface = &self.bus.interface;
        check(&self.bus)?;
        check_controller(interface, interface_info::of(interface)?.state)?;
        if !self.gone {
            let failed =
                |source| OpenError::System { interface: interface.clone(), doing: "look at", source };
            let bytes = batch::queued_bytes(self.socket.as_fd()).map_err(failed)?;
            if bytes > 0 {
                return Err(OpenError::Queued { interface: interface.clone(), bytes });
            }
        }
        // A new socket: the old one may be dead, and holds what was received before the fault.
        (self.socket, self.echoes) = open_socket(interface, self.role)?;
        (self.gone, self.down, self.confirmed) = (false, false, 0);
        (self.overflowed, self.overflow_count) = (0, 0);
        Ok(())
    }
}

/// Refuses a controller that cannot carry setpoints. Drivers that tell no state are taken at their word.
fn check_controller(interface: &str, state: Option<CanState>) -> Result<(), OpenError> {
    let restart = || format!("ip link set {interface} type can restart");
    let wait = || format!("wait for it, or: ip link set {interface} down && ip link set {interface} up");
    let (state, remedy) = match state {
        Some(CanState::BusOff) => ("bus-off", restart()),
        Some(CanState::ErrorPassive) => ("error-passive", wait()),
        Some(CanState::Stopped | CanState::Sleeping) => ("not started", wait()),
        Some(CanState::ErrorActive | CanState::ErrorWarning) | None => return Ok(()),
    };
    Err(OpenError::Unfit { interface: interface.to_owned(), state, remedy })
}

/// Refuses an interface that is absent, down, or not what the settings say.
fn check(bus: &Bus) -> Result<(), OpenError> {
    let interface = bus.interface.clone();
    if !interface_info::exists(&interface) {
        let remedy = match bus.kind {
            BusKind::Virtual => {
                format!(
                    "create it: ip link add dev {interface} type vcan && ip link set {interface} up; or do without it: start \
                     streamer and taustream-servosim with --link local"
                )
            }
            BusKind::Classic { .. } | BusKind::Fd { .. } => {
                "is its adapter plugged in? (list interfaces: ip link show type can)".into()
            }
        };
        return Err(OpenError::Missing { interface, remedy });
    }
    let interface_info = interface_info::of(&interface)?;
    if !interface_info.is_can {
        return Err(OpenError::NotCan { interface });
    }
    let name = bus.name.clone();
    let is_vcan = interface_info.kind.as_deref() == Some("vcan");
    match bus.kind {
        BusKind::Virtual if !is_vcan => {
            let kind = interface_info.kind.unwrap_or_default();
            return Err(OpenError::NotVirtual { bus: name, interface, kind });
        }
        BusKind::Virtual | BusKind::Classic { .. } | BusKind::Fd { .. } => {}
    }
    if !interface_info.is_up {
        return Err(OpenError::Down { command: up_command(bus), interface });
    }
    match (bus.kind.bitrate_bit_s(), interface_info.bitrate_bit_s) {
        (Some(declared_bit_s), Some(actual_bit_s)) if declared_bit_s != actual_bit_s => {
            let command = up_command(bus);
            Err(OpenError::OtherBitRate { bus: name, interface, declared_bit_s, actual_bit_s, command })
        }
        _ => Ok(()),
    }
}

/// A vcan carries whatever it is given: that a declared bit rate is only modelled must not come as a surprise.
fn say_what_is_modelled(bus: &Bus, role: LinkRole) {
    let is_vcan = interface_info::of(&bus.interface)
        .is_ok_and(|interface_info| interface_info.kind.as_deref() == Some("vcan"));
    if let (true, Some(words)) = (is_vcan, rates_in_words(bus.kind)) {
        let interface = &bus.interface;
        match role {
            LinkRole::Master => tracing::warn!("{interface} has no bit rate; the simulator models {words}"),
            LinkRole::Servos => tracing::info!("{interface} has no bit rate; {words} is modelled here"),
        }
    }
}

/// "1 Mbit/s", or "1 Mbit/s, 5 Mbit/s in the data phase"; none for a virtual bus.
pub(super) fn rates_in_words(kind: BusKind) -> Option<String> {
    let mega = |bit_s: u32| f64::from(bit_s) * 1e-6;
    let nominal = kind.bitrate_bit_s().map(mega)?;
    Some(match kind.data_bitrate_bit_s().map(mega) {
        Some(data) => format!("{nominal} Mbit/s, {data} Mbit/s in the data phase"),
        None => format!("{nominal} Mbit/s"),
    })
}

/// What brings the interface of a bus up.
fn up_command(bus: &Bus) -> String {
    let interface = &bus.interface;
    match bus.kind {
        BusKind::Virtual => format!("ip link set {interface} up"),
        BusKind::Classic { bitrate_bit_s } => {
            format!("ip link set {interface} up type can bitrate {bitrate_bit_s}")
        }
        BusKind::Fd { bitrate_bit_s, data_bitrate_bit_s } => format!(
            "ip link set {interface} up type can bitrate {bitrate_bit_s} dbitrate {data_bitrate_bit_s} fd on"
        ),
    }
}

/// Opens and sets up the socket: FD frames too, error frames, never waiting. A master's own frames come back to it as
/// confirmations that they were on the wire, if the interface hands them back itself, which is stated beside the socket.
fn open_socket(interface: &str, role: LinkRole) -> Result<(CanFdSocket, bool), OpenError> {
    let failed = |doing| move |source| OpenError::System { interface: interface.to_owned(), doing, source };
    let socket = CanFdSocket::open(interface).map_err(failed("open"))?;
    socket.set_nonblocking(true).map_err(failed("set up"))?;
    socket.set_recv_own_msgs(role == LinkRole::Master).map_err(failed("set up"))?;
    // Loopback to other sockets of this host stays on: recorders and simulators live there.
    socket.set_loopback(true).map_err(failed("set up"))?;
    socket.set_error_filter(ERROR_CLASSES).map_err(failed("set up"))?;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1).map_err(failed("set up"))?;
    // Beyond the host's limit only with CAP_NET_ADMIN; without it, as much as the limit gives.
    set_socket_recv_buffer_size_force(&socket, RECEIVE_BUFFER_BYTES)
        .or_else(|_| set_socket_recv_buffer_size(&socket, RECEIVE_BUFFER_BYTES))
        .map_err(|errno| failed("set up")(errno.into()))?;
    Ok((socket, interface_info::of(interface)?.echoes))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: a controller that is off the bus, or about to leave it, is not taken for a bus that carries setpoints, and
    /// each refusal names the command that helps. No vcan has such a state, so the kernel's answers are given here.
    #[test]
    fn faulty_controller_is_refused_with_the_remedy() {
        let said = |state| check_controller("can3", state).map_err(|refusal| refusal.to_string());
        for (state, word, remedy) in [
            (CanState::BusOff, "bus-off", "ip link set can3 type can restart"),
            (CanState::ErrorPassive, "error-passive", "ip link set can3 down && ip link set can3 up"),
            (CanState::Stopped, "not started", "ip link set can3 down && ip link set can3 up"),
            (CanState::Sleeping, "not started", "ip link set can3 down && ip link set can3 up"),
        ] {
            let text = said(Some(state)).expect_err("refused");
            assert!(text.contains("can3") && text.contains(word) && text.contains(remedy), "{text}");
        }
        for state in [Some(CanState::ErrorActive), Some(CanState::ErrorWarning), None] {
            assert_eq!(said(state), Ok(()));
        }
    }
}
