//! Intervals of a motion in lanes: what every pair keeps around the pose in the middle of each, however the joints turn from there.
//!
//! A point moves by at most the sum over the joints of how far each turns times its distance to that joint's axis in the middle
//! ([`crate::world::World::moves_m`]). The distance of two bodies, less what their points can move, is a lower bound over the whole interval. All is as in
//! the kernel of poses: groups of links first, their spheres where a group is near.
use super::arithmetic::{Vector, Vector3};
use super::kernel::{Chunk, LANES_MAX, Wanted, distance2};
use super::model::{Form, Group, GroupPair, Model, Obstacle};
use super::rounding::up;
use super::{Kept, Scratch};
use pulp::{Simd, WithSimd};
use taustream_motion::{JointArray, JointKind, MAX_JOINTS, USUAL_JOINTS};

/// Distances to axes are wrong by at most so many tolerances of positions: those of two points and of a direction.
const OF_LEVER: f32 = 3.0;
/// What sums and products of them, and a root, can lose, relatively and beside (m).
const ROUNDED: f32 = 1.0 + 1e-5;
const ROUNDED_M: f32 = 1e-6;

/// Intervals to look at.
pub(super) struct Pass<'a> {
    pub(super) model: &'a Model,
    /// The pose in the middle of each.
    pub(super) poses_rad: &'a [JointArray],
    /// How far each joint can be from there within the interval (m for a prismatic one).
    pub(super) turns_rad: &'a [JointArray],
    /// Larger distances need not be distinguished (m).
    pub(super) enough_m: f64,
    pub(super) scratch: &'a mut Scratch,
    pub(super) kept: &'a mut Vec<Kept>,
}

impl WithSimd for Pass<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if self.model.joints.len() <= USUAL_JOINTS {
            self.search::<S, { USUAL_JOINTS + 1 }>(simd);
        } else {
            self.search::<S, { MAX_JOINTS + 1 }>(simd);
        }
    }
}

impl Pass<'_> {
    #[inline(always)]
    fn search<S: Simd, const FRAMES: usize>(self, simd: S) {
        let Self { model, poses_rad, turns_rad, enough_m, scratch, kept } = self;
        let lanes = S::F32_LANES.min(LANES_MAX);
        scratch.centres.resize(model.spheres.len() * 3 * S::F32_LANES, 0.0);
        kept.clear();
        let chunk = Chunk::<S, FRAMES>::new(simd, (model, 0.0));
        let (zero, enough) = (chunk.ops.all(0.0), chunk.ops.all(up(enough_m)));
        let mut intervals = Intervals { chunk, turns: [zero; FRAMES], least: enough, spare: enough };
        for first in (0..poses_rad.len()).step_by(lanes) {
            intervals.chunk.pose(poses_rad, first, 1);
            for (joint, turn) in intervals.turns.iter_mut().enumerate().take(model.joints.len()) {
                let mut values = [0.0_f32; LANES_MAX];
                for (lane, value) in values.iter_mut().enumerate().take(S::F32_LANES) {
                    *value = up(turns_rad[(first + lane).min(turns_rad.len() - 1)][joint]);
                }
                *turn = S::as_simd_f32s(&values).0[0];
            }
            (intervals.least, intervals.spare) = (enough, enough);
            intervals.measure(scratch);
            let [mut least, mut spare] = [[0.0_f32; LANES_MAX]; 2];
            S::as_mut_simd_f32s(&mut least).0[0] = intervals.least;
            S::as_mut_simd_f32s(&mut spare).0[0] = intervals.spare;
            let here = lanes.min(poses_rad.len() - first);
            let each = least.iter().zip(&spare).take(here);
            kept.extend(each.map(|(least_m, spare_m)| Kept { least_m: *least_m, spare_m: *spare_m }));
        }
    }
}

/// How far a group can move.
#[derive(Clone, Copy)]
struct Moves<S: Simd> {
    /// The middle of the ball around it, and so the ball.
    middle: Vector<S>,
    /// Any point of it.
    all: Vector<S>,
}

/// As many intervals as there are lanes.
struct Intervals<'a, S: Simd, const FRAMES: usize> {
    /// The arm in the middle of each.
    chunk: Chunk<'a, S, FRAMES>,
    turns: [Vector<S>; FRAMES],
    /// The least distance that any pair keeps.
    least: Vector<S>,
    /// The same beyond what the pair must keep.
    spare: Vector<S>,
}

