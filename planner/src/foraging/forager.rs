//! One search: its steps, its trace, and how it gets out of a trap.
use super::Numbers;
use crate::rng::SeededRng;
use crate::tree::Space;
use crate::world::{Pair, Snapshot};
use std::collections::VecDeque;
use taustream_motion::{JointArray, MAX_JOINTS};
use taustream_optimizers::Refusal;

/// What a search came to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Foraged {
    /// The path, both ends included, every edge of it proven; `None` when the budget or the clock ended the search.
    pub path: Option<Vec<JointArray>>,
    /// Steps, those included on which it stayed where it was.
    pub steps: usize,
    /// Where it was trapped: the virtual obstacles that it set, the dropped ones included.
    pub virtuals: Vec<JointArray>,
    /// How often it began again at the start.
    pub restarts: usize,
}

/// Looks for a path between two free poses until `checks_max` poses have been checked.
///
/// # Errors
/// When the numbers make no sense.
pub fn forage(
    space: &Space,
    [start_rad, goal_rad]: [&JointArray; 2],
    numbers: &Numbers,
    checks_max: usize,
    rng: &mut SeededRng,
) -> Result<Foraged, Refusal> {
    numbers.check()?;
    let end = space.checks().saturating_add(checks_max);
    let mut forager = Forager::new(space, [*start_rad, *goal_rad], numbers);
    let path = loop {
        if space.checks() >= end || space.budget.is_over() {
            break None;
        }
        if forager.arrives() {
            let mut path = std::mem::take(&mut forager.trace);
            path.push(*goal_rad);
            break Some(path);
        }
        forager.step(rng);
        if forager.is_trapped() {
            forager.escape();
        }
    };
    Ok(Foraged { path, ..forager.found })
}

struct Forager<'a> {
    space: &'a Space<'a>,
    start_rad: JointArray,
    goal_rad: JointArray,
    numbers: &'a Numbers,
    /// `W_g`, 1/m².
    goal_width: f64,
    /// The path from the start to here, without what was retraced: never empty.
    trace: Vec<JointArray>,
    /// The latest poses since it set out or was freed, one more than are observed.
    observed: VecDeque<JointArray>,
    /// How many of the virtual obstacles are dropped.
    forgotten: usize,
    /// True when the edge from here to the goal was tried in vain.
    is_shut: bool,
    /// The pairs that are felt here.
    felt: Vec<Pair>,
    snapshot: Snapshot,
    found: Foraged,
}

impl<'a> Forager<'a> {
    fn new(space: &'a Space<'a>, [start_rad, goal_rad]: [JointArray; 2], numbers: &'a Numbers) -> Self {
        let distance_m = space.distance_m(&start_rad, &goal_rad).max(numbers.step_m);
        Self {
            space,
            start_rad,
            goal_rad,
            numbers,
            goal_width: 1.0 / (distance_m * distance_m),
            trace: vec![start_rad],
            observed: VecDeque::from([start_rad]),
            forgotten: 0,
            is_shut: false,
            felt: Vec::new(),
            snapshot: Snapshot::default(),
            found: Foraged::default(),
        }
    }

    fn here(&self) -> JointArray {
        self.trace.last().copied().unwrap_or(self.start_rad)
    }

    /// True when the goal is near and the edge to it is proven.
    fn arrives(&mut self) -> bool {
        let here = self.here();
        if self.is_shut || self.space.distance_m(&here, &self.goal_rad) > self.numbers.arrived_m {
            return false;
        }
        let arrives = self.space.is_edge_free(&here, &self.goal_rad);
        self.is_shut = !arrives;
        arrives
    }

    /// To the cheapest of the candidates that are cheaper than here and whose edge is proven; or stays.
    fn step(&mut self, rng: &mut SeededRng) {
        let here = self.here();
        self.feel(&here);
        let cost_here = self.cost(&here);
        let mut candidates = Vec::with_capacity(self.numbers.bacteria);
        for _ in 0..self.numbers.bacteria {
            if self.space.budget.is_over_after(self.felt.len()) {
                return;
            }
            let pose = self.tumble(&here, rng);
            let cost = self.cost(&pose);
            if cost < cost_here {
                candidates.push((cost, pose));
            }
        }
        candidates.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let next = candidates.iter().find(|(_, pose)| self.space.is_edge_free(&here, pose));
        if let Some((_, pose)) = next {
            self.trace.push(*pose);
            self.is_shut = false;
        }
        self.found.steps += 1;
        self.observed.push_back(self.here());
        if self.observed.len() > self.numbers.observed + 1 {
            self.observed.pop_front();
        }
    }

