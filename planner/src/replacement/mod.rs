//! Replacing a running motion from a cut on.
//!
//! The strokes that have begun at the cut run on, bit by bit as they are; the others are dropped and new ones are added. The
//! sum is C3 whatever the new ones are, but not inside the limits: pending strokes of a train cancel running ones, so
//! dropping them alone takes several times the acceleration and jerk that the arm may use. The weights of the new strokes
//! are therefore fitted so that kept and new ones *together* follow a time-optimal reference (`reference`), and are
//! projected into the limits (`fit`). The duration is raised in steps until the sum fits.
//!
//! Everything here is a pure function of its arguments. What it returns holds the motion limits at closely spaced instants;
//! [`crate::verify()`] proves the rest, positions and clearance included.
mod basis;
mod cut;
mod factor;
mod fit;
mod reference;

use basis::{Instants, Slot, Widths, continued, slots};
use cut::{AllRates, Cut};
use factor::Factor;
use fit::{Fine, Problem, Rates, System};
use reference::Optimum;
use std::cell::OnceCell;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory};

/// Joints that are fitted together.
const LANES: usize = 4;
/// Share of the limits that the fit uses.
const MARGIN: f64 = 0.998;
/// Share of the limits that no checked instant exceeds. The difference to 1 covers what lies between them.
const CEILING: f64 = 0.9997;
/// Durations that are tried, over the least one.
const DURATIONS: [f64; 15] =
    [1.07, 1.1, 1.15, 1.22, 1.27, 1.32, 1.38, 1.44, 1.5, 1.6, 1.8, 2.05, 2.3, 3.2, 5.0];
/// Above this duration, over the least one, what is found is tried once more halfway to the duration that failed before.
const HALVED: f64 = 1.25;
/// Width of the first strokes over that of the kept ones ..
const FIRST: f64 = 0.5;
/// Width of the last strokes over the duration; the first ones are not narrower for that.
const LAST: f64 = 0.1;
/// The reference departs from the running motion this part of the first width after the cut ..
const LEAD: f64 = 0.15;
/// .. and rests this part of the last width before the end.
const TAIL: f64 = 0.25;
/// Shortest replacement (s): its narrowest strokes are longer than the shortest that there are.
const DURATION_S_MIN: f64 = 0.02;

/// The motion that keeps the strokes that have begun at `cut_s` (`start_s < cut_s`), and ends at rest at `goal_rad`, as soon
/// as it can inside the motion limits.
///
/// Nothing when the running motion is not inside these limits itself, when an argument is no number, or when the strokes
/// do not fit into a message.
#[must_use]
pub fn replacement(
    running: &Trajectory,
    cut_s: f64,
    goal_rad: &JointArray,
    limits: &[JointLimits; MAX_JOINTS],
) -> Option<Trajectory> {
    let cut = Cut::new(running, cut_s, limits)?;
    if !goal_rad.iter().all(|goal| goal.is_finite()) {
        return None;
    }
    let direct = search(&cut, Some(goal_rad), f64::INFINITY);
    // Soon after the start of a motion the other way, coming to rest first may be quicker than turning in motion.
    let below_s = direct.as_ref().map_or(f64::INFINITY, Trajectory::duration_s);
    rest_first(&cut, goal_rad, below_s).or(direct)
}

/// The motion that keeps the strokes that have begun at `cut_s` (`start_s < cut_s`), and comes to rest as soon as it can
/// inside the motion limits, near the path of the running motion. Where none is quicker, the running motion itself.
///
/// Nothing when an argument is no number.
#[must_use]
pub fn to_rest(running: &Trajectory, cut_s: f64, limits: &[JointLimits; MAX_JOINTS]) -> Option<Trajectory> {
    let cut = Cut::new(running, cut_s, limits)?;
    search(&cut, None, running.duration_s() - cut_s).or_else(|| Some(running.clone()))
}

/// To rest, and from there to the goal, if that ends before `below_s`.
fn rest_first(cut: &Cut, goal_rad: &JointArray, below_s: f64) -> Option<Trajectory> {
    let at_rest = to_rest(cut.running, cut.at_s, cut.limits)?;
    let from_rest = Cut::new(&at_rest, at_rest.duration_s().max(cut.at_s), cut.limits)?;
    search(&from_rest, Some(goal_rad), below_s - from_rest.at_s)
}

