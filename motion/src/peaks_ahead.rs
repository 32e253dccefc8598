//! How fast, strong and jerky a motion is in each stretch of its time: tables that are made once, off the real-time thread.
//!
//! The motion is cut into cells of equal duration. Each cell holds proven bounds of velocity, acceleration and jerk with
//! their signs, joint by joint. A stop that is being chosen looks the cells up that it passes.
//!
//! A table begins with the first stroke: before it the sum rests. The strokes of a replacement that have ended before its cut are
//! folded, so its cells are as fine after minutes of replacements as at first.
use crate::limits::TOLERANCE;
use crate::proof::Proof;
use crate::{JointLimits, MAX_JOINTS, MAX_STROKES, Trajectory, USUAL_JOINTS};

/// Most cells of a table.
pub const CELLS_MAX: usize = 1024;
/// Shortest cell, s.
const CELL_S_MIN: f64 = 1e-3;

/// Lowest and highest value of each quantity of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRanges {
    /// Velocity, rad/s.
    pub velocity_rad_s: [f64; 2],
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: [f64; 2],
    /// Jerk, rad/s^3.
    pub jerk_rad_s3: [f64; 2],
}

impl JointRanges {
    fn join(&mut self, other: &Self) {
        let join = |[low, high]: &mut [f64; 2], [other_low, other_high]: &[f64; 2]| {
            *low = low.min(*other_low);
            *high = high.max(*other_high);
        };
        join(&mut self.velocity_rad_s, &other.velocity_rad_s);
        join(&mut self.acceleration_rad_s2, &other.acceleration_rad_s2);
        join(&mut self.jerk_rad_s3, &other.jerk_rad_s3);
    }
}

/// What a motion does in one stretch of its time, joint by joint: an arm of few joints has its values side by side.
pub type Stretch = [JointRanges; MAX_JOINTS];

/// A stretch in which nothing moves.
pub const AT_REST: Stretch =
    [JointRanges { velocity_rad_s: [0.0; 2], acceleration_rad_s2: [0.0; 2], jerk_rad_s3: [0.0; 2] };
        MAX_JOINTS];

/// Extends the ranges of so many joints to hold those of another stretch.
///
/// Real time: one loop over the joints.
pub fn join(stretch: &mut Stretch, other: &Stretch, joints: usize) {
    for (ranges, other) in stretch.iter_mut().zip(other).take(joints) {
        ranges.join(other);
    }
}

/// When the first stroke of a motion begins and the last one ends, s: what its table covers.
#[must_use]
pub fn span_s(trajectory: &Trajectory) -> [f64; 2] {
    let end_s = trajectory.duration_s();
    let starts_s = trajectory.strokes().iter().map(|stroke| stroke.start_s);
    [starts_s.fold(end_s, f64::min), end_s]
}

/// How many cells the table of a motion has.
#[must_use]
pub fn cell_count(trajectory: &Trajectory) -> usize {
    let [begin_s, end_s] = span_s(trajectory);
    let wanted = libm::ceil((end_s - begin_s) / CELL_S_MIN);
    (1..CELLS_MAX).find(|count| to_f64(*count) >= wanted).unwrap_or(CELLS_MAX)
}

/// Fills `cells`, as many as [`cell_count`] says, with the bounds of a motion that keeps the motion limits.
pub fn fill(cells: &mut [Stretch], trajectory: &Trajectory, limits: &[JointLimits; MAX_JOINTS]) {
    if trajectory.joints() <= USUAL_JOINTS {
        fill_in::<USUAL_JOINTS>(cells, trajectory, limits);
    } else {
        fill_in::<MAX_JOINTS>(cells, trajectory, limits);
    }
}

fn fill_in<const WIDTH: usize>(
    cells: &mut [Stretch],
    trajectory: &Trajectory,
    limits: &[JointLimits; MAX_JOINTS],
) {
    let [begin_s, end_s] = span_s(trajectory);
    let width_s = (end_s - begin_s) / to_f64(cells.len().max(1));
    let mut edges = [f64::INFINITY; 2 * MAX_STROKES];
    for (pair, stroke) in edges.chunks_exact_mut(2).zip(trajectory.strokes()) {
        pair.copy_from_slice(&[stroke.start_s, stroke.end_s()]);
    }
    edges.sort_unstable_by(f64::total_cmp);
    // Between two of these the motion is one polynomial.
    let mut edges = edges.iter().copied().filter(|edge_s| *edge_s > begin_s && *edge_s < end_s);
    let mut proof = Proof::<WIDTH>::new(trajectory, limits, 0.0);
    let (mut from_s, mut piece_ends_s) = (begin_s, begin_s);
    for (index, cell) in cells.iter_mut().enumerate() {
        let mut whole: Option<Stretch> = None;
        let cell_ends_s = begin_s + to_f64(index + 1) * width_s;
        while from_s < cell_ends_s {
            if from_s >= piece_ends_s {
                piece_ends_s = edges.find(|edge_s| *edge_s > from_s).unwrap_or(f64::INFINITY);
                proof.enter(from_s, piece_ends_s.min(end_s));
            }
            let to_s = cell_ends_s.min(piece_ends_s);
            let found = bounds(&mut proof, limits, [from_s, to_s]);
            join(whole.get_or_insert(found), &found, trajectory.joints());
            from_s = to_s;
        }
        *cell = whole.unwrap_or(AT_REST);
    }
}

