//! What the constraints of the tip change in the pipeline; nothing where there are none.
use super::Pipeline;
use crate::constraints::search::{self, Keeping};
use crate::constraints::{ConstraintViolation, TipFault, TipRules};
use crate::rng::SeededRng;
use crate::search::Searcher;
use crate::timing::{Path, Timed};
use crate::tree::{Field, Search, Space};
use crate::verify::{Proof, Violation};
use taustream_motion::{JointArray, Trajectory};

/// Timings with lower joint speeds that are tried for a tip that is too fast.
const TIMINGS: usize = 4;
/// A tip that uses this share of its speed limit is fast enough.
const FAST_ENOUGH: f64 = 0.97;

/// True for a tip that is too fast: a slower motion keeps its path.
pub(super) fn is_too_fast(violation: &Violation) -> bool {
    use ConstraintViolation::{Broken, Unresolved};
    matches!(
        violation,
        Violation::Constraint(Broken { fault: TipFault::Fast { .. }, .. } | Unresolved { .. })
    )
}

impl Pipeline<'_> {
    /// The rules of poses, where there are some.
    fn pose_rules(&self) -> Option<&TipRules<'_>> {
        self.rules.as_ref().filter(|rules| rules.are_of_poses())
    }

    /// True when a straight edge keeps what the tip must keep.
    pub(super) fn is_edge_kept(&self, from_rad: &JointArray, to_rad: &JointArray) -> bool {
        self.pose_rules().is_none_or(|rules| rules.keeps_edge(from_rad, to_rad, self.space.budget))
    }

    /// Why the straight line does not keep what the tip must keep.
    pub(super) fn violating_line(&self, line: &[JointArray]) -> Option<String> {
        let (rules, [from_rad, to_rad]) = (self.pose_rules()?, line) else { return None };
        if rules.keeps_edge(from_rad, to_rad, self.space.budget) {
            return None;
        }
        let worst = rules.worst_of_edge(from_rad, to_rad);
        Some(
            worst.map_or_else(|| "too near to a constraint of the tip".to_owned(), |fault| fault.to_string()),
        )
    }

    /// The first of some poses that violates what the tip must keep.
    pub(super) fn first_violating(&self, poses_rad: &[JointArray]) -> Option<usize> {
        self.pose_rules()?.first_violating(poses_rad)
    }

    /// The space with edges that keep what the tip must keep.
    pub(super) fn keeping(&self) -> Keeping<'_, Space<'_>> {
        self.keeping_in(&self.space)
    }

    /// The same of another field.
    pub(super) fn keeping_in<'f, F: Field>(&'f self, field: &'f F) -> Keeping<'f, F> {
        Keeping { field, rules: self.pose_rules(), budget: self.space.budget }
    }

    /// A searcher's path, or one that keeps constraints.
    pub(super) fn search_keeping(
        &self,
        searcher: Searcher,
        ends: [&JointArray; 2],
        checks_max: usize,
        rng: &mut SeededRng,
    ) -> Search {
        match self.pose_rules() {
            Some(rules) => search::search(rules, &self.keeping(), ends, checks_max, rng),
            None => searcher.search(&self.space, ends, checks_max, rng),
        }
    }

    /// A timing of a path that keeps the speed limits of the tip: with joint speeds that are lowered for it, and as much slower as
    /// is still needed.
    pub(super) fn timed(
        &self,
        corners_rad: &[JointArray],
        make: &dyn Fn(&Path) -> Option<Timed>,
    ) -> Option<Timed> {
        match self.rules.as_ref().filter(|rules| rules.limit_speeds()) {
            None => make(&self.path(corners_rad)),
            Some(rules) => self.timed_below(rules, corners_rad, make),
        }
    }

    /// A function of its own: it keeps several motions on its stack.
    #[inline(never)]
    fn timed_below(
        &self,
        rules: &TipRules,
        corners_rad: &[JointArray],
        make: &dyn Fn(&Path) -> Option<Timed>,
    ) -> Option<Timed> {
        let mut best = None::<Timed>;
        let (mut lowered, mut timed) = (1.0, make(&self.path(corners_rad))?);
        for _ in 0..TIMINGS {
            let factor = rules.slowdown(&timed.trajectory);
            let kept = if factor > 1.0 { timed.slower(factor)? } else { timed };
            let duration_s = |timed: &Timed| timed.trajectory.duration_s();
            if best.as_ref().is_none_or(|best| duration_s(&kept) < duration_s(best)) {
                best = Some(kept);
            }
            // A motion that was made fast enough at once needs no lower joint speeds.
            if factor <= 1.0 && (lowered <= 1.0 || factor >= FAST_ENOUGH) {
                break;
            }
            lowered *= factor;
            let mut limits = self.limits;
            limits.iter_mut().for_each(|joint| joint.motion.velocity_rad_s /= lowered);
            let path = Path { corners_rad, joints: self.space.world.joints(), limits: &limits };
            let Some(next) = make(&path) else { break };
            timed = next;
        }
        best
    }

    /// The proof of a motion that keeps what the tip must keep, too.
    pub(super) fn prove_rules(&self, motion: &Trajectory, proof: Proof) -> Result<Proof, Violation> {
        if let Some(rules) = &self.rules {
            rules.prove(motion, ([0.0, motion.duration_s()], &proof.peaks), self.space.budget)?;
        }
        Ok(proof)
    }
}