/// The shortest motion found that takes less than `below_s` from the cut on.
fn search(cut: &Cut, goal_rad: Option<&JointArray>, below_s: f64) -> Option<Trajectory> {
    let mut solver = Optimum::new();
    let start = cut.running.sample(cut.at_s);
    let mut joints: Vec<(usize, f64)> = Vec::new();
    for joint in 0..cut.joints() {
        let task = cut.task(&start, joint, goal_rad);
        joints.push((joint, solver.duration_s(&task, &cut.limits[joint].motion)?));
    }
    // The slowest joints first: they decide.
    joints.sort_by(|a, b| b.1.total_cmp(&a.1));
    let (slowest, least_s) = *joints.first()?;
    let joints: Vec<usize> = joints.into_iter().map(|(joint, _)| joint).collect();
    let least_s = least_s.max(DURATION_S_MIN);
    let mut fit = |duration_s: f64| {
        Pattern::ALL.iter().find_map(|pattern| {
            let attempt = Attempt::new(cut, (duration_s, *pattern), slowest)?;
            attempt.fit(&mut solver, &joints, goal_rad)
        })
    };
    let mut failed_s = 0.0;
    for factor in DURATIONS {
        let duration_s = (factor * least_s).max(cut.kept_end_s);
        if duration_s >= below_s {
            break;
        }
        if let Some(found) = fit(duration_s) {
            let halved_s = if factor > HALVED { 0.5 * (failed_s + duration_s) } else { duration_s };
            return if halved_s < duration_s { fit(halved_s).or(Some(found)) } else { Some(found) };
        }
        failed_s = duration_s;
    }
    None
}

/// Where new strokes begin.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pattern {
    /// Narrower ones from the cut on: they turn the motion soonest.
    Fresh,
    /// The places of dropped ones first: they complete what the kept ones are a part of.
    Continued,
}

impl Pattern {
    const ALL: [Self; 2] = [Self::Fresh, Self::Continued];

    /// Width of the widest strokes over the duration.
    const fn middle(self) -> f64 {
        match self {
            Self::Fresh => 0.25,
            Self::Continued => 0.18,
        }
    }
}

/// One duration.
struct Attempt<'a> {
    cut: &'a Cut<'a>,
    widths: Widths,
    slots: Vec<Slot>,
    system: System,
    /// What the kept strokes do at the fitted instants.
    kept: Vec<AllRates>,
    /// The checked instants, and what the kept strokes do there.
    checked: OnceCell<(Instants, Vec<AllRates>)>,
    /// Until when they are closer to each other, after the cut.
    fine_until_s: f64,
}

impl<'a> Attempt<'a> {
    /// Nothing when there would be too many strokes, or when a pattern has nothing to continue.
    fn new(cut: &'a Cut<'a>, (duration_s, pattern): (f64, Pattern), slowest: usize) -> Option<Self> {
        let (middle_s, last_s) = (pattern.middle() * duration_s, LAST * duration_s);
        // Narrower than what they have to cancel, but not narrower each time that a replacement is replaced.
        let first_s = cut.kernel_s.min((FIRST * cut.kernel_s).max(last_s)).min(middle_s);
        let continued = match pattern {
            Pattern::Fresh => Vec::new(),
            Pattern::Continued => continued(cut.dropped, cut.at_s, duration_s),
        };
        if pattern == Pattern::Continued && continued.is_empty() {
            return None;
        }
        let first_s = continued.first().map_or(first_s, |slot| slot.width_s);
        let widths = Widths { duration_s, first_s, middle_s, last_s };
        // Strokes made elsewhere may end more steeply than ours.
        let fine_until_s =
            continued.last().map_or(0.0, |slot| slot.start_s + slot.width_s).max(cut.kept_end_s);
        let slots = slots(continued, &widths).filter(|slots| cut.kept.len() + slots.len() <= MAX_STROKES)?;
        let instants = Instants::fitted(&slots);
        let motion = cut.limits[slowest].motion;
        let weights = [motion.velocity_rad_s, motion.acceleration_rad_s2, motion.jerk_rad_s3]
            .map(|limit| 1.0 / (limit * limit));
        let factor = Factor::new(&instants, slots.len(), weights)?;
        let kept = cut.kept_rates(&instants.times_s);
        let system = System { instants, factor, weights, count: slots.len() };
        Some(Self { cut, widths, slots, system, kept, checked: OnceCell::new(), fine_until_s })
    }

    fn fit(
        &self,
        solver: &mut Optimum,
        joints: &[usize],
        goal_rad: Option<&JointArray>,
    ) -> Option<Trajectory> {
        let mut strokes: Vec<Stroke> = self.cut.kept.to_vec();
        strokes.extend(self.slots.iter().map(|slot| Stroke {
            start_s: self.cut.at_s + slot.start_s,
            duration_s: slot.width_s,
            n: slot.n,
            delta_rad: [0.0; MAX_JOINTS],
        }));
        let new = self.cut.kept.len();
        for joints in joints.chunks(LANES) {
            let mut problem = self.problem(solver, joints, goal_rad)?;
            let weights = self.system.solve(&mut problem, &|| self.fine(joints))?;
            for (stroke, weight) in strokes.iter_mut().skip(new).zip(&weights) {
                for (joint, weight) in joints.iter().zip(weight) {
                    stroke.delta_rad[*joint] = *weight;
                }
            }
        }
        if let Some(goal_rad) = goal_rad {
            end_at(self.cut.running.base_rad(), &mut strokes, new + self.slots.len() / 2, goal_rad);
        }
        let found = Trajectory::new(self.cut.joints(), *self.cut.running.base_rad(), &strokes).ok()?;
        self.cut.holds_range(&found, self.widths.duration_s).then_some(found)
    }

