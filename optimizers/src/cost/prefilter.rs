//! The kernel: the tip's path of a whole motion, and which of its poses may be near a sphere.
//!
//! Lanes are poses of one segment. The kernel never says what a contact costs: it only sorts out the poses that are
//! surely free, and whoever calls it looks at the others exactly. "Surely" is the distance in f32 against a limit
//! that is wider by what f32 can be wrong, see [`super::margin`].
//!
//! Before that, cells of neighbouring poses are looked at as one: half of a segment's poses lie in its first and last
//! hundredth, and most spheres are far from most of a motion.
//!
//! The arm is seen from behind its first joint, whose turn moves the spheres instead. Behind that, a parallel joint
//! moves points by the sum of its group's angles; only a tilted axis takes a rotation of the directions.
use super::flat::{Flat, FlatSegment, FlatSphere};
use super::lanes::{Lanes, Vector, Vector3};
use super::margin::Limits;
use pulp::{Simd, WithSimd};
use taustream_motion::MAX_JOINTS;

/// Poses are padded to a multiple of the widest vector.
pub(super) const PADDING: usize = 16;

/// Every angle of a segment in half turns: where it starts, and how far it goes.
pub(super) type Angles = [[f32; 2]; MAX_JOINTS];

/// Poses of a cell.
pub(super) const CELL: usize = 8;

/// Neighbouring poses, [`CELL`] of them together; padded to a multiple of [`PADDING`].
#[derive(Clone, Debug)]
pub(super) struct Cells {
    /// The profile in the middle of each.
    pub(super) middles: Vec<f32>,
    /// How far it is from there to either end, at most.
    pub(super) halves: Vec<f32>,
}

/// How far a segment moves any point of the arm against any other or a sphere, at most (m).
pub(super) type Sweep = f32;

/// One motion to look through.
pub(super) struct Pass<'a> {
    /// Arm and spheres.
    pub(super) flat: &'a Flat,
    /// The profile at the poses of a segment, then 1 up to a multiple of [`PADDING`], once at least.
    pub(super) phases: &'a [f32],
    /// The cells of those poses.
    pub(super) cells: &'a Cells,
    /// A row a segment.
    pub(super) angles: &'a [Angles],
    /// One a segment.
    pub(super) sweeps: &'a [Sweep],
    /// When a pose is surely free.
    pub(super) limits: &'a Limits,
    /// Out: below 0 where a pose is not surely free; as many a segment as there are phases.
    pub(super) slack: &'a mut [f32],
}

/// What a pass finds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passed {
    /// Length of the tip's path.
    pub(super) length_m: f64,
    /// False when every pose is surely free.
    pub(super) has_suspects: bool,
}

impl WithSimd for Pass<'_> {
    type Output = Passed;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Passed {
        let lanes = Lanes(simd);
        let Self { flat, limits, cells, .. } = self;
        let (mut length_m, mut least) = (0.0, lanes.all(f32::MAX));
        let mut arm = ArmLanes::new(lanes);
        let (phases, _) = S::as_simd_f32s(self.phases);
        // The tip at every pose and one vector more: steps go from each pose to the next one.
        let row = self.phases.len() + PADDING;
        let mut tips = vec![0.0_f32; 3 * row];
        let mut far = vec![-1.0_f32; flat.spheres.len() * cells.middles.len()];
        let segments =
            self.angles.iter().zip(self.sweeps).zip(self.slack.chunks_exact_mut(self.phases.len()));
        for ((angles, sweep), slack) in segments {
            if !limits.sums {
                arm.scout(lanes, (flat, limits), (angles, *sweep), (cells, &mut far));
            }
            let (slacks, _) = S::as_mut_simd_f32s(slack);
            let [x, y, z] = rows(&mut tips, row);
            let ((xs, _), (ys, _), (zs, _)) =
                (S::as_mut_simd_f32s(x), S::as_mut_simd_f32s(y), S::as_mut_simd_f32s(z));
            let poses = phases.iter().zip(slacks).enumerate();
            for ((((block, (phase, slack)), x), y), z) in poses.zip(xs).zip(ys).zip(zs) {
                arm.place(lanes, flat, angles, *phase);
                *slack = arm.slack(lanes, (flat, limits), &far, block);
                least = lanes.min(least, *slack);
                [*x, *y, *z] = arm.tip(lanes, flat);
            }
            length_m += f64::from(path_m(lanes, &mut tips, row));
        }
        // Sizes and angles are bounded, so that everything here is a number.
        let has_suspects = simd.reduce_min_f32s(least) < 0.0;
        Passed { length_m, has_suspects }
    }
}

