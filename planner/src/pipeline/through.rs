//! A path through given poses, leg by leg.
use super::{Pipeline, SHORTCUTS};
use crate::plan::{Plan, PlanError};
use crate::rng::SeededRng;
use crate::search::Searcher;
use crate::shortcut::shorten;
use taustream_motion::JointArray;

impl Pipeline<'_> {
    /// A motion from a pose to another one, or through several.
    ///
    /// # Errors
    /// What was tried in vain.
    pub fn run_onward(self, start_rad: &JointArray, onward_rad: &[JointArray]) -> Result<Plan, PlanError> {
        if let [goal_rad] = onward_rad {
            return self.run(start_rad, goal_rad);
        }
        let all_rad: Vec<JointArray> = std::iter::once(start_rad).chain(onward_rad).copied().collect();
        self.run_through(&all_rad)
    }

    /// A motion that passes poses in their order.
    ///
    /// # Errors
    /// What was tried in vain.
    pub fn run_through(mut self, poses_rad: &[JointArray]) -> Result<Plan, PlanError> {
        let legs = poses_rad.len().saturating_sub(1);
        let mut whole: Vec<JointArray> = poses_rad.first().copied().into_iter().collect();
        for (number, leg) in poses_rad.windows(2).enumerate() {
            let Some(path) = self.leg(leg, number, self.stage_budgets.search_checks / legs.max(1)) else {
                return self.finish();
            };
            whole.extend(path.iter().skip(1));
        }
        match whole.as_slice() {
            [pose_rad] => self.stay(pose_rad),
            [_, _] => self.propose(&whole, "straight line"),
            _ => {
                let source = format!("through {} poses", poses_rad.len());
                self.propose(&whole, &source);
                self.round(&whole, &source, None);
            }
        }
        self.finish()
    }

    /// The straight line between two poses, or a shortened path around what blocks it.
    fn leg(&mut self, leg: &[JointArray], number: usize, checks_max: usize) -> Option<Vec<JointArray>> {
        let [from, to] = leg else { return None };
        if self.is_edge_kept(from, to) && self.space.is_edge_free(from, to) {
            return Some(leg.to_vec());
        }
        let searcher = Searcher::RrtConnect;
        let mut rng = SeededRng::new(self.options.seed, 10 + number as u64);
        let search = self.search_keeping(searcher, [from, to], checks_max, &mut rng);
        let verdict = if search.path.is_some() { "" } else { ", nothing found" };
        self.note(format!(
            "{} for leg {} ({} {}{verdict})",
            searcher.title(),
            number + 1,
            search.nodes,
            searcher.unit()
        ));
        let mut path = search.path?;
        shorten(&self.keeping(), &mut path, SHORTCUTS, &mut rng);
        Some(path)
    }
}
