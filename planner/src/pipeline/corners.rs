//! Rounding the corners of a path, as far as that is free.
use super::{Pipeline, SLOWER, SLOWER_TRIES};
use crate::objective::Objective;
use crate::plan::Blend;
use crate::timing::Timed;
use taustream_motion::JointArray;
use taustream_motion::limits::{Quantity, check_motion};

/// How far from its corners a motion may pass, widest first (rad, length of the difference of all joints).
const BLENDS_RAD: [f64; 4] = [0.4, 0.15, 0.05, 0.015];
/// A path that is estimated to take this many times as long as the best one is not timed.
const HOPELESS: f64 = 1.1;
/// A motion that is longer than the best one by more than this factor is not improved.
const PROMISING: f64 = 1.15;

impl Pipeline<'_> {
    /// Rounds the corners of a path as far as that is free, and proves the motion; stops at them where nothing else is.
    ///
    /// The widest blend of all corners that is free is proven at once; then one corner after the other gets a wider one, since
    /// a tight one must not hold back the rest.
    pub(super) fn round(&mut self, path: &[JointArray], source: &str) {
        let estimate_s = self.estimate_s(path);
        if self.best_s().is_finite() && estimate_s > HOPELESS * self.least_estimate_s {
            return;
        }
        self.least_estimate_s = estimate_s.min(self.least_estimate_s);
        let whole = self.whole_path(path);
        let widths_rad = self.blends_rad();
        let mut left = self.stage_budgets.timings;
        let found = self.widest(&whole, &widths_rad, &mut left);
        let is_proven = found.as_ref().is_some_and(|(_, timed)| self.prove_rounded(&whole, timed, source));
        match found {
            Some((width, timed)) if is_proven => {
                if timed.trajectory.duration_s() <= PROMISING * self.best_s()
                    && let Some(wider) = self.widened(&whole, &widths_rad[..=width], (timed, left))
                {
                    self.prove_rounded(&whole, &wider, source);
                }
            }
            Some(_) | None if self.best_s().is_infinite() => self.propose(path, source),
            Some(_) | None => {}
        }
    }

    fn prove_rounded(&mut self, whole: &[JointArray], timed: &Timed, source: &str) -> bool {
        let (corners, at_most_rad) = (whole.len().saturating_sub(2), timed.deviation_rad);
        self.prove(timed, &format!("{source}, {corners} corners rounded by at most {at_most_rad:.3} rad"))
    }

    /// Duration of the best motion so far; without limit where duration is not what counts.
    fn best_s(&self) -> f64 {
        let by_time = self.best.as_ref().filter(|_| self.evaluator.objective == Objective::Time);
        by_time.map_or(f64::INFINITY, |best| best.proof.duration_s)
    }

    /// A motion with such blends, if it is free and about as short as requested.
    fn attempt(
        &self,
        whole: &[JointArray],
        blends_rad: &[f64],
        (left, most_s): (&mut usize, f64),
    ) -> Option<Timed> {
        *left = left.checked_sub(1)?;
        if self.space.budget.is_over() {
            return None;
        }
        let timed = self.within_limits(self.path(whole).rounded(blends_rad, most_s)?)?;
        self.keeps_apart(&timed.trajectory).then_some(timed)
    }

    /// The widest blend of all corners that is free, by its number.
    fn widest(&self, whole: &[JointArray], widths_rad: &[f64], left: &mut usize) -> Option<(usize, Timed)> {
        let corners = whole.len().saturating_sub(2);
        let most_s = PROMISING * self.best_s();
        widths_rad.iter().enumerate().find_map(|(width, blend_rad)| {
            self.attempt(whole, &vec![*blend_rad; corners], (left, most_s)).map(|timed| (width, timed))
        })
    }

    /// A shorter motion, where single corners have wider blends than the last of the given ones, which all have.
    fn widened(&self, whole: &[JointArray], widths_rad: &[f64], from: (Timed, usize)) -> Option<Timed> {
        let ((mut best, mut left), mut is_shorter) = (from, false);
        let (all_rad, wider_rad) = widths_rad.split_last()?;
        let corners = whole.len().saturating_sub(2);
        let mut blends_rad = vec![*all_rad; corners];
        for wider in wider_rad.iter().rev() {
            for corner in 0..corners {
                let narrow = std::mem::replace(&mut blends_rad[corner], *wider);
                let most_s = best.trajectory.duration_s();
                match self.attempt(whole, &blends_rad, (&mut left, most_s)) {
                    Some(timed) if timed.trajectory.duration_s() < best.trajectory.duration_s() => {
                        (best, is_shorter) = (timed, true);
                    }
                    Some(_) | None => blends_rad[corner] = narrow,
                }
            }
        }
        is_shorter.then_some(best)
    }

    /// A motion that is proven to keep the limits, a little slower if its peaks were met between samples; `None` when a
    /// position limit is in the way.
    fn within_limits(&self, mut timed: Timed) -> Option<Timed> {
        for _ in 0..SLOWER_TRIES {
            match check_motion(&timed.trajectory, &self.limits) {
                Ok(_) => return Some(timed),
                Err(violation) if violation.quantity == Quantity::Position => return None,
                Err(_) => timed = timed.slower(SLOWER)?,
            }
        }
        None
    }

    /// How far from its corners a motion may pass, widest first (rad); empty when it has to stop at them.
    fn blends_rad(&self) -> Vec<f64> {
        let most_rad = match self.options.blend {
            Blend::Clearance => BLENDS_RAD[0],
            Blend::Radians(most_rad) => most_rad,
            Blend::Metres(most_m) => {
                // No point goes farther than each joint's change times its longest lever, all added up.
                let levers_m = self.space.world.reach_m().iter().map(|lever| lever * lever).sum::<f64>();
                most_m / levers_m.sqrt()
            }
        };
        let is_usable = most_rad.is_finite() && most_rad > 0.0;
        let shares = BLENDS_RAD.iter().map(|blend_rad| blend_rad / BLENDS_RAD[0]);
        if is_usable { shares.map(|share| share * most_rad).collect() } else { Vec::new() }
    }
}