/// Three rows of equal length.
fn rows(table: &mut [f32], row: usize) -> [&mut [f32]; 3] {
    let (x, rest) = table.split_at_mut(row);
    let (y, z) = rest.split_at_mut(row);
    [x, y, z]
}

/// Sum of the steps between the points of a table. Behind the last pose nothing moves, so that padding adds nothing.
#[inline(always)]
fn path_m<S: Simd>(lanes: Lanes<S>, tips: &mut [f32], row: usize) -> f32 {
    let used = row - PADDING;
    for line in tips.chunks_exact_mut(row) {
        let (moving, still) = line.split_at_mut(used);
        still.fill(moving.last().copied().unwrap_or(0.0));
    }
    let [x, y, z] = rows(tips, row);
    let mut sum = lanes.all(0.0);
    let (x0, y0, z0) =
        (S::as_simd_f32s(&x[..used]).0, S::as_simd_f32s(&y[..used]).0, S::as_simd_f32s(&z[..used]).0);
    let (x1, y1, z1) = (S::as_simd_f32s(&x[1..]).0, S::as_simd_f32s(&y[1..]).0, S::as_simd_f32s(&z[1..]).0);
    let (from, to) = (x0.iter().zip(y0).zip(z0), x1.iter().zip(y1).zip(z1));
    for (((x0, y0), z0), ((x1, y1), z1)) in from.zip(to) {
        let step = lanes.sub3([*x1, *y1, *z1], [*x0, *y0, *z0]);
        sum = lanes.add(sum, lanes.sqrt(lanes.dot(step, step)));
    }
    lanes.0.reduce_sum_f32s(sum)
}

/// The arm in as many poses as there are lanes, seen from behind its first joint.
struct ArmLanes<S: Simd> {
    /// Sine and cosine of the first joint's angle.
    first: [Vector<S>; 2],
    /// The frames' origins; behind the arm's last one nothing.
    origins: [Vector3<S>; MAX_JOINTS + 1],
    /// The last one.
    tip: Vector3<S>,
    /// Of each link: from the origin in front to the one behind, and 1 / length^2.
    along: [(Vector3<S>, Vector<S>); MAX_JOINTS],
}

impl<S: Simd> ArmLanes<S> {
    /// Somewhere.
    #[inline(always)]
    fn new(lanes: Lanes<S>) -> Self {
        let (zero, nowhere) = (lanes.all(0.0), lanes.all3([0.0; 3]));
        Self {
            first: [zero; 2],
            origins: [nowhere; MAX_JOINTS + 1],
            tip: nowhere,
            along: [(nowhere, zero); MAX_JOINTS],
        }
    }

    /// Goes to the poses of a segment's phases.
    #[inline(always)]
    fn place(&mut self, lanes: Lanes<S>, flat: &Flat, angles: &Angles, phase: Vector<S>) {
        self.first = turn(lanes, angles[0], phase);
        self.origins[0] = if flat.base_is_on_axis {
            tilted_back(lanes, flat, lanes.all3(flat.base))
        } else {
            seen_from_first(lanes, flat, self.first, flat.base)
        };
        let mut tip = tilted_back(lanes, flat, lanes.all3(flat.first.origin));
        self.origins[1] = tip;
        let mut at = match flat.first.next {
            Some(next) => tilted_back(lanes, flat, lanes.all3(next)),
            None => tip,
        };
        let (mut axes, mut are_turned) = (Axes::plain(lanes), false);
        for ((link_segment, angle), slot) in flat.others.iter().zip(&angles[1..]).zip(&mut self.origins[2..])
        {
            let sin_cos = if link_segment.turns {
                turn(lanes, *angle, phase)
            } else {
                [lanes.all(0.0), lanes.all(1.0)]
            };
            let swing = if link_segment.swings { Some(sin_cos) } else { None };
            let seen = if are_turned { Some(&axes) } else { None };
            tip = shifted(lanes, at, seen, link_segment.origin, swing);
            at = match link_segment.next {
                Some(next) => shifted(lanes, at, seen, next, swing),
                None => tip,
            };
            *slot = tip;
            if let Some(tilt) = link_segment.tilt {
                axes.turn(lanes, link_segment, sin_cos);
                axes.tilt(lanes, link_segment, tilt);
                are_turned = true;
            }
        }
        self.tip = tip;
    }

