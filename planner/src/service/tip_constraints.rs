//! Which constraints of the tip the accepted motions keep: what replaces one by itself has to keep them too.
use super::Service;
use crate::constraints::TipConstraints;
use std::collections::VecDeque;
use taustream_messages::Report;
use taustream_messages::plan::PlanOutcome;

/// Motions that are remembered: what runs, what waits, and some before.
const REMEMBERED: usize = 16;

/// The constraints of accepted motions, by their trajectory.
#[derive(Debug, Default)]
pub(super) struct Remembered {
    /// `None` where parts of one motion have different constraints.
    motions: VecDeque<(u64, Option<TipConstraints>)>,
}

impl Remembered {
    fn note(&mut self, trajectory_id: u64, asked: Option<TipConstraints>) {
        if asked.is_some_and(|asked| asked.is_none()) {
            return;
        }
        if self.motions.len() == REMEMBERED {
            self.motions.pop_front();
        }
        self.motions.push_back((trajectory_id, asked));
    }

    /// None are known of a motion that was asked for without any.
    fn of(&self, trajectory_id: u64) -> Option<TipConstraints> {
        let found = self.motions.iter().rev().find(|(id, _)| *id == trajectory_id);
        found.map_or(Some(TipConstraints::default()), |(_, asked)| *asked)
    }
}

impl Service<'_> {
    /// Remembers what an accepted motion keeps.
    pub(super) fn remember(&self, trajectory_id: u64, asked: Option<TipConstraints>) {
        self.kept_constraints.borrow_mut().note(trajectory_id, asked);
    }

    /// The same of an answer.
    pub(super) fn remembering(&self, outcome: PlanOutcome, asked: &TipConstraints) -> PlanOutcome {
        if let PlanOutcome::Planned { trajectory_id, .. } = &outcome {
            self.remember(*trajectory_id, Some(*asked));
        }
        outcome
    }

    /// What the motion that runs keeps, and the one that waits; `None` where parts of them keep different constraints.
    pub(super) fn running_constraints(&self, report: &Report) -> Option<TipConstraints> {
        let remembered = self.kept_constraints.borrow();
        let runs = remembered.of(report.trajectory_id)?;
        if report.successor_id == 0 {
            return Some(runs);
        }
        remembered.of(report.successor_id).filter(|waits| *waits == runs)
    }

    /// Why a stream of targets cannot begin: it keeps no constraint of the tip.
    pub(super) fn unconstrained(&self, report: &Report, runs: bool) -> Result<(), String> {
        if !self.revision().scene.zones.is_empty() {
            return Err("the scene has speed zones ([[zone]]), which follow and jog do not keep; use replan, or a scene without \
                        zones"
                .to_owned());
        }
        if runs && self.running_constraints(report).is_none_or(|asked| !asked.is_none()) {
            return Err("the motion that runs keeps constraints of the tip, which follow and jog do not keep; wait until it has \
                        ended, or stop it"
                .to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_without_constraints_need_no_memory_and_the_oldest_are_forgotten() {
        let slow = TipConstraints { speed_m_s: Some(0.1), ..TipConstraints::default() };
        let mut remembered = Remembered::default();
        remembered.note(1, Some(slow));
        remembered.note(2, None);
        for id in 3..100 {
            remembered.note(id, Some(TipConstraints::default()));
        }
        assert_eq!((remembered.of(1), remembered.of(2)), (Some(slow), None));
        assert_eq!(remembered.of(50), Some(TipConstraints::default()));
        for id in 100..116 {
            remembered.note(id, Some(slow));
        }
        assert_eq!(remembered.of(1), Some(TipConstraints::default()));
    }
}
