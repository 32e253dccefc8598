//! A curve through the rows of a table: Hermite pieces, by the table's own velocities and accelerations where it has them.
//!
//! Without them the slopes are those of the cubic spline through the rows, held back where it would swing: between rows of one
//! value nothing moves, a rise stays a rise (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980, by Hyman's bound), and no
//! piece leaves the joint's range where its rows do not.
use super::ImportError;
use taustream_arm::MotionTable;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS};

/// Times the velocities of a table may differ from what its rows do, of the way from row to row; beyond this they are of
/// another unit or another joint.
const SHARE_MAX: f64 = 0.25;
/// The same where next to nothing moves (rad).
const SLIP_RAD: f64 = 1e-3;

/// Rows, and what holds at each of them.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub(super) t_s: Vec<f64>,
    pub(super) position_rad: Vec<JointArray>,
    slope_rad_s: Vec<JointArray>,
    acceleration_rad_s2: Option<Vec<JointArray>>,
    /// Why columns of the table are not used.
    pub(super) note: Option<String>,
}

/// The end of a piece: position and derivatives.
type End = [f64; 3];

impl Rows {
    pub(super) fn of(table: MotionTable, limits: &[JointLimits; MAX_JOINTS]) -> Result<Self, ImportError> {
        let MotionTable { joints, mut t_s, mut position_rad, velocity_rad_s, acceleration_rad_s2, .. } =
            table;
        while let [.., before, last] = position_rad.as_slice()
            && before.map(f64::to_bits) == last.map(f64::to_bits)
        {
            position_rad.pop();
            t_s.pop();
        }
        if position_rad.len() < 2 {
            return Err(ImportError::Still);
        }
        let rows = position_rad.len();
        let cut = |columns: Option<Vec<JointArray>>| {
            columns.map(|mut columns| {
                columns.truncate(rows);
                columns
            })
        };
        let (velocity, acceleration) = (cut(velocity_rad_s), cut(acceleration_rad_s2));
        let mut curve =
            Self { t_s, position_rad, slope_rad_s: Vec::new(), acceleration_rad_s2: None, note: None };
        if let Some(velocity) = velocity {
            curve.note = curve.misfit(&velocity, acceleration.as_deref(), joints);
            if curve.note.is_none() {
                (curve.slope_rad_s, curve.acceleration_rad_s2) = (velocity, acceleration);
                return Ok(curve);
            }
        }
        curve.slope_rad_s = vec![[0.0; MAX_JOINTS]; rows];
        for (joint, limits) in limits.iter().enumerate().take(joints) {
            for (row, slope) in curve.slopes(joint, limits.position_rad).into_iter().enumerate() {
                if let Some(slot) = curve.slope_rad_s.get_mut(row).and_then(|row| row.get_mut(joint)) {
                    *slot = slope;
                }
            }
        }
        Ok(curve)
    }

    /// The first row that velocities do not lead to, in words.
    fn misfit(
        &self,
        velocity: &[JointArray],
        acceleration: Option<&[JointArray]>,
        joints: usize,
    ) -> Option<String> {
        let at = |columns: &[JointArray], row: usize, joint: usize| {
            columns.get(row).and_then(|row| row.get(joint)).copied().unwrap_or(f64::NAN)
        };
        for (row, pair) in self.t_s.windows(2).enumerate() {
            let [t0, t1] = pair else { continue };
            let h = t1 - t0;
            for joint in 0..joints {
                let by_rad = at(&self.position_rad, row + 1, joint) - at(&self.position_rad, row, joint);
                let (v0, v1) = (at(velocity, row, joint), at(velocity, row + 1, joint));
                let bend =
                    acceleration.map_or(0.0, |a| (at(a, row, joint) - at(a, row + 1, joint)) * h * h / 12.0);
                let led_rad = (v0 + v1) * h / 2.0 + bend;
                let way_rad = by_rad.abs().max(h * v0.abs().max(v1.abs()));
                if (led_rad - by_rad).abs() > SHARE_MAX * way_rad + SLIP_RAD || led_rad.is_nan() {
                    return Some(format!(
                        "columns of velocity and acceleration are not used: joint {} moves by {by_rad:.6} rad before \
                         t = {t1:.6} s, and they make it {led_rad:.6} rad",
                        joint + 1
                    ));
                }
            }
        }
        None
    }

