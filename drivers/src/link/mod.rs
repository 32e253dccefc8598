//! What moves frames: SocketCAN, or the local link on a host whose kernel has no CAN.
//!
//! [`open()`] chooses, checks and locks; the cycle then knows only the [`CanLink`] trait. Frames that a link sent itself
//! never come back to it.
use crate::frame::{CanFrame, FrameBatch};
use std::os::fd::BorrowedFd;

mod batch;
mod controller;
pub mod error_frame;
mod interface_info;
mod local;
mod lock;
pub mod open;
mod socketcan;

pub use controller::{Controller, ControllerState, controller};
pub use error_frame::ErrorFrame;
pub use open::{Holder, LinkChoice, LinkRole, OpenError, is_local, open};

/// Why a link did not take, or give, frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkFault {
    /// ENOBUFS or EAGAIN: no frame leaves the queue.
    #[error("transmit queue full; are the drives powered and is the bus terminated?")]
    QueueFull,
    /// ENETDOWN: the interface is down.
    #[error("interface is down; bring it up: ip link set IFACE up")]
    Down,
    /// ENXIO, ENODEV, or the peer of a local link has gone: the interface does not exist any more.
    #[error("the interface, or the other end of a local link, has gone")]
    Gone,
    /// Another error of the operating system.
    #[error("operating system error {0}")]
    Os(i32),
}

/// What became of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sent {
    /// How many frames were taken, from the front.
    pub count: usize,
    /// Why not all.
    pub fault: Option<LinkFault>,
}

/// A CAN bus as the cycle sees it. Never waits, never allocates after it was opened.
pub trait CanLink: Send {
    /// Hands the frames over in order: up to [`crate::frame::BATCH_MAX`] in one system call.
    ///
    /// Real time: one system call, up to three more after a partial batch or a stale error; never waits.
    fn send(&mut self, frames: &[CanFrame]) -> Sent;

    /// Replaces the batch by what has arrived, oldest first, at most its capacity. Error frames come too.
    ///
    /// Real time: one system call, up to two more while an interface is down; never waits.
    fn receive(&mut self, into: &mut FrameBatch) -> Option<LinkFault>;

    /// What it is, for messages: "socketcan vcan0" or "local link vcan0".
    fn describe(&self) -> String;

    /// Whether it joins programs of this computer without any bus between them, as a local link does.
    fn is_local(&self) -> bool {
        false
    }

    /// Descriptor that polls readable while `receive` has work, new peers of a local link included: an epoll
    /// instance where one descriptor does not do. For servers, which wait; the cycle never does. `None` when there
    /// is nothing to wait on (a link in memory).
    fn readiness(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// How many frames of this link were seen on the wire since it was opened or reopened: the kernel hands each one
    /// back when the controller has sent it (own-message echo). `None` where a frame that was taken has arrived.
    ///
    /// Interfaces without an echo of their own (vcan, some serial adapters) hand frames back as they are taken, before
    /// any queue: there the count says nothing about the wire, and only the queue filling up does.
    fn confirmed(&self) -> Option<u64> {
        None
    }

    /// Whether [`Self::confirmed`] counts what was on the wire. On an interface without an echo of its own it counts what
    /// came back through this computer's receive path, and a frame that stays away says nothing about the bus.
    fn confirms_from_wire(&self) -> bool {
        true
    }

    /// Frames, own ones among them, that were lost because they arrived faster than they were read, since the link was
    /// opened or reopened.
    fn overflowed(&self) -> u64 {
        0
    }

    /// Whether frames of this link still wait in the interface's queue; those in a controller's mailboxes do not count.
    ///
    /// Real time: at most one system call, never waits.
    fn has_queued(&self) -> bool {
        false
    }

    /// After a fault: starts over on the interface, or the peer, that has come back. What was received before is
    /// forgotten, and frames that still wait to be sent are a refusal: they are old. The lock is kept all the while, so that
    /// no other master slips in. Harmless on a link that is well.
    ///
    /// Not for real time: allocates and asks the kernel.
    ///
    /// # Errors
    /// As for [`open()`], and when the controller is not fit or old frames wait; the link is as it was and may be asked
    /// again.
    fn reopen(&mut self) -> Result<(), OpenError> {
        Ok(())
    }
}
