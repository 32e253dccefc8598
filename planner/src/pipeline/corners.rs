//! Rounding the corners of a path, as far as that is free.
use super::Pipeline;
use crate::collide::{Course, Motion};
use crate::lanes::Lanes;
use crate::objective::Objective;
use crate::timing::{Path, Timed, distance};
use crate::tree::Space;
use crate::world::World;
use taustream_messages::way_points::Blend;
use taustream_motion::{JointArray, Trajectory};

/// How far from its corners a motion may pass, widest first (rad, length of the difference of all joints).
const BLENDS_RAD: [f64; 4] = [0.4, 0.15, 0.05, 0.015];
/// A path that is estimated to take this many times as long as the best one is not timed.
const HOPELESS: f64 = 1.1;
/// A motion that is longer than the best one by more than this factor is not looked for.
const PROMISING: f64 = 1.15;
/// Share of a blend that a motion makes use of at its corner, about.
const USED: f64 = 0.7;
/// Share of a segment that a corner takes at most.
const REACH: f64 = 0.45;
/// Poses at which a rounded corner is looked at before it is timed.
const CORNER_POSES: u32 = 9;
/// Instants a second at which a timed motion is looked at before it is proven.
const INSTANTS_A_SECOND: f64 = 120.0;
/// What it keeps beyond the margin at them (m).
const INSTANTS_EXTRA_M: f64 = 1e-4;
/// Most of them.
const INSTANTS_MAX: f64 = 4_000.0;

/// The blend of each corner, by its number among the widths.
struct Blends<'a> {
    widths_rad: &'a [f64],
    /// One a corner.
    levels: Vec<usize>,
}

impl Blends<'_> {
    fn radians(&self) -> Vec<f64> {
        self.levels.iter().filter_map(|level| self.widths_rad.get(*level).copied()).collect()
    }

    /// Makes a corner tighter; false when it is as tight as any.
    fn tighten(&mut self, corner: usize) -> bool {
        let most = self.widths_rad.len().saturating_sub(1);
        match self.levels.get_mut(corner) {
            Some(level) if *level < most => {
                *level += 1;
                true
            }
            Some(_) | None => false,
        }
    }

    fn tighten_all(&mut self) -> bool {
        (0..self.levels.len()).fold(false, |any, corner| self.tighten(corner) | any)
    }
}