/// What one polynomial piece does between two of its instants. Motion limits that were proven bound it, too.
fn bounds<const WIDTH: usize>(
    proof: &mut Proof<'_, WIDTH>,
    limits: &[JointLimits; MAX_JOINTS],
    [from_s, to_s]: [f64; 2],
) -> Stretch {
    let middle_s = 0.5 * (from_s + to_s);
    let found = proof.ranges(middle_s, (to_s - middle_s).max(middle_s - from_s));
    let mut stretch = AT_REST;
    for ((ranges, [velocity, acceleration, jerk]), JointLimits { motion, .. }) in
        stretch.iter_mut().zip(found).zip(limits).take(proof.joints())
    {
        let within = |[low, high]: [f64; 2], limit: f64| {
            let limit = limit * (1.0 + TOLERANCE);
            [low.max(-limit), high.min(limit)]
        };
        *ranges = JointRanges {
            velocity_rad_s: within(velocity, motion.velocity_rad_s),
            acceleration_rad_s2: within(acceleration, motion.acceleration_rad_s2),
            jerk_rad_s3: within(jerk, motion.jerk_rad_s3),
        };
    }
    stretch
}

#[expect(clippy::cast_precision_loss, reason = "at most some thousand cells")]
fn to_f64(count: usize) -> f64 {
    count as f64
}

/// A motion's table, and after its cut that of the motion that follows.
#[derive(Clone, Copy, Debug)]
pub struct PeaksAhead<'a> {
    table: Table<'a>,
    then: Option<(f64, Table<'a>)>,
}

/// The cells of a motion.
#[derive(Clone, Copy, Debug)]
struct Table<'a> {
    cells: &'a [Stretch],
    begin_s: f64,
    cells_a_second: f64,
}

impl<'a> PeaksAhead<'a> {
    /// The table of a motion that runs during [`span_s`].
    #[must_use]
    pub fn new(cells: &'a [Stretch], span_s: [f64; 2]) -> Self {
        Self { table: Table::new(cells, span_s), then: None }
    }

    /// The same up to `from_s`, and the table of another motion, on the same time axis, from there on.
    #[must_use]
    pub fn then(self, from_s: f64, cells: &'a [Stretch], span_s: [f64; 2]) -> Self {
        Self { then: Some((from_s, Table::new(cells, span_s))), ..self }
    }

    /// Writes what so many joints do between two instants of the motion, the earlier first; rest after its end.
    ///
    /// Real time: looks at each cell between them once, at most [`CELLS_MAX`] of each motion.
    pub fn between(&self, [from_s, to_s]: [f64; 2], joints: usize, stretch: &mut Stretch) {
        let cut_s = self.then.map_or(f64::INFINITY, |(cut_s, ..)| cut_s);
        let mut rests = true;
        if from_s < cut_s || self.then.is_none() {
            rests &= !self.table.join([from_s, to_s.min(cut_s)], (joints, rests), stretch);
        }
        if let Some((cut_s, table)) = self.then
            && to_s >= cut_s
        {
            rests &= !table.join([from_s.max(cut_s), to_s], (joints, rests), stretch);
        }
        if rests {
            stretch.iter_mut().zip(AT_REST).take(joints).for_each(|(ranges, rest)| *ranges = rest);
        }
    }
}

impl<'a> Table<'a> {
    fn new(cells: &'a [Stretch], [begin_s, end_s]: [f64; 2]) -> Self {
        let cells_a_second = if end_s > begin_s { to_f64(cells.len()) / (end_s - begin_s) } else { 0.0 };
        Self { cells, begin_s, cells_a_second }
    }

    /// Joins the cells between two instants with the stretch, or begins it with the first of them; whether there are any.
    /// Beyond the last cell the motion rests.
    fn join(&self, [from_s, to_s]: [f64; 2], (joints, begins): (usize, bool), stretch: &mut Stretch) -> bool {
        // The cell in which an instant lies. A time before the first cell, or NaN, counts as in it.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates at both ends")]
        let index = |s: f64| (((s - self.begin_s) * self.cells_a_second) as usize).min(self.cells.len());
        let (first, last) = (index(from_s), index(to_s));
        let mut cells = self.cells.get(first..).unwrap_or(&[]).iter().take((last + 1).saturating_sub(first));
        let Some(cell) = cells.next() else { return false };
        if begins {
            for (ranges, other) in stretch.iter_mut().zip(cell).take(joints) {
                *ranges = *other;
            }
        } else {
            join(stretch, cell, joints);
        }
        cells.for_each(|cell| join(stretch, cell, joints));
        true
    }
}
