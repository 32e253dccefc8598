//! A path whose poses keep constraints: two trees, every step of which is projected into what is allowed.
//!
//! Source: Berenson, Srinivasa, Ferguson and Kuffner, "Manipulation planning on constraint manifolds", ICRA 2009 (`CBiRRT`). Edges
//! between projected poses are straight and proven, so that the path keeps the constraints between its poses too.
use super::TipRules;
use crate::budget::Budget;
use crate::rng::SeededRng;
use crate::tree::{Field, Search, Space};
use taustream_motion::JointArray;

/// Most nodes of both trees, and most steps that are tried.
const NODES_MAX: usize = 10_000;
const STEPS_MAX: usize = 60_000;
/// Share of the field's step at an allowed angle of half a radian; a narrower one needs shorter steps, by its root.
const STEP_ANGLE_RAD: f64 = 0.5;
const STEP_SHARE_MIN: f64 = 0.08;
/// A projected step counts when it comes nearer by this share of itself at least.
const PROGRESS: f64 = 0.1;

/// A field whose edges keep constraints as well.
pub(crate) struct Keeping<'f, F> {
    pub(crate) field: &'f F,
    /// `None` where poses are free.
    pub(crate) rules: Option<&'f TipRules<'f>>,
    pub(crate) budget: &'f Budget<'f>,
}

impl<F: Field> Field for Keeping<'_, F> {
    fn step(&self) -> f64 {
        self.field.step()
    }

    fn distance(&self, a: &JointArray, b: &JointArray) -> f64 {
        self.field.distance(a, b)
    }

    fn is_edge_free(&self, a: &JointArray, b: &JointArray) -> bool {
        self.rules.is_none_or(|rules| rules.keeps_edge(a, b, self.budget)) && self.field.is_edge_free(a, b)
    }

    fn checks(&self) -> usize {
        self.field.checks()
    }

    fn is_over(&self) -> bool {
        self.field.is_over()
    }

    fn random_pose(&self, rng: &mut SeededRng) -> JointArray {
        self.field.random_pose(rng)
    }
}

/// Poses, each with the index of its parent (the root is its own).
struct Tree(Vec<(JointArray, usize)>);

impl Tree {
    fn nearest(&self, field: &impl Field, pose: &JointArray) -> usize {
        let distances = self.0.iter().map(|(node, _)| field.distance(node, pose)).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    }

    fn path_to(&self, node: usize) -> Vec<JointArray> {
        let (mut path, mut at) = (vec![self.0[node].0], node);
        while at != 0 {
            at = self.0[at].1;
            path.push(self.0[at].0);
        }
        path.reverse();
        path
    }
}

/// What limits a search.
struct Limits<'l, 'a> {
    rules: &'l TipRules<'a>,
    step: f64,
    checks_end: usize,
    steps: usize,
    nodes: usize,
}

impl Limits<'_, '_> {
    fn is_spent(&self, field: &impl Field) -> bool {
        self.steps >= STEPS_MAX
            || self.nodes >= NODES_MAX
            || field.checks() >= self.checks_end
            || field.is_over()
    }
}

/// Looks for a path between two poses that keep the constraints, until `checks_max` poses have been checked.
pub(crate) fn search<F: Field>(
    rules: &TipRules,
    field: &Keeping<'_, F>,
    [start, goal]: [&JointArray; 2],
    checks_max: usize,
    rng: &mut SeededRng,
) -> Search {
    let share =
        rules.narrowest_rad().map_or(1.0, |angle| (angle / STEP_ANGLE_RAD).sqrt().clamp(STEP_SHARE_MIN, 1.0));
    let checks_end = field.checks().saturating_add(checks_max);
    let mut limits = Limits { rules, step: share * field.step(), checks_end, steps: 0, nodes: 2 };
    let (mut a, mut b) = (Tree(vec![(*start, 0)]), Tree(vec![(*goal, 0)]));
    let mut swapped = false;
    while !limits.is_spent(field) {
        let random = field.random_pose(rng);
        let reached = extend(&mut a, field, (&random, false), &mut limits);
        let meeting = a.0[reached].0;
        let there = extend(&mut b, field, (&meeting, true), &mut limits);
        if field.distance(&b.0[there].0, &meeting) <= 0.0 {
            let (mut path, mut rest) = (a.path_to(reached), b.path_to(there));
            if swapped {
                std::mem::swap(&mut path, &mut rest);
            }
            path.extend(rest.into_iter().rev().skip(1));
            return Search { path: Some(path), nodes: limits.nodes };
        }
        std::mem::swap(&mut a, &mut b);
        swapped = !swapped;
    }
    Search { path: None, nodes: limits.nodes }
}

/// Steps from the nearest node towards a pose, as far as they come nearer; the last node. `keeps`: the pose keeps the constraints.
fn extend<F: Field>(
    tree: &mut Tree,
    field: &Keeping<'_, F>,
    (target, keeps): (&JointArray, bool),
    limits: &mut Limits,
) -> usize {
    let mut at = tree.nearest(field, target);
    while !limits.is_spent(field) {
        let from = tree.0[at].0;
        let distance = field.distance(&from, target);
        if distance <= 0.0 {
            break;
        }
        limits.steps += 1;
        let is_last = distance <= limits.step;
        let ahead = if is_last { *target } else { Space::between(&from, target, limits.step / distance) };
        let projected = if is_last && keeps { Some(ahead) } else { limits.rules.project(&ahead, None) };
        let Some(pose) = projected else { break };
        let comes_nearer = field.distance(&pose, target) <= distance - PROGRESS * limits.step.min(distance);
        // A projection that leads far away is another branch of poses.
        let is_near = field.distance(&from, &pose) <= 2.0 * limits.step;
        if !(comes_nearer && is_near && field.is_edge_free(&from, &pose)) {
            break;
        }
        tree.0.push((pose, at));
        limits.nodes += 1;
        at = tree.0.len() - 1;
    }
    at
}

impl TipRules<'_> {
    /// The allowed angle; `None` where it is free.
    fn narrowest_rad(&self) -> Option<f64> {
        self.asked.upright.map(|upright| upright.tolerance_rad)
    }
}
