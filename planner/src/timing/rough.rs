//! A motion along a path at constant speed, smoothed by one kernel: quickly made, for comparing many paths.
//!
//! Every segment is a train of equal strokes of one duration, started evenly while a reference runs along it at the full speed of
//! its slowest joint. The sum is that reference averaged over the kernel, scaled to the limits.
use super::Path;
use super::scale::scale_to_fit;
use taustream_motion::stroke::DURATION_S_MIN;
use taustream_motion::{JointArray, MAX_STROKES, Stroke, Trajectory};

/// Strokes a kernel: at a coarser spacing the ripple of the sum eats the limits.
const SPACING: f64 = 8.0;
/// Width of the kernel, in units of the arm's natural one: best most often.
const KERNEL: f64 = 0.8;
/// Exponent of the strokes.
const EXPONENT: u32 = 6;
/// Peaks sampled a kernel.
const SAMPLES: f64 = 16.0;

impl Path<'_> {
    /// A motion that stops at no corner, near the limits and quickly made: what [`Path::rounded`] would make of the path,
    /// roughly.
    #[must_use]
    pub fn rough(&self) -> Option<Trajectory> {
        let kernel_s = KERNEL * self.natural_kernel_s().max(self.least_kernel_s()?);
        let mut strokes = self.constant_speed(kernel_s)?;
        let scale = scale_to_fit(&strokes, self.joints, self.limits, kernel_s / SAMPLES);
        // A stroke has a least duration; scaling up to it only makes the motion slower.
        let scale = scale.max(DURATION_S_MIN / kernel_s);
        for stroke in &mut strokes {
            stroke.start_s *= scale;
            stroke.duration_s *= scale;
        }
        Trajectory::new(self.joints, *self.corners_rad.first()?, &strokes).ok()
    }

    /// Kernel that takes a joint from full speed to rest within its limits: the slowest joint's.
    fn natural_kernel_s(&self) -> f64 {
        let joints = self.limits.iter().take(self.joints);
        let each_s = joints.map(|l| {
            let m = l.motion;
            // c_v and c_a of n = 6, rounded up.
            (2.6 * m.velocity_rad_s / m.acceleration_rad_s2)
                .max((13.0 * m.velocity_rad_s / m.jerk_rad_s3).sqrt())
        });
        each_s.filter(|s| s.is_finite()).fold(DURATION_S_MIN, f64::max)
    }

    /// Narrowest kernel with which the whole path takes at most [`MAX_STROKES`] strokes; `None` when a stroke a segment
    /// is too many already. Each segment rounds its count up, by less than one stroke.
    fn least_kernel_s(&self) -> Option<f64> {
        let segments = self.corners_rad.windows(2);
        let room = MAX_STROKES.checked_sub(segments.len()).filter(|room| *room > 0)?;
        let distance_s: f64 = segments.map(|p| if let [a, b] = p { self.cruise_s(a, b) } else { 0.0 }).sum();
        Some(distance_s * SPACING / room as f64)
    }

    /// Time of the reference for a segment at full speed of its slowest joint.
    fn cruise_s(&self, from: &JointArray, to: &JointArray) -> f64 {
        let joints = from.iter().zip(to).zip(self.limits).take(self.joints);
        joints.map(|((a, b), l)| (b - a).abs() / l.motion.velocity_rad_s).fold(0.0, f64::max)
    }

    /// Strokes that follow the reference; `None` when there are too many or a number is not finite.
    fn constant_speed(&self, kernel_s: f64) -> Option<Vec<Stroke>> {
        let mut strokes = Vec::new();
        let mut start_s = 0.0;
        for corners in self.corners_rad.windows(2) {
            let [from, to] = corners else { continue };
            let cruise_s = self.cruise_s(from, to);
            // 0 * infinity is NaN: both ends of the range are refused here.
            let count = (cruise_s * SPACING / kernel_s).ceil().max(1.0);
            let room = (MAX_STROKES - strokes.len()) as f64;
            if !(count.is_finite() && count <= room) {
                return None;
            }
            let step_s = cruise_s / count;
            let delta_rad: JointArray = std::array::from_fn(|j| (to[j] - from[j]) / count);
            let mut k = 0.0;
            while k < count {
                strokes.push(Stroke {
                    start_s: start_s + k * step_s,
                    duration_s: kernel_s,
                    n: EXPONENT,
                    delta_rad,
                });
                k += 1.0;
            }
            start_s += cruise_s;
        }
        Some(strokes)
    }
}
