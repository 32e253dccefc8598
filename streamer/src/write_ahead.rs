//! Between the cycle and the pose store: before drives are energised, a record on the disk says so.
//!
//! The cycle requests a record and goes on; the store's thread writes it and says when it is on the disk, or why not.
//! Both sides only load and store atomic numbers, so neither waits for the other. Requests are numbered: a record of rest
//! is written only while no request is open, that is after the cycle has released the newest one.
use std::array;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};
use taustream_arm::state_dir::DiskFault;
use taustream_messages::ReferenceState;
use taustream_motion::MAX_JOINTS;

/// Which of the two directories a fault is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// The state directory.
    State,
    /// The directory of the drives' epochs.
    Epochs,
}

/// Why a record is not on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoreFault {
    /// Where.
    pub place: Place,
    /// What.
    pub fault: DiskFault,
}

const EPOCHS_BIT: u32 = 1 << 31;

impl StoreFault {
    fn code(self) -> u32 {
        let place = if self.place == Place::Epochs { EPOCHS_BIT } else { 0 };
        self.fault.code() | place
    }
    fn from_code(code: u32) -> Option<Self> {
        let place = if code & EPOCHS_BIT == 0 { Place::State } else { Place::Epochs };
        Some(Self { place, fault: DiskFault::from_code(code & !EPOCHS_BIT)? })
    }
}

/// What is known of one joint at the moment of the request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointNow {
    /// Measured position, rad.
    pub position_rad: f64,
    /// What is added to its feedback, rad.
    pub offset_rad: f64,
    /// Whether the offset is known.
    pub reference_state: ReferenceState,
}

impl JointNow {
    /// Nothing is known.
    pub const UNKNOWN: Self =
        Self { position_rad: f64::NAN, offset_rad: 0.0, reference_state: ReferenceState::NoFeedback };
}

/// A request for a record that says: under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// Its number, from 1 on.
    pub number: u32,
    /// The joints.
    pub joints: [JointNow; MAX_JOINTS],
}

#[derive(Debug, Default)]
struct Slot {
    position_bits: AtomicU64,
    offset_bits: AtomicU64,
    reference_state: AtomicU32,
}

#[derive(Debug, Default)]
struct Shared {
    /// Written before the joints of a request, and `requested` after them: equal when the joints belong together.
    begun: AtomicU32,
    requested: AtomicU32,
    joints: [Slot; MAX_JOINTS],
    /// Number of the newest answer in the upper half, code of its fault in the lower; no fault: 0.
    answered: AtomicU64,
    released: AtomicU32,
    released_tick: AtomicU64,
    /// The newest released request after which rest was recorded.
    rested: AtomicU32,
}

/// The cycle's end.
#[derive(Debug)]
pub struct Requester {
    shared: Arc<Shared>,
    newest: u32,
}

/// The pose store's end.
#[derive(Clone, Debug)]
pub struct Recorder(Arc<Shared>);

/// Both ends.
#[must_use]
pub fn pair() -> (Requester, Recorder) {
    let shared = Arc::new(Shared::default());
    (Requester { shared: Arc::clone(&shared), newest: 0 }, Recorder(shared))
}

impl Requester {
    /// Requests a record; its number.
    ///
    /// Real time: a few atomic stores.
    pub fn request(&mut self, joints: &[JointNow; MAX_JOINTS]) -> u32 {
        self.newest = self.newest.wrapping_add(1);
        self.shared.begun.store(self.newest, Ordering::Relaxed);
        fence(Ordering::Release);
        for (slot, joint) in self.shared.joints.iter().zip(joints) {
            slot.position_bits.store(joint.position_rad.to_bits(), Ordering::Relaxed);
            slot.offset_bits.store(joint.offset_rad.to_bits(), Ordering::Relaxed);
            slot.reference_state.store(joint.reference_state.code(), Ordering::Relaxed);
        }
        self.shared.requested.store(self.newest, Ordering::Release);
        self.newest
    }

