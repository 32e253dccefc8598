//! From a path to Tau-J* strokes inside the motion limits.
//!
//! Every segment of the path is cut into a train of equal strokes of one duration T, started evenly while a
//! reference runs along the segment at constant speed. The sum is that reference smoothed by the kernel phi' of
//! width T: its velocity is an average of the reference's, its acceleration at a corner about the change of
//! velocity times `c_v / T`. At a corner the reference waits for a share w of T: at w = 1 the arm stops and follows the path
//! exactly, at w = 0 it passes and rounds the corner, which is new geometry. Scaling all times by c scales velocity,
//! acceleration and jerk by 1/c, 1/c^2, 1/c^3 and leaves the geometry, so every shape (T, n, w) is made to fit the
//! limits exactly, and the shortest wins. One stroke a segment (the paper's way) is the limit of large T.
use crate::budget::Budget;
use taustream_motion::stroke::{DURATION_S_MIN, Phi};
use taustream_motion::{JointArray, JointLimits, MAX_JOINTS, MAX_STROKES, Stroke, Trajectory};

/// Share of the limits that is left unused, so that rounding never decides.
pub(crate) const SLACK: f64 = 1e-3;
/// Strokes a kernel: at a coarser spacing the ripple of the sum eats the limits.
const SPACING: f64 = 8.0;
/// Kernel widths that are tried, in units of the arm's natural one ([`natural_kernel_s`]).
const KERNELS: [f64; 11] = [0.2, 0.35, 0.5, 0.65, 0.8, 0.95, 1.15, 1.4, 1.8, 2.4, 3.5];
/// The one of them that is best most often.
const ROUGH_KERNEL: f64 = 0.8;
/// Exponents that are tried: for k = 1/n from 0.12 to 0.24 the durations differ by a few percent only.
const EXPONENTS: [u32; 3] = [5, 6, 8];

/// A path and what it may use.
pub struct Path<'a> {
    /// Corners, both ends included.
    pub corners_rad: &'a [JointArray],
    /// How many joints the arm has.
    pub joints: usize,
    /// Limits of each joint.
    pub limits: &'a [JointLimits; MAX_JOINTS],
}

/// One way to time a path.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Exponent of every stroke.
    pub n: u32,
    /// Duration of every stroke before scaling.
    pub kernel_s: f64,
    /// Share of a kernel that the reference waits at each inner corner.
    pub waits: Vec<f64>,
}

/// A timed path.
#[derive(Clone, Debug)]
pub struct Timed {
    /// The motion.
    pub trajectory: Trajectory,
    /// How it is shaped.
    pub shape: Shape,
}

/// A path that goes nowhere still takes one stroke, so that every reader sees a motion with an end.
#[must_use]
pub fn stand_still(joints: usize, pose_rad: &JointArray) -> Option<Trajectory> {
    let stroke =
        Stroke { start_s: 0.0, duration_s: DURATION_S_MIN, n: EXPONENTS[0], delta_rad: [0.0; MAX_JOINTS] };
    Trajectory::new(joints, *pose_rad, &[stroke]).ok()
}