    /// A pose one step away in a random direction, inside the position limits.
    fn tumble(&self, here: &JointArray, rng: &mut SeededRng) -> JointArray {
        let joints = self.space.world.joints();
        let mut pose = *here;
        let direction: [f64; MAX_JOINTS] =
            std::array::from_fn(|j| if j < joints { rng.normal() } else { 0.0 });
        let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
        let step_m = if length > 0.0 { self.numbers.step_m / length } else { 0.0 };
        let weights_m = self.space.weights_m();
        for (j, joint) in self.space.world.robot().joints.iter().enumerate() {
            let [low, high] = joint.limits.position_rad;
            pose[j] = (here[j] + step_m * direction[j] / weights_m[j]).clamp(low, high);
        }
        pose
    }

    /// Notes which pairs are in range.
    fn feel(&mut self, here: &JointArray) {
        let world = self.space.world;
        world.place(here, &mut self.snapshot);
        let (range_m, snapshot) = (self.numbers.range_m, &self.snapshot);
        let is_near = |pair: &&Pair| {
            let most_m = pair.required_m + range_m;
            world.distance_bound_m(pair, snapshot) <= most_m && world.distance_m(pair, snapshot) <= most_m
        };
        self.felt.clear();
        self.felt.extend(world.pairs().iter().filter(is_near).copied());
    }

    /// Cost of a pose (eq. 10 to 12 and 15) for what is felt.
    fn cost(&mut self, pose: &JointArray) -> f64 {
        self.space.note_checks(1);
        let (world, numbers) = (self.space.world, self.numbers);
        world.place(pose, &mut self.snapshot);
        let pushed = self.felt.iter().map(|pair| {
            let kept_m = world.distance_m(pair, &self.snapshot) - pair.required_m;
            gaussian(numbers.obstacle, kept_m.max(0.0))
        });
        let virtuals = self.found.virtuals.iter().skip(self.forgotten);
        let added = virtuals.map(|v| gaussian(numbers.virtual_obstacle, self.space.distance_m(pose, v)));
        let distance_m = self.space.distance_m(pose, &self.goal_rad);
        pushed.sum::<f64>() + added.sum::<f64>() - gaussian([numbers.goal_depth, self.goal_width], distance_m)
    }

    /// True when it has not got away by a step for long.
    fn is_trapped(&self) -> bool {
        let (Some(before), Some(now)) = (self.observed.front(), self.observed.back()) else { return false };
        let is_long = self.observed.len() > self.numbers.observed;
        (is_long && self.space.distance_m(before, now) < self.numbers.step_m)
            || self.trace.len() > self.numbers.trace_max
    }

    /// Sets a virtual obstacle and goes back to the last pose of the trace that is far enough from it, or to the
    /// start; begins again when no further one may be set.
    fn escape(&mut self) {
        let trap = self.here();
        let set = self.found.virtuals.len() - self.forgotten;
        if set < self.numbers.virtual_max && self.trace.len() <= self.numbers.trace_max {
            let is_far = |pose: &JointArray| self.space.distance_m(&trap, pose) > self.numbers.retreat_m;
            let length = self.trace.iter().rposition(is_far).map_or(1, |i| i + 1);
            self.trace.truncate(length);
            self.found.virtuals.push(trap);
        } else {
            self.trace.truncate(1);
            self.forgotten = self.found.virtuals.len();
            self.found.restarts += 1;
        }
        self.is_shut = false;
        self.observed.clear();
        self.observed.push_back(self.here());
    }
}