    /// Length and slope of the chord behind a row.
    fn chord(&self, row: usize, joint: usize) -> (f64, f64) {
        let (Some([t0, t1]), Some([from, to])) =
            (self.t_s.get(row..row + 2), self.position_rad.get(row..row + 2))
        else {
            return (1.0, 0.0);
        };
        (t1 - t0, (to[joint] - from[joint]) / (t1 - t0))
    }

    /// Slopes of one joint at every row.
    fn slopes(&self, joint: usize, range_rad: [f64; 2]) -> Vec<f64> {
        let last = self.t_s.len() - 1;
        let chords: Vec<(f64, f64)> = (0..last).map(|row| self.chord(row, joint)).collect();
        let mut slopes = spline_slopes(&chords);
        for (row, slope) in slopes.iter_mut().enumerate() {
            let before = row.checked_sub(1).and_then(|row| chords.get(row)).copied();
            let after = chords.get(row).copied();
            let at_rad = self.position_rad.get(row).map_or(0.0, |row| row[joint]);
            *slope = held_back(*slope, (before, after), at_rad, range_rad);
        }
        slopes
    }

    fn end(&self, row: usize, joint: usize) -> End {
        let of = |columns: &[JointArray]| columns.get(row).map_or(0.0, |row| row[joint]);
        [of(&self.position_rad), of(&self.slope_rad_s), self.acceleration_rad_s2.as_deref().map_or(0.0, of)]
    }

    /// The piece's Bezier points; cubic pieces use the first four.
    fn points(&self, row: usize, joint: usize) -> ([f64; 6], usize) {
        let (h, _) = self.chord(row, joint);
        let ([p0, v0, a0], [p1, v1, a1]) = (self.end(row, joint), self.end(row + 1, joint));
        if self.acceleration_rad_s2.is_some() {
            let (b1, b4) = (p0 + h * v0 / 5.0, p1 - h * v1 / 5.0);
            let b2 = p0 + 2.0 * h * v0 / 5.0 + h * h * a0 / 20.0;
            let b3 = p1 - 2.0 * h * v1 / 5.0 + h * h * a1 / 20.0;
            ([p0, b1, b2, b3, b4, p1], 6)
        } else {
            ([p0, p0 + h * v0 / 3.0, p1 - h * v1 / 3.0, p1, 0.0, 0.0], 4)
        }
    }

    /// Where all joints are.
    pub(super) fn at(&self, joints: usize, time_s: f64) -> JointArray {
        let last = self.t_s.len().saturating_sub(2);
        let row = self.t_s.partition_point(|t| *t <= time_s).saturating_sub(1).min(last);
        let (h, _) = self.chord(row, 0);
        let share = ((time_s - self.t_s.get(row).copied().unwrap_or(0.0)) / h).clamp(0.0, 1.0);
        let mut position_rad = [0.0; MAX_JOINTS];
        for (joint, slot) in position_rad.iter_mut().enumerate().take(joints) {
            // Rows are met to the last bit.
            *slot = if share >= 1.0 {
                self.end(row + 1, joint)[0]
            } else {
                let (mut points, mut count) = self.points(row, joint);
                while count > 1 {
                    count -= 1;
                    for i in 0..count {
                        points[i] += (points[i + 1] - points[i]) * share;
                    }
                }
                points[0]
            };
        }
        position_rad
    }

