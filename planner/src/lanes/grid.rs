//! Which obstacles are near a box in space: a tree of boxes.
use super::rounding::{down, up};
use parry3d_f64::math::Vector;

/// Obstacles of a leaf.
const LEAF: usize = 8;

/// A box with edges along the axes, rounded outwards.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) low: [f32; 3],
    pub(super) high: [f32; 3],
}

impl Bounds {
    const NONE: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// Around a point.
    pub(super) fn around(centre: Vector, half: Vector) -> Self {
        Self { low: (centre - half).to_array().map(down), high: (centre + half).to_array().map(up) }
    }

    fn join(&mut self, other: &Self) {
        for k in 0..3 {
            self.low[k] = self.low[k].min(other.low[k]);
            self.high[k] = self.high[k].max(other.high[k]);
        }
    }

    fn meets(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }
}

struct Node {
    bounds: Bounds,
    /// In a leaf, its obstacles in `order`; in a branch the first is the index of the second child, whose sibling is the next node.
    first: u32,
    /// 0 in a branch.
    count: u32,
}

/// The tree.
pub(super) struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
    bounds: Vec<Bounds>,
}

impl Tree {
    /// Builds a tree by halves along the longest edge.
    pub(super) fn new(bounds: Vec<Bounds>) -> Self {
        let order = (0..u32::try_from(bounds.len()).unwrap_or(u32::MAX)).collect();
        let mut tree = Self { nodes: Vec::new(), order, bounds };
        if !tree.order.is_empty() {
            tree.build(0, tree.order.len());
        }
        tree
    }

    fn build(&mut self, from: usize, to: usize) {
        let mut all = Bounds::NONE;
        for i in &self.order[from..to] {
            all.join(&self.bounds[*i as usize]);
        }
        let node = self.nodes.len();
        let index = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        self.nodes.push(Node { bounds: all, first: index(from), count: index(to - from) });
        if to - from <= LEAF {
            return;
        }
        let edge = |k: usize| all.high[k] - all.low[k];
        let axis = (1..3).fold(0, |longest, k| if edge(k) > edge(longest) { k } else { longest });
        let middle = usize::midpoint(from, to);
        let bounds = &self.bounds;
        let place = |i: &u32| {
            let b = &bounds[*i as usize];
            b.low[axis] + b.high[axis]
        };
        self.order[from..to]
            .select_nth_unstable_by(middle - from, |a, b| place(a).total_cmp(&place(b)).then(a.cmp(b)));
        self.build(from, middle);
        let second = self.nodes.len();
        self.build(middle, to);
        self.nodes[node].first = index(second);
        self.nodes[node].count = 0;
    }

    /// Writes down which obstacles' boxes meet a box.
    pub(super) fn near(&self, region: &Bounds, near: &mut Vec<u32>) {
        near.clear();
        let mut open = [0_u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = open[depth];
            let node = &self.nodes[index as usize];
            if !node.bounds.meets(region) {
                continue;
            }
            if node.count == 0 {
                open[depth] = node.first;
                open[depth + 1] = index + 1;
                depth += 2;
            } else {
                let leaf = &self.order[node.first as usize..(node.first + node.count) as usize];
                near.extend(leaf.iter().filter(|i| self.bounds[**i as usize].meets(region)));
            }
        }
    }
}