    fn problem(
        &self,
        solver: &mut Optimum,
        joints: &[usize],
        goal_rad: Option<&JointArray>,
    ) -> Option<Problem> {
        let times_s = &self.system.instants.times_s;
        let sum_rad = goal_rad.map(|goal_rad| {
            let mut sum_rad = [0.0; LANES];
            for (sum_rad, joint) in sum_rad.iter_mut().zip(joints) {
                *sum_rad = goal_rad[*joint] - self.cut.kept_end_rad[*joint];
            }
            sum_rad
        });
        Some(Problem {
            kept: picked(&self.kept, joints),
            reference: self.reference(solver, joints, goal_rad)?,
            bounds: self.cut.bounds(joints, times_s, self.widths.first_s, MARGIN),
            sum_rad,
        })
    }

    /// What is checked of some joints.
    fn fine(&self, joints: &[usize]) -> Fine<'_> {
        let (instants, kept) = self.checked.get_or_init(|| {
            let instants = &self.system.instants;
            let checked = instants.checked(&self.slots, self.widths.duration_s, self.fine_until_s);
            let kept = self.cut.kept_rates(&checked.times_s);
            (checked, kept)
        });
        let ceilings = self.cut.bounds(joints, &instants.times_s, self.widths.first_s, CEILING);
        Fine { instants, kept: picked(kept, joints), ceilings }
    }

    /// The running motion for a moment, then a time-optimal one under lower limits, then rest.
    fn reference(
        &self,
        solver: &mut Optimum,
        joints: &[usize],
        goal_rad: Option<&JointArray>,
    ) -> Option<Vec<Rates>> {
        let (cut, widths) = (self.cut, &self.widths);
        let lead_s = LEAD * widths.first_s;
        let rest_s = widths.duration_s - TAIL * widths.last_s;
        let instants = &self.system.instants.times_s;
        let mut reference = vec![[[0.0; LANES]; 3]; instants.len()];
        let departs = cut.running.sample(cut.at_s + lead_s);
        let led = instants.partition_point(|after_s| *after_s <= lead_s);
        for (rates, after_s) in reference.iter_mut().zip(instants).take(led) {
            let now = cut.running.sample(cut.at_s + after_s);
            let now = [now.velocity_rad_s, now.acceleration_rad_s2, now.jerk_rad_s3];
            for (rates, now) in rates.iter_mut().zip(now) {
                for (rate, joint) in rates.iter_mut().zip(joints) {
                    *rate = now[*joint];
                }
            }
        }
        for (lane, joint) in joints.iter().enumerate() {
            let task = cut.task(&departs, *joint, goal_rad);
            solver.slow_down(&task, &cut.limits[*joint].motion, rest_s - lead_s)?;
            for (rates, after_s) in reference.iter_mut().zip(instants).skip(led) {
                for (rates, now) in rates.iter_mut().zip(solver.rates(after_s - lead_s)) {
                    rates[lane] = now;
                }
            }
        }
        Some(reference)
    }
}

/// The rates of some joints.
fn picked(all: &[AllRates], joints: &[usize]) -> Vec<Rates> {
    let pick = |rates: &AllRates| {
        let mut picked = [[0.0; LANES]; 3];
        for (picked, rates) in picked.iter_mut().zip(rates) {
            for (picked, joint) in picked.iter_mut().zip(joints) {
                *picked = rates[*joint];
            }
        }
        picked
    };
    all.iter().map(pick).collect()
}

/// Moves the last rounding errors into one stroke, so that the sum in the order of the strokes ends at the goal.
pub(crate) fn end_at(base_rad: &JointArray, strokes: &mut [Stroke], into: usize, goal_rad: &JointArray) {
    for _ in 0..2 {
        let mut off_rad = *goal_rad;
        let mut end_rad = *base_rad;
        for stroke in strokes.iter() {
            for (end, delta) in end_rad.iter_mut().zip(&stroke.delta_rad) {
                *end += delta;
            }
        }
        for (off, end) in off_rad.iter_mut().zip(&end_rad) {
            *off -= end;
        }
        if let Some(stroke) = strokes.get_mut(into) {
            for (delta, off) in stroke.delta_rad.iter_mut().zip(&off_rad) {
                *delta += off;
            }
        }
    }
}
