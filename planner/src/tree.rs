//! Trees of free edges: RRT-Connect, with two that grow towards each other, and the plain RRT with one.
//!
//! Source: Kuffner and `LaValle`, "RRT-Connect: An Efficient Approach to Single-Query Path Planning", ICRA 2000;
//! `LaValle`, "Rapidly-Exploring Random Trees: A New Tool for Path Planning", 1998. What poses, distances and free edges
//! are is a matter of the [`Field`] that they grow in. In the arm's [`Space`], distances between poses weigh each joint
//! with how far it can move a point of the arm, so that a step means about the same way in space for every joint.
use crate::budget::Budget;
use crate::collide::{Motion, StraightEdge, SweepRules, sweep};
use crate::rng::SeededRng;
use crate::world::World;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Longest edge, in metres of weighted distance.
const STEP_M: f64 = 0.35;
/// Least weight of a joint, so that turning a symmetrical last link is not free.
const WEIGHT_M_MIN: f64 = 0.1;
/// Most nodes of both trees; bounds memory and the linear search for the nearest.
const NODES_MAX: usize = 20_000;

/// What trees grow in.
pub trait Field {
    /// Longest edge, in the unit of [`Self::distance`].
    fn step(&self) -> f64;

    /// Distance of two poses.
    fn distance(&self, a: &JointArray, b: &JointArray) -> f64;

    /// True when the straight edge between two poses is free.
    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool;

    /// Poses that were checked so far: the measure of work that every machine agrees on.
    fn checks(&self) -> usize;

    /// True when the search has to end.
    fn is_over(&self) -> bool;

    /// A uniform pose.
    fn random_pose(&self, rng: &mut SeededRng) -> JointArray;
}

impl Field for Space<'_> {
    fn step(&self) -> f64 {
        STEP_M
    }

    fn distance(&self, a: &JointArray, b: &JointArray) -> f64 {
        self.distance_m(a, b)
    }

    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        self.is_edge_free(a, b)
    }

    fn checks(&self) -> usize {
        self.checks()
    }

    fn is_over(&self) -> bool {
        self.budget.is_over()
    }

    fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        self.random_pose(rng)
    }
}

/// How the joints count in the distance of two poses, and straight edges that are proven.
pub struct Space<'a> {
    /// The world.
    pub world: &'a World<'a>,
    /// The clock.
    pub budget: &'a Budget<'a>,
    weight_m: JointArray,
    checks: std::cell::Cell<usize>,
}

impl<'a> Space<'a> {
    /// Makes a space.
    #[must_use]
    pub fn new(world: &'a World<'a>, budget: &'a Budget<'a>) -> Self {
        let weight_m = world.reach_m().map(|r| r.max(WEIGHT_M_MIN));
        Self { world, budget, weight_m, checks: std::cell::Cell::new(0) }
    }

    /// Weighted distance of two poses.
    #[must_use]
    pub fn distance_m(&self, a: &JointArray, b: &JointArray) -> f64 {
        let joints = self.world.joints();
        let square = |j: usize| (self.weight_m[j] * (a[j] - b[j])).powi(2);
        (0..joints).map(square).sum::<f64>().sqrt()
    }

    /// True when the straight edge between two poses is proven.
    pub fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        let edge = StraightEdge { from_rad: a, to_rad: b };
        let result = sweep(self.world, &edge, [0.0, 1.0], &SweepRules::EDGE, self.budget);
        let checks = match &result {
            Ok(clearance) => clearance.checks,
            Err(blocked) => blocked.checks,
        };
        self.checks.set(self.checks.get() + checks);
        result.is_ok()
    }

    /// Poses that were checked so far: the measure of work that every machine agrees on.
    #[must_use]
    pub fn checks(&self) -> usize {
        self.checks.get()
    }

    /// Counts poses that were checked elsewhere.
    pub fn note_checks(&self, checks: usize) {
        self.checks.set(self.checks.get() + checks);
    }

    /// Weight of each joint in the distance of two poses, m/rad: never below `WEIGHT_M_MIN`.
    #[must_use]
    pub fn weights_m(&self) -> &JointArray {
        &self.weight_m
    }

    /// A pose on the straight line, at a share of the way.
    #[must_use]
    pub fn between(a: &JointArray, b: &JointArray, share: f64) -> JointArray {
        StraightEdge { from_rad: a, to_rad: b }.at(share)
    }

    /// A uniform pose inside the position limits.
    pub fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        let mut pose = [0.0; MAX_JOINTS];
        for (q, joint) in pose.iter_mut().zip(&self.world.robot().joints) {
            let [low, high] = joint.limits.position_rad;
            *q = rng.within(low, high);
        }
        pose
    }
}

/// What a search came to.
#[derive(Clone, Debug)]
pub struct Search {
    /// The path, both ends included; `None` when the budget or the clock ended the search.
    pub path: Option<Vec<JointArray>>,
    /// Nodes of all trees.
    pub nodes: usize,
}