    /// A bound of each joint's |second derivative| inside of the pieces.
    pub(super) fn bend_rad_s2(&self, joints: usize) -> JointArray {
        let mut bend = [0.0; MAX_JOINTS];
        for row in 0..self.t_s.len().saturating_sub(1) {
            for (joint, slot) in bend.iter_mut().enumerate().take(joints) {
                let ((points, count), (h, _)) = (self.points(row, joint), self.chord(row, joint));
                let factor = if count == 6 { 20.0 } else { 6.0 } / (h * h);
                for window in points[..count].windows(3) {
                    let [a, b, c] = window else { continue };
                    *slot = f64::max(*slot, (factor * (a - 2.0 * b + c)).abs());
                }
            }
        }
        bend
    }

    /// The time in which something moves (s).
    pub(super) fn moving_s(&self) -> f64 {
        let rows = 0..self.t_s.len().saturating_sub(1);
        let moved = |from: f64, to: f64| (from - to).abs() > 0.0;
        let moves = |row: &usize| {
            (0..MAX_JOINTS).any(|joint| {
                self.end(*row, joint)
                    .into_iter()
                    .zip(self.end(row + 1, joint))
                    .any(|(from, to)| moved(from, to))
            })
        };
        rows.filter(moves).map(|row| self.chord(row, 0).0).sum()
    }

    /// Velocities at its two ends (rad/s).
    pub(super) fn end_speeds_rad_s(&self) -> [JointArray; 2] {
        [self.slope_rad_s.first(), self.slope_rad_s.last()]
            .map(|row| row.copied().unwrap_or([0.0; MAX_JOINTS]))
    }
}

/// Slopes of the cubic spline over chords (length, slope): one tridiagonal system, diagonally dominant.
fn spline_slopes(chords: &[(f64, f64)]) -> Vec<f64> {
    let last = chords.len();
    let one_sided = |near: Option<&(f64, f64)>, far: Option<&(f64, f64)>| match (near, far) {
        (Some((h0, d0)), Some((h1, d1))) => d0 + (d0 - d1) * h0 / (h0 + h1),
        (Some((_, d0)), None) => *d0,
        (None, _) => 0.0,
    };
    let mut slopes = vec![0.0; last + 1];
    let mut upper = vec![0.0; last + 1];
    slopes[0] = one_sided(chords.first(), chords.get(1));
    for (row, pair) in chords.windows(2).enumerate() {
        let [(h0, d0), (h1, d1)] = pair else { continue };
        let below = slopes[row];
        let pivot = 2.0 * (h0 + h1) - h1 * upper[row];
        upper[row + 1] = h0 / pivot;
        slopes[row + 1] = (3.0 * (h1 * d0 + h0 * d1) - h1 * below) / pivot;
    }
    slopes[last] = one_sided(chords.last(), last.checked_sub(2).and_then(|row| chords.get(row)));
    for row in (1..last).rev() {
        slopes[row] -= upper[row] * slopes[row + 1];
    }
    slopes
}

/// Length and slope of a chord.
type Chord = (f64, f64);

/// The slope at a row, held back by the chords on both sides of it.
fn held_back(
    slope: f64,
    (before, after): (Option<Chord>, Option<Chord>),
    at_rad: f64,
    [low_rad, high_rad]: [f64; 2],
) -> f64 {
    let (d0, d1) = match (before, after) {
        (Some((_, d0)), Some((_, d1))) => (d0, d1),
        (Some((_, d)), None) | (None, Some((_, d))) => (d, d),
        (None, None) => return 0.0,
    };
    let least = d0.abs().min(d1.abs());
    if d0 * d1 > 0.0 {
        return if slope * d0 > 0.0 { slope.clamp(-3.0 * least, 3.0 * least) } else { 0.0 };
    }
    // The row is the highest or lowest of three: the curve may turn a little beside it.
    let slope = slope.clamp(-least, least);
    let length = before.map_or(0.0, |(h, _)| h).max(after.map_or(0.0, |(h, _)| h));
    let beyond_rad = slope.abs() * length * 4.0 / 27.0;
    let inside = at_rad - beyond_rad >= low_rad && at_rad + beyond_rad <= high_rad;
    if inside { slope } else { 0.0 }
}
