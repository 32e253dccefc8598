//! The buses: drivers that write and read frames, links that move them.
//!
//! One cycle makes one `sendmmsg` and one or two `recvmmsg` a bus, whatever arrives. A frame that was not
//! taken is counted, never sent again: an old setpoint is worse than none. A bus that has failed is silent
//! (`health.rs`) until its link was restarted by the service thread.
use crate::cycle_state::{BUSES_MAX, CycleState};
use crate::health::{BusActivity, Health};
use taustream_arm::Settings;
use taustream_drivers::{
    CanId, CanLink, DriveTarget, ErrorFrame, FrameBatch, JointCommand, LinkFault, Nanos, ServoDriver,
};
use taustream_motion::MAX_JOINTS;

/// SYNC's id (CiA 301, 7.2.5).
const SYNC: CanId = CanId::standard(0x080);
/// Batches taken from a link in one cycle; more wait for the next.
const RECEIVES_MAX: usize = 2;

/// Links of failed buses, by bus, on their way to the service thread or back.
pub type Links = [Option<Box<dyn CanLink>>; BUSES_MAX];

/// One bus: its link and the drivers of its servos.
pub struct Bus {
    /// `None` while the service thread starts it over.
    link: Option<Box<dyn CanLink>>,
    driver: Box<dyn ServoDriver>,
    health: Health,
    outgoing: FrameBatch,
    incoming: FrameBatch,
    syncs: u64,
    frames: u64,
    live: bool,
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let link = self.link.as_ref().map(|link| link.describe());
        f.debug_struct("Bus").field("link", &link).field("health", &self.health).finish_non_exhaustive()
    }
}

impl Bus {
    /// A bus on which nothing was sent or received; the settings say when it has failed.
    #[must_use]
    pub fn new(link: Box<dyn CanLink>, driver: Box<dyn ServoDriver>, settings: &Settings) -> Self {
        Self {
            link: Some(link),
            driver,
            health: Health::new(settings),
            outgoing: FrameBatch::new(),
            incoming: FrameBatch::new(),
            syncs: 0,
            frames: 0,
            live: false,
        }
    }
}

