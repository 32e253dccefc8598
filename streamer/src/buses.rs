//! The buses: drivers that write and read frames, links that move them.
//!
//! One cycle makes one `sendmmsg` and one or two `recvmmsg` a bus, whatever arrives. A frame that was not
//! taken is counted, never sent again: an old setpoint is worse than none.
use crate::facts::{BUSES_MAX, BusTrouble, Facts};
use taustream_drivers::{CanFrame, CanId, CanLink, DriveWish, FrameBatch, JointCommand, Nanos, ServoDriver};
use taustream_motion::MAX_JOINTS;

/// SYNC's id (CiA 301, 7.2.5).
const SYNC: CanId = CanId::standard(0x080);
/// Batches taken from a link in one cycle; more wait for the next.
const RECEIVES_MAX: usize = 2;

/// One bus: its link and the drivers of its servos.
pub struct Bus {
    link: Box<dyn CanLink>,
    driver: Box<dyn ServoDriver>,
    outgoing: FrameBatch,
    incoming: FrameBatch,
    syncs: u64,
    lost_in_a_row: u32,
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus").field("link", &self.link.describe()).finish_non_exhaustive()
    }
}

impl Bus {
    /// A bus of which nothing was sent or heard.
    #[must_use]
    pub fn new(link: Box<dyn CanLink>, driver: Box<dyn ServoDriver>) -> Self {
        Self {
            link,
            driver,
            outgoing: FrameBatch::new(),
            incoming: FrameBatch::new(),
            syncs: 0,
            lost_in_a_row: 0,
        }
    }
}

/// All buses of the arm.
#[derive(Debug)]
pub struct Buses(Vec<Bus>);

/// More buses than a cycle serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} buses; one streamer serves at most {BUSES_MAX}")]
pub struct TooManyBuses(pub usize);

impl Buses {
    /// Takes all buses of an arm.
    ///
    /// # Errors
    /// When there are more than [`BUSES_MAX`].
    pub fn new(buses: Vec<Bus>) -> Result<Self, TooManyBuses> {
        if buses.len() > BUSES_MAX { Err(TooManyBuses(buses.len())) } else { Ok(Self(buses)) }
    }

    /// What the links are, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        let links: Vec<String> = self.0.iter().map(|b| b.link.describe()).collect();
        links.join(", ")
    }

    pub(crate) fn links_mut(&mut self) -> impl Iterator<Item = &mut dyn CanLink> {
        self.0.iter_mut().map(|bus| &mut *bus.link as &mut dyn CanLink)
    }

    /// Writes every bus's frames.
    ///
    /// Real time: no allocation.
    pub fn encode(&mut self, now: Nanos, wish: DriveWish, commands: &[JointCommand; MAX_JOINTS]) {
        for bus in &mut self.0 {
            bus.outgoing.clear();
            bus.driver.encode(now, wish, commands, &mut bus.outgoing);
        }
    }

    /// Hands every bus's frames over.
    ///
    /// Real time: one system call a bus, never waits.
    pub fn send(&mut self, facts: &mut Facts) {
        for (bus, found) in self.0.iter_mut().zip(&mut facts.buses) {
            let frames = bus.outgoing.frames();
            let sent = if frames.is_empty() { Default::default() } else { bus.link.send(frames) };
            let taken = frames.get(..sent.count).unwrap_or(frames);
            for frame in taken {
                bus.syncs += u64::from(frame.id() == SYNC);
            }
            let complete = taken.len() == frames.len();
            bus.lost_in_a_row = if complete { 0 } else { bus.lost_in_a_row.saturating_add(1) };
            (found.wanted, found.sent) = (count(frames.len()), count(taken.len()));
            found.fault = sent.fault.filter(|_| !complete);
            (found.lost_in_a_row, found.syncs) = (bus.lost_in_a_row, bus.syncs);
        }
    }

    /// Takes what has arrived, and asks the drivers what they know now.
    ///
    /// Real time: at most `RECEIVES_MAX` system calls a bus, never waits.
    pub fn receive(&mut self, now: Nanos, facts: &mut Facts) {
        for (bus, found) in self.0.iter_mut().zip(&mut facts.buses) {
            for _ in 0..RECEIVES_MAX {
                let fault = bus.link.receive(&mut bus.incoming);
                found.fault = found.fault.or(fault);
                for frame in bus.incoming.frames() {
                    if frame.id().is_error() {
                        found.trouble = found.trouble.or(trouble(frame));
                    } else {
                        bus.driver.decode(now, frame);
                    }
                }
                let received = bus.incoming.frames().len();
                found.received += count(received);
                if received < taustream_drivers::frame::BATCH_MAX {
                    break;
                }
            }
            for joint in bus.driver.joints() {
                if let Some(servo) = facts.servos.get_mut(*joint) {
                    *servo = bus.driver.status(*joint);
                }
            }
        }
    }

    /// Asks all drives to forget their faults, over the next cycles.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self) {
        for bus in &mut self.0 {
            bus.driver.clear_faults();
        }
    }
}

fn count(frames: usize) -> u32 {
    u32::try_from(frames).unwrap_or(u32::MAX)
}

/// What an error frame says (linux/can/error.h): class bits in the id, controller states in byte 1.
fn trouble(frame: &CanFrame) -> Option<BusTrouble> {
    const CONTROLLER: u32 = 0x004;
    const BUS_OFF: u32 = 0x040;
    const RESTARTED: u32 = 0x100;
    const PASSIVE: u8 = 0x10 | 0x20;
    let class = frame.id().raw();
    let passive = frame.data().get(1).is_some_and(|state| state & PASSIVE != 0);
    if class & BUS_OFF != 0 {
        Some(BusTrouble::BusOff)
    } else if class & RESTARTED != 0 {
        Some(BusTrouble::Restarted)
    } else {
        (class & CONTROLLER != 0 && passive).then_some(BusTrouble::ErrorPassive)
    }
}
