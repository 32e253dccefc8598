//! What a plan comes to: the best motion with its least distance, or why there is none.
use super::{Best, Pipeline, explained};
use crate::kind::PlannerKind;
use crate::plan::{CUT_SHORT, Plan, PlanError, Remedy};
use crate::verify::{Violation, measured};

impl Pipeline<'_> {
    /// Finds the least distance of the motion that is the answer.
    fn measure_best(&mut self) {
        let Some(mut best) = self.best.take() else { return };
        if let Some(stretches) = self.stretches(&best.trajectory) {
            best.proof = measured(&stretches, &best.trajectory, &best.proof, self.space.budget);
        }
        self.best = Some(best);
    }

    pub(super) fn finish(mut self) -> Result<Plan, PlanError> {
        self.note_time("timing, corners and proof".to_owned());
        self.measure_best();
        let stages = self.stages;
        let budget = self.space.budget;
        let cut = budget.was_cut();
        let tried = self.tried.join(", ");
        match (self.best, self.violation) {
            (Some(Best { trajectory, proof, how: last, score }), _) => {
                // What won comes first: messages hold 240 bytes.
                let mut how = last;
                if cut {
                    how.push_str(CUT_SHORT);
                }
                if !tried.is_empty() && tried != how {
                    how = format!("{how} (tried: {tried})");
                }
                let (energy_j, checks) = (self.evaluator.energy_j(&trajectory), self.space.checks());
                let (planning_s, first_s) = (budget.elapsed_s(), self.first_s);
                let tip_use = self.rules.as_ref().map(|rules| rules.used(&trajectory));
                Ok(Plan {
                    trajectory,
                    how,
                    proof,
                    score,
                    energy_j,
                    planning_s,
                    first_s,
                    checks,
                    tip_use,
                    stages,
                })
            }
            (None, Some(violation)) => {
                if cut && matches!(violation, Violation::Unresolved { .. }) {
                    let tried = format!("{tried}, {violation}");
                    let remedy = Remedy::Clock(self.options.deadline);
                    return Err(PlanError::NotFound { tried, remedy, explanation: explained(stages) });
                }
                Err(PlanError::Unproven { tried, violation, explanation: explained(stages) })
            }
            (None, None) if self.untimed && !cut => {
                Err(PlanError::Untimed { tried, explanation: explained(stages) })
            }
            (None, None) => {
                let remedy = match self.options.planner {
                    _ if cut => Remedy::Clock(self.options.deadline),
                    PlannerKind::Straight => Remedy::Planner,
                    PlannerKind::Auto
                    | PlannerKind::RrtConnect
                    | PlannerKind::Rrt
                    | PlannerKind::Rbf
                    | PlannerKind::Bfo
                    | PlannerKind::Optimiser(_) => Remedy::Budget(self.options.deadline),
                };
                Err(PlanError::NotFound { tried, remedy, explanation: explained(stages) })
            }
        }
    }
}
