//! Whether a drive that is found energised is ours, found out by reading alone.
//!
//! A streamer that was killed leaves drives that hold. The next one may take the hold over only if every object that it
//! would have written says what it would have written, and the drive's own target rests. Nothing is written here.
use crate::bring_up::fault::BringUpFault;
use crate::bring_up::plan::NodePlan;
use crate::bring_up::scale::{Contradiction, ExpectedScale, StatedScale};
use crate::bring_up::steps::{self, Check, Need, Step};
use crate::codec::cia402_words::DriveStep;
use crate::codec::error_text::is_of_the_transfer;
use crate::codec::object::{self, Address};
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::Nanos;

/// Time between the two readings of the target that must agree: a ramp under way shows itself in it.
const REST: Nanos = Nanos(100_000_000);

/// What an answer has brought.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Finding {
    /// More is to be read.
    More,
    /// Ours; it holds this target, in counts.
    Holds(i32),
    /// Not ours: why, and the object that says so.
    Foreign(BringUpFault, u32),
    /// Not as the settings say: it counts otherwise.
    Differs(Contradiction),
    /// It does not answer.
    NoReply,
}

/// The reading of one energised drive.
#[derive(Clone, Debug)]
pub(crate) struct Adoption {
    steps: Vec<Step>,
    /// The next step; beyond the last one the target is read.
    at: usize,
    /// Objects that may state the held target, the first that the drive has counts.
    sources: [Address; 2],
    source: usize,
    held: Option<i32>,
    not_before: Nanos,
    /// Where the plan maps the target.
    target: Address,
    expected: ExpectedScale,
    stated: StatedScale,
}

impl Adoption {
    /// A reading for a node of this plan.
    pub(crate) fn new(plan: &NodePlan) -> Self {
        let sources = [object::POSITION_DEMAND, object::POSITION_ACTUAL];
        Self {
            steps: plan.verification(),
            at: 0,
            sources,
            source: 0,
            held: None,
            not_before: Nanos(0),
            target: plan.target_object(),
            expected: plan.scale,
            stated: StatedScale::default(),
        }
    }

    /// Begins again with a drive in this state; `false` for a state in which nothing is held.
    ///
    /// Real time: no allocation.
    pub(crate) fn begin(&mut self, state: Option<DriveStep>) -> bool {
        (self.at, self.source, self.held, self.not_before) = (0, 0, None, Nanos(0));
        self.stated = StatedScale::default();
        // A drive without the demand object holds its last target while it is enabled, and where it stands after a stop.
        let second = match state {
            Some(DriveStep::OperationEnabled) => self.target,
            Some(DriveStep::QuickStopActive) => object::POSITION_ACTUAL,
            _ => return false,
        };
        self.sources = [object::POSITION_DEMAND, second];
        true
    }

    /// The read that is due now.
    ///
    /// Real time: no allocation.
    pub(crate) fn job(&self, now: Nanos) -> Option<SdoJob> {
        let step = self.steps.get(self.at).map(|step| step.job);
        let target = self.sources.get(self.source).map(|source| SdoJob::Read(*source));
        step.or_else(|| target.filter(|_| now >= self.not_before))
    }

    /// Takes the answer to [`Self::job`].
    ///
    /// Real time: no allocation.
    pub(crate) fn settle(&mut self, now: Nanos, job: SdoJob, outcome: SdoOutcome) -> Finding {
        let object = job.address().packed();
        let value = match outcome {
            SdoOutcome::Value(value) => value,
            SdoOutcome::TimedOut => return Finding::NoReply,
            SdoOutcome::Aborted(code) => return self.missing(code, job.address()),
            SdoOutcome::Written => return Finding::More,
        };
        let Some(step) = self.steps.get(self.at) else {
            return match value.as_unsigned(4) {
                Some(counts) => self.target(now, counts.cast_signed()),
                None => Finding::Foreign(BringUpFault::WrongWidth, object),
            };
        };
        if step.check == Check::Scale {
            return match step.number(value) {
                Some(number) => self.scale(job.address(), Some(number)),
                None => Finding::Foreign(BringUpFault::WrongWidth, object),
            };
        }
        let number = step.number(value);
        let fits = number.is_some_and(|number| steps::passes(step.check, number).is_ok());
        if !fits {
            return Finding::Foreign(BringUpFault::Foreign, object);
        }
        self.at += 1;
        Finding::More
    }

    fn scale(&mut self, address: Address, value: Option<u32>) -> Finding {
        self.at += 1;
        match self.stated.take(address, value, &self.expected) {
            Ok(()) => Finding::More,
            Err(contradiction) => Finding::Differs(contradiction),
        }
    }

    fn missing(&mut self, code: u32, address: Address) -> Finding {
        let absent = !is_of_the_transfer(code);
        match self.steps.get(self.at) {
            Some(step) if absent && step.check == Check::Scale => return self.scale(address, None),
            Some(step) if absent && step.need != Need::Demanded => self.at += 1,
            None if absent && self.source + 1 < self.sources.len() => self.source += 1,
            _ => return Finding::Foreign(BringUpFault::Foreign, address.packed()),
        }
        Finding::More
    }

    fn target(&mut self, now: Nanos, counts: i32) -> Finding {
        if self.held == Some(counts) {
            return Finding::Holds(counts);
        }
        self.held = Some(counts);
        self.not_before = Nanos(now.0.saturating_add(REST.0));
        Finding::More
    }
}