    /// What became of a request; `None` while nothing is known.
    ///
    /// Real time: one atomic load.
    #[must_use]
    pub fn answer(&self, number: u32) -> Option<Result<(), StoreFault>> {
        let answered = self.shared.answered.load(Ordering::Acquire);
        let (answered_number, code) = (answered >> 32, answered & u64::from(u32::MAX));
        if answered_number != u64::from(number) {
            return None;
        }
        let fault = u32::try_from(code).ok().and_then(StoreFault::from_code);
        Some(fault.map_or(Ok(()), Err))
    }

    /// Says that nothing is energised any more; `tick` is the cycle that found so.
    ///
    /// Real time: two atomic stores.
    pub fn release(&self, tick: u64) {
        self.shared.released_tick.store(tick, Ordering::Relaxed);
        self.shared.released.store(self.newest, Ordering::Release);
    }

    /// Rest was recorded after the newest request, or there was none.
    ///
    /// Real time: one atomic load.
    #[must_use]
    pub fn is_rest_recorded(&self) -> bool {
        self.shared.rested.load(Ordering::Relaxed) == self.newest
    }
}

impl Recorder {
    /// The newest request if it is newer than `done`.
    #[must_use]
    pub fn request(&self, done: u32) -> Option<Request> {
        let number = self.0.requested.load(Ordering::Acquire);
        let joints = array::from_fn(|joint| {
            self.0.joints.get(joint).map_or(JointNow::UNKNOWN, |slot| JointNow {
                position_rad: f64::from_bits(slot.position_bits.load(Ordering::Relaxed)),
                offset_rad: f64::from_bits(slot.offset_bits.load(Ordering::Relaxed)),
                reference_state: ReferenceState::from_code(slot.reference_state.load(Ordering::Relaxed)),
            })
        });
        fence(Ordering::Acquire);
        // While the next request is being written, this one has lost its reader.
        let whole = self.0.begun.load(Ordering::Relaxed) == number;
        (whole && number != done).then_some(Request { number, joints })
    }

    /// Answers a request.
    pub fn answer(&self, number: u32, result: Result<(), StoreFault>) {
        let code = result.err().map_or(0, StoreFault::code);
        self.0.answered.store(u64::from(number) << 32 | u64::from(code), Ordering::Release);
    }

    /// The cycle that released request `done`, when that is the newest one and nothing is energised since.
    #[must_use]
    pub fn released_since(&self, done: u32) -> Option<u64> {
        let released = self.0.released.load(Ordering::Acquire);
        let tick = self.0.released_tick.load(Ordering::Relaxed);
        let idle = released == done && self.0.requested.load(Ordering::Acquire) == done;
        idle.then_some(tick)
    }

    /// Says that rest is on the disk.
    pub fn rested(&self, number: u32) {
        self.0.rested.store(number, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use taustream_arm::state_dir::Step;

    #[test]
    fn requests_are_answered_by_number_and_faults_survive_the_way() {
        let (mut requester, recorder) = pair();
        assert!(requester.is_rest_recorded() && recorder.request(0).is_none());
        assert_eq!(recorder.released_since(0), Some(0));
        let joint =
            JointNow { position_rad: -1.5, offset_rad: 6.25, reference_state: ReferenceState::Operator };
        let number = requester.request(&[joint; MAX_JOINTS]);
        assert_eq!(recorder.request(0), Some(Request { number, joints: [joint; MAX_JOINTS] }));
        assert_eq!((requester.answer(number), recorder.released_since(number)), (None, None));
        for place in [Place::State, Place::Epochs] {
            let fault = StoreFault { place, fault: DiskFault { step: Step::Write, errno: 28 } };
            recorder.answer(number, Err(fault));
            assert_eq!(requester.answer(number), Some(Err(fault)));
        }
        recorder.answer(number, Ok(()));
        assert_eq!((requester.answer(number), requester.answer(number + 1)), (Some(Ok(())), None));
        requester.release(7);
        assert_eq!(recorder.released_since(number), Some(7));
        assert!(!requester.is_rest_recorded());
        recorder.rested(number);
        assert!(requester.is_rest_recorded());
        requester.request(&[joint; MAX_JOINTS]);
        assert_eq!(recorder.released_since(number), None, "a new request is open");
    }
}
