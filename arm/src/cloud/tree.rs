//! Points by place: a tree of balls.
use parry3d_f64::math::Vector;
use std::ops::Range;

/// Most points of a leaf.
const LEAF: usize = 8;
/// Deeper than any tree over `u32` many points that halves them.
const DEPTH_MAX: usize = 40;

/// A ball around some points.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    centre: Vector,
    radius_m: f64,
    /// Of a leaf, its points; of a branch, `end` is 0 and `first` the second child, whose sibling is the next node.
    first: u32,
    end: u32,
}

/// Points, and balls around halves of them, halves of halves, and so on.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTree {
    points: Vec<Vector>,
    nodes: Vec<Node>,
    low: Vector,
    high: Vector,
}

impl PointTree {
    /// Sorts the points. Their coordinates must be finite, and they at most `u32::MAX` many.
    #[must_use]
    pub fn new(points: Vec<Vector>) -> Self {
        let mut tree = Self { points, nodes: Vec::new(), low: Vector::ZERO, high: Vector::ZERO };
        if !tree.points.is_empty() {
            (tree.low, tree.high) = extent(&tree.points);
            tree.nodes.reserve(tree.points.len() / 2);
            tree.build(0..tree.points.len());
        }
        tree
    }

    fn build(&mut self, range: Range<usize>) {
        let points = &mut self.points[range.clone()];
        let (low, high) = extent(points);
        let centre = 0.5 * (low + high);
        let radius_m = points.iter().map(|p| (*p - centre).length()).fold(0.0, f64::max);
        let place = |i: usize| u32::try_from(i).unwrap_or(u32::MAX);
        let here = self.nodes.len();
        self.nodes.push(Node { centre, radius_m, first: place(range.start), end: place(range.end) });
        if range.len() <= LEAF {
            return;
        }
        let edges = (high - low).to_array();
        let longest = (0..3).max_by(|a, b| edges[*a].total_cmp(&edges[*b])).unwrap_or(0);
        let half = range.len() / 2;
        points.select_nth_unstable_by(half, |p, q| p.to_array()[longest].total_cmp(&q.to_array()[longest]));
        let middle = range.start + half;
        self.build(range.start..middle);
        (self.nodes[here].first, self.nodes[here].end) = (place(self.nodes.len()), 0);
        self.build(middle..range.end);
    }

    /// The points.
    #[must_use]
    pub fn points(&self) -> &[Vector] {
        &self.points
    }

    /// Centre and half edges of the box around the points.
    #[must_use]
    pub fn bounds(&self) -> (Vector, Vector) {
        (0.5 * (self.low + self.high), 0.5 * (self.high - self.low))
    }

    /// The least of a distance over all points, if it is less than `within_m`, and the index of its point. The distance must grow by no
    /// more than a point moves, as that from any body does.
    ///
    /// Real time: no allocation.
    #[must_use]
    pub fn nearest(&self, within_m: f64, distance_m: impl Fn(Vector) -> f64) -> Option<(f64, usize)> {
        let least_m = |node: &Node| distance_m(node.centre) - node.radius_m;
        let (mut best_m, mut found) = (within_m, None);
        let mut open = [(0.0, 0_usize); DEPTH_MAX];
        let mut depth = 0;
        let mut next = self.nodes.first().map(|root| (least_m(root), 0));
        loop {
            let Some((bound_m, index)) = next.take().or_else(|| {
                depth = usize::checked_sub(depth, 1)?;
                Some(open[depth])
            }) else {
                return found.map(|point| (best_m, point));
            };
            if bound_m >= best_m {
                continue;
            }
            let node = &self.nodes[index];
            if node.end > 0 {
                let range = node.first as usize..node.end as usize;
                for (point, at) in range.clone().zip(&self.points[range]) {
                    let here_m = distance_m(*at);
                    if here_m < best_m {
                        (best_m, found) = (here_m, Some(point));
                    }
                }
                continue;
            }
            let (a, b) = (index + 1, node.first as usize);
            let (a, b) = ((least_m(&self.nodes[a]), a), (least_m(&self.nodes[b]), b));
            let (near, far) = if a.0 <= b.0 { (a, b) } else { (b, a) };
            (open[depth], depth) = (far, depth + 1);
            next = Some(near);
        }
    }
}

fn extent(points: &[Vector]) -> (Vector, Vector) {
    let first = points.first().copied().unwrap_or_default();
    points.iter().fold((first, first), |(low, high), p| (low.min(*p), high.max(*p)))
}