    /// The tip as the first joint sees it before it turns: lengths in space need it.
    #[inline(always)]
    fn tip(&self, lanes: Lanes<S>, flat: &Flat) -> Vector3<S> {
        let [x, y, z] = self.tip;
        let (y, z) = match flat.first.tilt {
            Some([cos, sin]) => lanes.rotate([lanes.all(sin), lanes.all(cos)], y, z),
            None => (y, z),
        };
        let (x, y) = lanes.rotate(self.first, x, y);
        [x, y, z]
    }

    /// Looks at the middle of each cell, for each sphere: `far` is above 0 where the whole cell is surely free of it.
    ///
    /// Within a cell nothing moves further from the middle than the cell's half of the segment's sweep: joint j
    /// moves what it turns by its angle times its reach at most.
    #[inline(always)]
    fn scout(
        &mut self,
        lanes: Lanes<S>,
        (flat, limits): (&Flat, &Limits),
        (angles, sweep): (&Angles, Sweep),
        (cells, far): (&Cells, &mut [f32]),
    ) {
        let (middles, halves) = (S::as_simd_f32s(&cells.middles).0, S::as_simd_f32s(&cells.halves).0);
        for (i, (middle, half)) in middles.iter().zip(halves).enumerate() {
            self.place(lanes, flat, angles, *middle);
            self.stretch(lanes, flat);
            let spheres = flat.spheres.iter().zip(&limits.spheres);
            for ((sphere, limit), row) in spheres.zip(far.chunks_exact_mut(cells.middles.len())) {
                let reach = lanes.mul_add(*half, lanes.all(sweep), lanes.all(limit.distance));
                let nearest = self.nearest(lanes, flat, sphere, None);
                if let Some(slot) = S::as_mut_simd_f32s(row).0.get_mut(i) {
                    *slot = lanes.sub_mul(reach, reach, nearest);
                }
            }
        }
    }

    /// How far beyond its limit the nearest sphere is, in a measure that is below 0 when it may be inside. Spheres
    /// that are far from the block's cells are not asked.
    #[inline(always)]
    fn slack(
        &mut self,
        lanes: Lanes<S>,
        (flat, limits): (&Flat, &Limits),
        far: &[f32],
        block: usize,
    ) -> Vector<S> {
        let first = block * S::F32_LANES / CELL;
        let behind = first + (S::F32_LANES / CELL).max(1);
        let row = far.len() / flat.spheres.len().max(1);
        let mut is_stretched = false;
        let mut slack = lanes.all(f32::MAX);
        let spheres = flat.spheres.iter().zip(&limits.spheres).zip(far.chunks_exact(row.max(1)));
        for ((sphere, limit), far) in spheres {
            if far.get(first..behind).is_some_and(|cells| cells.iter().all(|beyond| *beyond > 0.0)) {
                continue;
            }
            if !is_stretched {
                self.stretch(lanes, flat);
                is_stretched = true;
            }
            let still = if limits.sums { Some(limit.still_m) } else { None };
            let measure = self.nearest(lanes, flat, sphere, still);
            slack = lanes.min(slack, lanes.sub(measure, lanes.all(limit.free_from)));
        }
        slack
    }

    /// Takes the links from the frames' origins.
    #[inline(always)]
    fn stretch(&mut self, lanes: Lanes<S>, flat: &Flat) {
        for (link, (along, share)) in flat.links.iter().zip(&mut self.along) {
            *along = lanes.sub3(self.origins[link.from + 1], self.origins[link.from]);
            *share = if let Some(per_length2) = link.per_length2 {
                lanes.all(per_length2)
            } else {
                // Where the length can become nothing, any share of it is the same point.
                let length2 = lanes.max(lanes.dot(*along, *along), lanes.all(f32::MIN_POSITIVE));
                lanes.div(lanes.all(1.0), length2)
            };
        }
    }

    /// The square of a sphere's least distance to the links; their sum, where there is something to add to.
    #[inline(always)]
    fn nearest(&self, lanes: Lanes<S>, flat: &Flat, sphere: &FlatSphere, still: Option<f32>) -> Vector<S> {
        let center = seen_from_first(lanes, flat, self.first, sphere.center);
        let mut measure = lanes.all(still.unwrap_or(f32::MAX));
        for (link, (along, share)) in flat.links.iter().zip(&self.along) {
            let to_center = lanes.sub3(center, self.origins[link.from]);
            let share = lanes.clamp_to_unit(lanes.mul(lanes.dot(to_center, *along), *share));
            let across = lanes.against(to_center, *along, share);
            let distance2 = lanes.dot(across, across);
            measure = match still {
                Some(_) => lanes.add(measure, lanes.sqrt(distance2)),
                None => lanes.min(measure, distance2),
            };
        }
        measure
    }
}

