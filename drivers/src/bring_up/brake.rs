//! The brake that a drive does not work by itself: released by its master through 0x60FE once the drive holds its load, and closed
//! before the drive loses its torque, or at once when it has lost it.
//!
//! It is written by SDO and counts as released or closed a stated time after the drive has confirmed it. Bring-up closes it.
use crate::bring_up::cia402::Node;
use crate::codec::object;
use crate::codec::sdo::SdoBytes;
use crate::codec::sdo_client::{SdoJob, SdoOutcome};
use crate::servo::Nanos;
use taustream_arm::BrakeSettings;

/// Pause between two tries to close it.
const AGAIN: Nanos = Nanos(100_000_000);

/// How the brake stands, as the power state machine sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrakeView {
    /// It is out of the way.
    pub released: bool,
    /// It holds, or there is none.
    pub closed: bool,
    /// The drive has not taken the newest command.
    pub failed: bool,
}

impl BrakeView {
    /// A drive that works its brake by itself, or has none.
    pub const NONE: Self = Self { released: true, closed: true, failed: false };
}

/// What is known of the brake of one drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Brake {
    /// The drive has confirmed it released, or closed.
    released: Option<bool>,
    /// When, or when it was tried last.
    since: Nanos,
    failed: bool,
}

impl Brake {
    /// Nothing is known of it.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }
    /// Bring-up has closed it.
    pub(super) fn closed_by_bring_up(&mut self) {
        *self = Self { released: Some(false), ..Self::default() };
    }
    /// It is tried anew.
    pub(super) fn clear(&mut self) {
        self.failed = false;
    }

    /// How it stands now.
    pub(super) fn view(&self, now: Nanos, settings: Option<&BrakeSettings>) -> BrakeView {
        let Some(settings) = settings else { return BrakeView::NONE };
        let passed = |ms: u16| now.0.saturating_sub(self.since.0) >= u64::from(ms) * 1_000_000;
        BrakeView {
            released: self.released == Some(true) && passed(settings.release_ms),
            closed: self.released == Some(false) && passed(settings.close_ms),
            failed: self.failed,
        }
    }
}

/// The write that releases or closes it.
pub(super) fn command(settings: &BrakeSettings, released: bool) -> SdoJob {
    SdoJob::Write(object::OUTPUTS, SdoBytes::from_u32(settings.output(released)))
}

impl Node {
    /// Commands the brake where it is not as the power state machine wants it.
    ///
    /// Closing does not wait for an answer to anything else.
    pub(super) fn work_brake(&mut self, now: Nanos) {
        let Some(settings) = self.plan.brake else { return };
        let Some(released) = self.power.wants_brake_released(self.status, self.mode.is_right) else { return };
        if self.brake.released == Some(released) {
            self.brake.failed = false;
            return;
        }
        let job = command(&settings, released);
        let waits = self.brake.failed && (released || self.age(now, self.brake.since) < AGAIN.0);
        let is_free = !released || self.sdo.is_idle();
        if !waits && is_free && self.sdo.job() != Some(job) {
            self.sdo.begin(job);
        }
    }

    /// Closes the brake of a drive that has left process data, as far as it still takes requests.
    pub(super) fn close_brake(&mut self) {
        if let Some(settings) = &self.plan.brake {
            self.sdo.begin(command(settings, false));
        }
    }

    /// Takes the answer.
    pub(super) fn take_brake(&mut self, now: Nanos, job: SdoJob, outcome: SdoOutcome) {
        let Some(settings) = self.plan.brake else { return };
        self.brake.since = now;
        self.brake.failed = outcome != SdoOutcome::Written;
        match outcome {
            SdoOutcome::Written => self.brake.released = Some(job == command(&settings, true)),
            // It may have been taken, and the answer lost.
            SdoOutcome::TimedOut => self.brake.released = None,
            SdoOutcome::Aborted(_) | SdoOutcome::Value(_) => {}
        }
    }
}
