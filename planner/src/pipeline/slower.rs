//! Proven motions that are made slower all the same: for their drives, or for the plan by time.
use super::{Pipeline, SAME_SHARE};
use crate::objective::Objective;
use crate::torque::{Load, Overload};
use crate::verify::{Proof, Violation};
use taustream_motion::Trajectory;

impl Pipeline<'_> {
    /// Where energy counts: from here on optimisers look for less of it, and a motion that would be faster than the best by
    /// time is slowed down to that one, which takes less work still. So a plan by energy takes no more work than the plan by
    /// time of the same call, and no less time.
    pub(super) fn turn_to_energy(&mut self) -> bool {
        let counts = self.evaluator.objective == Objective::Energy;
        if counts {
            self.refines_by_energy = true;
            self.least_s = Some(self.shortest_s).filter(|s| s.is_finite());
        }
        counts
    }

    /// By what factor a proven motion must be slower: for its drives, or not to be faster than the best by time. None for one
    /// that is not kept anyway.
    pub(super) fn slowdown(&self, motion: &Trajectory, proof: &Proof) -> Result<Option<f64>, Overload> {
        let is_beaten = self.evaluator.objective == Objective::Time
            && self.best.as_ref().is_some_and(|best| best.score <= proof.duration_s);
        if is_beaten {
            return Ok(None);
        }
        match self.torque_limits.as_ref().map_or(Load::Borne, |limits| limits.load(motion)) {
            Load::Slower(factor, _) => return Ok(Some(factor)),
            Load::Unbearable(overload) => return Err(overload),
            Load::Borne => {}
        }
        let behind = self.least_s.map(|least_s| least_s / proof.duration_s);
        Ok(behind.filter(|factor| *factor > 1.0 + SAME_SHARE).map(|factor| factor + SAME_SHARE))
    }

    /// Notes why a motion was not proven; that its drives cannot bear it says more than what came of the paths round that.
    pub(super) fn blame(&mut self, violation: Violation) {
        if !matches!(self.violation, Some(Violation::Torque(_))) {
            self.violation = Some(violation);
        }
    }
}
