//! The kernel: poses in lanes, groups of links against obstacles and each other, spheres where a group is near.
use super::Scratch;
use super::arithmetic::{Ops, Vector, Vector3};
use super::grid::Bounds;
use super::model::{Form, Group, GroupPair, Joint, Model, Obstacle};
use super::rounding::down;
use crate::collide::{Motion, StraightEdge};
use pulp::{Simd, WithSimd};
use std::f64::consts::PI;
use taustream_arm::cloud::Cloud;
use taustream_motion::{JointArray, JointKind, MAX_JOINTS, USUAL_JOINTS};

/// Most lanes of any machine.
pub(super) const LANES_MAX: usize = 16;
/// Adding and subtracting it leaves a number's whole part: 1.5 * 2^52.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// What a suspect pair is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Question {
    /// A link body, and an obstacle or link.
    Obstacle(usize, usize),
    /// Index into the world's pairs.
    Pair(usize),
}

/// A pair of bodies that may be too near in a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Suspect {
    pub(super) pose: u32,
    pub(super) question: Question,
}

/// Poses to look at.
pub(super) struct Pass<'a, P: Poses + ?Sized> {
    pub(super) model: &'a Model,
    pub(super) poses: &'a P,
    /// Kept beyond what every pair must.
    pub(super) extra_m: f64,
    pub(super) scratch: &'a mut Scratch,
}

impl<P: Poses + ?Sized> WithSimd for Pass<'_, P> {
    /// False when some pose is surely not free.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        if self.model.joints.len() <= USUAL_JOINTS {
            self.search::<S, { USUAL_JOINTS + 1 }>(simd)
        } else {
            self.search::<S, { MAX_JOINTS + 1 }>(simd)
        }
    }
}

impl<P: Poses + ?Sized> Pass<'_, P> {
    /// For arms with at most so many frames.
    #[inline(always)]
    fn search<S: Simd, const FRAMES: usize>(self, simd: S) -> bool {
        let Self { model, poses, extra_m, scratch } = self;
        let lanes = S::F32_LANES.min(LANES_MAX);
        let strides = poses.count().div_ceil(lanes);
        scratch.centres.resize(model.spheres.len() * 3 * S::F32_LANES, 0.0);
        let mut chunk = Chunk::<S, FRAMES>::new(simd, (model, extra_m));
        // Lanes are spread over the poses: what blocks an edge is met in its first chunk.
        for first in 0..strides {
            chunk.pose(poses, first, strides);
            if chunk.is_blocked(scratch) {
                return false;
            }
        }
        true
    }
}

/// Where poses come from; there is at least one.
pub(super) trait Poses {
    /// What is known of one.
    type Place: Copy;

    /// How many.
    fn count(&self) -> usize;

    /// The one of a number.
    fn place(&self, index: usize) -> Self::Place;

    /// The position of a joint there.
    fn position(&self, place: Self::Place, joint: usize) -> f64;

    /// All positions.
    fn pose(&self, index: usize) -> JointArray;
}

impl Poses for [JointArray] {
    type Place = usize;

    fn count(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn place(&self, index: usize) -> usize {
        index
    }

    #[inline(always)]
    fn position(&self, place: usize, joint: usize) -> f64 {
        self[place][joint]
    }

    fn pose(&self, index: usize) -> JointArray {
        self[index]
    }
}

/// Poses at even distances on a straight edge, its end the last of them.
pub(super) struct Along<'a> {
    pub(super) edge: StraightEdge<'a>,
    pub(super) count: usize,
}

impl Poses for Along<'_> {
    /// Share of the way.
    type Place = f64;

    fn count(&self) -> usize {
        self.count
    }

    #[inline(always)]
    fn place(&self, index: usize) -> f64 {
        (index + 1) as f64 / self.count as f64
    }

    #[inline(always)]
    fn position(&self, place: f64, joint: usize) -> f64 {
        let StraightEdge { from_rad, to_rad } = self.edge;
        from_rad[joint] + (to_rad[joint] - from_rad[joint]) * place
    }

    fn pose(&self, index: usize) -> JointArray {
        self.edge.at(self.place(index))
    }
}

