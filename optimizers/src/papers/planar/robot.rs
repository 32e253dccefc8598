//! One robot: its step, its trace, and how it gets out of a trap.
//!
//! Read where algorithm 1 leaves it open: a candidate must keep the clearance; the robot stays where it is when no
//! candidate lowers the cost, and is trapped when it has gone less than a step, in a straight line, in the observed
//! number of steps since it set out or was freed (the sum of its steps, which the paper takes, never falls below one
//! step); it goes back along its own trace, which is known to be free, and forgets what it retraced.
use super::field::{Numbers, force};
use super::{Place, distance_cm};
use crate::Reading;
use taustream_arm::rng::SeededRng;

/// How a robot chooses its steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Down the potential field.
    Potential,
    /// Bacterial foraging: the best of random candidates.
    Bacteria,
    /// Foraging with virtual obstacles as an escape.
    RobustBacteria,
}

/// A mark that says: not here again. All robots know all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualObstacle {
    /// Its centre.
    pub centre_cm: Place,
    /// Which robot made it.
    pub robot: usize,
}

/// What a robot knows of the world at one step.
pub(super) struct Senses<'a> {
    pub(super) numbers: &'a Numbers,
    /// Nearest points of the obstacles in range.
    pub(super) sensed: &'a [Place],
    pub(super) virtuals: &'a [VirtualObstacle],
    /// True when a place keeps the clearance.
    pub(super) is_clear: &'a dyn Fn(Place) -> bool,
}

/// A robot on its way.
#[derive(Clone, Debug)]
pub(super) struct PlanarRobot {
    pub(super) goal: Place,
    /// The path from the start to here, without what was retraced: never empty.
    trace: Vec<Place>,
    /// Every place, a step apart.
    pub(super) path: Vec<Place>,
    /// Where the observation of this stretch begins in the path.
    observed_from: usize,
    /// How long the trace is where a retreat ends.
    returns_to: Option<usize>,
    rng: SeededRng,
}

impl PlanarRobot {
    pub(super) fn new(start: Place, goal: Place, rng: SeededRng) -> Self {
        Self { goal, trace: vec![start], path: vec![start], observed_from: 0, returns_to: None, rng }
    }

    pub(super) fn place(&self) -> Place {
        self.trace.last().copied().unwrap_or(self.goal)
    }

    pub(super) fn has_arrived(&self, numbers: &Numbers) -> bool {
        distance_cm(self.place(), self.goal) < numbers.arrived_cm
    }

    /// Takes one step, which may be to stay.
    pub(super) fn step(&mut self, rule: Rule, senses: &Senses) {
        if let Some(length) = self.returns_to {
            self.retrace(length, senses);
        } else {
            let next = match rule {
                Rule::Potential => self.down_the_field(senses),
                Rule::Bacteria | Rule::RobustBacteria => self.best_of_candidates(senses),
            };
            self.trace.extend(next);
        }
        self.path.push(self.place());
    }

    /// One step back along the trace, unless something stands there now.
    fn retrace(&mut self, length: usize, senses: &Senses) {
        if let [.., before, _] = self.trace.as_slice()
            && self.trace.len() > length
            && (senses.is_clear)(*before)
        {
            self.trace.pop();
        }
        if self.trace.len() <= length {
            self.returns_to = None;
            self.observed_from = self.path.len();
        }
    }

    fn down_the_field(&self, senses: &Senses) -> Option<Place> {
        let [x, y] = force(senses.numbers, self.place(), self.goal, senses.sensed);
        let length = x.hypot(y);
        let step = senses.numbers.step_cm / length;
        let there = [self.place()[0] + step * x, self.place()[1] + step * y];
        (length > 0.0 && length.is_finite() && (senses.is_clear)(there)).then_some(there)
    }

    /// The candidate whose cost is least, if it is less than here; of equals the one nearer to the goal.
    fn best_of_candidates(&mut self, senses: &Senses) -> Option<Place> {
        let here = self.place();
        let cost = |place| senses.numbers.cost(place, self.goal, senses.sensed, senses.virtuals);
        let mut best = (cost(here), None, distance_cm(here, self.goal));
        for _ in 0..senses.numbers.bacteria {
            // Uniform in the square, as eq. 9 has it, then of a step's length.
            let [dx, dy]: Place = std::array::from_fn(|_| self.rng.within(-1.0, 1.0));
            let share = senses.numbers.step_cm / dx.hypot(dy);
            let there = [here[0] + share * dx, here[1] + share * dy];
            if !(share.is_finite() && (senses.is_clear)(there)) {
                continue;
            }
            let (now, distance) = (cost(there), distance_cm(there, self.goal));
            if now < best.0 || (now <= best.0 && distance < best.2) {
                best = (now, Some(there), distance);
            }
        }
        best.1
    }

    /// True when it has not got away by a step for long.
    pub(super) fn is_trapped(&self, numbers: &Numbers) -> bool {
        let Some(before) = self.path.len().checked_sub(numbers.observed + 1) else { return false };
        let is_observed = self.returns_to.is_none() && before >= self.observed_from;
        is_observed && distance_cm(self.place(), self.path[before]) < numbers.step_cm
    }

    /// Turns back to the last place of the trace that is far enough, or to the start; where the virtual obstacle is.
    pub(super) fn retreat(&mut self, numbers: &Numbers) -> Place {
        let trap = self.place();
        let is_far = |place: &Place| distance_cm(trap, *place) > numbers.retreat_cm;
        let length = self.trace.iter().rposition(is_far).map_or(1, |i| i + 1);
        self.returns_to = Some(length);
        match numbers.reading {
            Reading::Corrected => trap,
            Reading::Printed => self.trace[length - 1],
        }
    }
}
