//! The motion that is imported, as it was before: rows of a table, or a profile through way points.
use super::ImportError;
use super::profiles::ViaProfile;
use super::rows::Rows;
use crate::timing::used;
use taustream_arm::MotionTable;
use taustream_motion::peaks::PeakConstants;
use taustream_motion::profile::Profile;
use taustream_motion::spline::{CubicSpline, Ends};
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS};
use taustream_optimizers::papers::spline::Spline;

/// A motion of all joints from time 0 on.
pub struct Reference {
    joints: usize,
    duration_s: f64,
    shape: ReferenceShape,
}

enum ReferenceShape {
    /// A curve through rows.
    Rows(Rows),
    /// One scalar profile from point to point, at rest at each.
    Stops { t_s: Vec<f64>, points_rad: Vec<JointArray>, profile: Box<dyn Profile> },
    /// A cubic spline a joint.
    Cubic { t_s: Vec<f64>, splines: Vec<CubicSpline> },
    /// One curve for all joints.
    Seventh(Spline),
}

/// Way points, and how to go through them.
#[derive(Clone, Copy, Debug)]
pub struct Via<'a> {
    /// The points.
    pub points_rad: &'a [JointArray],
    /// How many joints the arm has.
    pub joints: usize,
    /// The profile.
    pub profile: ViaProfile,
    /// How long each piece takes (s), one fewer than points.
    pub durations_s: &'a [f64],
}

impl Reference {
    /// The motion of a table, without the rest at its end: through its rows, by its own velocities and accelerations where it
    /// has them, and inside of `limits` where its rows are.
    ///
    /// # Errors
    /// When nothing moves in it.
    pub fn of_table(table: MotionTable, limits: &[JointLimits; MAX_JOINTS]) -> Result<Self, ImportError> {
        let joints = table.joints;
        let rows = Rows::of(table, limits)?;
        let duration_s = rows.t_s.last().copied().unwrap_or(0.0);
        Ok(Self { joints, duration_s, shape: ReferenceShape::Rows(rows) })
    }

    /// What is worth saying about how the table was read.
    #[must_use]
    pub fn note(&self) -> Option<&str> {
        match &self.shape {
            ReferenceShape::Rows(rows) => rows.note.as_deref(),
            ReferenceShape::Stops { .. } | ReferenceShape::Cubic { .. } | ReferenceShape::Seventh(_) => None,
        }
    }

    /// A profile through way points.
    ///
    /// # Errors
    /// Points and durations that do not fit each other, are too many, or go nowhere.
    pub fn through(via: &Via) -> Result<Self, ImportError> {
        let Via { points_rad, joints, profile, durations_s } = *via;
        if points_rad.windows(2).all(|pair| pair.first() == pair.last()) {
            return Err(ImportError::Still);
        }
        let mut t_s = vec![0.0];
        for (piece, duration_s) in durations_s.iter().enumerate() {
            if !(*duration_s >= DURATION_S_MIN && duration_s.is_finite()) {
                return Err(ImportError::Duration { piece, duration_s: *duration_s });
            }
            t_s.push(t_s.last().copied().unwrap_or(0.0) + duration_s);
        }
        if t_s.len() != points_rad.len() {
            return Err(ImportError::Durations { got: durations_s.len(), points: points_rad.len() });
        }
        let shape = match profile.scalar()? {
            Some(profile) => {
                ReferenceShape::Stops { t_s: t_s.clone(), points_rad: points_rad.to_vec(), profile }
            }
            None if profile == ViaProfile::BSpline7 => {
                let points: Vec<Vec<f64>> = points_rad.iter().map(|p| p[..joints].to_vec()).collect();
                ReferenceShape::Seventh(Spline::through(&points, durations_s)?)
            }
            None => {
                let ends = if profile == ViaProfile::NotAKnot { Ends::NotAKnot } else { Ends::Clamped };
                let spline = |joint: usize| {
                    let knots: Vec<(f64, f64)> =
                        t_s.iter().zip(points_rad).map(|(t, p)| (*t, p[joint])).collect();
                    CubicSpline::new(&knots, ends)
                };
                let splines = (0..joints).map(spline).collect::<Result<_, _>>()?;
                ReferenceShape::Cubic { t_s: t_s.clone(), splines }
            }
        };
        Ok(Self { joints, duration_s: t_s.last().copied().unwrap_or(0.0), shape })
    }

