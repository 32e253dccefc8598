//! Rounding the corners of a path, as far as that is free.
use super::{Pipeline, SLOWER, SLOWER_TRIES};
use crate::plan::Blend;
use crate::timing::Timed;
use taustream_motion::JointArray;
use taustream_motion::limits::{Quantity, check_motion};

/// How far from its corners a motion may pass, widest first (rad, length of the difference of all joints).
const BLENDS_RAD: [f64; 6] = [0.4, 0.2, 0.1, 0.05, 0.025, 0.01];

impl Pipeline<'_> {
    /// Rounds the corners of a path as far as that is free, and proves the motion; stops at them where nothing else is.
    pub(super) fn round(&mut self, path: &[JointArray], source: &str) {
        let whole = self.whole_path(path);
        let corners = whole.len().saturating_sub(2);
        let is_proven = self.rounded(&whole).is_some_and(|timed| {
            let at_most_rad = timed.deviation_rad;
            self.prove(
                &timed,
                &format!("{source}, {corners} corners rounded by at most {at_most_rad:.3} rad"),
            )
        });
        if !is_proven {
            self.propose(path, source);
        }
    }

    /// The widest blend of all corners that is free, then of one corner after the other: a tight one must not hold back the
    /// rest.
    fn rounded(&self, whole: &[JointArray]) -> Option<Timed> {
        let corners = whole.len().saturating_sub(2);
        let mut left = self.stage_budgets.timings;
        let mut attempt = |blends_rad: &[f64]| {
            if left == 0 || self.space.budget.is_over() {
                return None;
            }
            left -= 1;
            let timed = self.within_limits(self.path(whole).rounded(blends_rad)?)?;
            self.keeps_apart(&timed.trajectory).then_some(timed)
        };
        let widths_rad = self.blends_rad();
        let mut widths = widths_rad.iter().enumerate();
        let (width, mut best) =
            widths.find_map(|(width, rad)| attempt(&vec![*rad; corners]).map(|timed| (width, timed)))?;
        let mut blends_rad = vec![widths_rad[width]; corners];
        for wider in widths_rad[..width].iter().rev() {
            for corner in 0..corners {
                let narrow = std::mem::replace(&mut blends_rad[corner], *wider);
                match attempt(&blends_rad) {
                    Some(timed) if timed.trajectory.duration_s() < best.trajectory.duration_s() => {
                        best = timed;
                    }
                    Some(_) | None => blends_rad[corner] = narrow,
                }
            }
        }
        Some(best)
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