impl Pipeline<'_> {
    /// Rounds the corners of a path as far as that is free, and proves the motion; stops at them where nothing else is.
    ///
    /// Each corner begins with the widest blend that is free where it is rounded. What is timed is looked at again, as it
    /// need not be as wide as its blends, nor as narrow between the corners; where it is in the way, the nearest corner gets a tighter blend.
    pub(super) fn round(&mut self, path: &[JointArray], source: &str, lanes: Option<&Lanes>) {
        let estimate_s = self.estimate_s(path);
        if self.best_s().is_finite() && estimate_s > HOPELESS * self.least_estimate_s {
            return;
        }
        self.least_estimate_s = estimate_s.min(self.least_estimate_s);
        let whole = self.whole_path(path);
        let own;
        let lanes = if let Some(lanes) = lanes {
            lanes
        } else {
            own = Lanes::new(self.space.world);
            &own
        };
        if !self.round_whole(&whole, source, lanes) && self.best.is_none() {
            self.propose(path, source);
        }
    }

    /// True when a rounded motion is proven.
    fn round_whole(&mut self, whole: &[JointArray], source: &str, lanes: &Lanes) -> bool {
        let widths_rad = blends_rad(self.options.blend, self.space.world);
        let corners = whole.len().saturating_sub(2);
        if widths_rad.is_empty() || corners == 0 {
            return false;
        }
        let level = |corner: usize| {
            let is_free = |width: &f64| {
                let poses_rad = rounded(whole, corner, *width);
                lanes.are_free(&poses_rad, 0.0) && self.first_violating(&poses_rad).is_none()
            };
            widths_rad.iter().position(is_free).unwrap_or(widths_rad.len() - 1)
        };
        let mut blends = Blends { widths_rad: &widths_rad, levels: (0..corners).map(level).collect() };
        for _ in 0..self.stage_budgets.timings {
            if self.space.budget.is_over() {
                return false;
            }
            let most_s = PROMISING * self.best_s();
            let timed = self.timed(whole, &|path: &Path| path.rounded(&blends.radians(), most_s));
            let tightened = match timed {
                None => blends.tighten_all(),
                Some(timed) => match self.in_the_way(&timed.trajectory, lanes) {
                    Some(pose_rad) => {
                        let apart = |i: &usize| distance(&whole[*i], &pose_rad);
                        let nearest = (1..=corners).min_by(|i, j| apart(i).total_cmp(&apart(j)));
                        nearest.is_some_and(|i| blends.tighten(i - 1)) || blends.tighten_all()
                    }
                    None if self.prove_rounded(corners, &timed, source) => return true,
                    None => blends.tighten_all(),
                },
            };
            if !tightened {
                return false;
            }
        }
        false
    }

    /// The first sampled pose of a motion that is not free.
    fn in_the_way(&self, motion: &Trajectory, lanes: &Lanes) -> Option<JointArray> {
        if self.margin_exit.is_some() {
            // Another world counts at first.
            return if self.keeps_apart(motion) { None } else { Some(*motion.base_rad()) };
        }
        let duration_s = motion.duration_s();
        let instants = (duration_s * INSTANTS_A_SECOND).ceil().clamp(1.0, INSTANTS_MAX);
        let (course, mut poses_rad) = (Course::new(motion), Vec::new());
        let mut i = 1.0;
        while i < instants {
            poses_rad.push(course.at(duration_s * i / instants));
            i += 1.0;
        }
        self.space.note_checks(poses_rad.len());
        if let Some(first) = self.first_violating(&poses_rad) {
            return poses_rad.get(first).copied();
        }
        lanes.first_blocked(&poses_rad, INSTANTS_EXTRA_M).map(|i| poses_rad[i])
    }

    fn prove_rounded(&mut self, corners: usize, timed: &Timed, source: &str) -> bool {
        let (at_most_rad, unit) = (timed.deviation_rad, self.space.world.robot().travel_unit());
        self.prove(timed, &format!("{source}, {corners} corners rounded by at most {at_most_rad:.3} {unit}"))
    }

    /// Duration of the best motion so far; without limit where duration is not what counts.
    fn best_s(&self) -> f64 {
        let by_time = self.best.as_ref().filter(|_| self.evaluator.objective == Objective::Time);
        by_time.map_or(f64::INFINITY, |best| best.proof.duration_s)
    }
}

/// How far from its corners a motion may pass, widest first (rad); empty when it has to stop at them.
pub(crate) fn blends_rad(blend: Blend, world: &World) -> Vec<f64> {
    let most_rad = match blend {
        Blend::Clearance => BLENDS_RAD[0],
        Blend::Radians(most_rad) => most_rad,
        Blend::Metres(most_m) => {
            // No point goes farther than each joint's change times its longest lever, all added up.
            let levers_m = world.reach_m().iter().map(|lever| lever * lever).sum::<f64>();
            most_m / levers_m.sqrt()
        }
    };
    let is_usable = most_rad.is_finite() && most_rad > 0.0;
    let shares = BLENDS_RAD.iter().map(|blend_rad| blend_rad / BLENDS_RAD[0]);
    if is_usable { shares.map(|share| share * most_rad).collect() } else { Vec::new() }
}

/// Poses of a corner that is rounded by a blend, about as a motion does: on a parabola through both of its segments.
fn rounded(whole: &[JointArray], corner: usize, blend_rad: f64) -> Vec<JointArray> {
    let (before, at, after) = (&whole[corner], &whole[corner + 1], &whole[corner + 2]);
    let (to_rad, from_rad) = (distance(before, at), distance(at, after));
    let turn = (0..at.len()).map(|j| {
        let (u, v) = ((before[j] - at[j]) / to_rad, (after[j] - at[j]) / from_rad);
        (u + v) * (u + v)
    });
    // The parabola between two points at this length from the corner passes it at a quarter of that times the turn.
    let turn = turn.sum::<f64>().sqrt();
    let length_rad = (4.0 * USED * blend_rad / turn).min(REACH * to_rad.min(from_rad));
    let begin = Space::between(at, before, length_rad / to_rad);
    let end = Space::between(at, after, length_rad / from_rad);
    let pose = |i: u32| {
        let share = f64::from(i) / f64::from(CORNER_POSES - 1);
        Space::between(&Space::between(&begin, at, share), &Space::between(at, &end, share), share)
    };
    (0..CORNER_POSES).map(pose).collect()
}