    /// How many joints it moves.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// When it ends.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where all joints are; at rest before and after.
    #[must_use]
    pub fn at(&self, time_s: f64) -> JointArray {
        let time_s = time_s.clamp(0.0, self.duration_s);
        match &self.shape {
            ReferenceShape::Rows(rows) => rows.at(self.joints, time_s),
            ReferenceShape::Stops { t_s, points_rad, profile } => {
                between(t_s, points_rad, time_s, |share| profile.at(share).value)
            }
            ReferenceShape::Cubic { splines, .. } => {
                let mut position_rad = [0.0; MAX_JOINTS];
                for (slot, spline) in position_rad.iter_mut().zip(splines) {
                    *slot = spline.sample(time_s).value;
                }
                position_rad
            }
            ReferenceShape::Seventh(spline) => {
                std::array::from_fn(|joint| spline.at(joint, time_s, 0).unwrap_or(0.0))
            }
        }
    }

    /// When its pieces join, both ends included: between two of these times it has a second derivative.
    #[must_use]
    pub fn joins_s(&self) -> Vec<f64> {
        match &self.shape {
            ReferenceShape::Rows(Rows { t_s, .. })
            | ReferenceShape::Stops { t_s, .. }
            | ReferenceShape::Cubic { t_s, .. } => t_s.clone(),
            ReferenceShape::Seventh(spline) => spline.joins_s(),
        }
    }

    /// The times between which something moves, and the time in which something does (s).
    #[must_use]
    pub fn moving_s(&self) -> f64 {
        match &self.shape {
            ReferenceShape::Rows(rows) => rows.moving_s(),
            ReferenceShape::Stops { t_s, points_rad: points, .. } => {
                let pieces = t_s.windows(2).zip(points.windows(2));
                let moves = pieces.filter(|(_, points)| points.first() != points.last());
                moves.map(|(t, _)| if let [a, b] = t { b - a } else { 0.0 }).sum()
            }
            ReferenceShape::Cubic { .. } | ReferenceShape::Seventh(_) => self.duration_s,
        }
    }

    /// A bound of each joint's |second derivative| between joins.
    #[must_use]
    pub fn bend_rad_s2(&self) -> JointArray {
        match &self.shape {
            ReferenceShape::Rows(rows) => rows.bend_rad_s2(self.joints),
            ReferenceShape::Stops { t_s, points_rad, profile } => {
                let c_a = profile.peaks().c_a;
                let mut bend = [0.0; MAX_JOINTS];
                for (t, points) in t_s.windows(2).zip(points_rad.windows(2)) {
                    let ([t0, t1], [from, to]) = (t, points) else { continue };
                    for (bend, (from, to)) in bend.iter_mut().zip(from.iter().zip(to)) {
                        *bend = f64::max(*bend, c_a * (to - from).abs() / ((t1 - t0) * (t1 - t0)));
                    }
                }
                bend
            }
            ReferenceShape::Cubic { splines, .. } => {
                std::array::from_fn(|joint| splines.get(joint).map_or(0.0, CubicSpline::bend_max))
            }
            ReferenceShape::Seventh(spline) => std::array::from_fn(|joint| spline.bound(joint, 2)),
        }
    }

    /// Velocity at its two ends, from inside (rad/s).
    #[must_use]
    pub fn end_speeds_rad_s(&self) -> [JointArray; 2] {
        match &self.shape {
            ReferenceShape::Stops { .. } | ReferenceShape::Seventh(_) => [[0.0; MAX_JOINTS]; 2],
            ReferenceShape::Cubic { splines, .. } => [0.0, self.duration_s]
                .map(|t| std::array::from_fn(|j| splines.get(j).map_or(0.0, |s| s.sample(t).d1))),
            ReferenceShape::Rows(rows) => rows.end_speeds_rad_s(),
        }
    }

    /// Rows between which a joint goes faster than `times` its motion limit and farther than `tolerance_rad`: the first
    /// one's time, joint, way and speed.
    #[must_use]
    pub fn first_jump(
        &self,
        limits: &[JointLimits; MAX_JOINTS],
        times: f64,
        tolerance_rad: f64,
    ) -> Option<(f64, usize, f64, f64)> {
        let ReferenceShape::Rows(Rows { t_s, position_rad, .. }) = &self.shape else { return None };
        for (t, rows) in t_s.windows(2).zip(position_rad.windows(2)) {
            let ([t0, t1], [from, to]) = (t, rows) else { continue };
            for (joint, limits) in limits.iter().enumerate().take(self.joints) {
                let by_rad = to[joint] - from[joint];
                let speed = by_rad.abs() / (t1 - t0);
                if by_rad.abs() > tolerance_rad && speed > times * limits.motion.velocity_rad_s {
                    return Some((*t1, joint, by_rad, speed));
                }
            }
        }
        None
    }
}