impl Path<'_> {
    /// The shortest motion with the given waits; `None` when nothing fits (too many strokes, limits of zero, or
    /// the clock).
    #[must_use]
    pub fn fastest(&self, waits: &[f64], budget: &Budget) -> Option<Timed> {
        // A way that is long against the natural kernel takes more strokes than a message holds: the widest kernel
        // with room for them is then as good, as it is still short against the way.
        let natural_s = self.natural_kernel_s().max(self.least_kernel_s()?);
        let mut best: Option<(f64, Shape)> = None;
        let mut try_shape = |kernel: f64, n: u32| {
            let shape = Shape { n, kernel_s: kernel * natural_s, waits: waits.to_vec() };
            let duration_s = self.duration_s(&shape, 32)?;
            if best.as_ref().is_none_or(|(b, _)| duration_s < *b) {
                best = Some((duration_s, shape));
            }
            best.as_ref().map(|(_, s)| (s.kernel_s / natural_s, s.n))
        };
        let mut top = None;
        for kernel in KERNELS {
            if budget.is_over() {
                break;
            }
            top = try_shape(kernel, EXPONENTS[1]).or(top);
        }
        let (mut kernel, _) = top?;
        for step in [1.12, 1.05, 1.02] {
            for n in EXPONENTS {
                for factor in [1.0 / step, 1.0, step] {
                    if !budget.is_over() {
                        kernel = try_shape(kernel * factor, n).map_or(kernel, |(k, _)| k);
                    }
                }
            }
        }
        let (_, shape) = best?;
        self.fit(&shape)
    }

    /// A motion that stops at no corner, near the limits and quickly made: what [`Self::fastest`] would make of the path,
    /// roughly.
    #[must_use]
    pub fn rough(&self) -> Option<Timed> {
        let natural_s = self.natural_kernel_s().max(self.least_kernel_s()?);
        let waits = vec![0.0; self.corners_rad.len().saturating_sub(2)];
        let shape = Shape { n: EXPONENTS[1], kernel_s: ROUGH_KERNEL * natural_s, waits };
        let strokes = self.strokes(&shape)?;
        let scale = scale_to_fit(&strokes, self.joints, self.limits, shape.kernel_s / 16.0);
        self.scaled(&strokes, &shape, scale)
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

    /// The strokes of a shape, not scaled yet; `None` when there are too many or a number is not finite.
    fn strokes(&self, shape: &Shape) -> Option<Vec<Stroke>> {
        let kernel_s = shape.kernel_s;
        let mut strokes = Vec::new();
        let mut start_s = 0.0;
        for (i, corners) in self.corners_rad.windows(2).enumerate() {
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
                    n: shape.n,
                    delta_rad,
                });
                k += 1.0;
            }
            let wait = shape.waits.get(i).copied().unwrap_or(1.0);
            start_s += cruise_s - step_s + step_s * (1.0 - wait) + kernel_s * wait;
        }
        Some(strokes)
    }

    /// Duration after scaling to the limits, from peaks sampled at `samples` instants a kernel.
    fn duration_s(&self, shape: &Shape, samples: u32) -> Option<f64> {
        let strokes = self.strokes(shape)?;
        let end_s = strokes.last()?.end_s();
        let scale = scale_to_fit(&strokes, self.joints, self.limits, shape.kernel_s / f64::from(samples));
        Some(end_s * scale).filter(|s| s.is_finite() && *s > 0.0)
    }

    /// The motion of a shape, scaled to the limits less the slack.
    #[must_use]
    pub fn fit(&self, shape: &Shape) -> Option<Timed> {
        let strokes = self.strokes(shape)?;
        // Fine enough that the peaks between samples stay far inside the slack.
        let scale = scale_to_fit(&strokes, self.joints, self.limits, shape.kernel_s / 256.0) * (1.0 + SLACK);
        self.scaled(&strokes, shape, scale)
    }

    /// The same motion, slower by a factor.
    #[must_use]
    pub fn slower(&self, timed: &Timed, factor: f64) -> Option<Timed> {
        self.scaled(timed.trajectory.strokes(), &timed.shape, factor)
    }

    fn scaled(&self, strokes: &[Stroke], shape: &Shape, scale: f64) -> Option<Timed> {
        // A stroke has a least duration; scaling up to it only makes the motion slower.
        let shortest_s = strokes.iter().map(|s| s.duration_s).fold(f64::INFINITY, f64::min);
        let scale = scale.max(DURATION_S_MIN / shortest_s);
        let mut scaled: Vec<Stroke> = strokes.to_vec();
        for stroke in &mut scaled {
            stroke.start_s *= scale;
            stroke.duration_s *= scale;
        }
        let base_rad = self.corners_rad.first()?;
        let trajectory = Trajectory::new(self.joints, *base_rad, &scaled).ok()?;
        Some(Timed { trajectory, shape: shape.clone() })
    }
}

/// Factor on all times after which peaks, sampled every so often while something runs, fit the motion limits.
pub(crate) fn scale_to_fit(
    strokes: &[Stroke],
    joints: usize,
    limits: &[JointLimits; MAX_JOINTS],
    every_s: f64,
) -> f64 {
    let end_s = strokes.last().map_or(0.0, Stroke::end_s);
    let mut scale: f64 = 0.0;
    let (mut first, mut t_s) = (0, every_s * 0.5);
    while t_s < end_s {
        while strokes.get(first).is_some_and(|s| s.has_ended(t_s)) {
            first += 1;
        }
        if let Some(next) = strokes.get(first).filter(|next| next.start_s >= t_s) {
            // Nothing runs: a long rest costs nothing.
            t_s = next.start_s + every_s * 0.5;
        }
        let (mut v, mut a, mut j) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for stroke in strokes.iter().skip(first).take_while(|s| s.start_s < t_s) {
            let (phi, rate) = (stroke.phi(t_s), 1.0 / stroke.duration_s);
            let (d1, d2, d3) = scaled(&phi, rate);
            for (i, delta) in stroke.delta_rad.iter().enumerate().take(joints) {
                v[i] += delta * d1;
                a[i] += delta * d2;
                j[i] += delta * d3;
            }
        }
        for (i, limits) in limits.iter().enumerate().take(joints) {
            let m = limits.motion;
            scale = scale
                .max(used(v[i], m.velocity_rad_s))
                .max(used(a[i], m.acceleration_rad_s2).sqrt())
                .max(used(j[i], m.jerk_rad_s3).cbrt());
        }
        t_s += every_s;
    }
    scale
}

fn scaled(phi: &Phi, rate: f64) -> (f64, f64, f64) {
    (phi.d1 * rate, phi.d2 * rate * rate, phi.d3 * rate * rate * rate)
}

/// Share of a limit that is used; something over nothing is infinite, nothing over nothing is nothing.
pub(crate) fn used(value: f64, limit: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.abs() / limit }
}
