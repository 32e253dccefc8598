//! RRT-Connect: two trees of proven edges that grow towards each other.
//!
//! Source: Kuffner and `LaValle`, "RRT-Connect: An Efficient Approach to Single-Query Path Planning", ICRA 2000.
//! Distances between poses weigh each joint with how far it can move a point of the arm, so that a step means about
//! the same way in space for every joint.
use crate::collide::{Motion, StraightEdge, SweepRules, sweep};
use crate::draw::Draw;
use crate::work::Work;
use crate::world::World;
use taustream_motion::{JointArray, MAX_JOINTS};

/// Longest edge, in metres of weighted distance.
const STEP_M: f64 = 0.35;
/// Least weight of a joint, so that turning a symmetrical last link is not free.
const WEIGHT_M_MIN: f64 = 0.1;
/// Most nodes of both trees; bounds memory and the linear search for the nearest.
const NODES_MAX: usize = 20_000;

/// How the joints count in the distance of two poses, and straight edges that are proven.
pub struct Space<'a> {
    /// The world.
    pub world: &'a World<'a>,
    /// The clock.
    pub work: &'a Work<'a>,
    weight_m: JointArray,
    checks: std::cell::Cell<usize>,
}

impl<'a> Space<'a> {
    /// Makes a space.
    #[must_use]
    pub fn new(world: &'a World<'a>, work: &'a Work<'a>) -> Self {
        let weight_m = world.reach_m().map(|r| r.max(WEIGHT_M_MIN));
        Self { world, work, weight_m, checks: std::cell::Cell::new(0) }
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
        let result = sweep(self.world, &edge, [0.0, 1.0], &SweepRules::EDGE, self.work);
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

    /// A pose on the straight line, at a share of the way.
    #[must_use]
    pub fn between(a: &JointArray, b: &JointArray, share: f64) -> JointArray {
        StraightEdge { from_rad: a, to_rad: b }.at(share)
    }

    /// A uniform pose inside the position limits.
    pub fn draw_pose(&self, draw: &mut Draw) -> JointArray {
        let mut pose = [0.0; MAX_JOINTS];
        for (q, joint) in pose.iter_mut().zip(&self.world.robot().joints) {
            let [low, high] = joint.limits.position_rad;
            *q = draw.within(low, high);
        }
        pose
    }
}

/// What a search came to.
#[derive(Clone, Debug)]
pub struct Search {
    /// The path, both ends included; `None` when the budget or the clock ended the search.
    pub path: Option<Vec<JointArray>>,
    /// Nodes of both trees.
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

/// Looks for a path between two free poses until `checks_max` poses have been checked.
pub fn rrt_connect(
    space: &Space,
    start_rad: &JointArray,
    goal_rad: &JointArray,
    checks_max: usize,
    draw: &mut Draw,
) -> Search {
    let end = space.checks() + checks_max;
    let mut from_start = Tree { nodes: vec![(*start_rad, 0)] };
    let mut from_goal = Tree { nodes: vec![(*goal_rad, 0)] };
    let mut swapped = false;
    loop {
        let nodes = from_start.nodes.len() + from_goal.nodes.len();
        if space.checks() >= end || nodes >= NODES_MAX || space.work.is_over() {
            return Search { path: None, nodes };
        }
        let (growing, other) =
            if swapped { (&mut from_goal, &mut from_start) } else { (&mut from_start, &mut from_goal) };
        let target = space.draw_pose(draw);
        if let Reached::Advanced(new) | Reached::Target(new) = growing.extend(space, &target) {
            let meeting = growing.nodes[new].0;
            if let Some(there) = other.connect(space, &meeting, end) {
                let (mut path, mut rest) = (growing.path_to(new), other.path_to(there));
                if swapped {
                    std::mem::swap(&mut path, &mut rest);
                }
                path.extend(rest.into_iter().rev().skip(1));
                return Search { path: Some(path), nodes };
            }
        }
        swapped = !swapped;
    }
}

impl Tree {
    /// One step from the nearest node towards a pose.
    fn extend(&mut self, space: &Space, target: &JointArray) -> Reached {
        let (nearest, distance_m) = self.nearest(space, target);
        self.step(space, nearest, target, distance_m)
    }

    fn step(&mut self, space: &Space, from: usize, target: &JointArray, distance_m: f64) -> Reached {
        let reaches = distance_m <= STEP_M;
        let base = self.nodes[from].0;
        let pose = if reaches { *target } else { Space::between(&base, target, STEP_M / distance_m) };
        if !space.is_edge_free(&base, &pose) {
            return Reached::Trapped;
        }
        self.nodes.push((pose, from));
        let new = self.nodes.len() - 1;
        if reaches { Reached::Target(new) } else { Reached::Advanced(new) }
    }

    /// Steps towards a pose until it is reached or the way is blocked.
    fn connect(&mut self, space: &Space, target: &JointArray, checks_end: usize) -> Option<usize> {
        let (mut from, _) = self.nearest(space, target);
        while space.checks() < checks_end && self.nodes.len() < NODES_MAX && !space.work.is_over() {
            let distance_m = space.distance_m(&self.nodes[from].0, target);
            match self.step(space, from, target, distance_m) {
                Reached::Trapped => return None,
                Reached::Advanced(new) => from = new,
                Reached::Target(new) => return Some(new),
            }
        }
        None
    }

    fn nearest(&self, space: &Space, target: &JointArray) -> (usize, f64) {
        let mut best = (0, f64::INFINITY);
        for (i, (pose, _)) in self.nodes.iter().enumerate() {
            let distance_m = space.distance_m(pose, target);
            if distance_m < best.1 {
                best = (i, distance_m);
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
