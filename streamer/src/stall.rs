//! Stalls of the cycle: what they do to the motion, and which faults they are to blame for.
use crate::cycle_state::{Cause, CycleState};
use crate::phases::Event;
use crate::supervise::{Actions, Supervisor};
use taustream_arm::settings::CycleSettings;
use taustream_drivers::{DriveTarget, Nanos};
use taustream_messages::{FaultReason, Phase};
use taustream_motion::stopping::SpeedRequest;

/// How long the drives may take to come to rest after a stall before the arm stays paused, s.
const REST_S: f64 = 1.0;
/// How long after a stall a drive that has lost its master may say so, s: some tell by their next heartbeat but one.
const BLAME_S: f64 = 1.0;

/// What stalls may last, and the newest one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stalls {
    period_s: f64,
    tolerated_s: f64,
    resume_s: f64,
    watchdog_s: f64,
    /// A stall froze the motion; it continues when the drives rest.
    frozen_since: Option<Nanos>,
    /// How long no setpoint left before it, s.
    gap_s: f64,
    /// The newest stall of this loop that the drives do not bridge: when it ended, and how long it was, s.
    newest: Option<(Nanos, f64)>,
}

impl Stalls {
    pub(crate) fn new(cycle: &CycleSettings) -> Self {
        let period_s = f64::from(cycle.period_us) * 1e-6;
        Self {
            period_s,
            tolerated_s: f64::from(cycle.tolerated_gap_periods) * period_s,
            resume_s: f64::from(cycle.stall_resume_ms) * 1e-3,
            watchdog_s: f64::from(cycle.drive_watchdog_ms) * 1e-3,
            frozen_since: None,
            gap_s: 0.0,
            newest: None,
        }
    }

    /// The motion is frozen, and continues when the drives rest.
    pub(crate) fn is_frozen(&self) -> bool {
        self.frozen_since.is_some()
    }

    /// How long no setpoint left before the newest stall that froze a motion, s.
    pub(crate) fn gap_s(&self) -> f64 {
        self.gap_s
    }

    /// What was frozen no longer continues by itself.
    pub(crate) fn release(&mut self) {
        self.frozen_since = None;
    }

    /// Not the gap between setpoints: a failed bus makes one, too, while this loop runs.
    fn observe(&mut self, cycle_state: &CycleState) {
        let gap_s = (cycle_state.tick.skipped + 1) as f64 * self.period_s;
        if gap_s > self.tolerated_s {
            self.newest = Some((cycle_state.tick.wake_time, gap_s));
        }
    }

    /// A drive that has stopped because its master was silent is not to blame when this loop has just stalled.
    pub(crate) fn blame(&self, cause: Cause, cycle_state: &CycleState) -> Cause {
        let lost_master = |joint: usize| cycle_state.servos.get(joint).is_some_and(|servo| servo.lost_master);
        let is_recent = |at: Nanos| cycle_state.tick.wake_time.since_s(at) <= BLAME_S;
        match (cause.joint, self.newest) {
            (Some(joint), Some((at, gap_s))) if lost_master(joint) && is_recent(at) => {
                Cause::new(FaultReason::Stall).at_joint(joint).amount(gap_s, 0.0)
            }
            _ => cause,
        }
    }
}

impl Supervisor {
    /// Gaps beyond what the drives bridge.
    pub(crate) fn evaluate_stall(&mut self, cycle_state: &CycleState, actions: &mut Actions) {
        let energised = matches!(self.drive_target(), DriveTarget::Enabled | DriveTarget::Keep)
            && self.phase != Phase::Fault;
        self.stalls.observe(cycle_state);
        if energised && cycle_state.gap_s > self.stalls.watchdog_s {
            let cause = Cause::new(FaultReason::Stall).amount(cycle_state.gap_s, self.stalls.watchdog_s);
            self.raise(Event::StopFault, cause, cycle_state, actions);
        }
        if self.phase != Phase::Moving {
            return;
        }
        if cycle_state.frozen {
            self.stalls.gap_s = cycle_state.gap_s;
            if cycle_state.gap_s > self.stalls.resume_s {
                self.stalls.release();
                self.step(Event::StalledLong, cycle_state, actions);
            } else {
                self.stalls.frozen_since = Some(cycle_state.tick.wake_time);
            }
            return;
        }
        let Some(since) = self.stalls.frozen_since else { return };
        if self.watch.is_at_rest() && cycle_state.can_ramp {
            self.stalls.release();
            actions.speed = Some(SpeedRequest::Change(self.speed()));
        } else if cycle_state.tick.wake_time.since_s(since) > REST_S {
            self.stalls.release();
            self.step(Event::StalledLong, cycle_state, actions);
        }
    }
}