/// What a scalar profile makes of the two points whose times enclose one.
fn between(t_s: &[f64], points_rad: &[JointArray], time_s: f64, profile: impl Fn(f64) -> f64) -> JointArray {
    let behind = t_s.partition_point(|t| *t <= time_s).clamp(1, t_s.len().saturating_sub(1).max(1));
    let (Some([t0, t1]), Some([from, to])) =
        (t_s.get(behind - 1..=behind), points_rad.get(behind - 1..=behind))
    else {
        return points_rad.first().copied().unwrap_or_default();
    };
    let share = profile(((time_s - t0) / (t1 - t0)).clamp(0.0, 1.0));
    // Its ends are met to the last bit.
    if share >= 1.0 {
        *to
    } else {
        std::array::from_fn(|joint| from[joint] + (to[joint] - from[joint]) * share)
    }
}

/// The shortest durations with which a profile through points keeps the motion limits: piece by piece for profiles that
/// rest at every point, and for splines those of quintic pieces, all scaled by one factor.
///
/// # Errors
/// Points that have no such profile.
pub fn fitted_durations_s(
    points_rad: &[JointArray],
    joints: usize,
    profile: ViaProfile,
    limits: &[JointLimits; MAX_JOINTS],
) -> Result<Vec<f64>, ImportError> {
    let scalar = profile.scalar()?;
    let peaks = scalar.as_ref().map_or_else(|| taustream_motion::profile::Quintic.peaks(), |p| p.peaks());
    let pieces = points_rad.windows(2).map(|pair| {
        if let [from, to] = pair { piece_s(from, to, joints, limits, &peaks) } else { DURATION_S_MIN }
    });
    let mut durations_s: Vec<f64> = pieces.collect();
    if scalar.is_some() {
        return Ok(durations_s);
    }
    // A spline has no use for pieces of nearly no time: a point given twice is passed in a tenth of a mean piece.
    let mean_s = durations_s.iter().sum::<f64>() / durations_s.len().max(1) as f64;
    durations_s.iter_mut().for_each(|s| *s = s.max(0.1 * mean_s).max(DURATION_S_MIN));
    let via = Via { points_rad, joints, profile, durations_s: &durations_s };
    let scale = Reference::through(&via)?.share_of(limits);
    durations_s.iter_mut().for_each(|s| *s = (*s * scale).max(DURATION_S_MIN));
    Ok(durations_s)
}

fn piece_s(
    from: &JointArray,
    to: &JointArray,
    joints: usize,
    limits: &[JointLimits; MAX_JOINTS],
    peaks: &PeakConstants,
) -> f64 {
    let each = from.iter().zip(to).zip(limits).take(joints).map(|((a, b), limits)| {
        let (distance, m) = ((b - a).abs(), &limits.motion);
        let [v, a, j] = [peaks.c_v * distance, peaks.c_a * distance, peaks.c_j * distance];
        used(v, m.velocity_rad_s)
            .max(used(a, m.acceleration_rad_s2).sqrt())
            .max(used(j, m.jerk_rad_s3).cbrt())
    });
    each.fold(DURATION_S_MIN, f64::max)
}

impl Reference {
    /// The factor on all times with which a spline just keeps the motion limits, by its peaks.
    fn share_of(&self, limits: &[JointLimits; MAX_JOINTS]) -> f64 {
        let mut share: f64 = 0.0;
        for (joint, limits) in limits.iter().enumerate().take(self.joints) {
            let [v, a, j] = self.peaks(joint);
            let m = &limits.motion;
            share = share
                .max(used(v, m.velocity_rad_s))
                .max(used(a, m.acceleration_rad_s2).sqrt())
                .max(used(j, m.jerk_rad_s3).cbrt());
        }
        share
    }

    /// Highest |velocity|, |acceleration| and |jerk| of a joint inside of the pieces of a spline.
    #[must_use]
    pub fn peaks(&self, joint: usize) -> [f64; 3] {
        const SAMPLES: u32 = 64;
        match &self.shape {
            ReferenceShape::Rows(_) | ReferenceShape::Stops { .. } => [0.0; 3],
            ReferenceShape::Cubic { splines, .. } => splines.get(joint).map_or([0.0; 3], |spline| {
                let (peaks, d) = (spline.peaks(), self.duration_s);
                [peaks.c_v / d, peaks.c_a / (d * d), peaks.c_j / (d * d * d)]
            }),
            ReferenceShape::Seventh(spline) => {
                let mut peaks = [0.0_f64; 3];
                for piece in spline.joins_s().windows(2) {
                    let [a, b] = piece else { continue };
                    for i in 0..=SAMPLES {
                        let t = a + (b - a) * f64::from(i) / f64::from(SAMPLES);
                        for (order, peak) in peaks.iter_mut().enumerate() {
                            *peak = peak.max(spline.at(joint, t, order + 1).unwrap_or(0.0).abs());
                        }
                    }
                }
                peaks
            }
        }
    }
}