/// One tree: poses, each with the index of its parent (the root is its own).
struct Tree {
    nodes: Vec<(JointArray, usize)>,
}

/// How far an extension got.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reached {
    Trapped,
    Advanced(usize),
    Target(usize),
}

/// Share of the random poses that are the goal, for a single tree; 5 to 10 % are usual.
const GOAL_BIAS: f64 = 0.05;

/// A search has checked its poses, grown all the nodes that it may, or was cancelled.
fn is_spent(field: &impl Field, nodes: usize, checks_end: usize) -> bool {
    field.checks() >= checks_end || nodes >= NODES_MAX || field.is_over()
}

/// Looks for a path between two free poses with one tree that grows from the start, until `checks_max` poses have been
/// checked.
///
/// Random numbers: whether the next pose is the goal, and the pose if it is not.
pub fn rrt(
    field: &impl Field,
    start_rad: &JointArray,
    goal_rad: &JointArray,
    checks_max: usize,
    rng: &mut SeededRng,
) -> Search {
    let end = field.checks().saturating_add(checks_max);
    let mut tree = Tree { nodes: vec![(*start_rad, 0)] };
    loop {
        let nodes = tree.nodes.len();
        if is_spent(field, nodes, end) {
            return Search { path: None, nodes };
        }
        let is_goal = rng.unit() < GOAL_BIAS;
        let target = if is_goal { *goal_rad } else { field.random_pose(rng) };
        let grown = tree.extend(field, &target);
        if let (true, Reached::Target(new)) = (is_goal, grown) {
            return Search { path: Some(tree.path_to(new)), nodes: tree.nodes.len() };
        }
    }
}

/// Looks for a path between two free poses with two trees until `checks_max` poses have been checked.
pub fn rrt_connect(
    field: &impl Field,
    start_rad: &JointArray,
    goal_rad: &JointArray,
    checks_max: usize,
    rng: &mut SeededRng,
) -> Search {
    let end = field.checks().saturating_add(checks_max);
    let mut from_start = Tree { nodes: vec![(*start_rad, 0)] };
    let mut from_goal = Tree { nodes: vec![(*goal_rad, 0)] };
    loop {
        let nodes = from_start.nodes.len() + from_goal.nodes.len();
        if is_spent(field, nodes, end) {
            return Search { path: None, nodes };
        }
        // The smaller one: a tree that hardly grows stands where it is narrow, and needs the samples.
        let swapped = from_goal.nodes.len() < from_start.nodes.len();
        let (growing, other) =
            if swapped { (&mut from_goal, &mut from_start) } else { (&mut from_start, &mut from_goal) };
        let target = field.random_pose(rng);
        if let Reached::Advanced(new) | Reached::Target(new) = growing.extend(field, &target) {
            let meeting = growing.nodes[new].0;
            if let Some(there) = other.connect(field, &meeting, end) {
                let (mut path, mut rest) = (growing.path_to(new), other.path_to(there));
                if swapped {
                    std::mem::swap(&mut path, &mut rest);
                }
                path.extend(rest.into_iter().rev().skip(1));
                return Search { path: Some(path), nodes };
            }
        }
    }
}

impl Tree {
    /// One step from the nearest node towards a pose.
    fn extend(&mut self, field: &impl Field, target: &JointArray) -> Reached {
        let (nearest, distance) = self.nearest(field, target);
        self.step(field, nearest, target, distance)
    }

    fn step(&mut self, field: &impl Field, from: usize, target: &JointArray, distance: f64) -> Reached {
        let reaches = distance <= field.step();
        let base = self.nodes[from].0;
        let pose = if reaches { *target } else { Space::between(&base, target, field.step() / distance) };
        if !field.is_edge_free(&base, &pose) {
            return Reached::Trapped;
        }
        self.nodes.push((pose, from));
        let new = self.nodes.len() - 1;
        if reaches { Reached::Target(new) } else { Reached::Advanced(new) }
    }

    /// Steps towards a pose until it is reached or the way is blocked.
    fn connect(&mut self, field: &impl Field, target: &JointArray, checks_end: usize) -> Option<usize> {
        let (mut from, _) = self.nearest(field, target);
        while field.checks() < checks_end && self.nodes.len() < NODES_MAX && !field.is_over() {
            let distance = field.distance(&self.nodes[from].0, target);
            match self.step(field, from, target, distance) {
                Reached::Trapped => return None,
                Reached::Advanced(new) => from = new,
                Reached::Target(new) => return Some(new),
            }
        }
        None
    }

    fn nearest(&self, field: &impl Field, target: &JointArray) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (i, (pose, _)) in self.nodes.iter().enumerate() {
            let distance = field.distance(pose, target);
            if distance < best.1 {
                best = (i, distance);
            }
        }
        best
    }

    fn path_to(&self, node: usize) -> Vec<JointArray> {
        let mut path = vec![self.nodes[node].0];
        let mut at = node;
        while at != 0 {
            at = self.nodes[at].1;
            path.push(self.nodes[at].0);
        }
        path.reverse();
        path
    }
}
