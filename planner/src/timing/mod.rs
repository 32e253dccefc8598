//! From a path to Tau-J* strokes inside the motion limits.
//!
//! A straight move is a train of strokes of one kernel ([`train`]): at most 64 strokes and 1.12 times the jerk-limited optimum.
//! A path that stops at its corners is a move after the other ([`Path::stopping`]). A path whose corners may be cut is one
//! train for all joints, fitted to the limits inside a tube around the path ([`Path::rounded`]): new geometry, which has to
//! be verified. Scaling all times by c scales velocity, acceleration and jerk by 1/c, 1/c^2, 1/c^3 and leaves the geometry,
//! so every shape is made to fit the limits exactly.
pub mod fit;
mod law;
pub mod line;
pub mod onward;
mod rough;
mod scale;
#[cfg(test)]
mod tests;
pub mod train;
mod tube;

pub(crate) use scale::{scale_to_fit, used};

use line::LineLimits;
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory};
use train::Train;

/// Share of the limits that is left unused, so that rounding never decides.
pub(crate) const SLACK: f64 = 1e-3;
/// Exponent of a stroke that moves nothing.
const STILL_EXPONENT: u32 = 5;

/// A path and what it may use.
pub struct Path<'a> {
    /// Corners, both ends included; neighbours differ.
    pub corners_rad: &'a [JointArray],
    /// How many joints the arm has.
    pub joints: usize,
    /// Limits of each joint.
    pub limits: &'a [JointLimits; MAX_JOINTS],
}

/// A timed path.
#[derive(Clone, Debug)]
pub struct Timed {
    /// The motion.
    pub trajectory: Trajectory,
    /// How far from the path it is at most, as the length of the difference of all joints.
    pub deviation_rad: f64,
}

/// A path that goes nowhere still takes one stroke, so that every reader sees a motion with an end.
#[must_use]
pub fn stand_still(joints: usize, pose_rad: &JointArray) -> Option<Trajectory> {
    Trajectory::new(joints, *pose_rad, &[still_stroke()]).ok()
}

fn still_stroke() -> Stroke {
    Stroke { start_s: 0.0, duration_s: DURATION_S_MIN, n: STILL_EXPONENT, delta_rad: [0.0; MAX_JOINTS] }
}

/// Length of the difference of two poses.
pub(crate) fn distance(a: &JointArray, b: &JointArray) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

impl Path<'_> {
    /// The motion that stops at every corner, each segment as fast as its limits allow; `None` when there is none.
    #[must_use]
    pub fn stopping(&self) -> Option<Timed> {
        let segments: Vec<[&JointArray; 2]> = self
            .corners_rad
            .windows(2)
            .filter_map(|pair| if let [from, to] = pair { Some([from, to]) } else { None })
            .filter(|[from, to]| distance(from, to) > 0.0)
            .collect();
        let strokes_max = MAX_STROKES / segments.len().max(1);
        let (mut strokes, mut start_s) = (Vec::new(), 0.0);
        for [from, to] in segments {
            let limits = LineLimits::between(from, to, (self.joints, self.limits))?;
            let train = Train::new(&limits, strokes_max)?;
            train.append(&mut strokes, start_s, [from, to]);
            start_s += train.duration_s();
        }
        if strokes.is_empty() {
            strokes.push(still_stroke());
        }
        let base_rad = self.corners_rad.first()?;
        let trajectory = Trajectory::new(self.joints, *base_rad, &strokes).ok()?;
        Some(Timed { trajectory, deviation_rad: 0.0 })
    }

    /// The motion that rounds each inner corner and stays within its distance of the path; `None` when there is none, or one that has to be
    /// so slow that a stop is better, or none that is expected in less than `most_s`.
    #[must_use]
    pub fn rounded(&self, deviations_rad: &[f64], most_s: f64) -> Option<Timed> {
        let inner = self.corners_rad.len().checked_sub(2)?;
        let is_usable = |deviation_rad: &f64| deviation_rad.is_finite() && *deviation_rad > 0.0;
        if inner == 0 || deviations_rad.len() != inner || !deviations_rad.iter().all(is_usable) {
            return None;
        }
        let rounded = tube::through(self, deviations_rad, most_s)?;
        let trajectory = Trajectory::new(self.joints, *self.corners_rad.first()?, &rounded.strokes).ok()?;
        Some(Timed { trajectory, deviation_rad: rounded.deviation_rad })
    }
}

impl Timed {
    /// The same motion, slower by a factor.
    #[must_use]
    pub fn slower(&self, factor: f64) -> Option<Self> {
        let slower =
            |s: &Stroke| Stroke { start_s: s.start_s * factor, duration_s: s.duration_s * factor, ..*s };
        let strokes: Vec<Stroke> = self.trajectory.strokes().iter().map(slower).collect();
        let (joints, base_rad) = (self.trajectory.joints(), *self.trajectory.base_rad());
        let trajectory = Trajectory::new(joints, base_rad, &strokes).ok()?;
        Some(Self { trajectory, deviation_rad: self.deviation_rad })
    }
}