impl<S: Simd, const FRAMES: usize> Intervals<'_, S, FRAMES> {
    #[inline(always)]
    fn measure(&mut self, scratch: &mut Scratch) {
        let model = self.chunk.model;
        let zero = self.chunk.ops.all(0.0);
        let mut middles = [[zero; 3]; FRAMES];
        let mut moves = [Moves { middle: zero, all: zero }; FRAMES];
        for (index, group) in model.groups.iter().enumerate() {
            let (columns, origin) = &self.chunk.frames[group.frame];
            middles[index] = self.chunk.ops.moved(*origin, columns, group.centre);
            moves[index] = self.group_moves(0, group, middles[index]);
        }
        // What is at the tip is nearest to something as a rule.
        for (index, group) in model.groups.iter().enumerate().rev().filter(|(_, group)| group.frame > 0) {
            self.against_obstacles((index, group), (middles[index], moves[index]), scratch);
        }
        for pair in &model.group_pairs {
            self.against_itself(pair, &middles, &moves, scratch);
        }
    }

    /// How far a point of a frame can move against a frame that carries it. Distances of balls depend on nothing but their centres.
    #[inline(always)]
    fn moves(&self, (frame, against): (usize, usize), point: Vector3<S>) -> Vector<S> {
        let (ops, model) = (self.chunk.ops, self.chunk.model);
        let mut sum = ops.all(0.0);
        let more = ops.all(OF_LEVER * model.tolerance);
        let mut frame = frame;
        while frame > against {
            // A joint stands in its axes; it turns about the third, or slides along it.
            let (joint, turn) = (&model.joints[frame - 1], self.turns[frame - 1]);
            let (columns, origin) = &self.chunk.frames[frame];
            frame = joint.parent;
            if joint.kind == JointKind::Prismatic {
                sum = ops.0.add_f32s(sum, turn);
                continue;
            }
            let [x, y, z] = ops.sub3(point, *origin);
            let [u, v, w] = columns[2];
            let across = [
                ops.sub_mul(z, v, ops.0.mul_f32s(y, w)),
                ops.sub_mul(x, w, ops.0.mul_f32s(z, u)),
                ops.sub_mul(y, u, ops.0.mul_f32s(x, v)),
            ];
            sum = ops.mul_add(turn, ops.0.add_f32s(ops.length(across), more), sum);
        }
        ops.0.mul_f32s(sum, ops.all(ROUNDED))
    }

    /// How far a group of links can move against a frame that carries it.
    #[inline(always)]
    fn group_moves(&self, against: usize, group: &Group, middle: Vector3<S>) -> Moves<S> {
        let (ops, model) = (self.chunk.ops, self.chunk.model);
        let mut turned = ops.all(0.0);
        let mut frame = group.frame;
        while frame > against {
            let joint = &model.joints[frame - 1];
            if joint.kind == JointKind::Revolute {
                turned = ops.0.add_f32s(turned, self.turns[frame - 1]);
            }
            frame = joint.parent;
        }
        let of_middle = self.moves((group.frame, against), middle);
        let about = ops.all(group.radius * ROUNDED + OF_LEVER * model.tolerance);
        Moves { middle: of_middle, all: ops.mul_add(turned, about, of_middle) }
    }

    /// True when nothing of a distance, in any lane, is less than what is known already.
    #[inline(always)]
    fn is_far(&self, distance: Vector<S>, required: f32) -> bool {
        let simd = self.chunk.ops.0;
        let spare = simd.sub_f32s(distance, self.chunk.ops.all(required));
        let beyond =
            self.chunk.ops.min(simd.sub_f32s(distance, self.least), simd.sub_f32s(spare, self.spare));
        simd.reduce_min_f32s(beyond) >= 0.0
    }

    #[inline(always)]
    fn take(&mut self, distance: Vector<S>, required: f32) {
        let ops = self.chunk.ops;
        self.least = ops.min(self.least, distance);
        self.spare = ops.min(self.spare, ops.0.sub_f32s(distance, ops.all(required)));
    }

    /// What two points whose squared distance is known keep of it when they stand for radii, and move.
    #[inline(always)]
    fn kept(&self, apart2: Vector<S>, radii: f32, moves: Vector<S>) -> Vector<S> {
        let (ops, simd) = (self.chunk.ops, self.chunk.ops.0);
        simd.sub_f32s(simd.sub_f32s(simd.sqrt_f32s(apart2), ops.all(radii + ROUNDED_M)), moves)
    }

    #[inline(always)]
    fn against_obstacles(
        &mut self,
        (index, group): (usize, &Group),
        (middle, moves): (Vector3<S>, Moves<S>),
        scratch: &mut Scratch,
    ) {
        let model = self.chunk.model;
        let Some(tree) = &model.tree else {
            for obstacle in &model.obstacles {
                self.against_obstacle((index, group), obstacle, (middle, moves), scratch);
            }
            return;
        };
        let simd = self.chunk.ops.0;
        // Farther off than this, nothing is less than what is known: boxes of the tree reach as far as the margin.
        let known = simd.reduce_max_f32s(self.least).max(simd.reduce_max_f32s(self.spare));
        let reach = group.radius + model.tolerance + simd.reduce_max_f32s(moves.middle) + known + ROUNDED_M;
        let region = self.chunk.region(middle, reach);
        let mut near = std::mem::take(&mut scratch.near);
        tree.near(&region, &mut near);
        for o in &near {
            self.against_obstacle((index, group), &model.obstacles[*o as usize], (middle, moves), scratch);
        }
        scratch.near = near;
    }

    #[inline(always)]
    fn against_obstacle(
        &mut self,
        (index, group): (usize, &Group),
        obstacle: &Obstacle,
        (middle, moves): (Vector3<S>, Moves<S>),
        scratch: &mut Scratch,
    ) {
        let (ops, model) = (self.chunk.ops, self.chunk.model);
        let beside = obstacle.radius + obstacle.tolerance;
        let apart2 = distance2(ops, obstacle, middle, Wanted::Bound);
        if self.is_far(self.kept(apart2, beside + group.radius, moves.middle), model.margin) {
            return;
        }
        self.chunk.place((index, group), &mut scratch.centres);
        for sphere in group.spheres.clone() {
            let (at, outer) =
                (Chunk::<S, FRAMES>::centre(&scratch.centres, sphere), model.spheres[sphere].outer);
            let radii = beside + outer;
            let apart2 = distance2(ops, obstacle, at, Wanted::Bound);
            // As the whole group at first, then by its own levers.
            if self.is_far(self.kept(apart2, radii, moves.all), model.margin) {
                continue;
            }
            let known =
                ops.0.reduce_max_f32s(self.least).max(ops.0.reduce_max_f32s(self.spare) + model.margin);
            let moves = self.moves((group.frame, 0), at);
            let wanted = Wanted::Within(radii + known + ops.0.reduce_max_f32s(moves) + ROUNDED_M);
            let apart2 = if let Form::Cloud(_) = obstacle.form {
                distance2(ops, obstacle, at, wanted)
            } else {
                apart2
            };
            self.take(self.kept(apart2, radii, moves), model.margin);
        }
    }

    #[inline(always)]
    fn against_itself(
        &mut self,
        pair: &GroupPair,
        middles: &[Vector3<S>; FRAMES],
        moves: &[Moves<S>; FRAMES],
        scratch: &mut Scratch,
    ) {
        let (ops, model) = (self.chunk.ops, self.chunk.model);
        let [a, b] = pair.groups;
        let (of_a, of_b) = (&model.groups[a], &model.groups[b]);
        let apart2 = self.chunk.apart2(middles[a], middles[b]);
        let radii = of_a.radius + of_b.radius + model.tolerance;
        let both = ops.0.add_f32s(moves[a].middle, moves[b].middle);
        if self.is_far(self.kept(apart2, radii, both), pair.required) {
            return;
        }
        // What carries both moves them alike.
        let moves_of_b = self.group_moves(pair.common, of_b, middles[b]);
        let both = ops.0.add_f32s(self.moves((of_a.frame, pair.common), middles[a]), moves_of_b.middle);
        if self.is_far(self.kept(apart2, radii, both), pair.required) {
            return;
        }
        self.chunk.place((a, of_a), &mut scratch.centres);
        self.chunk.place((b, of_b), &mut scratch.centres);
        for (sphere, others) in &pair.spheres {
            let (at, outer) =
                (Chunk::<S, FRAMES>::centre(&scratch.centres, *sphere), model.spheres[*sphere].outer);
            let apart2 = self.chunk.apart2(at, middles[b]);
            let moves = self.moves((of_a.frame, pair.common), at);
            let both = ops.0.add_f32s(moves, moves_of_b.middle);
            if self.is_far(self.kept(apart2, outer + of_b.radius + model.tolerance, both), pair.required) {
                continue;
            }
            for (other, keep) in others {
                let (there, radii) = (
                    Chunk::<S, FRAMES>::centre(&scratch.centres, *other),
                    outer + model.spheres[*other].outer,
                );
                let apart2 = self.chunk.apart2(at, there);
                let both = ops.0.add_f32s(moves, moves_of_b.all);
                if self.is_far(self.kept(apart2, radii + model.tolerance, both), pair.required) {
                    continue;
                }
                let both = ops.0.add_f32s(moves, self.moves((of_b.frame, pair.common), there));
                // What they must keep stands there with the radii, rounded up.
                self.take(self.kept(apart2, radii + model.tolerance, both), keep - radii + ROUNDED_M);
            }
        }
    }
}