/// What is left of a joint's position: half revolutions, -1 to 1, or metres.
#[inline(always)]
fn reduced(joint: &Joint, position: f64) -> f32 {
    let by = match joint.kind {
        JointKind::Revolute => {
            let halves = position * (1.0 / PI) + joint.offset;
            let whole = (halves * 0.5 + WHOLE) - WHOLE;
            halves - 2.0 * whole
        }
        JointKind::Prismatic => position + joint.offset,
    };
    #[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
    let by = by as f32;
    by
}

/// The arm in as many poses as there are lanes.
pub(super) struct Chunk<'a, S: Simd, const FRAMES: usize> {
    pub(super) ops: Ops<S>,
    pub(super) model: &'a Model,
    extra: f32,
    /// Index of the first lane's pose, from one lane's to the next, and how many poses there are.
    poses: [usize; 3],
    /// Columns and origin of each frame.
    pub(super) frames: [([Vector3<S>; 3], Vector3<S>); FRAMES],
    /// Groups whose spheres are placed, a bit each.
    placed: u64,
}

impl<'a, S: Simd, const FRAMES: usize> Chunk<'a, S, FRAMES> {
    #[inline(always)]
    pub(super) fn new(simd: S, (model, extra_m): (&'a Model, f64)) -> Self {
        let ops = Ops(simd);
        let zero = ops.all(0.0);
        #[expect(clippy::cast_possible_truncation, reason = "counted in the tolerance")]
        let extra = extra_m as f32;
        Self { ops, model, extra, poses: [0; 3], frames: [([[zero; 3]; 3], [zero; 3]); FRAMES], placed: 0 }
    }

    /// The arm in the poses from `first` on, one in `strides` a lane.
    #[inline(always)]
    pub(super) fn pose(&mut self, poses: &(impl Poses + ?Sized), first: usize, strides: usize) {
        let (ops, model) = (self.ops, self.model);
        let (one, zero) = (ops.all(1.0), ops.all(0.0));
        let mut columns = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
        let mut origin = [zero; 3];
        self.frames[0] = (columns, origin);
        let last = poses.count() - 1;
        let mut places = [poses.place(last); LANES_MAX];
        for (lane, place) in places.iter_mut().enumerate().take(S::F32_LANES) {
            *place = poses.place((first + lane * strides).min(last));
        }
        for (j, joint) in model.joints.iter().enumerate() {
            let mut positions = [0.0_f32; LANES_MAX];
            for (position, place) in positions.iter_mut().zip(&places) {
                *position = reduced(joint, poses.position(*place, j));
            }
            let (position, _) = S::as_simd_f32s(&positions);
            if joint.parent != j {
                (columns, origin) = self.frames[joint.parent];
            }
            origin = ops.moved(origin, &columns, joint.shift);
            let zero3 = [zero; 3];
            let fixed = [
                ops.moved(zero3, &columns, joint.columns[0]),
                ops.moved(zero3, &columns, joint.columns[1]),
                ops.moved(zero3, &columns, joint.columns[2]),
            ];
            match joint.kind {
                JointKind::Revolute => {
                    let [sin, cos] = ops.sin_cos_pi(position[0]);
                    for k in 0..3 {
                        let (x, y) = (fixed[0][k], fixed[1][k]);
                        columns[0][k] = ops.mul_add(sin, y, ops.0.mul_f32s(cos, x));
                        columns[1][k] = ops.sub_mul(sin, x, ops.0.mul_f32s(cos, y));
                    }
                    columns[2] = fixed[2];
                }
                JointKind::Prismatic => {
                    columns = fixed;
                    for k in 0..3 {
                        origin[k] = ops.mul_add(position[0], columns[2][k], origin[k]);
                    }
                }
            }
            self.frames[j + 1] = (columns, origin);
        }
        self.poses = [first, strides, last + 1];
        self.placed = 0;
    }

    /// True when some pose is surely not free; writes down the pairs that f32 leaves open.
    #[inline(always)]
    fn is_blocked(&mut self, scratch: &mut Scratch) -> bool {
        let mut middles = [[self.ops.all(0.0); 3]; FRAMES];
        for (group, middle) in self.model.groups.iter().zip(&mut middles) {
            let (columns, origin) = &self.frames[group.frame];
            *middle = self.ops.moved(*origin, columns, group.centre);
        }
        // What is at the tip meets something first as a rule.
        for (index, group) in self.model.groups.iter().enumerate().rev() {
            if group.frame > 0 && self.meets_obstacles((index, group), middles[index], scratch) {
                return true;
            }
        }
        self.meets_itself(&middles, scratch)
    }

    #[inline(always)]
    fn meets_obstacles(
        &mut self,
        (index, group): (usize, &Group),
        middle: Vector3<S>,
        scratch: &mut Scratch,
    ) -> bool {
        let model = self.model;
        let Some(tree) = &model.tree else {
            // Most groups are clear of everything: one look at the least of all is enough then.
            let mut slack = self.ops.all(f32::MAX);
            for obstacle in &model.obstacles {
                let keep = self.group_keep(group, obstacle);
                slack = self.less_slack(slack, distance2(self.ops, obstacle, middle, Wanted::Bound), keep);
            }
            if self.ops.0.reduce_min_f32s(slack) > 0.0 {
                return false;
            }
            for (o, obstacle) in model.obstacles.iter().enumerate() {
                if self.is_near(group, middle, obstacle) && self.meets((index, group), (o, obstacle), scratch)
                {
                    return true;
                }
            }
            return false;
        };
        let region = self.region(middle, group.radius + self.extra + model.tolerance);
        let mut near = std::mem::take(&mut scratch.near);
        tree.near(&region, &mut near);
        let mut meets = false;
        for o in &near {
            let o = *o as usize;
            let obstacle = &model.obstacles[o];
            if self.is_near(group, middle, obstacle) && self.meets((index, group), (o, obstacle), scratch) {
                meets = true;
                break;
            }
        }
        scratch.near = near;
        meets
    }

    /// A box around spheres at some points.
    #[inline(always)]
    pub(super) fn region(&self, middle: Vector3<S>, radius: f32) -> Bounds {
        let simd = self.ops.0;
        let [x, y, z] = middle;
        let low = [simd.reduce_min_f32s(x), simd.reduce_min_f32s(y), simd.reduce_min_f32s(z)];
        let high = [simd.reduce_max_f32s(x), simd.reduce_max_f32s(y), simd.reduce_max_f32s(z)];
        Bounds { low: low.map(|at| at - radius), high: high.map(|at| at + radius) }
    }

    /// True when something of a group may be nearer to an obstacle than it must.
    #[inline(always)]
    fn is_near(&self, group: &Group, middle: Vector3<S>, obstacle: &Obstacle) -> bool {
        let keep = self.group_keep(group, obstacle);
        self.ops.0.reduce_min_f32s(distance2(self.ops, obstacle, middle, Wanted::Bound)) <= keep * keep
    }

    /// The least of a slack and of what some squared distances have beyond the square of what they must keep.
    #[inline(always)]
    fn less_slack(&self, slack: Vector<S>, apart2: Vector<S>, keep: f32) -> Vector<S> {
        self.ops.min(slack, self.ops.0.sub_f32s(apart2, self.ops.all(keep * keep)))
    }

    /// What the middle of a group keeps from an obstacle's core at least where nothing of it is near.
    #[inline(always)]
    fn group_keep(&self, group: &Group, obstacle: &Obstacle) -> f32 {
        group.radius + obstacle.radius + self.model.margin + self.extra + obstacle.tolerance
    }

    /// Places the spheres of a group, once.
    #[inline(always)]
    pub(super) fn place(&mut self, (index, group): (usize, &Group), centres: &mut [f32]) {
        if self.placed & (1 << index) != 0 {
            return;
        }
        self.placed |= 1 << index;
        let (columns, origin) = &self.frames[group.frame];
        let (slots, _) = S::as_mut_simd_f32s(centres);
        for (sphere, slots) in group.spheres.clone().zip(slots[3 * group.spheres.start..].chunks_exact_mut(3))
        {
            let at = self.ops.moved(*origin, columns, self.model.spheres[sphere].centre);
            slots.copy_from_slice(&at);
        }
    }

    #[inline(always)]
    pub(super) fn centre(centres: &[f32], sphere: usize) -> Vector3<S> {
        let (slots, _) = S::as_simd_f32s(centres);
        [slots[3 * sphere], slots[3 * sphere + 1], slots[3 * sphere + 2]]
    }

    /// The spheres of a group against an obstacle.
    #[inline(always)]
    fn meets(
        &mut self,
        (index, group): (usize, &Group),
        (o, obstacle): (usize, &Obstacle),
        scratch: &mut Scratch,
    ) -> bool {
        self.place((index, group), &mut scratch.centres);
        let model = self.model;
        let keep = obstacle.radius + model.margin + self.extra + obstacle.tolerance;
        let mut slack = self.ops.all(f32::MAX);
        for sphere in group.spheres.clone() {
            let keep = keep + model.spheres[sphere].outer;
            let apart2 = distance2(self.ops, obstacle, Self::centre(&scratch.centres, sphere), Wanted::Bound);
            slack = self.less_slack(slack, apart2, keep);
        }
        if self.ops.0.reduce_min_f32s(slack) > 0.0 {
            return false;
        }
        for cover in &model.covers[group.bodies.clone()] {
            let mut open = 0_u32;
            for sphere in cover.spheres.clone() {
                let keep = keep + model.spheres[sphere].outer;
                let apart2 = distance2(
                    self.ops,
                    obstacle,
                    Self::centre(&scratch.centres, sphere),
                    Wanted::Within(keep),
                );
                let Some(least2) = self.below(apart2, keep, &mut open) else {
                    continue;
                };
                if obstacle.is_coarse {
                    continue;
                }
                let required = model.least_margin((cover.link, o));
                let sure = model.spheres[sphere].inner + obstacle.radius + required + self.extra
                    - obstacle.tolerance;
                if is_below(least2, sure) {
                    return true;
                }
            }
            self.suspect(open, Question::Obstacle(cover.link, o), scratch);
        }
        false
    }

    /// The least of some squared distances when it is not above the square of a limit; marks the lanes that are not.
    #[inline(always)]
    fn below(&self, apart2: Vector<S>, limit: f32, open: &mut u32) -> Option<f32> {
        let limit2 = limit * limit;
        let least2 = self.ops.0.reduce_min_f32s(apart2);
        if least2 > limit2 {
            return None;
        }
        let mut values = [f32::INFINITY; LANES_MAX];
        let (slots, _) = S::as_mut_simd_f32s(&mut values);
        slots[0] = apart2;
        for (lane, value) in values.iter().enumerate().take(S::F32_LANES) {
            *open |= u32::from(*value <= limit2) << lane;
        }
        Some(least2)
    }

    #[inline(always)]
    fn suspect(&self, open: u32, question: Question, scratch: &mut Scratch) {
        let [first, strides, count] = self.poses;
        let mut open = open;
        while open != 0 {
            let lane = open.trailing_zeros() as usize;
            open &= open - 1;
            let pose = first + lane * strides;
            if pose < count {
                scratch.suspects.push(Suspect { pose: u32::try_from(pose).unwrap_or(u32::MAX), question });
            }
        }
    }

    #[inline(always)]
    fn meets_itself(&mut self, middles: &[Vector3<S>; FRAMES], scratch: &mut Scratch) -> bool {
        let model = self.model;
        for pair in &model.group_pairs {
            let [a, b] = pair.groups;
            let (of_a, of_b) = (&model.groups[a], &model.groups[b]);
            let keep = of_a.radius + of_b.radius + pair.required + self.extra + model.tolerance;
            if self.ops.0.reduce_min_f32s(self.apart2(middles[a], middles[b])) > keep * keep {
                continue;
            }
            self.place((a, of_a), &mut scratch.centres);
            self.place((b, of_b), &mut scratch.centres);
            if self.are_spheres_apart(pair, middles[b], &scratch.centres) {
                continue;
            }
            for bodies in &pair.bodies {
                if self.bodies_meet(bodies, scratch) {
                    return true;
                }
            }
        }
        false
    }

    /// Squared distance of two points.
    #[inline(always)]
    pub(super) fn apart2(&self, a: Vector3<S>, b: Vector3<S>) -> Vector<S> {
        let between = self.ops.sub3(a, b);
        self.ops.dot(between, between)
    }

    /// True when the larger spheres of two groups keep what they must in every pose.
    #[inline(always)]
    fn are_spheres_apart(&self, pair: &GroupPair, middle: Vector3<S>, centres: &[f32]) -> bool {
        let model = self.model;
        let of_b = &model.groups[pair.groups[1]];
        let more = self.extra + model.tolerance;
        for (sphere, others) in &pair.spheres {
            let at = Self::centre(centres, *sphere);
            let keep = model.spheres[*sphere].outer + of_b.radius + pair.required + more;
            if self.ops.0.reduce_min_f32s(self.apart2(at, middle)) > keep * keep {
                continue;
            }
            let mut slack = self.ops.all(f32::MAX);
            for (other, keep) in others {
                let apart2 = self.apart2(at, Self::centre(centres, *other));
                slack = self.less_slack(slack, apart2, keep + more);
            }
            if self.ops.0.reduce_min_f32s(slack) <= 0.0 {
                return false;
            }
        }
        true
    }

    #[inline(always)]
    fn bodies_meet(&mut self, bodies: &super::model::BodyPair, scratch: &mut Scratch) -> bool {
        let model = self.model;
        let [a, b] = bodies.covers.map(|cover| model.covers[cover].spheres.clone());
        let more = bodies.required + self.extra;
        let mut open = 0_u32;
        for i in a {
            let (at, one) = (Self::centre(&scratch.centres, i), &model.spheres[i]);
            for j in b.clone() {
                let other = &model.spheres[j];
                let apart2 = self.apart2(at, Self::centre(&scratch.centres, j));
                let keep = one.outer + other.outer + more + model.tolerance;
                let Some(least2) = self.below(apart2, keep, &mut open) else { continue };
                if one.inner > 0.0
                    && other.inner > 0.0
                    && is_below(least2, one.inner + other.inner + more - model.tolerance)
                {
                    return true;
                }
            }
        }
        self.suspect(open, Question::Pair(bodies.pair), scratch);
        false
    }
}

/// True when the root of a square is less than a limit.
#[inline(always)]
fn is_below(square: f32, limit: f32) -> bool {
    limit > 0.0 && square < limit * limit
}

/// What shall be known of a distance.
#[derive(Clone, Copy)]
pub(super) enum Wanted {
    /// A lower bound, if that is quicker.
    Bound,
    /// The distance itself, if it is not more than this; any larger number otherwise.
    Within(f32),
}

/// Squared distance of points from an obstacle's core: a root costs as much as all the rest.
#[inline(always)]
pub(super) fn distance2<S: Simd>(
    ops: Ops<S>,
    obstacle: &Obstacle,
    point: Vector3<S>,
    wanted: Wanted,
) -> Vector<S> {
    let from = ops.sub3(point, ops.all3(obstacle.centre));
    match &obstacle.form {
        Form::AlignedBox(half) => outside(ops, from, *half),
        Form::Box(half) => {
            let rows = &obstacle.rows;
            let seen = [along(ops, from, rows[0]), along(ops, from, rows[1]), along(ops, from, rows[2])];
            outside(ops, seen, *half)
        }
        Form::Cylinder([half, radius]) => {
            let axis = ops.all3(obstacle.rows[0]);
            let height = ops.dot(from, axis);
            let across = [
                ops.sub_mul(axis[0], height, from[0]),
                ops.sub_mul(axis[1], height, from[1]),
                ops.sub_mul(axis[2], height, from[2]),
            ];
            let zero = ops.all(0.0);
            let beside = ops.max(ops.0.sub_f32s(ops.length(across), ops.all(*radius)), zero);
            let above = ops.max(ops.0.sub_f32s(ops.abs(height), ops.all(*half)), zero);
            ops.mul_add(beside, beside, ops.0.mul_f32s(above, above))
        }
        Form::Segment(half, per_length2) => {
            let half = ops.all3(*half);
            let share = ops.0.mul_f32s(ops.dot(from, half), ops.all(*per_length2));
            let share = ops.0.min_f32s(ops.max(share, ops.all(-1.0)), ops.all(1.0));
            let across = [
                ops.sub_mul(half[0], share, from[0]),
                ops.sub_mul(half[1], share, from[1]),
                ops.sub_mul(half[2], share, from[2]),
            ];
            ops.dot(across, across)
        }
        Form::Cloud(cloud) => {
            let rows = &obstacle.rows;
            let seen = [along(ops, from, rows[0]), along(ops, from, rows[1]), along(ops, from, rows[2])];
            let mut lanes = [[0.0_f32; LANES_MAX]; 3];
            for (lane, seen) in lanes.iter_mut().zip(seen) {
                S::as_mut_simd_f32s(lane).0[0] = seen;
            }
            let mut apart2 = [0.0; LANES_MAX];
            to_points(cloud, &lanes, wanted, &mut apart2[..S::F32_LANES]);
            S::as_simd_f32s(&apart2).0[0]
        }
    }
}

/// Squared distances to the nearest points of a cloud.
fn to_points(cloud: &Cloud, lanes: &[[f32; LANES_MAX]; 3], wanted: Wanted, apart2: &mut [f32]) {
    let [x, y, z] = lanes;
    for (lane, apart2) in apart2.iter_mut().enumerate() {
        let at = parry3d_f64::math::Vector::new(f64::from(x[lane]), f64::from(y[lane]), f64::from(z[lane]));
        let mut apart_m = cloud.least_m(at);
        if let Wanted::Within(keep) = wanted
            && apart_m <= f64::from(keep)
        {
            // What is as far as that to the last bit is found too.
            let found = cloud.tree().nearest(f64::from(keep.next_up()), |p| (p - at).length());
            apart_m = found.map_or(f64::from(keep.next_up()), |(apart_m, _)| apart_m);
        }
        let apart = down(apart_m);
        *apart2 = apart * apart;
    }
}

#[inline(always)]
fn along<S: Simd>(ops: Ops<S>, from: Vector3<S>, row: [f32; 3]) -> Vector<S> {
    ops.dot(from, ops.all3(row))
}

/// Squared distance from a box around the origin.
#[inline(always)]
fn outside<S: Simd>(ops: Ops<S>, at: Vector3<S>, half: [f32; 3]) -> Vector<S> {
    let zero = ops.all(0.0);
    let x = ops.max(ops.0.sub_f32s(ops.abs(at[0]), ops.all(half[0])), zero);
    let y = ops.max(ops.0.sub_f32s(ops.abs(at[1]), ops.all(half[1])), zero);
    let z = ops.max(ops.0.sub_f32s(ops.abs(at[2]), ops.all(half[2])), zero);
    ops.dot([x, y, z], [x, y, z])
}
