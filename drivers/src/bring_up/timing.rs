//! What every bring-up knows of time: how long to wait, and a clock that does not count our own stalls as waiting.
use crate::frame::CanId;
use crate::servo::{DriveTarget, Nanos};

/// Limits of waiting.
#[derive(Clone, Copy, Debug)]
pub struct Timeouts {
    /// Each confirmation of a step.
    pub step: Nanos,
    /// Age up to which feedback of a drive is recent.
    pub feedback: Nanos,
}

/// What the master knows in a cycle, beside the drive itself.
#[derive(Clone, Copy, Debug)]
pub struct BringUpCycle {
    /// Time without our own stalls.
    pub now: Nanos,
    /// The drive target.
    pub drive_target: DriveTarget,
    /// A frame of another master was received recently.
    pub other_master: bool,
}

/// Time without frames of other masters after which the bus counts as ours.
const OTHER_MASTER_QUIET: Nanos = Nanos(500_000_000);
/// A longer gap between two cycles is our own stall and does not count as waiting.
const STEP_PERIODS: u64 = 10;

/// A clock that advances with the cycles, but not through our own stalls.
#[derive(Clone, Copy, Debug)]
pub struct StepTimer {
    step: Nanos,
    now: Nanos,
    ticked: Option<Nanos>,
    /// When another master has spoken last, and by which frame.
    other_master: Option<(Nanos, CanId)>,
}

impl StepTimer {
    /// At its beginning.
    #[must_use]
    pub fn new(period_us: u32) -> Self {
        let step = Nanos(u64::from(period_us) * 1_000 * STEP_PERIODS);
        // Not 0: that is "never" where a time is kept.
        Self { step, now: Nanos(1), ticked: None, other_master: None }
    }
    /// One cycle at `time`, with this drive target.
    pub fn tick(&mut self, time: Nanos, drive_target: DriveTarget) -> BringUpCycle {
        let passed = self.ticked.map_or(0, |then| time.0.saturating_sub(then.0));
        self.now = Nanos(self.now.0.saturating_add(passed.min(self.step.0)));
        self.ticked = Some(time);
        BringUpCycle { now: self.now, drive_target, other_master: self.other_master().is_some() }
    }
    /// Its time.
    #[must_use]
    pub const fn now(&self) -> Nanos {
        self.now
    }
    /// The bus is another one now.
    pub fn forget_other_master(&mut self) {
        self.other_master = None;
    }
    /// Another master has spoken, by this frame.
    pub fn note_other_master(&mut self, id: CanId) {
        self.other_master = Some((self.now, id));
    }
    /// The newest frame of another master, when it came a short while ago.
    #[must_use]
    pub fn other_master(&self) -> Option<CanId> {
        let is_recent = |at: Nanos| self.now.0.saturating_sub(at.0) < OTHER_MASTER_QUIET.0;
        self.other_master.filter(|(at, _)| is_recent(*at)).map(|(_, id)| id)
    }
}

/// A positive time of the settings in nanoseconds; `None` for what is no positive number.
#[must_use]
pub fn nanos(seconds: f64) -> Option<Nanos> {
    if !seconds.is_finite() || seconds <= 0.0 {
        return None;
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "positive; saturation is fine"
    )]
    let nanos = (seconds * 1e9) as u64;
    Some(Nanos(nanos))
}