/// All buses of the arm.
#[derive(Debug)]
pub struct Buses {
    all: Vec<Bus>,
    local: Vec<bool>,
}

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
        if buses.len() > BUSES_MAX {
            return Err(TooManyBuses(buses.len()));
        }
        let is_local = |bus: &Bus| bus.link.as_ref().is_some_and(|link| link.is_local());
        Ok(Self { local: buses.iter().map(is_local).collect(), all: buses })
    }

    /// What the links are, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        let links: Vec<String> = self.all.iter().flat_map(|b| &b.link).map(|link| link.describe()).collect();
        links.join(", ")
    }

    /// Which of them are local links, one value a bus.
    #[must_use]
    pub fn local(&self) -> &[bool] {
        &self.local
    }

    pub(crate) fn links_mut(&mut self) -> impl Iterator<Item = &mut dyn CanLink> {
        self.all.iter_mut().flat_map(|bus| &mut bus.link).map(|link| &mut **link as &mut dyn CanLink)
    }

    /// Writes every bus's frames. On a failed bus only torque off is sent.
    ///
    /// Real time: no allocation.
    pub fn encode(&mut self, now: Nanos, drive_target: DriveTarget, commands: &[JointCommand; MAX_JOINTS]) {
        for bus in &mut self.all {
            bus.live = matches!(drive_target, DriveTarget::Enabled | DriveTarget::Keep);
            bus.outgoing.clear();
            if !bus.health.is_silent() || drive_target == DriveTarget::TorqueOff {
                bus.driver.encode(now, drive_target, commands, &mut bus.outgoing);
            }
        }
    }

    /// Says which joint's servo is to home itself in the next cycle's frames, of all that there are.
    ///
    /// Real time: no allocation.
    pub fn set_homing(&mut self, joint: Option<usize>) {
        for bus in &mut self.all {
            bus.driver.set_homing(joint);
        }
    }

    /// Hands every bus's frames over, all of them before anything is read.
    ///
    /// Real time: one system call a bus, one more while own frames are overdue; never waits.
    pub fn send(&mut self, cycle_state: &mut CycleState) {
        for (bus, found) in self.all.iter_mut().zip(&mut cycle_state.buses) {
            let frames = bus.outgoing.frames();
            let asks = bus.health.asks_for_queue();
            found.queued = bus.link.as_ref().filter(|_| asks).map(|link| link.has_queued());
            let sent = match &mut bus.link {
                Some(link) if !frames.is_empty() => link.send(frames),
                Some(_) | None => Default::default(),
            };
            let taken = frames.get(..sent.count).unwrap_or(frames);
            for frame in taken {
                bus.syncs += u64::from(frame.id() == SYNC);
            }
            bus.frames = bus.frames.saturating_add(u64::from(count(taken.len())));
            let complete = taken.len() == frames.len();
            (found.requested, found.sent) = (count(frames.len()), count(taken.len()));
            found.fault = sent.fault.filter(|_| !complete);
            (found.syncs, found.frames) = (bus.syncs, bus.frames);
            // Known before the commanded pose is: nothing was sent on a failed bus.
            found.failed = bus.health.failed();
            cycle_state.due = cycle_state.due.union(bus.outgoing.setpoints_in(frames.len()));
            cycle_state.taken = cycle_state.taken.union(bus.outgoing.setpoints_in(taken.len()));
            for joint in bus.driver.joints() {
                if let Some(out) = cycle_state.unreachable.get_mut(*joint) {
                    *out = found.failed.is_some();
                }
            }
        }
    }

    /// Takes what has arrived, evaluates each bus, and reads the state of the drives.
    ///
    /// Real time: at most `RECEIVES_MAX` system calls a bus, never waits.
    pub fn receive(&mut self, now: Nanos, cycle_state: &mut CycleState) {
        for (bus, found) in self.all.iter_mut().zip(&mut cycle_state.buses) {
            let Bus { link, driver, health, incoming, live, .. } = bus;
            let mut seen = BusActivity { live: *live, queued: found.queued, ..BusActivity::default() };
            if let Some(link) = link {
                for _ in 0..RECEIVES_MAX {
                    let fault = link.receive(incoming);
                    found.fault = worse(found.fault, fault);
                    for frame in incoming.frames() {
                        match ErrorFrame::of(frame) {
                            Some(error) => health.take_error(error, found),
                            None => driver.decode(now, frame),
                        }
                    }
                    found.received = found.received.saturating_add(count(incoming.frames().len()));
                    seen.more = incoming.may_have_more();
                    if !seen.more {
                        break;
                    }
                }
                (seen.confirmed, seen.from_wire) = (link.confirmed(), link.confirms_from_wire());
                seen.overflowed = link.overflowed();
            }
            health.evaluate(seen, found);
            found.other_master = driver.other_master();
            for joint in driver.joints() {
                if let Some(servo) = cycle_state.servos.get_mut(*joint) {
                    *servo = driver.status(*joint);
                }
                if let Some(out) = cycle_state.unreachable.get_mut(*joint) {
                    *out = found.failed.is_some();
                }
            }
        }
    }

    /// Resets the faults of all drives, over the next cycles.
    ///
    /// Real time: no allocation.
    pub fn clear_faults(&mut self) {
        for bus in &mut self.all {
            bus.driver.clear_faults();
        }
    }

    /// Hands out the links of failed buses, to be restarted.
    ///
    /// Real time: moves pointers.
    pub fn hand_out(&mut self) -> Links {
        let mut links: Links = Default::default();
        for (bus, slot) in self.all.iter_mut().zip(&mut links) {
            if bus.health.is_silent() {
                *slot = bus.link.take();
            }
        }
        links
    }

    /// Takes links back. When they are `recovered`, their buses begin again: the state of the drives is read before anything is sent.
    ///
    /// Real time: moves pointers, frees nothing.
    pub fn reclaim(&mut self, links: Links, recovered: bool) {
        for (bus, link) in self.all.iter_mut().zip(links) {
            let Some(link) = link else { continue };
            bus.link = Some(link);
            if recovered {
                bus.health.start_over();
                bus.driver.start_over();
            }
        }
    }
}

fn count(frames: usize) -> u32 {
    u32::try_from(frames).unwrap_or(u32::MAX)
}

/// Which of two faults of one cycle says more: a lost interface hides behind a full queue.
fn worse(sent: Option<LinkFault>, received: Option<LinkFault>) -> Option<LinkFault> {
    match (sent, received) {
        (Some(LinkFault::QueueFull | LinkFault::Os(_)) | None, Some(_)) => received,
        (Some(_), _) | (None, None) => sent,
    }
}