fn gaussian([height, width]: [f64; 2], away_m: f64) -> f64 {
    height * (-width * away_m * away_m).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::Budget;
    use crate::world::World;
    use std::path::Path;
    use taustream_arm::{Robot, Scene};

    /// A UR5 alone in the world, and what a forager does there.
    fn with_forager(numbers: &Numbers, check: impl Fn(&mut Forager, &Space)) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/robots/ur5.toml");
        let robot = Robot::load(&file).unwrap();
        let world = World::new(&robot, &Scene::default()).unwrap();
        let budget = Budget::unbounded();
        let space = Space::new(&world, &budget);
        let ends = [pose(0.0), pose(1.0)];
        check(&mut Forager::new(&space, ends, numbers), &space);
    }

    /// Stretched out and turned about the first joint, so that nothing is near anything.
    fn pose(pan_rad: f64) -> JointArray {
        let mut pose = [0.0; MAX_JOINTS];
        pose[0] = pan_rad;
        pose[1] = -1.0;
        pose
    }

    /// The formula with the numbers put in by hand: half the way is left, and the virtual obstacle is a quarter of it
    /// away. The way is as long as the first joint's weight, which is the only one that turns.
    #[test]
    fn cost_is_the_goal_and_the_virtual_obstacles() {
        let numbers = Numbers { goal_depth: 20.0, virtual_obstacle: [3.0, 4.0], ..Numbers::ROBUST };
        with_forager(&numbers, |forager, space| {
            let distance_m = space.weights_m()[0];
            let goal = -20.0 * (-0.25_f64).exp();
            assert!((forager.cost(&pose(0.5)) - goal).abs() < 1e-12);
            forager.found.virtuals.push(pose(0.25));
            let added = 3.0 * (-4.0 * (0.25 * distance_m).powi(2)).exp();
            assert!((forager.cost(&pose(0.5)) - goal - added).abs() < 1e-12);
            forager.forgotten = 1;
            assert!((forager.cost(&pose(0.5)) - goal).abs() < 1e-12, "forgotten");
        });
    }

    #[test]
    fn retreat_ends_at_the_last_pose_that_is_far_enough_and_marks_the_trap() {
        let numbers = Numbers { retreat_m: 0.5, virtual_max: 1, ..Numbers::ROBUST };
        with_forager(&numbers, |forager, space| {
            let step_rad = 0.2 / space.weights_m()[0];
            let trace: Vec<JointArray> = (0..6).map(|i| pose(f64::from(i) * step_rad)).collect();
            forager.trace.clone_from(&trace);
            forager.escape();
            // 1.0 m from the start: 0.4 m and 0.2 m back are too near, 0.6 m is far enough.
            assert_eq!(forager.trace, trace[..3]);
            assert_eq!((forager.found.virtuals.as_slice(), forager.found.restarts), (&trace[5..], 0));
            // No further one may be set: from the start again, and nothing is in the way any more.
            forager.escape();
            assert_eq!((forager.trace.as_slice(), forager.found.restarts), (&trace[..1], 1));
            assert_eq!((forager.forgotten, forager.found.virtuals.len()), (1, 1));
        });
    }

    /// A trap of which no pose of the trace is far enough, as at the very start.
    #[test]
    fn retreat_near_the_start_ends_at_the_start() {
        with_forager(&Numbers::ROBUST, |forager, _| {
            forager.trace.push(pose(0.01));
            forager.escape();
            assert_eq!(forager.trace, [pose(0.0)]);
        });
    }

    #[test]
    fn trapped_is_who_stays_within_a_step_for_the_observed_number_of_steps() {
        let numbers = Numbers { observed: 3, step_m: 0.3, ..Numbers::ROBUST };
        with_forager(&numbers, |forager, space| {
            let metre_rad = 1.0 / space.weights_m()[0];
            let mut walk = |distances_m: &[f64]| {
                forager.observed = distances_m.iter().map(|m| pose(m * metre_rad)).collect();
                forager.is_trapped()
            };
            assert!(!walk(&[0.0, 0.0, 0.0]), "not observed for long enough");
            assert!(walk(&[0.0, 0.0, 0.0, 0.0]) && walk(&[0.0, 0.3, 0.3, 0.1]));
            assert!(!walk(&[0.0, 0.3, 0.3, 0.31]));
        });
    }

    #[test]
    fn tumble_is_a_step_long_in_any_direction_and_stays_inside_the_ranges() {
        with_forager(&Numbers::ROBUST, |forager, space| {
            let mut rng = SeededRng::new(5, 0);
            let here = pose(0.0);
            let mut sum = [0.0; MAX_JOINTS];
            for _ in 0..1_000 {
                let there = forager.tumble(&here, &mut rng);
                assert!((space.distance_m(&here, &there) - Numbers::ROBUST.step_m).abs() < 1e-12);
                for (j, s) in sum.iter_mut().enumerate() {
                    *s += (there[j] - here[j]) * space.weights_m()[j] / Numbers::ROBUST.step_m;
                }
            }
            // A thousand directions cancel: their mean is about 1/sqrt(6 * 1000) long in each coordinate.
            assert!(sum.iter().all(|s| s.abs() < 70.0), "{sum:?}");
            let edge = std::array::from_fn(|j| if j < 6 { 3.1 } else { 0.0 });
            let ranges = space.world.robot().joints.iter().map(|j| j.limits.position_rad);
            let there = forager.tumble(&edge, &mut rng);
            assert!(there.iter().zip(ranges).all(|(q, [low, high])| (low..=high).contains(q)));
        });
    }
}