/// Sine and cosine of an angle at a phase of its travel.
#[inline(always)]
fn turn<S: Simd>(lanes: Lanes<S>, [from, travel]: [f32; 2], phase: Vector<S>) -> [Vector<S>; 2] {
    lanes.sin_cos_pi(lanes.mul_add(lanes.all(travel), phase, lanes.all(from)))
}

/// A constant point seen from behind the first joint's tilt.
#[inline(always)]
fn tilted_back<S: Simd>(lanes: Lanes<S>, flat: &Flat, [x, y, z]: Vector3<S>) -> Vector3<S> {
    let Some([cos, sin]) = flat.first.tilt else { return [x, y, z] };
    let (y, z) = lanes.rotate([lanes.all(-sin), lanes.all(cos)], y, z);
    [x, y, z]
}

/// A fixed point, seen from behind the first joint.
#[inline(always)]
fn seen_from_first<S: Simd>(
    lanes: Lanes<S>,
    flat: &Flat,
    [sin, cos]: [Vector<S>; 2],
    point: [f32; 3],
) -> Vector3<S> {
    let [x, y, z] = lanes.all3(point);
    // The turn back: (cos x + sin y, cos y - sin x).
    let (y, x) = lanes.rotate([sin, cos], y, x);
    tilted_back(lanes, flat, [x, y, z])
}

/// The directions of the joint that comes next.
struct Axes<S: Simd> {
    x: Vector3<S>,
    y: Vector3<S>,
    z: Vector3<S>,
}

impl<S: Simd> Axes<S> {
    /// Those behind the first joint.
    #[inline(always)]
    fn plain(lanes: Lanes<S>) -> Self {
        Self {
            x: lanes.all3([1.0, 0.0, 0.0]),
            y: lanes.all3([0.0, 1.0, 0.0]),
            z: lanes.all3([0.0, 0.0, 1.0]),
        }
    }

    /// Turns them about z, as far as anything behind asks for them.
    #[inline(always)]
    fn turn(&mut self, lanes: Lanes<S>, link_segment: &FlatSegment, [sin, cos]: [Vector<S>; 2]) {
        for (x, y) in self.x.iter_mut().zip(&mut self.y) {
            let (a, b) = (*x, *y);
            *y = lanes.sub_mul(sin, a, lanes.mul(cos, b));
            if link_segment.wants[0] {
                *x = lanes.mul_add(sin, b, lanes.mul(cos, a));
            }
        }
    }

    /// Tilts them about x, likewise.
    #[inline(always)]
    fn tilt(&mut self, lanes: Lanes<S>, link_segment: &FlatSegment, [cos, sin]: [f32; 2]) {
        let (cos, sin) = (lanes.all(cos), lanes.all(sin));
        for (y, z) in self.y.iter_mut().zip(&mut self.z) {
            let (a, b) = (*y, *z);
            if link_segment.wants[0] {
                *y = lanes.mul_add(sin, b, lanes.mul(cos, a));
            }
            if link_segment.wants[1] {
                *z = lanes.sub_mul(sin, a, lanes.mul(cos, b));
            }
        }
    }
}

/// A point shifted by what a joint carries; a shift that leaves the joint's axis swings with its angle.
#[inline(always)]
fn shifted<S: Simd>(
    lanes: Lanes<S>,
    at: Vector3<S>,
    axes: Option<&Axes<S>>,
    by: [f32; 3],
    swing: Option<[Vector<S>; 2]>,
) -> Vector3<S> {
    let [x, y, z] = lanes.all3(by);
    let Some(sin_cos) = swing else {
        return match axes {
            None => [at[0], at[1], lanes.add(at[2], z)],
            Some(axes) => lanes.along(at, axes.z, z),
        };
    };
    let (x, y) = lanes.rotate(sin_cos, x, y);
    match axes {
        None => [lanes.add(at[0], x), lanes.add(at[1], y), lanes.add(at[2], z)],
        Some(axes) => lanes.along(lanes.along(lanes.along(at, axes.x, x), axes.y, y), axes.z, z),
    }
}
